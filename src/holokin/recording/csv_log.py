"""Reads joints from CSV files, a piece at a time: the text of a long log is never in memory as a whole."""

from __future__ import annotations

import csv
import re
from array import array
from collections.abc import Callable, Iterator, Sequence
from itertools import chain, islice
from pathlib import Path
from typing import TextIO

import numpy as np

from ..base.types import Matrix, Vector
from ..errors import RecordingError
from ..robot import Robot
from .columns import Columns, column_named, columns_named, in_si
from .log import Samples, joints_missing, listed, shown

TIMES = ("t", "time", "stamp", "secs", "timestamp")
"""Names of a time column; a prefix ('header.stamp') and capitals do not matter."""

PIECE = 10_000
"""Rows that are text at one time: some megabytes."""

LONGEST_LINE = 1_000_000
"""Characters of a line; a file with a longer one is no table, and may be gigabytes of one line."""

_OTHER = re.compile(
    r"(^|[^a-z])(d|dq|vel|velocity|velocities|eff|effort|torque|tau|acc|accel|acceleration|current|desired|target|cmd|"
    r"command|commanded|goal|error)([^a-z]|$)"
)
_POSITION = re.compile(r"[./_: ](position|positions|pos|q|actual)$", re.IGNORECASE)
_WHOLE = re.compile(r"[+-]?\d{1,19}")


def read_csv(file: Path, robot: Robot, columns: Columns | None = None, time: str | None = None) -> Samples:
    """The samples of a CSV file; columns and time name its columns.

    Raises:
        RecordingError. UnknownNameError, ArgumentError: as `columns_named`.
    """
    times: list[int] = []

    def wanted(names: Sequence[str]) -> list[int]:
        header = [in_si(name) for name in names]
        times.extend(_time_column(file, header) if time is None else [column_named(file, header, time, "the time")])
        if columns is None:
            return [*times, *_joint_columns(file, header, robot, robot.joint_names)]
        others = lambda joints: _joint_columns(file, header, robot, joints)  # noqa: E731
        return [*times, *columns_named(file, header, robot, columns, others)]

    stamps: _Stamps | None = None
    q, numbers = array("d"), array("q")
    for table, texts, places in csv_pieces(file, wanted, "log a header and at least two cycles"):
        stamps = stamps or _Stamps(len(times) == 2)
        stamps.add(table[:, : len(times)], texts)
        q.frombytes(table[:, len(times) :].tobytes())
        numbers.extend(places)
    if stamps is None:
        raise RecordingError(file, "has a header but no samples", "log at least two cycles")
    notes: list[str] = []
    t = stamps.seconds(file, notes)
    return Samples(t, np.frombuffer(q).reshape(len(t), -1), "line", np.frombuffer(numbers, dtype=np.int64), notes)


def csv_pieces(
    file: Path, wanted: Callable[[Sequence[str]], Sequence[int]], cure: str, names: str = "t and the robot's joints"
) -> Iterator[tuple[Matrix, list[str], Sequence[int]]]:
    """Some rows of a CSV file at a time: the wanted columns as finite numbers, the first of them as text, the lines.

    Args:
        wanted: the columns that are read, of the header's names.
        cure: for a file without a header or rows. names: of the columns that it should have.

    Raises:
        RecordingError: it cannot be read, has no header, or a cell that is no finite number.
    """
    try:
        with file.open(newline="", encoding="utf-8-sig") as stream:
            lines = _lines(file, stream)
            first = next(lines, "")
            delimiter = max(",;\t", key=first.count)
            if delimiter not in first and '"' not in first and len(first.split()) > 1:  # as UR's RTDE client writes it
                delimiter, first, lines = (
                    ",",
                    ",".join(first.split()),
                    (",".join(line.split()) + "\n" for line in lines),
                )
            cells = next(csv.reader([first], delimiter=delimiter), [])
            header = [cell.strip().strip("#").strip() for cell in cells]
            if not any(header):
                fact = "line 1 is empty, no header" if next(lines, "") else "is empty"
                raise RecordingError(file, fact, cure)
            if _is_number(header[0]):
                raise RecordingError(file, "line 1 holds numbers, no header", f"name the columns: {names}")
            yield from _pieces(file, header, _told_apart(file, header, wanted(header)), lines, delimiter)
    except (OSError, UnicodeError, csv.Error) as problem:
        fact = f"cannot be read as text ({shown(str(problem), 200)})"
        raise RecordingError(file, fact, "give a CSV file in UTF-8, a bag or .mcap") from None


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _told_apart(file: Path, header: Sequence[str], wanted: Sequence[int]) -> Sequence[int]:
    """The wanted columns, each of a name that no other has. Raises: RecordingError."""
    for c in wanted:
        if header.count(header[c]) > 1:
            fact = f"its header has {header.count(header[c])} columns {shown(header[c])!r}"
            raise RecordingError(file, fact, "rename or delete all but one")
    return wanted


def _lines(file: Path, stream: TextIO) -> Iterator[str]:
    while line := stream.readline(LONGEST_LINE):
        if len(line) == LONGEST_LINE and not line.endswith(("\n", "\r")):
            fact = f"a line has over {LONGEST_LINE} characters"
            raise RecordingError(file, fact, "give a CSV file with a line a sample")
        yield line


def _pieces(
    file: Path, header: Sequence[str], wanted: Sequence[int], lines: Iterator[str], delimiter: str
) -> Iterator[tuple[Matrix, list[str], Sequence[int]]]:
    """The wanted columns of some rows as numbers, the first of them, the time, as text too, and the rows' lines."""
    done = 1
    while piece := list(islice(lines, PIECE)):
        plain = not any('"' in line for line in piece)
        fits = plain and max(line.count(delimiter) for line in piece) < len(header)
        table = _plain_numbers(piece, wanted, delimiter) if fits else None
        if table is not None:
            c = wanted[0]
            texts = [line.split(delimiter, c + 1)[c].strip() for line in piece]
            yield table, texts, range(done + 1, done + len(piece) + 1)
            done += len(piece)
            continue
        # A quoted cell may run on beyond the piece: from here to the end, or to that of a piece without quotes.
        reader = csv.reader(piece if plain else chain(piece, lines), delimiter=delimiter)
        rows = ((done + reader.line_num, row) for row in reader if any(cell.strip() for cell in row))
        while some := list(islice(rows, PIECE)):
            table = _row_numbers(file, header, wanted, some)
            yield table, [row[wanted[0]].strip() for _, row in some], [line for line, _ in some]
        done += reader.line_num


def _plain_numbers(lines: Sequence[str], wanted: Sequence[int], delimiter: str) -> Matrix | None:
    """Columns of lines without quotes, several times as fast as cell by cell; None where one is not a finite number."""
    if not all(map(str.strip, lines)):
        return None
    try:
        table = np.loadtxt(lines, delimiter=delimiter, usecols=wanted, comments=None, ndmin=2)
    except ValueError:
        return None
    return table if len(table) == len(lines) and np.isfinite(table).all() else None


def _row_numbers(
    file: Path, header: Sequence[str], wanted: Sequence[int], rows: Sequence[tuple[int, list[str]]]
) -> Matrix:
    for line, row in rows:
        if len(row) > len(header) and any(cell.strip() for cell in row[len(header) :]):
            fact = f"line {line} has {len(row)} cells, the header {len(header)}"
            raise RecordingError(file, fact, "delete what is too much; write decimals with a point, not a comma")
    try:
        table = np.array([[float(row[c]) for c in wanted] for _, row in rows])
    except (ValueError, IndexError):
        raise _bad_cell(file, header, wanted, rows) from None
    if not np.isfinite(table).all():
        raise _bad_cell(file, header, wanted, rows)
    return table


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
                held = shown(row[c].strip())
                fact = f"line {line}, column {shown(header[c])!r} holds {held!r}, not a finite number"
                return RecordingError(file, fact, "correct or delete the line")
    raise AssertionError("every cell is a finite number")  # only called when one is not


class _Stamps:
    """Times, piece by piece: as numbers, and as exact integers as long as all are whole."""

    def __init__(self, split: bool) -> None:
        self.split, self.whole, self.origin = split, not split, 0.0
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

    def seconds(self, file: Path, notes: list[str]) -> Vector:
        """Seconds since the first stamp. Whole nanoseconds are told by their step; their differences are exact."""
        t = np.frombuffer(self.values)
        if self.split:
            return t
        if self.whole and np.abs(t).max() < 2**62:  # no difference overflows
            ticks = np.frombuffer(self.ticks, dtype=np.int64)
            ticks = (ticks - ticks[0]).astype(float)
            step = float(np.median(np.abs(np.diff(ticks)))) if len(ticks) > 1 else 0.0
            if step >= 1e4:
                notes.append("stamps read as nanoseconds")
                return ticks * 1e-9
            if step > 5:
                fact = f"its whole-number stamps are {step:g} apart: neither seconds nor nanoseconds"
                raise RecordingError(file, fact, "give seconds, or whole nanoseconds")
        with np.errstate(over="ignore"):  # an infinite span is refused later, as all over three centuries
            return t - t[0] if abs(t[0]) > 1e6 else t


def _time_column(file: Path, header: Sequence[str]) -> list[int]:
    """The time column; with a second one of nanoseconds where stamps are split ('secs', 'nsecs')."""
    words = [re.split(r"[^a-z]+", name.lower().strip("_"))[-1] for name in header]
    for name in TIMES:
        exact = [i for i, column in enumerate(header) if column.lower() == name]
        found = exact or [i for i, word in enumerate(words) if word == name]
        if found:
            parts = [i for i, word in enumerate(words) if word in ("nsecs", "nanosec", "nsec")]
            return [found[0], *parts[:1]] if name == "secs" else found[:1]
    cure = f"name the column of seconds one of {', '.join(TIMES)}; the columns are {listed(header)}"
    raise RecordingError(file, "there is no time column", cure)


def _joint_columns(file: Path, header: Sequence[str], robot: Robot, joints: Sequence[str]) -> list[int]:
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
            fact = f"joint {joint!r} could be any of the columns {names}"
            raise RecordingError(file, fact, "keep or name one of them")
        if near:
            chosen.append(near[0])
        else:
            missing.append(joint)
    if missing:
        raise joints_missing(file, missing, header, "columns", robot)
    return chosen
