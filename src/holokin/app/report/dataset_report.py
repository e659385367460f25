"""The figure of the audit of a robot learning dataset."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...analysis.audit import DatasetAudit, LogVerdict
from .log_report import two_panels
from .palette import BAD, GOOD, GREY, INK
from .plots import thin
from .robot_panels import Actor, Curve, draw_panel, stage_of
from .words import on_figure

MOST_POINTS = 4_000
"""Tool poses and pairs that are drawn."""


def dataset_figure(audit: DatasetAudit) -> Any:
    """Distances of the joints at equal poses by episode, and where the tool is there, with the two worst postures."""
    name = on_figure(audit.dataset.folder.resolve().name)
    word = {LogVerdict.REPEATS: "equal", LogVerdict.DIFFERS: "different"}.get(audit.verdict, "undecided")
    figure, left, right = two_panels(f"{name}: joints at equal tool poses are {word}")
    _by_episode(left, audit)
    _places(right, audit)
    return figure


def _by_episode(axes: Any, audit: DatasetAudit) -> None:
    """Each pair of equal poses, at both of its episodes; those that differ in red."""
    pairs = audit.pairs
    at = thin(len(pairs.first), MOST_POINTS) if len(pairs.first) else np.empty(0, np.intp)
    for beyond, color, word in ((False, GOOD, "equal"), (True, BAD, "different")):
        mine = at[pairs.beyond[at] == beyond]
        rows = np.concatenate([pairs.first[mine], pairs.second[mine]])
        episode = audit.episodes[np.searchsorted(audit.begins, rows, side="right") - 1]
        distance = np.maximum(np.tile(pairs.distance[mine], 2), 1e-6)
        if len(mine):
            axes.semilogy(episode, distance, "o", color=color, markersize=4, alpha=0.5, markeredgewidth=0, label=word)
    axes.axhline(audit.tolerance, color=INK, linewidth=0.8, linestyle="--", label=f"tolerance {audit.tolerance:g}")
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.set_xlabel("episode")
    axes.set_ylabel("distance of the joints [rad or m]")
    axes.set_title("Each pair of equal tool poses, at both episodes", loc="left", color=INK, fontsize=10)
    axes.legend(fontsize=8, loc="best")


def _places(axes: Any, audit: DatasetAudit) -> None:
    """The arm at the two postures of the worst pair, and the tool's places."""
    worst = audit.worst()
    shown = thin(len(audit.q), 20 * MOST_POINTS // 40)
    rows = [0] if worst is None else [int(audit.pairs.first[worst]), int(audit.pairs.second[worst])]
    first, last = audit.q[rows[0]].astype(float), audit.q[rows[-1]].astype(float)
    points, _ = audit.task.poses(audit.q[shown].astype(float))
    stage = stage_of(audit.robot, np.vstack([first, last]), [Curve(points, GREY)], pairs=[(first, last)])
    differs = worst is not None and audit.verdict is LogVerdict.DIFFERS
    actors = [Actor(first, GOOD), *([Actor(last, BAD, "outline")] if differs else [])]
    title = "The arm at a tool pose"
    if differs and worst is not None:
        (e, _), (f, _) = audit.frame(rows[0]), audit.frame(rows[1])
        title = f"One tool pose, two postures: episodes {e} and {f}"
    draw_panel(axes, stage, actors, title=title)
    seen = stage.scene.view.seen(points)
    axes.plot(*seen[:, :2].T, ".", color="#c9cdd4", markersize=1.5, zorder=3)
    if differs:
        pairs = audit.pairs
        bad = pairs.first[np.flatnonzero(pairs.beyond)]
        spots, _ = audit.task.poses(audit.q[bad[thin(len(bad), MOST_POINTS)]].astype(float))
        axes.plot(*stage.scene.view.seen(spots)[:, :2].T, ".", color=BAD, markersize=3, zorder=4)
