"""The table of a job, for the terminal and the report."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from .result import JobResult, StrategyResult

COLUMNS: tuple[tuple[str, Literal["left", "right"]], ...] = (
    ("strategy", "left"),
    ("verdict", "left"),
    ("drift / cycle", "right"),
    ("two ways apart", "right"),
    ("tracking", "right"),
    ("sigma min", "right"),
    ("speed / MP", "right"),
    ("expected", "left"),
)
"""Heading and alignment. Drift and spread: largest joint [rad or m]; tracking: worst [m or rad]."""


def row(result: StrategyResult) -> list[str]:
    """The cells of one strategy."""
    f = result.figures
    return [
        result.name,
        "holonomic" if result.verdict.holonomic else "NOT holonomic",
        number(f["drift_mean"]),
        number(f["spread"]),
        number(f["tracking"]),
        number(f["sigma"]),
        f"{f['speed']:.3f}" if np.isfinite(f["speed"]) else "-",
        "ok" if result.passed else "FAILED",
    ]


def number(value: float) -> str:
    """Three digits; a dash where there is none."""
    if not np.isfinite(value):
        return "-"
    return f"{value:.3f}" if 1e-2 <= abs(value) < 100 else f"{value:.1e}"


def print_result(result: JobResult, console: Any) -> None:
    """Print a job's table, and below it what failed."""
    from rich.table import Table
    from rich.text import Text

    table = Table(title=result.title, title_justify="left", title_style="bold", header_style="dim")
    for heading, justify in COLUMNS:
        table.add_column(heading, justify=justify, no_wrap=heading != "strategy")
    colors = {"holonomic": "green", "NOT holonomic": "red", "FAILED": "bold red", "ok": "green"}
    for strategy in result.strategies:
        table.add_row(*(Text(cell, style=colors.get(cell, "")) for cell in row(strategy)))
    console.print(table)
    for strategy in result.strategies:
        if strategy.trouble:
            console.print(f"  {strategy.name}: {strategy.trouble}", style="yellow", markup=False, highlight=False)
        for check in strategy.checks:
            if not check.passed:
                text = f"  {strategy.name}: expected {check.figure} {check.wanted}, found {check.found}"
                console.print(text, style="red", markup=False, highlight=False)
