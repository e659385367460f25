"""Pictures of robots: the side from which they are seen best, and everything in one picture as large as it can be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np

from ...base.types import Matrix
from .bodies import cloud
from .palette import INK
from .solids import Layer, Pixels, Solid, Window, drawn, over, tint

ELEVATIONS = (8.0, 16.0, 24.0, 34.0)
"""Heights of the eye over the floor that are looked from [degrees]."""

DETAIL = 150
"""Pixels for an inch of a picture."""

AROUND = 0.25
"""Room for obstacles beside a robot, over its size in the picture: what is farther out is cut off."""

BEYOND = 0.042
"""Way from the end of a base's axis to its name, at least, over the width of the picture."""

SHADOW = 0.16
"""Darkness of the shadow on the floor."""

_COARSE = 4
"""Pixels to a side for one of the shadow."""

_SHADOW_PIXELS = 90
"""Of the longer side of the shadow, before it is softened."""


@final
@dataclass(frozen=True)
class View:
    """From where a scene is seen [degrees]: azimuth round z from x, height of the eye over the floor."""

    azimuth: float
    elevation: float

    @cached_property
    def axes(self) -> Matrix:
        """The axes of the eye (3, 3) in rows: right, up, towards it."""
        a, e = np.deg2rad(self.azimuth), np.deg2rad(self.elevation)
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        return np.array([right, np.cross(towards, right), towards])

    def seen(self, points: Matrix) -> Matrix:
        """Points (k, 3) in the axes of the eye."""
        return points @ self.axes.T

    def turned(self, solids: Sequence[Solid]) -> list[Solid]:
        """Solids in the axes of the eye."""
        zero = np.zeros(3)
        return [solid.moved(zero, self.axes) for solid in solids]


ABOVE = View(-90.0, 90.0)
"""From above, x to the right: for robots that move in a plane."""


def best_view(
    bodies: Sequence[Matrix], paths: Sequence[Matrix] = (), pairs: Sequence[tuple[Matrix, Matrix]] = ()
) -> View:
    """The view that shows best the robot's own plane, the area of the tool's loop, and how far two ends are apart.

    Args:
        bodies: points (k, 3) of the robot, at some postures each.
        paths: points (k, 3) of the tool's path.
        pairs: postures, points (k, 3) each, whose difference is to be seen.
    """
    body = np.vstack([points - points.mean(axis=0) for points in bodies])
    middle = np.vstack(bodies).mean(axis=0)
    path = np.vstack(paths) if len(paths) else np.zeros((0, 3))
    loop = path - path.mean(axis=0) if len(path) else path
    gaps = np.vstack([one - other for one, other in pairs]) if len(pairs) else np.zeros((0, 3))
    views = [View(a, e) for e in ELEVATIONS for a in np.arange(-170.0, 190.0, 10.0)]
    scores = np.zeros((4, len(views)))
    for i, view in enumerate(views):
        flat = view.seen(body)[:, :2]
        scores[0, i] = np.sqrt(max(np.linalg.det(flat.T @ flat), 0.0))
        if len(loop):
            ring = view.seen(loop)[:, :2]
            scores[1, i] = np.sqrt(np.sqrt(max(np.linalg.det(ring.T @ ring), 0.0)))
            scores[3, i] = float(view.axes[2] @ (path.mean(axis=0) - middle))
        if len(gaps):
            scores[2, i] = np.hypot(*view.seen(gaps)[:, :2].T).max()
    size = float(np.ptp(body, axis=0).max()) + 1e-12
    most = scores[:3].max(axis=1, keepdims=True)
    shares = scores[:3] / np.where(most > 1e-9 * size, most, np.inf)
    total = shares[0] + 0.9 * shares[1] + 0.4 * shares[2] + 0.25 * scores[3] / size
    total -= [0.15 * abs(view.elevation - 20.0) / 20.0 for view in views]
    return views[int(np.argmax(total))]


@final
@dataclass(frozen=True, eq=False)
class Scene:
    """What a panel shows: view, left, right, bottom, top [m] in the axes of the eye, floor z [m] (None: seen flat)."""

    view: View
    bounds: tuple[float, float, float, float]
    floor: float | None
    spread: Matrix

    @property
    def shape(self) -> tuple[float, float]:
        """Width and height [m]."""
        left, right, bottom, top = self.bounds
        return right - left, top - bottom

    def window(self, width: int) -> Window:
        """The picture in so many pixels of width."""
        left, right, bottom, top = self.bounds
        rows = max(2, round(width * (top - bottom) / (right - left)))
        return Window(left, right, bottom, top, rows, width)


def scene_of(
    view: View, solids: Sequence[Solid], *, flat: bool, ratio: tuple[float, float] = (0.6, 1.5),
    around: Sequence[Solid] = (),
) -> Scene:  # fmt: skip
    """The scene that holds solids, in the frame of the base, and little more.

    Args:
        around: solids that shall be seen as far as the others do not become much smaller for it.
        flat: seen from above, with the axes x and y.
        ratio: least and greatest height over width.
    """
    points = cloud(solids)
    seen = cloud(view.turned(solids))
    low, high = seen[:, :2].min(axis=0), seen[:, :2].max(axis=0)
    floor = None if flat else min(0.0, float(points[:, 2].min()))
    if floor is not None:
        stand = points.copy()
        stand[:, 2] = floor
        low[1] = min(low[1], view.seen(stand)[:, 1].min())
    if len(around):
        room = AROUND * float((high - low).max())
        beside = cloud(view.turned(around))[:, :2]
        low = np.maximum(np.minimum(low, beside.min(axis=0)), low - room)
        high = np.minimum(np.maximum(high, beside.max(axis=0)), high + room)
        points = np.vstack([points, np.clip(cloud(around), points.min(axis=0) - room, points.max(axis=0) + room)])
    pad = 0.03 * float((high - low).max())
    low, high = low - pad, high + pad
    width, height = high - low
    grow = np.array([max(height / ratio[1] - width, 0.0), max(width * ratio[0] - height, 0.0)]) / 2
    low, high = low - grow, high + grow
    spread = np.array([points[:, :2].min(axis=0), points[:, :2].max(axis=0)])
    return Scene(view, (low[0], high[0], low[1], high[1]), floor, spread)


def layer_of(scene: Scene, solids: Sequence[Solid], window: Window) -> Layer:
    """Solids, in the frame of the base, as they are seen."""
    return drawn(scene.view.turned(solids), window)


def empty(window: Window) -> Pixels:
    """A picture of nothing."""
    return np.zeros((window.rows, window.columns, 4), np.float32)


def shadowed(picture: Pixels, scene: Scene, window: Window, solids: Sequence[Solid]) -> Pixels:
    """A picture with the shadow of solids on the floor: of a lamp right above, soft."""
    if scene.floor is None or not len(solids):
        return picture
    from scipy.ndimage import gaussian_filter, map_coordinates

    low, high = scene.spread
    reach = 0.12 * float((high - low).max()) + 1e-3
    low, high = low - reach, high + reach
    columns = round(_SHADOW_PIXELS * (high[0] - low[0]) / max(high - low)) + 2
    rows = round(_SHADOW_PIXELS * (high[1] - low[1]) / max(high - low)) + 2
    above = Window(low[0], low[0] + columns * max(high - low) / _SHADOW_PIXELS, 0, 0, rows, columns)
    above = Window(above.left, above.right, high[1] - rows * above.pixel, high[1], rows, columns)
    cover = gaussian_filter(drawn(ABOVE.turned(solids), above).cover, 1.6)
    right, up, _ = scene.view.axes
    coarse = Window(*window.extent, window.rows // _COARSE + 1, window.columns // _COARSE + 1)
    xs = np.linspace(window.left, window.right, coarse.columns)
    ys = np.linspace(window.top, window.bottom, coarse.rows)
    u, v = np.meshgrid(xs, ys - scene.floor * up[2])
    place = np.linalg.inv(np.array([right[:2], up[:2]])) @ np.stack([u.ravel(), v.ravel()])
    at = np.array([(above.top - place[1]) / above.pixel - 0.5, (place[0] - above.left) / above.pixel - 0.5])
    dark = map_coordinates(cover, at, order=1).reshape(u.shape)
    rows = np.linspace(0, coarse.rows - 1, window.rows)
    columns = np.linspace(0, coarse.columns - 1, window.columns)
    fine = map_coordinates(dark, np.meshgrid(rows, columns, indexing="ij"), order=1).astype(np.float32)
    return over(picture, Layer(np.zeros((*fine.shape, 3), np.float32), SHADOW * fine, fine))


def laid(picture: Pixels, layer: Layer, depth: Pixels, hidden: float = 0.25) -> Pixels:
    """A picture of solids of a depth with a layer in it: faint where it is behind them."""
    front = layer.depth >= depth - 1e-4
    return over(picture, layer, where=np.where(front, 1.0, hidden).astype(np.float32))


def outlined(picture: Pixels, layer: Layer, color: str, beneath: Layer, fill: float = 0.3) -> Pixels:
    """A picture with the outline of a layer in it, and its surface, faint, where it is not over what is beneath."""
    from scipy.ndimage import gaussian_filter

    soft = gaussian_filter(layer.cover, 1.6)
    line = np.exp(-(((soft - 0.45) / 0.3) ** 2)).astype(np.float32)
    line[soft < 0.02] = 0
    paint = np.broadcast_to(tint(color, ink=0.1).astype(np.float32), (*soft.shape, 3))
    return over(over(picture, layer, fill, 1 - beneath.cover), Layer(paint, line, layer.depth))


def show(axes: Any, scene: Scene, picture: Pixels, window: Window) -> Any:
    """A picture in Axes, with its floor, or with the axes x and y where the scene is seen from above."""
    axes.imshow(np.clip(picture, 0, 1), extent=window.extent, interpolation="antialiased", zorder=2, aspect="equal")
    axes.set_xlim(window.left, window.right)
    axes.set_ylim(window.bottom, window.top)
    if scene.floor is None:
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
        return axes
    axes.set_axis_off()
    return _floor(axes, scene)


def _floor(axes: Any, scene: Scene) -> Any:
    """Lines on the floor, at round distances."""
    from matplotlib.collections import LineCollection

    low, high = scene.spread
    step = _squares(scene)
    first, last = np.floor(low / step) * step, np.ceil(high / step) * step
    ends = [
        *(([x, first[1]], [x, last[1]]) for x in np.arange(first[0], last[0] + step / 2, step)),
        *(([first[0], y], [last[0], y]) for y in np.arange(first[1], last[1] + step / 2, step)),
    ]
    lines = [scene.view.seen(np.column_stack([np.array(pair), np.full(2, scene.floor)]))[:, :2] for pair in ends]
    axes.add_collection(LineCollection(lines, colors="#dfe2e7", linewidths=0.8, zorder=1))
    return axes


def named_axes(axes: Any, scene: Scene, size: float, cover: Pixels, window: Window) -> bool:
    """The names of the base's axes beyond the ends of its rods, where nothing covers them.

    Returns:
        Whether one of them is in the corner at the right below.
    """
    wide, tall, taken = window.right - window.left, window.top - window.bottom, False
    for name, axis in zip("xyz", np.eye(3), strict=True):
        flat = scene.view.seen(axis[None])[0][:2]
        short = float(np.hypot(*flat))
        if short <= 0.2:
            continue
        x, y = (size + max(0.2 * size, BEYOND * wide / short)) * flat
        row, column = int((window.top - y) / window.pixel), int((x - window.left) / window.pixel)
        if 0 <= row < window.rows and 0 <= column < window.columns and cover[row, column] < 0.5:
            axes.text(x, y, name, fontsize=7.5, color=INK, ha="center", va="center", zorder=6)
            taken = taken or (x > window.left + 0.5 * wide and y < window.bottom + 0.1 * tall)
    return taken


def floor_scale(axes: Any, scene: Scene, *, left: bool = False) -> Any:
    """How large the squares on the floor are, in the corner at the right below, or at the left."""
    axes.text(
        0.005 if left else 0.995, 0.0, f"floor: {_squares(scene):g} m squares", transform=axes.transAxes,
        ha="left" if left else "right", va="bottom", fontsize=7.5, color="#6b7280", zorder=6,
    )  # fmt: skip
    return axes


def _squares(scene: Scene) -> float:
    """The side of the squares on the floor [m]."""
    return _round(float(np.ptp(scene.spread, axis=0).max()) / 5)


def _round(value: float) -> float:
    """The nearest of 1, 2, 5 times a power of ten, from below."""
    power = 10.0 ** np.floor(np.log10(max(value, 1e-9)))
    return float(power * max(k for k in (1, 2, 5) if k * power <= value * 1.0000001))
