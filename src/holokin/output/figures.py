"""The figures of a job, composed of `plots`: name -> matplotlib Figure."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..trajectory import Status, Trajectory
from .coverage_plots import coverage_figure
from .plots import (
    CLOCKWISE,
    COUNTER,
    GREY,
    ZOOMS,
    best_azimuth,
    drift_per_cycle,
    frame_robot,
    inside,
    joint_cycles,
    joint_ways,
    robot_stick,
    style,
    tool_path,
)
from .result import JobResult, StrategyResult
from .words import away, joint_unit, on_figure, stopped, ways_end

MAPS = (
    "Maps: planes through the centre of the workspace, the tool in its middle orientation, a cross at the start. "
    "Points: the poses sampled, with all their tilts and turns."
)
"""What a figure of coverage shows."""

COLUMNS = 3
"""Panels side by side, at most: more would be too small to read in a page."""


def figures(result: JobResult) -> Iterator[tuple[str, str, Any]]:
    """(file stem, caption, Figure) of every figure of a job, made one at a time."""
    from matplotlib import rc_context

    if result.robot.tips:
        caption = "The robot at the start (grey) and where each way has led it: clockwise (wide, blue) and "
        with rc_context(style()):
            yield "robot", caption + "counter-clockwise (thin, red), in one picture.", robot_figure(result)
    for strategy in result.drawn:
        if strategy.ways is not None:
            with rc_context(style()):
                caption = f"{strategy.name}: joints over half a loop, clockwise (solid) and counter-clockwise (dashed)."
                apart = strategy.metrics["same_joints"]
                if np.isfinite(apart):
                    unit = joint_unit(result.robot)
                    caption += f" The other representations of orientation lie within {apart:.1g} {unit} of it."
                yield f"ways-{result.stems[strategy.name]}", caption, ways_figure(strategy)
    if result.cycles > 1:
        with rc_context(style()):
            yield "cycles", f"Joints, less their start values, over {result.cycles} cycles.", cycles_figure(result)
        if any(s.cycles.cycles for s in result.drawn):
            with rc_context(style()):
                yield "drift", "Joint drift after each cycle.", drift_figure(result)
    for strategy in result.drawn:
        if strategy.coverage is not None:
            with rc_context(style()):
                found = strategy.coverage
                said = [f"{found.sentence}.", found.remark, MAPS if strategy.slices else ""]
                caption = " ".join(filter(None, said))
                yield f"coverage-{result.stems[strategy.name]}", caption, coverage_figure(found, strategy.slices)


def ways_figure(strategy: StrategyResult) -> Any:
    """Joint histories by both ways, one panel a joint. [ZR11, Figs 4, 5, 8]"""
    from matplotlib.figure import Figure

    if strategy.ways is None:
        raise ValueError("a strategy without two ways has no such figure")
    clockwise, counter = strategy.ways
    n = len(clockwise.joint_names)
    columns = min(n, 2 if n == 4 else COLUMNS)
    rows = -(-n // columns)
    word = "holonomic" if strategy.verdict.holonomic else "not holonomic"
    title = f"{on_figure(strategy.name)} ({word})"
    if Status.COMPLETE not in (clockwise.status, counter.status) or clockwise.status is not counter.status:
        title += "\n" + ways_end(strategy.ways)
    top = 0.45 + 0.2 * (1 + title.count("\n"))
    bottom = 0.85 if n == rows * columns else 0.55
    figure = Figure(figsize=(max(4.4 * columns, 6.4), (2.6 if rows == 1 else 1.6) * rows + bottom + top))
    margins(figure, left=0.7, right=0.15, bottom=bottom, top=top, width_gap=0.75, height_gap=0.42, grid=(rows, columns))
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True)
    for joint in range(n):
        joint_ways(grid.flat[joint], clockwise, counter, joint)
    for column in range(columns):
        last = max(r for r in range(rows) if r * columns + column < n)
        grid[last, column].set_xlabel("time [s]")
        grid[last, column].tick_params(labelbottom=True)
    legend(figure, grid, n)
    figure.suptitle(title, fontsize=12, fontweight="bold", y=1 - 0.08 / figure.get_figheight(), va="top")
    return figure


def legend(figure: Any, grid: Any, count: int) -> None:
    """One legend for a grid of which `count` cells are used: in the empty cells, or below where there are none."""
    handles, labels = grid.flat[0].get_legend_handles_labels()
    for axes in grid.flat[count:]:
        axes.set_visible(False)
    if count == grid.size:
        figure.legend(handles, labels, loc="lower center", ncols=min(7, len(labels)))
        return
    first, last = grid.flat[count].get_position(), grid.flat[-1].get_position()
    center = ((first.x0 + last.x1) / 2, (last.y0 + first.y1) / 2)
    figure.legend(handles, labels, loc="center", bbox_to_anchor=center, ncols=-(-len(labels) // 4), fontsize=11)


def cycles_figure(result: JobResult) -> Any:
    """Joint histories over the cycles, one panel a strategy, on one scale. [ZR11, Fig. 6]"""
    from matplotlib.figure import Figure

    count = len(result.drawn)
    columns = min(count, COLUMNS)
    rows = -(-count // columns)
    bottom = 0.95 if count == rows * columns else 0.6
    figure = Figure(figsize=(3.9 * columns + 1.0, 3.1 * rows + bottom))
    margins(
        figure, left=0.75, right=0.15, bottom=bottom, top=0.55, width_gap=0.25, height_gap=0.6, grid=(rows, columns)
    )
    grid = figure.subplots(rows, columns, squeeze=False, sharey=True, sharex=True)
    for k, (axes, strategy) in enumerate(zip(grid.flat, result.drawn, strict=False)):
        joint_cycles(axes, strategy.cycles)
        axes.set_title(f"{on_figure(strategy.name)}\n{_drift(strategy.cycles)}", loc="left", fontsize=10)
        below = k + columns < count
        axes.tick_params(labelbottom=not below)
        axes.set_xlabel("" if below else "time [s]")
    for axes in grid[:, 0]:
        axes.set_ylabel(f"q - q(0) [{joint_unit(result.robot)}]")
    legend(figure, grid, count)
    return figure


def drift_figure(result: JobResult) -> Any:
    """Drift after each cycle, all strategies in one."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.0))
    margins(figure, left=0.85, right=0.15, bottom=0.6, top=0.2)
    walks = {on_figure(s.name): s.cycles for s in result.drawn if s.cycles.cycles}
    axes = drift_per_cycle(figure.subplots(), walks)
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, 0.72))
    return figure


def robot_figure(result: JobResult) -> Any:
    """Stick figures, one panel a strategy: start in grey, the two ends in the colours of their ways."""
    from matplotlib.figure import Figure

    robot = result.robot
    count = len(result.drawn)
    columns = min(count, COLUMNS)
    rows = -(-count // columns)
    figure = Figure(figsize=(4.4 * columns, 4.2 * rows))
    if robot.planar:
        margins(figure, left=0.65, right=0.15, bottom=0.6, top=0.6, width_gap=0.6, height_gap=0.9, grid=(rows, columns))
    else:  # 3-D axes leave room of their own, but for the last labels
        margins(
            figure, left=0.05, right=0.25, bottom=0.3, top=0.52, width_gap=0.3, height_gap=0.6, grid=(rows, columns)
        )
    kind = {} if robot.planar else {"projection": "3d"}
    grid = figure.subplots(rows, columns, squeeze=False, subplot_kw=kind)
    for axes in grid.flat[count:]:
        axes.set_visible(False)
    panels = list(zip(grid.flat, result.drawn, strict=False))
    clouds = [points for axes, strategy in panels for points in draw_robot(axes, result, strategy)]
    ends = [(s.ways or (s.cycles,) * 2) for s in result.drawn]
    azimuth = best_azimuth([(np.vstack(robot.skeleton(a.q[-1])), np.vstack(robot.skeleton(b.q[-1]))) for a, b in ends])
    for zoom in ZOOMS:
        for axes, strategy in panels:
            title = f"{on_figure(strategy.name)}\n{_ending(strategy)}"
            frame_robot(axes, robot, clouds, title, azimuth=azimuth, zoom=zoom)
        if robot.planar or inside(figure):
            break
    return figure


def margins(
    figure: Any, *, left: float, right: float, bottom: float, top: float, width_gap: float = 0.0,
    height_gap: float = 0.0, grid: tuple[int, int] = (1, 1),
) -> None:  # fmt: skip
    """Fix the margins and gaps of a grid (rows, columns) of axes [inches]; automatic layout is slow."""
    width, height = figure.get_size_inches()
    rows, columns = grid
    cell_width = (width - left - right - width_gap * (columns - 1)) / columns
    cell_height = (height - bottom - top - height_gap * (rows - 1)) / rows
    figure.subplots_adjust(
        left=left / width, right=1 - right / width, bottom=bottom / height, top=1 - top / height,
        wspace=width_gap / cell_width, hspace=height_gap / cell_height,
    )  # fmt: skip


def draw_robot(axes: Any, result: JobResult, strategy: StrategyResult) -> list[Any]:
    """The robot at the start and at the end of each way, with the tool paths; returns the points drawn.

    The clockwise end is wide and light, the counter-clockwise one thin: neither covers the other.
    """
    robot = result.robot
    clouds = list(robot.skeleton(result.start))
    robot_stick(axes, robot, result.start, GREY, width=2.2)
    if strategy.ways is None:
        walks = ((strategy.cycles, CLOCKWISE),)
    else:
        walks = tuple(zip(strategy.ways, (CLOCKWISE, COUNTER), strict=True))
    for walk, look in walks:
        points = tool_points(result, walk)
        tool_path(axes, robot, points, **{**look, "linewidth": 1.4})
        wide = look is CLOCKWISE and strategy.ways is not None  # so that both are seen where they are one
        robot_stick(axes, robot, walk.q[-1], look["color"], width=6.0 if wide else 1.8, alpha=0.45 if wide else 1.0)
        clouds += [points, *robot.skeleton(walk.q[-1])]
    return clouds


def tool_points(result: JobResult, walk: Trajectory) -> Any:
    """Tool positions (k, 3) of at most 120 samples of a trajectory."""
    keep = np.unique(np.linspace(0, len(walk) - 1, min(len(walk), 120)).round().astype(int))
    return np.array([result.robot.pose(q)[:3, 3] for q in walk.q[keep]])


def _ending(strategy: StrategyResult) -> str:
    if strategy.ways is not None:
        return ways_end(strategy.ways)
    return stopped(strategy.cycles) or "at the end of the path"


def _drift(walk: Trajectory) -> str:
    parts = [away(walk, walk.cycles)] if walk.cycles else []
    return "; ".join([*parts, *filter(None, [stopped(walk)])])
