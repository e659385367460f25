"""The table of a job, for the terminal and the report."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from ..errors import brief
from .job_result import JobResult, StrategyResult
from .palette import BAD, GOOD, HOLONOMIC_TEXT, WARNING
from .words import check_words, joint_unit, speed_warning, ways_words

NOTHING = 1e-18
"""Size [any unit] below which a figure is 0: differences of doubles over 0.01 are at least that."""

Column = tuple[str, Literal["left", "right"]]


def columns(result: JobResult) -> tuple[Column, ...]:
    """Heading, with its unit, and alignment of each column."""
    joints = joint_unit(result.robot)
    task = " or ".join(dict.fromkeys(unit for s in result.strategies for unit in s.cycles.row_units))
    narrow = result.workspace or looked_at(result)
    return (
        ("strategy", "left"),
        ("verdict", "left"),
        (f"drift / cycle\n[{joints}]", "right"),
        (f"two ways\napart [{joints}]" if narrow else f"two ways apart\n[{joints}]", "right"),
        (f"tracking\n[{task}]", "right"),
        ("sigma\nmin", "right"),
        ("speed\n/ MP", "right"),
        ("peak\nspeed", "right"),
        *((("clear.\n[m]", "right"),) if looked_at(result) else ()),
        *((("work-\nspace", "right"),) if result.workspace else ()),
        ("expected", "left"),
    )


def looked_at(result: JobResult) -> bool:
    """Whether distances are known: those that [checks] asks for."""
    return any(np.isfinite(s.metrics["clearance"]) for s in result.strategies)


def row(result: StrategyResult, workspace: bool = False, clearance: bool = False) -> list[str]:
    """The cells of one strategy; with clearance and share of the workspace in a job that has them."""
    f = result.metrics
    covers = f"{f['coverage']:.1%}" if np.isfinite(f["coverage"]) else "-"
    return [
        result.name,
        "holonomic" if result.verdict.holonomic else "NOT holonomic",
        number(f["drift_mean"]),
        number(f["spread"]),
        number(f["tracking"]),
        number(f["sigma"]),
        f"{f['speed']:.3f}" if np.isfinite(f["speed"]) else "-",
        number(f["peak_speed"]),
        *([number(f["clearance"])] if clearance else []),
        *([covers] if workspace else []),
        "FAILED" if not result.passed else "ok" if result.checks or result.motion_check is not None else "-",
    ]


def rows(result: JobResult) -> list[list[str]]:
    """The cells of every strategy: those that could not be run last."""
    width = len(columns(result))
    failed = [[one.name, "NOT run", *["-"] * (width - 3), "FAILED"] for one in result.not_run]
    return [*(row(s, bool(result.workspace), looked_at(result)) for s in result.strategies), *failed]


def remarks(result: JobResult) -> list[tuple[str, str]]:
    """(strategy, sentence) of all that the table does not tell: what was not run, what stopped, what is too fast."""
    found = [(one.name, f"not run: {one.reason}") for one in result.not_run]
    found += [(s.name, text) for s in result.strategies for text in (s.trouble, speed_warning(result, s))]
    return [(name, text) for name, text in found if text]


def number(value: float) -> str:
    """Three digits; a dash where there is none, 0 for what is below all round-off."""
    if not np.isfinite(value):
        return "-"
    if abs(value) < NOTHING:
        value = 0.0
    return f"{value:.3f}" if 1e-2 <= abs(value) < 100 else f"{value:.1e}"


def print_result(result: JobResult, console: Any) -> None:
    """Print a job's table, and below it what failed."""
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(brief(result.title)), title_justify="left", title_style="bold", header_style="dim")
    for heading, justify in columns(result):
        table.add_column(Text(heading), justify=justify, no_wrap=heading != "strategy")
    colors = {"holonomic": HOLONOMIC_TEXT, "NOT holonomic": BAD, "ok": GOOD}
    colors |= dict.fromkeys(("NOT run", "FAILED"), f"bold {BAD}")
    for cells in rows(result):
        table.add_row(*(Text(brief(cell), style=colors.get(cell, "")) for cell in cells))
    console.print(table)
    if ways_words(result):
        console.print(f"  {ways_words(result)}", markup=False, highlight=False)
    for name, text in remarks(result):
        console.print(f"  {brief(name)}: {text}", style=WARNING, markup=False, highlight=False)
    for strategy in result.strategies:
        if strategy.timed is not None:
            console.print(f"  {brief(strategy.name)}, timed:", markup=False, highlight=False)
            for line in strategy.timed.table().splitlines():
                console.print(f"    {brief(line)}", markup=False, highlight=False)
        if strategy.motion_check is not None:
            console.print(f"  {brief(strategy.name)}, checked:", markup=False, highlight=False)
            told = strategy.motion_check.table().splitlines()
            said = [text for text in [check_words(strategy)] if text]
            for line in [*said, *told[strategy.motion_check.passed :]]:
                console.print(f"    {brief(line)}", markup=False, highlight=False)
        for check in strategy.checks:
            if not check.passed:
                text = f"  {brief(strategy.name)}: expected {check.metric} {check.wanted}, found {check.found}"
                console.print(text, style=BAD, markup=False, highlight=False)
