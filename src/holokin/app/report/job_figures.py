"""The figures of a job, composed of `plots` and `robot_panels`: name -> matplotlib Figure."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from textwrap import fill
from typing import Any

import numpy as np

from ...motion.trajectory import Status, Trajectory
from . import plots
from .job_result import JobResult, StrategyResult
from .plots import style
from .robot_panels import Actor, Curve, draw_panel, stage_of
from .sheets_plots import JUMPS, MAPPED, coverage_figure, sheet_motion_figure, sheets_figure

MAPS = (
    "Maps: planes through the centre of the workspace, the tool in its middle orientation, a cross at the start. "
    "Points: the poses sampled, with all their tilts and turns."
)
"""What a figure of coverage shows."""

CUTS = "Lines: there inverse kinematics jumps, poses on both sides have joints that no short path of the tool joins."
"""The same where there are such lines."""

WRAP = 44
"""Letters in a line of a legend."""

COLUMNS = 2
"""Panels side by side, at most: more would be too small to read in a page."""


MOST_PANELS = 12
"""Strategies in the picture of the robot: of more, those whose ends are farthest apart."""


def figures(result: JobResult) -> Iterator[tuple[str, str, Any]]:
    """(file stem, caption, Figure) of every figure of a job, made one at a time."""
    from matplotlib import rc_context

    for stem, caption, draw in _figures(result):
        with rc_context(style()):
            figure = plots.legible(draw())
        yield stem, caption, figure


def _figures(result: JobResult) -> Iterator[tuple[str, str, Callable[[], Any]]]:
    """(file stem, caption, what draws it) of each figure."""
    seen = result.printed
    # The robot, and its drift from cycle to cycle.
    if result.robot.tips:
        yield "robot", _robot_caption(result), lambda: robot_figure(result)
    if result.cycles > 1 and any(s.cycles.cycles for s in result.drawn):
        caption = (
            "The largest joint error after each cycle, on a logarithmic scale. A strategy that repeats here stays in "
            "the grey band, which is round-off; the other lines are what the robot has drifted."
        )
        yield "drift", caption, lambda: drift_figure(seen)
    if result.cycles > 1:
        caption = (
            f"How far each joint is from its start, over {result.cycles} cycles; pale upright lines end the cycles. "
            "Of a strategy that repeats here every line is back at zero at each of them."
        )
        yield "cycles", caption, lambda: cycles_figure(seen)
    # The two paths of each strategy, and the ranges of the joints.
    for s in seen.drawn:
        if s.two_paths is not None:
            caption = _two_paths_caption(result, s)
            yield f"paths-{result.stems[s.name]}", caption, lambda s=s: two_paths_figure(s, seen)
    if np.isfinite(result.robot.upper - result.robot.lower).any():
        caption = (
            "What the motion uses of each joint's range, from the lower to the upper limit. Bars near a dotted "
            "line have little left."
        )
        yield "ranges", caption, lambda: _ranges_figure(result)
    # The workspace, by strategies and by sheets.
    for s in result.drawn:
        if (coverage := s.coverage) is not None:
            sentences = [f"{coverage.sentence}.", coverage.remark, MAPS if s.slices else ""]
            sentences.append(CUTS if any(len(part.cuts) for part in s.slices) else "")
            caption = " ".join(filter(None, sentences))
            yield f"coverage-{result.stems[s.name]}", caption, lambda s=s, c=coverage: coverage_figure(c, s.slices)
    sheets = result.sheets
    if sheets is not None:
        yield "sheets", MAPPED, lambda: sheets_figure(sheets.found)
        if (along := sheets.along) is not None and along.pieces:
            yield "sheets-joints", JUMPS, lambda: sheet_motion_figure(along, result.robot)


def _robot_caption(result: JobResult) -> str:
    """What to see in the picture of the robot."""
    caption = "The robot at the start is pale pink. "
    if any(s.two_paths is not None for s in result.drawn):
        caption += (
            "Half a loop clockwise leads it to where it is light blue, half a loop counter-clockwise to the orange "
            "outline. The tool is at one pose in both: where the two robots differ, the joints depend on the path."
        )
    else:
        caption += "In colour it is at the end of its path: blue by a holonomic strategy, red by any other."
        caption += " Its joints are compared with none of another path there." if result.one_way else ""
    if len(result.drawn) > MOST_PANELS:
        caption += f" The {MOST_PANELS} of {len(result.drawn)} strategies whose ends are farthest apart are shown."
    return caption


def _two_paths_caption(result: JobResult, strategy: StrategyResult) -> str:
    """What to see in the picture of the two paths."""
    caption = (
        f"{strategy.name}: each joint over half a loop, clockwise (solid) and counter-clockwise (dashed), to the same "
        "tool pose. Dots that lie on each other: the joints do not depend on the path."
    )
    apart = strategy.metrics["same_joints"]
    if np.isfinite(apart):
        unit, factor = result.joint_unit
        caption += f" With the other representations of orientation the joints differ by {factor * apart:.1g} "
        caption += f"{unit} at most."
    return caption


def two_paths_figure(strategy: StrategyResult, result: JobResult | None = None) -> Any:
    """Joint histories by both ways, one panel a joint. [ZR11, Figs 4, 5, 8]"""
    from matplotlib.figure import Figure

    if strategy.two_paths is None:
        raise ValueError("a strategy without two paths has no such figure")
    clockwise, counter = strategy.two_paths
    n = len(clockwise.joint_names)
    columns = min(n, 2 if n == 4 else COLUMNS)
    rows = -(-n // columns)
    word = "holonomic" if strategy.verdict.holonomic else "not holonomic"
    title = f"{plots.on_figure(strategy.name)} ({word})"
    if Status.COMPLETE not in (clockwise.status, counter.status) or clockwise.status is not counter.status:
        title += "\n" + plots.paths_end(strategy.two_paths)
    top = 0.45 + 0.2 * (1 + title.count("\n"))
    bottom = 0.85 if n == rows * columns else 0.55
    figure = Figure(figsize=(max(4.4 * columns, 6.4), (2.6 if rows == 1 else 1.6) * rows + bottom + top))
    margins(figure, left=0.85, right=0.85, bottom=bottom, top=top, width_gap=1.5, height_gap=0.42, grid=(rows, columns))
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True)
    for joint in range(n):
        plots.joint_histories(grid.flat[joint], clockwise, counter, joint, result.robot if result else None)
    for column in range(columns):
        last = max(r for r in range(rows) if r * columns + column < n)
        grid[last, column].set_xlabel("time [s]")
        grid[last, column].tick_params(labelbottom=True)
    legend(figure, grid, n)
    figure.suptitle(title, fontsize=12, fontweight="bold", y=1 - 0.08 / figure.get_figheight(), va="top")
    return figure


def legend(figure: Any, grid: Any, count: int) -> None:
    """One legend for a grid of which `count` cells are used: in the empty cells, or below where there are none."""
    named: dict[str, Any] = {}
    for axes in grid.flat[:count]:
        handles, labels = axes.get_legend_handles_labels()
        named = dict(zip(labels, handles, strict=True)) | named
    handles, labels = list(named.values()), [fill(label, WRAP) for label in named]
    for axes in grid.flat[count:]:
        axes.set_visible(False)
    if count == grid.size:
        figure.legend(handles, labels, loc="lower center", ncols=_columns(labels, figure.get_figwidth()))
        return
    first, last = grid.flat[count].get_position(), grid.flat[-1].get_position()
    center = ((first.x0 + last.x1) / 2, (last.y0 + first.y1) / 2)
    figure.legend(handles, labels, loc="center", bbox_to_anchor=center, ncols=-(-len(labels) // 4), fontsize=11)


def _columns(labels: list[str], width: float) -> int:
    """Columns of a legend that fit into a width [inches]."""
    longest = max(len(line) for label in labels for line in label.split("\n"))
    return max(1, min(7, len(labels), int(width / (0.6 + 0.078 * longest))))


def cycles_figure(result: JobResult) -> Any:
    """Joint histories over the cycles, one panel a strategy, on one scale. [ZR11, Fig. 6]"""
    from matplotlib.figure import Figure

    # The panels, and the joints that have a colour.
    count = len(result.drawn)
    columns = min(count, COLUMNS)
    rows = -(-count // columns)
    named = plots.movers([s.cycles for s in result.drawn])
    names = [plots.on_figure(name, 30) for name in result.robot.joint_names]
    rest = fill(f"grey: {', '.join(names[j] for j in range(len(names)) if j not in named)}", WRAP)
    labels = [names[j] for j in named] + ([rest] if len(named) < len(names) else [])
    # The size of the figure, with room for the legend.
    wide = 3.9 * columns + 1.0
    lines = -(-len(labels) // _columns(labels, wide)) + rest.count("\n") * (len(named) < len(names))
    bottom = 0.73 + 0.22 * lines if count == rows * columns else 0.6
    figure = Figure(figsize=(wide, 3.1 * rows + bottom))
    margins(
        figure, left=0.75, right=0.15, bottom=bottom, top=0.55, width_gap=0.25, height_gap=0.6, grid=(rows, columns)
    )
    grid = figure.subplots(rows, columns, squeeze=False, sharey=True, sharex=True)
    # The joints of each strategy.
    for k, (axes, strategy) in enumerate(zip(grid.flat, result.drawn, strict=False)):
        plots.joint_cycles(axes, strategy.cycles, named)
        walk = strategy.cycles
        ends = [plots.away(walk, walk.cycles)] if walk.cycles else []
        words = "; ".join(filter(None, [*ends, plots.stopped(walk)]))
        axes.set_title(f"{plots.on_figure(strategy.name)}\n{words}", loc="left", fontsize=10)
        below = k + columns < count
        axes.tick_params(labelbottom=not below)
        axes.set_xlabel("" if below else "time [s]")
    unit = " or ".join(dict.fromkeys(result.drawn[0].cycles.joint_units))
    for axes in grid[:, 0]:
        axes.set_ylabel(f"q - q(0) [{unit}]")
    legend(figure, grid, count)
    return figure


def strategy_colors(result: JobResult) -> dict[str, str]:
    """Name -> the colour of a strategy in all pictures of a result."""
    names = [s.name for s in result.drawn]
    return dict(zip(names, plots.law_colors([s.verdict.holonomic for s in result.drawn]), strict=True))


def drift_figure(result: JobResult) -> Any:
    """Drift after each cycle, all strategies in one."""
    from matplotlib.figure import Figure

    done = [s for s in result.drawn if s.cycles.cycles]
    walks = {plots.on_figure(s.name, 40): s.cycles for s in done}
    room = 0.5 + 0.08 * max(26 if len(walks) > plots.LABELS else 0, *map(len, walks))
    figure = Figure(figsize=(6.2 + room, 4.0))
    margins(figure, left=0.85, right=room, bottom=0.6, top=0.2)
    colors = strategy_colors(result)
    plots.drift_per_cycle(figure.subplots(), walks, [colors[s.name] for s in done])
    return figure


def _ranges_figure(result: JobResult) -> Any:
    """What each strategy uses of the joints' ranges."""
    from matplotlib.figure import Figure

    # At most so many strategies have bars.
    shown = result.drawn[:6]
    rows = int(np.isfinite(result.robot.upper - result.robot.lower).sum())
    figure = Figure(figsize=(7.6, 0.9 + rows * max(0.32, 0.13 * len(shown)) + 0.24 * -(-len(shown) // 3)))
    margins(figure, left=1.7, right=0.45, bottom=0.45 + 0.24 * -(-len(shown) // 3), top=0.15)
    walks = {plots.on_figure(s.name, 40): s.cycles for s in shown}
    colors = strategy_colors(result)
    axes = plots.joint_ranges(figure.subplots(), result.robot, walks, [colors[s.name] for s in shown])
    figure.legend(*axes.get_legend_handles_labels(), loc="lower center", ncols=3, fontsize=9)
    return figure


def robot_figure(result: JobResult) -> Any:
    """The robot, one panel a strategy: the start in pale pink, the two ends in the colours of their ways."""
    from matplotlib.figure import Figure

    # The strategies whose ends are farthest apart, in the order of the job.
    order = sorted(range(len(result.drawn)), key=lambda i: -_apart(result.drawn[i]))[:MOST_PANELS]
    drawn = [result.drawn[i] for i in sorted(order)]
    columns = min(len(drawn), COLUMNS)
    rows = -(-len(drawn) // columns)
    # One scene for all, of their postures, ends and paths.
    casts = [cast(result, s) for s in drawn]
    pairs = [(s.two_paths[0].q[-1], s.two_paths[1].q[-1]) for s in drawn if s.two_paths is not None]
    pairs = pairs or [(s.cycles.q[0], s.cycles.q[-1]) for s in drawn]
    postures = np.array([actor.q for actors, _ in casts for actor in actors])
    curves = [curve for _, of_tools in casts for curve in of_tools]
    stage = stage_of(result.robot, postures, curves, pairs=pairs, obstacles=result.obstacles)
    # The size of the figure, from that of a panel and of the titles.
    wide, tall = stage.scene.shape
    width = {1: 5.4, 2: 4.6}.get(columns, 3.75 if result.robot.planar else 4.1)
    side = (0.8, 0.15, 0.55) if result.robot.planar else (0.12, 0.12, 0.12)  # left, right, bottom
    height = width * tall / wide
    names = [s.name for s in drawn]
    printed = [s for s in result.printed.strategies if s.name in names]
    titles = [f"{plots.on_figure(drawn[k].name)}\n{_ending(s)}" for k, s in enumerate(printed)]
    top = 0.26 + 0.17 * max(title.count("\n") + 1 for title in titles)
    gap = (side[0] if result.robot.planar else 0.2, top + (side[2] if result.robot.planar else 0.1))
    size = (
        columns * width + side[0] + side[1] + (columns - 1) * gap[0],
        rows * height + side[2] + KEY + top + (rows - 1) * gap[1],
    )
    figure = Figure(figsize=size)
    around = {"left": side[0], "right": side[1], "bottom": side[2] + KEY, "top": top}
    margins(figure, **around, width_gap=gap[0], height_gap=gap[1], grid=(rows, columns))
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes in grid.flat[len(drawn) :]:
        axes.set_visible(False)
    for axes, (actors, curves), title in zip(grid.flat, casts, titles, strict=False):
        draw_panel(axes, stage, actors, curves, title)
        if result.robot.planar and axes not in grid[:, 0]:
            axes.set_ylabel("")
    _key(figure, drawn)
    return figure


KEY = 0.3
"""Height of the line that names the colours [inch]."""


def _key(figure: Any, drawn: list[StrategyResult]) -> None:
    """Which posture has which colour."""
    from matplotlib.lines import Line2D

    marks: list[tuple[str, str, Any]] = [(plots.START, "start", "-")]
    if any(s.two_paths is not None for s in drawn):
        marks += [(plots.CLOCKWISE, "end, clockwise", "-"), (plots.COUNTER_CLOCKWISE, "end, counter-clockwise", "--")]
    else:
        marks.append((plots.INK, "end, in the colour of the strategy", "-"))
    handles = [Line2D([], [], color=color, linestyle=style, linewidth=4, label=name) for color, name, style in marks]
    figure.legend(handles=handles, loc="lower center", fontsize=9, ncols=len(handles), frameon=False)


def cast(result: JobResult, strategy: StrategyResult) -> tuple[list[Actor], list[Curve]]:
    """The postures to show of a strategy, and its tool's paths; the start is pale, the second path an outline."""
    actors = [Actor(result.q0, plots.START, "ghost")]
    if strategy.two_paths is None:
        points, color = tool_points(result, strategy.cycles), strategy_colors(result)[strategy.name]
        return [*actors, Actor(strategy.cycles.q[-1], color)], [Curve(p, plots.LOOP) for p in points]
    clockwise, counter = strategy.two_paths
    actors += [Actor(clockwise.q[-1], plots.CLOCKWISE), Actor(counter.q[-1], plots.COUNTER_CLOCKWISE, "outline")]
    curves = [Curve(points, plots.CLOCKWISE) for points in tool_points(result, clockwise)]
    return actors, curves + [Curve(points, plots.COUNTER_CLOCKWISE, 3) for points in tool_points(result, counter)]


def _apart(strategy: StrategyResult) -> float:
    """How far the two paths end apart, or the last posture from the first."""
    pair = strategy.two_paths
    gap = pair[0].q[-1] - pair[1].q[-1] if pair else strategy.cycles.q[-1] - strategy.cycles.q[0]
    return float(np.abs(gap).max())


def margins(
    figure: Any,
    *,
    left: float,
    right: float,
    bottom: float,
    top: float,
    width_gap: float = 0.0,
    height_gap: float = 0.0,
    grid: tuple[int, int] = (1, 1),
) -> None:
    """Fix the margins and gaps of a grid (rows, columns) of axes [inches]; automatic layout is slow."""
    width, height = figure.get_size_inches()
    rows, columns = grid
    cell_width = (width - left - right - width_gap * (columns - 1)) / columns
    cell_height = (height - bottom - top - height_gap * (rows - 1)) / rows
    figure.subplots_adjust(left / width, bottom / height, 1 - right / width, 1 - top / height)
    figure.subplots_adjust(wspace=width_gap / cell_width, hspace=height_gap / cell_height)


def tool_points(result: JobResult, walk: Trajectory) -> list[Any]:
    """Positions (k, 3) of every tip, at most 120 samples of a trajectory."""
    keep = plots.thin(len(walk), 120)
    return [result.robot.pose_batch(walk.q[keep], tip.name)[0] for tip in result.robot.tips]


def _ending(strategy: StrategyResult) -> str:
    if strategy.two_paths is not None:
        return plots.paths_end(strategy.two_paths)
    return plots.stopped(strategy.cycles) or "at the end of the path"
