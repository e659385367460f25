"""Pictures of coverage, of maps of sheets, and of a motion over sheets."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import Any

import numpy as np

from ...analysis.coverage import Coverage, PoseStatus, Slice
from ...analysis.coverage.cover_workspace import Plane, grid_planes, neighbouring_cells
from ...analysis.coverage.starts import reached
from ...analysis.sheets import PoseRest, SheetMotion, Sheets
from ...base.types import Array, Indices, Matrix
from ...motion.ik.inverse_function import leads_to
from ...path.workspaces import PoseRange
from ...robot import Robot
from . import plots

# --- Pictures of coverage: slices through a workspace and the cloud of its poses. Each takes an Axes and returns it.

CAUSES = {
    PoseStatus.LIMIT: (plots.ORANGE, "joint limit"),
    PoseStatus.BLOCKED: (plots.SKY, "too near to something"),
    PoseStatus.ALGORITHMIC: (plots.VERMILLION, "strategy singular on the way"),
    PoseStatus.KINEMATIC: (plots.PURPLE, "arm singular on the way"),
    PoseStatus.REPRESENTATION: (plots.YELLOW, "angles not defined on the way"),
    PoseStatus.STOPPED: (plots.BLACK, "no path shown"),
    PoseStatus.BEYOND_LIMITS: ("#6b7480", "no posture within limits"),
    PoseStatus.OUT_OF_REACH: ("#b4bcc8", "out of reach"),
}
"""Colour and short name of each cause: what the strategy loses in strong colours, what none reaches in greys."""

CUT = "#d6006c"
"""Colour of the lines across which the joints jump."""

_AXES = "xyz"


def slice_map(axes: Any, part: Slice, most: float | None = None) -> Any:
    """A slice as a map: reached cells shaded by rcond, the others in the colour of their cause; a cross at the start.

    Lines are where `ik(pose)` jumps from a cell to the next.

    Args:
        most: rcond of the darkest shade; by default the greatest of the slice.
    """
    from matplotlib.colors import to_rgb
    from matplotlib.patheffects import withStroke

    status, rcond = part.grid(part.coverage.status), part.grid(part.coverage.rcond)
    image = np.ones((*status.shape, 3))
    reached = status == PoseStatus.REACHED
    most = most or _greatest([part.coverage])
    image[reached] = shades()(np.clip(rcond[reached] / most, 0, 1))[:, :3]
    for cause, (color, _) in CAUSES.items():
        image[status == cause] = to_rgb(color)
    i, j = part.axes
    extent = _plane_map(axes, part, image, part.coverage.poses[part.cuts][:, :, [i, j], 3])
    tool = part.coverage.tool[:3, 3]
    if extent[0] <= tool[i] <= extent[1] and extent[2] <= tool[j] <= extent[3]:
        around = [withStroke(linewidth=4, foreground="white")]  # it has to be seen on dark cells, too
        axes.plot(tool[i], tool[j], "+", color=plots.INK, markersize=9, markeredgewidth=1.6, path_effects=around)
    axes.set_title(f"{_AXES[3 - i - j]} = {part.at:.3g} m: {part.coverage.share:.0%}", loc="left", fontsize=10)
    return axes


def _plane_map(axes: Any, plane: Slice | Plane, image: Array, cuts: Array) -> tuple[float, float, float, float]:
    """Draw the cells of a plane by their colours (rows, columns, 3), and a line between each of some pairs of cells.

    Args:
        cuts: the places of the two cells of each pair (c, 2, 2).

    Returns:
        The ends of the plane, left, right, bottom, top [m].
    """
    (i, j), (du, dv) = plane.axes, (plane.u[1] - plane.u[0], plane.v[1] - plane.v[0])
    extent = (plane.u[0] - du / 2, plane.u[-1] + du / 2, plane.v[0] - dv / 2, plane.v[-1] + dv / 2)
    axes.imshow(image, origin="lower", extent=extent, interpolation="nearest", aspect="equal")
    for first, second in cuts:  # the side between the two cells
        middle, along = (first + second) / 2, np.where(np.abs(second - first) > 1e-9, 0.0, [du / 2, dv / 2])
        axes.plot(*np.transpose([middle - along, middle + along]), color=CUT, linewidth=1.8, solid_capstyle="butt")
    axes.grid(False)
    axes.locator_params(nbins=5)
    axes.set_xlabel(f"{_AXES[i]} [m]")
    axes.set_ylabel(f"{_AXES[j]} [m]")
    return extent


def coverage_cloud(axes: Any, coverage: Coverage, most: float | None = None, seen: Matrix | None = None) -> Any:
    """All poses at their positions in space: reached ones small, shaded by rcond, the others larger, by their cause.

    Args:
        axes: in space (projection "3d"), or in the plane where all poses are in one.
        most: rcond of the darkest shade; by default the greatest of the coverage.
        seen: where the poses are in a picture in the plane, which has its robot already.
    """
    p, status = coverage.poses[:, :3, 3], coverage.status
    flat = not hasattr(axes, "get_zlim")
    points = (p if seen is None else seen)[:, :2].T if flat else p.T
    most = most or _greatest([coverage])
    reached = status == PoseStatus.REACHED
    color = shades()(np.clip(coverage.rcond[reached] / most, 0, 1))
    style = {"linewidths": 0, "zorder": 4} if flat else {"linewidths": 0, "depthshade": False}
    for cause in reversed(CAUSES):  # what the strategy loses last, over the rest
        of_cause = status == cause
        lost = cause < PoseStatus.BEYOND_LIMITS
        if of_cause.any():  # an empty cloud would move the limits of the axes
            axes.scatter(*points[:, of_cause], color=CAUSES[cause][0], s=22 if lost else 9, **style)
    if reached.any():
        axes.scatter(*points[:, reached], color=color, s=7, alpha=0.9 if flat else 0.45, **style)
    if flat and seen is None:
        axes.set_aspect("equal")
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
    return axes


def coverage_figure(coverage: Coverage, slices: Sequence[Slice] = ()) -> Any:
    """The slices as views on one scale (from above, from the front, from the side), the cloud, causes and the scale.

    The maps of x-y and x-z lie over each other, those of x-z and y-z side by side, as in a drawing.
    """
    p = coverage.poses[:, :3, 3]
    flat = bool(np.ptp(p[:, 2]) < 1e-9)
    figure, maps, cloud, right = views(p, slices)
    size = figure.get_size_inches()
    every = [coverage, *(part.coverage for part in slices)]
    most = _greatest(every)
    for part, axes in zip(slices, maps, strict=True):
        slice_map(axes, part, most)
    coverage_cloud(cloud, coverage, most)
    cloud.set_title(f"{len(coverage)} poses: {coverage.share:.1%}", loc="left", fontsize=10)
    if not flat:
        _frame_cloud(cloud, p)
    within = "within the joint limits" if coverage.limits else "joint limits aside"
    head = f"{plots.on_figure(coverage.name)} reaches {coverage.share:.1%} of the workspace {within}"
    figure.suptitle(head, x=0.2 / size[0], y=1 - 0.15 / size[1], ha="left", va="top", fontsize=12, color=plots.INK)
    cut = any(len(part.cuts) for part in slices)
    _explain(figure, coverage, every, most, 1 - (right - 0.75) / size[0], cut)
    return figure


def views(points: Matrix, planes: Sequence[Slice | Plane]) -> tuple[Any, list[Any], Any, float]:
    """(an empty figure, axes for a map of each plane, axes for the cloud of points (k, 3), width [inch] of the margin
    at the right, which is for a legend)."""
    from matplotlib.figure import Figure

    widths, heights, places = _layout(points, planes)
    flat = bool(np.ptp(points[:, 2]) < 1e-9)
    scale = min(4.6 / sum(widths), 4.8 / sum(heights))
    wide, tall = scale * sum(widths), max(scale * sum(heights), 2.4)
    left, right, bottom, top, gap = 0.9, 3.7, 0.6, 0.95, 0.8
    size = (wide + left + right + gap * (len(widths) - 1), tall + bottom + top + gap * (len(heights) - 1))
    figure = Figure(figsize=size)
    grid = figure.add_gridspec(len(heights), len(widths), width_ratios=widths, height_ratios=heights)
    grid.update(left=left / size[0], right=1 - right / size[0], bottom=bottom / size[1], top=1 - top / size[1])
    grid.update(wspace=gap * len(widths) / wide, hspace=gap * len(heights) / tall)
    maps = [figure.add_subplot(grid[place]) for place in places]
    cloud = figure.add_subplot(grid[0, len(widths) - 1], projection=None if flat else "3d")
    return figure, maps, cloud, right


def _layout(points: Matrix, slices: Sequence[Slice | Plane]) -> tuple[list[float], list[float], list[tuple[int, int]]]:
    """(widths of the columns, heights of the rows [m], (row, column) of each slice); the cloud is at the top right."""
    sides = [(float(np.ptp(part.u)), float(np.ptp(part.v))) for part in slices]
    if len(sides) == 3:
        widths, heights, places = [sides[0][0], sides[2][0]], [sides[0][1], sides[1][1]], [(0, 0), (1, 0), (1, 1)]
    elif sides:
        widths, heights, places = [sides[0][0]] * 2, [sides[0][1]], [(0, 0)]
    else:
        widths, heights, places = [float(np.ptp(points[:, 0]))], [float(np.ptp(points[:, 1]))], []
    smallest = max(0.3 * max(*widths, *heights), 1e-3)  # thin or single ones shall be seen
    return [max(w, smallest) for w in widths], [max(h, smallest) for h in heights], places


def _explain(figure: Any, coverage: Coverage, every: Sequence[Coverage], most: float, left: float, cut: bool) -> None:
    """The causes with their shares, and the scale of rcond, right of a place."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    width, height = figure.get_size_inches()
    patches = [
        Patch(color=color, label=f"{name}: {coverage.count(cause) / len(coverage):.1%}")
        for cause, (color, name) in CAUSES.items()
        if any(c.count(cause) for c in every)
    ]
    cross = {"color": plots.INK, "marker": "+", "linestyle": "", "markersize": 9, "markeredgewidth": 1.6}
    start = [Line2D([], [], label="tool at the start (projected)", **cross)] if len(every) > 1 else []
    lines = [Line2D([], [], color=CUT, linewidth=1.8, label="ik(pose) jumps")] if cut else []
    corner = (left - 0.1 / width, 1 - 0.8 / height)
    figure.legend(handles=[*patches, *lines, *start], loc="upper left", bbox_to_anchor=corner, fontsize=9)
    bar = figure.add_axes((left, 0.6 / height, 0.16 / width, min(2.2, height / 2 - 0.5) / height))
    figure.colorbar(ScalarMappable(Normalize(0, most), shades()), cax=bar, label="reached: rcond of [J; J_g]")


def shades() -> Any:
    """The colour map of reached poses."""
    from matplotlib.colors import LinearSegmentedColormap

    # Reached poses from rcond 0, light, to the greatest of the picture, dark.
    return LinearSegmentedColormap.from_list("reached", ("#b9e0d2", "#74bfa7", "#1f7a6b", "#0b3d3a"))


def _greatest(every: Sequence[Coverage]) -> float:
    """The greatest rcond of some coverages; 1 where nothing is reached."""
    rconds = [c.rcond[c.reached].max() for c in every if c.reached.any()]
    return float(max(rconds)) if rconds else 1.0


def _frame_cloud(axes: Any, points: Matrix) -> None:
    """Axes in space round points (k, 3), with few numbers at them."""
    from matplotlib.ticker import MaxNLocator

    low, high = points.min(axis=0), points.max(axis=0)
    axes.set_box_aspect(np.maximum(high - low, max(0.25 * float((high - low).max()), 1e-3)), zoom=1.15)
    axes.view_init(elev=22, azim=-60)
    for axis, name in ((axes.xaxis, "x"), (axes.yaxis, "y"), (axes.zaxis, "z")):
        axis.pane.set_facecolor("#fafafa")
        axis.set_major_locator(MaxNLocator(4))
        axis.set_tick_params(labelsize=7, pad=-2)
        axis.set_label_text(f"{name} [m]", fontsize=8)
        axis.labelpad = -3


# --- Pictures of a map of sheets: which sheet serves which pose, and where the joints change.

SHEETS = ("#1f7a6b", plots.SKY, plots.ORANGE, "#3b4ba0", plots.YELLOW, plots.VERMILLION, plots.PURPLE)
"""Colours of the sheets, the first one's first; of more they come again."""

NONE = "#d5dae1"
"""Colour of cells that no sheet serves."""

REST = {
    PoseRest.NOT_COVERED: (plots.BLACK, "reached, by no sheet"),
    PoseRest.BLOCKED: ("#4b5563", "too near to something"),
    PoseRest.LIMITS: ("#8a93a0", "beyond joint limits"),
    PoseRest.OUT_OF_REACH: ("#c5ccd6", "out of reach"),
}
"""Colour and short name of what becomes of a pose without a sheet."""

MAPPED = (
    "The sheets of the workspace: the planes through its centre, the tool in its middle orientation, and all poses "
    "that were sampled. Each has the colour of the sheet that serves it. Shares are of the poses that the arm reaches, "
    "unless it says `of all`."
)
"""What a figure of sheets shows."""

STEPS = 41
"""Cells along the longest side."""


def sheets_figure(sheets: Sheets, steps: int = STEPS) -> Any:
    """Maps of the planes through the workspace's centre, in its middle orientation, and the cloud of all poses.

    Lines are where the joints jump from a cell to the next: there the arm changes its posture.

    Args:
        steps: cells along the longest side of a map, at least 2.
    """
    p = sheets.poses[:, :3, 3]
    planes = list(grid_planes(sheets.workspace, steps)) if isinstance(sheets.workspace, PoseRange) else []
    figure, maps, cloud, _ = views(p, planes)
    jumps = False
    for axes, plane in zip(maps, planes, strict=True):
        jumps |= _map(axes, sheets, sheets.workspace, plane)
    _cloud(cloud, sheets)
    many = f"{len(sheets)} sheet{'' if len(sheets) == 1 else 's'}"
    head = f"{plots.on_figure(sheets.task.robot.name)}: {many} for {sheets.share:.1%} of what the arm reaches"
    size = figure.get_size_inches()
    figure.suptitle(head, x=0.2 / size[0], y=1 - 0.15 / size[1], ha="left", va="top", fontsize=12, color=plots.INK)
    _legend(figure, sheets, bool(planes), jumps)
    return figure


def sheet_color(s: int) -> str:
    """The colour of a sheet."""
    return SHEETS[s % len(SHEETS)]


def _map(axes: Any, sheets: Sheets, space: Any, plane: Plane) -> bool:
    """One plane; returns whether the joints jump in it."""
    from matplotlib.colors import to_rgb

    poses = space.at(plane.points[plane.inside.ravel()])
    within = np.flatnonzero(reached(sheets.task, poses, None).within)  # a sheet takes long to say no
    answers = sheets.batch(poses[within])
    sheet, q = np.full(len(poses), -1), np.full((len(poses), sheets.task.n), np.nan)
    sheet[within], q[within] = answers.sheet, answers.q
    labels = np.full(plane.inside.shape, -2)
    labels[plane.inside] = sheet
    image = np.ones((*labels.shape, 3))
    image[labels == -1] = to_rgb(NONE)
    for s in range(len(sheets)):
        image[labels == s] = to_rgb(sheet_color(s))
    cuts = _jumps(sheets, poses, q, sheet, neighbouring_cells(plane.inside))
    i, j = plane.axes
    _plane_map(axes, plane, image, poses[cuts][:, :, [i, j], 3])
    axes.set_title(f"{'xyz'[3 - i - j]} = {plane.at:.3g} m", loc="left", fontsize=10)
    return bool(len(cuts))


def _jumps(sheets: Sheets, poses: Array, q: Array, sheet: Indices, pairs: Indices) -> Indices:
    """Those of some pairs (e, 2) of poses, both with a sheet, between which the joints do not continue."""
    both = pairs[(sheet[pairs] >= 0).all(axis=1)]
    cut = [
        (sheet[i] != sheet[j] and np.abs(q[i] - q[j]).max() > 0.2)
        or (sheet[i] == sheet[j] and not leads_to(sheets.sheets[sheet[i]].ik, poses[j], q[i], q[j]))
        for i, j in both
    ]
    return both[np.array(cut, dtype=bool)] if len(both) else both


def _cloud(axes: Any, sheets: Sheets) -> None:
    """All sampled poses at their positions."""
    p, flat = sheets.poses[:, :3, 3], not hasattr(axes, "get_zlim")
    points = p[:, :2].T if flat else p.T
    style = {"linewidths": 0} if flat else {"linewidths": 0, "depthshade": False}
    for rest in reversed(REST):
        of_rest = sheets.rest == rest
        if of_rest.any():
            axes.scatter(*points[:, of_rest], color=REST[rest][0], s=16 if rest is PoseRest.NOT_COVERED else 5, **style)
    for s in range(len(sheets)):
        of_rest = sheets.labels == s
        if of_rest.any():
            axes.scatter(*points[:, of_rest], color=sheet_color(s), s=9, alpha=0.9 if flat else 0.6, **style)
    axes.set_title(f"{len(p)} poses", loc="left", fontsize=10)
    if flat:
        axes.set_aspect("equal")
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
    else:
        _frame_cloud(axes, p)


def _lines(name: str) -> str:
    """A sheet's name in lines of the legend."""
    return fill(plots.on_figure(name, 60), 28)


def _share(sheets: Sheets, rest: PoseRest) -> str:
    """How many poses have no sheet for a reason: of those in reach, or of all."""
    count, every = int((sheets.rest == rest).sum()), len(sheets.poses)
    within = int(sheets.reachable.sum())
    return f"{count / within:.1%}" if rest is PoseRest.NOT_COVERED else f"{count / every:.1%} of all"


def _legend(figure: Any, sheets: Sheets, maps: bool, jump: bool) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    within = max(1, int(sheets.reachable.sum()))
    width, height = figure.get_size_inches()
    patches = [
        Patch(color=sheet_color(s), label=f"sheet {s}: {(sheets.labels == s).sum() / within:.1%}\n{_lines(sheet.name)}")
        for s, sheet in enumerate(sheets.sheets)
    ]
    patches += [
        Patch(color=color, label=f"{name}: {_share(sheets, rest)}")
        for rest, (color, name) in REST.items()
        if (sheets.rest == rest).any()
    ]
    patches += [Patch(color=NONE, label="no sheet (maps)")] if maps else []
    lines = [Line2D([], [], color=CUT, linewidth=1.8, label="the joints jump here")] if jump else []
    corner = (1 - 2.95 / width, 1 - 0.8 / height)
    figure.legend(handles=[*patches, *lines], loc="upper left", bbox_to_anchor=corner, fontsize=8.5, frameon=False)


JUMPS = (
    "The joints along the job's path on the sheets. The bar below has the colour of the sheet that serves. At a line "
    "across the panel the sheet changes: drawn through, by a self-motion with the tool at rest; dashed, the arm must "
    "leave the path to go on."
)
"""What to see in the picture."""


def sheet_motion_figure(motion: SheetMotion, robot: Robot) -> Any:
    """Every joint over the share of the path, a bar of the sheets below, lines at changes and divisions.

    Of many joints those that move most have a colour each, the others are grey.
    """
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    # The joints over the path, and the sheets below.
    figure = Figure(figsize=(7.2, 3.9))
    axes, bar = figure.subplots(2, 1, sharex=True, height_ratios=[14, 1])
    figure.subplots_adjust(left=0.09, right=0.74, top=0.96, bottom=0.13, hspace=0.08)
    walks = [piece.trajectory for piece in motion.pieces]
    named = plots.movers(walks) if walks else []
    for piece in motion.pieces:
        walk = piece.trajectory
        keep = plots.thin(len(walk))
        share = 100 * (piece.start + (piece.stop - piece.start) * walk.t[keep] / max(float(walk.t[-1]), 1e-300))
        for j in range(robot.n):
            color = plots.color_of(named.index(j)) if j in named else "#c3c8d0"
            style = "-" if j not in named or named.index(j) < len(plots.COLORS) else (0, (4, 1.5))
            axes.plot(share, walk.q[keep, j], color=color, linestyle=style, linewidth=1.6 if j in named else 1.0)
        bar.axvspan(100 * piece.start, 100 * piece.stop, color=sheet_color(piece.sheet), linewidth=0)
    for part in motion.left_out:
        bar.axvspan(100 * part.start, 100 * part.stop, color=NONE, linewidth=0)
    # Where the sheet changes, or the path is divided.
    for place in _places(motion):
        axes.axvline(100 * place, color=plots.INK, linewidth=1.2, zorder=1.5)
    for division in motion.divisions:
        axes.axvline(100 * division.at, color=plots.LIMIT, linewidth=1.6, linestyle=(0, (3, 2)), zorder=1.5)
    _frame(axes, bar, robot)
    _motion_legend(figure, motion, robot, named, Patch)
    return figure


def _places(motion: SheetMotion) -> list[float]:
    """Where the sheet changes with the tool at rest, as shares of the path."""
    divided = {part.at for part in motion.divisions}
    ends = {part.stop for part in motion.pieces}
    starts = [part.start for part in motion.pieces if part.start in ends and part.start not in divided]
    begun = [0.0] if motion.changes > len(starts) else []
    return begun + starts


def _frame(axes: Any, bar: Any, robot: Robot) -> None:
    units = " or ".join(dict.fromkeys(c.unit for c in robot.coordinates))
    axes.set_ylabel(f"joints [{units}]")
    axes.set_xlim(0, 100)
    axes.axhline(0, color=plots.GREY, linewidth=0.8, zorder=1)
    bar.set_yticks([])
    bar.grid(visible=False)
    bar.set_xlabel("share of the path [%]")


def _motion_legend(figure: Any, motion: SheetMotion, robot: Robot, named: list[int], patch: Any) -> None:
    """The joints, the sheets, and what is not served."""
    from matplotlib.lines import Line2D

    lines = []
    for k, j in enumerate(named):
        style = "-" if k < len(plots.COLORS) else (0, (4, 1.5))
        lines.append(
            Line2D([], [], color=plots.color_of(k), label=plots.on_figure(robot.joint_names[j], 22), linestyle=style)
        )
    if len(named) < robot.n:
        lines.append(Line2D([], [], color="#c3c8d0", label="other joints"))
    used = np.unique([piece.sheet for piece in motion.pieces]).tolist() if motion.pieces else []
    patches = [patch(color=sheet_color(s), label=f"sheet {s}") for s in used]
    patches += [patch(color=NONE, label="no sheet")] if motion.left_out else []
    figure.legend(handles=[*lines, *patches], loc="upper left", bbox_to_anchor=(0.745, 0.98), fontsize=8.5)
