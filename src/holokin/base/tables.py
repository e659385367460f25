"""CSV tables of numbers: their dialect, columns of times, and columns of points or poses of the tool."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase as fnmatch
from itertools import chain, islice
from math import isfinite
from pathlib import Path
from typing import NamedTuple, TextIO

import numpy as np

from .errors import ArgumentError, FileError
from .files import is_folder, listed, shown
from .poses import ORDERS, UNIT
from .types import ROTATION, Array, Indices, Matrix, Vector, rotation_cure, rotation_gap

# --- Reads tables of numbers from CSV files, a piece at a time: the text of a long one is never in memory as a whole.

PIECE = 10_000
"""Rows that are text at one time: some megabytes."""

_COMMA, _POINT = re.compile(r"(?<=\d),(?=\d)"), re.compile(r"\d\.\d")
"""Decimal marks."""

_NUMBERS = re.compile(r"[-+.,;\s\deE]*")
"""A line without names."""

_REMARK = re.compile(r"^//|(?<=\S)\s*(?://|#).*(?=\n)|(?<=\S)\s*(?://|#).*$")
"""The mark of a remark at the beginning of a line, or a remark behind something."""

LONGEST_LINE = 1_000_000
"""Characters of a line; a file with a longer one is no table, and may be gigabytes of one line."""


def read_table(
    file: Path,
    wanted: Callable[[Sequence[str]], Sequence[int]],
    cure: str,
    names: str,
    *,
    headless: Callable[[Sequence[str]], list[str]] | None = None,
    bad: list[FileError] | None = None,
    labels: Sequence[int] = (),
    remarks: bool = False,
) -> Iterator[Rows]:
    """Some rows of a CSV file at a time: the wanted columns as finite numbers, the first of them as text, the lines.

    Args:
        wanted: the columns that are read, of the header's names.
        labels: columns whose text is wanted too; `wanted` may fill it.
        cure: for a file without a header or rows. names: of the columns that it should have.
        headless: names the columns of a file whose first line holds numbers, by this line; None refuses such a file.
        remarks: what stands behind # or // in a line is none of its cells.
        bad: gets the error of each row that cannot be read, and the row is left out; None raises it.

    Raises:
        FileError: it cannot be read, has no header, or a cell that is no finite number.
    """
    try:
        with file.open(newline="", encoding="utf-8-sig") as stream:
            first, lines, done = _from_header(_lines(file, stream, remarks), remarks and headless is not None)
            delimiter = _delimiter(first)
            if delimiter not in first and '"' not in first and len(first.split()) > 1:  # as UR's RTDE client writes it
                delimiter, first = ",", ",".join(first.split())
                lines = (",".join(line.split()) + "\n" for line in lines)
            plain = first if delimiter == "," else _COMMA.sub(".", first)
            cells = next(csv.reader([plain], delimiter=delimiter), [])
            header = [cell.strip().strip("#").strip() for cell in cells]
            if not any(header):
                raise FileError(file, f"line {done} is empty, no header" if first else "is empty", cure)
            if number_in(header[0]) is not None:
                if headless is None:
                    fact = f"line {done} holds numbers, no header"
                    raise FileError(file, fact, f"name the columns: {names}")
                header, lines, done = headless([cell.strip() for cell in cells]), chain([first], lines), done - 1
            if delimiter != ",":
                lines = _with_points(file, lines, done)
            columns = wanted(header)
            for name in (header[c] for c in columns):
                if header.count(name) > 1:
                    fact = f"its header has {header.count(name)} columns {shown(name)!r}"
                    raise FileError(file, fact, "rename or delete all but one")
            yield from _pieces(file, header, columns, lines, delimiter, done, bad, labels)
    except (OSError, UnicodeError, csv.Error) as problem:
        fact = f"cannot be read as text ({shown(str(problem), 200)})"
        raise FileError(file, fact, "give a CSV file in UTF-8, a bag or .mcap") from None


def _from_header(lines: Iterator[str], named: bool) -> tuple[str, Iterator[str], int]:
    """(the header, the lines after it, the header's number): comments, from # on, and empty lines may stand before it.

    A comment is the header where no other line is, and the columns are not named: numbers follow, and it has as many
    cells as they.
    """
    before: list[str] = []
    for line in lines:
        if line.strip() and not line.startswith("#"):
            break
        before.append(line)
    else:
        line = ""
    mark = _delimiter(line)
    cells = line.count(mark)
    holds_numbers = not line or number_in(line.split(mark)[0].replace(",", ".")) is not None
    for i, comment in reversed([*enumerate(before)]):
        if holds_numbers and not named and "#" in comment and (not line or cells == comment.count(mark)):
            return comment, chain(before[i + 1 :], [line] * bool(line), lines), i + 1
    return line, lines, len(before) + 1


def _delimiter(line: str) -> str:
    """What ends the cells of a line: the most frequent mark; of numbers alone a comma may be a decimal mark."""
    return max(";\t" if _NUMBERS.fullmatch(line) and re.search("[;\t]", line) else ",;\t", key=line.count)


def _with_points(file: Path, lines: Iterator[str], done: int) -> Iterator[str]:
    """Lines whose cells no comma ends, with points for decimal commas. Raises: FileError: the lines have both."""
    comma = point = 0
    for number, line in enumerate(lines, done + 1):
        if not point and "." in line and not line.startswith("#") and _POINT.search(line):
            point = number
        if "," in line and not line.startswith("#"):
            line, count = _COMMA.subn(".", line)
            comma = comma or number * bool(count)
        if comma and point:
            fact = f"line {comma} has a decimal comma, line {point} a decimal point"
            raise FileError(file, fact, "write all decimals with points, and no commas between thousands")
        yield line


class Rows(NamedTuple):
    """Some rows of a table: numbers (k, c), the first of them as text, the line of each, and its labels."""

    table: Matrix
    texts: list[str]
    lines: Sequence[int]
    labels: list[tuple[str, ...]]


def _labels(rows: Sequence[Sequence[str]], columns: Sequence[int]) -> list[tuple[str, ...]]:
    return [tuple(row[c].strip() if c < len(row) else "" for c in columns) for row in rows]


def number_in(text: str) -> float | None:
    """The number that a cell holds; None for text."""
    try:
        return float(text)
    except ValueError:
        return None


def _lines(file: Path, stream: TextIO, remarks: bool) -> Iterator[str]:
    while line := stream.readline(LONGEST_LINE):
        if len(line) == LONGEST_LINE and not line.endswith(("\n", "\r")):
            fact = f"a line has over {LONGEST_LINE} characters"
            raise FileError(file, fact, "give a CSV file with a line a sample")
        yield _REMARK.sub(lambda match: "" if match.start() else "#", line) if remarks else line


def _pieces(
    file: Path,
    header: Sequence[str],
    wanted: Sequence[int],
    lines: Iterator[str],
    delimiter: str,
    done: int,
    bad: list[FileError] | None,
    labels: Sequence[int],
) -> Iterator[Rows]:
    """Rows, some at a time; the first of the wanted columns is the time."""
    while piece := list(islice(lines, PIECE)):
        plain = not any('"' in line for line in piece)
        fits = plain and max(line.count(delimiter) for line in piece) < len(header)
        table = _plain_numbers(piece, wanted, delimiter) if fits else None
        if table is not None:
            c = wanted[0]
            texts = [line.split(delimiter, c + 1)[c].strip() for line in piece]
            words = _labels([line.split(delimiter) for line in piece], labels) if labels else []
            yield Rows(table, texts, range(done + 1, done + len(piece) + 1), words)
            done += len(piece)
            continue
        # A quoted cell may run on beyond the piece: from here to the end, or to that of a piece without quotes.
        reader = csv.reader(piece if plain else chain(piece, lines), delimiter=delimiter)
        rows = ((done + reader.line_num, row) for row in reader if _holds_values(row, len(header), wanted))
        while some := list(islice(rows, PIECE)):
            sound_rows, numbers = _row_numbers(file, header, wanted, some, bad)
            if sound_rows:
                texts = [row[wanted[0]].strip() for _, row in sound_rows]
                words = _labels([row for _, row in sound_rows], labels) if labels else []
                yield Rows(np.array(numbers), texts, [line for line, _ in sound_rows], words)
        done += reader.line_num


def _holds_values(row: Sequence[str], width: int, wanted: Sequence[int]) -> bool:
    """Whether a row is neither empty nor a comment, which begins with # and is no row of the header's with numbers."""
    if not any(map(str.strip, row)):
        return False
    return not row[0].startswith("#") or (len(row) == width and any(number_in(row[c]) is not None for c in wanted))


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
    file: Path,
    header: Sequence[str],
    wanted: Sequence[int],
    rows: Sequence[tuple[int, list[str]]],
    bad: list[FileError] | None,
) -> tuple[list[tuple[int, list[str]]], list[list[float]]]:
    """(the rows, their wanted columns), cell by cell. Raises: FileError: one cannot be read, and `bad` is None."""
    sound_rows, numbers = [], []
    for line, row in rows:
        try:
            numbers.append(_row(file, header, wanted, line, row))
        except FileError as problem:
            if bad is None:
                raise
            bad.append(problem)
        else:
            sound_rows.append((line, row))
    return sound_rows, numbers


def _row(file: Path, header: Sequence[str], wanted: Sequence[int], line: int, row: Sequence[str]) -> list[float]:
    """The wanted columns of a row. Raises: FileError: one is no finite number; the row is too long or short."""
    lengths = f"cells, the header {len(header)}"
    if len(row) > len(header) and any(cell.strip() for cell in row[len(header) :]):
        cure = "delete what is too much; write decimals with a point, not a comma"
        raise FileError(file, f"line {line} has {len(row)} {lengths}", cure)
    values = []
    for c in wanted:
        if c >= len(row):
            raise FileError(file, f"line {line} has {len(row)} {lengths}", "complete or delete the line")
        number = number_in(row[c])
        if number is None or not isfinite(number):
            fact = f"line {line}, column {shown(header[c])!r} holds {shown(row[c].strip())!r}, not a finite number"
            comma = _COMMA.search(row[c])
            raise FileError(file, fact, "write decimals with points" if comma else "correct or delete the line")
        values.append(number)
    return values


# --- Times in CSV files: which columns hold them, and their unit, told by the header or by the size of the stamps.

TIMES = ("t", "time", "stamp", "secs", "sec", "seconds", "timestamp")
"""Names of a time column; a prefix ('header.stamp'), a unit at the end ('t_ms', 'Time (s)') and capitals do not
matter."""

UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
WORDS = {"s": "seconds", "ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds"}

EPOCH = (9e8, 4.2e9)
"""Unix time [s] that stamps are believed to have: 1998 to 2103."""

STEPS = (1e-5, 100.0)
"""Time [s] between two samples that belongs to such stamps."""

BY_STEP = ((5.0, "s"), (100.0, "ms"), (1e3, None), (1e5, "us"), (1e6, None), (np.inf, "ns"))
"""Units of whole stamps without a date, by the largest step that they have in each: of 5 Hz to 10 kHz, and in seconds
rarer. Between them are steps that could have two units."""

_SPELT = {
    **dict.fromkeys(["s", "sec", "secs", "second", "seconds"], "s"),
    **dict.fromkeys(["ms", "msec", "msecs", "millis", "milliseconds"], "ms"),
    **dict.fromkeys(["us", "µs", "μs", "usec", "usecs", "micros", "microseconds"], "us"),
    **dict.fromkeys(["ns", "nsec", "nsecs", "nanos", "nanosec", "nanosecs", "nanoseconds"], "ns"),
}
_UNIT = re.compile(rf"(.+?)\s*(?:[\[(]\s*({'|'.join(_SPELT)})\s*[\])]|[_ ]({'|'.join(_SPELT)}))")
_PART = re.compile(r"(.*?)(sec|secs|seconds|nsec|nsecs|nanosec|nanosecs|nanoseconds)")


@dataclass(frozen=True)
class TimeColumns:
    """The columns of a time: one, whose unit is None where the header does not say it; or seconds and nanoseconds."""

    places: tuple[int, ...]
    unit: str | None = None

    @property
    def split(self) -> bool:
        """Whether it has a part of whole seconds and one of nanoseconds."""
        return len(self.places) == 2


def time_columns(header: Sequence[str], prefixes: bool = True) -> TimeColumns | None:
    """The time columns of a header, whose names may have prefixes; None where there are none."""
    names = [name.lower().strip() for name in header]
    parts = {match[1] + match[2][0]: i for i, name in enumerate(names) if (match := _PART.fullmatch(name))}
    plain = [_without_unit(name) for name in names]
    words = [re.split(r"[^a-z]+", name.strip("_"))[-1] for name, _ in plain]
    for wanted in TIMES:
        exact = [i for i, (name, _) in enumerate(plain) if name == wanted]
        for i in exact or [i for i, word in enumerate(words) if word == wanted and prefixes]:
            match = _PART.fullmatch(names[i])
            pair = () if match is None else tuple(parts.get(match[1] + part, -1) for part in "sn")
            if not pair or -1 in pair:
                return TimeColumns((i,), plain[i][1] or ("s" if wanted in _SPELT else None))
            return TimeColumns(pair)
    for stem, i in parts.items():  # header_stamp_sec and header_stamp_nanosec
        if stem.endswith("s") and f"{stem[:-1]}n" in parts and prefixes:
            return TimeColumns((i, parts[f"{stem[:-1]}n"]))
    return None


def unit_in(name: str) -> str | None:
    """The unit of a time that a column's name says."""
    return _without_unit(name.lower().strip())[1]


def _without_unit(name: str) -> tuple[str, str | None]:
    match = _UNIT.fullmatch(name)
    return (name, None) if match is None else (match[1], _SPELT[match[2] or match[3]])


def unit_of(file: Path, stamps: Vector, steady: bool) -> str:
    """The unit of stamps (k,) by their size: those of Unix time in the years 1998 to 2103; of others, whole and of
    samples in `steady` succession, by their usual step; else seconds.

    Raises:
        FileError: whole stamps whose step could have two units.
    """
    first = abs(float(stamps[0]))
    fits = [unit for unit, size in UNITS.items() if EPOCH[0] <= first * size <= EPOCH[1]]
    whole = bool((np.floor(stamps[:1000]) == stamps[:1000]).all())
    step = float(np.median(np.abs(np.diff(stamps)))) if steady and (fits or whole) and len(stamps) > 1 else 0.0
    fits = [unit for unit in fits if not step or STEPS[0] <= step * UNITS[unit] <= STEPS[1]]
    if fits or not (steady and whole):
        return fits[0] if fits else "s"
    unit = next(unit for most, unit in BY_STEP if step <= most)
    if unit is None:
        fact = f"its whole-number stamps are {step:g} apart, which could be two units"
        raise FileError(file, fact, "name the unit in the header, as in t_ms, t_us or t_ns")
    return unit


def no_time(file: Path, header: Sequence[str]) -> FileError:
    """The refusal of a header without a time."""
    cure = f"name the column of times one of {', '.join(TIMES)}, with a unit as in t_ms; the columns are"
    return FileError(file, "there is no time column", f"{cure} {listed(header)}")


POSITION = ("x", "y", "z")
MATRIX = tuple(f"t{row}{column}" for row in range(3) for column in range(4))
"""Columns of a pose as the first three rows of its matrix, counted from 0; a last row may stand there too."""

NAMED = {
    "quaternion": ("qx", "qy", "qz", "qw"),
    "axis": ("i", "j", "k"),
    "normal": ("nx", "ny", "nz"),
    "angles": ("roll", "pitch", "yaw"),
    "vector": ("rx", "ry", "rz"),
    "KUKA": ("a", "b", "c"),
    "FANUC": ("w", "p", "r"),
    "Kawasaki": ("o", "a", "t"),
    "Comau": ("a", "e", "r"),
}
AXES = ("axis", "normal")
"""Columns of the direction of the tool's z axis."""

EULER = {
    "angles": "xyz",
    "KUKA": "ZYX",
    "FANUC": "xyz",
    "Kawasaki": "ZYZ",
    "Comau": "ZYZ",
    "Mitsubishi": "xyz",
    "Yaskawa": "xyz",
    "Staubli": "XYZ",
}
"""Axes of three angles in the order of their columns: capitals turn with the tool, small letters stand still. Those of
makers are as Basler's pages on pose formats have them; of Comau and Staubli as in RoboDK's robomath.py."""

OF_MAKERS = {"KUKA": ("KUKA", "Mitsubishi"), "vector": ("UR", "Yaskawa", "Staubli")}
"""Names of columns that several makers use in ways of their own: the first one is taken where nobody says another."""

MAKERS = sorted({*EULER, "UR"} - {"angles"}, key=str.lower)
NUMBERED = (("q1", "q2", "q3", "q4"), ("q0", "q1", "q2", "q3"))
REMARKS = {"", "name", "label", "comment", "remark", "note", "id", "index", "number", "point", "line", "row"}
"""Columns that say nothing of a pose; a table that pandas wrote has one without a name."""

LAST_ROW = ("t30", "t31", "t32", "t33")

COVERAGE = (("x", "y", "z", "qx", "qy", "qz", "qw", "status"), ("rcond", "margin"))
"""How the header of a saved coverage begins and ends; between are the joints."""

AS_KUKA = (
    "a, b, c are read as KUKA's angles: a about z, b about the new y, c about the new x. Where a is about x, name them "
    "roll, pitch, yaw, or say maker="
)

AS_VECTOR = (
    "rx, ry, rz are read as a rotation vector, in degrees. Where they are three angles, say maker='Yaskawa' (about the "
    "fixed x, y, z) or maker='Staubli' (about x, the new y, the new z)"
)

ALLOWED = {"units": ("m", "cm", "mm", "um", "in"), "angles": ("rad", "deg")}
SCALES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "rad": 1.0, "deg": np.pi / 180}

PATHS = ("path", "seam", "operation")
"""Names of a column that says to which path a row belongs."""

_SPEED = re.compile(r"\s*(?:speed|feed|feedrate)\s*[_ ]?\s*[\[(]?\s*(m|mm|in)[/_ ](s|min)\s*[\])]?\s*")
"""A column of speeds, by its name and unit: speed_mm_s, "feed [mm/min]"."""

FAR = 20.0
"""Coordinates [m] beyond which metres are doubted: no robot reaches so far, and a workpiece of 20 mm is a small one."""

NEAR = 2e-3
"""Coordinates [m] below which millimetres are doubted."""

FULL = 2 * np.pi * 1.001
"""Angles [rad] beyond which radians are doubted, unless an argument says them."""

_MEANT = {*POSITION, *MATRIX, *chain(*NAMED.values(), *NUMBERED)}

_NAME = re.compile(r"\s*([a-z]+\d{0,2})\s*[_ ]?\s*[\[(]?\s*(mm|cm|um|m|inch|in|deg|rad|)\s*[\])]?\s*")
"""A column's name and the unit at its end: x_mm, x [mm], x(mm), roll_deg."""


@dataclass(frozen=True)
class Units:
    """What the caller says of a file; None where its header must say it.

    With `assumed` a header that does not say it means metres and radians; q1 to q4 are no quaternion then, and times
    are left out. Columns that `ignore` names, or fits with a *, are not there. `columns` names
    those of a file without a header. `maker` says whose angles they are, `into` whether axes i, j, k point into the
    work, as the tool's z axis does. `place` is what messages call a row.
    """

    units: str | None
    angles: str | None
    order: str | None
    assumed: bool
    ignore: tuple[str, ...] = ()
    place: str = "line"
    columns: tuple[str, ...] | None = None
    maker: str | None = None
    into: bool | None = None

    def __post_init__(self) -> None:
        known = {"units": ("m", "mm", "in"), "angles": ("rad", "deg"), "order": tuple(ORDERS), "maker": tuple(MAKERS)}
        for what, choices in known.items():
            value = getattr(self, what)
            if value is not None and value not in choices:
                raise ArgumentError(what, value, f"use one of {', '.join(choices)}")


@dataclass
class PoseRows:
    """Points [m] (k, 3), rotations (k, 3, 3) or axes (k, 3), times [s] (k,) and speeds [m/s] (k,) where there are, the
    line of each, and the name of its path."""

    points: Matrix
    rotations: Array | None
    times: Vector | None
    lines: Indices
    notes: list[str]
    axes: Matrix | None = None
    speeds: Vector | None = None
    names: Sequence[str] = ()


@dataclass
class PoseColumns:
    """Where a file has position, orientation and time, and what turns each column into SI units."""

    position: list[int]
    orientation: list[int]
    kind: str
    time: TimeColumns | None
    scales: Vector
    speed: tuple[int, float] | None = None
    path: int | None = None

    @property
    def wanted(self) -> list[int]:
        """All columns of numbers that are read, in this order."""
        speed = () if self.speed is None else self.speed[:1]
        return [*self.position, *self.orientation, *(self.time.places if self.time else ()), *speed]


def pose_rows(file: Path, noun: str, units: Units) -> PoseRows:
    """The points or poses of a CSV file, a `noun` a line.

    Raises:
        FileError: no such file, unreadable; missing columns, no unit; text or NaN in a cell, with line and column;
            values that look like another unit; quaternions that are not of unit length, matrices that do not rotate.
    """
    if is_folder(file):
        raise FileError(file, "is a folder", f"give a CSV file of {noun}s")
    chosen: list[PoseColumns] = []
    labels: list[int] = []
    used: list[int] = []

    def wanted(header: Sequence[str]) -> list[int]:
        if units.columns is not None and not used:
            raise FileError(file, f"has a header, {listed(header)}", "leave out columns=")
        chosen.append(columns_of_poses(file, header, units))
        labels.extend([] if chosen[0].path is None else [chosen[0].path])
        return chosen[0].wanted

    def named(cells: Sequence[str]) -> list[str]:
        names = [*(units.columns or ())]
        used.append(len(names))
        if len(names) != len(cells):
            fact = f"has {len(cells)} cells in its first line"
            raise FileError(file, fact, f"name as many columns; columns= has {len(names)}")
        return names

    headless = None if units.columns is None else named
    example = "x_mm, y_mm, z_mm" if units.assumed else "x_mm, y_mm, z_mm, in its first line or by columns="
    pieces = [
        *read_table(file, wanted, f"give a {noun} a line", example, headless=headless, labels=labels, remarks=True)
    ]
    if not pieces:
        raise FileError(file, f"has a header but no {noun}s", f"give a {noun} a line")
    lines = np.concatenate([piece.lines for piece in pieces])
    rows = poses_of(file, chosen[0], np.vstack([piece.table for piece in pieces]), lines, units)
    rows.names = [name for piece in pieces for (name,) in piece.labels]
    return rows


def poses_of(file: Path, columns: PoseColumns, values: Matrix, lines: Indices, units: Units) -> PoseRows:
    """The points or poses of values (k, c) of the columns `wanted`, in SI units. Raises: FileError."""
    table = values[:, : len(columns.scales)] * columns.scales
    notes: list[str] = []
    points, turned = table[:, :3], table[:, 3 : 3 + len(columns.orientation)]
    size = np.abs(points).max(axis=1)
    if size.max() > FAR:
        i = int(np.argmax(size > FAR))
        fact = f"{units.place} {lines[i]} has a coordinate of {size[i]:g} m: this looks like millimetres"
        raise FileError(file, fact, "say units='mm', or name the columns x_mm, y_mm, z_mm")
    if columns.scales[0] == SCALES["mm"] and size.max() < NEAR:
        notes.append(f"no coordinate is beyond {1e3 * size.max():.3g} mm: are they metres?")
    along = columns.kind in AXES
    axes = _axes(file, turned, lines, units, notes) if along else None
    rotations = _rotations(file, columns.kind, turned, lines, units, notes) if columns.kind and not along else None
    if columns.kind == "KUKA" and units.maker is None:
        notes.append(AS_KUKA)
    if columns.kind == "vector" and columns.scales[3] != 1.0 and units.maker is None:
        notes.append(AS_VECTOR)
    times = _seconds(file, columns.time, values[:, len(columns.scales) :], notes) if columns.time else None
    speeds = None if columns.speed is None else _speeds(file, values[:, -1] * columns.speed[1], lines, units)
    return PoseRows(points, rotations, times, lines, notes, axes, speeds)


def _speeds(file: Path, speeds: Vector, lines: Indices, units: Units) -> Vector:
    """Raises: FileError: one that is not above 0."""
    if not speeds.min() > 0:
        i = int(np.argmin(speeds > 0))
        raise FileError(file, f"{units.place} {lines[i]} has a speed of {speeds[i]:g} m/s", "give one above 0")
    return speeds


def _axes(file: Path, vectors: Matrix, lines: Indices, units: Units, notes: list[str]) -> Matrix:
    """Directions (k, 3) of the tool's z axis. Raises: FileError: one that is not of unit length."""
    with np.errstate(over="ignore"):
        length = np.linalg.norm(vectors, axis=1)
    if not np.abs(length - 1).max() <= UNIT:
        i = int(np.argmax(np.abs(length - 1) > UNIT))
        fact = f"{units.place} {lines[i]} has a tool axis of length {length[i]:.6g}"
        raise FileError(file, fact, "give directions of length 1")
    if units.into is None:
        notes.append(
            "the columns of the tool axis are read as the direction in which the tool's z axis points, into the work; "
            "say axis='out' where they point out of it"
        )
    return vectors / length[:, None] * (-1.0 if units.into is False else 1.0)


def _seconds(file: Path, columns: TimeColumns, values: Matrix, notes: list[str]) -> Vector:
    """Times [s] of the time columns (k, 1) or (k, 2); Unix time from the first on."""
    t = values[:, 0]
    unit = "s" if columns.split else columns.unit or unit_of(file, t, steady=False)
    since = (t - t[0]) * UNITS[unit] + (1e-9 * (values[:, 1] - values[0, 1]) if columns.split else 0.0)
    first = t[0] * UNITS[unit] + (1e-9 * values[0, 1] if columns.split else 0.0)
    if columns.unit is None and unit != "s":
        notes.append(f"times read as {WORDS[unit]}")
    return since if abs(first) > 1e6 else since + first


def columns_of_poses(file: Path, header: Sequence[str], units: Units) -> PoseColumns:
    """Which columns of a header hold points or poses. Raises: FileError."""
    first, last = COVERAGE
    if tuple(header[: len(first)]) == first and tuple(header[-len(last) :]) == last:
        header = header[: len(POSITION) + 4]
    left = _ignored(header, units.ignore)
    # Columns whose names are known, with the unit that stands in the name.
    known: dict[str, tuple[int, str]] = {}
    for i, name in enumerate(header):
        match = _NAME.fullmatch(name.lower())
        if match is None or i in left:
            continue
        if match[1] in known and match[1] in _MEANT:
            raise FileError(file, f"its header has 2 columns {match[1]!r}", "keep or name one of them")
        known[match[1]] = (i, match[2])
    # Positions and orientations, and by what they are multiplied for SI units.
    matrix = all(name in known for name in MATRIX)
    where = MATRIX[3::4] if matrix else POSITION
    missing = [name for name in where if name not in known]
    if missing:
        cure = f"name the columns x_mm, y_mm, z_mm or x, y, z; they are {listed(header)}"
        raise FileError(file, f"has no column {', '.join(missing)}", cure)
    otherwise = ("m", "rad") if units.assumed else (None, None)
    scales = _scales(file, known, where, "units", units.units, otherwise[0])
    kind, names = (
        ("matrix", tuple(n for n in MATRIX if n not in where)) if matrix else _orientation(file, known, header, units)
    )
    if kind in EULER or kind == "vector":
        scales += _scales(file, known, names, "angles", units.angles, otherwise[1])
    else:
        if units.angles is not None:
            raise FileError(file, "has no angles", "leave out angles=")
        scales += [1.0] * len(names)
    # Times, speeds and names of paths; a column of which nothing is known is refused.
    places = {name: place for name, (place, _) in known.items()}
    read = {places[name] for name in (*where, *names)}
    time = time_columns(["" if i in left | read else name for i, name in enumerate(header)], prefixes=False)
    speed, path = _speed_and_path(header, left, units)
    read |= {*(time.places if time else ()), *(speed or ())[:1], *([] if path is None else [path])}
    passed = {places[name] for name in LAST_ROW * matrix if name in places}
    for i, name in enumerate(header):
        if i not in read | passed | left and name.lower() not in REMARKS:
            fact = (
                f"its column {shown(name)!r} is neither a position, nor an orientation, a time or a speed with its unit"
            )
            cure = f"delete it, or leave it out on purpose with ignore={[shown(name)]}"
            raise FileError(file, fact, cure)
    if units.assumed:
        time = speed = path = None
    if time is not None and speed is not None:
        names = [header[time.places[0]], header[speed[0]]]
        cure = f"leave one of them out, as in ignore={[shown(names[1])]}"
        raise FileError(file, f"has times and speeds, {listed(names)}", cure)
    found = [places[n] for n in where], [places[n] for n in names]
    return PoseColumns(*found, kind, time, np.array(scales), speed, path)


def _speed_and_path(header: Sequence[str], left: set[int], units: Units) -> tuple[tuple[int, float] | None, int | None]:
    """((column of speeds, what makes m/s of them), column of the names of paths), None where there is none."""
    speed, path = None, None
    for i, name in enumerate(header):
        match = None if i in left else _SPEED.fullmatch(name.lower())
        if match is not None and speed is None:
            speed = i, SCALES[match[1]] / (60.0 if match[2] == "min" else 1.0)
        if i not in left and path is None and name.lower().strip() in PATHS:
            path = i
    return speed, path


def _ignored(header: Sequence[str], patterns: Sequence[str]) -> set[int]:
    """The places of the columns to leave out. Raises: ArgumentError: one that is not there."""
    left: set[int] = set()
    for pattern in patterns:
        fits = {i for i, name in enumerate(header) if fnmatch(name.lower(), pattern.strip().lower())}
        if not fits:
            raise ArgumentError("ignore", pattern, f"there is no such column; they are {listed(header)}")
        left |= fits
    return left


def _orientation(
    file: Path, known: Mapping[str, object], header: Sequence[str], units: Units
) -> tuple[str, tuple[str, ...]]:
    """(kind, names of the columns) of the orientation; ("", ()) where there is none."""
    there = [(kind, names) for kind, names in NAMED.items() if all(name in known for name in names)]
    if units.maker is not None and len(there) == 1:
        there = [(_of_maker(file, there[0][0], units.maker), there[0][1])]
    if not there and (units.order is not None or not units.assumed):
        there = [("numbered", names) for names in NUMBERED if all(name in known for name in names)]
    if len(there) > 1:
        fact = f"its columns hold more than one orientation: {listed(there[0][1])} and {listed(there[1][1])}"
        raise FileError(file, fact, "keep one of them")
    if not there:
        some = [n for names in (*NAMED.values(), MATRIX, *([] if units.assumed else NUMBERED)) for n in names]
        some = [n for n in some if n in known and n not in TIMES]
        if some:
            fact = f"its column {some[0]!r} alone is no orientation"
            cure = (
                f"name qx, qy, qz, qw, or roll, pitch, yaw, or i, j, k, or as a maker does; they are {listed(header)}"
            )
            raise FileError(file, fact, cure)
        if units.maker is not None:
            raise FileError(file, "has no angles", "leave out maker=")
        if units.order is not None:
            raise FileError(file, "has no quaternions", "leave out order=")
        return "", ()
    kind, names = there[0]
    if kind == "numbered" and units.order is None:
        fact = f"its columns {', '.join(names)} do not say which number is the scalar"
        raise FileError(file, fact, "say order='xyzw' or order='wxyz', or name them qx, qy, qz, qw")
    if kind != "numbered" and units.order is not None:
        raise FileError(file, f"names its columns {', '.join(names)}", "leave out order=")
    return kind, names


def _of_maker(file: Path, kind: str, maker: str) -> str:
    """The kind of the angles of a maker. Raises: FileError: its columns are not named as this maker does."""
    if maker not in OF_MAKERS.get(kind, (kind,)):
        fact = f"names its columns {', '.join(NAMED[kind])}"
        raise FileError(file, fact, f"leave out maker={maker!r}, or name them as it does")
    return "vector" if maker == "UR" else maker


def _scales(
    file: Path,
    known: Mapping[str, tuple[int, str]],
    names: Sequence[str],
    argument: str,
    given: str | None,
    otherwise: str | None,
) -> list[float]:
    """What makes SI units of columns: by the unit in each name, or the given one, or what is taken otherwise."""
    out = []
    allowed = ALLOWED[argument]
    written = {unit for name in names if (unit := known[name][1].removesuffix("ch")) in allowed}
    if len(written) > 1:
        fact = f"mixes units: {', '.join(f'{name!r} is in {known[name][1] or given}' for name in names)}"
        raise FileError(file, fact, "give them in one unit")
    for name in names:
        unit = known[name][1].removesuffix("ch")
        if unit and unit not in allowed:
            fact = f"its column {name!r} is in {unit}"
            raise FileError(file, fact, f"give it in {' or '.join(allowed)}")
        if unit and given is not None and unit != given:
            cure = f"leave out {argument}=, or correct the header"
            raise FileError(file, f"its header says {unit} for {name!r}, and you {given}", cure)
        assumed = unit or given or otherwise
        if assumed is None:
            small, plain = ("mm", "m") if argument == "units" else ("deg", "rad")
            cure = f"say {argument}='{small}' or {argument}='{plain}', or put the unit into the header: {name}_{small}"
            raise FileError(file, f"does not say in which unit {name!r} is", cure)
        out.append(SCALES[assumed])
    return out


def _rotations(file: Path, kind: str, values: Matrix, lines: Indices, units: Units, notes: list[str]) -> Array:
    from scipy.spatial.transform import Rotation

    # Matrices are rotations, or refused.
    if kind == "matrix":
        matrices = values.reshape(-1, 3, 3)
        for line, R in zip(lines, matrices, strict=True):
            if not rotation_gap(R) < ROTATION:
                raise FileError(file, f"{units.place} {line} has no rotation", rotation_cure(R))
        return matrices
    # Quaternions have length 1; one that changes its sign is noted.
    if kind in ("quaternion", "numbered"):
        values = values[:, ORDERS[units.order or "xyzw"]]
        off = np.abs(np.linalg.norm(values, axis=1) - 1)
        if (off > UNIT).any():
            i, more = int(np.argmax(off > UNIT)), int((off > UNIT).sum()) - 1
            fact = f"{units.place} {lines[i]} has a quaternion of length {np.linalg.norm(values[i]):.6g}"
            fact += f", and {more} {units.place}s after it" if more else ""
            cure = "give unit quaternions, qw the scalar"
            raise FileError(file, f"{fact}, {off[i]:.2g} away from 1", cure)
        flips = np.flatnonzero(np.sum(values[1:] * values[:-1], axis=1) < 0) + 1
        if flips.size:
            where = ", ".join(str(lines[i]) for i in flips[:5]) + (", ..." if flips.size > 5 else "")
            many = f"{flips.size} quaternion{'s change' if flips.size > 1 else ' changes'}"
            notes.append(f"{many} sign ({units.place} {where}): read as the rotation that it is, by the shorter way")
        return Rotation.from_quat(values).as_matrix()
    # Angles and rotation vectors are of at most a turn.
    far = np.abs(values).max(axis=1) > FULL
    if far.any() and units.angles != "rad":
        i = int(np.argmax(far))
        fact = f"{units.place} {lines[i]} has an angle of {np.abs(values[i]).max():g} rad, over a turn: "
        fact += "it looks like degrees"
        raise FileError(file, fact, "say angles='deg', or name the columns so, as in roll_deg")
    if kind == "vector":
        return Rotation.from_rotvec(values).as_matrix()
    return Rotation.from_euler(EULER[kind], values).as_matrix()
