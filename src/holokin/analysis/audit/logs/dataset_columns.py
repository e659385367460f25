"""Which entries of a dataset's columns are which joints, or a tool pose; their values in rad and m."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ....base.arguments import typed
from ....base.axis_counts import AxisCounts
from ....base.errors import ArgumentError, RecordingError, UnknownNameError
from ....base.given_files import listed, shown
from ....base.pose_columns import PoseColumns, Units, columns_of_poses, poses_of
from ....base.types import Array, Indices, Matrix, Value, Vector
from ....robot import Robot
from .dataset_folder import INFO, Dataset
from .joint_columns import Columns, columns_named, joint_columns
from .logged_turns import outside

STATE = "observation.state"
"""The name that LeRobot gives to what the robot measures."""

ACTION = "action"
"""The name that LeRobot gives to what the robot is told."""

NORMALIZED = 100.0
"""The ends of the range to which LeRobot maps a motor that has no unit."""

MOTORS = ("so100", "so101", "so_", "koch", "omx", "lekiwi", "bi_so", "hope_jr")
"""How `robot_type` begins of arms of hobby servos: LeRobot records these in degrees, or from -100 to 100."""

_TURNS = {"wx": "rx", "wy": "ry", "wz": "rz"}
"""Rotation vectors: as LeRobot names their entries, and as they are read."""

_POSE = re.compile(r"(?:^|.*[._/: ])(x|y|z|q[xyzw0-4]|roll|pitch|yaw|[rw][xyz])(?:[._](?:pos|position))?$")


@dataclass(frozen=True, eq=False)
class JointFeature(Value):
    """The joints of a robot in a column of a dataset: `places` (n,) among its entries, in the robot's order.

    degrees: True or False as the caller says; None where the values must show it. counts_turns: the values count whole
    turns of hinges, so none is taken to be modulo a turn. counts: sign, offset and scale of each joint.
    """

    name: str
    places: Indices
    degrees: bool | None
    counts_turns: bool = False
    counts: AxisCounts = field(default_factory=AxisCounts)

    def joints(self, robot: Robot, values: Matrix, degrees: bool | None = None) -> Matrix:
        """Joints (k, n) in rad and m of values in the robot's order."""
        return self.counts.joints(robot.joint_names, values, self._units(robot, degrees))

    def values(self, robot: Robot, joints: Matrix) -> Matrix:
        """What the dataset has for joints (k, n)."""
        return self.counts.values(robot.joint_names, joints, self._units(robot, None))

    def _units(self, robot: Robot, degrees: bool | None) -> Vector:
        unit = bool(self.degrees) if degrees is None else degrees
        return np.where(robot.hinges & unit, np.pi / 180, 1.0)


@dataclass(frozen=True, eq=False)
class PoseFeature(Value):
    """A tool pose in a column of a dataset: which of its entries, and in which units."""

    name: str
    columns: PoseColumns
    said: Units


def _names_of(dataset: Dataset, feature: str) -> list[str]:
    """The names of a column's entries, or their numbers where it has none. Raises: UnknownNameError, RecordingError."""
    if feature not in dataset.features:
        raise UnknownNameError("column", feature, dataset.features)
    known = dataset.features[feature]
    width = int(np.prod(known["shape"]))
    names = _flat(known.get("names"))
    if names and len(names) != width:
        fact = f"names {len(names)} entries of {feature}, which has {width}"
        raise RecordingError(dataset.folder / INFO, fact, "correct meta/info.json")
    return names or [str(i) for i in range(width)]


@typed
def joint_feature(
    dataset: Dataset, robot: Robot, feature: str, *, columns: Columns | None = None, degrees: bool | None = None,
    counts_turns: bool = False, signs: Mapping[str, int] | None = None, offsets: Mapping[str, float] | None = None,
    scales: Mapping[str, float] | None = None,
) -> JointFeature:  # fmt: skip
    """The joints of a robot in a column, by their names, in whatever order.

    Args:
        columns: names of the entries, as for the columns of a log; entries without names have their numbers from 0.
        degrees: unit of the hinges; None where the values shall show it.
        counts_turns: the values of hinges count whole turns.
        signs, offsets, scales: how the column counts joints, as of `read_recording`.

    Raises:
        RecordingError: joints that are missing; a unit that must be said. ArgumentError, UnknownNameError.
    """
    names, file = _names_of(dataset, feature), dataset.folder / INFO
    counts = AxisCounts(signs or {}, offsets or {}, scales or {}).known(robot.joint_names)
    if columns is None:
        places = joint_columns(file, names, robot, robot.joint_names)
    else:
        places = columns_named(
            file, names, robot, columns, lambda joints: joint_columns(file, names, robot, joints)
        )  # fmt: skip
    kind = str(dataset.info.get("robot_type") or "")
    if degrees is None and kind.startswith(MOTORS) and not counts.scaled(robot.joint_names)[robot.hinges].all():
        fact = f"was recorded with {shown(kind)}, whose joints LeRobot writes in degrees or from -100 to 100"
        cure = "say --degrees (degrees=True) if it was recorded with use_degrees; other values are no angles"
        raise RecordingError(file, fact, cure)
    return JointFeature(feature, np.array(places, dtype=np.intp), degrees, counts_turns, counts)


@typed
def has_joints(dataset: Dataset, robot: Robot, feature: str) -> bool:
    """Whether a column names every joint of a robot."""
    try:
        joint_feature(dataset, robot, feature, degrees=False)
    except (RecordingError, UnknownNameError):
        return False
    return True


@typed
def pose_feature(
    dataset: Dataset, feature: str, *, angles: str | None = None, order: str | None = None
) -> PoseFeature:  # fmt: skip
    """The tool pose in a column, with entries x, y, z [m] and qx, qy, qz, qw, or roll, pitch, yaw, or rx, ry, rz, also
    as ee.x or ee.wx; other entries are left aside.

    Args:
        angles: "rad" or "deg", of roll, pitch, yaw and rotation vectors; by default rad.
        order: "xyzw" or "wxyz" of quaternions whose entries are numbered.

    Raises:
        RecordingError: no such entries. UnknownNameError: no such column. ArgumentError.
    """
    names = _names_of(dataset, feature)
    plain = [_plain(name) for name in names]
    said = Units(None, angles, order, assumed=True, place="frame")
    numbered = [name for name in plain if re.fullmatch(r"q[0-4]", name)]
    kept = [(i, name) for i, name in enumerate(plain) if name and (order is not None or name not in numbered)]
    found = columns_of_poses(dataset.folder / INFO, [name for _, name in kept], said)
    if not found.kind:
        fact = f"{feature} has a position, but no orientation: its entries are {listed(names)}"
        cure = "name qx, qy, qz, qw, or roll, pitch, yaw, or rx, ry, rz"
        if numbered:
            cure = "say --order xyzw or wxyz (order=...), if these numbers are a quaternion"
        raise RecordingError(dataset.folder / INFO, fact, cure)
    at = [i for i, _ in kept]
    places = [[at[i] for i in part] for part in (found.position, found.orientation)]
    return PoseFeature(feature, PoseColumns(places[0], places[1], found.kind, None, found.scales), said)


def postures_of(dataset: Dataset, robot: Robot, joints: JointFeature, values: Matrix) -> Matrix:
    """Postures (k, n) in rad and m of the values (k, d) of a column.

    Raises:
        RecordingError: values that look like degrees, or like LeRobot's -100 to 100, where nothing was said.
    """
    raw = values[:, joints.places]
    if not len(raw):
        return raw
    low, high = raw.min(axis=0), raw.max(axis=0)
    file = dataset.folder / INFO
    ends = (np.maximum(-low, high) == NORMALIZED) & robot.hinges & ~joints.counts.scaled(robot.joint_names)
    if ends.sum() > 1 and np.abs(raw[:, robot.hinges]).max() == NORMALIZED and joints.degrees is not False:
        fact = f"{int(ends.sum())} joints of {joints.name} reach 100 exactly, the end of LeRobot's range -100 to 100"
        raise RecordingError(file, fact, "convert them to degrees by the calibration of the arm, or record degrees")
    if joints.degrees is None:
        _check_unit(file, robot, joints, np.stack([low, high]))
    return joints.joints(robot, raw)


def check_normalized(dataset: Dataset, robot: Robot, joints: JointFeature, low: Vector, high: Vector) -> None:
    """Raises: RecordingError: all joints (n,) of hobby servos that are said to be in degrees lie within LeRobot's -100
    to 100, between `low` and `high` [rad or m]; these look alike, and are no angles."""
    asked = robot.hinges & ~joints.counts.scaled(robot.joint_names)
    if not (joints.degrees and str(dataset.info.get("robot_type") or "").startswith(MOTORS) and asked.any()):
        return
    if np.abs(joints.values(robot, np.stack([low, high])))[:, asked].max() <= NORMALIZED * (1 + 1e-6):
        fact = f"no joint of {joints.name} is beyond 100: these may be degrees, or LeRobot's -100 to 100, no angles"
        cure = "give the rad of a unit for each joint by --scales, and --offsets, from the calibration of the arm"
        raise RecordingError(dataset.folder / INFO, fact, f"{cure}; a degree has 0.0174533")


def tool_poses_of(
    dataset: Dataset, poses: PoseFeature, values: Matrix, frames: Indices
) -> tuple[Matrix, Array]:  # fmt: skip
    """Points [m] (k, 3) and rotations (k, 3, 3) of the values (k, d) of a column. Raises: RecordingError."""
    wanted = [*poses.columns.position, *poses.columns.orientation]
    found = poses_of(dataset.folder, poses.columns, values[:, wanted], frames, poses.said)
    return found.points, np.asarray(found.rotations)


def _flat(names: Any) -> list[str]:
    """Names as LeRobot's versions write them: a list, or lists by group, as {"motors": [...]}."""
    if isinstance(names, dict):
        inner = [_flat(part) for part in names.values()]
        return [name for part in inner for name in part] if any(inner) else [str(name) for name in names]
    return [str(name) for name in names] if isinstance(names, Sequence) and not isinstance(names, str) else []


def _plain(name: str) -> str:
    """The name of a pose's entry without the tool's name before it; empty for another one."""
    match = _POSE.match(name.lower())
    return _TURNS.get(match[1], match[1]) if match else ""


def _check_unit(file: Any, robot: Robot, joints: JointFeature, ends: Matrix) -> None:
    """Raises: RecordingError: values that are no radians, by their extremes (2, n)."""
    low, high = (end(joints.joints(robot, ends, False), axis=0) for end in (np.min, np.max))
    over = np.where(robot.hinges & ~joints.counts.scaled(robot.joint_names), outside(robot, low, high), -np.inf)
    worst = int(np.argmax(over))
    if over[worst] <= 0:
        return
    name = robot.joint_names[worst]
    value = float(low[worst] if -low[worst] > high[worst] else high[worst])
    fact = f"joint {name} of {joints.name} reaches {value:.4g}, far outside its limits in rad"
    turned = joints.joints(robot, ends, True)
    if (outside(robot, turned.min(axis=0), turned.max(axis=0)) <= 0)[robot.hinges].all():
        cure = "say --degrees (degrees=True), or --radians if it is radians after all"
        raise RecordingError(file, f"{fact}, but every joint fits in degrees", cure)
    cure = "check robot and joints; of LeRobot's -100 to 100, and of encoder ticks, give --scales and --offsets"
    cure += " from the calibration of the arm"
    raise RecordingError(file, f"{fact} and in degrees", cure)


@typed
def chosen_episodes(dataset: Dataset, text: str | None) -> list[int]:
    """The episodes of a text as "0:10,12": 0 to 9, and 12; all where there is none. Raises: ArgumentError."""
    count = len(dataset.episodes)
    if text is None:
        return list(range(count))
    found: set[int] = set()
    for part in text.split(","):
        match = re.fullmatch(r"\s*(\d{1,9})\s*(?:(:)\s*(\d{0,9})\s*)?", part)
        first, last = (int(match[1]), int(match[3] or count) if match[2] else int(match[1]) + 1) if match else (0, 0)
        if not match or not first < last <= count:
            cure = f"give numbers and ranges such as 0:10,12 of the episodes 0 to {count - 1}"
            raise ArgumentError("--episodes", text, cure)
        found |= set(range(first, last))
    return sorted(found)
