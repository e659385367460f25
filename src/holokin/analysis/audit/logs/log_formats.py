"""`read_recording`: from a file to a `Recording` in radians, with rising times and joints that run on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....base.arguments import AxisCounts, typed
from ....base.errors import ArgumentError, FileError
from ....base.files import is_folder
from ....base.types import Array, Flags, Indices, Matrix, Vector, positive, runs
from ....motion.trajectory import GAP, Recording
from ....robot import Robot
from .bag import read_bag
from .csv_log import read_csv
from .joint_columns import Columns, Samples

# --- Whole turns of hinges: many drivers write an angle modulo a turn, and a joint may pass a turn between two samples.
#
# One rule for logs and datasets. From one sample to the next a hinge moves by the least change, modulo a turn, that
# leads from one value to the other. This is sure where its speed limit allows no other change. Where it is not, and
# between the episodes of a dataset, the joint limits may still tell the turn, since the values must lie within them.
# Otherwise the turn is not known.

TURN = 2 * np.pi

Rows = NDArray[np.integer[Any]]
Numbers = NDArray[np.floating[Any]]  # in any precision: datasets are long

SLACK = 0.5
"""How far [rad or m] beyond its limits a joint may be logged before the unit is doubted: calibration never errs so."""

OVERSPEED = 1.2  # times its speed limit that a joint may move: controllers overshoot, and stamps are not exact

# Change [rad] that the noise of two samples may add, and distance from joint limits at which values may lie.
NOISE = 0.05

BLOCK = 50_000  # samples whose changes are in memory at one time
FASTEST_HINGE = 4 * np.pi  # speed [rad/s] of a hinge without a speed limit: the wrists of industrial arms reach 8 rad/s


@dataclass(frozen=True, eq=False)
class HingeTurns:
    """Whole turns of one hinge: `turns` (k,) [rad] to add to its values, which then run on; None where there are none.

    begins (r,): runs of samples in which no turn is missed; known (r,): whether its limits, or values that count turns,
    leave no other turn of the run; cut: whether the values are cut, and not only moved into the limits.
    """

    turns: Numbers | None
    begins: Indices
    known: Flags
    cut: bool

    def runs_apart(self, first: Rows, second: Rows) -> Flags:
        """Whether two samples (p,), (p,) are of different runs."""
        return np.not_equal(*(np.searchsorted(self.begins, rows, side="right") for rows in (first, second)))

    def apart(self, first: Rows, second: Rows) -> Flags:
        """Whether the joint may have made unknown turns between two samples (p,), (p,)."""
        known = [self.known[np.searchsorted(self.begins, rows, side="right") - 1] for rows in (first, second)]
        return self.runs_apart(first, second) & ~(known[0] & known[1])


def hinge_turns(values: Numbers, steps: Numbers, robot: Robot, joint: int) -> HingeTurns:
    """Whole turns of the hinge `joint` with values (k,), whose samples are `steps` (k - 1,) [s] apart; inf: unknown."""
    speed = robot.max_velocity[joint] if np.isfinite(robot.max_velocity[joint]) else FASTEST_HINGE
    low, high = float(values.min()), float(values.max())
    turns, other = _least_turns(values, steps, speed)
    begins = np.concatenate([[0], np.flatnonzero(other) + 1])
    cut, most = bool(turns[~other].any()), max(-low, high)
    if most > 2 * TURN or (not cut and (high - low > TURN + 2 * NOISE or most > TURN + NOISE)):
        # no interval of a turn that drivers use holds the values: they count turns
        return HingeTurns(None, begins, np.ones(len(begins), bool), False)
    whole: Numbers | None = None
    if turns.any():
        whole = np.zeros_like(values)
        np.cumsum(turns, out=whole[1:])
        whole *= TURN
    joined = values if whole is None else values + whole
    lowest, highest = np.minimum.reduceat(joined, begins), np.maximum.reduceat(joined, begins)
    moves, known = _into_limits(lowest, highest, robot.lower[joint], robot.upper[joint])
    if moves.any():
        whole = np.zeros_like(values) if whole is None else whole
        for first, last, move in zip(begins, [*begins[1:], len(values)], TURN * moves, strict=True):
            whole[first:last] += move
    return HingeTurns(whole, begins, known, bool(turns.any()))


def _least_turns(values: Numbers, steps: Numbers, speed: float) -> tuple[Rows, Flags]:
    """(whole turns (k - 1,) that make each change of the values (k,) least, whether it may be another one).

    It may where the speed limit allows that, or does not even allow the least, if that is over a quarter turn.
    """
    turns, other = np.zeros(len(steps), np.int32), np.zeros(len(steps), bool)
    for i in range(0, len(steps), BLOCK):  # a dataset has a million
        change = np.diff(values[i : i + BLOCK + 1])
        reach = OVERSPEED * speed * steps[i : i + BLOCK] + NOISE
        change_left = np.abs(change)
        if change_left.max() > np.pi:
            turn = np.round(change / -TURN)
            turns[i : i + BLOCK] = turn
            change_left = np.abs(change + TURN * turn)
        other[i : i + BLOCK] = (TURN - change_left <= reach) | ((change_left > reach) & (change_left > np.pi / 2))
    return turns, other


@typed
def joined_turns(log: Recording, robot: Robot, *, counted: bool = False, breaks: Sequence[int] = ()) -> Recording:
    """A log whose hinges run on where it cuts them by whole turns, and lie within their limits where these tell a turn.

    Its `unknown_turns` are the steps in which a joint may have made whole turns that the log does not show.

    Args:
        counted: the values count whole turns, so they stay as they are.
        breaks: samples after which the time that passed is not known.
    """
    q, unknown = log.q, []
    cut: list[str] = []
    moved: list[str] = []
    steps = np.diff(log.t)
    steps[list(breaks)] = np.inf
    for i in np.flatnonzero(robot.hinges).tolist() if not counted else ():
        hinge = hinge_turns(log.q[:, i], steps, robot, i)
        before = hinge.begins[1:] - 1
        unknown += [(k, i) for k in before[hinge.apart(before, before + 1)]]
        if hinge.turns is not None:
            q = q.copy() if q is log.q else q
            q[:, i] += hinge.turns
            (cut if hinge.cut else moved).append(robot.joint_names[i])
    notes = (*log.notes, *turns_notes(cut, moved, "log"))
    return replace(log, q=q, notes=notes, unknown_turns=np.array(sorted(unknown), dtype=np.intp).reshape(-1, 2))


def turns_notes(cut: Sequence[str], moved: Sequence[str], what: str) -> list[str]:
    """What was done to the joints that are cut, and to those that were only moved."""
    notes = [f"turns of {', '.join(cut)} joined, which the {what} cuts"] if cut else []
    return notes + ([f"values of {', '.join(moved)} moved by whole turns into their limits"] if moved else [])


def _into_limits(low: Numbers, high: Numbers, lower: float, upper: float) -> tuple[Vector, Flags]:
    """(whole turns (r,) by which runs of values from `low` to `high` (r,) must move to lie within limits, whether these
    leave no other)."""
    if not np.isfinite([lower, upper]).any():
        return np.zeros(len(low)), np.zeros(len(low), bool)
    fewest, most = np.ceil((lower - NOISE - low) / TURN), np.floor((upper + NOISE - high) / TURN)
    narrow = upper - lower < TURN - 2 * NOISE
    shift, sure, now = np.zeros(len(low)), fewest == most, 0.0
    for r in range(len(low)):
        if fewest[r] <= most[r]:
            now = float(np.clip(now, fewest[r], most[r]))
        else:  # it lies beyond them whatever the turn
            middle = np.round((lower + upper - low[r] - high[r]) / 2 / TURN)
            over = [max(lower - low[r] - TURN * c, high[r] + TURN * c - upper) for c in (middle, now)]
            now = float(middle) if over[0] < min(over[1] - NOISE, SLACK) else now
            sure[r] = narrow
        shift[r] = now
    return shift, sure


def outside(robot: Robot, low: Vector, high: Vector) -> Vector:
    """How far [rad or m] joints (n,) between `low` and `high` are over `SLACK` beyond their limits.

    Values of a hinge that lie within one turn may be modulo a turn: they are looked at in the turn that fits best, and
    those that fill half a turn or more, which may be cut, fit always.
    """
    lower = np.where(np.isfinite(robot.lower), robot.lower, -4 * np.pi) - SLACK
    upper = np.where(np.isfinite(robot.upper), robot.upper, 4 * np.pi) + SLACK
    turn = (high - low <= TURN + NOISE) & (np.maximum(-low, high) <= TURN + NOISE)
    moves = np.where(robot.hinges & turn, TURN, 0.0) * np.array([[-1], [0], [1]])
    over = np.maximum(lower - low - moves, high + moves - upper).min(axis=0)
    return np.where(robot.hinges & turn & (high - low >= np.pi), np.minimum(over, 0.0), over)


def less_turns(change: Array, which: Flags) -> Array:
    """Changes (..., n) of joints, those of some less their whole turns."""
    return np.where(which, change - TURN * np.round(change / TURN), change)


# Largest joint position [rad or m] that is believed: 160,000 turns; beyond it a float holds less than a micrometre.
FARTHEST = 1e6

# Longest log [s] that is believed: three centuries. A longer one has stamps in another unit, or broken ones.
LONGEST = 1e10

FASTEST = 1e-9  # shortest median step [s] that is believed: stamps have nanoseconds


@typed
def read_recording(
    path: str | Path,
    robot: Robot,
    *,
    degrees: bool | None = None,
    topic: str | None = None,
    columns: Columns | None = None,
    time: str | None = None,
    skip_bad: bool = False,
    counts_turns: bool = False,
    signs: Mapping[str, int] | None = None,
    offsets: Mapping[str, float] | None = None,
    scales: Mapping[str, float] | None = None,
) -> Recording:
    """Read the joints of a robot from a log.

    CSV: a header with a time column (`TIMES`; its name or its size says the unit) and the robot's joints, in any order;
    a joint may have a prefix that ends in / . _ or : ('position.panda_joint1') where only one column fits. Where each
    row names its joints ('field.name0' beside 'field.position0'), the names are used.
    rosbag2 folder, .mcap, .db3 or ROS 1 .bag: sensor_msgs/JointState messages (needs the extra `log`).
    Hinges that the log cuts by whole turns run on, with a note; where turns are not known, see `unknown_turns` of the
    recording.

    Args:
        degrees: True when revolute joints are logged in degrees; None refuses values that only fit as degrees.
        topic: of the JointState messages; by default /joint_states, or the only one there is.
        columns: of a CSV file or a bag whose joints have other names: n names in the robot's order, a mapping
            joint -> name, or text: "q_a, q_b, ...", "elbow=q_c, wrist=q_d" or a pattern "actual_q_%d", which counts
            from 0, or from 1 where there is no column with 0. Joints that a mapping leaves out have their own names.
            Of a file without a header the columns are "1", "2", ...; without `columns` they are guessed, see notes.
        time: of a CSV file: the name of the time column.
        skip_bad: of a CSV file: rows that cannot be read are left out and counted in the notes, not refused.
        counts_turns: the values of hinges count whole turns: none is taken to be modulo a turn.
        signs, offsets, scales: how the log counts joints, as `export.Wiring` for programs: scale * value = sign * joint
            + offset [rad or m], each by the name of the joint; a scale is in rad or m, as 2 pi / 4096 of an encoder.

    Raises:
        FileError: no such file, unreadable, no time column, joints missing, empty, text or NaN in a cell (with
            its line), time that runs backward or stands still with other joints, degrees where radians are due,
            encoder ticks without scales.
        MissingExtraError: a bag, and rosbags is not installed.
        ArgumentError: a topic for a CSV file, a time for a bag, a wrong number of columns.
        UnknownNameError: a column, sign, offset or scale for a joint that the robot has not.
    """
    file = Path(path)
    counts = AxisCounts(signs or {}, offsets or {}, scales or {}).known(robot.joint_names)
    samples = _samples_of(file, robot, topic, columns, time, skip_bad)
    return joined(recorded(file, samples, robot, degrees, counts), robot, counts_turns)


def _samples_of(
    file: Path, robot: Robot, topic: str | None, columns: Columns | None, time: str | None, skip_bad: bool
) -> Samples:
    """What a file holds, in its own units and order. Raises: as `read_recording`."""
    if is_folder(file) or file.suffix.lower() in (".mcap", ".db3", ".bag"):
        for name, given in (("time", time), ("skip_bad", skip_bad or None)):
            if given is not None:
                raise ArgumentError(name, given, "only CSV files have rows; leave it out for a bag")
        return read_bag(file, robot, topic, columns)
    if topic is not None:
        raise ArgumentError("topic", topic, "only bags have topics; leave it out for a CSV file")
    return read_csv(file, robot, columns, time, skip_bad=skip_bad)


def recorded(file: Path, samples: Samples, robot: Robot, degrees: bool | None, counts: AxisCounts) -> Recording:
    """Samples as a recording: in rad and m, with rising times. Raises: FileError."""
    notes = samples.notes
    t, q = _in_order(file, samples, notes)
    q = _in_radians(file, q, robot, False if samples.in_si else degrees, counts)
    log = Recording(robot.joint_names, t, q, str(file))
    if len(log.gaps):
        longest = float(np.diff(t).max())
        notes.append(f"{len(log.gaps)} gaps in time, the longest {longest:.3g} s (median step {1 / log.rate:.3g} s)")
    return replace(log, notes=tuple(notes))


def _in_order(file: Path, samples: Samples, notes: list[str]) -> tuple[Vector, Matrix]:
    """Samples with rising times: identical repeated ones are dropped."""
    t, q = samples.t, samples.q
    if not t.max() - t.min() <= LONGEST:
        fact = f"its times span {t.max() - t.min():.3g} s, over three centuries"
        raise FileError(file, fact, "give times in seconds, or whole nanoseconds")
    step = np.diff(t)
    for i in np.flatnonzero(step < 0)[:1]:
        fact = f"time runs backward at {samples.where(i + 1)}, from {t[i]:.9g} to {t[i + 1]:.9g} s"
        raise FileError(file, fact, "sort the log by time, or audit its parts apart: --split")
    same = np.flatnonzero(step == 0) + 1
    for i in same[(q[same] != q[same - 1]).any(axis=1)][:1]:
        fact = f"{samples.where(i)} repeats the time {t[i]:.9g} s with other joints"
        raise FileError(file, fact, "log stamps with more digits, or delete one of the two")
    if len(t) - len(same) < 2:
        raise FileError(file, "has a single sample", "log at least two cycles")
    usual = float(np.median(step[step > 0]))
    if usual < FASTEST:
        fact = f"its samples are {usual:.3g} s apart, less than stamps can tell"
        raise FileError(file, fact, "give times in seconds, or whole nanoseconds")
    if len(same):
        notes.append(f"{len(same)} repeated rows dropped")
        t, q = np.delete(t, same), np.delete(q, same, axis=0)
    return t, q


def joined(log: Recording, robot: Robot, counts_turns: bool, breaks: Sequence[int] = ()) -> Recording:
    """A recording whose hinges run on, with a note where a joint is far beyond its limits."""
    log = joined_turns(log, robot, counted=counts_turns, breaks=breaks)
    low, high = log.q.min(axis=0), log.q.max(axis=0)
    over = np.maximum(robot.lower - low, high - robot.upper)
    worst = int(np.argmax(over))
    if over[worst] <= SLACK:
        return log
    beyond = f"{over[worst]:.3g} {robot.coordinates[worst].unit} outside its limits"
    return replace(log, notes=(*log.notes, f"joint {robot.joint_names[worst]} is logged up to {beyond}"))


def _in_radians(file: Path, q: Matrix, robot: Robot, degrees: bool | None, counts: AxisCounts) -> Matrix:
    """Joints in rad and m: the unit is looked for in the extremes of the columns, since a log may be long."""
    # The extremes of the joints, read in rad or in degrees.
    names, turning = robot.joint_names, robot.hinges
    units = {unit: np.where(turning & unit, np.pi / 180, 1.0) for unit in (False, True)}
    ends = np.stack([q.min(axis=0), q.max(axis=0)])

    def extremes(unit: bool) -> tuple[Vector, Vector]:
        q_ends = counts.joints(names, ends, units[unit])
        return q_ends.min(axis=0), q_ends.max(axis=0)

    # Positions that nobody believes, degrees where radians are due, and ticks of encoders are refused.
    lowest, highest = extremes(bool(degrees))
    reach = np.maximum(-lowest, highest)
    far = int(np.argmax(reach))
    if reach[far] > FARTHEST:
        fact = f"joint {names[far]} reaches {reach[far]:.3g} {robot.coordinates[far].unit}"
        raise FileError(file, fact, "give joints in rad and m; correct or delete the broken samples")
    over = np.where(counts.scaled(names), -np.inf, outside(robot, lowest, highest))
    worst = int(np.argmax(over))
    if degrees is None and turning[worst] and over[worst] > 0 and (outside(robot, *extremes(True)) <= 0).all():
        value = float(lowest[worst] if -lowest[worst] > highest[worst] else highest[worst])
        fact = f"joint {names[worst]} reaches {value:.4g}, far outside its limits in rad"
        fact = f"{fact}, but every joint fits in degrees"
        raise FileError(file, fact, "pass --degrees (degrees=True), or degrees=False if it is radians after all")
    free = turning & ~counts.scaled(names)
    if degrees is not False and free.any() and (q[:, free] == np.rint(q[:, free])).all():
        over = np.where(free, outside(robot, *extremes(True)), -np.inf)
        if over[worst := int(np.argmax(over))] > (0.0 if degrees is None else 2 * np.pi):
            fact = f"joint {names[worst]} reaches {np.abs(ends[:, worst]).max():.0f}, and all values are whole numbers"
            cure = "if they are encoder ticks, give the rad of a tick by --scales (scales=) and the zeros by --offsets"
            raise FileError(file, fact, f"{cure}, else degrees=False for rad")
    plain = not (degrees or counts.signs or counts.offsets or counts.scales)
    return q if plain else counts.joints(names, q, units[bool(degrees)])


# Rest [s] from which on a log is cut there: longer than the dwells of a process, shorter than most pauses between
# runs.
IDLE = 5.0

# How far [rad or m] joints may move within a fourth of that and still rest: noise, brakes, a servo that hunts.
STILL = 1e-3


@dataclass(frozen=True, eq=False)
class _Piece:
    """A recording whose clock runs on, with the stamp from which its times count."""

    log: Recording
    origin: float

    @property
    def ends(self) -> tuple[float, float]:
        """First and last time of its clock [s]."""
        return self.origin + float(self.log.t[0]), self.origin + float(self.log.t[-1])


@typed
def read_runs(
    paths: Sequence[str | Path], robot: Robot, *, split: bool = False, idle: float = IDLE, degrees: bool | None = None,
    topic: str | None = None, columns: Columns | None = None, time: str | None = None, skip_bad: bool = False,
    counts_turns: bool = False, signs: Mapping[str, int] | None = None, offsets: Mapping[str, float] | None = None,
    scales: Mapping[str, float] | None = None,
) -> tuple[Recording, ...]:  # fmt: skip
    """Read files as one log; with `split` as several runs.

    Files are taken in the order given. Where the stamps of one go on after those of the one before, the time between
    them is kept; where its clock begins anew it is put behind, with a gap in time, so that no cycle spans the join.

    Args:
        split: cut where the clock is set back and where all joints rest for `idle` [s]; each part is a run.
        degrees, topic, columns, time, skip_bad, counts_turns, signs, offsets, scales: as of `read_recording`.

    Raises:
        ArgumentError: no file, a rest that is not positive. FileError: as `read_recording`; nothing moves.
    """
    positive("idle", idle, "give a positive number of seconds")
    if not paths:
        raise ArgumentError("the files of a log", list(paths), "give at least one")
    counts = AxisCounts(signs or {}, offsets or {}, scales or {}).known(robot.joint_names)
    pieces: list[_Piece] = []
    for path in map(Path, paths):
        samples = _samples_of(path, robot, topic, columns, time, skip_bad)
        back = np.flatnonzero(np.diff(samples.t) < 0) + 1 if split else ()  # where the clock is set back
        for first, last in pairwise([0, *map(int, back), len(samples.t)]):
            part = samples.some(first, last) if split else samples
            if len(part.t) > 1:
                pieces.append(_Piece(recorded(path, part, robot, degrees, counts), samples.origin))
    if not pieces:
        raise FileError(paths[0], "holds no two samples of one clock", "log at least two cycles")
    logs = _joined(pieces, robot, anew=not split, counts_turns=counts_turns)
    if not split:
        return logs
    moving = tuple(part for log in logs for part in _without_rests(log, idle))
    if not moving:
        raise FileError(paths[0], "all joints rest", "log a motion of the arm, or leave out --split")
    return tuple(replace(part, source=f"{part.source}, run {k} of {len(moving)}") for k, part in enumerate(moving, 1))


def _joined(pieces: Sequence[_Piece], robot: Robot, *, anew: bool, counts_turns: bool) -> tuple[Recording, ...]:
    """Pieces put together as long as their clock goes on; with `anew` all, a gap before each whose clock does not."""
    groups: list[list[_Piece]] = []
    breaks: list[list[int]] = []  # samples after which the clock begins anew
    notes: list[str] = []
    for piece in pieces:
        before = groups[-1][-1] if groups else None
        if before is not None and piece.ends[0] > before.ends[1]:
            groups[-1].append(piece)
        elif before is not None and anew:
            wait = 2 * GAP / min(piece.log.rate, before.log.rate)
            shift = before.ends[1] + wait - piece.ends[0]
            breaks[-1].append(sum(len(part.log) for part in groups[-1]) - 1)
            groups[-1].append(_Piece(piece.log, piece.origin + shift))
            notes.append(f"the clock of {Path(piece.log.source).name} begins anew: put behind, with a gap")
        else:
            groups.append([piece])
            breaks.append([])
    logs = (_one(group, notes) for group in groups)
    return tuple(joined(log, robot, counts_turns, cuts) for log, cuts in zip(logs, breaks, strict=True))


def _one(group: Sequence[_Piece], notes: Sequence[str]) -> Recording:
    """One recording of pieces whose times rise."""
    if len(group) == 1:
        return group[0].log
    origin = group[0].origin
    t: Vector = np.concatenate([piece.log.t + (piece.origin - origin) for piece in group])
    q: Matrix = np.vstack([piece.log.q for piece in group])
    names = dict.fromkeys(piece.log.source for piece in group)
    all_notes = [note for piece in group for note in piece.log.notes] + list(notes)
    source = f"{len(names)} files, {Path(next(iter(names))).name} to {Path(next(reversed(names))).name}"
    return Recording(group[0].log.joint_names, t, q, source if len(names) > 1 else next(iter(names)), tuple(all_notes))


def _without_rests(log: Recording, idle: float) -> list[Recording]:
    """The parts of a log between rests of at least `idle` [s]; those too short to move are left out."""
    block = np.floor((log.t - log.t[0]) / (idle / 4)).astype(int)
    first = np.flatnonzero(np.diff(block, prepend=-1))
    low, high = np.minimum.reduceat(log.q, first), np.maximum.reduceat(log.q, first)
    still = ((high - low) <= STILL).all(axis=1)
    stop = np.append(first, len(log.t))
    rests = [
        (stop[a], stop[b] - 1)
        for a, b in runs(np.asarray(still))
        if log.t[stop[b] - 1] - log.t[stop[a]] >= idle * 3 / 4
    ]
    begins = [0, *(int(b) for _, b in rests)]
    ends = [*(int(a) for a, _ in rests), len(log.t) - 1]
    parts = []
    for a, b in zip(begins, ends, strict=True):
        if b > a + 1 and float(np.ptp(log.q[a : b + 1], axis=0).max()) > STILL:
            span = f"from {log.t[a]:.4g} to {log.t[b]:.4g} s"
            parts.append(replace(log.part(a, b + 1), notes=(*log.notes, span)))
    return parts
