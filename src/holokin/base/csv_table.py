"""Reads tables of numbers from CSV files, a piece at a time: the text of a long one is never in memory as a whole."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterator, Sequence
from itertools import chain, islice
from math import isfinite
from pathlib import Path
from typing import NamedTuple, TextIO

import numpy as np

from .errors import RecordingError
from .given_files import shown
from .types import Matrix

PIECE = 10_000
"""Rows that are text at one time: some megabytes."""

_COMMA, _POINT = re.compile(r"(?<=\d),(?=\d)"), re.compile(r"\d\.\d")
"""Decimal marks."""

_NUMBERS = re.compile(r"[-+.,;\s\deE]*")
"""A line without names."""

LONGEST_LINE = 1_000_000
"""Characters of a line; a file with a longer one is no table, and may be gigabytes of one line."""


def read_table(
    file: Path, wanted: Callable[[Sequence[str]], Sequence[int]], cure: str, names: str, *,
    headless: Callable[[Sequence[str]], list[str]] | None = None, bad: list[RecordingError] | None = None,
    labels: Sequence[int] = (),
) -> Iterator[Rows]:  # fmt: skip
    """Some rows of a CSV file at a time: the wanted columns as finite numbers, the first of them as text, the lines.

    Args:
        wanted: the columns that are read, of the header's names.
        labels: columns whose text is wanted too; `wanted` may fill it.
        cure: for a file without a header or rows. names: of the columns that it should have.
        headless: names the columns of a file whose first line holds numbers, by this line; None refuses such a file.
        bad: gets the error of each row that cannot be read, and the row is left out; None raises it.

    Raises:
        RecordingError: it cannot be read, has no header, or a cell that is no finite number.
    """
    try:
        with file.open(newline="", encoding="utf-8-sig") as stream:
            first, lines, done = _from_header(_lines(file, stream))
            delimiter = _delimiter(first)
            if delimiter not in first and '"' not in first and len(first.split()) > 1:  # as UR's RTDE client writes it
                delimiter, first = ",", ",".join(first.split())
                lines = (",".join(line.split()) + "\n" for line in lines)
            plain = first if delimiter == "," else _COMMA.sub(".", first)
            cells = next(csv.reader([plain], delimiter=delimiter), [])
            header = [cell.strip().strip("#").strip() for cell in cells]
            if not any(header):
                raise RecordingError(file, f"line {done} is empty, no header" if first else "is empty", cure)
            if number_in(header[0]) is not None:
                if headless is None:
                    fact = f"line {done} holds numbers, no header"
                    raise RecordingError(file, fact, f"name the columns: {names}")
                header, lines, done = headless([cell.strip() for cell in cells]), chain([first], lines), done - 1
            if delimiter != ",":
                lines = _with_points(file, lines, done)
            columns = _told_apart(file, header, wanted(header))
            yield from _pieces(file, header, columns, lines, delimiter, done, bad, labels)
    except (OSError, UnicodeError, csv.Error) as problem:
        fact = f"cannot be read as text ({shown(str(problem), 200)})"
        raise RecordingError(file, fact, "give a CSV file in UTF-8, a bag or .mcap") from None


def _from_header(lines: Iterator[str]) -> tuple[str, Iterator[str], int]:
    """(the header, the lines after it, the header's number): comments, from # on, and empty lines may stand before it.

    A comment is the header where no other line is: numbers follow, and it has as many cells as they.
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
        if holds_numbers and "#" in comment and (not line or cells == comment.count(mark)):
            return comment, chain(before[i + 1 :], [line] * bool(line), lines), i + 1
    return line, lines, len(before) + 1


def _delimiter(line: str) -> str:
    """What ends the cells of a line: the most frequent mark; of numbers alone a comma may be a decimal mark."""
    return max(";\t" if _NUMBERS.fullmatch(line) and re.search("[;\t]", line) else ",;\t", key=line.count)


def _with_points(file: Path, lines: Iterator[str], done: int) -> Iterator[str]:
    """Lines whose cells no comma ends, with points for decimal commas. Raises: RecordingError: the lines have both."""
    comma = point = 0
    for number, line in enumerate(lines, done + 1):
        if not point and "." in line and not line.startswith("#") and _POINT.search(line):
            point = number
        if "," in line and not line.startswith("#"):
            line, count = _COMMA.subn(".", line)
            comma = comma or number * bool(count)
        if comma and point:
            fact = f"line {comma} has a decimal comma, line {point} a decimal point"
            raise RecordingError(file, fact, "write all decimals with points, and no commas between thousands")
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
    file: Path, header: Sequence[str], wanted: Sequence[int], lines: Iterator[str], delimiter: str, done: int,
    bad: list[RecordingError] | None, labels: Sequence[int],
) -> Iterator[Rows]:  # fmt: skip
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
            kept, numbers = _row_numbers(file, header, wanted, some, bad)
            if kept:
                texts = [row[wanted[0]].strip() for _, row in kept]
                words = _labels([row for _, row in kept], labels) if labels else []
                yield Rows(np.array(numbers), texts, [line for line, _ in kept], words)
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
    file: Path, header: Sequence[str], wanted: Sequence[int], rows: Sequence[tuple[int, list[str]]],
    bad: list[RecordingError] | None,
) -> tuple[list[tuple[int, list[str]]], list[list[float]]]:  # fmt: skip
    """(the rows, their wanted columns), cell by cell. Raises: RecordingError: one cannot be read, and `bad` is None."""
    kept, numbers = [], []
    for line, row in rows:
        try:
            numbers.append(_row(file, header, wanted, line, row))
        except RecordingError as problem:
            if bad is None:
                raise
            bad.append(problem)
        else:
            kept.append((line, row))
    return kept, numbers


def _row(file: Path, header: Sequence[str], wanted: Sequence[int], line: int, row: Sequence[str]) -> list[float]:
    """The wanted columns of a row. Raises: RecordingError: one is no finite number; the row is too long or short."""
    lengths = f"cells, the header {len(header)}"
    if len(row) > len(header) and any(cell.strip() for cell in row[len(header) :]):
        cure = "delete what is too much; write decimals with a point, not a comma"
        raise RecordingError(file, f"line {line} has {len(row)} {lengths}", cure)
    found = []
    for c in wanted:
        if c >= len(row):
            raise RecordingError(file, f"line {line} has {len(row)} {lengths}", "complete or delete the line")
        number = number_in(row[c])
        if number is None or not isfinite(number):
            fact = f"line {line}, column {shown(header[c])!r} holds {shown(row[c].strip())!r}, not a finite number"
            comma = _COMMA.search(row[c])
            raise RecordingError(file, fact, "write decimals with points" if comma else "correct or delete the line")
        found.append(number)
    return found
