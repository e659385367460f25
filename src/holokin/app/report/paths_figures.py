"""The figures of a job of several paths: the robot among its paths, and the joints and distances over the program."""

from __future__ import annotations

from itertools import accumulate
from typing import Any

import numpy as np

from ...base.types import Matrix
from ...motion import TimedTrajectory
from . import plots
from .job_figures import margins
from .paths_result import PathsResult, RuleResult
from .robot_panels import Actor, Curve, draw_panel, stage_of
from .robot_view import cloud, standing

WIDTH = 7.6
"""Of a figure [inch]."""

MOST_LOOKED_AT = 500
"""Instants at which distances are drawn."""

PLAN = (
    "From above. Green: the paths, with their numbers at their beginnings; orange, dashed: the ways between them. "
    "Grey: the obstacles, meshes as convex outlines."
)
"""What the picture from above shows."""

ROBOT = (
    "The arm at the start of the first path, pale at the start posture. Green: the paths, with their numbers at their "
    "beginnings, in the order of the table; orange, dashed: the ways between them. Grey: the obstacles, meshes as "
    "convex hulls."
)
"""What the picture of the robot shows."""


def robot_figure(result: PathsResult, rule: RuleResult) -> Any:
    """The robot at the first path, all paths in their order, and the ways through the air."""
    from matplotlib.figure import Figure

    curves = _curves(result, rule)
    first = next(row.own for row in rule.rows if row.own is not None)
    actors = [Actor(result.q0, plots.START, "ghost"), Actor(first.q[0], plots.HOLONOMIC)]
    obstacles = () if result.scene is None else tuple(result.scene.obstacles)
    postures = np.array([actor.q for actor in actors])
    stage = stage_of(result.shown, postures, curves, obstacles=obstacles)
    wide, tall = stage.scene.shape
    sides = (0.8, 0.5) if result.robot.planar else (0.1, 0.1)  # left, bottom: axes have their names there
    figure = Figure(figsize=(WIDTH, (WIDTH - sides[0] - 0.1) * tall / wide + sides[1] + 0.1))
    margins(figure, left=sides[0], right=0.1, bottom=sides[1], top=0.1)
    axes = draw_panel(figure.subplots(), stage, actors, curves)
    _number(axes, stage.scene.view.seen(np.array([c.points[0] for c in curves if not c.dash])))
    return figure


def plan_figure(result: PathsResult, rule: RuleResult) -> Any:
    """The paths from above, in their order, with the ways between them and the outlines of the obstacles."""
    from matplotlib.figure import Figure
    from scipy.spatial import ConvexHull

    curves, factor = _curves(result, rule), result.units.factor("m")
    points = factor * np.vstack([curve.points[:, :2] for curve in curves])
    low, high = points.min(axis=0), points.max(axis=0)
    pad = 0.08 * float((high - low).max())
    low, high = low - pad, high + pad
    width = WIDTH - 0.9
    height = float(np.clip(width * (high - low)[1] / (high - low)[0], 0.35 * width, 0.8 * width))
    figure = Figure(figsize=(WIDTH, height + 0.6))
    margins(figure, left=0.8, right=0.1, bottom=0.5, top=0.1)
    axes = figure.subplots()
    axes.set_aspect("equal")
    for shape in () if result.scene is None else result.scene.obstacles:
        corners = factor * cloud(standing([shape]))[:, :2]
        outline = corners[ConvexHull(corners).vertices]
        axes.fill(*outline.T, facecolor=plots.PALE, edgecolor=plots.GREY, linewidth=0.8, zorder=1)
    for curve in curves:
        dashes, width = ("--", 1.0) if curve.dash else ("-", 2.4)
        axes.plot(*(factor * curve.points[:, :2]).T, color=curve.color, linestyle=dashes, linewidth=width, zorder=3)
    _number(axes, factor * np.array([c.points[0] for c in curves if not c.dash]))
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_xlabel(f"x [{result.units.length}]")
    axes.set_ylabel(f"y [{result.units.length}]")
    return figure


def _curves(result: PathsResult, rule: RuleResult) -> list[Curve]:
    """The ways through the air, dashed, and the paths, in their order."""
    ways = [(row.air, plots.ORANGE, 3) for row in rule.rows], [(row.own, plots.LOOP, 0) for row in rule.rows]
    every = [way for pair in zip(*ways, strict=True) for way in pair]
    return [Curve(_tool(result, timed), color, dash) for timed, color, dash in every if timed is not None]


def _number(axes: Any, beginnings: Matrix) -> None:
    """The number of each path, beside its beginning (k, 2 or more)."""
    for number, place in enumerate(beginnings, 1):
        box = {"boxstyle": "circle,pad=0.15", "facecolor": "white", "edgecolor": plots.LOOP, "linewidth": 0.8}
        look = {"fontsize": 8, "color": plots.INK, "ha": "center", "va": "center", "zorder": 7, "bbox": box}
        axes.annotate(str(number), place[:2], xytext=(0, 9), textcoords="offset points", **look)


def motion_figure(result: PathsResult, rule: RuleResult) -> Any:
    """Each joint over the whole program, the paths shaded and numbered; below it the least distance between shapes."""
    from matplotlib.figure import Figure

    motion, units = rule.motion, result.robot.coordinates
    keep = plots.thin(len(motion), 2 * MOST_LOOKED_AT)
    kinds = [unit for unit in ("rad", "m") if any(c.unit == unit for c in units)]
    rows = len(kinds) + (result.scene is not None)
    figure = Figure(figsize=(WIDTH, 0.75 + 2.3 * len(kinds) + 1.7 * (result.scene is not None)))
    grid = figure.subplots(
        rows, 1, squeeze=False, sharex=True, height_ratios=[1.4] * len(kinds) + [1] * (rows - len(kinds))
    )
    margins(figure, left=0.75, right=1.75, bottom=0.5, top=0.3, height_gap=0.15, grid=(rows, 1))
    # The joints, those of one unit together, to be named at their ends.
    names = []
    for axes, unit in zip(grid[:, 0], kinds, strict=False):
        factor, named = result.units.factor(unit), []
        for i, joint in enumerate(units):
            if joint.unit == unit:
                color = plots.color_of(i)
                axes.plot(motion.t[keep], factor * motion.q[keep, i], color=color, linewidth=1.3)
                named.append((factor * float(motion.q[-1, i]), plots.on_figure(joint.name, 24), color))
        axes.set_ylabel(result.units.name(unit))
        names.append((axes, named))
    # The distances, beside what is asked for.
    if result.scene is not None:
        axes, factor = grid[-1, 0], result.units.factor("m")
        some = plots.thin(len(motion), MOST_LOOKED_AT)
        axes.plot(motion.t[some], factor * result.distances(motion.q[some]), color=plots.INK, linewidth=1.3)
        axes.axhline(factor * result.scene.clearance, color=plots.LIMIT, linewidth=1.6, linestyle=(0, (1, 1)))
        axes.set_ylim(bottom=0.0)
        axes.set_ylabel(f"distance [{result.units.length}]")
    # The paths, shaded.
    for axes in grid[:, 0]:
        for number, (begin, end) in enumerate(_spans(rule), 1):
            axes.axvspan(begin, end, color=plots.PALE, zorder=0, linewidth=0)
            if axes is grid[0, 0]:
                look = {"transform": axes.get_xaxis_transform(), "ha": "center", "va": "bottom", "fontsize": 8}
                axes.text((begin + end) / 2, 1.01, str(number), color=plots.INK, **look)
        axes.set_xlim(0.0, motion.duration)
    for axes, named in names:  # when nothing moves the axes any more
        axes.set_ylim(axes.get_ylim())
        plots.beside(axes, named)
    grid[-1, 0].set_xlabel("time [s]")
    return figure


def motion_words(result: PathsResult) -> str:
    """What the figure of the motion shows."""
    words = "The joints over the whole program; shaded: the paths, by their numbers; white: the ways between them."
    return (
        words
        if result.scene is None
        else f"{words} Below: the least distance between shapes; dotted: what is asked for."
    )


def _spans(rule: RuleResult) -> list[tuple[float, float]]:
    """When each path begins and ends [s]."""
    parts = [
        (timed.duration, timed is row.own) for row in rule.rows for timed in (row.air, row.own) if timed is not None
    ]
    ends = list(accumulate(seconds for seconds, _ in parts))
    return [(end - seconds, end) for (seconds, is_path), end in zip(parts, ends, strict=True) if is_path]


def _tool(result: PathsResult, timed: TimedTrajectory) -> Matrix:
    """Where the tool of a motion is (k, 3)."""
    return timed.untimed.robot.pose_batch(timed.q[plots.thin(len(timed), 120)], result.tip)[0]
