"""Columns of a log that somebody else named: which of them is which joint, and which the time."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import pi
from pathlib import Path

from ....base.errors import ArgumentError, FileError, UnknownNameError, closest
from ....base.files import listed, shown
from ....base.types import Indices, Matrix, Vector
from ....robot import Robot


@dataclass(frozen=True, eq=False)
class Samples:
    """What a file holds, in its own order and units: t (k,) [s] and q (k, n); `place` and `numbers` (k,) name each
    ('line 7'), for messages. in_si: whether the file named its units, so that q is in rad and m for sure.
    origin: the stamp [s] from which t counts."""

    t: Vector
    q: Matrix
    place: str
    numbers: Indices
    notes: list[str] = field(default_factory=list)
    in_si: bool = False
    origin: float = 0.0

    def some(self, first: int, last: int) -> Samples:
        """The samples from one to before another."""
        t, q, numbers = self.t[first:last], self.q[first:last].copy(), self.numbers[first:last]
        return replace(self, t=t, q=q, numbers=numbers, notes=list(self.notes))

    def where(self, i: int) -> str:
        """The place of sample i in the file, in words."""
        return f"{self.place} {self.numbers[i]}"


Columns = str | Sequence[str] | Mapping[str, str]
"""Columns of the joints: names in the robot's order; joint -> name; or text, "a, b, c", "elbow=a, wrist=b", "q_%d"."""

# Stands in a pattern for the number of a joint, counted from 0, or from 1 where the file has no column with 0.
NUMBER = "%d"


_OTHER = re.compile(
    r"(^|[^a-z])(d|dq|vel|velocity|velocities|eff|effort|torque|tau|acc|accel|acceleration|current|desired|target|cmd|"
    r"command|commanded|goal|error)([^a-z]|$)"
)
_NAMES = re.compile(r"(.*?)name(\W?\d+\W?)")
_POSITION = re.compile(r"[./_: ](position|positions|pos|q|actual)$", re.IGNORECASE)


def plain_name(name: str) -> str:
    """The name of a column without a unit in brackets that is understood, as in "time [s]"; with another as it is."""
    return re.sub(r"\s*\[(s|rad|m|deg|mm)\]$", "", name)


def scale_of(name: str) -> float:
    """By what a column is multiplied to be in rad or m: of "NAME [deg]" and "NAME [mm]"; 1 without these units."""
    unit = re.search(r"\[(deg|mm)\]$", name)
    return 1.0 if unit is None else {"deg": pi / 180, "mm": 1e-3}[unit[1]]


def column_named(file: Path, header: Sequence[str], name: str, what: str, noun: str = "column") -> int:
    """The place of a column, or another noun. Raises: FileError, which names the nearest."""
    name = plain_name(name)
    if name in header:
        return header.index(name)
    fact = f"there is no {noun} {shown(name)!r} for {what}"
    raise FileError(file, fact, closest(name, [shown(column) for column in header if column]))


def columns_named(
    file: Path,
    header: Sequence[str],
    robot: Robot,
    columns: Columns | None,
    *,
    noun: str = "column",
    what: str = "columns",
) -> list[int]:
    """The places of the robot's joints in a header, in its order; joints without a column have their own names.

    Raises:
        FileError: the file has no such column. ArgumentError: too few or too many, or one column for two joints.
        UnknownNameError: a joint that the robot has not.
    """
    if columns is None:
        return joint_columns(file, header, robot, robot.joint_names, what)
    # The column that is named for each joint.
    names = _in_words(header, robot, columns) if isinstance(columns, str) else columns
    if isinstance(names, Mapping):
        for joint in names:
            if joint not in robot.joint_names:
                raise UnknownNameError(f"joint of {robot.name!r}", joint, robot.joint_names)
        chosen = {joint: names[joint] for joint in robot.joint_names if joint in names}
    else:
        if len(names) != robot.n:
            order = ", ".join(robot.joint_names)
            cure = f'name {robot.n} columns in the order {order}, or a pattern "q_{NUMBER}", or joint=column'
            raise ArgumentError("columns", columns, cure)
        chosen = dict(zip(robot.joint_names, names, strict=True))
    # Its place; joints that a mapping leaves out have their own names.
    place_of: dict[str, int] = {}
    for joint, name in chosen.items():
        if not isinstance(name, str):
            raise ArgumentError(f"the column of joint {joint!r}", name, "give its name in the header")
        place_of[joint] = column_named(file, header, name, f"joint {joint!r}", noun)
    rest = [joint for joint in robot.joint_names if joint not in place_of]
    place_of |= dict(zip(rest, joint_columns(file, header, robot, rest, what), strict=True))
    places = [place_of[joint] for joint in robot.joint_names]
    for i, place in enumerate(places):
        if place in places[:i]:
            two = f"{robot.joint_names[places.index(place)]} and {robot.joint_names[i]}"
            raise ArgumentError("columns", columns, f"{noun} {header[place]!r} cannot be both {two}: give each its own")
    return places


def _in_words(header: Sequence[str], robot: Robot, text: str) -> Sequence[str] | Mapping[str, str]:
    """Columns as they are typed."""
    parts = [part.strip() for part in text.split(",")]
    if len(parts) == 1 and NUMBER in text and parts[0] not in header:
        first = 0 if text.strip().replace(NUMBER, "0") in header else 1
        return [text.strip().replace(NUMBER, str(first + i)) for i in range(robot.n)]
    pairs = [part.partition("=") for part in parts]
    if all(between for _, between, _ in pairs) and not set(parts) <= set(header):
        return {joint.strip(): column.strip() for joint, _, column in pairs}
    return parts


def names_beside(header: Sequence[str]) -> dict[int, int]:
    """Columns of positions, and beside each the column that names its joint in every row, as `field.name0` names that
    of `field.position0`."""
    beside = {}
    for i, column in enumerate(header):
        match = _NAMES.fullmatch(column)
        position = f"{match[1]}position{match[2]}" if match else ""
        if position in header:
            beside[header.index(position)] = i
    return beside


def joint_columns(
    file: Path, header: Sequence[str], robot: Robot, joints: Sequence[str], what: str = "columns"
) -> list[int]:
    """The places of joints by their own names, with or without a prefix. Raises: FileError."""
    chosen, missing = [], []
    for joint in joints:
        exact = [i for i, column in enumerate(header) if column == joint]
        ends = re.compile(rf"(^|[^A-Za-z0-9]){re.escape(joint)}$")
        near = exact or [i for i, column in enumerate(header) if ends.search(_POSITION.sub("", column))]
        if len(near) > 1 and not exact:
            rates = [i for i in near if _OTHER.search(header[i].lower().replace(joint.lower(), ""))]
            near = [i for i in near if i not in rates]
        if len(near) > 1:
            names = listed([repr(header[i]) for i in near])
            fact = f"joint {joint!r} could be any of the {what} {names}"
            raise FileError(file, fact, "keep or name one of them, by --columns (columns=...)")
        if near:
            chosen.append(near[0])
        else:
            missing.append(joint)
    if missing:
        fact = f"joints {listed(missing)} of {shown(robot.name)} are not in it"
        cure = "rename them, name them by --columns (columns=...) or choose another robot"
        raise FileError(file, fact, f"{cure}; the {what} are {listed(header)}")
    return chosen
