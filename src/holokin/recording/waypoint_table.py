"""`read_waypoints`: points or poses of the tool from a CSV file, with the units that it declares."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from ..arguments import typed
from ..errors import ArgumentError, RecordingError
from ..path import Waypoints
from ..types import Array, Indices, Matrix, Vector
from .csv_log import csv_pieces
from .log import listed
from .pose_table import ANGLES, POSITION, QUATERNION, quaternion_rotations
from .reading import is_folder

VECTOR = ("rx", "ry", "rz")
NUMBERED = (("q1", "q2", "q3", "q4"), ("q0", "q1", "q2", "q3"))
TIMES = ("t", "time")
ORDERS = {"xyzw": (0, 1, 2, 3), "wxyz": (1, 2, 3, 0)}
"""Of a quaternion's numbers -> where x, y, z and w are among them."""

SCALES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "rad": 1.0, "deg": np.pi / 180, "s": 1.0, "ms": 1e-3}

FAR = 20.0
"""Coordinates [m] beyond which metres are doubted: no robot reaches so far, and a workpiece of 20 mm is a small one."""

NEAR = 2e-3
"""Coordinates [m] below which millimetres are doubted."""

FULL = 2 * np.pi * 1.001
"""Angles [rad] beyond which radians are doubted."""

WIDE = np.deg2rad(170)
"""Turns [rad] from one waypoint to the next beyond which the shorter way round may not be the one that was meant."""

_NAME = re.compile(r"\s*([a-z]+\d?)\s*[_ ]?\s*[\[(]?\s*(mm|cm|um|ms|m|s|deg|rad|)\s*[\])]?\s*")
"""A column's name and the unit at its end: x_mm, x [mm], x(mm), roll_deg, t."""


@dataclass
class _Columns:
    """Where a file has position, orientation and time, and what turns each column into SI units."""

    position: list[int]
    orientation: list[int]
    kind: str
    time: list[int]
    scales: Vector

    @property
    def wanted(self) -> list[int]:
        """All columns that are read, in this order."""
        return [*self.position, *self.orientation, *self.time]


@typed
def read_waypoints(
    path: str | Path,
    *,
    units: Literal["m", "mm"] | None = None,
    angles: Literal["rad", "deg"] | None = None,
    order: Literal["xyzw", "wxyz"] | None = None,
) -> Waypoints:
    """Waypoints of the tool from a CSV file, a line each; `hk.spline` and `hk.polyline` lead a path through them.

    The header names the columns, in any order, others are left out: x, y, z; for the orientation, if there is one, qx,
    qy, qz, qw, or q1 to q4 or q0 to q3 with their `order`, or roll, pitch, yaw (about the axes x, y, z of the frame, in
    this order), or rx, ry, rz, a rotation vector; for the time, if there is one, t or time [s]. A unit may stand at the
    end of a name: x_mm, roll_deg, t_ms, "x [mm]".

    Args:
        units: of x, y, z where the header names none. Nobody guesses: one of the two must say it.
        angles: of roll, pitch, yaw and of rotation vectors, likewise.
        order: of the numbers of a quaternion in columns q1 to q4 or q0 to q3.

    Returns:
        Waypoints whose `notes` say what was repaired, and what looks odd.

    Raises:
        RecordingError: no such file, unreadable; missing columns, no unit; text or NaN in a cell, with line and column;
            values that look like another unit; quaternions that are not of unit length; times that do not rise.
    """
    file = Path(path)
    choices = {"units": (units, ("m", "mm")), "angles": (angles, ("rad", "deg")), "order": (order, tuple(ORDERS))}
    for what, (value, known) in choices.items():
        if value is not None and value not in known:
            raise ArgumentError(what, value, f"use one of {', '.join(known)}")
    if is_folder(file):
        raise RecordingError(file, "is a folder", "give a CSV file of waypoints")
    chosen: list[_Columns] = []

    def wanted(header: Sequence[str]) -> list[int]:
        chosen.append(_columns(file, header, units, angles, order))
        return chosen[0].wanted

    pieces = csv_pieces(file, wanted, "give a waypoint a line", "x_mm, y_mm, z_mm")
    found = [(table, places) for table, _, places in pieces]
    if not found:
        raise RecordingError(file, "has a header but no waypoints", "give a waypoint a line")
    lines = np.concatenate([places for _, places in found])
    columns = chosen[0]
    table = np.vstack([rows for rows, _ in found]) * columns.scales
    if len(table) < 2:
        raise RecordingError(file, "has one waypoint", "give two at least")
    notes: list[str] = []
    points = table[:, :3]
    _check_lengths(file, points, lines, notes, columns.scales[0])
    rotations = _rotations(file, columns.kind, table[:, 3 : 3 + len(columns.orientation)], lines, order, notes)
    times = _times(file, table[:, -1], lines) if columns.time else None
    _check_rests(file, points, rotations, times, lines)
    return Waypoints(points, rotations, times, str(file), tuple(notes))


def _columns(file: Path, header: Sequence[str], units: str | None, angles: str | None, order: str | None) -> _Columns:
    known: dict[str, tuple[int, str]] = {}
    for i, name in enumerate(header):
        match = _NAME.fullmatch(name.lower())
        if match is None:
            continue
        if match[1] in known:
            raise RecordingError(file, f"two columns are called {match[1]!r}", "keep or name one of them")
        known[match[1]] = (i, match[2])
    missing = [name for name in POSITION if name not in known]
    if missing:
        cure = f"name the columns x_mm, y_mm, z_mm or x, y, z; they are {listed(header)}"
        raise RecordingError(file, f"has no column {', '.join(missing)}", cure)
    scales = _scales(file, known, POSITION, units, ("m", "cm", "mm", "um"), "units='mm' or units='m'", "x_mm")
    kind, names = _orientation(file, known, header, order)
    if kind in ("angles", "vector"):
        scales += _scales(file, known, names, angles, ("rad", "deg"), "angles='deg' or angles='rad'", f"{names[0]}_deg")
    else:
        if angles is not None:
            raise RecordingError(file, "has no angles", "leave out angles=")
        scales += [1.0] * len(names)
    time = [name for name in TIMES if name in known]
    if len(time) > 1:
        raise RecordingError(file, "has columns t and time", "keep one of them")
    scales += _scales(file, known, time, "s", ("s", "ms"), "seconds", "t_s", declared=False)
    places = {name: place for name, (place, _) in known.items()}
    return _Columns(
        [places[n] for n in POSITION], [places[n] for n in names], kind, [places[n] for n in time], np.array(scales)
    )


def _orientation(
    file: Path, known: Mapping[str, object], header: Sequence[str], order: str | None
) -> tuple[str, tuple[str, ...]]:
    """(kind, names of the columns) of the orientation; ("", ()) where there is none."""
    kinds = {"quaternion": [QUATERNION], "numbered": list(NUMBERED), "angles": [ANGLES], "vector": [VECTOR]}
    there = [(kind, names) for kind, sets in kinds.items() for names in sets if all(name in known for name in names)]
    if len(there) > 1:
        fact = f"its columns hold more than one orientation: {listed(there[0][1])} and {listed(there[1][1])}"
        raise RecordingError(file, fact, "keep one of them")
    if not there:
        some = [n for sets in kinds.values() for names in sets for n in names if n in known]
        if some:
            fact = f"its column {some[0]!r} alone is no orientation"
            cure = f"name qx, qy, qz, qw, or roll, pitch, yaw, or rx, ry, rz; the columns are {listed(header)}"
            raise RecordingError(file, fact, cure)
        if order is not None:
            raise RecordingError(file, "has no quaternions", "leave out order=")
        return "", ()
    kind, names = there[0]
    if kind == "numbered" and order is None:
        fact = f"its columns {', '.join(names)} do not say which number is the scalar"
        raise RecordingError(file, fact, "say order='xyzw' or order='wxyz', or name them qx, qy, qz, qw")
    if kind != "numbered" and order is not None:
        raise RecordingError(file, f"names its columns {', '.join(names)}", "leave out order=")
    return kind, names


def _scales(
    file: Path, known: Mapping[str, tuple[int, str]], names: Sequence[str], given: str | None, allowed: Sequence[str],
    argument: str, example: str, declared: bool = True,
) -> list[float]:  # fmt: skip
    """What makes SI units of columns, by the unit in each name, or the given one."""
    out = []
    for name in names:
        unit = known[name][1]
        if unit and unit not in allowed:
            fact = f"its column {name!r} is in {unit}"
            raise RecordingError(file, fact, f"give it in {' or '.join(allowed)}")
        if unit and declared and given is not None and unit != given:
            cure = f"leave out {argument.partition('=')[0]}=, or correct the header"
            raise RecordingError(file, f"its header says {unit} for {name!r}, and you {given}", cure)
        if not unit and given is None:
            cure = f"say {argument}, or put the unit into the header, as in {example}"
            raise RecordingError(file, f"does not say in which unit {name!r} is", cure)
        out.append(SCALES[unit or str(given)])
    return out


def _check_lengths(file: Path, points: Matrix, lines: Indices, notes: list[str], scale: float) -> None:
    size = np.abs(points).max(axis=1)
    if size.max() > FAR:
        i = int(np.argmax(size > FAR))
        fact = f"line {lines[i]} has a coordinate of {size[i]:g} m: this looks like millimetres"
        raise RecordingError(file, fact, "say units='mm', or name the columns x_mm, y_mm, z_mm")
    if scale == SCALES["mm"] and size.max() < NEAR:
        notes.append(f"no coordinate is beyond {1e3 * size.max():.3g} mm: are they metres?")


def _rotations(
    file: Path, kind: str, values: Matrix, lines: Indices, order: str | None, notes: list[str]
) -> Array | None:
    from scipy.spatial.transform import Rotation

    if not kind:
        return None
    if kind in ("quaternion", "numbered"):
        values = values[:, ORDERS[order or "xyzw"]]
        rotations = quaternion_rotations(file, values, lines)
        flips = np.flatnonzero(np.sum(values[1:] * values[:-1], axis=1) < 0) + 1
        if flips.size:
            where = ", ".join(str(lines[i]) for i in flips[:5]) + (", ..." if flips.size > 5 else "")
            many = f"{flips.size} quaternion{'s change' if flips.size > 1 else ' changes'}"
            notes.append(f"{many} sign (line {where}): read as the rotation that it is, by the shorter way")
    else:
        far = np.abs(values).max(axis=1) > FULL
        if far.any():
            i = int(np.argmax(far))
            fact = (
                f"line {lines[i]} has an angle of {np.abs(values[i]).max():g} rad, over a turn: it looks like degrees"
            )
            raise RecordingError(file, fact, "say angles='deg', or name the columns so, as in roll_deg")
        made = Rotation.from_euler("xyz", values) if kind == "angles" else Rotation.from_rotvec(values)
        rotations = made.as_matrix()
    turns = (Rotation.from_matrix(rotations[:-1]).inv() * Rotation.from_matrix(rotations[1:])).magnitude()
    if turns.max() > WIDE:
        i = int(np.argmax(turns))
        notes.append(
            f"from line {lines[i]} to line {lines[i + 1]} the tool turns by {np.degrees(turns[i]):.0f} degrees, by the "
            "shorter way: put a waypoint between if it is not meant"
        )
    return rotations


def _times(file: Path, t: Vector, lines: Indices) -> Vector:
    back = np.flatnonzero(np.diff(t) <= 0)
    if back.size:
        i = int(back[0])
        what = "stands still" if t[i + 1] == t[i] else "runs backward"
        fact = f"time {what} from line {lines[i]} ({t[i]:.9g} s) to line {lines[i + 1]} ({t[i + 1]:.9g} s)"
        raise RecordingError(file, fact, "give rising times in seconds")
    return t - t[0]


def _check_rests(file: Path, points: Matrix, rotations: Array | None, times: Vector | None, lines: Indices) -> None:
    """Raises: RecordingError: a waypoint repeats the one before, where no times say how long it rests there."""
    if times is not None:
        return
    same = (points[1:] == points[:-1]).all(axis=1)
    if rotations is not None:
        same &= (rotations[1:] == rotations[:-1]).all(axis=(1, 2))
    if same.any():
        i = int(np.argmax(same))
        raise RecordingError(
            file, f"line {lines[i + 1]} repeats line {lines[i]}", "delete it, or give a column t of times"
        )
