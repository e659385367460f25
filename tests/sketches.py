"""Figures that take no time, for the tests of all that stands around them."""

from __future__ import annotations

from pathlib import Path


class Sketch:
    """What a report takes for a figure."""

    def savefig(self, file: Path, **_how: object) -> None:
        Path(file).write_bytes(b"a sketch")


def sketches(_result: object) -> list[tuple[str, str, Sketch]]:
    """Instead of `holokin.app.report.job_figures.figures`."""
    return [("sketch", "a sketch", Sketch())]


SKETCHED = f"""
import sys
sys.path.append({str(Path(__file__).parent)!r})
import holokin.app.report.job_report, sketches
holokin.app.report.job_report.figures = sketches.sketches
"""
"""Python for a process of its own, whose reports then have sketches."""
