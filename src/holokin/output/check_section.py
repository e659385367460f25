"""What the checks of a job found, as a section of its report."""

from __future__ import annotations

from html import escape

from .result import JobResult


def check_section(result: JobResult) -> list[str]:
    """Findings, distances and what was not looked at, by strategy; nothing in a job without [checks]."""
    parts = [
        f"<h3>{escape(s.name)}</h3><div class='wide'><pre>{escape(s.motion_check.table())}</pre></div>"
        for s in result.strategies
        if s.motion_check is not None
    ]
    return ["<h2>Checks of the motion</h2>", *parts] if parts else []
