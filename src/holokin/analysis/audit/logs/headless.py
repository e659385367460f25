"""Names for the columns of a CSV file without a header: as `ros2 topic echo --csv` writes them, or by their number."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ....base.csv_table import number_in
from ....base.errors import RecordingError
from ....base.given_files import listed
from ....robot import Robot
from .joint_columns import names_beside

STAMPS = ("secs", "nsecs")
"""Columns of a stamp in two parts."""


def numbered(cells: Sequence[str]) -> list[str]:
    """The columns by their numbers, "1", "2", ..., for who names them so."""
    return [str(k + 1) for k in range(len(cells))]


def guessed(file: Path, cells: Sequence[str], robot: Robot) -> tuple[list[str], str]:
    """(names of the columns, a note on what was taken for what) by the first row of a file without a header.

    A JointState as `ros2 topic echo --csv` writes it names its joints in each row: stamp, frame, names, positions, and
    perhaps velocities and efforts. Else the number of columns tells: a time, or seconds and nanoseconds, then the
    joints in the robot's order, perhaps their rates, perhaps their efforts.

    Raises:
        RecordingError: columns that nobody knows.
    """
    found = _joint_state(cells, robot) or _by_count(cells, robot)
    if found is None:
        n = robot.n
        fact = f"line 1 holds numbers, no header, and {len(cells)} columns are none that are known for {n} joints"
        counts = ", ".join(str(count) for count in sorted(_forms(robot)))
        cure = f"log a header, or give the columns by their numbers: --columns 2,3,... --time 1 ({counts} are known)"
        raise RecordingError(file, fact, cure)
    names, what = found
    beside = names_beside(names)
    at = {name: k + 1 for k, name in enumerate(names)} | {cells[name]: k + 1 for k, name in beside.items()}
    places = [at[joint] for joint in robot.joint_names]
    row = places == list(range(places[0], places[-1] + 1))
    which = f"{places[0]} to {places[-1]}" if row else ", ".join(map(str, places))
    return names, f"no header: {what}; columns {which} were taken for {listed(robot.joint_names)}"


def _joint_state(cells: Sequence[str], robot: Robot) -> tuple[list[str], str] | None:
    """Of a JointState: the joints' names stand in the row itself."""
    there = [k for k, cell in enumerate(cells) if k > 1 and not _is_number(cell) and cell]
    if not there or not set(robot.joint_names) <= {cells[k] for k in there}:
        return None
    first = min(cells.index(joint) for joint in robot.joint_names)
    while first - 1 in there and cells[first - 1].strip() and first - 1 > 2:  # joints of other parts before them
        first -= 1
    last = first
    while last < len(cells) and not _is_number(cells[last]):
        last += 1
    count, rest = last - first, len(cells) - last
    joints = list(cells[first:last])
    if rest < count or rest % count or len(set(joints)) < count:
        return None
    kinds = ("position", "velocity", "effort", *(f"more {k} " for k in range(rest // count)))
    named = [f"{kind}{k}" for kind in ("name", *kinds[: rest // count]) for k in range(count)]
    head = [*STAMPS, *(f"field {k}" for k in range(2, first))]
    return [
        *head,
        *named,
    ], "a JointState of `ros2 topic echo --csv`, with its joints' names in each row"


def _by_count(cells: Sequence[str], robot: Robot) -> tuple[list[str], str] | None:
    """By the number of columns, where all hold numbers and one form alone has so many."""
    if not all(map(_is_number, cells)):
        return None
    whole = all(cell.strip().isdigit() for cell in cells[:2])  # a stamp in two parts holds whole numbers
    fitting = [form for form in _forms(robot).get(len(cells), []) if whole or form[0][0] not in STAMPS]
    return fitting[0] if len(fitting) == 1 else None


def _forms(robot: Robot) -> dict[int, list[tuple[list[str], str]]]:
    """Number of columns -> what they may be: names, and the same in words."""
    joints, found = list(robot.joint_names), {}
    for stamp, said in ((["t"], "a time"), (list(STAMPS), "seconds and nanoseconds")):
        for parts, more in (((), ""), (("d_",), ", their rates"), (("d_", "effort."), ", their rates and efforts")):
            names = [*stamp, *joints, *(part + joint for part in parts for joint in joints)]
            found.setdefault(len(names), []).append((names, f"guessed from the count: {said}, the joints{more}"))
    return found


def _is_number(text: str) -> bool:
    return number_in(text) is not None
