"""`spline` and `path_of`: smooth paths through waypoints, and of functions of time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError
from ..base.poses import PoseLike, pose_numbers
from ..base.types import Array, ArrayLike, Matrix, Vector, finite, positive
from .curves import cubics, evenly, of_segments, within
from .path import LARGEST, Path
from .segments import Segment, sure_turns, turn_between
from .waypoints import Poses, Waypoints, as_poses, distinct, meets

SHAPE = 1e-4
"""How far [m] a spline at even speed may be from the spline of chord lengths through the same waypoints; of one larger
than a metre the same share of its size."""

SLOWEST = 0.1
"""Share of its speed below which the spline of chord lengths may fall where it turns round on the spot; there the tool
is slow at even speed, too."""

ALIKE = 0.01
"""Share of the velocity by which it may differ at both ends of a motion that returns, so that it goes on smoothly: a
corner turns it by more, and finite differences are right to 1e-4."""


@typed
def spline(
    points: PoseLike | Waypoints,
    *,
    times: ArrayLike | None = None,
    closed: bool = False,
    speed: float = 0.1,
    angular_speed: float = 0.5,
) -> Path:
    """A smooth path through waypoints: its velocity and acceleration have no jumps (C2).

    Without times the tool goes at even `speed` (to 1 %), slower where it would turn faster than `angular_speed` and
    where the path turns round on the spot. With times it is at each waypoint at its time, and its speed follows.
    A waypoint that repeats the one before, to 1e-7 m, rad and s, is left out, and the path's `notes` say so.

    Args:
        points: (k, 3) or (k, 2) [m]; poses (k, 4, 4), whose rotations the tool takes; or `Waypoints`.
        times: (k,) [s], rising; by default those of the waypoints, if they have any.
        closed: goes on to the first point, smoothly; a timed path must give it again as the last one.
        speed: of the tool [m/s]. angular_speed: [rad/s].

    Raises:
        ShapeError, NotFiniteError, ArgumentError: bad or too few points, times that do not rise.
    """
    given = points if isinstance(points, Waypoints) else None
    if given is not None and times is None and given.times is not None:
        times = given.times
    poses = as_poses(points)
    said = () if given is None else given.notes
    first = poses.rotations[0] if poses.rotations is not None else None
    if times is not None:
        if closed and not meets(poses):
            cure = "give the first waypoint again as the last one, with the time of the return"
            raise ArgumentError("the end of a closed path with times", poses.points[-1].tolist(), cure)
        t = finite("times", times, (len(poses),), "give one for each waypoint")
        poses, kept, notes = distinct(poses, t)
        t = rising(t[kept], len(poses))
        if poses.rotations is not None:
            sure_turns(poses.rotations)
        return replace(_timed_path(cubics(t, poses, closed, 1.0), first, t), notes=(*said, *notes))
    if closed and not meets(poses):
        poses = poses.at(np.append(np.arange(len(poses)), 0))
    poses, _, notes = distinct(poses)
    turns = None if poses.rotations is None else sure_turns(poses.rotations)
    positive("speed", speed, "give a positive speed in m/s or rad/s")
    positive("angular_speed", angular_speed, "give a positive speed in m/s or rad/s")
    far = np.linalg.norm(np.diff(poses.points, axis=0), axis=1) / speed
    if turns is not None:
        turned = np.linalg.norm(turns, axis=1)
        far = np.maximum(far, turned / angular_speed)
    t = np.concatenate([[0.0], np.cumsum(far)])
    size = float(np.ptp(poses.points, axis=0).max())
    if size > LARGEST:
        raise ArgumentError("the size of a curve", size, f"give metres, at most {LARGEST:g}")
    curve = of_segments(cubics(t, poses, closed, 1.0), t, first)
    segments = evenly(curve, t, closed, speed, angular_speed, SHAPE * max(1.0, size), SLOWEST)
    return Path(tuple(segments), speed, angular_speed, first, (*said, *notes))


@typed
def path_of(
    motion: PoseLike | Waypoints | Callable[[float], PoseLike],
    times: ArrayLike | None = None,
    *,
    closed: bool | None = None,
    tolerance: float = 1e-6,
) -> Path:
    """A path that is at given poses at given times: the poses in an array, or a function of time.

    Args:
        motion: poses (k, 4, 4) or points (k, 3); or a function t -> pose (4, 4) or point (3,).
        times: (k,) [s], rising, of the array; of a function start and end, and more where it is not smooth to the third
            derivative. They count from the first one.
        closed: smooth at the start, too; by default where the last pose is the first one and, of a function, where the
            velocity is the same.
        tolerance: of a function, of which the path takes as many points as needed [m or rad].

    Raises:
        ShapeError, NotFiniteError, ArgumentError: bad poses or times; a function with a jump.
    """
    if not callable(motion):
        if closed is None:
            poses = as_poses(motion)
            closed = len(poses) > 2 and meets(poses)
        return spline(motion, times=times, closed=closed)
    if times is None:
        raise ArgumentError("times", None, "give the start and the end of the motion in seconds")
    t = rising(times, None)
    function: Callable[[float], PoseLike] = motion

    def curve(s: Vector) -> Poses:
        what = "the pose of a motion"
        return as_poses([finite(what, pose_numbers(what, function(float(x)))) for x in s])

    ends = curve(np.array([t[0], t[-1]]))
    if closed is None:
        closed = meets(ends) and _goes_on(curve, t)
    elif closed and not meets(ends):
        raise ArgumentError("the end of a closed motion", ends.points[-1].tolist(), "let it end where it starts")
    knots = np.unique(np.concatenate([np.linspace(a, b, 9) for a, b in pairwise(t.tolist())]))
    segments = within(curve, knots, closed, positive("tolerance", tolerance), 1.0)
    return _timed_path(segments, ends.rotations[0] if ends.rotations is not None else None, t)


def _timed_path(segments: list[Segment], rotation: Matrix | None, t: Vector) -> Path:
    """The path of cubics made for a speed of 1, with its mean speed and the same times."""
    length = sum(s.length for s in segments)
    path = Path(tuple(segments), 1.0, rotation=rotation)
    mean = length / float(t[-1] - t[0])
    return path.at_pace(mean) if mean > 1e-9 else path


def rising(times: ArrayLike, count: int | None) -> Vector:
    """Times (k,) that rise, as many as asked for. Raises: ShapeError, NotFiniteError, ArgumentError."""
    t = finite("times", times, ("k",) if count is None else (count,), "give one for each waypoint")
    if len(t) < 2:
        raise ArgumentError("the number of times", len(t), "give at least two")
    steps = np.diff(t)
    if not steps.min() > 0:
        i = int(np.argmax(~(steps > 0))) + 1
        raise ArgumentError(f"time {i}", float(t[i]), f"let it be after the one before, {t[i - 1]:g} s")
    return t


def _goes_on(curve: Callable[[Vector], Poses], t: Vector) -> bool:
    """Whether a motion that returns has the same velocity at both ends, by one-sided differences."""
    h = 1e-4 * float(t[-1] - t[0])
    near = curve(np.array([t[0], t[0] + h, t[0] + 2 * h, t[-1] - 2 * h, t[-1] - h, t[-1]]))
    rates = [_slope(near.points, h)]
    if near.rotations is not None:
        rates.append(_slope(turn_between(near.rotations[:1], near.rotations), h))
    return all(np.linalg.norm(a - b) <= ALIKE * max(np.linalg.norm(a), np.linalg.norm(b), 1e-9) for a, b in rates)


def _slope(x: Array, h: float) -> tuple[Vector, Vector]:
    first, last = (-3 * x[0] + 4 * x[1] - x[2]) / (2 * h), (3 * x[5] - 4 * x[4] + x[3]) / (2 * h)
    return first, last
