"""Controllers of ros2_control, updated in a loop as a controller manager does."""

from __future__ import annotations

import subprocess
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from holokin.base.types import Array
from holokin.export import Ros2ControlPackage


class Event(IntEnum):
    """What happens before an update; DEACTIVATE, ACTIVATE and CLEAN_UP stand for one."""

    UPDATE = 0
    POSE = 1
    TWIST = 2
    DEACTIVATE = 3
    ACTIVATE = 4
    STATE = 5
    HELD = 6
    STUCK = 7
    CLEAN_UP = 8
    FRAME = 9


class Outcome(IntEnum):
    """The status that is published."""

    OK = 0
    SLOWED = 1
    LIMIT = 2
    SINGULAR = 3
    NOT_FINITE = 4
    LOST = 8
    WAITING = 20
    STALE = 21
    BAD_TARGET = 22
    FAR = 23
    BAD_PERIOD = 24
    NO_STATE = 25
    NOT_FOLLOWING = 26
    INACTIVE = 27


@dataclass(frozen=True)
class BuiltController:
    """A built controller with its driver, and the package it is of."""

    library: Path
    driver: Path
    package: Ros2ControlPackage
    joints: tuple[str, ...]
    start: Array

    @property
    def robot(self) -> Path:
        return self.package.folder / "test" / "robot.urdf"


@dataclass(frozen=True)
class Ran:
    """What the driver says: its exit code, its words, and a row for each event."""

    exit: int
    words: str
    returned: Array
    status: Array
    level: Array
    scale: Array
    commands: Array
    states: Array
    allocations: Array
    locks: Array


def event(kind: Event, *numbers: float, period: float = 0.001, age: float = np.nan) -> list[float]:
    """A row for the driver. `age` [s] is that of the message's stamp; by default the stamp is 0."""
    return [kind, period, age, *numbers, *[0.0] * (7 - len(numbers))]


def posed(T: Array, *, kind: Event = Event.POSE, period: float = 0.001, age: float = np.nan) -> list[float]:
    """A target pose (4, 4), and an update."""
    return event(kind, *T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_quat(), period=period, age=age)


def update_all(
    built: BuiltController, events: list[list[float]], *parameters: str, start: Array | None = None, rate: int = 1000,
    robot: Path | None = None, prefix: str = "",
) -> Ran:  # fmt: skip
    """Run the events. `parameters`: NAME=KIND:VALUE, order=reverse, drop=JOINT/KIND."""
    given, found = built.driver.with_name("in.bin"), built.driver.with_name("out.bin")
    np.array(events, dtype=float).tofile(given)
    found.unlink(missing_ok=True)
    q = ",".join(repr(float(x)) for x in (built.start if start is None else start))
    joints = ",".join(prefix + joint for joint in built.joints)
    words = [built.driver, built.library, robot or built.robot, given, found, rate, q, joints, *parameters]
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, timeout=400, check=False)
    n = len(built.joints)
    rows = np.fromfile(found).reshape(len(events), -1) if found.exists() else np.zeros((0, 6 + 2 * n))
    return Ran(
        done.returncode, done.stdout + done.stderr, rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3],
        rows[:, 4 : 4 + n], rows[:, 4 + n : 4 + 2 * n], rows[:, -2], rows[:, -1],
    )  # fmt: skip
