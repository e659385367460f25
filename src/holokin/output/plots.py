"""Drawing, one thing a function: each takes an Axes and returns it.

As the paper draws: clockwise solid blue, counter-clockwise dashed red.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ..errors import ArgumentError
from ..files import replacing
from ..robot import Robot
from ..trajectory import Status, Trajectory
from ..types import Indices, Matrix, Vector
from .words import on_figure

CLOCKWISE = {"color": "#1f5fbf", "linestyle": "-", "linewidth": 1.8}
COUNTER = {"color": "#d1352b", "linestyle": (0, (4, 2)), "linewidth": 1.8}
GREY = "#9aa1ac"
ELEVATION = 20.0
"""Height of the eye over the floor in pictures in space [degrees]."""
ZOOMS = (1.38, 1.3, 1.2, 1.1, 1.0, 0.9)
"""How near pictures in space are looked at, the nearest first: labels hang out of their axes, see `inside`."""
INK = "#22262e"
PALETTE = ("#1f5fbf", "#d1352b", "#2e8b57", "#8a4fbf", "#c47f11", "#0f8b8d", "#6b7280", "#b03a7c")

_STYLE = {
    "font.size": 10,
    "axes.titlesize": 11,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#6b7280",
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.color": "#4b5563",
    "ytick.color": "#4b5563",
    "axes.grid": True,
    "grid.color": "#e5e7eb",
    "grid.linewidth": 0.8,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "svg.hashsalt": "holokin",
}


def write_figure(draw: Callable[[], Any], file: FilePath) -> None:
    """Write the figure that `draw` makes as an image of the file's type, PNG where its name has no ending.

    Raises:
        ArgumentError: there is no such type. WriteError: the system refuses the file.
    """
    from matplotlib import rc_context
    from matplotlib.backend_bases import FigureCanvasBase

    kind = file.suffix[1:].lower() or "png"
    known = FigureCanvasBase.get_supported_filetypes()
    if kind not in known:
        raise ArgumentError("the file to write", str(file), f"it cannot be written: choose of {', '.join(known)}")
    with rc_context(style()), replacing(file) as part:
        draw().savefig(part, format=kind, dpi=130, facecolor="white")


def style() -> Any:
    """matplotlib settings of every figure."""
    return dict(_STYLE)


def thin(count: int, most: int = 600) -> Indices:
    """Indices of at most `most` samples, ends included: pictures need no more."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.intp))


def joint_ways(axes: Any, clockwise: Trajectory, counter: Trajectory, joint: int) -> Any:
    """One joint over time, by both ways, with the gap at the end or crosses where they stop. [ZR11, Figs 4, 5, 8]"""
    stops: list[float] = []
    for walk, style, label in ((clockwise, CLOCKWISE, "clockwise"), (counter, COUNTER, "counter-clockwise")):
        keep = thin(len(walk))
        axes.plot(walk.t[keep], walk.q[keep, joint], label=label, **style)
        if walk.status is not Status.COMPLETE:
            stops.append(float(walk.t[-1]))
        end = "o" if walk.status is Status.COMPLETE else "X"
        axes.plot(walk.t[-1], walk.q[-1, joint], end, color=style["color"], markersize=4 if end == "o" else 7)
    gap = abs(clockwise.q[-1, joint] - counter.q[-1, joint])
    unit = clockwise.joint_units[joint]
    low, high = axes.get_ylim()
    least = 0.02 if unit == "rad" else 0.01  # a joint that stands still shall look it
    if high - low < least:
        axes.set_ylim((low + high - least) / 2, (low + high + least) / 2)
    ending = f"stopped at {' and '.join(f'{t:.3g}' for t in stops)} s" if stops else _gap(gap, unit)
    axes.set_title(f"{on_figure(clockwise.joint_names[joint], 30)}: {ending}", loc="left", color=INK, fontsize=10)
    axes.set_ylabel(unit)
    return axes


def joint_cycles(axes: Any, walk: Trajectory, colors: Sequence[str] = PALETTE) -> Any:
    """Every joint's departure from its start over the cycles, drift of the worst joint named. [ZR11, Fig. 6]"""
    keep = thin(len(walk), 1500)
    shift = walk.q - walk.q[0]
    for joint, name in enumerate(walk.joint_names):
        shown, color = on_figure(name, 30), colors[joint % len(colors)]
        axes.plot(walk.t[keep], shift[keep, joint], color=color, linewidth=1.4, label=shown)
    for mark in walk.marks[1:]:
        axes.axvline(walk.t[mark], color="#e5e7eb", linewidth=0.8, zorder=0)
    axes.set_xlabel("time [s]")
    return axes


def drift_per_cycle(axes: Any, walks: dict[str, Trajectory]) -> Any:
    """Largest joint drift after 1, 2, ... cycles, on a logarithmic scale down to round-off."""
    for i, (name, walk) in enumerate(walks.items()):
        values = np.maximum(np.abs(walk.drift_since_start()).max(axis=1), 1e-17)
        cycles = np.arange(1, len(values) + 1)
        axes.semilogy(cycles, values, "o-", color=PALETTE[i % len(PALETTE)], linewidth=1.8, markersize=4, label=name)
    axes.axhspan(1e-18, 1e-12, color="#f3f4f6", zorder=0)
    axes.text(0.99, 0.02, "below 1e-12: round-off", transform=axes.transAxes, ha="right", color="#6b7280", fontsize=9)
    axes.set_ylim(1e-17, 10)
    axes.set_xlabel("cycles done")
    units = dict.fromkeys(unit for walk in walks.values() for unit in walk.joint_units)
    axes.set_ylabel(f"joint drift, largest joint [{' or '.join(units)}]")
    axes.xaxis.get_major_locator().set_params(integer=True)
    return axes


def robot_stick(axes: Any, robot: Robot, q: Vector, color: str, *, width: float = 3.0, alpha: float = 1.0) -> list[Any]:
    """The robot as a stick figure; returns the artists. In a plane for a planar robot, else in space."""
    artists = []
    for line in robot.skeleton(q):
        points = _planar(line) if robot.planar else line.T
        artists += axes.plot(
            *points, color=color, linewidth=width, alpha=alpha, marker="o", markersize=width + 1,
            markerfacecolor="white", markeredgecolor=color, markeredgewidth=1.2, solid_capstyle="round",
        )  # fmt: skip
    return artists


def tool_path(axes: Any, robot: Robot, points: Matrix, **style: Any) -> list[Any]:
    """A tool path (k, 3) in the robot's axes; returns the artists."""
    keep = thin(len(points))
    shown = _planar(points[keep]) if robot.planar else points[keep].T
    return axes.plot(*shown, **style)


def frame_robot(
    axes: Any,
    robot: Robot,
    clouds: Sequence[Matrix],
    title: str = "",
    *,
    azimuth: float = -62.0,
    zoom: float = ZOOMS[0],
) -> Any:
    """Equal scales, limits close round all points and the base, few ticks; seen from an azimuth [degrees]."""
    points = np.vstack([*clouds, np.zeros((1, 3))])
    low, high = points.min(axis=0), points.max(axis=0)
    axes.set_title(title, loc="left" if robot.planar else "center", fontsize=10, color=INK)
    if robot.planar:
        pad = 0.1 * (high - low)[:2].max()
        axes.set_xlim(low[0] - pad, high[0] + pad)
        axes.set_ylim(low[1] - pad, high[1] + pad)
        axes.set_aspect("equal")
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
        return axes
    size = np.maximum(1.1 * (high - low), 0.5 * float((high - low).max()))
    middle = (low + high) / 2
    if low[2] >= -1e-9:  # stands on the floor
        middle[2] = size[2] / 2
    axes.set_xlim(middle[0] - size[0] / 2, middle[0] + size[0] / 2)
    axes.set_ylim(middle[1] - size[1] / 2, middle[1] + size[1] / 2)
    axes.set_zlim(middle[2] - size[2] / 2, middle[2] + size[2] / 2)
    axes.set_box_aspect(size / size.max(), zoom=zoom * size.max() / float(np.linalg.norm(size)))
    axes.view_init(elev=ELEVATION, azim=azimuth)
    for axis, name, side in zip((axes.xaxis, axes.yaxis, axes.zaxis), "xyz", size, strict=True):
        axis.pane.set_facecolor("#fafafa")
        axis.set_major_locator(_few(side / size.max()))
        axis.set_tick_params(labelsize=7, pad=-2)
        axis.set_label_text(f"{name} [m]", fontsize=8)
        axis.labelpad = -2 if name == "z" else -6  # the ticks of z are beside it, with all their digits
    return axes


def inside(figure: Any) -> bool:
    """Whether all titles, ticks and labels of a figure lie in it: those of axes in space do not keep to margins."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw_without_rendering()
    box, whole = figure.get_tightbbox(renderer), figure.bbox_inches
    return bool(box.x0 >= 0 and box.y0 >= 0 and box.x1 <= whole.x1 and box.y1 <= whole.y1)


def best_azimuth(pairs: Sequence[tuple[Matrix, Matrix]]) -> float:
    """The azimuth [degrees] from which pairs of postures, points (k, 3) each, show best how far they are apart.

    Half as much counts that the robot itself is seen from its side.
    """
    angles = np.arange(-150.0, 180.0, 10.0)
    a, e = np.deg2rad(angles), np.deg2rad(ELEVATION)
    right = np.stack([-np.sin(a), np.cos(a), np.zeros_like(a)])
    up = np.stack([-np.sin(e) * np.cos(a), -np.sin(e) * np.sin(a), np.full_like(a, np.cos(e))])
    gaps = np.vstack([one - other for one, other in pairs])
    apart = np.hypot(gaps @ right, gaps @ up).max(axis=0)
    body = np.vstack([one - one.mean(axis=0) for one, _ in pairs])
    seen = np.abs(body @ right).max(axis=0)
    score = seen / (2 * max(seen.max(), 1e-12))
    if apart.max() > 1e-9:
        score = score + apart / apart.max()
    return float(angles[np.argmax(score)])


def _planar(points: Matrix) -> Matrix:
    return points[:, :2].T


def _few(share: float) -> Any:
    """Few ticks; on an axis that is but a share of the longest one, fewer, so that its name finds room."""
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(max(2, round(4 * share)))


def _gap(gap: float, unit: str) -> str:
    return "ends agree" if gap < 1e-9 else f"ends {gap:.3g} {unit} apart"
