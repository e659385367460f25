"""Paths over a plane or curved patch: figure eight, raster, spiral."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError
from ..base.types import Array, ArrayLike, Matrix, Value, Vector, finite, positive, whole
from .curves import evenly
from .path import LARGEST, Path, as_point, join
from .segments import line_segment
from .waypoints import Poses

Surface = Callable[[float, float], float]
"""Height z = f(u, v) [m] over the plane of a patch."""

EXACT = 1e-6
"""How far [m] a curve may be from its formula; of one larger than a metre the same share of its size."""

STEP = 1e-5
"""Step [m] of the differences that give a surface's slope: right to 1e-9 on one that bends over centimetres."""

MOST_ROWS = 2_000
"""Lines of a raster and windings of a spiral: a millimetre apart they cover two metres."""


@dataclass(frozen=True, eq=False)
class Patch(Value):
    """A plane with axes (3, 3), rows along, across and up, or a surface over it.

    faced: the tool's z axis looks into it, its x axis is the direction along the patch, laid down on the surface.
    """

    origin: Vector
    axes: Matrix
    surface: Surface | None
    faced: bool

    def at(self, uv: Matrix) -> Poses:
        """Poses over points (k, 2) [m] of the plane. Raises: ArgumentError: the surface has no height there."""
        height = self._heights(uv)
        return Poses(self.origin + np.column_stack([uv, height]) @ self.axes, self._facing(uv) if self.faced else None)

    def _heights(self, uv: Matrix) -> Vector:
        return np.array([self._height(u, v) for u, v in uv.tolist()])

    def _height(self, u: float, v: float) -> float:
        if self.surface is None:
            return 0.0
        z = np.asarray(finite(f"the surface at u = {u:.6g}, v = {v:.6g}", self.surface(u, v)))
        if z.size != 1:
            raise ArgumentError("the height of a surface", z.tolist(), "return one number, z(u, v) in metres")
        return float(z.reshape(()))

    def _facing(self, uv: Matrix) -> Array:
        """Rotations (k, 3, 3) of the tool against the surface, from its slopes by differences."""
        du, dv = ((self._heights(uv + h) - self._heights(uv - h)) / (2 * STEP) for h in STEP * np.eye(2))
        one, none = np.ones(len(uv)), np.zeros(len(uv))
        x, z = np.column_stack([one, none, du]), np.column_stack([du, dv, -one])  # z goes into the surface
        x, z = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (x, z))
        return self.axes.T @ np.stack([x, np.cross(z, x), z], axis=2)


def _patch(origin: ArrayLike, along: Vector, up: Vector, surface: Surface | None, tool: str | None) -> Patch:
    chosen = tool or ("start" if surface is None else "normal")
    if chosen not in ("start", "normal"):
        raise ArgumentError("tool", tool, "use 'start', as at the start posture, or 'normal', against the surface")
    x, z = along / np.linalg.norm(along), up / np.linalg.norm(up)
    return Patch(as_point(origin), np.array([x, np.cross(z, x), z]), surface, chosen == "normal")


def _plane(normal: ArrayLike, along: ArrayLike | None) -> tuple[Vector, Vector]:
    """(a direction in the plane, its normal); by default the direction nearest to x, of a plane across x to y."""
    up = finite("normal", normal, (3,))
    if not np.linalg.norm(up) > 0:
        raise ArgumentError("normal", up.tolist(), "give a direction")
    up = up / np.linalg.norm(up)
    default = np.array([1.0, 0.0, 0.0]) if abs(up[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    given = default if along is None else finite("along", along, (3,))
    flat = given - (given @ up) * up
    if not np.linalg.norm(flat) > 1e-9 * np.linalg.norm(given):
        raise ArgumentError("along", given.tolist(), "give a direction that is not the normal's")
    return flat, up


def _tolerance(size: float) -> float:
    """Raises: ArgumentError: no robot reaches over so large a curve."""
    if size > LARGEST:
        raise ArgumentError("the size of a curve", size, f"give metres, at most {LARGEST:g}")
    return EXACT * max(1.0, size)


@typed
def figure_eight(
    start: ArrayLike,
    width: float,
    height: float | None = None,
    normal: ArrayLike = (0.0, 0.0, 1.0),
    *,
    along: ArrayLike | None = None,
    speed: float = 0.1,
) -> Path:
    """A figure eight, Bernoulli's lemniscate, that starts where it crosses itself.

    Its length is 2.622 width for the height by default, width / sqrt(8).

    Args:
        start: the crossing [m]. width, height: of the whole figure [m].
        along: direction of its width; by default x, or y if the normal is x.

    Raises:
        ArgumentError, ShapeError, NotFiniteError.
    """
    half = positive("width", width) / 2
    stretch = 1.0 if height is None else positive("height", height) * np.sqrt(2) / half
    flat, up = _plane(normal, along)
    patch = _patch(start, flat, up, None, None)

    def curve(s: Vector) -> Poses:
        c, d = np.cos(s), np.sin(s)
        return patch.at(half * np.column_stack([d, stretch * d * c]) / (1 + c * c)[:, None])

    segments = evenly(curve, np.linspace(0, 2 * np.pi, 9), True, positive("speed", speed), 1.0, _tolerance(2 * half))
    return Path(tuple(segments), speed)


@typed
def raster(
    start: ArrayLike,
    along: ArrayLike,
    across: ArrayLike,
    spacing: float,
    *,
    surface: Callable[[float, float], float] | None = None,
    tool: Literal["start", "normal"] | None = None,
    speed: float = 0.1,
    angular_speed: float = 0.5,
) -> Path:
    """A zigzag of lines over a rectangle: along it, a step across, back, and so on; over a plane or a curved surface.

    Args:
        start: the corner where it begins [m]. along, across: the rectangle's sides (3,) [m], perpendicular.
        spacing: the most between two lines [m].
        surface: (u, v) -> z [m], the height over the rectangle towards along x across, u along and v across [m].
        tool: "start" keeps the orientation of the start posture; "normal" turns the tool's z axis into the surface, its
            x axis along the lines. By default "normal" on a surface.

    Raises:
        ArgumentError, ShapeError, NotFiniteError.
    """
    a, b = finite("along", along, (3,)), finite("across", across, (3,))
    length, breadth = float(np.linalg.norm(a)), float(np.linalg.norm(b))
    if not (length > 0 and breadth > 0) or abs(a @ b) > 1e-9 * length * breadth:
        cure = "give two perpendicular sides of a rectangle"
        raise ArgumentError("the sides of a raster", [a.tolist(), b.tolist()], cure)
    count = whole("the lines of a raster", int(min(np.ceil(breadth / positive("spacing", spacing) - 1e-9), 2**60)) + 1)
    if count > MOST_ROWS:
        raise ArgumentError("the lines of a raster", count, f"give a larger spacing, for at most {MOST_ROWS}")
    patch = _patch(start, a, np.cross(a, b), surface, tool)
    rows = np.linspace(0.0, breadth, count)
    corners = np.array([(u, v) for k, v in enumerate(rows) for u in ((0.0, length), (length, 0.0))[k % 2]])
    return _through(patch, corners, positive("speed", speed), positive("angular_speed", angular_speed))


def _through(patch: Patch, corners: Matrix, speed: float, angular_speed: float) -> Path:
    """Straight over the plane from corner to corner (k, 2), and up and down with the surface."""
    at = patch.at(corners)
    first = None if at.rotations is None else at.rotations[0]
    if patch.surface is None:
        pairs = zip(at.points[:-1], at.points[1:], strict=True)
        return Path(tuple(line_segment(a, b, np.zeros(3)) for a, b in pairs), speed, angular_speed, first)
    pieces = []
    for k, (a, b) in enumerate(pairwise(corners)):

        def curve(s: Vector, a: Vector = a, b: Vector = b) -> Poses:
            return patch.at(a + s[:, None] * (b - a))

        tolerance = _tolerance(float(np.abs(b - a).max()))
        segments = evenly(curve, np.linspace(0.0, 1.0, 3), False, speed, angular_speed, tolerance)
        rotation = None if at.rotations is None else at.rotations[k]
        pieces.append(Path(tuple(segments), speed, angular_speed, rotation))
    return join(*pieces)


@typed
def spiral(
    center: ArrayLike,
    radius: float,
    spacing: float,
    normal: ArrayLike = (0.0, 0.0, 1.0),
    *,
    inward: bool = False,
    clockwise: bool = False,
    along: ArrayLike | None = None,
    surface: Callable[[float, float], float] | None = None,
    tool: Literal["start", "normal"] | None = None,
    speed: float = 0.1,
    angular_speed: float = 0.5,
) -> Path:
    """Archimedes' spiral over a disc, r = spacing t / (2 pi), from its center out to the radius; or inward.

    Args:
        center: [m]. radius: of the disc [m]. spacing: between two windings [m].
        along: the direction in which it leaves the center; by default x, or y if the normal is x.
        surface: (u, v) -> z [m], the height over the disc towards the normal, u in the direction `along`.
        tool: as of `raster`.

    Raises:
        ArgumentError, ShapeError, NotFiniteError.
    """
    turns = positive("radius", radius) / positive("spacing", spacing)
    if turns > MOST_ROWS:
        raise ArgumentError("the windings of a spiral", turns, f"give a larger spacing, for at most {MOST_ROWS}")
    flat, up = _plane(normal, along)
    patch, sign = _patch(center, flat, up, surface, tool), -1.0 if clockwise else 1.0

    def curve(s: Vector) -> Poses:
        t = 2 * np.pi * s
        return patch.at(spacing * s[:, None] * np.column_stack([np.cos(t), sign * np.sin(t)]))

    breaks = np.linspace(0.0, turns, 1 + int(np.ceil(4 * turns)))
    speed, angular_speed = positive("speed", speed), positive("angular_speed", angular_speed)
    segments = evenly(curve, breaks, False, speed, angular_speed, _tolerance(radius))
    first = patch.at(np.zeros((1, 2))).rotations
    path = Path(tuple(segments), speed, angular_speed, None if first is None else first[0])
    return path.reversed() if inward else path
