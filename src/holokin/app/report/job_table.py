"""The table of a job, for the terminal and the report."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import numpy as np

from ...base.errors import brief
from .job_result import JobResult, StrategyResult
from .palette import BAD, GOOD, HOLONOMIC_TEXT, WARNING
from .words import check_words, paths_words, speed_warning

NOTHING = 1e-18
"""Size [any unit] below which a figure is 0: differences of doubles over 0.01 are at least that."""


def number(value: float) -> str:
    """Three digits; a dash where there is none, 0 for what is below all round-off."""
    if not np.isfinite(value):
        return "-"
    if abs(value) < NOTHING:
        value = 0.0
    return f"{value:.3f}" if 1e-2 <= abs(value) < 100 else f"{value:.1e}"


Column = tuple[str, Literal["left", "right"]]
"""Heading and alignment."""


class _Column(NamedTuple):
    heading: str
    cell: Callable[[StrategyResult], str]
    side: Literal["left", "right"] = "right"


def _columns(result: JobResult) -> list[_Column]:
    """The columns; clearance and share of the workspace in a job that has them."""

    def figure(key: str, form: Callable[[float], str] = number) -> Callable[[StrategyResult], str]:
        by = result.factor(key)
        return lambda s: form(by * s.metrics[key]) if np.isfinite(s.metrics[key]) else "-"

    joints, task = result.joint_unit[0], result.row_unit[0]
    looked_at = any(np.isfinite(s.metrics["clearance"]) for s in result.strategies)
    narrow = result.workspace or looked_at
    found = [
        _Column("strategy", lambda s: s.name, "left"),
        _Column("verdict", lambda s: "holonomic" if s.verdict.holonomic else "NOT holonomic", "left"),
        _Column(f"drift / cycle\n[{joints}]", figure("drift_mean")),
        _Column(f"two paths\napart [{joints}]" if narrow else f"two paths apart\n[{joints}]", figure("spread")),
        _Column(f"tracking\n[{task}]", figure("tracking")),
        _Column("sigma\nmin", figure("sigma")),
        _Column("speed\n/ MP", figure("speed", "{:.3f}".format)),
        _Column("peak\nspeed", figure("peak_speed")),
    ]
    unit = result.units.length
    clear = figure("clearance", number if unit == "m" else "{:.1f}".format)
    found += [_Column(f"clear.\n[{unit}]", clear)] if looked_at else []
    found += [_Column("work-\nspace", figure("coverage", "{:.1%}".format))] if result.workspace else []
    return [*found, _Column("expected", _expected, "left")]


def _expected(s: StrategyResult) -> str:
    return "FAILED" if not s.passed else "ok" if s.checks or s.motion_check is not None else "-"


def columns(result: JobResult) -> list[Column]:
    """Heading, with its unit, and alignment of each column."""
    return [(column.heading, column.side) for column in _columns(result)]


def rows(result: JobResult) -> list[list[str]]:
    """The cells of every strategy: those that could not be run last."""
    shown = _columns(result)
    failed = [[one.name, "NOT run", *["-"] * (len(shown) - 3), "FAILED"] for one in result.not_run]
    return [*([column.cell(s) for column in shown] for s in result.strategies), *failed]


def remarks(result: JobResult) -> list[tuple[str, str]]:
    """(strategy, sentence) of all that the table does not tell: what was not run, what stopped, what is too fast."""
    found = [(one.name, f"not run: {one.reason}") for one in result.not_run]
    found += [(s.name, text) for s in result.strategies for text in (s.trouble, speed_warning(result, s))]
    return [(name, text) for name, text in found if text]


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
    if paths_words(result):
        console.print(f"  {paths_words(result)}", markup=False, highlight=False)
    for name, text in remarks(result):
        console.print(f"  {brief(name)}: {text}", style=WARNING, markup=False, highlight=False)
    if result.sheets is not None:
        console.print("  sheets:", markup=False, highlight=False)
        for line in [*result.sheets.map_lines(), *result.sheets.path_lines()]:
            wrong = line == result.sheets.verdict and not result.sheets.passed
            console.print(f"    {brief(line, 300)}", style=BAD if wrong else None, markup=False, highlight=False)
    for strategy in result.strategies:
        if strategy.timed is not None:
            console.print(f"  {brief(strategy.name)}, timed:", markup=False, highlight=False)
            for line in strategy.timed.table(result.units).splitlines():
                console.print(f"    {brief(line)}", markup=False, highlight=False)
        if strategy.motion_check is not None:
            console.print(f"  {brief(strategy.name)}, checked:", markup=False, highlight=False)
            told = strategy.motion_check.table(result.units).splitlines()
            said = [text for text in [check_words(strategy)] if text]
            for line in [*said, *told[strategy.motion_check.passed :]]:
                console.print(f"    {brief(line)}", markup=False, highlight=False)
        for check in strategy.checks:
            if not check.passed:
                text = f"  {brief(strategy.name)}: {check.unmet}"
                console.print(text, style=BAD, markup=False, highlight=False)
