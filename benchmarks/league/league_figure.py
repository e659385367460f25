"""docs/league.png: how far apart the joints are at one pose after two paths, and what a call takes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.league.league_entries import OURS
from benchmarks.league.league_reading import BOTH, EXAMPLE, arms_of, shown
from benchmarks.league.played import Played
from holokin.app.report.plots import BLUE, GREY, INK, VERMILLION

LEAST = 1e-16
"""Differences are drawn no farther to the left [rad]: it is round-off."""

TITLES = {"panda": "Panda", "iiwa14": "iiwa 14"}


def league_figure(played: Sequence[Played]) -> Any:
    """A row a library, the one that returns best on top: its example as a circle, its best setting as a diamond."""
    from matplotlib.figure import Figure

    arms = arms_of(played)
    rows = sorted((p for p in played if any(shown(p, arm) for arm in arms)), key=lambda p: -_nearest(p, arms))
    figure = Figure(figsize=(7.3, 1.75 + 0.36 * len(rows)), layout="constrained")
    panels = figure.subplots(1, len(arms) + 1, sharey=True)
    for axes, arm in zip(panels, [*arms, arms[0]], strict=True):
        for y, p in enumerate(rows):
            points = [(how, s) for how, s in shown(p, arm) if not s.fault]
            _dots(axes, y, p, [(how, s, s.call_us if axes is panels[-1] else max(s.apart, LEAST)) for how, s in points])
        axes.set_xscale("log")
        axes.spines[["top", "right", "left"]].set_visible(False)
        axes.tick_params(axis="y", length=0)
        axes.grid(axis="y", visible=False)
        axes.set_title(TITLES.get(arm, arm), loc="left", fontweight="bold", color=INK)
        axes.set_xlabel("joints apart [rad]")
    for axes in panels[:-1]:
        axes.set_xlim(LEAST / 8, 20)
        axes.set_xticks([1e-15, 1e-10, 1e-5, 1])
    panels[-1].set_title("A call", loc="left", fontweight="bold", color=INK)
    panels[-1].set_xlabel(f"from Python, {TITLES.get(arms[0], arms[0])} [us]")
    panels[0].set_yticks(range(len(rows)), [p.entry.name for p in rows])
    for label in panels[0].get_yticklabels():
        if label.get_text() == OURS.name:
            label.set(fontweight="bold", color=BLUE)
    figure.suptitle("The same tool pose, reached by two paths: the same joints?", x=0.01, ha="left", fontweight="bold")
    _legend(figure, panels[0])
    return figure


def _nearest(p: Played, arms: Sequence[str]) -> float:
    """By what the rows are sorted: the best of a library on the worse of the arms, those with a fair setting first."""
    best = [min((s.apart + 10 * bool(s.unfair) for _, s in shown(p, arm)), default=100.0) for arm in arms]
    return float(np.log10(max(max(best), LEAST)))


def _dots(axes: Any, y: int, p: Played, points: list[tuple[str, Any, float]]) -> None:
    """The settings of one library in one panel, joined by a line."""
    color = BLUE if p.entry == OURS else VERMILLION
    axes.plot([value for *_, value in points], [y] * len(points), color=GREY, lw=1.4, zorder=1)
    for how, s, value in points:
        look = {"facecolors": "white", "edgecolors": color, "linewidths": 1.7} if how == EXAMPLE else {"color": color}
        marker = "X" if s.unfair else "o" if how == EXAMPLE else "D"
        axes.scatter(value, y, marker=marker, s=62 if how == EXAMPLE else 46, zorder=3, **look)
        if how == BOTH:
            axes.scatter(value, y, marker="o", s=150, facecolors="none", edgecolors=color, linewidths=1.4, zorder=2)


def _legend(figure: Any, axes: Any) -> None:
    """What the signs mean."""
    hollow = {"facecolors": "white", "edgecolors": VERMILLION, "linewidths": 1.7}
    axes.scatter([], [], marker="o", s=62, label="as its own example", **hollow)
    axes.scatter([], [], marker="X", s=62, label="so, but not along all paths", **hollow)
    axes.scatter([], [], marker="D", s=46, label="at its best", color=VERMILLION)
    figure.legend(loc="outside lower center", ncols=3, frameon=False, columnspacing=1.2, handletextpad=0.3)
