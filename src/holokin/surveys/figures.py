"""Figures of a survey: distributions by law, never means alone."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..output.palette import COLORS, GREEN, GREY, INK, ORANGE, PURPLE, SKY, VERMILLION, YELLOW, color_of
from ..output.words import on_figure
from .findings import STATUS_ORDER, Findings

LEAST = 1e-12
"""Drift [rad, m] that is drawn for less, which is round-off."""

STATUS_COLORS = (GREEN, PURPLE, ORANGE, VERMILLION, YELLOW, SKY, GREY)


def _figure(height: float) -> tuple[Any, Any]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.6, height), layout="constrained")
    return figure, figure.add_subplot()


def drift_figure(found: Findings) -> Any:
    """Share of the cases of a law whose drift of a cycle is below a value, over that value."""
    figure, axes = _figure(4.2)
    for i, law in enumerate(found.laws):
        drift = np.sort(np.maximum(found.of_law(law).known("drift_mean"), LEAST))
        if drift.size:
            share = np.arange(1, drift.size + 1) / drift.size
            axes.step(
                np.append(drift, max(drift[-1], 1.0)), np.append(share, 1.0), where="post", color=color_of(i),
                linewidth=2.0, linestyle=("-", "--", "-.", ":")[i // len(COLORS) % 4], label=on_figure(law),
            )  # fmt: skip
    axes.set_xscale("log")
    axes.set_xlim(0.7 * LEAST, 4.0)
    axes.set_ylim(0, 1.02)
    axes.set_xlabel("largest joint error after a cycle [rad, m], mean over the cycles of a case")
    axes.set_ylabel("share of the cases with less")
    axes.set_title("Drift: lines at the left return, lines at the right drift", loc="left", color=INK, fontsize=11)
    axes.legend(fontsize=9, loc="upper left", ncols=2)
    return figure


def survival_figure(found: Findings) -> Any:
    """Share of the arms that have met no limit after k cycles."""
    figure, axes = _figure(3.8)
    for i, law in enumerate(found.laws):
        cycles, share, count = found.of_law(law).survival()
        if count:
            axes.step(
                cycles, share, where="post", color=color_of(i), linewidth=2.0, label=on_figure(law),
                linestyle=("-", "--", "-.", ":")[i // len(COLORS) % 4],
            )  # fmt: skip
    axes.set_ylim(0, 1.02)
    axes.set_xlim(left=0)
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.set_xlabel("cycles")
    axes.set_ylabel("share without a limit so far")
    axes.set_title("Joint limits: share of the arms that have met none", loc="left", color=INK, fontsize=11)
    axes.legend(fontsize=9, loc="lower left", ncols=2)
    return figure


def status_figure(found: Findings) -> Any:
    """How the cases of each law ended, as bars."""
    laws = found.laws
    figure, axes = _figure(1.2 + 0.42 * len(laws))
    left = np.zeros(len(laws))
    for status, color in zip(STATUS_ORDER, STATUS_COLORS, strict=True):
        share = np.array([found.of_law(law).shares()[status] for law in laws])
        if share.any():
            axes.barh(np.arange(len(laws)), share, left=left, color=color, label=status, edgecolor="white")
        left += share
    axes.set_yticks(np.arange(len(laws)), [on_figure(law) for law in laws])
    axes.invert_yaxis()
    axes.set_xlim(0, 1)
    axes.grid(visible=False)
    axes.set_xlabel("share of the cases")
    axes.set_title("How the cases ended", loc="left", color=INK, fontsize=11)
    figure.legend(fontsize=9, loc="outside right upper")
    return figure


def boxes_figure(found: Findings) -> Any:
    """Cost and margin by law: median, quartiles, 5 and 95 percent."""
    from matplotlib.figure import Figure

    laws = found.laws
    figure = Figure(figsize=(9.6, 1.4 + 0.42 * len(laws)), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    panels = (
        ("cost", "joint speed over that of the pseudo-inverse"),
        ("margin", "least distance to a limit, of its range"),
    )
    for ax, (metric, words) in zip(axes, panels, strict=True):
        values = [found.of_law(law).known(metric) for law in laws]
        boxes = ax.boxplot(
            [v if v.size else [np.nan] for v in values], orientation="horizontal", whis=(5, 95), showfliers=False,
            patch_artist=True, widths=0.6, medianprops={"color": INK, "linewidth": 1.8},
        )  # fmt: skip
        for i, box in enumerate(boxes["boxes"]):
            box.set_facecolor(color_of(i))
            box.set_alpha(0.6)
        ax.set_xlabel(words)
    axes[0].set_yticks(np.arange(1, len(laws) + 1), [on_figure(law) for law in laws])
    axes[0].invert_yaxis()
    axes[0].set_title("What it costs, and how near to the limits", loc="left", color=INK, fontsize=11)
    return figure
