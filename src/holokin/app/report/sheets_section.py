"""What a job found of its [sheets], as a section of its report."""

from __future__ import annotations

from html import escape

from .sheets_result import SheetsResult


def sheets_section(result: SheetsResult | None) -> list[str]:
    """What the sheets serve, and what became of the job's path; nothing in a job without [sheets]."""
    if result is None:
        return []
    mark = "yes" if result.passed else "no"
    first, *lines = [line for line in result.map_lines() if line != result.verdict]
    parts = [
        "<h2>Sheets</h2>",
        f"<p>{escape(first)}.</p>",
        _listed(lines),
        f"<p class='{mark}'>{escape(result.verdict)}</p>",
        f"<p class='small'>{escape(str(result.found.workspace))}; {len(result.found.poses)} poses sampled.</p>",
    ]
    path = result.path_lines()
    return parts + ([f"<p>{escape(path[0])}.</p>", _listed(path[1:])] if path else [])


def _listed(lines: list[str]) -> str:
    """Lines as a list; nothing of none."""
    items = "".join(f"<li>{escape(line.strip())}</li>" for line in lines)
    return f"<ul class='small'>{items}</ul>" if items else ""
