"""The figures of a job, composed of `plots`: name -> matplotlib Figure."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..trajectory import Trajectory
from .plots import (
    CLOCKWISE,
    COUNTER,
    GREY,
    drift_per_cycle,
    frame_robot,
    joint_cycles,
    joint_ways,
    robot_stick,
    style,
    tool_path,
)  # fmt: skip
from .result import JobResult, StrategyResult


def figures(result: JobResult) -> Iterator[tuple[str, str, Any]]:
    """(file stem, caption, Figure) of every figure of a job, made one at a time."""
    from matplotlib import rc_context

    with rc_context(style()):
        yield "robot", "The robot at the start (grey) and where each way has led it.", robot_figure(result)
    for strategy in result.drawn:
        if strategy.ways is not None:
            with rc_context(style()):
                caption = f"{strategy.name}: joints over half a loop, clockwise (solid) and counter-clockwise (dashed)."
                apart = strategy.figures["same_joints"]
                if np.isfinite(apart):
                    caption += f" The other representations of orientation lie within {apart:.1g} of it."
                yield f"ways-{slug(strategy.name)}", caption, ways_figure(strategy)
    if result.cycles > 1:
        with rc_context(style()):
            yield "cycles", f"Joints, less their start values, over {result.cycles} cycles.", cycles_figure(result)
        with rc_context(style()):
            yield "drift", "Joint drift after each cycle.", drift_figure(result)


def slug(name: str) -> str:
    """A file name of a strategy's name."""
    return "".join(c if c.isalnum() or c == "-" else "-" for c in name).strip("-").replace("--", "-")


def ways_figure(strategy: StrategyResult) -> Any:
    """Joint histories by both ways, one panel a joint. [ZR11, Figs 4, 5, 8]"""
    from matplotlib.figure import Figure

    if strategy.ways is None:
        raise ValueError("a strategy without two ways has no such figure")
    clockwise, counter = strategy.ways
    n = len(clockwise.joint_names)
    columns = 1 if n <= 3 else 2 if n <= 6 else 3
    rows = -(-n // columns)
    figure = Figure(figsize=(4.4 * columns if columns > 1 else 6.4, 1.9 * rows + 1.1))
    margins(figure, left=0.7, right=0.15, bottom=0.85, top=0.65, width_gap=0.75, height_gap=0.42, grid=(rows, columns))
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True)
    for joint in range(n):
        joint_ways(grid.flat[joint], clockwise, counter, joint)
    for axes in grid.flat[n:]:
        axes.set_visible(False)
    for column in range(columns):
        last = max(r for r in range(rows) if r * columns + column < n)
        grid[last, column].set_xlabel("time [s]")
        grid[last, column].tick_params(labelbottom=True)
    handles, labels = grid.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=2)
    word = "holonomic" if strategy.verdict.holonomic else "not holonomic"
    figure.suptitle(
        f"{strategy.name} ({word})", fontsize=12, fontweight="bold", y=1 - 0.08 / figure.get_figheight(), va="top"
    )
    return figure


def cycles_figure(result: JobResult) -> Any:
    """Joint histories over the cycles, one panel a strategy, on one scale. [ZR11, Fig. 6]"""
    from matplotlib.figure import Figure

    count = len(result.drawn)
    figure = Figure(figsize=(3.9 * count + 1.0, 4.1))
    margins(figure, left=0.75, right=0.15, bottom=0.95, top=0.55, width_gap=0.25, grid=(1, count))
    grid = figure.subplots(1, count, squeeze=False, sharey=True)[0]
    for axes, strategy in zip(grid, result.drawn, strict=True):
        joint_cycles(axes, strategy.cycles)
        drift = _drift(strategy.cycles)
        axes.set_title(f"{strategy.name}\n{drift}", loc="left", fontsize=10)
    grid[0].set_ylabel("q - q(0) [rad or m]")
    handles, labels = grid[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=min(7, len(labels)))
    return figure


def drift_figure(result: JobResult) -> Any:
    """Drift after each cycle, all strategies in one."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.0))
    margins(figure, left=0.85, right=0.15, bottom=0.6, top=0.2)
    walks = {s.name: s.cycles for s in result.drawn if s.cycles.cycles}
    axes = drift_per_cycle(figure.subplots(), walks)
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, 0.72))
    return figure


def robot_figure(result: JobResult) -> Any:
    """Stick figures, one panel a strategy: start in grey, the two ends in the colours of their ways."""
    from matplotlib.figure import Figure

    robot = result.robot
    count = len(result.drawn)
    columns = min(count, 4)
    rows = -(-count // columns)
    figure = Figure(figsize=(4.0 * columns, 4.2 * rows))
    if robot.planar:
        margins(figure, left=0.65, right=0.15, bottom=0.6, top=0.6, width_gap=0.6, height_gap=0.9, grid=(rows, columns))
    else:  # 3-D axes leave room of their own, but for the last labels
        margins(
            figure, left=0.05, right=0.25, bottom=0.15, top=0.52, width_gap=0.3, height_gap=0.6, grid=(rows, columns)
        )
    kind = {} if robot.planar else {"projection": "3d"}
    grid = figure.subplots(rows, columns, squeeze=False, subplot_kw=kind)
    for axes in grid.flat[count:]:
        axes.set_visible(False)
    panels = list(zip(grid.flat, result.drawn, strict=False))
    clouds = [points for axes, strategy in panels for points in draw_robot(axes, result, strategy)]
    for axes, strategy in panels:
        frame_robot(axes, robot, clouds, f"{strategy.name}\n{_spread(strategy)}")
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
    """The robot at the start and at the end of each way, with the tool paths; returns the points drawn."""
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
        robot_stick(axes, robot, walk.q[-1], look["color"], style=look["linestyle"], width=2.6)
        clouds += [points, *robot.skeleton(walk.q[-1])]
    return clouds


def tool_points(result: JobResult, walk: Trajectory) -> Any:
    """Tool positions (k, 3) of at most 120 samples of a trajectory."""
    keep = np.unique(np.linspace(0, len(walk) - 1, min(len(walk), 120)).round().astype(int))
    return np.array([result.robot.pose(q)[:3, 3] for q in walk.q[keep]])


def _spread(strategy: StrategyResult) -> str:
    spread = strategy.figures["spread"]
    if not np.isfinite(spread):
        return strategy.status.value
    return "both ways end alike" if spread < 1e-8 else f"the two ways end {spread:.3g} rad apart"


def _drift(walk: Trajectory) -> str:
    if not walk.cycles:
        return "stopped in the first cycle"
    total = np.abs(walk.drift_since_start()[-1]).max()
    return f"after {walk.cycles} cycles: " + ("back home" if total < 1e-8 else f"{total:.3g} rad away")
