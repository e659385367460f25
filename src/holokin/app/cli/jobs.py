"""`holokin jobs`: lists the packaged jobs, or what a job file may hold."""

from __future__ import annotations

from typing import Annotated

import typer

from .outcome import show


def jobs(
    kinds: Annotated[
        bool, typer.Option("--kinds", help="List the kinds of strategy that a job file may hold, and their keys.")
    ] = False,
) -> None:
    """List the packaged jobs, or what a job file may hold."""
    from ..job import KINDS, PAPER, keys_of, open_job, packaged_jobs

    if kinds:
        for kind, model in KINDS.items():
            needed, optional = keys_of(model)
            more = f"   may have {', '.join(optional)}" if optional else ""
            show(f"{kind:16} {'needs ' + ', '.join(needed) if needed else ''}{more}".rstrip())
        return
    for name in packaged_jobs():
        show(f"{name:22} {open_job(name)[1].title}")
    show(f"{'paper':22} {', '.join(PAPER)}")
