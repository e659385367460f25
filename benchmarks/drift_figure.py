"""docs/drift.png: drift against cycles, and what the joints at a pose depend on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from holokin.app.report.plots import BLUE, GREEN, ORANGE, PURPLE, VERMILLION, beside

COLORS = {"no rule": VERMILLION, "posture": ORANGE, "to a leaf": PURPLE, "no feedback": GREEN, "holonomic": BLUE}
MEANINGS = {
    "no rule": "no rule", "posture": "posture task", "to a leaf": "nears a leaf",
    "no feedback": "holonomic, no feedback", "holonomic": "holonomic",
}  # fmt: skip
LEAST = 1e-7
"""What is smaller is drawn there."""


class Drawn(Protocol):
    """What a row of the benchmark has that is drawn."""

    law: str
    kind: str
    ways: float
    speeds: float
    history: np.ndarray
    fault: str


def drift_picture(every: Sequence[Drawn]) -> Any:
    """The rows of one arm: above their drift since the start, below each law with its two differences."""
    from matplotlib.figure import Figure

    rows = [r for r in every if not r.fault]
    figure = Figure(figsize=(7.3, 9.6), layout="constrained")
    above, below = figure.subplots(2, 1, height_ratios=(1, 1.5))
    _histories(above, rows)
    _differences(below, rows)
    handles = [*above.get_legend_handles_labels()[0], *below.get_legend_handles_labels()[0]]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False, columnspacing=1.2)
    return figure


def _histories(axes: Any, rows: Sequence[Drawn]) -> None:
    for r in rows:
        cycles = np.arange(1, len(r.history) + 1)
        axes.plot(cycles, np.maximum(r.history, LEAST), color=COLORS[r.kind], lw=1.5, alpha=0.75)
    for kind, color in COLORS.items():
        axes.plot([], [], color=color, lw=3, label=MEANINGS[kind])
    axes.set_yscale("log")
    worst = {r.kind: r for r in sorted(rows, key=lambda r: r.history[-1])}.values()
    beside(axes, [(max(r.history[-1], LEAST), r.law, COLORS[r.kind]) for r in worst])
    axes.set_xlabel("cycles of the circle")
    axes.set_ylabel("largest joint's drift since the start [rad]")
    axes.set_title("Does it repeat? The worst of each kind is named", loc="left", fontweight="bold")


def _differences(axes: Any, rows: Sequence[Drawn]) -> None:
    names = [r.law for r in rows][::-1]
    y, shades = np.arange(len(names)), [COLORS[r.kind] for r in rows[::-1]]
    for figure_name, marker, label in (("ways", "o", "two paths to it"), ("speeds", "D", "slow or fast")):
        values = np.maximum([getattr(r, figure_name) for r in rows[::-1]], LEAST)
        axes.scatter(values, y, marker=marker, s=42, c=shades, edgecolors="white", lw=0.6, zorder=3)
        axes.scatter([], [], marker=marker, c="0.4", label=label)
    axes.set_yticks(y, names)
    axes.set_xscale("log")
    axes.set_xlabel("difference of the joints at one tool pose [rad]")
    axes.set_title("Do the joints belong to the pose?", loc="left", fontweight="bold")
    axes.grid(axis="x", visible=False)
