"""docs/league.png: how far apart the joints are at one pose after two paths, and what a call takes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.league.league_entries import OURS
from benchmarks.league.league_page import shown, worst
from benchmarks.league.played import Played
from holokin.output.palette import BLUE, GREY, INK, VERMILLION

LEAST = 1e-16
"""Differences are drawn no farther to the left [rad]: it is round-off."""


def league_figure(played: Sequence[Played]) -> Any:
    """A row a library, the one that returns best on top; open circles as its example, diamonds at its best."""
    from matplotlib.figure import Figure

    rows = [_row(p) for p in played if shown(p)]
    rows.sort(key=lambda row: -min(point[1] for point in row[1]))
    figure = Figure(figsize=(7.3, 1.5 + 0.36 * len(rows)), layout="constrained")
    apart, times = figure.subplots(1, 2, sharey=True, width_ratios=(1.75, 1))
    for y, (name, points) in enumerate(rows):
        for axes, which in ((apart, 1), (times, 2)):
            values = [max(point[which], LEAST) for point in points]
            axes.plot(values, [y] * len(values), color=GREY, lw=1.6, zorder=1)
            for (how, *_), value in zip(points, values, strict=True):
                axes.scatter(value, y, zorder=3, **_marker(how, name == OURS.name))
    apart.set_yticks(range(len(rows)), [name for name, _ in rows])
    for label in apart.get_yticklabels():
        if label.get_text() == OURS.name:
            label.set_fontweight("bold")
    for axes in (apart, times):
        axes.set_xscale("log")
        axes.spines[["top", "right", "left"]].set_visible(False)
        axes.tick_params(axis="y", length=0)
        axes.grid(axis="x", color="0.9", zorder=0)
        axes.set_axisbelow(True)
    apart.set_xlabel("joints apart at one pose after two paths [rad]")
    times.set_xlabel("a call from Python [us]")
    apart.set_title("Same pose, same joints?", loc="left", fontweight="bold", color=INK)
    times.set_title("What does it take?", loc="left", fontweight="bold", color=INK)
    for how, label in (
        ("as its example", "as its own example runs it"),
        ("at its best", "at the best of its settings"),
    ):
        apart.scatter([], [], label=label, **_marker(how, False))
    apart.scatter([], [], label="holokin", marker="D", s=60, color=BLUE)
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    return figure


def _row(p: Played) -> tuple[str, list[tuple[str, float, float]]]:
    """Name, and (how, apart [rad], call [us]) of each setting that is shown, the worst of the arms."""
    points = []
    for how, name in shown(p):
        apart, call = worst(p, name, lambda s: max(s.ways, s.later)), worst(p, name, lambda s: s.call_us)
        if np.isfinite(apart):
            points.append((how, apart, call))
    return p.entry.name, points


def _marker(how: str, ours: bool) -> dict[str, Any]:
    color = BLUE if ours else VERMILLION
    if how == "as its example":
        return {"marker": "o", "s": 60, "facecolors": "white", "edgecolors": color, "linewidths": 1.8}
    return {"marker": "D", "s": 60, "color": color}
