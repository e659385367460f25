"""Cubic segments through points and rotations at given times (C2), and curves gone along at even speed.

A curve is a function of a parameter; what is made of it are the cubics of a spline through some of its points, as many
as it takes to stay within a tolerance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from ..base.errors import ArgumentError
from ..base.types import Array, Flags, Indices, Matrix, Vector
from .path import Path, Samples
from .segments import Segment, cubic_segment, turn_between
from .waypoints import Poses, returned

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
            points[i], points[i + 1], (h * slopes[i], h * slopes[i + 1]), turns[i], (h * spins[i], h * spins[i + 1]),
            h * speed,
        )
        for i, h in enumerate(steps)
    ]  # fmt: skip


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


def of_segments(segments: list[Segment], t: Vector, first: Array | None) -> Curve:
    """The curve of cubics that end at rising times t (k,), from a rotation at the start."""
    path = Path(tuple(segments), 1.0)

    def curve(s: Vector) -> Poses:
        index = np.clip(np.searchsorted(t, s, side="right") - 1, 0, len(segments) - 1)
        at = path.on(index, (s - t[index]) / (t[index + 1] - t[index]))
        return Poses(at.position, None if first is None else at.rotation @ first)

    return curve


def within(curve: Curve, t: Vector, closed: bool, tolerance: float, speed: float) -> list[Segment]:
    """A curve of time [s] as the cubics of a spline, through its points at rising t (k,) and as many more as it takes.

    Args:
        tolerance: from the curve, in the middle of each cubic [m, rad].

    Raises:
        ArgumentError: the curve has a corner or a jump.
    """

    def rough(at: Samples, _begun: list[Samples], wanted: Poses) -> Flags:
        off = np.linalg.norm(at.position - wanted.points, axis=1)
        return (off > tolerance) | (_turned(at, wanted) > tolerance)

    segments, stuck, at = _refined(curve, t, closed, speed, rough, np.full(len(t) - 1, MOST))
    if stuck.any():
        raise ArgumentError(CORNER, at, SMOOTH)
    return segments


def evenly(
    curve: Curve, breaks: Vector, closed: bool, speed: float, angular_speed: float, tolerance: float,
    slowest: float = 0.0,
) -> list[Segment]:  # fmt: skip
    """A curve gone along at even speed, as cubics like those of `within`; breaks are its parameters (k,) there.

    The speed is the tool's [m/s] where the angular speed [rad/s] allows it, to the share `EVEN`. slowest: seconds that
    the parameter takes at least for each unit of its own: the tool is slow where the curve almost stands, in a cusp.

    Raises:
        ArgumentError: the curve has a corner, a jump or no length.
    """
    pieces = np.full(len(breaks) - 1, FINE)
    while True:
        segments, stuck, at = _evenly(curve, breaks, closed, speed, angular_speed, tolerance, slowest, pieces)
        if not stuck.any():
            return segments
        pieces[stuck] *= FINER
        if pieces.max() > FINEST:
            raise ArgumentError(CORNER, at, SMOOTH)


def _evenly(
    curve: Curve, breaks: Vector, closed: bool, speed: float, angular_speed: float, tolerance: float, slowest: float,
    pieces: Indices,
) -> tuple[list[Segment], Flags, float]:  # fmt: skip
    """`evenly`, with the length of each interval measured on some pieces; as `_refined`. Raises: ArgumentError."""
    from scipy.interpolate import PchipInterpolator

    fine = _divided(breaks, pieces)
    edges = [*range(0, len(fine) - 1, BLOCK), len(fine) - 1]
    parts = (fine[a : b + 1] for a, b in pairwise(edges))
    steps = np.concatenate([_seconds(curve(part), part, speed, angular_speed, slowest) for part in parts])
    if not steps.min() > 0:
        cure = "leave out repeated points, or give times to rest there"
        raise ArgumentError("the length of a piece of a curve", 0.0, cure)
    clock = np.append(0.0, np.cumsum(steps))
    knots = clock[np.append(0, np.cumsum(pieces))]

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

    def rough(at: Samples, begun: list[Samples], wanted: Poses) -> Flags:
        ahead = at.velocity / np.maximum(np.linalg.norm(at.velocity, axis=1, keepdims=True), 1e-300)
        gap = at.position - wanted.points
        gap -= np.sum(gap * ahead, axis=1, keepdims=True) * ahead  # along the curve it is the clock that is off
        uneven = np.zeros(len(wanted), dtype=bool)
        for x in (at, *begun):
            sizes = np.linalg.norm(x.velocity, axis=1) / speed, np.linalg.norm(x.angular, axis=1) / angular_speed
            load = _most(*sizes)
            slow = load < 1 - EVEN
            if slow.any():
                slow[slow] = slowest * inverse(x.t[slow], 1) < SLOW
            uneven |= (load > 1 + EVEN) | slow
        off = (np.linalg.norm(gap, axis=1) > tolerance) | (_turned(at, wanted) > TURNED)
        return off | uneven

    return _refined(timed, knots, closed, speed, rough, pieces // 4)


def _refined(
    curve: Curve, knots: Vector, closed: bool, speed: float, rough: Callable[[Samples, list[Samples], Poses], Flags],
    most: Indices,
) -> tuple[list[Segment], Flags, float]:  # fmt: skip
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
        at, *begun = (path.on(index, np.full(len(index), u)) for u in (0.5, 0.0, 0.25, 0.75))
        if poses.rotations is not None:
            at = replace(at, rotation=at.rotation @ poses.rotations[0])
        found = rough(at, begun, curve((t[:-1] + t[1:]) / 2))
        interval = np.repeat(np.arange(len(counts)), counts)
        worse = np.bincount(interval, found, len(counts)) > 0
        stuck = worse & (counts >= most)
        if stuck.any() or not worse.any():
            return segments, stuck, float(t[int(np.argmax(found & stuck[interval]))])
        counts[worse] *= 2


def _divided(breaks: Vector, counts: Indices) -> Vector:
    """Breaks (k + 1,) with counts - 1 points spread evenly in each of the intervals between them."""
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.append(within * np.repeat(np.diff(breaks) / counts, counts) + np.repeat(breaks[:-1], counts), breaks[-1])


def _turned(at: Samples, wanted: Poses) -> Vector:
    """Angles (k,) between rotations and those wanted."""
    if wanted.rotations is None:
        return np.zeros(len(wanted))
    return np.linalg.norm(turn_between(wanted.rotations, at.rotation), axis=1)


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
