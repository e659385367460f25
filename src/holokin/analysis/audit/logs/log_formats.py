"""`read_recording`: from a file to a `Recording` in radians, with rising times and joints that run on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ....base.arguments import typed
from ....base.axis_counts import AxisCounts
from ....base.errors import ArgumentError, RecordingError
from ....base.given_files import is_folder
from ....base.types import Matrix, Vector
from ....motion.recording import Recording
from ....robot import Robot
from .bag import read_bag
from .csv_log import read_csv
from .joint_columns import Columns
from .log_samples import Samples
from .logged_turns import SLACK, joined_turns, outside

FARTHEST = 1e6
"""Largest joint position [rad or m] that is believed: 160,000 turns; beyond it a float holds less than a micrometre."""

LONGEST = 1e10
"""Longest log [s] that is believed: three centuries. A longer one has stamps in another unit, or broken ones."""

FASTEST = 1e-9
"""Shortest median step [s] that is believed: stamps have nanoseconds."""


@typed
def read_recording(
    path: str | Path, robot: Robot, *, degrees: bool | None = None, topic: str | None = None,
    columns: Columns | None = None, time: str | None = None, skip_bad: bool = False, counts_turns: bool = False,
    signs: Mapping[str, int] | None = None, offsets: Mapping[str, float] | None = None,
    scales: Mapping[str, float] | None = None,
) -> Recording:  # fmt: skip
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
        RecordingError: no such file, unreadable, no time column, joints missing, empty, text or NaN in a cell (with
            its line), time that runs backward or stands still with other joints, degrees where radians are due,
            encoder ticks without scales.
        MissingExtraError: a bag, and rosbags is not installed.
        ArgumentError: a topic for a CSV file, a time for a bag, a wrong number of columns.
        UnknownNameError: a column, sign, offset or scale for a joint that the robot has not.
    """
    file = Path(path)
    counts = AxisCounts(signs or {}, offsets or {}, scales or {}).known(robot.joint_names)
    samples = samples_of(file, robot, topic, columns, time, skip_bad)
    return joined(recorded(file, samples, robot, degrees, counts), robot, counts_turns)


def samples_of(
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


def recorded(
    file: Path, samples: Samples, robot: Robot, degrees: bool | None, counts: AxisCounts
) -> Recording:  # fmt: skip
    """Samples as a recording: in rad and m, with rising times. Raises: RecordingError."""
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
        raise RecordingError(file, fact, "give times in seconds, or whole nanoseconds")
    step = np.diff(t)
    for i in np.flatnonzero(step < 0)[:1]:
        fact = f"time runs backward at {samples.where(i + 1)}, from {t[i]:.9g} to {t[i + 1]:.9g} s"
        raise RecordingError(file, fact, "sort the log by time, or audit its parts apart: --split")
    same = np.flatnonzero(step == 0) + 1
    for i in same[(q[same] != q[same - 1]).any(axis=1)][:1]:
        fact = f"{samples.where(i)} repeats the time {t[i]:.9g} s with other joints"
        raise RecordingError(file, fact, "log stamps with more digits, or delete one of the two")
    if len(t) - len(same) < 2:
        raise RecordingError(file, "has a single sample", "log at least two cycles")
    usual = float(np.median(step[step > 0]))
    if usual < FASTEST:
        fact = f"its samples are {usual:.3g} s apart, less than stamps can tell"
        raise RecordingError(file, fact, "give times in seconds, or whole nanoseconds")
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
    names, turning = robot.joint_names, robot.hinges
    units = {unit: np.where(turning & unit, np.pi / 180, 1.0) for unit in (False, True)}
    ends = np.stack([q.min(axis=0), q.max(axis=0)])

    def extremes(unit: bool) -> tuple[Vector, Vector]:
        found = counts.joints(names, ends, units[unit])
        return found.min(axis=0), found.max(axis=0)

    least, most = extremes(bool(degrees))
    reach = np.maximum(-least, most)
    far = int(np.argmax(reach))
    if reach[far] > FARTHEST:
        fact = f"joint {names[far]} reaches {reach[far]:.3g} {robot.coordinates[far].unit}"
        raise RecordingError(file, fact, "give joints in rad and m; correct or delete the broken samples")
    over = np.where(counts.scaled(names), -np.inf, outside(robot, least, most))
    worst = int(np.argmax(over))
    if degrees is None and turning[worst] and over[worst] > 0 and (outside(robot, *extremes(True)) <= 0).all():
        value = float(least[worst] if -least[worst] > most[worst] else most[worst])
        fact = f"joint {names[worst]} reaches {value:.4g}, far outside its limits in rad"
        fact = f"{fact}, but every joint fits in degrees"
        raise RecordingError(file, fact, "pass --degrees (degrees=True), or degrees=False if it is radians after all")
    free = turning & ~counts.scaled(names)
    if degrees is not False and free.any() and (q[:, free] == np.rint(q[:, free])).all():
        over = np.where(free, outside(robot, *extremes(True)), -np.inf)
        if over[worst := int(np.argmax(over))] > (0.0 if degrees is None else 2 * np.pi):
            fact = f"joint {names[worst]} reaches {np.abs(ends[:, worst]).max():.0f}, and all values are whole numbers"
            cure = "if they are encoder ticks, give the rad of a tick by --scales (scales=) and the zeros by --offsets"
            raise RecordingError(file, fact, f"{cure}, else degrees=False for rad")
    plain = not (degrees or counts.signs or counts.offsets or counts.scales)
    return q if plain else counts.joints(names, q, units[bool(degrees)])
