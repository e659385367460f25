"""`Path`: segments and curves of the tool in space, followed at constant speed, and the waypoints they are made of.

A path is a chain of segments. Each moves the tool's point along a line, an arc or a cubic and may turn the tool.
Orientation is relative by default: the target is R(t) R_start, with R(0) = 1, so the same path serves any start
orientation. A path through poses says R_start itself, as `rotation`.
"""

from __future__ import annotations

from abc import ABC
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from math import dist, hypot, sqrt
from typing import Any, Self

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError, OpenPathError, ShapeError
from ..base.poses import PoseLike, pose_cure, pose_from, pose_numbers
from ..base.types import (
    Array,
    ArrayLike,
    Indices,
    Matrix,
    Shown,
    Value,
    Vector,
    check_rotation,
    finite,
    frozen,
    numbers,
    positive,
    right_last_row,
    tool_pose,
    whole,
)
from ..symbolic.rotations import rotation_from_rpy


@dataclass(frozen=True, eq=False)
class StraightPath(Value):
    """p(s) = position + s move, R(s) = exp(s turn) rotation, s from 0 to 1: the twist (move, turn) is constant.

    One way, of (3,), (3, 3), (3,), (3,); or many side by side, of (k, 3), (k, 3, 3), (k, 3), (k, 3), or from one pose.
    One way of several frames is of (3F,), (3F, 3), (3F,), (3F,).
    """

    position: Vector
    rotation: Array
    move: Vector
    turn: Vector

    def at(self, share: float | Vector, which: Indices | None = None) -> tuple[Array, Array]:
        """Positions and rotations at a share of all ways, or at one of each (k,); `which`: of some of them."""
        parts = self.position, self.rotation, self.move, self.turn
        p, R, v, w = parts if which is None else (part[which] for part in parts)
        s = np.asarray(share)[..., None]
        if R.shape[-2] == 3:
            return p + s * v, rotation_matrix(s * w) @ R
        return p + s * v, (rotation_matrix((s * w).reshape(-1, 3)) @ R.reshape(-1, 3, 3)).reshape(R.shape)


def straight(position: Vector, rotation: Array, end: Vector, end_rotation: Array) -> StraightPath:
    """The straight path from a pose to another, by the shorter turn; or ways between many."""
    if rotation.shape[-2] == 3:
        turn = rotation_vector(end_rotation @ np.swapaxes(rotation, -1, -2))
    else:
        turn = rotation_vector(end_rotation.reshape(-1, 3, 3) @ np.swapaxes(rotation.reshape(-1, 3, 3), -1, -2)).ravel()
    return StraightPath(position, rotation, end - position, turn)


def rotation_vector(R: Array) -> Array:
    """log: the axes of rotations (..., 3, 3) times their angles (..., 3) [rad]."""
    from scipy.spatial.transform import Rotation  # here, because it doubles the time to import holokin

    return Rotation.from_matrix(R).as_rotvec()


def rotation_matrix(turn: Array) -> Array:
    """exp: the rotations (..., 3, 3) of rotation vectors (..., 3) [rad]."""
    from scipy.spatial.transform import Rotation

    if not np.any(turn):  # most paths turn no tool, and SciPy's takes as long as all else of a step
        return np.tile(np.eye(3), (*np.shape(turn)[:-1], 1, 1))
    return Rotation.from_rotvec(np.array(turn)).as_matrix()  # a copy: it refuses what nobody can write to


NODES, WEIGHTS = (frozen(values) for values in np.polynomial.legendre.leggauss(20))
"""Gauss-Legendre points on [-1, 1]: exact for the area of a cubic, and 1e-15 of the length of the segments of a spline,
which bend little."""

SURE = np.pi - 1e-4
"""Turns [rad] from one waypoint to the next beyond which digits that files leave out may decide their direction."""

HALF_TURN = "it is half a turn, and the last digits decide in which direction: put a waypoint between the two"
"""What to say of longer ones."""

WIDTH = 43
"""Numbers of a segment in a table."""


@dataclass(frozen=True, eq=False)
class Segment(Value):
    """p(u) = center + cos(a u) x + sin(a u) y + [u, u^2, u^3] along, R(u) = exp([1, u, u^2, u^3] turning) R_0.

    u is in [0, 1]. A line has a = 0, x = y = 0 and one row of `along` (3, 3) [m] that is not 0; a cubic has three; an
    arc has along = 0 and perpendicular radii x, y. The rotation vector in the base frame is a cubic, too: `turning`
    (4, 3) [rad]; an even turn has one row, the second.

    nominal [m]: the segment takes nominal / speed seconds; None where its length and its turn decide.
    """

    center: Vector
    x: Vector
    y: Vector
    angle: float
    along: Matrix
    turning: Matrix
    nominal: float | None = None

    @property
    def length(self) -> float:
        """Distance travelled by the point [m]."""
        if not self.along[1:].any():
            return float(np.linalg.norm(self.x)) * abs(self.angle) + float(np.linalg.norm(self.along[0]))
        return self._integral(lambda u: np.linalg.norm(self.derivative(u), axis=1))

    @property
    def turn(self) -> float:
        """Angle by which the tool turns [rad], all the way counted."""
        if not self.turning[2:].any():
            return float(np.linalg.norm(self.turning[1]))
        phi, rate = self.turning, self.turning[1:] * [[1.0], [2.0], [3.0]]
        return self._integral(lambda u: np.linalg.norm(spin(powers(u, 4) @ phi, powers(u, 3) @ rate), axis=1))

    @property
    def twice_area(self) -> Vector:
        """The integral of p x dp (3,) [m^2], exact."""
        if self.angle == 0.0:
            u = (1 + NODES) / 2
            return np.asarray(WEIGHTS / 2 @ np.cross(self.position(u), self.derivative(u)), dtype=float)
        a, b = self.position(np.array([0.0, 1.0]))
        return np.asarray(np.cross(self.center, b - a) + self.angle * np.cross(self.x, self.y), dtype=float)

    @property
    def rotation(self) -> Matrix:
        """R(1) R(0)^T (3, 3): the rotation of the tool from its start to its end."""
        if not self.turning[0].any():
            return rotation_matrix(self.turning.sum(axis=0))
        return rotation_matrix(self.turning.sum(axis=0)) @ rotation_matrix(self.turning[0]).T

    @property
    def bend(self) -> float:
        """A bound of |d^2 p / du^2| [m]."""
        b, c = 2 * self.along[1], 6 * self.along[2]
        return self.angle**2 * float(np.linalg.norm(self.x)) + float(max(np.linalg.norm(b), np.linalg.norm(b + c)))

    @property
    def sway(self) -> float:
        """The even turn [rad] whose second derivatives bound the tool's: its square bounds |w|^2 + |w'| / 2.

        |w| is at most |phi'|, which lies within its control points, and |w'| at most |phi''| + |phi'|^2 / 2.
        """
        even, b, c = self.turning[1:]
        if not (b.any() or c.any()):
            return float(np.linalg.norm(even))
        rate = max(float(np.linalg.norm(v)) for v in (even, even + b, even + 2 * b + 3 * c))
        change = max(float(np.linalg.norm(v)) for v in (2 * b, 2 * b + 6 * c)) + rate**2 / 2
        return (rate**2 + change / 2) ** 0.5

    def position(self, u: Vector) -> Matrix:
        """Points (k, 3) at u (k,)."""
        return positions(self.row[None], u)

    def derivative(self, u: Vector) -> Matrix:
        """dp/du (k, 3)."""
        return derivatives(self.row[None], u)[0]

    @property
    def row(self) -> Vector:
        """The numbers (`WIDTH`,) of a table: center, x, y, angle, along, turning, R_0, seconds, bend, sway.

        R_0 and the seconds are the path's to say: 0 here.
        """
        parts = [self.center, self.x, self.y, [self.angle], self.along.ravel(), self.turning.ravel(), np.zeros(10)]
        return np.concatenate([*parts, [self.bend, self.sway]])

    def part(self, start: float, stop: float) -> Segment:
        """The piece from u = start to u = stop, turned round when stop < start."""
        share = stop - start
        along, turning = _shifted(np.vstack([np.zeros(3), self.along]), start, share), self.turning
        turning = _shifted(turning, start, share)
        if not self.turning[2:].any():  # an even turn goes on about its axis
            turning = np.vstack([np.zeros(3), turning[1:]])
        nominal = None if self.nominal is None else abs(share) * self.nominal
        if self.angle == 0.0:
            return replace(
                self, center=self.position(np.array([start]))[0], along=along[1:], turning=turning, nominal=nominal
            )
        c, s = np.cos(self.angle * start), np.sin(self.angle * start)
        x, y = c * self.x + s * self.y, c * self.y - s * self.x
        return replace(self, x=x, y=y, angle=share * self.angle, turning=turning, nominal=nominal)

    def mapped(self, matrix: Matrix, shift: Vector) -> Segment:
        """The segment under p -> M p + s, M = c R a rotation (3, 3) times a factor; its turns are turned by M / c."""
        turn = matrix / np.cbrt(np.linalg.det(matrix))
        return replace(
            self,
            center=matrix @ self.center + shift,
            x=matrix @ self.x,
            y=matrix @ self.y,
            along=self.along @ matrix.T,
            turning=self.turning @ turn.T,
        )

    def evenly(self, turn: Vector) -> Segment:
        """The same curve of the point with another turn, an even one by a rotation vector (3,) [rad]."""
        return replace(self, turning=_even(turn))

    def _integral(self, density: Callable[[Vector], Vector]) -> float:
        return float(WEIGHTS / 2 @ density((1 + NODES) / 2))


def line_segment(start: Vector, end: Vector, turn: Vector) -> Segment:
    """A straight line with an even turn."""
    zero = np.zeros(3)
    return Segment(start, zero, zero, 0.0, np.array([end - start, zero, zero]), _even(turn))


def arc_segment(center: Vector, x: Vector, y: Vector, angle: float, turn: Vector) -> Segment:
    """An arc of perpendicular radii x, y about a center, with an even turn."""
    return Segment(center, x, y, angle, np.zeros((3, 3)), _even(turn))


def cubic_segment(
    start: Vector,
    end: Vector,
    slopes: tuple[Vector, Vector],
    turn: Vector,
    spins: tuple[Vector, Vector],
    nominal: float | None,
) -> Segment:
    """The cubic between two points with dp/du = slopes at its ends, turning by exp(turn) with w = spins there."""
    zero = np.zeros(3)
    turning = _hermite(turn, spins[0], _unspin(turn, spins[1]))
    along = _hermite(end - start, *slopes)
    return Segment(start, zero, zero, 0.0, along, np.vstack([zero, turning]), nominal)


def _hermite(change: Vector, first: Vector, last: Vector) -> Matrix:
    """Rows [u, u^2, u^3] of the cubic from 0 to `change` with these derivatives at its ends."""
    return np.array([first, 3 * change - 2 * first - last, first + last - 2 * change])


def _even(turn: Vector) -> Matrix:
    return np.array([np.zeros(3), turn, np.zeros(3), np.zeros(3)])


def _shifted(rows: Matrix, start: float, share: float) -> Matrix:
    """The cubic of rows [1, u, u^2, u^3] as one of v, u = start + share v."""
    s, k = start, share
    a, b, c, d = rows
    return np.array(
        [a + s * b + s * s * c + s**3 * d, k * (b + 2 * s * c + 3 * s * s * d), k * k * (c + 3 * s * d), k**3 * d]
    )


def powers(u: Vector, count: int) -> Matrix:
    """[1, u, u^2, ...] (k, count)."""
    return u[:, None] ** np.arange(count)


def positions(rows: Matrix, u: Vector) -> Matrix:
    """Points (k, 3) at u (k,) of segments, a row of a table each, or one for all."""
    angle, along, u = rows[:, 9:10] * u[:, None], rows[:, 10:19], u[:, None]
    cubic = u * along[:, :3] + (u * u) * (along[:, 3:6] + u * along[:, 6:])
    return rows[:, :3] + np.cos(angle) * rows[:, 3:6] + np.sin(angle) * rows[:, 6:9] + cubic


def derivatives(rows: Matrix, u: Vector) -> tuple[Matrix, Matrix, Matrix]:
    """(dp/du, phi, w), each (k, 3): w du is the turn of the tool, phi its rotation vector."""
    a, along, turning, u = rows[:, 9:10], rows[:, 10:19], rows[:, 19:31], u[:, None]
    angle = a * u
    arc = a * (np.cos(angle) * rows[:, 6:9] - np.sin(angle) * rows[:, 3:6])
    slope = arc + (along[:, :3] + u * (2 * along[:, 3:6] + 3 * u * along[:, 6:]))
    phi = turning[:, :3] + u * (turning[:, 3:6] + u * (turning[:, 6:9] + u * turning[:, 9:]))
    even = ~turning[:, 6:].any(axis=1, keepdims=True)
    if even.all():
        return slope, phi, np.broadcast_to(turning[:, 3:6], phi.shape)
    rate = turning[:, 3:6] + u * (2 * turning[:, 6:9] + 3 * u * turning[:, 9:])
    return slope, phi, np.where(even, turning[:, 3:6], spin(phi, rate))


def spin(phi: Array, rate: Array) -> Array:
    """w (..., 3) of R = exp(phi) with phi' = rate: w = rate + b phi x rate + c phi x (phi x rate) [SLA21]."""
    b, c = _factors(np.linalg.norm(phi, axis=-1, keepdims=True))
    once = np.cross(phi, rate)
    return np.asarray(rate + b * once + c * np.cross(phi, once), dtype=float)


def _unspin(phi: Vector, w: Vector) -> Vector:
    """phi' (3,) of R = exp(phi) that turns with w: what `spin` undoes. |phi| < 2 pi."""
    if not phi.any():
        return w
    columns = spin(np.broadcast_to(phi, (3, 3)), np.eye(3)).T
    return np.asarray(np.linalg.solve(columns, w), dtype=float)


def _factors(angle: Array) -> tuple[Array, Array]:
    """((1 - cos a) / a^2, (a - sin a) / a^3), by their series near 0."""
    small, square = np.asarray(angle < 0.3), angle * angle
    a = np.where(small, 1.0, angle)
    series = 1 / 6 - square * (1 / 120 - square * (1 / 5040 - square * (1 / 362880 - square / 39916800)))
    b = np.where(
        small,
        0.5 - square * (1 / 24 - square * (1 / 720 - square * (1 / 40320 - square / 3628800))),
        2 * (np.sin(a / 2) / a) ** 2,
    )
    return b, np.where(small, series, (a - np.sin(a)) / a**3)


def turn_between(first: Array, last: Array) -> Array:
    """The rotation vectors (..., 3) by which rotations go over into others, by the shorter way."""
    return rotation_vector(last @ np.swapaxes(first, -1, -2))


def sure_turns(rotations: Array) -> Matrix:
    """The rotation vectors (k - 1, 3) from each rotation to the next, by the shorter way.

    Raises:
        ArgumentError: half a turn, whose direction is by chance.
    """
    turns = turn_between(rotations[:-1], rotations[1:])
    size = np.linalg.norm(turns, axis=-1)
    if len(size) and size.max() > SURE:
        i = int(np.argmax(size))
        what = f"the turn from waypoint {i}, counted from 0, to the next one"
        raise ArgumentError(what, turns[i].tolist(), HALF_TURN)
    return turns


CLOSED = 1e-9
"""Gap [m or rad] between start and end up to which a path counts as closed."""

SAME = 1e-7
"""Distance between two poses [m, rad, s] up to which they are one and the same: less than any robot can tell apart,
and more than what drawing programs leave where an outline closes."""

CORNER = 1e-6
"""Share of the tool's speed [m/s and rad/s] by which its velocity jumps at a corner: tangents of joined arcs agree to
1e-12, and a jump of 1e-6 is a turn of 0.2 seconds of arc."""

LARGEST = 1e6
"""Largest size of a curve [m], that of the farthest start of a robot."""

ALIKE = 1e-6
"""Difference of two rotations up to which they are one: that of quaternions written with six digits."""

NEARLY_X = 0.999
"""Cosine of the angle from x beyond which an axis of a tool says nothing of where the tool's x axis may point: 2.6
degrees."""

ROUND_OFF = 1e-9
"""Share of a path's duration by which a time may lie outside it."""


@dataclass(frozen=True, eq=False)
class Samples(Shown):
    """A path at k instants: t [s], position (k, 3), rotation (k, 3, 3), velocity [m/s] and angular [rad/s] (k, 3)."""

    t: Vector
    position: Matrix
    rotation: Array
    velocity: Matrix
    angular: Matrix


class OneOrManyPaths(Value, ABC):
    """What `Path` and `SynchronizedPaths` have in common; `closed`, `part` and the others are theirs. Abstract."""

    @cached_property
    def corners(self: Any) -> tuple[int, ...]:
        """Segments at whose start a velocity jumps; 0 among them where a closed path ends in a corner."""
        k = len(self.durations)
        start, end = (self.on(np.arange(k), np.full(k, u)) for u in (0.0, 1.0))
        after = np.hstack([start.velocity, start.angular])
        before = np.roll(np.hstack([end.velocity, end.angular]), 1, axis=0)
        jumps = np.abs(after - before).max(axis=1) > CORNER * np.maximum(np.abs(after), np.abs(before)).max(axis=1)
        return tuple(int(i) for i in np.flatnonzero(jumps) if i > 0 or self.closed)

    def counts(self: Any, samples: int) -> Indices:
        """Steps of each segment so that there are at least `samples`, of nearly equal time, and no corner is cut."""
        return np.maximum(1, np.ceil(whole("samples", samples) * self.durations / self.duration - 1e-9)).astype(int)

    def halves(self) -> tuple[Self, Self]:
        """The two ways round a closed path to the pose half a loop away. Raises: OpenPathError."""
        path: Any = self
        if not path.closed:
            raise OpenPathError("splitting into two paths", path.gap)
        return path.part(0.0, 0.5), path.reversed().part(0.0, 0.5)


@dataclass(frozen=True, eq=False)
class Path(OneOrManyPaths):
    """Segments, one after the other, at `speed` [m/s] (and `angular_speed` [rad/s] where the tool turns on the spot).

    A segment takes max(length / speed, turn / angular_speed) seconds, one with a nominal length nominal / speed.

    rotation: orientation (3, 3) of the tool at the start, in the robot's base; None takes that of the start posture.

    notes: what was changed in making it, such as repeated points that were left out.
    """

    segments: tuple[Segment, ...]
    speed: float = 0.1
    angular_speed: float = 0.5
    rotation: Matrix | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.segments:
            raise ArgumentError("the number of segments of a path", 0, "give at least two points")
        if self.rotation is not None:
            check_rotation("the rotation of a path", finite("the rotation of a path", self.rotation, (3, 3)))
        for name, value in (("speed", self.speed), ("angular_speed", self.angular_speed)):
            positive(name, value, "give a positive speed in m/s or rad/s")
        for duration in self._durations.tolist():
            if not 0 < duration < np.inf:
                cure = "leave out repeated points, and give points and speeds that a robot can have"
                raise ArgumentError("the seconds that a segment takes", duration, cure)

    def __repr__(self) -> str:
        count = len(self.segments)
        notes = "".join(f"; {note}" for note in self.notes)
        return f"Path({count} segment{'s' * (count > 1)}, {self.length:.4g} m, {self.duration:.4g} s{notes})"

    @typed
    def __add__(self, other: Path) -> Path:
        """This path, then the other, moved to start where this one ends; speeds are kept from this one."""
        return join(self, other)

    @cached_property
    def _durations(self) -> Vector:
        def seconds(s: Segment) -> float:
            known = s.nominal
            return known / self.speed if known is not None else max(s.length / self.speed, s.turn / self.angular_speed)

        with np.errstate(over="ignore"):
            return frozen([seconds(s) for s in self.segments])

    @cached_property
    def _rows(self) -> Matrix:
        return frozen([s.row for s in self.segments])

    @cached_property
    def _starts(self) -> Vector:
        return frozen(np.concatenate([[0.0], np.cumsum(self._durations)]))

    @cached_property
    def _rotations(self) -> Array:
        """R at the start of every segment, and at the end (segments + 1, 3, 3)."""
        if not self._rows[:, 19:31].any():
            return frozen(np.tile(np.eye(3), (len(self.segments) + 1, 1, 1)))
        out = [np.eye(3)]
        for segment in self.segments:
            out.append(segment.rotation @ out[-1])
        return frozen(out)

    @cached_property
    def _bases(self) -> Array:
        """R_0 of every segment (segments, 3, 3): its rotations are exp(phi(u)) R_0."""
        first = np.array([s.turning[0] for s in self.segments])
        begun = first.any(axis=1)
        out = self._rotations[:-1].copy()
        if begun.any():
            out[begun] = np.swapaxes(rotation_matrix(first[begun]), 1, 2) @ out[begun]
        return frozen(out)

    def table(self, start_rotation: ArrayLike) -> Matrix:
        """One row a segment (`WIDTH`) of its numbers, with R_0 of a tool at first turned so and with its seconds.

        Raises: ShapeError, NotFiniteError, ArgumentError: the rotation at the start is no matrix (3, 3).
        """
        rows = self._rows.copy()
        rows[:, 31:40] = (self._bases @ finite("the rotation at the start", start_rotation, (3, 3))).reshape(-1, 9)
        rows[:, 40] = self._durations
        return rows

    @property
    def length(self) -> float:
        """Distance travelled by the point [m]."""
        return sum(s.length for s in self.segments)

    @property
    def duration(self) -> float:
        """Time for one run [s]."""
        return float(self._starts[-1])

    @property
    def start(self) -> Vector:
        """First point (3,) [m]."""
        return self.segments[0].position(np.zeros(1))[0]

    @property
    def end(self) -> Vector:
        """Last point (3,) [m]."""
        return self.segments[-1].position(np.ones(1))[0]

    @property
    def area(self) -> Vector:
        """Area vector (3,) [m^2] of a closed path, half the integral of p x dp: normal to a plane loop,
        towards the side from which it runs counter-clockwise."""
        total = sum((s.mapped(np.eye(3), -self.start).twice_area for s in self.segments), np.zeros(3))
        return np.asarray(total / 2, dtype=float)

    @property
    def counter_clockwise(self) -> bool:
        """Whether a closed path runs counter-clockwise, seen against the axis (x, y or z) it winds about most."""
        area = self.area
        return bool(area[np.argmax(np.abs(area))] > 0)

    @property
    def turned(self) -> Matrix:
        """Rotation (3, 3) between the start and the end."""
        return np.asarray(self._rotations[-1])

    @cached_property
    def gap(self) -> float:
        """How far the end pose is from the start pose: the larger of metres and radians."""
        chord = float(np.linalg.norm(self._rotations[-1] - np.eye(3))) / np.sqrt(8.0)  # sin(angle / 2)
        return max(float(np.linalg.norm(self.end - self.start)), 2 * float(np.arcsin(min(chord, 1.0))))

    @cached_property
    def closed(self) -> bool:
        """True when the path ends in the pose it starts from."""
        return self.gap <= CLOSED

    @typed
    def at(self, t: ArrayLike) -> Samples:
        """The path at times t (k,) in [0, duration]; at a corner the segment that begins there.

        Raises:
            ArgumentError, NotFiniteError: no such times. Round-off beyond the ends is forgiven.
        """
        t = finite("t", np.atleast_1d(numbers("t", t)), ("k",))
        outside = np.maximum(-t, t - self.duration)
        if t.size and outside.max() > ROUND_OFF * self.duration:
            worst = float(t.flat[np.argmax(outside)])
            raise ArgumentError("t", worst, f"the path lasts from 0 to {self.duration:.9g} s")
        t = np.clip(t, 0.0, self.duration)
        index = np.clip(np.searchsorted(self._starts, t, side="right") - 1, 0, len(self.segments) - 1)
        return self._on(index, (t - self._starts[index]) / self._durations[index])

    def on(self, index: ArrayLike, u: ArrayLike) -> Samples:
        """The path on the segments index (k,) at their parameter u (k,) in [0, 1].

        Raises: ShapeError, NotFiniteError, ArgumentError: no such segments, or no such parameters.
        """
        chosen, parameters, count = numbers("the segments", index), finite("u", u, ("k",)), len(self.segments)
        if chosen.shape != parameters.shape:
            raise ShapeError("the segments", parameters.shape, chosen.shape, "give one for each u")
        if not ((chosen >= 0) & (chosen < count) & (chosen == np.floor(chosen))).all():
            raise ArgumentError("the segments", chosen.tolist(), f"give whole numbers from 0 to {count - 1}")
        if not np.abs(parameters - 0.5).max(initial=0.0) <= 0.5 + ROUND_OFF:
            raise ArgumentError("u", parameters.tolist(), "give numbers from 0 to 1")
        return self._on(chosen.astype(np.intp), parameters)

    def _on(self, index: Indices, u: Vector) -> Samples:
        k, rows = len(u), self._rows[index]
        seconds = self._durations[index][:, None]
        slope, phi, w = derivatives(rows, u)
        p, v, w, R = positions(rows, u), slope / seconds, w / seconds, rotation_matrix(phi) @ self._bases[index]
        if self.closed and k:  # a closed path ends exactly where it starts
            last = (index == len(self.segments) - 1) & (u == 1.0)
            if last.any():
                p[last], R[last] = self.start, np.eye(3)
        return Samples(self._starts[index] + u * self._durations[index], p, R, v, w)

    @property
    def starts(self) -> Vector:
        """Seconds at which each segment starts, and the path's end."""
        return self._starts

    @property
    def durations(self) -> Vector:
        """Seconds that each segment takes."""
        return self._durations

    def steps(self, samples: int) -> tuple[Indices, Vector, Vector]:
        """The steps of `counts`: (segment, u_start, u_stop), each (k,)."""
        counts = self.counts(samples)
        return locate(counts, np.arange(counts.sum()))

    @typed
    def part(self, start: float, stop: float) -> Path:
        """The piece between two fractions of the duration, 0 <= start < stop <= 1."""
        if not 0.0 <= start < stop <= 1.0:
            raise ArgumentError("the part of a path", (start, stop), "give 0 <= start < stop <= 1")
        segments = tuple(self.cut(start * self.duration, stop * self.duration))
        return replace(self, segments=segments, rotation=self._turned(self.at(start * self.duration).rotation[0]))

    @typed
    def cut(self, start: float, stop: float) -> list[Segment]:
        """The segments between two times [s]."""
        pieces = []
        for i, segment in enumerate(self.segments):
            a, b = np.clip((np.array([start, stop]) - self._starts[i]) / self._durations[i], 0.0, 1.0).tolist()
            if b - a > 1e-12:
                pieces.append(segment if (a, b) == (0.0, 1.0) else segment.part(a, b))
        return pieces

    def reversed(self) -> Path:
        """The same curve run backwards, with its turns undone in reverse order (they count from its own start)."""
        back = tuple(s.part(1.0, 0.0) for s in reversed(self.segments))
        return replace(self, segments=back, rotation=self._turned(self.turned))

    def _turned(self, turned: Matrix) -> Matrix | None:
        return None if self.rotation is None else turned @ self.rotation

    def starting_at(self, point: ArrayLike) -> Path:
        """The path moved, without turning, to start at a point (3,) or (2,) [m]."""
        shift = as_point(point) - self.start
        return replace(self, segments=tuple(replace(s, center=s.center + shift) for s in self.segments))

    def in_frame(self, frame: PoseLike) -> Path:
        """The path, given in a workpiece's frame, in the robot's base: points, turns and the rotation at the start.

        Args:
            frame: pose (4, 4) of the workpiece in the base, or (6,): x, y, z [m], roll, pitch, yaw [rad].
        """
        F = frame_pose("the frame of a path", frame)
        R, rotation = F[:3, :3], None if self.rotation is None else F[:3, :3] @ self.rotation
        return replace(self, segments=tuple(s.mapped(R, F[:3, 3]) for s in self.segments), rotation=rotation)

    @typed
    def at_pace(self, speed: float) -> Path:
        """The same path in the same times, with another speed as its own [m/s]."""
        share = speed / self.speed
        longer = tuple(s if s.nominal is None else replace(s, nominal=share * s.nominal) for s in self.segments)
        return replace(self, segments=longer, speed=speed)

    @typed
    def at_speed(self, speed: float, angular_speed: float | None = None) -> Path:
        """The same curve at another speed [m/s], and angular speed [rad/s]."""
        return replace(self, speed=speed, angular_speed=self.angular_speed if angular_speed is None else angular_speed)


def locate(counts: Indices, step: Indices) -> tuple[Indices, Vector, Vector]:
    """(segment, u_start, u_stop), each (k,), of some steps (k,), where the segments have counts of them."""
    ends = np.cumsum(counts)
    segment = np.searchsorted(ends, step, side="right")
    within, total = step - (ends - counts)[segment], counts[segment]
    return segment, within / total, (within + 1) / total


@typed
def join(*paths: Path) -> Path:
    """Paths one after the other, each moved to start where the one before ends; the first one's speeds hold.

    Raises:
        ArgumentError: no paths, or one whose own rotation at its start is not that in which the tool gets there.
    """
    if not paths:
        raise ArgumentError("the paths to join", paths, "give at least one")
    whole = paths[0]
    for path in paths[1:]:
        turned, rotation = whole.turned, whole.rotation
        if path.rotation is not None and rotation is None:
            rotation = turned.T @ path.rotation
        elif path.rotation is not None and rotation is not None:
            off = float(np.abs(path.rotation - turned @ rotation).max())
            if off > ALIKE:
                cure = "turn the tool on the way there, by hk.line(..., turn=...)"
                raise ArgumentError("the difference of rotations where two paths meet", off, cure)
        segments = (*whole.segments, *path.starting_at(whole.end).segments)
        whole = replace(whole, segments=segments, rotation=rotation, notes=(*whole.notes, *path.notes))
    return whole


def frame_pose(what: str, frame: PoseLike) -> Matrix:
    """A pose (4, 4) of one, or of x, y, z [m], roll, pitch, yaw [rad] (6,), R = Rz(yaw) Ry(pitch) Rx(roll).

    Raises:
        ShapeError, NotFiniteError, ArgumentError: no such pose.
    """
    given = pose_numbers(what, frame)
    if given.shape == (6,):
        six = finite(what, given, (6,))
        return pose_from(six[:3], rotation_from_rpy(six[3:].tolist()))
    cure = pose_cure(given) or "or x, y, z, roll, pitch, yaw (6,)"
    return tool_pose(what, finite(what, given, (4, 4), cure))


def as_point(point: ArrayLike) -> Vector:
    """A point (3,); a planar one (2,) gets z = 0. Raises: ShapeError, NotFiniteError."""
    p = numbers("a point", point)
    if p.shape == (2,):
        p = np.append(p, 0.0)
    return finite("a point", p, (3,))


@dataclass(frozen=True, eq=False)
class Waypoints(Value):
    """Points (k, 3) [m] of the tool, with rotations (k, 3, 3) and times (k,) [s] where they are given.

    `notes` says what was changed in reading, and what looks odd. A path of a file has a `name`, and what the file says:
    `axes` (k, 3), unit vectors along the tool's z axis, where it gives no rotations, which are turned about them as
    little as can be; `speeds` (k - 1,) [m/s] of the moves from point to point, NaN where it states none; `moves`, a
    segment each, where some are not straight; `approach` (j, 3) [m], the rapid moves to the first point; `comments`.
    """

    points: Matrix
    rotations: Array | None = None
    times: Vector | None = None
    source: str = ""
    notes: tuple[str, ...] = ()
    name: str = ""
    axes: Matrix | None = None
    speeds: Vector | None = None
    moves: tuple[Segment, ...] | None = None
    approach: Matrix | None = None
    comments: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.points)

    @typed
    def path(self, speed: float = 0.1, angular_speed: float = 0.5) -> Path:
        """The path along the moves as the file draws them, straight from point to point where it says no more.

        It has the times of the file, or its speeds, the greatest of which is that of the path.

        Args:
            speed, angular_speed: [m/s] and [rad/s], where the file states no speed, or the tool turns on the spot.

        Raises:
            ArgumentError: two points alike, or half a turn between two.
        """
        turns = np.zeros((len(self) - 1, 3)) if self.rotations is None else sure_turns(self.rotations)
        if self.moves is None:
            segments = [line_segment(*ends, turn) for ends, turn in zip(pairwise(self.points), turns, strict=True)]
        else:
            segments = [move.evenly(turn) for move, turn in zip(self.moves, turns, strict=True)]
        first = None if self.rotations is None else self.rotations[0]
        if self.speeds is not None and not np.isnan(self.speeds).any():
            speed = float(np.max(self.speeds))
        return Path(tuple(paced(segments, self.seconds(segments), speed)), speed, angular_speed, first, self.notes)

    def seconds(self, moves: Sequence[Segment], index: Indices | None = None) -> Vector:
        """Seconds (k - 1,) of moves between its points, or some of them, by its times or speeds; NaN without these."""
        rows = np.arange(len(self)) if index is None else index
        if self.times is not None:
            return np.diff(self.times[rows])
        if self.speeds is None:
            return np.full(len(rows) - 1, np.nan)
        lengths = np.array([move.length for move in moves[: len(rows) - 1]])
        return np.where(lengths > 0.0, lengths / self.speeds[rows[1:] - 1], np.nan)


def paced(segments: Sequence[Segment], seconds: Vector, speed: float) -> list[Segment]:
    """Segments of a path at `speed` [m/s] that take their own seconds (k,), where these are not NaN."""
    return [
        segment if np.isnan(own) else replace(segment, nominal=own * speed)
        for segment, own in zip(segments, seconds.tolist(), strict=True)
    ]


def rotations_along(axes: Matrix) -> Array:
    """Rotations (k, 3, 3) of a tool whose z axis has the directions of unit vectors (k, 3).

    The x axis of the first one is as near to x as can be; each other one is the one before, turned about the line that
    is perpendicular to both directions. For opposite directions there is no such line, and the result means nothing.
    """
    start = np.array([1.0, 0.0, 0.0]) if abs(axes[0][0]) < NEARLY_X else np.array([0.0, 1.0, 0.0])
    x, y, z = (start - (start @ axes[0]) * axes[0]).tolist()
    rows = axes.tolist()
    a, b, c = rows[0]
    along = []
    for i, (u, v, w) in enumerate(rows):
        if i:  # numbers of Python, which take a fifth of the time of arrays of three
            share = (x * u + y * v + z * w) / max(1.0 + a * u + b * v + c * w, 1e-12)
            x, y, z = x - share * (a + u), y - share * (b + v), z - share * (c + w)
        off = x * u + y * v + z * w
        x, y, z = x - off * u, y - off * v, z - off * w
        size = sqrt(x * x + y * y + z * z)
        x, y, z, a, b, c = x / size, y / size, z / size, u, v, w
        along.append((x, y, z))
    return np.stack([np.array(along), np.cross(axes, along), axes], axis=2)


@dataclass(frozen=True, eq=False)
class Poses(Value):
    """Points (k, 3) [m] and, where the tool turns, rotations (k, 3, 3)."""

    points: Matrix
    rotations: Array | None

    def __len__(self) -> int:
        return len(self.points)

    def at(self, index: object) -> Poses:
        """Some of them."""
        return Poses(self.points[index], None if self.rotations is None else self.rotations[index])  # type: ignore[index]


def distinct(poses: Poses, more: Vector | None = None) -> tuple[Poses, Indices, tuple[str, ...]]:
    """The poses that are not the one before, their indices, and a note on the others.

    Of poses within `SAME` of each other the first one is kept. A last pose within it of the first one becomes that.

    Args:
        more: times (k,) [s] or angles turned [rad], by which a rest or a turn on the spot is told from a repeat.

    Raises:
        ArgumentError: not even two are left.
    """
    rows = poses.points
    if more is not None:
        rows = np.column_stack([rows, more])
    if poses.rotations is not None:  # divided so that the distance of two is their angle
        rows = np.hstack([rows, poses.rotations.reshape(-1, 9) / sqrt(2)])
    rows = rows.tolist()
    distinct_rows: list[int] = []
    for i, row in enumerate(rows):
        if not distinct_rows or dist(row, rows[distinct_rows[-1]]) > SAME:
            distinct_rows.append(i)
    count = len(distinct_rows)
    if count < 2:
        raise ArgumentError("the number of points that differ", count, f"give at least two, {SAME:g} m apart")
    index = np.array(distinct_rows)
    repeats = len(rows) - count
    what = "point" if repeats == 1 else "points"
    notes = (f"{repeats} repeated {what} left out, within {SAME:g} m of the one before",) * (repeats > 0)
    return returned(poses.at(index) if notes else poses), index, notes


def meets(poses: Poses) -> bool:
    """Whether the last pose is the first one."""
    off = dist(poses.points[0].tolist(), poses.points[-1].tolist())
    if poses.rotations is None:
        return off <= SAME
    turned = dist(poses.rotations[0].ravel().tolist(), poses.rotations[-1].ravel().tolist()) / sqrt(2)
    return hypot(off, turned) <= SAME


def returned(poses: Poses) -> Poses:
    """The poses, where the last one is the first one, so to the last bit."""
    return poses.at(np.append(np.arange(len(poses) - 1), 0)) if meets(poses) else poses


def as_poses(points: PoseLike | Waypoints) -> Poses:
    """Points (k, 3), (k, 2), poses (k, 4, 4) or waypoints. Raises: ShapeError, NotFiniteError, ArgumentError."""
    if isinstance(points, Waypoints):
        if points.moves is not None:
            cure = "take its path(), which has the arcs and curves of the file"
            raise ArgumentError("the waypoints", f"of {points.name!r}, with curves between them", cure)
        return Poses(points.points, points.rotations)
    given = pose_numbers("the waypoints", points)
    if given.ndim == 3:
        poses = finite("the waypoints", given, ("k", 4, 4))
        for i, pose in enumerate(poses):
            right_last_row(f"waypoint {i}", pose)
            check_rotation(f"the rotation of waypoint {i}", pose[:3, :3])
        return Poses(poses[:, :3, 3], poses[:, :3, :3])
    if given.ndim != 2 or pose_cure(given):
        cure = pose_cure(given) or "give points or poses, one a row"
        raise ShapeError("the waypoints", "(k, 3) or (k, 4, 4)", given.shape, cure)
    if given.shape[1] == 2:
        given = np.column_stack([given, np.zeros(len(given))])
    return Poses(finite("the waypoints", given, ("k", 3)), None)
