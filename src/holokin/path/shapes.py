"""Paths of lines and arcs."""

from __future__ import annotations

import numpy as np

from ..arguments import typed
from ..errors import ArgumentError
from ..types import ArrayLike, finite, numbers
from .path import Path, as_point
from .segments import arc_segment, line_segment


@typed
def line(start: ArrayLike, end: ArrayLike, *, turn: ArrayLike = (0.0, 0.0, 0.0), speed: float = 0.1) -> Path:
    """A straight line between two points [m], turning the tool by a rotation vector [rad] in the base frame."""
    a, b = as_point(start), as_point(end)
    return Path((line_segment(a, b, finite("turn", turn, (3,))),), speed)


@typed
def arc(
    start: ArrayLike,
    center: ArrayLike,
    angle: float,
    normal: ArrayLike = (0.0, 0.0, 1.0),
    *,
    turn: ArrayLike = (0.0, 0.0, 0.0),
    speed: float = 0.1,
) -> Path:
    """A circular arc from `start` about `center` by `angle` [rad], counter-clockwise about `normal` if positive.

    Raises:
        ArgumentError: no radius, no normal, or a normal that is not perpendicular to the radius.
    """
    a, c, n = as_point(start), as_point(center), finite("normal", normal, (3,))
    x = a - c
    size, radius = float(np.linalg.norm(n)), float(np.linalg.norm(x))
    if radius == 0.0 or size == 0.0 or not np.isfinite(angle) or angle == 0.0:
        raise ArgumentError("an arc's (radius, normal, angle)", (radius, n.tolist(), angle), "none of them may vanish")
    off = float(x @ n) / size
    if abs(off) > 1e-9 * radius:
        cure = f"make it perpendicular to the line from center to start: start lies {off:.3g} m along it from center"
        raise ArgumentError("normal", n.tolist(), cure)
    y = np.asarray(np.cross(n / size, x), dtype=float)
    return Path((arc_segment(c, x, y, float(angle), finite("turn", turn, (3,))),), speed)


@typed
def circle(
    start: ArrayLike,
    center: ArrayLike,
    normal: ArrayLike = (0.0, 0.0, 1.0),
    *,
    clockwise: bool = False,
    speed: float = 0.1,
) -> Path:
    """A full circle from `start` about `center`; counter-clockwise about `normal` unless `clockwise`."""
    return arc(start, center, -2 * np.pi if clockwise else 2 * np.pi, normal, speed=speed)


@typed
def polyline(points: ArrayLike, *, turns: ArrayLike | None = None, closed: bool = False, speed: float = 0.1) -> Path:
    """Straight lines through points (k, 3) or (k, 2) [m].

    Args:
        turns: rotation vectors (segments, 3) [rad], one a line, in the base frame; none by default.
        closed: adds the line back to the first point.

    Raises:
        ShapeError, NotFiniteError, ArgumentError: bad, too few or repeated points.
    """
    corners = [as_point(p) for p in np.atleast_2d(numbers("the points of a polyline", points))]
    if closed:
        corners.append(corners[0])
    if len(corners) < 2:
        raise ArgumentError("the number of points of a polyline", len(corners), "give at least two")
    shape = (len(corners) - 1, 3)
    spins = np.zeros(shape) if turns is None else finite("turns", turns, shape, "one rotation vector a line")
    pairs = zip(corners, corners[1:], spins, strict=False)
    return Path(tuple(line_segment(a, b, s) for a, b, s in pairs), speed)
