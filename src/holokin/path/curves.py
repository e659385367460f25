"""Paths to begin with: lines, arcs, polylines, splines, figures, rasters and spirals over surfaces.

A curve is a function of a parameter; what is made of it are the cubics of a spline through some of its points, as many
as it takes to stay within a tolerance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Literal

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError
from ..base.poses import PoseLike, pose_numbers
from ..base.types import Array, ArrayLike, Flags, Indices, Matrix, Value, Vector, finite, positive, whole
from .path import (
    LARGEST,
    Path,
    Poses,
    Samples,
    Segment,
    Waypoints,
    arc_segment,
    as_point,
    as_poses,
    cubic_segment,
    distinct,
    join,
    line_segment,
    meets,
    paced,
    returned,
    sure_turns,
    turn_between,
)

# --- Paths of lines and arcs.


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
        first, spins = poses.rotations[0], sure_turns(poses.rotations)
    segments = [line_segment(a, b, s) for a, b, s in zip(poses.points, poses.points[1:], spins, strict=False)]
    notes_of_file = points.notes if isinstance(points, Waypoints) else ()
    path = Path(tuple(segments), speed, rotation=first, notes=(*notes_of_file, *notes))
    if isinstance(points, Waypoints) and points.speeds is not None:
        kept = index[index < len(points)]  # without the line back
        seconds = np.append(points.seconds(segments, kept), np.full(len(index) - len(kept), np.nan))
        return replace(path, segments=tuple(paced(segments, seconds, speed)))
    return path


def _planar(points: PoseLike) -> ArrayLike:
    return np.atleast_2d(pose_numbers("the points of a polyline", points))


EVEN = 0.01
"""Share by which the tool's speed on a spline without times may be off."""

SLOW = 0.4
"""Share of the slowest pace of a curve from which its tool may be slower than even speed."""

TURNED = 1e-4
"""How far [rad] the tool may be turned from the orientations of a curve gone along at even speed."""

FINE, FINER, FINEST = 64, 8, 4096
"""Pieces of an interval on which its length is measured: with 64 a bend of 90 degrees is measured to 3e-5; sharper ones
take 8 times as many, or 64 times."""

ROUND = 8
"""Exponent of the norm that stands for the larger of two: they slow each other down by 9 % where both are alike, and by
0.05 % where one is half the other."""

MOST = 512
"""Pieces of one interval at most: a curve that needs more has a corner or a jump there."""

BLOCK = 65_536
"""Points of a curve that are looked at together: 20 MB."""

PADDING = 30
"""Rotations by which a closed series is continued at both ends: what a spline does at its end fades by 0.27 a knot."""


CORNER = "the time [s] of a corner or jump of a curve"
SMOOTH = "let it be smooth between the waypoints, give times, or give a larger tolerance"

Curve = Callable[[Vector], Poses]
"""s (k,) -> poses at these parameters."""


def cubics(t: Vector, poses: Poses, closed: bool, speed: float) -> list[Segment]:
    """The C2 spline through poses at rising times t (k,) [s], a cubic between each two.

    Positions by the cubic spline, rotations by one of rotation vectors, both of SciPy; closed: the last pose is the
    first one, and the curve is smooth there, too. Else the third derivative is the same on the first two and on the
    last two pieces, and the angular acceleration vanishes at the ends.

    speed: that at which the path takes these times [m/s].
    """
    from scipy.interpolate import CubicSpline

    poses = returned(poses) if closed else poses
    points = poses.points
    wraps = "periodic" if closed and len(t) > 2 else "not-a-knot"
    slopes = CubicSpline(t, points, bc_type=wraps)(t, 1)
    turns, spins = _turns(t, poses.rotations, closed)
    steps = np.diff(t)
    return [
        cubic_segment(
            points[i],
            points[i + 1],
            (h * slopes[i], h * slopes[i + 1]),
            turns[i],
            (h * spins[i], h * spins[i + 1]),
            h * speed,
        )
        for i, h in enumerate(steps)
    ]


def _turns(t: Vector, rotations: Array | None, closed: bool) -> tuple[Matrix, Matrix]:
    """(rotation vectors (k - 1, 3) between neighbours, angular velocities (k, 3) [rad/s]), in the base frame."""
    if rotations is None:
        return np.zeros((len(t) - 1, 3)), np.zeros((len(t), 3))
    from scipy.spatial.transform import Rotation, RotationSpline

    k = len(t)
    times, series = t, rotations
    if closed and k > 2:
        rounds = -(-PADDING // (k - 1))
        laps = np.arange(-rounds, rounds + 1)[:, None] * (t[-1] - t[0])
        times = np.append((t[:-1] + laps).ravel(), t[-1] + laps[-1])
        series = np.concatenate([np.tile(rotations[:-1], (len(laps), 1, 1)), rotations[:1]])
    spline = RotationSpline(times, Rotation.from_matrix(series))
    body = spline(t, 1)  # in the tool's frame
    if closed and k > 2:
        body[-1] = body[0]
    return turn_between(rotations[:-1], rotations[1:]), np.einsum("kij,kj->ki", rotations, body)


def _of_segments(segments: list[Segment], t: Vector, first: Array | None) -> Curve:
    """The curve of cubics that end at rising times t (k,), from a rotation at the start."""
    path = Path(tuple(segments), 1.0)

    def curve(s: Vector) -> Poses:
        index = np.clip(np.searchsorted(t, s, side="right") - 1, 0, len(segments) - 1)
        samples = path.on(index, (s - t[index]) / (t[index + 1] - t[index]))
        return Poses(samples.position, None if first is None else samples.rotation @ first)

    return curve


def within(curve: Curve, t: Vector, closed: bool, tolerance: float, speed: float) -> list[Segment]:
    """A curve of time [s] as the cubics of a spline, through its points at rising t (k,) and as many more as it takes.

    Args:
        tolerance: from the curve, in the middle of each cubic [m, rad].

    Raises:
        ArgumentError: the curve has a corner or a jump.
    """

    def rough(samples: Samples, _begun: list[Samples], wanted: Poses) -> Flags:
        off = np.linalg.norm(samples.position - wanted.points, axis=1)
        return (off > tolerance) | (_angles_between(samples, wanted) > tolerance)

    segments, stuck, samples = _refined(curve, t, closed, speed, rough, np.full(len(t) - 1, MOST))
    if stuck.any():
        raise ArgumentError(CORNER, samples, SMOOTH)
    return segments


def evenly(
    curve: Curve,
    breaks: Vector,
    closed: bool,
    speed: float,
    angular_speed: float,
    tolerance: float,
    slowest: float = 0.0,
) -> list[Segment]:
    """A curve gone along at even speed, as cubics like those of `within`; breaks are its parameters (k,) there.

    The speed is the tool's [m/s] where the angular speed [rad/s] allows it, to the share `EVEN`. slowest: seconds that
    the parameter takes at least for each unit of its own: the tool is slow where the curve almost stands, in a cusp.

    Raises:
        ArgumentError: the curve has a corner, a jump or no length.
    """
    pieces = np.full(len(breaks) - 1, FINE)
    while True:
        segments, stuck, parameters = _evenly(curve, breaks, closed, speed, angular_speed, tolerance, slowest, pieces)
        if not stuck.any():
            return segments
        pieces[stuck] *= FINER
        if pieces.max() > FINEST:
            raise ArgumentError(CORNER, parameters, SMOOTH)


def _evenly(
    curve: Curve,
    breaks: Vector,
    closed: bool,
    speed: float,
    angular_speed: float,
    tolerance: float,
    slowest: float,
    pieces: Indices,
) -> tuple[list[Segment], Flags, float]:
    """`evenly`, with the length of each interval measured on some pieces; as `_refined`. Raises: ArgumentError."""
    from scipy.interpolate import PchipInterpolator

    # The clock: seconds along the curve up to each of its fine places.
    fine = _divided(breaks, pieces)
    edges = [*range(0, len(fine) - 1, BLOCK), len(fine) - 1]
    parts = (fine[a : b + 1] for a, b in pairwise(edges))
    steps = np.concatenate([_seconds(curve(part), part, speed, angular_speed, slowest) for part in parts])
    if not steps.min() > 0:
        cure = "leave out repeated points, or give times to rest there"
        raise ArgumentError("the length of a piece of a curve", 0.0, cure)
    clock = np.append(0.0, np.cumsum(steps))
    knots = clock[np.append(0, np.cumsum(pieces))]

    # Its inverse, time to parameter, by monotone cubics.
    @lru_cache(maxsize=1)
    def interpolated(k: int) -> PchipInterpolator:
        near = slice(max(0, edges[k] - 2), edges[k + 1] + 3)  # it has the slopes of one through all: they are local
        return PchipInterpolator(clock[near], fine[near])

    def inverse(t: Vector, order: int = 0) -> Vector:
        cuts = [0, *np.searchsorted(t, clock[edges[1:-1]]).tolist(), len(t)]
        return np.concatenate([interpolated(k)(t[a:b], order) for k, (a, b) in enumerate(pairwise(cuts)) if a < b])

    def timed(t: Vector) -> Poses:
        place = np.searchsorted(knots, t).clip(0, len(knots) - 1)
        return curve(np.where(knots[place] == t, breaks[place], inverse(t)))  # waypoints to the last bit

    # Where a cubic is off the curve, turned from it, or not even.
    def rough(samples: Samples, begun: list[Samples], wanted: Poses) -> Flags:
        ahead = samples.velocity / np.maximum(np.linalg.norm(samples.velocity, axis=1, keepdims=True), 1e-300)
        gap = samples.position - wanted.points
        gap -= np.sum(gap * ahead, axis=1, keepdims=True) * ahead  # along the curve it is the clock that is off
        uneven = np.zeros(len(wanted), dtype=bool)
        for x in (samples, *begun):
            sizes = np.linalg.norm(x.velocity, axis=1) / speed, np.linalg.norm(x.angular, axis=1) / angular_speed
            load = _most(*sizes)
            slow = load < 1 - EVEN
            if slow.any():
                slow[slow] = slowest * inverse(x.t[slow], 1) < SLOW
            uneven |= (load > 1 + EVEN) | slow
        off = (np.linalg.norm(gap, axis=1) > tolerance) | (_angles_between(samples, wanted) > TURNED)
        return off | uneven

    return _refined(timed, knots, closed, speed, rough, pieces // 4)


def _refined(
    curve: Curve,
    knots: Vector,
    closed: bool,
    speed: float,
    rough: Callable[[Samples, list[Samples], Poses], Flags],
    most: Indices,
) -> tuple[list[Segment], Flags, float]:
    """The spline through a curve of time at knots, and at more of them, until no cubic of it is rough.

    Returns:
        Its cubics; intervals between knots (k,) that are still rough with the most cubics, and a time in one of them.
    """
    counts = np.ones(len(knots) - 1, dtype=int)
    while True:
        t = _divided(knots, counts)
        poses = curve(t)
        segments = cubics(t, poses, closed, speed)
        path = Path(tuple(segments), speed)
        index = np.arange(len(segments))
        middle, *begun = (path.on(index, np.full(len(index), u)) for u in (0.5, 0.0, 0.25, 0.75))
        if poses.rotations is not None:
            middle = replace(middle, rotation=middle.rotation @ poses.rotations[0])
        spline = rough(middle, begun, curve((t[:-1] + t[1:]) / 2))
        interval = np.repeat(np.arange(len(counts)), counts)
        worse = np.bincount(interval, spline, len(counts)) > 0
        stuck = worse & (counts >= most)
        if stuck.any() or not worse.any():
            return segments, stuck, float(t[int(np.argmax(spline & stuck[interval]))])
        counts[worse] *= 2


def _divided(breaks: Vector, counts: Indices) -> Vector:
    """Breaks (k + 1,) with counts - 1 points spread evenly in each of the intervals between them."""
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.append(within * np.repeat(np.diff(breaks) / counts, counts) + np.repeat(breaks[:-1], counts), breaks[-1])


def _angles_between(samples: Samples, wanted: Poses) -> Vector:
    """Angles (k,) between rotations and those wanted."""
    if wanted.rotations is None:
        return np.zeros(len(wanted))
    return np.linalg.norm(turn_between(wanted.rotations, samples.rotation), axis=1)


def _most(*sizes: Array) -> Array:
    """About the largest of some numbers, without the kinks where they change places."""
    top = np.maximum(np.max(sizes, axis=0), 1e-300)
    return top * np.sum([(size / top) ** ROUND for size in sizes], axis=0) ** (1 / ROUND)


def _seconds(poses: Poses, s: Vector, speed: float, angular_speed: float, slowest: float) -> Vector:
    """Seconds (k - 1,) from pose to pose at parameters s (k,): about the longer of moving and turning."""
    sizes = [np.linalg.norm(np.diff(poses.points, axis=0), axis=1) / speed, slowest * np.diff(s)]
    if poses.rotations is not None:
        turned = np.linalg.norm(turn_between(poses.rotations[:-1], poses.rotations[1:]), axis=1)
        sizes.append(turned / angular_speed)
    return _most(*sizes)


def even_curve(
    points: Callable[[Vector], Matrix], pieces: int, closed: bool, speed: float, tolerance: float
) -> list[Segment]:
    """A curve of points, of a parameter from 0 to a number of smooth pieces, as cubics at even speed. As `evenly`."""
    breaks = np.arange(pieces + 1.0)
    return evenly(lambda s: Poses(points(s), None), breaks, closed, speed, 1.0, tolerance)


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
    notes_of_file = () if given is None else given.notes
    if given is not None and given.speeds is not None:
        notes_of_file = (*notes_of_file, f"the speeds of the file are left out: a spline goes at one, {speed:g} m/s")
    first = poses.rotations[0] if poses.rotations is not None else None
    # With times: a spline through the waypoints at these.
    if times is not None:
        if closed and not meets(poses):
            cure = "give the first waypoint again as the last one, with the time of the return"
            raise ArgumentError("the end of a closed path with times", poses.points[-1].tolist(), cure)
        t = finite("times", times, (len(poses),), "give one for each waypoint")
        poses, distinct_rows, notes = distinct(poses, t)
        t = rising(t[distinct_rows], len(poses))
        if poses.rotations is not None:
            sure_turns(poses.rotations)
        return replace(_timed_path(cubics(t, poses, closed, 1.0), first, t), notes=(*notes_of_file, *notes))
    if closed and not meets(poses):
        poses = poses.at(np.append(np.arange(len(poses)), 0))
    poses, _, notes = distinct(poses)
    turns = None if poses.rotations is None else sure_turns(poses.rotations)
    positive("speed", speed, "give a positive speed in m/s or rad/s")
    positive("angular_speed", angular_speed, "give a positive speed in m/s or rad/s")
    # Without: a spline by chord lengths, gone along at even speed.
    far = np.linalg.norm(np.diff(poses.points, axis=0), axis=1) / speed
    if turns is not None:
        turned = np.linalg.norm(turns, axis=1)
        far = np.maximum(far, turned / angular_speed)
    t = np.concatenate([[0.0], np.cumsum(far)])
    size = float(np.ptp(poses.points, axis=0).max())
    if size > LARGEST:
        raise ArgumentError("the size of a curve", size, f"give metres, at most {LARGEST:g}")
    curve = _of_segments(cubics(t, poses, closed, 1.0), t, first)
    segments = evenly(curve, t, closed, speed, angular_speed, SHAPE * max(1.0, size), SLOWEST)
    return Path(tuple(segments), speed, angular_speed, first, (*notes_of_file, *notes))


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


# --- Paths over a plane or curved patch: figure eight, raster, spiral.

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
    points = patch.at(corners)
    first = None if points.rotations is None else points.rotations[0]
    if patch.surface is None:
        pairs = zip(points.points[:-1], points.points[1:], strict=True)
        return Path(tuple(line_segment(a, b, np.zeros(3)) for a, b in pairs), speed, angular_speed, first)
    pieces = []
    for k, (a, b) in enumerate(pairwise(corners)):

        def curve(s: Vector, a: Vector = a, b: Vector = b) -> Poses:
            return patch.at(a + s[:, None] * (b - a))

        tolerance = _tolerance(float(np.abs(b - a).max()))
        segments = evenly(curve, np.linspace(0.0, 1.0, 3), False, speed, angular_speed, tolerance)
        rotation = None if points.rotations is None else points.rotations[k]
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
