"""`Path`: curves of the tool in space, followed at constant speed; closed or open, reversible, joinable.

A path is a chain of segments. Each moves the tool's point along a line or an arc and may turn the tool
evenly about a fixed axis. Orientation is relative: the target is R(t) R_start, with R(0) = 1, so the same
path serves any start orientation and constant orientation is the default.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .arguments import typed
from .errors import ArgumentError, OpenPathError
from .types import Array, ArrayLike, Indices, Matrix, Value, Vector, finite, frozen, numbers, positive, whole
from .ways import rotation_matrix

CLOSED = 1e-9
"""Gap [m or rad] between start and end up to which a path counts as closed."""

CORNER = 1e-6
"""Share of the tool's speed [m/s and rad/s] by which its velocity jumps at a corner: tangents of joined arcs agree to
1e-12, and a jump of 1e-6 is a turn of 0.2 seconds of arc."""

ROUND_OFF = 1e-9
"""Share of a path's duration by which a time may lie outside it."""


@dataclass(frozen=True, eq=False)
class Segment(Value):
    """p(u) = center + cos(a u) x + sin(a u) y + u v for u in [0, 1], turning by the rotation vector `turn`.

    A line has a = 0, x = 0 and v its direction; an arc has v = 0 and x, y perpendicular radii.
    """

    center: Vector
    x: Vector
    y: Vector
    angle: float
    v: Vector
    turn: Vector

    @property
    def length(self) -> float:
        """Distance travelled by the point [m]."""
        return float(np.linalg.norm(self.x)) * abs(self.angle) + float(np.linalg.norm(self.v))

    def position(self, u: Vector) -> Matrix:
        """Points (k, 3) at u (k,)."""
        a = self.angle * u[:, None]
        return self.center + np.cos(a) * self.x + np.sin(a) * self.y + u[:, None] * self.v

    def derivative(self, u: Vector) -> Matrix:
        """dp/du (k, 3)."""
        a = self.angle * u[:, None]
        return self.angle * (np.cos(a) * self.y - np.sin(a) * self.x) + self.v

    def part(self, start: float, stop: float) -> Segment:
        """The piece from u = start to u = stop, turned round when stop < start."""
        share = stop - start
        if self.angle == 0.0:
            return replace(self, center=self.position(np.array([start]))[0], v=share * self.v, turn=share * self.turn)
        c, s = np.cos(self.angle * start), np.sin(self.angle * start)
        x, y = c * self.x + s * self.y, c * self.y - s * self.x
        return replace(self, x=x, y=y, angle=share * self.angle, turn=share * self.turn)


@dataclass(frozen=True, eq=False)
class Samples:
    """A path at k instants: t [s], position (k, 3), rotation (k, 3, 3), velocity [m/s] and angular [rad/s] (k, 3)."""

    t: Vector
    position: Matrix
    rotation: Array
    velocity: Matrix
    angular: Matrix


@dataclass(frozen=True, eq=False)
class Path(Value):
    """Segments, one after the other, at `speed` [m/s] (and `angular_speed` [rad/s] where the tool turns on the spot).

    A segment takes max(length / speed, turn / angular_speed) seconds.
    """

    segments: tuple[Segment, ...]
    speed: float = 0.1
    angular_speed: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.segments:
            raise ArgumentError("the number of segments of a path", 0, "give at least two points")
        for name, value in (("speed", self.speed), ("angular_speed", self.angular_speed)):
            positive(name, value, "give a positive speed in m/s or rad/s")
        for duration in self._durations.tolist():
            if not 0 < duration < np.inf:
                cure = "leave out repeated points, and give points and speeds that a robot can have"
                raise ArgumentError("the seconds that a segment takes", duration, cure)

    @typed
    def __add__(self, other: Path) -> Path:
        """This path, then the other, moved to start where this one ends; speeds are kept from this one."""
        return join(self, other)

    @cached_property
    def _durations(self) -> Vector:
        lengths = np.array([s.length for s in self.segments])
        turns = np.array([float(np.linalg.norm(s.turn)) for s in self.segments])
        with np.errstate(over="ignore"):
            return frozen(np.maximum(lengths / self.speed, turns / self.angular_speed))

    @cached_property
    def _starts(self) -> Vector:
        return frozen(np.concatenate([[0.0], np.cumsum(self._durations)]))

    @cached_property
    def _rotations(self) -> Array:
        """R at the start of every segment, and at the end (segments + 1, 3, 3)."""
        out = [np.eye(3)]
        for segment in self.segments:
            out.append(rotation_matrix(segment.turn) @ out[-1])
        return frozen(out)

    def table(self, start_rotation: Matrix) -> Matrix:
        """One row a segment (26): center, x, y, angle, v, turn, rotation at its start (of a tool at first), seconds."""
        rows = [
            np.concatenate([s.center, s.x, s.y, [s.angle], s.v, s.turn, (R @ start_rotation).ravel(), [duration]])
            for s, R, duration in zip(self.segments, self._rotations, self._durations, strict=False)
        ]
        return np.array(rows, dtype=float)

    @property
    def tracks(self) -> tuple[tuple[Segment, ...], ...]:
        """The segments of each frame that it leads: of one."""
        return (self.segments,)

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
        total: Vector = np.zeros(3)
        for segment in self.segments:  # exact: lines and arcs about their own centres have closed forms
            a, b = segment.position(np.array([0.0, 1.0])) - self.start
            if segment.angle == 0.0:
                twice = np.cross(a, b)
            else:
                center = segment.center - self.start
                twice = np.cross(center, b - a) + segment.angle * np.cross(segment.x, segment.y)
            total += np.asarray(twice, dtype=float) / 2
        return total

    @property
    def counter_clockwise(self) -> bool:
        """Whether a closed path runs counter-clockwise, seen against the axis (x, y or z) it winds about most."""
        area = self.area
        return bool(area[np.argmax(np.abs(area))] > 0)

    @property
    def turned(self) -> Matrix:
        """Rotation (3, 3) between the start and the end."""
        return np.asarray(self._rotations[-1])

    @property
    def gap(self) -> float:
        """How far the end pose is from the start pose: the larger of metres and radians."""
        chord = float(np.linalg.norm(self._rotations[-1] - np.eye(3))) / np.sqrt(8.0)  # sin(angle / 2)
        return max(float(np.linalg.norm(self.end - self.start)), 2 * float(np.arcsin(min(chord, 1.0))))

    @property
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
        return self.on(index, (t - self._starts[index]) / self._durations[index])

    def on(self, index: Indices, u: Vector) -> Samples:
        """The path on the segments index (k,) at their parameter u (k,) in [0, 1]."""
        k = len(u)
        p, v, w, R = np.empty((k, 3)), np.empty((k, 3)), np.empty((k, 3)), np.empty((k, 3, 3))
        for i, segment in enumerate(self.segments):
            here = index == i
            if not here.any():
                continue
            p[here], v[here] = segment.position(u[here]), segment.derivative(u[here]) / self._durations[i]
            w[here] = segment.turn / self._durations[i]
            R[here] = rotation_matrix(u[here, None] * segment.turn) @ self._rotations[i]
        if self.closed and k:  # a closed path ends exactly where it starts
            last = (index == len(self.segments) - 1) & (u == 1.0)
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

    @cached_property
    def corners(self) -> tuple[int, ...]:
        """Segments at whose start the tool's velocity jumps; 0 among them where a closed path ends in a corner."""
        k = len(self.segments)
        start, end = (self.on(np.arange(k), np.full(k, u)) for u in (0.0, 1.0))
        after = np.hstack([start.velocity, start.angular])
        jump = np.abs(after - np.roll(np.hstack([end.velocity, end.angular]), 1, axis=0)).max(axis=1)
        found = jump > CORNER * np.abs(after).max(axis=1)
        return tuple(int(i) for i in np.flatnonzero(found) if i > 0 or self.closed)

    def counts(self, samples: int) -> Indices:
        """Steps of each segment so that there are at least `samples`, of nearly equal time, and no corner is cut."""
        return np.maximum(1, np.ceil(whole("samples", samples) * self._durations / self.duration - 1e-9)).astype(int)

    def steps(self, samples: int) -> tuple[Indices, Vector, Vector]:
        """The steps of `counts`: (segment, u_start, u_stop), each (k,)."""
        counts = self.counts(samples)
        return self.locate(counts, np.arange(counts.sum()))

    @staticmethod
    def locate(counts: Indices, step: Indices) -> tuple[Indices, Vector, Vector]:
        """(segment, u_start, u_stop), each (k,), of some steps (k,), where the segments have counts of them."""
        ends = np.cumsum(counts)
        segment = np.searchsorted(ends, step, side="right")
        within, total = step - (ends - counts)[segment], counts[segment]
        return segment, within / total, (within + 1) / total

    @typed
    def part(self, start: float, stop: float) -> Path:
        """The piece between two fractions of the duration, 0 <= start < stop <= 1."""
        if not 0.0 <= start < stop <= 1.0:
            raise ArgumentError("the part of a path", (start, stop), "give 0 <= start < stop <= 1")
        pieces = []
        for i, segment in enumerate(self.segments):
            low = (start * self.duration - self._starts[i]) / self._durations[i]
            high = (stop * self.duration - self._starts[i]) / self._durations[i]
            a, b = np.clip([low, high], 0.0, 1.0)
            if b - a > 1e-12:
                pieces.append(segment if (a, b) == (0.0, 1.0) else segment.part(float(a), float(b)))
        return replace(self, segments=tuple(pieces))

    def ways(self) -> tuple[Path, Path]:
        """The two ways round a closed path to the pose half a loop away. Raises: OpenPathError."""
        if not self.closed:
            raise OpenPathError("splitting into two ways", self.gap)
        return self.part(0.0, 0.5), self.reversed().part(0.0, 0.5)

    def reversed(self) -> Path:
        """The same curve run backwards, with its turns undone in reverse order (they count from its own start)."""
        return replace(self, segments=tuple(s.part(1.0, 0.0) for s in reversed(self.segments)))

    def starting_at(self, point: ArrayLike) -> Path:
        """The path moved, without turning, to start at a point (3,) or (2,) [m]."""
        shift = as_point(point) - self.start
        return replace(self, segments=tuple(replace(s, center=s.center + shift) for s in self.segments))

    @typed
    def at_speed(self, speed: float, angular_speed: float | None = None) -> Path:
        """The same curve at another speed [m/s], and angular speed [rad/s]."""
        return replace(self, speed=speed, angular_speed=self.angular_speed if angular_speed is None else angular_speed)


@typed
def line(start: ArrayLike, end: ArrayLike, *, turn: ArrayLike = (0.0, 0.0, 0.0), speed: float = 0.1) -> Path:
    """A straight line between two points [m], turning the tool by a rotation vector [rad] in the base frame."""
    a, b = as_point(start), as_point(end)
    zero = np.zeros(3)
    return Path((Segment(a, zero, zero, 0.0, b - a, _vector("turn", turn)),), speed)


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
    a, c, n = as_point(start), as_point(center), _vector("normal", normal)
    x = a - c
    size, radius = float(np.linalg.norm(n)), float(np.linalg.norm(x))
    if radius == 0.0 or size == 0.0 or not np.isfinite(angle) or angle == 0.0:
        raise ArgumentError("an arc's (radius, normal, angle)", (radius, n.tolist(), angle), "none of them may vanish")
    off = float(x @ n) / size
    if abs(off) > 1e-9 * radius:
        cure = f"make it perpendicular to the line from center to start: start lies {off:.3g} m along it from center"
        raise ArgumentError("normal", n.tolist(), cure)
    y = np.asarray(np.cross(n / size, x), dtype=float)
    return Path((Segment(c, x, y, float(angle), np.zeros(3), _vector("turn", turn)),), speed)


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
    zero = np.zeros(3)
    pairs = zip(corners, corners[1:], spins, strict=False)
    return Path(tuple(Segment(a, zero, zero, 0.0, b - a, s) for a, b, s in pairs), speed)


@typed
def join(*paths: Path) -> Path:
    """Paths one after the other, each moved to start where the one before ends; the first one's speeds hold."""
    if not paths:
        raise ArgumentError("the paths to join", paths, "give at least one")
    segments = list(paths[0].segments)
    for path in paths[1:]:
        end = segments[-1].position(np.ones(1))[0]
        segments.extend(path.starting_at(end).segments)
    return replace(paths[0], segments=tuple(segments))


def as_point(point: ArrayLike) -> Vector:
    """A point (3,); a planar one (2,) gets z = 0. Raises: ShapeError, NotFiniteError."""
    p = numbers("a point", point)
    if p.shape == (2,):
        p = np.append(p, 0.0)
    return _vector("a point", p)


def _vector(what: str, value: ArrayLike) -> Vector:
    return finite(what, value, (3,))
