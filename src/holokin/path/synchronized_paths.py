"""`SynchronizedPaths`: a path for each frame of a task, run through in the same time, as two hands carry one tray."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError, OpenPathError
from ..base.types import ArrayLike, Indices, Matrix, Value, Vector, finite, one_or_each, positive
from .path import SAME, Path, Samples, as_point, corners_of
from .segments import Segment, line_segment
from .waypoints import Poses, distinct, meets


@dataclass(frozen=True, eq=False)
class SynchronizedPaths(Value):
    """Paths of F frames, as many segments in each, each segment as long in all of them [s].

    Make one with `synchronized` or `through`. Positions, rotations and velocities of the frames stand side by side.
    """

    paths: tuple[Path, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.paths or any(not np.array_equal(path.durations, self.durations) for path in self.paths):
            raise ArgumentError("the paths to run through together", len(self.paths), "make them by hk.synchronized")

    def __repr__(self) -> str:
        return f"SynchronizedPaths({', '.join(map(repr, self.paths))})"

    @property
    def durations(self) -> Vector:
        """Seconds that each segment takes, (S,)."""
        return self.paths[0].durations

    @property
    def starts(self) -> Vector:
        """Seconds at which each segment starts, and the end."""
        return self.paths[0].starts

    @property
    def duration(self) -> float:
        """Time for one run [s]."""
        return self.paths[0].duration

    @property
    def notes(self) -> tuple[str, ...]:
        """What was changed in making them, each note once."""
        return tuple(dict.fromkeys(note for path in self.paths for note in path.notes))

    def table(self, start_rotation: ArrayLike) -> Matrix:
        """The rows of `Path.table` of all segments of the first frame, then of the next one's.

        Raises: ShapeError, NotFiniteError, ArgumentError: the rotations at the start are no matrix (3F, 3).
        """
        starts = finite("the rotations at the start", start_rotation, (3 * len(self.paths), 3)).reshape(-1, 3, 3)
        return np.vstack([path.table(start) for path, start in zip(self.paths, starts, strict=True)])

    @property
    def length(self) -> float:
        """Distance travelled by the point that goes farthest [m]."""
        return max(path.length for path in self.paths)

    @property
    def speed(self) -> float:
        """How fast that point goes [m/s], on the average."""
        return self.length / self.duration

    @property
    def counter_clockwise(self) -> bool:
        """Whether closed paths run counter-clockwise, as of `Path`, by the one that encloses most."""
        return max(self.paths, key=lambda path: float(np.linalg.norm(path.area))).counter_clockwise

    @property
    def start(self) -> Vector:
        """First points, one after the other (3F,) [m]."""
        return np.concatenate([path.start for path in self.paths])

    @property
    def end(self) -> Vector:
        """Last points (3F,) [m]."""
        return np.concatenate([path.end for path in self.paths])

    @property
    def turned(self) -> Matrix:
        """Rotations (3F, 3) between the start and the end."""
        return np.vstack([path.turned for path in self.paths])

    @property
    def gap(self) -> float:
        """How far the end is from the start: the larger of metres and radians."""
        return max(path.gap for path in self.paths)

    @property
    def closed(self) -> bool:
        """True when all end where they start."""
        return all(path.closed for path in self.paths)

    @typed
    def at(self, t: ArrayLike) -> Samples:
        """All frames at times t (k,) in [0, duration]: positions (k, 3F), rotations (k, 3F, 3), velocities (k, 3F).

        Raises:
            ArgumentError, NotFiniteError: no such times.
        """
        return _beside([path.at(t) for path in self.paths])

    def on(self, index: ArrayLike, u: ArrayLike) -> Samples:
        """All frames on the segments index (k,) at their parameter u (k,) in [0, 1].

        Raises: ShapeError, NotFiniteError, ArgumentError: no such segments, or no such parameters.
        """
        return _beside([path.on(index, u) for path in self.paths])

    @property
    def corners(self) -> tuple[int, ...]:
        """Segments at whose start a velocity jumps; 0 among them where closed paths end in a corner."""
        return corners_of(self, len(self.durations))

    def counts(self, samples: int) -> Indices:
        """Steps of each segment so that there are at least `samples`, of nearly equal time, and no corner is cut."""
        return self.paths[0].counts(samples)

    @typed
    def part(self, start: float, stop: float) -> SynchronizedPaths:
        """The piece between two fractions of the duration, 0 <= start < stop <= 1."""
        return SynchronizedPaths(tuple(path.part(start, stop) for path in self.paths))

    def halves(self) -> tuple[SynchronizedPaths, SynchronizedPaths]:
        """The two ways round closed paths to the poses half a loop away. Raises: OpenPathError."""
        if not self.closed:
            raise OpenPathError("splitting into two paths", self.gap)
        return self.part(0.0, 0.5), self.reversed().part(0.0, 0.5)

    def reversed(self) -> SynchronizedPaths:
        """The same curves run backwards."""
        return SynchronizedPaths(tuple(path.reversed() for path in self.paths))


AnyPath = Path | SynchronizedPaths
"""A path of one frame, or paths of several."""


def paths_of(path: AnyPath) -> tuple[Path, ...]:
    """The path of each frame."""
    return path.paths if isinstance(path, SynchronizedPaths) else (path,)


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
    ends = np.append(ends[:-1][np.diff(ends) > SAME / seconds], 1.0)  # of ends that fall together the last one
    ends[0] = 0.0
    return SynchronizedPaths(tuple(_timed(path, ends, seconds * np.diff(ends)) for path in paths))


def _timed(path: Path | ArrayLike, ends: Vector, seconds: Vector) -> Path:
    """A path cut at shares of its duration, or a point at rest, whose pieces take so many seconds."""
    if isinstance(path, Path):
        pieces, rotation, notes = _pieces(path, ends, SAME / float(seconds.sum())), path.rotation, path.notes
    else:
        point = as_point(path)
        pieces, rotation, notes = [line_segment(point, point, np.zeros(3))] * len(seconds), None, ()
    nominal = tuple(replace(s, nominal=float(t)) for s, t in zip(pieces, seconds, strict=True))
    return Path(nominal, speed=1.0, rotation=rotation, notes=notes)


def _pieces(path: Path, ends: Vector, alike: float) -> list[Segment]:
    times = path.starts / path.duration
    middle = (ends[:-1] + ends[1:]) / 2
    found = []
    for i, a, b in zip(np.searchsorted(times, middle, side="right") - 1, ends, ends[1:], strict=False):
        share = times[i + 1] - times[i]
        low, high = (np.clip((np.array([a, b]) - times[i]) / share, 0.0, 1.0)).tolist()
        low, high = (0.0 if low * share <= alike else low), (1.0 if (1 - high) * share <= alike else high)
        segment = path.segments[i]
        found.append(segment if (low, high) == (0.0, 1.0) else segment.part(low, high))
    return found


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
        ShapeError, NotFiniteError, ArgumentError: bad or too few points.
    """
    given = finite("the points to go through", points, ("k", "d"))
    if not given.shape[1]:
        raise ArgumentError("the coordinates of the points to go through", 0, "give at least one")
    corners = np.vstack([given, given[:1]]) if closed and not meets(Poses(given, None)) else given
    each = one_or_each("seconds", seconds, len(corners) - 1)
    poses, kept, notes = distinct(Poses(corners, None))
    corners, each = poses.points, each[kept[1:] - 1]
    moves = np.diff(corners, axis=0)
    if speed is not None:
        each = np.linalg.norm(moves, axis=1) / positive("speed", speed)
    frames = -(-given.shape[1] // 3)
    wide = np.zeros((len(corners), 3 * frames))
    wide[:, : given.shape[1]] = corners
    times = each.tolist()
    return SynchronizedPaths(
        tuple(
            Path(
                tuple(
                    replace(line_segment(a, b, np.zeros(3)), nominal=t)
                    for a, b, t in zip(line, line[1:], times, strict=False)
                ),
                speed=1.0,
                notes=notes,
            )
            for line in wide.reshape(len(corners), frames, 3).swapaxes(0, 1)
        )
    )


def _beside(parts: list[Samples]) -> Samples:
    """Of several frames at the same instants."""
    return Samples(
        parts[0].t,
        np.hstack([part.position for part in parts]),
        np.concatenate([part.rotation for part in parts], axis=1),
        np.hstack([part.velocity for part in parts]),
        np.hstack([part.angular for part in parts]),
    )
