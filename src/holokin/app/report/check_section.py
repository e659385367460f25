"""What the checks of a job found, as a section of its report."""

from __future__ import annotations

from collections.abc import Callable
from html import escape

from ...motion.checks import CheckReport, Finding
from .job_result import JobResult, StrategyResult
from .words import check_words

MOST_ROWS = 200
"""Findings in a report; result.json has them all."""

_HEAD = ["finding", "of", "from [s]", "to [s]", "worst at [s]", "value", "wanted"]


def check_section(result: JobResult, table: Callable[[list[str], list[list[str]]], str]) -> list[str]:
    """Findings, distances and what was not looked at, by strategy; nothing in a job without [checks]."""
    parts = []
    for strategy in result.strategies:
        if strategy.motion_check is not None:
            parts += [f"<h3>{escape(strategy.name)}</h3>", *_told(result, strategy, strategy.motion_check, table)]
    return ["<h2>Checks of the motion</h2>", *parts] if parts else []


def _told(
    result: JobResult, strategy: StrategyResult, report: CheckReport,
    table: Callable[[list[str], list[list[str]]], str],
) -> list[str]:  # fmt: skip
    """The findings as a table, and the other lines of the report as a list."""
    lines = "".join(f"<li>{escape(line)}</li>" for line in report.notes(result.units))
    found = table(_HEAD, [_row(one.printed(result.units)) for one in report.findings[:MOST_ROWS]])
    mark = "yes" if strategy.followed == 1.0 else "no"
    said = [f"<p class='{mark}'>{escape(text)}</p>" for text in [check_words(strategy)] if text]
    said += [f"<p class='no'>{escape(report.unread)}</p>"] if report.unread else []
    return [*([found] if report.findings else []), *said, f"<ul class='small'>{lines}</ul>"]


def _row(one: Finding) -> list[str]:
    unit = f" {one.unit}" if one.unit else ""
    sign = "at least" if one.is_least else "limit"
    return [
        f"<span class='no'>{escape(one.kind.value)}</span>", escape(" and ".join(one.what)), f"{one.start:.3f}",
        f"{one.stop:.3f}", f"{one.time:.3f}", f"{one.value:.4g}{unit}", f"{sign} {one.limit:.4g}{unit}",
    ]  # fmt: skip
