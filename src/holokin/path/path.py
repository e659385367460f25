"""`Path`: curves of the tool in space, followed at constant speed; closed or open, reversible, joinable.

A path is a chain of segments. Each moves the tool's point along a line, an arc or a cubic and may turn the tool.
Orientation is relative by default: the target is R(t) R_start, with R(0) = 1, so the same path serves any start
orientation. A path through poses says R_start itself, as `rotation`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError, OpenPathError, ShapeError
from ..base.poses import PoseLike, pose_cure, pose_from, pose_numbers
from ..base.types import (
    Array,
    ArrayLike,
    Indices,
    Matrix,
    Value,
    Vector,
    check_rotation,
    finite,
    frozen,
    numbers,
    positive,
    tool_pose,
    whole,
)
from ..symbolic.rotations import rotation_from_rpy
from .segments import Segment, derivatives, positions
from .straight_path import rotation_matrix

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

ROUND_OFF = 1e-9
"""Share of a path's duration by which a time may lie outside it."""


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
        said = "".join(f"; {note}" for note in self.notes)
        return f"Path({count} segment{'s' * (count > 1)}, {self.length:.4g} m, {self.duration:.4g} s{said})"

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
        return self._on(*_on_segments(index, u, len(self.segments)))

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

    @cached_property
    def corners(self) -> tuple[int, ...]:
        """Segments at whose start the tool's velocity jumps; 0 among them where a closed path ends in a corner."""
        return corners_of(self, len(self.segments))

    def counts(self, samples: int) -> Indices:
        """Steps of each segment so that there are at least `samples`, of nearly equal time, and no corner is cut."""
        return np.maximum(1, np.ceil(whole("samples", samples) * self._durations / self.duration - 1e-9)).astype(int)

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

    def halves(self) -> tuple[Path, Path]:
        """The two ways round a closed path to the pose half a loop away. Raises: OpenPathError."""
        if not self.closed:
            raise OpenPathError("splitting into two paths", self.gap)
        return self.part(0.0, 0.5), self.reversed().part(0.0, 0.5)

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


def _on_segments(index: ArrayLike, u: ArrayLike, count: int) -> tuple[Indices, Vector]:
    """Some of so many segments (k,), and the parameters (k,) on them. Raises: ShapeError, ArgumentError."""
    chosen, at = numbers("the segments", index), finite("u", u, ("k",))
    if chosen.shape != at.shape:
        raise ShapeError("the segments", at.shape, chosen.shape, "give one for each u")
    if not ((chosen >= 0) & (chosen < count) & (chosen == np.floor(chosen))).all():
        raise ArgumentError("the segments", chosen.tolist(), f"give whole numbers from 0 to {count - 1}")
    if not np.abs(at - 0.5).max(initial=0.0) <= 0.5 + ROUND_OFF:
        raise ArgumentError("u", at.tolist(), "give numbers from 0 to 1")
    return chosen.astype(np.intp), at


def locate(counts: Indices, step: Indices) -> tuple[Indices, Vector, Vector]:
    """(segment, u_start, u_stop), each (k,), of some steps (k,), where the segments have counts of them."""
    ends = np.cumsum(counts)
    segment = np.searchsorted(ends, step, side="right")
    within, total = step - (ends - counts)[segment], counts[segment]
    return segment, within / total, (within + 1) / total


def corners_of(path: Any, k: int) -> tuple[int, ...]:
    """Of k segments those at whose start a velocity jumps; 0 among them where a closed path ends in a corner."""
    start, end = (path.on(np.arange(k), np.full(k, u)) for u in (0.0, 1.0))
    after = np.hstack([start.velocity, start.angular])
    before = np.roll(np.hstack([end.velocity, end.angular]), 1, axis=0)
    found = np.abs(after - before).max(axis=1) > CORNER * np.maximum(np.abs(after), np.abs(before)).max(axis=1)
    return tuple(int(i) for i in np.flatnonzero(found) if i > 0 or path.closed)


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
