"""Reads joints over time from CSV files: their stamps, and joints in the robot's order."""

from __future__ import annotations

import re
from array import array
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..base.csv_table import read_table
from ..base.types import Matrix, Vector
from ..errors import RecordingError
from ..robot import Robot
from .headless import guessed, numbered
from .joint_columns import Columns, column_named, columns_named, joint_columns, plain_name, scale_of, time_column
from .log_samples import Samples

CURE = "log a header and at least two cycles"
_WHOLE = re.compile(r"[+-]?\d{1,19}")


def read_csv(
    file: Path, robot: Robot, columns: Columns | None = None, time: str | None = None, *, skip_bad: bool = False
) -> Samples:
    """The samples of a CSV file; columns and time name its columns, of a file without a header by their numbers.

    skip_bad: rows that cannot be read are left out and counted; else the first one is refused.

    Raises:
        RecordingError. UnknownNameError, ArgumentError: as `columns_named`.
    """
    times: list[int] = []
    notes: list[str] = []
    bad: list[RecordingError] | None = [] if skip_bad else None

    def headless(cells: Sequence[str]) -> list[str]:
        if columns is None and time is None:
            names, note = guessed(file, cells, robot)
            notes.append(note)
            return names
        first = "" if time is not None else "column 1 was taken for the time, "
        notes.append(f"no header: {first}columns by their numbers")
        return [*(["t"] if time is None else ["1"]), *numbered(cells)[1:]]

    scales: list[float] = []

    def wanted(names: Sequence[str]) -> list[int]:
        places = chosen(names)
        scales.extend(scale_of(names[place]) for place in places[len(times) :])
        return places

    def chosen(names: Sequence[str]) -> list[int]:
        header = [plain_name(name) for name in names]
        times.extend(time_column(file, header) if time is None else [column_named(file, header, time, "the time")])
        if columns is None:
            return [*times, *joint_columns(file, header, robot, robot.joint_names)]
        others = lambda joints: joint_columns(file, header, robot, joints)  # noqa: E731
        return [*times, *columns_named(file, header, robot, columns, others)]

    stamps: _Stamps | None = None
    q, numbers = array("d"), array("q")
    for table, texts, places in read_table(file, wanted, CURE, "t and the robot's joints", headless=headless, bad=bad):
        stamps = stamps or _Stamps(len(times) == 2)
        stamps.add(table[:, : len(times)], texts)
        q.frombytes((table[:, len(times) :] * scales).tobytes())
        numbers.extend(places)
    if stamps is None:
        raise RecordingError(file, "has a header but no samples", "log at least two cycles")
    if bad:
        rows = "1 row was" if len(bad) == 1 else f"{len(bad)} rows were"
        notes.append(f"{rows} left out that could not be read; the first: {bad[0].fact}")
    t, origin = stamps.seconds(file, notes)
    lines, said = np.frombuffer(numbers, dtype=np.int64), any(scale != 1.0 for scale in scales)
    return Samples(t, np.frombuffer(q).reshape(len(t), -1), "line", lines, notes, said, origin)


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

    def seconds(self, file: Path, notes: list[str]) -> tuple[Vector, float]:
        """(seconds since the first stamp, that stamp), or (seconds, 0.0) of small ones. Whole nanoseconds are told by
        their step; their differences are exact.
        """
        t = np.frombuffer(self.values)
        if self.split:
            return t, self.origin
        if self.whole and np.abs(t).max() < 2**62:  # no difference overflows
            ticks = np.frombuffer(self.ticks, dtype=np.int64)
            first = float(ticks[0])
            ticks = (ticks - ticks[0]).astype(float)
            step = float(np.median(np.abs(np.diff(ticks)))) if len(ticks) > 1 else 0.0
            if step >= 1e4:
                notes.append("stamps read as nanoseconds")
                return ticks * 1e-9, first * 1e-9
            if step > 5:
                fact = f"its whole-number stamps are {step:g} apart: neither seconds nor nanoseconds"
                raise RecordingError(file, fact, "give seconds, or whole nanoseconds")
        with np.errstate(over="ignore"):  # an infinite span is refused later, as all over three centuries
            return (t - t[0], float(t[0])) if abs(t[0]) > 1e6 else (t, 0.0)
