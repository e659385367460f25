"""`holokin certify`: proves leaves of a job."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..version import build
from .export import OneJob
from .outcome import ending, show, show_rich


def certify(
    job: OneJob,
    workspace: Annotated[
        bool, typer.Option("--workspace", help="Over the box of its [workspace], not along its path.")
    ] = False,
    budget: Annotated[int | None, typer.Option(help="Cells that may be examined for each strategy.")] = None,
    check: Annotated[
        float, typer.Option(min=0.0, help="Seconds that the checker may take for each certificate; 0: it is not run.")
    ] = 60.0,
    out: Annotated[Path, typer.Option(help="Folder for the certificates.")] = Path("out"),
) -> None:
    """Prove, for each strategy with leaves of a job, that the joints are one smooth function of the tool pose.

    Writes OUT/<job>-proof/<strategy>-certificate.json, and beside it a page to print, <strategy>-certificate.html.
    With python-flint the checker verifies each certificate, and the page says so. Exits 0 when all of it is proven of
    every strategy with leaves, 1 when not, or when the checker rejects a certificate, 2 on bad input.
    """
    from ..job import certify_job, open_one_job
    from ..output.proof_report import print_certificates, write_certificates
    from ..output.result_folder import check_folder
    from ..proof.checker_word import Outcome, ask_checker

    name, opened, file = open_one_job(job)
    check_folder(out, f"{name}-proof")
    found, words = {}, {}
    try:
        with ending().telling(name) as say:
            for title, one in certify_job(opened, file, workspace=workspace, budget=budget, say=say):
                found[title] = one
                if not isinstance(one, str):
                    say(f"{title}: the checker")
                    words[title] = ask_checker(one, check)
    finally:  # after Ctrl-C those that are done
        files = write_certificates(f"{name}-proof", found, words, out, build()) if found else []
        for written in files:
            show(f"wrote {written}")
    show_rich(lambda console: print_certificates(opened.title, found, words, console))
    proven = [one for one in found.values() if not isinstance(one, str)]
    rejected = any(word.outcome is Outcome.REJECTED for word in words.values())
    raise typer.Exit(0 if proven and all(one.whole for one in proven) and not rejected else 1)
