"""Times in CSV files: which columns hold them, and their unit, told by the header or by the size of the stamps."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .errors import RecordingError
from .given_files import listed
from .types import Vector

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
    "s": "s", "sec": "s", "secs": "s", "second": "s", "seconds": "s", "ms": "ms", "msec": "ms", "msecs": "ms",
    "millis": "ms", "milliseconds": "ms", "us": "us", "µs": "us", "μs": "us", "usec": "us", "usecs": "us",
    "micros": "us", "microseconds": "us", "ns": "ns", "nsec": "ns", "nsecs": "ns", "nanos": "ns", "nanosec": "ns",
    "nanosecs": "ns", "nanoseconds": "ns",
}  # fmt: skip
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
        RecordingError: whole stamps whose step could have two units.
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
        raise RecordingError(file, fact, "name the unit in the header, as in t_ms, t_us or t_ns")
    return unit


def no_time(file: Path, header: Sequence[str]) -> RecordingError:
    """The refusal of a header without a time."""
    cure = f"name the column of times one of {', '.join(TIMES)}, with a unit as in t_ms; the columns are"
    return RecordingError(file, "there is no time column", f"{cure} {listed(header)}")
