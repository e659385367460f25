"""Reads joints from rosbag2 folders, .mcap, .db3 and ROS 1 .bag files."""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ....base.errors import HolokinError, MissingExtraError, RecordingError
from ....base.given_files import listed, shown
from ....robot import Robot
from .joint_columns import Columns, columns_named, joint_columns
from .log_samples import Samples
from .unpacked_size import MOST_MESSAGE, broken, check_folder, check_mcap, check_sqlite, unpacked

JOINT_STATE = "sensor_msgs/msg/JointState"


class _State(NamedTuple):
    """A message: its stamp and the time of its reception [ns], names and positions."""

    stamp: int
    received: int
    names: tuple[str, ...]
    position: Any


def read_bag(file: Path, robot: Robot, topic: str | None, columns: Columns | None = None) -> Samples:
    """The samples of a bag; columns: which names of its messages are which joints, as of a CSV file.

    Raises: RecordingError; MissingExtraError: rosbags is not installed. UnknownNameError, ArgumentError: as
    `columns_named`.
    """
    try:
        from rosbags.rosbag1 import Reader as Reader1
        from rosbags.rosbag2 import Reader as Reader2
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingExtraError("rosbags, to read bags and .mcap files", "log") from None
    old = file.suffix.lower() == ".bag" and not file.is_dir()
    for part in check_folder(file) if file.is_dir() else [file]:
        {".mcap": check_mcap, ".db3": check_sqlite}.get(part.suffix.lower(), lambda _: None)(part)
    store = get_typestore(Stores.ROS1_NOETIC if old else Stores.ROS2_HUMBLE)
    notes: list[str] = []
    with _refusals(file):
        reader: Any = Reader1(file) if old else Reader2(file)
        reader.open()
    try:
        for c in reader.connections:
            if not (isinstance(c.topic, str) and isinstance(c.msgtype, str) and isinstance(c.msgcount, int)):
                raise broken(file, f"a topic is {c.topic!r} of type {c.msgtype!r} with {c.msgcount!r} messages")
        # The definition of a message that a bag brings along is not used: a JointState has been the same in all
        # releases, and another one could declare arrays of any size.
        parse = store.deserialize_ros1 if old else store.deserialize_cdr
        connections = [c for c in reader.connections if c.msgtype == JOINT_STATE]
        name = _topic(file, {c.topic for c in connections}, {c.topic for c in reader.connections}, topic, notes)
        wanted = [c for c in connections if c.topic == name]
        samples, read = _joint_states(file, robot, _states(file, reader, wanted, parse), columns, notes)
        told = sum(c.msgcount for c in wanted)
        if read < told:
            notes.append(f"{read} messages read of the {told} that the bag counts")
        return samples
    finally:
        reader.close()


@contextmanager
def _refusals(file: Path) -> Iterator[None]:
    """Whatever the parsers of a bag raise at broken bytes becomes a refusal of the file.

    They and the libraries beneath (sqlite, zstd, lz4, yaml, struct) have no common error, and raise MemoryError or
    OverflowError at senseless sizes. So everything is caught, round calls of theirs alone.
    """
    try:
        yield
    except HolokinError:
        raise
    except Exception as problem:  # noqa: BLE001
        raise broken(file, f"{type(problem).__name__}: {problem}") from None


def _states(file: Path, reader: Any, wanted: list[Any], parse: Any) -> Iterator[_State]:
    """The JointState messages in the order of their reception."""
    storage: Any = getattr(reader, "storage", None)
    packed = False
    if storage is not None and storage.metadata.compression_mode == "message":
        packed = True  # unpacked here, with a limit
        storage.metadata = storage.metadata._replace(compression_mode=None)
    with _refusals(file):
        messages = reader.messages(wanted)
    while True:
        with _refusals(file):
            found = next(messages, None)
            if found is None:
                return
            connection, at, raw = found
            data = unpacked(file, "a message", "zstd", raw, MOST_MESSAGE) if packed else raw
            message = parse(data, connection.msgtype)
            stamp = int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)
            names, position = tuple(message.name), np.asarray(message.position, dtype=float)
            if not 0 <= int(at) < 2**63:
                raise OverflowError(f"a message was received at {at} ns")
            state = _State(stamp, int(at), names, position)
        yield state


def _topic(file: Path, states: set[str], every: set[str], topic: str | None, notes: list[str]) -> str:
    name = topic or "/joint_states"
    if name in states:
        return name
    if topic is None and len(states) == 1:
        name = next(iter(states))
        notes.append(f"topic {shown(name)}")
        return name
    there = f"topics of JointState messages: {listed(sorted(states))}" if states else (
        f"it has no JointState messages at all, its topics are {listed(sorted(every)) or 'none'}"
    )  # fmt: skip
    fact = f"there are no JointState messages on {shown(name)}"
    raise RecordingError(file, fact, f"name the topic with --topic; {there}")


def _places(file: Path, robot: Robot, names: Sequence[str], columns: Columns | None) -> list[int]:
    """The robot's joints among names. Raises: RecordingError, UnknownNameError, ArgumentError."""
    others = lambda joints: joint_columns(file, names, robot, joints, "joints")  # noqa: E731
    return others(robot.joint_names) if columns is None else columns_named(file, names, robot, columns, others, "name")


def _joint_states(
    file: Path, robot: Robot, states: Iterator[_State], columns: Columns | None, notes: list[str]
) -> tuple[Samples, int]:
    """The robot's samples, and how many messages were read."""
    stamps, received, numbers, q = array("q"), array("q"), array("q"), array("d")
    seen: dict[str, None] = {}
    order: list[int] | None = None
    last: tuple[str, ...] | None = None
    count = 0
    for state in states:
        count += 1
        if state.names != last:
            last = state.names
            seen.update(dict.fromkeys(last if len(seen) < 1000 else ()))
            try:
                order = _places(file, robot, last, columns)
            except RecordingError:  # a message of other joints
                order = None
        if order is None or len(state.position) < len(state.names):
            continue
        row = state.position[order]
        if not np.isfinite(row).all():
            joint = robot.joint_names[int(np.argmin(np.isfinite(row)))]
            fact = f"message {count}: the position of {joint} is not finite"
            raise RecordingError(file, fact, "record again, or cut the bag before it")
        stamps.append(state.stamp)
        received.append(state.received)
        numbers.append(count)
        q.frombytes(row.tobytes())
    if not numbers:
        if not seen:
            raise RecordingError(file, "there are no JointState messages in it", "record at least two cycles")
        _places(file, robot, list(seen), columns)
        fact = f"no message holds the positions of all joints of {robot.name} together"
        raise RecordingError(file, fact, "record the topic of the joint_state_broadcaster")
    if len(numbers) < count:
        notes.append(f"{count - len(numbers)} messages without all of the robot's joints left out")
    stamped = any(stamps)
    if not stamped:
        notes.append("messages without stamps: times of reception used")
    ticks = np.frombuffer(stamps if stamped else received, dtype=np.int64)
    t = (ticks - ticks[0]) * 1e-9  # stamps are below 2^62, times of reception not negative: nothing overflows
    samples = Samples(t, np.frombuffer(q).reshape(len(t), -1), "message", np.frombuffer(numbers, np.int64), notes)
    return samples, count
