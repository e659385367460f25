"""`SynchronizedPaths`: a path for each frame of a task, run through in the same time, as two hands carry one tray."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from .arguments import typed
from .errors import ArgumentError, OpenPathError, ShapeError
from .path import CLOSED, CORNER, Path, Samples, Segment, as_point
from .types import Array, ArrayLike, Indices, Matrix, Value, Vector, finite, frozen, numbers, positive, whole
from .ways import rotation_matrix

LOOKS = 64
"""Points of a segment by which it is told which way round a path runs."""

ALIKE = 1e-12
"""Share of the whole time within which two segments end together."""


@dataclass(frozen=True, eq=False)
class SynchronizedPaths(Value):
    """Segments of F frames side by side, `tracks` (F of S segments), each taking `durations` (S,) [s] in all of them.

    Make one with `synchronized` or `through`.
    """

    tracks: tuple[tuple[Segment, ...], ...]
    durations: Vector

    def __post_init__(self) -> None:
        super().__post_init__()
        count = len(self.durations)
        if not self.tracks or not count or any(len(track) != count for track in self.tracks):
            raise ArgumentError("the segments of synchronized paths", len(self.durations), "make them by synchronized")
        if not ((self.durations > 0) & (self.durations < np.inf)).all():
            cure = "leave out repeated points, and give points and speeds that a robot can have"
            raise ArgumentError("the seconds that a segment takes", self.durations.tolist(), cure)

    @cached_property
    def starts(self) -> Vector:
        """Seconds at which each segment starts, and the end."""
        return frozen(np.concatenate([[0.0], np.cumsum(self.durations)]))

    @property
    def duration(self) -> float:
        """Time for one run [s]."""
        return float(self.starts[-1])

    @cached_property
    def _rotations(self) -> Array:
        """R of each frame at the start of every segment, and at the end (F, segments + 1, 3, 3)."""
        every = []
        for track in self.tracks:
            out = [np.eye(3)]
            for segment in track:
                out.append(rotation_matrix(segment.turn) @ out[-1])
            every.append(out)
        return frozen(every)

    def table(self, start_rotation: Matrix) -> Matrix:
        """The rows of `Path.table` (26) of all segments of the first frame, then of the next one's."""
        rows = []
        for track, turned, start in zip(self.tracks, self._rotations, start_rotation.reshape(-1, 3, 3), strict=True):
            for s, R, seconds in zip(track, turned, self.durations, strict=False):
                rows.append(
                    np.concatenate([s.center, s.x, s.y, [s.angle], s.v, s.turn, (R @ start).ravel(), [seconds]])
                )
        return np.array(rows, dtype=float)

    @property
    def length(self) -> float:
        """Distance travelled by the point that goes farthest [m]."""
        return max(sum(s.length for s in track) for track in self.tracks)

    @property
    def speed(self) -> float:
        """How fast that point goes [m/s], on the average."""
        return self.length / self.duration

    @property
    def counter_clockwise(self) -> bool:
        """Whether closed paths run counter-clockwise, as of `Path`, by the one that encloses most."""
        p = self.on(*self._grid).position.reshape(-1, len(self.tracks), 3).swapaxes(0, 1)
        areas = np.cross(p - p[:, :1], np.diff(p, axis=1, append=p[:, :1])).sum(axis=1)
        return bool(areas.flat[np.argmax(np.abs(areas))] > 0)

    @property
    def _grid(self) -> tuple[Indices, Vector]:
        """(segments, u) of some points of each segment."""
        shares = np.linspace(0.0, 1.0, LOOKS, endpoint=False)
        return np.repeat(np.arange(len(self.durations)), LOOKS), np.tile(shares, len(self.durations))

    @property
    def start(self) -> Vector:
        """First points, one after the other (3F,) [m]."""
        return np.concatenate([track[0].position(np.zeros(1))[0] for track in self.tracks])

    @property
    def end(self) -> Vector:
        """Last points (3F,) [m]."""
        return np.concatenate([track[-1].position(np.ones(1))[0] for track in self.tracks])

    @property
    def turned(self) -> Matrix:
        """Rotations (3F, 3) between the start and the end."""
        return self._rotations[:, -1].reshape(-1, 3)

    @property
    def gap(self) -> float:
        """How far the end is from the start: the larger of metres and radians."""
        chords = np.linalg.norm(self._rotations[:, -1] - np.eye(3), axis=(1, 2)) / np.sqrt(8.0)  # sin(angle / 2)
        away = np.linalg.norm((self.end - self.start).reshape(-1, 3), axis=1)
        return float(max(away.max(), 2 * np.arcsin(np.minimum(chords, 1.0)).max()))

    @property
    def closed(self) -> bool:
        """True when all end where they start."""
        return self.gap <= CLOSED

    @typed
    def at(self, t: ArrayLike) -> Samples:
        """All frames at times t (k,) in [0, duration]: positions (k, 3F), rotations (k, 3F, 3), velocities (k, 3F).

        Raises:
            ArgumentError, NotFiniteError: no such times.
        """
        t = finite("t", np.atleast_1d(numbers("t", t)), ("k",))
        if t.size and np.maximum(-t, t - self.duration).max() > CLOSED * self.duration:
            raise ArgumentError("t", t.tolist(), f"the paths last from 0 to {self.duration:.9g} s")
        t = np.clip(t, 0.0, self.duration)
        index = np.clip(np.searchsorted(self.starts, t, side="right") - 1, 0, len(self.durations) - 1)
        return self.on(index, (t - self.starts[index]) / self.durations[index])

    def on(self, index: Indices, u: Vector) -> Samples:
        """All frames on the segments index (k,) at their parameter u (k,) in [0, 1]."""
        k, frames, seconds = len(u), len(self.tracks), self.durations[index][:, None]
        p, v, w, R = (
            np.empty((k, frames, 3)),
            np.empty((k, frames, 3)),
            np.empty((k, frames, 3)),
            np.empty((k, frames, 3, 3)),
        )
        for f, track in enumerate(self.tracks):
            for i, segment in enumerate(track):
                here = index == i
                p[here, f], v[here, f], w[here, f] = (
                    segment.position(u[here]),
                    segment.derivative(u[here]),
                    segment.turn,
                )
                R[here, f] = rotation_matrix(u[here, None] * segment.turn) @ self._rotations[f, i]
        p, v, w, R = p.reshape(k, -1), v.reshape(k, -1) / seconds, w.reshape(k, -1) / seconds, R.reshape(k, -1, 3)
        if self.closed and k:  # closed paths end exactly where they start
            last = (index == len(self.durations) - 1) & (u == 1.0)
            p[last], R[last] = self.start, np.tile(np.eye(3), (frames, 1))
        return Samples(self.starts[index] + u * self.durations[index], p, R, v, w)

    @cached_property
    def corners(self) -> tuple[int, ...]:
        """Segments at whose start a velocity jumps; 0 among them where closed paths end in a corner."""
        k = len(self.durations)
        start, end = (self.on(np.arange(k), np.full(k, u)) for u in (0.0, 1.0))
        after = np.hstack([start.velocity, start.angular])
        before = np.roll(np.hstack([end.velocity, end.angular]), 1, axis=0)
        found = np.abs(after - before).max(axis=1) > CORNER * np.maximum(np.abs(after), np.abs(before)).max(axis=1)
        return tuple(int(i) for i in np.flatnonzero(found) if i > 0 or self.closed)

    def counts(self, samples: int) -> Indices:
        """Steps of each segment so that there are at least `samples`, of nearly equal time, and no corner is cut."""
        return np.maximum(1, np.ceil(whole("samples", samples) * self.durations / self.duration - 1e-9)).astype(int)

    locate = staticmethod(Path.locate)

    @typed
    def part(self, start: float, stop: float) -> SynchronizedPaths:
        """The piece between two fractions of the duration, 0 <= start < stop <= 1."""
        if not 0.0 <= start < stop <= 1.0:
            raise ArgumentError("the part of a path", (start, stop), "give 0 <= start < stop <= 1")
        low, high = (
            np.clip((share * self.duration - self.starts[:-1]) / self.durations, 0.0, 1.0) for share in (start, stop)
        )
        keep = np.flatnonzero(high - low > 1e-12)
        tracks = tuple(tuple(track[i].part(float(low[i]), float(high[i])) for i in keep) for track in self.tracks)
        return SynchronizedPaths(tracks, (high - low)[keep] * self.durations[keep])

    def ways(self) -> tuple[SynchronizedPaths, SynchronizedPaths]:
        """The two ways round closed paths to the poses half a loop away. Raises: OpenPathError."""
        if not self.closed:
            raise OpenPathError("splitting into two ways", self.gap)
        return self.part(0.0, 0.5), self.reversed().part(0.0, 0.5)

    def reversed(self) -> SynchronizedPaths:
        """The same curves run backwards."""
        tracks = tuple(tuple(s.part(1.0, 0.0) for s in reversed(track)) for track in self.tracks)
        return SynchronizedPaths(tracks, self.durations[::-1])


AnyPath = Path | SynchronizedPaths
"""A path of one frame, or paths of several."""


@typed
def synchronized(*paths: Path | ArrayLike, duration: float | None = None) -> SynchronizedPaths:
    """Paths of several frames run through together, one a frame of a stacked task, in its order.

    Each is run through evenly in the time of the slowest; a corner of one is a step of all.

    Args:
        paths: a path, or a point (3,) [m] where that frame stays.
        duration: seconds of all of them; by default those of the path that takes longest.

    Raises:
        ArgumentError: no path among them, or a bad duration. ShapeError, NotFiniteError: a bad point.
    """
    moving = [path for path in paths if isinstance(path, Path)]
    if not moving:
        raise ArgumentError("the paths to synchronize", len(moving), "give at least one path; the others may be points")
    seconds = max(path.duration for path in moving) if duration is None else positive("duration", duration)
    ends = np.sort(np.concatenate([path.starts / path.duration for path in moving]))
    ends = np.append(ends[:-1][np.diff(ends) > ALIKE], 1.0)  # of ends that fall together the last one
    ends[0] = 0.0
    tracks = tuple(_pieces(path, ends) for path in paths)
    return SynchronizedPaths(tracks, seconds * np.diff(ends))


def _pieces(path: Path | ArrayLike, ends: Vector) -> tuple[Segment, ...]:
    """The segments of a path cut at shares of its duration, or those of a point at rest."""
    zero = np.zeros(3)
    if not isinstance(path, Path):
        point = as_point(path)
        return tuple(Segment(point, zero, zero, 0.0, zero, zero) for _ in ends[1:])
    times = path.starts / path.duration
    middle = (ends[:-1] + ends[1:]) / 2
    found = []
    for i, a, b in zip(np.searchsorted(times, middle, side="right") - 1, ends, ends[1:], strict=False):
        low, high = (np.clip((np.array([a, b]) - times[i]) / (times[i + 1] - times[i]), 0.0, 1.0)).tolist()
        low, high = (0.0 if low < 1e-9 else low), (1.0 if high > 1 - 1e-9 else high)
        segment = path.segments[i]
        found.append(segment if (low, high) == (0.0, 1.0) else segment.part(low, high))
    return tuple(found)


@typed
def through(
    points: ArrayLike, *, closed: bool = False, speed: float | None = None, seconds: float | Sequence[float] = 1.0
) -> SynchronizedPaths:
    """Straight lines through points (k, d) of the coordinates of a `custom_task` of more than three rows.

    Args:
        closed: adds the line back to the first point.
        seconds: that each line takes, or one number for each of them.
        speed: instead of seconds, how fast the point moves, in the units of the coordinates, whose squares it adds.

    Raises:
        ShapeError, NotFiniteError, ArgumentError: bad, too few or repeated points.
    """
    given = finite("the points to go through", points, ("k", "d"))
    corners = np.vstack([given, given[:1]]) if closed else given
    if len(corners) < 2 or not given.shape[1]:
        raise ArgumentError("the number of points to go through", len(corners), "give at least two")
    moves = np.diff(corners, axis=0)
    if not np.abs(moves).max(axis=1).all():
        raise ArgumentError("the points to go through", given.tolist(), "leave out repeated points")
    each = numbers("seconds", seconds)
    if each.shape not in ((), (len(moves),)):
        raise ShapeError("seconds", f"() or ({len(moves)},)", each.shape)
    if speed is not None:
        each = np.linalg.norm(moves, axis=1) / positive("speed", speed)
    frames = -(-given.shape[1] // 3)
    wide = np.zeros((len(corners), 3 * frames))
    wide[:, : given.shape[1]] = corners
    zero = np.zeros(3)
    tracks = tuple(
        tuple(Segment(a, zero, zero, 0.0, b - a, zero) for a, b in pairwise(line))
        for line in wide.reshape(len(corners), frames, 3).swapaxes(0, 1)
    )
    return SynchronizedPaths(tracks, np.broadcast_to(each, len(moves)).copy())
