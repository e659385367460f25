"""Paths made of others: corners blended, leads, passes, and several frames led together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError
from ..base.types import ArrayLike, Matrix, Vector, finite, not_negative, one_or_each, positive, whole
from .path import (
    CORNER,
    SAME,
    OneOrManyPaths,
    Path,
    Poses,
    Samples,
    Segment,
    as_point,
    cubic_segment,
    distinct,
    line_segment,
    meets,
    turn_between,
)

BACK = 175.0
"""Angle [degrees] between two directions from which a corner turns back on itself, and stays as it is."""

ROUNDS = 60
"""Steps of the two searches of a blend: each gains a factor."""

MOST_PASSES = 1_000


@typed
def blended(path: Path, tolerance: float, *, keep_start: bool = False) -> Path:
    """The path with rounded corners: the tool passes each within a tolerance, and its velocity has no jump there.

    A corner is replaced by the cubic with the path's velocities at both ends, which begins and ends as far from it as
    the tolerance allows, at most halfway to the next corner. No point of the new path is farther than the tolerance
    from the old one. Corners at which the path turns back on itself stay.

    Args:
        tolerance: distance from a corner to the rounded path [m].
        keep_start: leave the corner in which a closed path starts. Else the new path starts in the middle of its
            blend, off the old start by the tolerance: `approach` leads there.

    Raises:
        ArgumentError.
    """
    positive("tolerance", tolerance, "give a distance above 0 in metres")
    corners = [k for k in path.corners if not (k == 0 and keep_start) and not _turns_back(path, k)]
    marks = [0.0, *(float(path.starts[k]) for k in path.corners if k > 0), path.duration]
    if not corners:
        return path
    closing = _blend(path, 0, min(marks[1], marks[-1] - marks[-2]) / 2, tolerance) if corners[0] == 0 else None
    pieces: list[Segment] = []
    done = 0.0 if closing is None else closing[1]
    for k in corners:
        i = marks.index(float(path.starts[k])) if k > 0 else 0
        if i == 0:
            continue
        begins, ends = i == 1 and closing is None, i == len(marks) - 2 and closing is None  # nothing is rounded there
        room = min((marks[i] - marks[i - 1]) / (2 - begins), (marks[i + 1] - marks[i]) / (2 - ends))
        blend, half = _blend(path, k, room, tolerance)
        pieces += [*path.cut(done, marks[i] - half), blend]
        done = marks[i] + half
    if closing is None:
        return replace(path, segments=(*pieces, *path.cut(done, path.duration)))
    blend, half = closing
    last = path.duration - half
    first = blend.part(0.0, 0.5)
    rotation = None if path.rotation is None else first.rotation @ path.at(last).rotation[0] @ path.rotation
    return replace(path, segments=(blend.part(0.5, 1.0), *pieces, *path.cut(done, last), first), rotation=rotation)


State = tuple[Vector, Vector, Vector, Matrix]
"""Position, velocity, angular velocity and rotation."""


def _turns_back(path: Path, k: int) -> bool:
    (_, u, *_), (_, v, *_) = _beside(path, k, 0.0)
    size = float(np.linalg.norm(u) * np.linalg.norm(v))
    return size > 0 and float(u @ v) / size < np.cos(np.deg2rad(BACK))


def _beside(path: Path, k: int, half: float) -> tuple[State, State]:
    """The tool a time before and after the start of a segment; before the first one is at the end of a closed path."""
    start = float(path.starts[k])
    return _state(path, (start or path.duration) - half, "left"), _state(path, start + half, "right")


def _state(path: Path, t: float, side: Literal["left", "right"]) -> State:
    index = np.searchsorted(path.starts[1:-1], [t], side=side)
    u = np.clip((t - path.starts[index]) / path.durations[index], 0.0, 1.0)
    sample = path.on(index, u)
    return sample.position[0], sample.velocity[0], sample.angular[0], sample.rotation[0]


def _blend(path: Path, k: int, room: float, tolerance: float) -> tuple[Segment, float]:
    """(the cubic that rounds the corner at the start of segment k, the time before and after it that it replaces)."""
    corner = path.segments[k].position(np.zeros(1))[0]
    u = np.linspace(0.0, 1.0, 129)
    half = room
    blend = _cubic(path, k, half)
    for _ in range(ROUNDS):
        off = float(np.linalg.norm(blend.position(u) - corner, axis=1).min())
        if off <= tolerance:
            break
        half *= (1 - 1e-9) * tolerance / off
        blend = _cubic(path, k, half)
    return blend, half


def _cubic(path: Path, k: int, half: float) -> Segment:
    """The cubic from the pose a time before a corner to that after it, with the path's velocities; it lasts as long as
    it takes at their mean speed."""
    (a, v, w, R), (b, v1, w1, R1) = _beside(path, k, half)
    turn = turn_between(R, R1)
    seconds, speed = 2 * half, (float(np.linalg.norm(v)) + float(np.linalg.norm(v1))) / 2

    def lasting(T: float) -> Segment:
        return cubic_segment(a, b, (T * v, T * v1), turn, (T * w, T * w1), T * path.speed)

    for _ in range(ROUNDS if speed > 0 else 0):
        before, seconds = seconds, lasting(seconds).length / speed
        if abs(seconds - before) <= 1e-9 * seconds:
            break
    return lasting(seconds)


@typed
def with_leads(
    path: Path,
    lead_in: float = 0.0,
    lead_out: float | None = None,
    *,
    along: ArrayLike | None = None,
    retract: float = 0.0,
    axis: ArrayLike = (0.0, 0.0, 1.0),
    retract_speed: float | None = None,
) -> Path:
    """The path with a straight path in before it and a way out after it.

    Args:
        lead_in, lead_out: their lengths [m]; by default both are alike. 0 leaves one out.
        along: where the tool comes from and goes to (3,), as seen from the path's ends; by default it comes and goes
            along the tangent, at the speed that the path has there, so that there is no corner.
        retract: a further way [m] along `axis` (3,), from above the path in and up from the path out.
        retract_speed: of the tool on that way [m/s]; by default that of the path.

    The tool keeps its orientation on the leads.

    Raises:
        ArgumentError: no direction; ShapeError, NotFiniteError.
    """
    lengths = not_negative("lead_in", lead_in), not_negative("lead_out", lead_in if lead_out is None else lead_out)
    up = _direction("axis", axis) * not_negative("retract", retract)
    ends = path.at(np.array([0.0, path.duration]))
    before, after = [], []
    for side, (length, pieces) in enumerate(zip(lengths, (before, after), strict=True)):
        position, sign = ends.position[side], (-1.0, 1.0)[side]
        if length > SAME:
            velocity = ends.velocity[side]
            rate = float(np.linalg.norm(velocity))
            if along is None and not rate > CORNER * path.speed:
                raise ArgumentError("the speed at an end of the path", rate, "give the direction of the leads, along=")
            way = sign * velocity / rate if along is None else _direction("along", along)
            nominal = length * path.speed / rate if along is None else None
            pieces.append((position, position + length * way, nominal))
            position = position + length * way
        if np.linalg.norm(up) > SAME:
            slower = None if retract_speed is None else path.speed / positive("retract_speed", retract_speed)
            pieces.append((position, position + up, None if slower is None else retract * slower))
    zero = np.zeros(3)
    lead = [replace(line_segment(b, a, zero), nominal=n) for a, b, n in reversed(before)]
    out = [replace(line_segment(a, b, zero), nominal=n) for a, b, n in after]
    return replace(path, segments=(*lead, *path.segments, *out))


@typed
def passes(
    path: Path,
    count: int,
    *,
    offset: ArrayLike = (0.0, 0.0, 0.0),
    back_and_forth: bool | None = None,
    lift: ArrayLike = (0.0, 0.0, 0.0),
) -> Path:
    """Several passes of a path, each moved on by an offset, with straight links between them.

    Args:
        count: number of passes.
        offset: (3,) [m], from each pass to the next, in the base's frame.
        back_and_forth: every second pass runs backwards; by default of open paths. Else all run the same way, and the
            tool goes back in between.
        lift: (3,) [m], by which the tool is lifted on the links; they are not lifted by default.

    Raises:
        ArgumentError, ShapeError, NotFiniteError.
    """
    if whole("count", count) > MOST_PASSES:
        raise ArgumentError("count", count, f"give at most {MOST_PASSES} passes")
    step, up = finite("offset", offset, (3,)), finite("lift", lift, (3,))
    turns = back_and_forth if back_and_forth is not None else not path.closed
    segments = list(path.segments)
    for k in range(1, count):
        back = turns and k % 2 == 1
        end = segments[-1].position(np.ones(1))[0]
        start = (path.end if back else path.start) + k * step
        turned = np.eye(3) if turns else path.turned.T  # from the end of a pass to the start of the next
        segments += _link(end, start, turn_between(np.eye(3), turned), up)
        segments += (path.reversed() if back else path).starting_at(start).segments
    return replace(path, segments=tuple(segments))


def _link(start: Vector, end: Vector, turn: Vector, lift: Vector) -> list[Segment]:
    """Up, across and down; straight on without a lift; nothing where the tool is there already."""
    moves = max(float(np.linalg.norm(end - start)), float(np.linalg.norm(turn))) > SAME
    if not moves and not lift.any():
        return []
    zero = np.zeros(3)
    if not lift.any():
        return [line_segment(start, end, turn)]
    over = [line_segment(start, start + lift, zero)]
    if moves:
        over.append(line_segment(start + lift, end + lift, turn))
    return [*over, line_segment(end + lift, end, zero)]


def _direction(what: str, value: ArrayLike) -> Vector:
    v = finite(what, value, (3,))
    if not np.linalg.norm(v) > 0:
        raise ArgumentError(what, v.tolist(), "give a direction")
    return v / np.linalg.norm(v)


@dataclass(frozen=True, eq=False)
class SynchronizedPaths(OneOrManyPaths):
    """Paths of F frames, as many segments in each, each segment as long in all of them [s].

    Make one with `synchronized` or `through`. Positions, rotations and velocities of the frames stand side by side.
    """

    paths: tuple[Path, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.paths or any(not np.array_equal(path.durations, self.durations) for path in self.paths):
            raise ArgumentError("the paths to run through together", len(self.paths), "hk.path.synchronized makes them")

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
        return _side_by_side([path.at(t) for path in self.paths])

    def on(self, index: ArrayLike, u: ArrayLike) -> Samples:
        """All frames on the segments index (k,) at their parameter u (k,) in [0, 1].

        Raises: ShapeError, NotFiniteError, ArgumentError: no such segments, or no such parameters.
        """
        return _side_by_side([path.on(index, u) for path in self.paths])

    @typed
    def part(self, start: float, stop: float) -> SynchronizedPaths:
        """The piece between two fractions of the duration, 0 <= start < stop <= 1."""
        return SynchronizedPaths(tuple(path.part(start, stop) for path in self.paths))

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
    pieces = []
    for i, a, b in zip(np.searchsorted(times, middle, side="right") - 1, ends, ends[1:], strict=False):
        share = times[i + 1] - times[i]
        low, high = (np.clip((np.array([a, b]) - times[i]) / share, 0.0, 1.0)).tolist()
        low, high = (0.0 if low * share <= alike else low), (1.0 if (1 - high) * share <= alike else high)
        segment = path.segments[i]
        pieces.append(segment if (low, high) == (0.0, 1.0) else segment.part(low, high))
    return pieces


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
    poses, distinct_rows, notes = distinct(Poses(corners, None))
    corners, each = poses.points, each[distinct_rows[1:] - 1]
    moves = np.diff(corners, axis=0)
    if speed is not None:
        each = np.linalg.norm(moves, axis=1) / positive("speed", speed)
    frames = -(-given.shape[1] // 3)
    wide = np.zeros((len(corners), 3 * frames))
    wide[:, : given.shape[1]] = corners
    times = each.tolist()
    paths = []
    for line in wide.reshape(len(corners), frames, 3).swapaxes(0, 1):
        lines = zip(line, line[1:], times, strict=False)
        segments = tuple(replace(line_segment(a, b, np.zeros(3)), nominal=t) for a, b, t in lines)
        paths.append(Path(segments, speed=1.0, notes=notes))
    return SynchronizedPaths(tuple(paths))


def _side_by_side(parts: list[Samples]) -> Samples:
    """Of several frames at the same instants."""
    p, v, w = (np.hstack([getattr(part, row) for part in parts]) for row in ("position", "velocity", "angular"))
    return Samples(parts[0].t, p, np.concatenate([part.rotation for part in parts], axis=1), v, w)
