"""Figures of a survey: distributions by law, never means alone."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from functools import wraps
from textwrap import fill
from typing import Any

import numpy as np

from ..report.palette import BLUE, GREEN, GREY, INK, ORANGE, PALE, PURPLE, SKY, VERMILLION, YELLOW, law_colors
from ..report.plots import PAGE, TYPE, legible, style
from ..report.words import on_figure
from .findings import ON_PATH, RETURNS, STATUS_ORDER, Findings, robot_labels

LEAST = 1e-12
"""Drift [rad, m] that is drawn for less, which is round-off."""

STATUS_COLORS = (GREEN, PURPLE, ORANGE, VERMILLION, YELLOW, SKY, GREY)

DASHES = ("-", "--", ":", "-.")

NAME = 30
"""Letters of a robot's name in a line: the map of the laws needs the room beside it."""

DEAR = 3.0
"""Cost beyond which the boxes end at the edge of the figure: it is rare, and would make all others look alike."""


def _styled(draw: Callable[[Findings], Any]) -> Callable[[Findings], Any]:
    """With the house's settings of matplotlib, wherever it is called."""

    @wraps(draw)
    def drawn(found: Findings) -> Any:
        from matplotlib import rc_context

        with rc_context(style()):
            return draw(found)

    return drawn


def _empty(height: float) -> Any:
    """A figure that notebooks show without pyplot."""
    from matplotlib.figure import Figure

    class Shown(Figure):
        def _repr_png_(self) -> bytes:
            stream = io.BytesIO()
            legible(self).savefig(stream, format="png", facecolor="white")
            return stream.getvalue()

    return Shown(figsize=(PAGE, height), layout="constrained")


def _figure(height: float) -> tuple[Any, Any]:
    figure = _empty(height)
    return figure, figure.add_subplot()


def _looks(found: Findings) -> dict[str, dict[str, Any]]:
    """Law -> how its line is drawn: in a cool colour where half of its cases return, in a warm one else."""
    drift = [found.of_law(law).known("drift_last") for law in found.laws]
    return_ = [bool(d.size) and float(np.median(d)) < RETURNS for d in drift]
    colors = [GREY if color == YELLOW else color for color in law_colors(return_)]  # no line is yellow on white
    looks = {}
    for i, law in enumerate(found.laws):
        before = return_[:i].count(return_[i])
        looks[law] = {"color": colors[i], "linestyle": DASHES[before // 4 % len(DASHES)], "linewidth": 2.0}
    return looks


def _title(axes: Any, text: str) -> None:
    axes.set_title(text, loc="left", color=INK, fontsize=11)


def _named(figure: Any, handles: Sequence[tuple[float, Any]]) -> None:
    """The laws beside the axes, in the order of the lines from above."""
    lines = [line for _, line in sorted(handles, key=lambda pair: -pair[0])]
    figure.legend(handles=lines, fontsize=9, loc="outside right upper", frameon=False)


@_styled
def drift_figure(found: Findings) -> Any:
    """Share of the cases of a law whose drift of their last cycle is below a value, over that value."""
    figure, axes = _figure(4.4)
    looks, handles = _looks(found), []
    for law in found.laws:
        drift = np.sort(np.maximum(found.of_law(law).known("drift_last"), LEAST))
        if drift.size:
            share = np.arange(1, drift.size + 1) / drift.size
            (line,) = axes.step(
                np.append(drift, max(drift[-1], 1.0)), np.append(share, 1.0), where="post", label=on_figure(law),
                **looks[law],
            )  # fmt: skip
            handles.append((-float(np.median(drift)), line))
    axes.axvline(RETURNS, color=GREY, linewidth=1.0, linestyle=(0, (1, 3)), zorder=0)
    axes.set_xscale("log")
    axes.set_xlim(0.7 * LEAST, 4.0)
    axes.set_ylim(0, 1.02)
    axes.set_xlabel("largest joint error after the last cycle of a case [rad, m]")
    axes.set_ylabel("share of the cases with less")
    _title(axes, "Drift: lines at the left return, lines at the right drift")
    _named(figure, handles)
    return figure


@_styled
def survival_figure(found: Findings) -> Any:
    """Share of the arms that have met no limit after k cycles."""
    figure, axes = _figure(4.0)
    looks, handles, least = _looks(found), [], 1.0
    for law in found.laws:
        cycles, share, count = found.of_law(law).survival()
        if count:
            (line,) = axes.step(cycles, share, where="post", label=on_figure(law), **looks[law])
            handles.append((float(share[-1]), line))
            least = min(least, float(share.min()))
    bottom = max(0.0, 1.0 - 1.15 * max(1.0 - least, 0.05))
    axes.set_ylim(bottom, 1.0)
    axes.set_yticks([tick for tick in axes.get_yticks() if bottom <= tick <= 1.0 + 1e-9])
    axes.set_ylim(bottom, 1.0 + 0.02 * (1.0 - bottom))  # a line along the top is seen whole
    axes.set_xlim(left=0)
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.yaxis.set_major_formatter(_percent)
    axes.set_xlabel("cycles")
    axes.set_ylabel("share without a limit so far")
    _title(axes, "Joint limits: share of the arms that have met none")
    _named(figure, handles)
    return figure


def _percent(value: float, _place: Any) -> str:
    return f"{100 * value:.3g} %"


@_styled
def coverage_figure(found: Findings) -> Any:
    """Of each robot and law the share of the loops asked that the law covers, as a map; best robots above.

    What was not asked is empty; where all cases are faults it says so.
    """
    from matplotlib.colors import LinearSegmentedColormap

    robots, laws, share = found.coverage()
    names = robot_labels(robots)
    known = np.isfinite(share)
    order = np.argsort(-np.nansum(share, axis=1) / np.maximum(known.sum(axis=1), 1), kind="stable")
    faults = found.faults()
    figure, axes = _figure(2.2 + 0.29 * len(robots))
    scale = [VERMILLION, YELLOW, "#FFFFFF", SKY, BLUE]
    colors = LinearSegmentedColormap.from_list("coverage", scale).with_extremes(bad=PALE)
    image = axes.imshow(np.ma.masked_invalid(share[order]), aspect="auto", vmin=0.0, vmax=1.0, cmap=colors)
    for row, robot in enumerate(order):
        for column in range(len(laws)):
            value = share[robot, column]
            if not np.isfinite(value) and (robots[robot], laws[column]) in faults:
                axes.text(column, row, "faults", ha="center", va="center", fontsize=TYPE, color=INK)
            if np.isfinite(value):
                ink = "white" if value > 0.9 or value < 0.1 else INK
                axes.text(column, row, f"{100 * value:.0f}", ha="center", va="center", fontsize=TYPE, color=ink)
    axes.set_xticks(range(len(laws)), [on_figure(law, 30) for law in laws], rotation=35, ha="left", fontsize=9)
    axes.xaxis.tick_top()
    shown = [fill(on_figure(names[i]), NAME) for i in order]
    axes.set_yticks(range(len(robots)), shown, fontsize=TYPE, linespacing=1.1)
    axes.tick_params(length=0)
    axes.grid(visible=False)
    for spine in axes.spines.values():
        spine.set_visible(False)
    bar = figure.colorbar(image, ax=axes, location="bottom", fraction=0.02, pad=0.01, aspect=40)
    bar.outline.set_visible(False)
    bar.ax.xaxis.set_major_formatter(_percent)
    bar.set_label(f"loops that were gone round to the end\nwith the tool within {1e3 * ON_PATH:g} mm of the path")
    return figure


@_styled
def status_figure(found: Findings) -> Any:
    """How the cases of each law ended, as bars."""
    laws = found.laws
    figure, axes = _figure(1.2 + 0.34 * len(laws))
    left = np.zeros(len(laws))
    for status, color in zip(STATUS_ORDER, STATUS_COLORS, strict=True):
        share = np.array([found.of_law(law).shares()[status] for law in laws])
        if share.any():
            axes.barh(np.arange(len(laws)), share, left=left, color=color, label=status, edgecolor="white")
        left += share
    axes.set_yticks(np.arange(len(laws)), [on_figure(law) for law in laws])
    axes.invert_yaxis()
    axes.set_xlim(0, 1)
    axes.xaxis.set_major_formatter(_percent)
    axes.grid(visible=False)
    axes.set_xlabel("share of the cases")
    _title(axes, "How the cases ended")
    figure.legend(fontsize=9, loc="outside right upper", frameon=False)
    return figure


@_styled
def boxes_figure(found: Findings) -> Any:
    """Cost and margin of each law: median, quartiles, 5 and 95 percent."""
    laws, looks = found.laws, _looks(found)
    figure = _empty(1.5 + 0.34 * len(laws))
    axes = figure.subplots(1, 2, sharey=True)
    panels = (
        ("cost", "joint speed over that\nof the pseudo-inverse"),
        ("margin", "least distance to a limit,\nof its range"),
    )
    for ax, (metric, words) in zip(axes, panels, strict=True):
        values = [found.of_law(law).known(metric) for law in laws]
        boxes = ax.boxplot(
            [v if v.size else [np.nan] for v in values], orientation="horizontal", whis=(5, 95), showfliers=False,
            patch_artist=True, widths=0.6, medianprops={"color": INK, "linewidth": 1.8},
        )  # fmt: skip
        for law, box in zip(laws, boxes["boxes"], strict=True):
            box.set_facecolor(looks[law]["color"])
            box.set_alpha(0.6)
        ax.set_xlabel(words)
    right = axes[0].get_xlim()[1]
    axes[0].set_xlim(0.95, min(max(right, 1.1), DEAR))
    axes[1].set_xlim(left=min(0.0, axes[1].get_xlim()[0]))
    axes[1].xaxis.set_major_formatter(_percent)
    axes[0].set_yticks(np.arange(1, len(laws) + 1), [on_figure(law) for law in laws])
    axes[0].invert_yaxis()
    _title(axes[0], "What it costs, and how near to the limits")
    return figure
