"""Certificates of a job: the table for the terminal, and the folder of their files and pages."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import Any

from ...base.errors import brief
from ...path.workspaces import PoseRange
from ...proof import Certificate
from ...proof.checker_word import CheckerWord, Outcome, unasked
from ...proof.proven_region import region_of
from .clear_words import refuted_by
from .job_table import Column
from .palette import BAD, GOOD, WARNING
from .proof_page import write_page
from .proof_words import checker_words
from .result_folder import free_name, renewed, write_facts

COLUMNS: tuple[Column, ...] = (
    ("strategy", "left"), ("proven", "left"), ("cells", "right"), ("seconds", "right"), ("largest\nomega", "right"),
    ("largest\nradius", "right"), ("nearest limit\n[rad or m]", "right"), ("least\n|det D_q E|", "right"),
)  # fmt: skip


CHECKED = {Outcome.VERIFIED: GOOD, Outcome.REJECTED: BAD, Outcome.SAMPLED: WARNING, Outcome.NONE: WARNING}
"""The colour of what the checker says."""


def cells(name: str, found: Certificate | str) -> list[str]:
    """The row of one strategy."""
    if isinstance(found, str):
        return [name, "not done", *["-"] * (len(COLUMNS) - 2)]
    proven = "all" if found.whole else "drifts" if found.revisit else "part" if len(found) else "NO"
    if not len(found):
        return [name, proven, "0", f"{found.seconds:.2g}", *["-"] * (len(COLUMNS) - 4)]
    return [
        name, proven, str(len(found)), f"{found.seconds:.2g}", f"{found.findings.omega.max():.2g}",
        f"{found.findings.r.max():.1e}", f"{found.to_limit.min():.3g}", f"{found.determinant:.1e}",
    ]  # fmt: skip


def print_certificates(
    title: str, found: dict[str, Certificate | str], words: dict[str, CheckerWord], console: Any
) -> None:
    """Print the table of a job's certificates, and below it each theorem, with what the checker says of it."""
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(brief(title)), title_justify="left", title_style="bold", header_style="dim")
    for heading, justify in COLUMNS:
        table.add_column(Text(heading), justify=justify, no_wrap=heading != "strategy")
    colors = {"all": GOOD, "part": WARNING, "not done": WARNING, "drifts": BAD, "NO": BAD}
    for name, one in found.items():
        table.add_row(*(Text(brief(cell), style=colors.get(cell, "")) for cell in cells(name, one)))
    console.print(table)
    left = [name for name, one in found.items() if isinstance(one, str)]
    for name, one in found.items():
        text = f"not certified: {one}" if isinstance(one, str) else str(one)
        style = GOOD if isinstance(one, Certificate) and one.whole else WARNING
        console.print(f"  {brief(name)}: {text}", style=style, markup=False, highlight=False)
        if isinstance(one, Certificate) and not one.whole:
            console.print(f"    {one.extent.value}", style=WARNING, markup=False, highlight=False)
            worst = refuted_by(one)
            if worst is not None:
                console.print(f"    refuted: {worst}", style=BAD, markup=False, highlight=False)
        if isinstance(one, Certificate):
            text, style = checker_words(one, words[name]), CHECKED[words[name].outcome]
            console.print(f"    {text}", style=style, markup=False, highlight=False)
    if left:
        rest = "the verdict is on the others" if len(left) < len(found) else "nothing is certified"
        text = f"left out: {brief(', '.join(left))}; {rest}"
        console.print(f"  {text}", style=WARNING, markup=False, highlight=False)


def write_certificates(
    name: str, found: dict[str, Certificate | str], words: dict[str, CheckerWord], out: FilePath, version: str,
    stopped: bool,
) -> list[FilePath]:  # fmt: skip
    """Write NAME-certificate.json and its page for each into `out/<name>`, which is replaced whole, see `renewed`.

    Args:
        words: of the checker; where one is missing, as after Ctrl-C, the page says that it was not run.
        stopped: whether the command was stopped before it came to all strategies, as result.json says.

    Raises:
        ArgumentError: the folder exists and was not written by holokin, or cannot be made. WriteError.
    """
    files: list[str] = []
    facts: dict[str, Any] = {"holokin": version, "stopped": stopped, "strategies": {}}
    with renewed(out, name) as work:
        for label, one in found.items():
            if isinstance(one, str):
                facts["strategies"][label] = {"proven": False, "theorem": one}
                continue
            file, word = one.save(work / free_name(label, "-certificate.json", files)), words.get(label) or unasked(one)
            files += [file.name, write_page(one, file, word).name]
            said = {"proven": one.whole, "theorem": one.theorem, "checker": word.outcome.value}
            facts["strategies"][label] = said
            if (worst := refuted_by(one)) is not None:
                said["refuted"] = {
                    "names": worst.names, "distance": worst.distance, "wanted": worst.wanted, "q": worst.q.tolist(),
                    "pose": worst.pose.tolist(),
                }  # fmt: skip
            if isinstance(one.asked, PoseRange) and not one.whole:
                region = region_of(one)
                said["shares"] = {"proven": region.share, **region.parts.shares}
            if one.revisit is not None:
                moved = [one.revisit.low.tolist(), one.revisit.high.tolist()]
                said["drift"] = dict(zip(("least", "most"), moved, strict=True))
        write_facts(work, facts)
    return [out / name / file for file in files]
