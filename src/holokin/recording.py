"""`Recording`: joint motion that a robot's own controller made, read from CSV, rosbag2 folders and MCAP files."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from .arguments import check, typed
from .errors import ArgumentError, MissingExtraError, NotFiniteError, RecordingError, ShapeError
from .robot import Robot
from .types import Indices, Matrix, Value, Vector, frozen, numbers

TIMES = ("t", "time", "stamp", "secs", "timestamp")
"""Names of a time column; a prefix ('header.stamp') and capitals do not matter."""

GAP = 10.0
"""A step longer than this many median steps is a gap: something is missing there."""

SLACK = 0.5
"""How far [rad or m] beyond its limits a joint may be logged before the unit is doubted: calibration never errs so."""

_OTHER = re.compile(
    r"(^|[^a-z])(d|dq|vel|velocity|velocities|eff|effort|torque|tau|acc|accel|acceleration|current|desired|target|cmd|"
    r"command|commanded|goal|error)([^a-z]|$)"
)
_POSITION = re.compile(r"[./_: ](position|positions|pos|q|actual)$", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Recording(Value):
    """Joint positions as logged: t (k,) [s], rising; q (k, n) [rad or m] in the order of `joint_names`.

    `notes` says what was changed or left out in reading.
    """

    joint_names: tuple[str, ...]
    t: Vector
    q: Matrix
    source: str
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("t", "q"):
            object.__setattr__(self, name, numbers(f"{name} of a recording", getattr(self, name)))
        check("joint_names", tuple[str, ...], self.joint_names)
        super().__post_init__()
        if self.t.ndim != 1:
            raise ShapeError("t of a recording", ("k",), self.t.shape)
        if self.q.shape != (len(self.t), len(self.joint_names)):
            raise ShapeError("q of a recording", (len(self.t), len(self.joint_names)), self.q.shape)
        for what, values in (("t of a recording", self.t), ("q of a recording", self.q)):
            if not np.isfinite(values).all():
                raise NotFiniteError(what, values[~np.isfinite(values)][:3].tolist())
        if len(self.t) > 1 and not (np.diff(self.t) > 0).all():
            raise ArgumentError("a step of t", float(np.diff(self.t).min()), "give rising times in seconds")

    def __len__(self) -> int:
        return len(self.t)

    @property
    def duration(self) -> float:
        """Time from the first sample to the last [s]."""
        return float(self.t[-1] - self.t[0])

    @property
    def rate(self) -> float:
        """Samples a second, of the median step [Hz]."""
        return float(1 / np.median(np.diff(self.t)))

    @cached_property
    def gaps(self) -> Indices:
        """Indices i at which the step from sample i to i + 1 is over `GAP` median steps."""
        steps = np.diff(self.t)
        return frozen(np.flatnonzero(steps > GAP * np.median(steps)))


@typed
def read_recording(
    path: str | Path, robot: Robot, *, degrees: bool | None = None, topic: str | None = None
) -> Recording:
    """Read the joints of a robot from a log.

    CSV: a header with a time column (`TIMES`; seconds, or whole nanoseconds) and the robot's joints, in any order;
    a joint may have a prefix that ends in / . _ or : ('position.panda_joint1') where only one column fits.
    rosbag2 folder, .mcap, .db3 or ROS 1 .bag: sensor_msgs/JointState messages (needs the extra `log`).

    Args:
        degrees: True when revolute joints are logged in degrees; None refuses values that only fit as degrees.
        topic: of the JointState messages; by default /joint_states, or the only one there is.

    Raises:
        RecordingError: no such file, unreadable, no time column, joints missing, empty, text or NaN in a cell (with
            its line), time that runs backward or stands still with other joints, degrees where radians are due.
        MissingExtraError: a bag, and rosbags is not installed. ArgumentError: a topic for a CSV file.
    """
    file = Path(path)
    if not file.exists():
        raise RecordingError(file, "there is no such file", "check the path")
    if file.is_dir() or file.suffix.lower() in (".mcap", ".db3", ".bag"):
        t, q, labels, notes = _read_bag(file, robot, topic)
    elif topic is not None:
        raise ArgumentError("topic", topic, "only bags have topics; leave it out for a CSV file")
    else:
        t, q, labels, notes = _read_csv(file, robot)
    t, q, dropped = _in_order(file, t, q, labels)
    notes += [f"{dropped} repeated rows dropped"] if dropped else []
    q = _in_radians(file, q, robot, degrees, notes)
    q = _unwrapped(q, robot, notes)
    log = Recording(robot.joint_names, t, q, str(file))
    if len(log.gaps):
        longest = float(np.diff(t).max())
        notes.append(f"{len(log.gaps)} gaps in time, the longest {longest:.3g} s (median step {1 / log.rate:.3g} s)")
    return replace(log, notes=tuple(notes))


# --- CSV ------------------------------------------------------------------------------------------------------


def _read_csv(file: Path, robot: Robot) -> tuple[Vector, Matrix, list[str], list[str]]:
    """(t, q, a label of every row, notes)."""
    try:
        with file.open(newline="", encoding="utf-8-sig") as stream:
            first = stream.readline()
            delimiter = max(",;\t", key=first.count)
            header = [cell.strip().strip("#").strip() for cell in next(csv.reader([first], delimiter=delimiter), [])]
            reader = csv.reader(stream, delimiter=delimiter)
            rows = [(reader.line_num + 1, row) for row in reader if any(cell.strip() for cell in row)]
    except (OSError, UnicodeDecodeError, csv.Error) as problem:
        raise RecordingError(file, f"cannot be read as text ({problem})", "give a CSV file, a bag or .mcap") from None
    if not any(header):
        raise RecordingError(file, "is empty", "log a header and at least two cycles")
    try:
        float(header[0])
    except ValueError:
        pass
    else:
        raise RecordingError(file, "line 1 holds numbers, no header", "name the columns: t and the robot's joints")
    time = _time_column(file, header)
    columns = _joint_columns(file, header, robot)
    if not rows:
        raise RecordingError(file, "has a header but no samples", "log at least two cycles")
    wanted = [*time, *columns]
    try:
        cells = [[row[c] for c in wanted] for _, row in rows]
        table = np.array([[float(cell) for cell in row] for row in cells])
    except (ValueError, IndexError):
        raise _bad_cell(file, header, wanted, rows) from None
    if not np.isfinite(table).all():
        raise _bad_cell(file, header, wanted, rows)
    notes: list[str] = []
    t = _seconds(file, [row[: len(time)] for row in cells], notes)
    return t, table[:, len(time) :], [f"line {line}" for line, _ in rows], notes


def _time_column(file: Path, header: Sequence[str]) -> list[int]:
    """The time column; with a second one of nanoseconds where stamps are split ('secs', 'nsecs')."""
    words = [re.split(r"[^a-z]+", name.lower().strip("_"))[-1] for name in header]
    for name in TIMES:
        exact = [i for i, column in enumerate(header) if column.lower() == name]
        found = exact or [i for i, word in enumerate(words) if word == name]
        if found:
            parts = [i for i, word in enumerate(words) if word in ("nsecs", "nanosec", "nsec")]
            return [found[0], *parts[:1]] if name == "secs" else found[:1]
    cure = f"name the column of seconds one of {', '.join(TIMES)}; the columns are {_listed(header)}"
    raise RecordingError(file, "there is no time column", cure)


def _joint_columns(file: Path, header: Sequence[str], robot: Robot) -> list[int]:
    chosen, missing = [], []
    for joint in robot.joint_names:
        exact = [i for i, column in enumerate(header) if column == joint]
        ends = re.compile(rf"(^|[^A-Za-z0-9]){re.escape(joint)}$")
        near = exact or [i for i, column in enumerate(header) if ends.search(_POSITION.sub("", column))]
        if len(near) > 1 and not exact:
            rates = [i for i in near if _OTHER.search(header[i].lower().replace(joint.lower(), ""))]
            near = [i for i in near if i not in rates]
        if len(near) > 1:
            names = ", ".join(repr(header[i]) for i in near)
            raise RecordingError(
                file, f"joint {joint!r} could be any of the columns {names}", "keep or name one of them"
            )
        if near:
            chosen.append(near[0])
        else:
            missing.append(joint)
    if missing:
        raise _joints_missing(file, missing, header, "columns", robot)
    return chosen


def _joints_missing(
    file: Path, missing: Sequence[str], there: Sequence[str], what: str, robot: Robot
) -> RecordingError:
    fact = f"joints {', '.join(missing)} of {robot.name} are not in it"
    return RecordingError(file, fact, f"rename them or choose another robot; the {what} are {_listed(there)}")


def _listed(names: Sequence[str], most: int = 24) -> str:
    tail = f", ... ({len(names)} in all)" if len(names) > most else ""
    return ", ".join(names[:most]) + tail


def _bad_cell(
    file: Path, header: Sequence[str], wanted: Sequence[int], rows: Sequence[tuple[int, list[str]]]
) -> RecordingError:
    for line, row in rows:
        for c in wanted:
            if c >= len(row):
                fact = f"line {line} has {len(row)} cells, the header {len(header)}"
                return RecordingError(file, fact, "complete or delete the line")
            try:
                bad = not np.isfinite(float(row[c]))
            except ValueError:
                bad = True
            if bad:
                fact = f"line {line}, column {header[c]!r} holds {row[c].strip()!r}, not a finite number"
                return RecordingError(file, fact, "mend or delete the line")
    raise AssertionError("every cell is a finite number")  # only called when one is not


def _seconds(file: Path, cells: Sequence[Sequence[str]], notes: list[str]) -> Vector:
    """Seconds since the first stamp. Whole nanoseconds are told by their step; differences are taken as integers."""
    if len(cells[0]) == 2:
        return np.array([float(a) - float(cells[0][0]) + 1e-9 * float(b) for a, b in cells])
    texts = [row[0].strip() for row in cells]
    if all(re.fullmatch(r"[+-]?\d+", text) for text in texts):
        whole = [int(text) for text in texts]
        ticks = np.array([value - whole[0] for value in whole], dtype=float)
        step = float(np.median(np.abs(np.diff(ticks)))) if len(ticks) > 1 else 0.0
        if step >= 1e4:
            notes.append("stamps read as nanoseconds")
            return ticks * 1e-9
        if step > 5:
            fact = f"its whole-number stamps are {step:g} apart: neither seconds nor nanoseconds"
            raise RecordingError(file, fact, "give seconds, or whole nanoseconds")
    t = np.array([float(text) for text in texts])
    return t - t[0] if abs(t[0]) > 1e6 else t


# --- bags -----------------------------------------------------------------------------------------------------


def _read_bag(file: Path, robot: Robot, topic: str | None) -> tuple[Vector, Matrix, list[str], list[str]]:
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingExtraError("rosbags, to read bags and .mcap files", "log") from None
    store = get_typestore(Stores.ROS1_NOETIC if file.suffix.lower() == ".bag" else Stores.ROS2_HUMBLE)
    notes: list[str] = []
    try:
        with AnyReader([file], default_typestore=store) as reader:
            connections = [c for c in reader.connections if c.msgtype.endswith("/JointState")]
            name = _topic(file, {c.topic for c in connections}, {c.topic for c in reader.connections}, topic, notes)
            wanted = [c for c in connections if c.topic == name]
            messages = ((stamp, reader.deserialize(raw, c.msgtype)) for c, stamp, raw in reader.messages(wanted))
            t, q = _joint_states(file, robot, messages, notes)
    except RecordingError:
        raise
    except (AnyReaderError, OSError, ValueError, KeyError, AttributeError) as problem:
        fact = f"cannot be read as a bag ({type(problem).__name__}: {problem})"
        raise RecordingError(file, fact, "give a rosbag2 folder with metadata.yaml, or a whole .mcap file") from None
    return t, q, [f"message {i + 1}" for i in range(len(t))], notes


def _topic(file: Path, states: set[str], every: set[str], topic: str | None, notes: list[str]) -> str:
    name = topic or "/joint_states"
    if name in states:
        return name
    if topic is None and len(states) == 1:
        name = next(iter(states))
        notes.append(f"topic {name}")
        return name
    listed = f"topics of JointState messages: {_listed(sorted(states))}" if states else (
        f"it has no JointState messages at all, its topics are {_listed(sorted(every)) or 'none'}"
    )  # fmt: skip
    raise RecordingError(file, f"there are no JointState messages on {name}", f"name the topic with --topic; {listed}")


def _joint_states(
    file: Path, robot: Robot, messages: Iterator[tuple[int, Any]], notes: list[str]
) -> tuple[Vector, Matrix]:
    stamps, received, rows = [], [], []
    seen: dict[str, None] = {}
    orders: dict[tuple[str, ...], list[int] | None] = {}
    partial = 0
    for at, message in messages:
        names = tuple(message.name)
        if names not in orders:
            seen.update(dict.fromkeys(names))
            known = set(robot.joint_names) <= set(names)
            orders[names] = [names.index(joint) for joint in robot.joint_names] if known else None
        order = orders[names]
        if order is None or len(message.position) < len(names):
            partial += 1
            continue
        row = np.asarray(message.position, dtype=float)[order]
        if not np.isfinite(row).all():
            joint = robot.joint_names[int(np.argmin(np.isfinite(row)))]
            fact = f"message {len(rows) + partial + 1}: the position of {joint} is not finite"
            raise RecordingError(file, fact, "record again, or cut the bag before it")
        header = message.header.stamp
        stamps.append(int(header.sec) * 10**9 + int(header.nanosec))
        received.append(at)
        rows.append(row)
    if not rows:
        if not seen:
            raise RecordingError(file, "there are no JointState messages in it", "record at least two cycles")
        missing = [joint for joint in robot.joint_names if joint not in seen]
        if missing:
            raise _joints_missing(file, missing, list(seen), "joints", robot)
        fact = f"no message holds the positions of all joints of {robot.name} together"
        raise RecordingError(file, fact, "record the topic of the joint_state_broadcaster")
    if partial:
        notes.append(f"{partial} messages without all of the robot's joints left out")
    chosen = stamps if any(stamps) else received
    if chosen is received:
        notes.append("messages without stamps: times of reception used")
    return np.array([s - chosen[0] for s in chosen]) * 1e-9, np.array(rows)


# --- both -----------------------------------------------------------------------------------------------------


def _in_order(file: Path, t: Vector, q: Matrix, labels: Sequence[str]) -> tuple[Vector, Matrix, int]:
    """Rows with rising times, and how many identical repeated ones were dropped."""
    step = np.diff(t)
    for i in np.flatnonzero(step < 0)[:1]:
        fact = f"time runs backward at {labels[i + 1]}, from {t[i]:.9g} to {t[i + 1]:.9g} s"
        raise RecordingError(file, fact, "sort the log by time, or audit its parts apart")
    same = np.concatenate([[False], step == 0])
    changed = same & np.concatenate([[False], (np.diff(q, axis=0) != 0).any(axis=1)])
    for i in np.flatnonzero(changed)[:1]:
        fact = f"{labels[i]} repeats the time {t[i]:.9g} s with other joints"
        raise RecordingError(file, fact, "log stamps with more digits, or delete one of the two")
    if len(t) - int(same.sum()) < 2:
        raise RecordingError(file, "has a single sample", "log at least two cycles")
    return t[~same], q[~same], int(same.sum())


def _in_radians(file: Path, q: Matrix, robot: Robot, degrees: bool | None, notes: list[str]) -> Matrix:
    turning = np.array([c.kind != "prismatic" for c in robot.coordinates])
    scale = np.where(turning, np.pi / 180, 1.0)
    if degrees:
        return q * scale
    lower = np.where(np.isfinite(robot.lower), robot.lower, -4 * np.pi) - SLACK
    upper = np.where(np.isfinite(robot.upper), robot.upper, 4 * np.pi) + SLACK
    over = np.maximum(lower - q, q - upper).max(axis=0)
    worst = int(np.argmax(over))
    if over[worst] <= 0:
        return q
    in_degrees = q * scale
    fits = bool(((in_degrees >= lower) & (in_degrees <= upper)).all())
    name, value = robot.joint_names[worst], float(q[np.argmax(np.abs(q[:, worst])), worst])
    if degrees is None and fits and turning[worst]:
        fact = f"joint {name} reaches {value:.4g}, far outside its limits in rad, but every joint fits in degrees"
        raise RecordingError(file, fact, "pass --degrees (degrees=True), or degrees=False if it is radians after all")
    notes.append(
        f"joint {name} is logged up to {over[worst] + SLACK:.3g} {robot.coordinates[worst].unit} outside its limits"
    )
    return q


def _unwrapped(q: Matrix, robot: Robot, notes: list[str]) -> Matrix:
    """Joints without limits are often logged modulo a turn: make them run on."""
    endless = [
        i for i, c in enumerate(robot.coordinates) if c.kind != "prismatic" and np.isinf([c.lower, c.upper]).all()
    ]
    whole = q.copy()
    whole[:, endless] = np.unwrap(q[:, endless], axis=0)
    turned = [robot.joint_names[i] for i in endless if not np.array_equal(q[:, i], whole[:, i])]
    if turned:
        notes.append(f"turns of {', '.join(turned)} joined, which the log cuts at pi")
    return whole
