"""Pictures of coverage: slices through a workspace and the cloud of its poses. Each takes an Axes and returns it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...analysis.coverage import Coverage, PoseStatus, Slice
from ...analysis.coverage.slices import Plane
from ...base.types import Array, Matrix
from .palette import BLACK, INK, ORANGE, PURPLE, SKY, VERMILLION, YELLOW
from .words import on_figure

CAUSES = {
    PoseStatus.LIMIT: (ORANGE, "joint limit"),
    PoseStatus.BLOCKED: (SKY, "too near to something"),
    PoseStatus.ALGORITHMIC: (VERMILLION, "leaf ends: law singular"),
    PoseStatus.KINEMATIC: (PURPLE, "leaf ends: arm singular"),
    PoseStatus.REPRESENTATION: (YELLOW, "leaf ends: representation"),
    PoseStatus.STOPPED: (BLACK, "no path shown"),
    PoseStatus.BEYOND_LIMITS: ("#6b7480", "no posture within limits"),
    PoseStatus.OUT_OF_REACH: ("#b4bcc8", "out of reach"),
}
"""Colour and short name of each cause: what the law loses in strong colours, what no law reaches in greys."""

CUT = "#d6006c"
"""Colour of the lines across which the joints jump."""

SHADES = ("#b9e0d2", "#74bfa7", "#1f7a6b", "#0b3d3a")
"""Reached poses from rcond 0, light, to the greatest of the picture, dark."""

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
    extent = plane_map(axes, part, image, part.coverage.poses[part.cuts][:, :, [i, j], 3])
    tool = part.coverage.tool[:3, 3]
    if extent[0] <= tool[i] <= extent[1] and extent[2] <= tool[j] <= extent[3]:
        around = [withStroke(linewidth=4, foreground="white")]  # it has to be seen on dark cells, too
        axes.plot(tool[i], tool[j], "+", color=INK, markersize=9, markeredgewidth=1.6, path_effects=around)
    axes.set_title(f"{_AXES[3 - i - j]} = {part.at:.3g} m: {part.coverage.share:.0%}", loc="left", fontsize=10)
    return axes


def plane_map(axes: Any, plane: Slice | Plane, image: Array, cuts: Array) -> tuple[float, float, float, float]:
    """Draw the cells of a plane by their colours (rows, columns, 3), and a line between each of some pairs of cells.

    Args:
        cuts: the places of the two cells of each pair (c, 2, 2).

    Returns:
        The ends of the plane, left, right, bottom, top [m].
    """
    (i, j), (du, dv) = plane.axes, (plane.u[1] - plane.u[0], plane.v[1] - plane.v[0])
    extent = (plane.u[0] - du / 2, plane.u[-1] + du / 2, plane.v[0] - dv / 2, plane.v[-1] + dv / 2)
    axes.imshow(image, origin="lower", extent=extent, interpolation="nearest", aspect="equal")
    for one, other in cuts:  # the side between the two cells
        middle, along = (one + other) / 2, np.where(np.abs(other - one) > 1e-9, 0.0, [du / 2, dv / 2])
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
    for cause in reversed(CAUSES):  # what the law loses last, over the rest
        here = status == cause
        lost = cause < PoseStatus.BEYOND_LIMITS
        if here.any():  # an empty cloud would move the limits of the axes
            axes.scatter(*points[:, here], color=CAUSES[cause][0], s=22 if lost else 9, **style)
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
        frame_cloud(cloud, p)
    within = "within the joint limits" if coverage.limits else "joint limits aside"
    head = f"{on_figure(coverage.name)} reaches {coverage.share:.1%} of the workspace {within}"
    figure.suptitle(head, x=0.2 / size[0], y=1 - 0.15 / size[1], ha="left", va="top", fontsize=12, color=INK)
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
    grid = figure.add_gridspec(
        len(heights), len(widths), width_ratios=widths, height_ratios=heights, left=left / size[0],
        right=1 - right / size[0], bottom=bottom / size[1], top=1 - top / size[1],
        wspace=gap * len(widths) / wide, hspace=gap * len(heights) / tall,
    )  # fmt: skip
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
    least = max(0.3 * max(*widths, *heights), 1e-3)  # thin or single ones shall be seen
    return [max(w, least) for w in widths], [max(h, least) for h in heights], places


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
    cross = {"color": INK, "marker": "+", "linestyle": "", "markersize": 9, "markeredgewidth": 1.6}
    start = [Line2D([], [], label="tool at the start (projected)", **cross)] if len(every) > 1 else []
    lines = [Line2D([], [], color=CUT, linewidth=1.8, label="ik(pose) jumps")] if cut else []
    corner = (left - 0.1 / width, 1 - 0.8 / height)
    figure.legend(handles=[*patches, *lines, *start], loc="upper left", bbox_to_anchor=corner, fontsize=9)
    bar = figure.add_axes((left, 0.6 / height, 0.16 / width, min(2.2, height / 2 - 0.5) / height))
    figure.colorbar(ScalarMappable(Normalize(0, most), shades()), cax=bar, label="reached: rcond of [J; J_g]")


def shades() -> Any:
    """The colour map of reached poses."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("reached", SHADES)


def _greatest(every: Sequence[Coverage]) -> float:
    """The greatest rcond of some coverages; 1 where nothing is reached."""
    found = [c.rcond[c.reached].max() for c in every if c.reached.any()]
    return float(max(found)) if found else 1.0


def frame_cloud(axes: Any, points: Matrix) -> None:
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
