"""Reads joints over time from CSV files: their stamps, and joints in the robot's order."""

from __future__ import annotations

import re
from array import array
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ....base import tables
from ....base.errors import FileError
from ....base.files import listed
from ....base.types import Matrix, Vector
from ....robot import Robot
from .joint_columns import (
    NUMBER,
    Columns,
    Samples,
    column_named,
    columns_named,
    joint_columns,
    names_beside,
    plain_name,
    scale_of,
)

# --- Names for the columns of a CSV file without a header: as `ros2 topic echo --csv` writes them, or by their number.

STAMPS = ("secs", "nsecs")  # columns of a stamp in two parts


def guessed(file: Path, cells: Sequence[str], robot: Robot) -> tuple[list[str], str]:
    """(names of the columns, a note on what was taken for what) by the first row of a file without a header.

    A JointState as `ros2 topic echo --csv` writes it names its joints in each row: stamp, frame, names, positions, and
    perhaps velocities and efforts. Else the number of columns tells: a time, or seconds and nanoseconds, then the
    joints in the robot's order, perhaps their rates, perhaps their efforts. Raises: FileError: columns that nobody
    knows."""
    form = _joint_state(cells, robot)
    if form is None and all(tables.number_in(cell) is not None for cell in cells):
        # By the number of columns, where one form alone has so many; a stamp in two parts holds whole numbers.
        whole = all(cell.strip().isdigit() for cell in cells[:2])
        fitting = [form for form in _forms(robot).get(len(cells), []) if whole or form[0][0] not in STAMPS]
        form = fitting[0] if len(fitting) == 1 else None
    if form is None:
        n = robot.n
        fact = f"line 1 holds numbers, no header, and {len(cells)} columns are none that are known for {n} joints"
        counts = ", ".join(str(count) for count in sorted(_forms(robot)))
        cure = f"log a header, or give the columns by their numbers: --columns 2,3,... --time 1 ({counts} are known)"
        raise FileError(file, fact, cure)
    names, what = form
    # The columns of the joints, counted from 1; a row may name its joints itself, in a column beside each position.
    column_of = {name: column + 1 for column, name in enumerate(names)}
    column_of |= {cells[name_column]: position + 1 for position, name_column in names_beside(names).items()}
    places = [column_of[joint] for joint in robot.joint_names]
    row = places == list(range(places[0], places[-1] + 1))
    which = f"{places[0]} to {places[-1]}" if row else ", ".join(map(str, places))
    return names, f"no header: {what}; columns {which} were taken for {listed(robot.joint_names)}"


def _joint_state(cells: Sequence[str], robot: Robot) -> tuple[list[str], str] | None:
    """Of a JointState: the joints' names stand in the row itself."""
    there = [k for k, cell in enumerate(cells) if k > 1 and tables.number_in(cell) is None and cell]
    if not there or not set(robot.joint_names) <= {cells[k] for k in there}:
        return None
    first = min(cells.index(joint) for joint in robot.joint_names)
    while first - 1 in there and cells[first - 1].strip() and first - 1 > 2:  # joints of other parts before them
        first -= 1
    last = first
    while last < len(cells) and tables.number_in(cells[last]) is None:
        last += 1
    count, rest = last - first, len(cells) - last
    joints = list(cells[first:last])
    if rest < count or rest % count or len(set(joints)) < count:
        return None
    kinds = ("position", "velocity", "effort", *(f"more {k} " for k in range(rest // count)))
    named = [f"{kind}{k}" for kind in ("name", *kinds[: rest // count]) for k in range(count)]
    head = [*STAMPS, *(f"field {k}" for k in range(2, first))]
    what = "a JointState of `ros2 topic echo --csv`, with its joints' names in each row"
    return [*head, *named], what


def _forms(robot: Robot) -> dict[int, list[tuple[list[str], str]]]:
    """Number of columns -> what they may be: names, and the same in words."""
    joints, forms = list(robot.joint_names), {}
    for stamp, stamp_words in ((["t"], "a time"), (list(STAMPS), "seconds and nanoseconds")):
        for parts, more in (((), ""), (("d_",), ", their rates"), (("d_", "effort."), ", their rates and efforts")):
            names = [*stamp, *joints, *(part + joint for part in parts for joint in joints)]
            forms.setdefault(len(names), []).append((names, f"guessed from the count: {stamp_words}, the joints{more}"))
    return forms


CURE = "log a header and at least two cycles"
_WHOLE = re.compile(r"[+-]?\d{1,19}")


def read_csv(
    file: Path, robot: Robot, columns: Columns | None = None, time: str | None = None, *, skip_bad: bool = False
) -> Samples:
    """The samples of a CSV file; columns and time name its columns, of a file without a header by their numbers.

    skip_bad: rows that cannot be read are left out and counted; else the first one is refused. Raises: FileError.
    UnknownNameError, ArgumentError: as `columns_named`."""
    # What is learnt of the columns when the header is read: names, times, units, and joints named in each row.
    times: list[tables.TimeColumns] = []
    notes: list[str] = []
    bad: list[FileError] | None = [] if skip_bad else None

    def headless(cells: Sequence[str]) -> list[str]:
        if columns is None and time is None:
            names, note = guessed(file, cells, robot)
            notes.append(note)
            return names
        first = "" if time is not None else "column 1 was taken for the time, "
        notes.append(f"no header: {first}columns by their numbers")
        return ["t" if time is None else "1", *(str(k) for k in range(2, len(cells) + 1))]

    scales: list[float] = []
    labels: list[int] = []
    joints: list[_JointsByName] = []

    def wanted(names: Sequence[str]) -> list[int]:
        header = [plain_name(name) for name in names]
        if time is None:
            columns_of_time = tables.time_columns(names)
            if columns_of_time is None:
                raise tables.no_time(file, header)
            times.append(columns_of_time)
        else:
            place = column_named(file, header, time, "the time")
            times.append(tables.TimeColumns((place,), tables.unit_in(names[place])))
        beside = names_beside(header)
        named_in_rows = columns is None and beside and not set(robot.joint_names) <= set(header)
        places = [] if named_in_rows else columns_named(file, header, robot, columns)
        if beside and set(places) <= set(beside):
            given = [list(beside).index(place) for place in places] or None
            joints.append(_JointsByName(file, robot, given, isinstance(columns, str) and NUMBER in columns))
            labels.extend(beside.values())
            notes.append(f"joints by their names in {names[labels[0]]} to {names[labels[-1]]}")
            places = list(beside)
        scales.extend(scale_of(names[place]) for place in places)
        return [*times[0].places, *places]

    # The rows, some at a time.
    stamps: _Stamps | None = None
    q, numbers = array("d"), array("q")
    cure = "t and the robot's joints"
    for rows in tables.read_table(file, wanted, CURE, cure, headless=headless, bad=bad, labels=labels):
        count = len(times[0].places)
        stamps = stamps or _Stamps(times[0])
        stamps.add(rows.table[:, :count], rows.texts)
        values = rows.table[:, count:] * scales
        q.frombytes((joints[0].ordered(values, rows) if joints else values).tobytes())
        numbers.extend(rows.lines)
    if stamps is None:
        raise FileError(file, "has a header but no samples", "log at least two cycles")
    if bad:
        rows = "1 row was" if len(bad) == 1 else f"{len(bad)} rows were"
        notes.append(f"{rows} left out that could not be read; the first: {bad[0].fact}")
    # Seconds, and joints in their order.
    t, origin = stamps.seconds(file, notes)
    lines, units_named = np.frombuffer(numbers, dtype=np.int64), any(scale != 1.0 for scale in scales)
    return Samples(t, np.frombuffer(q).reshape(len(t), -1), "line", lines, notes, units_named, origin)


class _JointsByName:
    """Puts values into the robot's order, row by row, where each row names its joints.

    given: places of the joints among the names, as the user says them, for names that are not the robot's. pattern:
    they follow from a pattern, which says no joint's name; else the names must not say otherwise.
    """

    def __init__(self, file: Path, robot: Robot, given: Sequence[int] | None, pattern: bool) -> None:
        self.file, self.robot, self.given, self.pattern = file, robot, given, pattern
        self.known: dict[tuple[str, ...], Sequence[int]] = {}

    def ordered(self, values: Matrix, rows: tables.Rows) -> Matrix:
        """Values (k, c) of the named joints -> (k, n). Raises: FileError."""
        places = np.empty((len(values), self.robot.n), dtype=np.intp)
        for k, names in enumerate(rows.labels):
            if names not in self.known:
                self.known[names] = self._places(names, rows.lines[k])
            places[k] = self.known[names]
        return np.take_along_axis(values, places, axis=1)

    def _places(self, names: Sequence[str], line: int) -> Sequence[int]:
        joints = self.robot.joint_names
        try:
            places = joint_columns(self.file, names, self.robot, joints, f"names in line {line}")
        except FileError:
            if self.given is None or self.known:
                raise
            return self.given
        if self.given is not None and not self.pattern and list(self.given) != places:
            i = next(i for i in range(len(joints)) if self.given[i] != places[i])
            fact = f"line {line} names {names[self.given[i]]!r} where --columns says {joints[i]!r}"
            raise FileError(self.file, fact, "leave out --columns (columns=...): the names in the file are used")
        return places


class _Stamps:
    """Times, piece by piece: as numbers, and as exact integers as long as all are whole."""

    def __init__(self, columns: tables.TimeColumns) -> None:
        self.split, self.unit, self.whole, self.origin = columns.split, columns.unit, not columns.split, 0.0
        self.values, self.ticks = array("d"), array("q")

    def add(self, table: Matrix, texts: Sequence[str]) -> None:
        """Add the time columns of some rows, and the text of the first."""
        if self.split:
            self.origin = self.origin if self.values else float(table[0, 0])
            with np.errstate(over="ignore"):
                self.values.frombytes((table[:, 0] - self.origin + 1e-9 * table[:, 1]).tobytes())
            return
        self.values.frombytes(table[:, 0].tobytes())
        if self.whole and all(_WHOLE.fullmatch(text) for text in texts):
            try:
                self.ticks.extend(int(text) for text in texts)
            except OverflowError:
                self.whole = False
        else:
            self.whole = False

    def seconds(self, file: Path, notes: list[str]) -> tuple[Vector, float]:
        """(seconds since the first stamp, that stamp), or (seconds, 0.0) of small ones; differences of whole stamps are
        exact. The unit is that of the header, else that of `unit_of`.
        """
        t = np.frombuffer(self.values)
        if self.split:
            return t, self.origin
        first = float(t[0])
        with np.errstate(over="ignore"):  # an infinite span is refused later, as all over three centuries
            if self.whole and np.abs(t).max() < 2**62:  # no difference overflows
                ticks = np.frombuffer(self.ticks, dtype=np.int64)
                since = (ticks - ticks[0]).astype(float)
            else:
                since = t - first
            unit = self.unit or tables.unit_of(file, t, steady=True)
            if self.unit is None and unit != "s":
                notes.append(f"stamps read as {tables.WORDS[unit]}")
            size = tables.UNITS[unit]
            return (since * size, first * size) if abs(first * size) > 1e6 or size < 1 else (t, 0.0)
