"""A picture of the levels that serve a workspace."""

from __future__ import annotations

from typing import Any

from ...analysis.design import LevelRange
from .palette import BLUE, INK
from .plots import style
from .words import on_figure


def level_figure(found: LevelRange) -> Any:
    """The share of the workspace that each level serves; shaded, the levels that serve all of it."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(style()):
        figure = Figure(figsize=(6.4, 3.2), layout="constrained")
        axes = figure.subplots()
        for k, (low, high) in enumerate(found.intervals):
            axes.axvspan(low, high, color=BLUE, alpha=0.16, linewidth=0, label=None if k else "serves all")
        axes.plot(found.levels, 100 * found.shares, "-o", color=BLUE, markersize=2.5, linewidth=1.2)
        axes.axvline(found.level, color=INK, linestyle=":", linewidth=1.2, label="level of the start")
        axes.axvline(found.best, color=INK, linewidth=1.2, label="level to take")
        unit = "rad" if found.strategy.constraint.angular[0] else "the constraint's unit"
        axes.set(xlabel=f"level [{unit}]", ylabel="served [%]", ylim=(0, 104), title=on_figure(found.strategy.name))
        axes.legend(loc="lower center", fontsize=8, frameon=True, framealpha=0.9)
    return figure
