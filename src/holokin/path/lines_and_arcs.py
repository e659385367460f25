"""Paths of lines and arcs."""

from __future__ import annotations

import numpy as np

from ..base.arguments import typed
from ..base.poses import PoseLike, pose_numbers
from ..base.types import ArrayLike, finite
from ..errors import ArgumentError
from .path import Path, as_point
from .segments import arc_segment, line_segment, turn_between
from .waypoints import Waypoints, as_poses, distinct, meets


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
def polyline(
    points: PoseLike | Waypoints, *, turns: ArrayLike | None = None, closed: bool = False, speed: float = 0.1
) -> Path:
    """Straight lines through points or poses, between which the tool turns evenly.

    A point that repeats the one before, to 1e-7 m and rad, is left out, and the path's `notes` say so.

    Args:
        points: (k, 3) or (k, 2) [m]; poses (k, 4, 4), whose rotations the tool takes; or `Waypoints`.
        turns: rotation vectors (segments, 3) [rad], one a line, in the base frame; by default none, or those from pose
            to pose, by the shorter way.
        closed: adds the line back to the first point, where that is not given again as the last one.

    Raises:
        ShapeError, NotFiniteError, ArgumentError: bad or too few points; poses and turns.
    """
    poses = as_poses(points if isinstance(points, Waypoints) else _planar(points))
    if closed and (turns is not None or not meets(poses)):
        poses = poses.at(np.append(np.arange(len(poses)), 0))
    shape = (len(poses) - 1, 3)
    if turns is not None and poses.rotations is not None:
        raise ArgumentError("turns", "given beside poses", "leave them out: the poses say how the tool turns")
    spins = np.zeros(shape) if turns is None else finite("turns", turns, shape, "one rotation vector a line")
    turned = None if turns is None else np.append(0.0, np.cumsum(np.linalg.norm(spins, axis=1)))
    poses, index, notes = distinct(poses, turned)
    first, spins = None, spins[index[1:] - 1]
    if poses.rotations is not None:
        first, spins = poses.rotations[0], turn_between(poses.rotations[:-1], poses.rotations[1:])
    segments = tuple(line_segment(a, b, s) for a, b, s in zip(poses.points, poses.points[1:], spins, strict=False))
    said = points.notes if isinstance(points, Waypoints) else ()
    return Path(segments, speed, rotation=first, notes=(*said, *notes))


def _planar(points: PoseLike) -> ArrayLike:
    return np.atleast_2d(pose_numbers("the points of a polyline", points))
