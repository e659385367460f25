"""The columns of a CSV file that hold points or poses of the tool: their names, units and forms of orientation."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase as fnmatch
from itertools import chain
from pathlib import Path

import numpy as np

from .csv_table import read_table
from .errors import ArgumentError, RecordingError
from .given_files import is_folder, listed, shown
from .poses import ORDERS, UNIT
from .time_columns import UNITS, WORDS, TimeColumns, time_columns, unit_of
from .types import ROTATION, Array, Indices, Matrix, Vector, rotation_cure, rotation_gap

POSITION = ("x", "y", "z")
MATRIX = tuple(f"t{row}{column}" for row in range(3) for column in range(4))
"""Columns of a pose as the first three rows of its matrix, counted from 0; a last row may stand there too."""

NAMED = {
    "quaternion": ("qx", "qy", "qz", "qw"), "angles": ("roll", "pitch", "yaw"), "vector": ("rx", "ry", "rz"),
    "KUKA": ("a", "b", "c"),
}  # fmt: skip
NUMBERED = (("q1", "q2", "q3", "q4"), ("q0", "q1", "q2", "q3"))
REMARKS = {"", "name", "label", "comment", "remark", "note", "id", "index", "number", "point", "line", "row"}
"""Columns that say nothing of a pose; a table that pandas wrote has one without a name."""

LAST_ROW = ("t30", "t31", "t32", "t33")

COVERAGE = (("x", "y", "z", "qx", "qy", "qz", "qw", "status"), ("rcond", "margin"))
"""How the header of a saved coverage begins and ends; between are the joints."""

AS_KUKA = (
    "a, b, c are read as KUKA's angles: a about z, b about the new y, c about the new x. Where a is about x, name them "
    "roll, pitch, yaw"
)

ALLOWED = {"units": ("m", "cm", "mm", "um"), "angles": ("rad", "deg")}
SCALES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "rad": 1.0, "deg": np.pi / 180}

FAR = 20.0
"""Coordinates [m] beyond which metres are doubted: no robot reaches so far, and a workpiece of 20 mm is a small one."""

NEAR = 2e-3
"""Coordinates [m] below which millimetres are doubted."""

FULL = 2 * np.pi * 1.001
"""Angles [rad] beyond which radians are doubted, unless an argument says them."""

_MEANT = {*POSITION, *MATRIX, *chain(*NAMED.values(), *NUMBERED)}

_NAME = re.compile(r"\s*([a-z]+\d{0,2})\s*[_ ]?\s*[\[(]?\s*(mm|cm|um|m|deg|rad|)\s*[\])]?\s*")
"""A column's name and the unit at its end: x_mm, x [mm], x(mm), roll_deg."""


@dataclass(frozen=True)
class Units:
    """What the caller says of a file; None where its header must say it.

    With `assumed` a header that does not say it means metres and radians; q1 to q4 are no quaternion then, and times
    are left out. Columns that `ignore` names, or fits with a *, are not there. `place` is what messages call a row.
    """

    units: str | None
    angles: str | None
    order: str | None
    assumed: bool
    ignore: tuple[str, ...] = ()
    place: str = "line"

    def __post_init__(self) -> None:
        known = {"units": ("m", "mm"), "angles": ("rad", "deg"), "order": tuple(ORDERS)}
        for what, choices in known.items():
            value = getattr(self, what)
            if value is not None and value not in choices:
                raise ArgumentError(what, value, f"use one of {', '.join(choices)}")


@dataclass
class PoseRows:
    """Points [m] (k, 3), rotations (k, 3, 3) and times [s] (k,) where there are, and the line of each."""

    points: Matrix
    rotations: Array | None
    times: Vector | None
    lines: Indices
    notes: list[str]


@dataclass
class PoseColumns:
    """Where a file has position, orientation and time, and what turns each column into SI units."""

    position: list[int]
    orientation: list[int]
    kind: str
    time: TimeColumns | None
    scales: Vector

    @property
    def wanted(self) -> list[int]:
        """All columns that are read, in this order."""
        return [*self.position, *self.orientation, *(self.time.places if self.time else ())]


def pose_rows(file: Path, noun: str, said: Units) -> PoseRows:
    """The points or poses of a CSV file, a `noun` a line.

    Raises:
        RecordingError: no such file, unreadable; missing columns, no unit; text or NaN in a cell, with line and column;
            values that look like another unit; quaternions that are not of unit length, matrices that do not rotate.
    """
    if is_folder(file):
        raise RecordingError(file, "is a folder", f"give a CSV file of {noun}s")
    chosen: list[PoseColumns] = []

    def wanted(header: Sequence[str]) -> list[int]:
        chosen.append(columns_of_poses(file, header, said))
        return chosen[0].wanted

    pieces = read_table(file, wanted, f"give a {noun} a line", "x_mm, y_mm, z_mm")
    found = [(piece.table, piece.lines) for piece in pieces]
    if not found:
        raise RecordingError(file, f"has a header but no {noun}s", f"give a {noun} a line")
    lines = np.concatenate([places for _, places in found])
    return poses_of(file, chosen[0], np.vstack([rows for rows, _ in found]), lines, said)


def poses_of(file: Path, columns: PoseColumns, values: Matrix, lines: Indices, said: Units) -> PoseRows:
    """The points or poses of values (k, c) of the columns `wanted`, in SI units. Raises: RecordingError."""
    table = values[:, : len(columns.scales)] * columns.scales
    notes: list[str] = []
    points, turned = table[:, :3], table[:, 3 : 3 + len(columns.orientation)]
    _check_lengths(file, points, lines, notes, columns.scales[0], said.place)
    rotations = _rotations(file, columns.kind, turned, lines, said, notes) if columns.kind else None
    if columns.kind == "KUKA":
        notes.append(AS_KUKA)
    times = _seconds(file, columns.time, values[:, len(columns.scales) :], notes) if columns.time else None
    return PoseRows(points, rotations, times, lines, notes)


def _seconds(file: Path, columns: TimeColumns, values: Matrix, notes: list[str]) -> Vector:
    """Times [s] of the time columns (k, 1) or (k, 2); Unix time from the first on."""
    t = values[:, 0]
    unit = "s" if columns.split else columns.unit or unit_of(file, t, steady=False)
    since = (t - t[0]) * UNITS[unit] + (1e-9 * (values[:, 1] - values[0, 1]) if columns.split else 0.0)
    first = t[0] * UNITS[unit] + (1e-9 * values[0, 1] if columns.split else 0.0)
    if columns.unit is None and unit != "s":
        notes.append(f"times read as {WORDS[unit]}")
    return since if abs(first) > 1e6 else since + first


def columns_of_poses(file: Path, header: Sequence[str], said: Units) -> PoseColumns:
    """Which columns of a header hold points or poses. Raises: RecordingError."""
    header = header[: len(POSITION) + 4] if _is_coverage(header) else header
    left = _ignored(header, said.ignore)
    known: dict[str, tuple[int, str]] = {}
    for i, name in enumerate(header):
        match = _NAME.fullmatch(name.lower())
        if match is None or i in left:
            continue
        if match[1] in known and match[1] in _MEANT:
            raise RecordingError(file, f"its header has 2 columns {match[1]!r}", "keep or name one of them")
        known[match[1]] = (i, match[2])
    matrix = all(name in known for name in MATRIX)
    where = MATRIX[3::4] if matrix else POSITION
    missing = [name for name in where if name not in known]
    if missing:
        cure = f"name the columns x_mm, y_mm, z_mm or x, y, z; they are {listed(header)}"
        raise RecordingError(file, f"has no column {', '.join(missing)}", cure)
    otherwise = ("m", "rad") if said.assumed else (None, None)
    scales = _scales(file, known, where, "units", said.units, otherwise[0])
    kind, names = (
        ("matrix", tuple(n for n in MATRIX if n not in where)) if matrix else _orientation(file, known, header, said)
    )
    if kind in ("angles", "vector", "KUKA"):
        scales += _scales(file, known, names, "angles", said.angles, otherwise[1])
    else:
        if said.angles is not None:
            raise RecordingError(file, "has no angles", "leave out angles=")
        scales += [1.0] * len(names)
    time = time_columns(["" if i in left else name for i, name in enumerate(header)], prefixes=False)
    places = {name: place for name, (place, _) in known.items()}
    read = {places[name] for name in (*where, *names)} | set(time.places if time else ())
    passed = {places[name] for name in LAST_ROW * matrix if name in places}
    for i, name in enumerate(header):
        if i not in read | passed | left and name.lower() not in REMARKS:
            fact = f"its column {shown(name)!r} is neither a position, nor an orientation or a time that is read"
            cure = f"delete it, or leave it out on purpose with ignore={[shown(name)]}"
            raise RecordingError(file, fact, cure)
    time = None if said.assumed else time
    return PoseColumns([places[n] for n in where], [places[n] for n in names], kind, time, np.array(scales))


def _is_coverage(header: Sequence[str]) -> bool:
    first, last = COVERAGE
    return tuple(header[: len(first)]) == first and tuple(header[-len(last) :]) == last


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
    file: Path, known: Mapping[str, object], header: Sequence[str], said: Units
) -> tuple[str, tuple[str, ...]]:
    """(kind, names of the columns) of the orientation; ("", ()) where there is none."""
    there = [(kind, names) for kind, names in NAMED.items() if all(name in known for name in names)]
    if not there and (said.order is not None or not said.assumed):
        there = [("numbered", names) for names in NUMBERED if all(name in known for name in names)]
    if len(there) > 1:
        fact = f"its columns hold more than one orientation: {listed(there[0][1])} and {listed(there[1][1])}"
        raise RecordingError(file, fact, "keep one of them")
    if not there:
        some = [n for names in (*NAMED.values(), MATRIX, *([] if said.assumed else NUMBERED)) for n in names]
        some = [n for n in some if n in known]
        if some:
            fact = f"its column {some[0]!r} alone is no orientation"
            cure = (
                f"name qx, qy, qz, qw, or roll, pitch, yaw, or rx, ry, rz, or a, b, c; the columns are {listed(header)}"
            )
            raise RecordingError(file, fact, cure)
        if said.order is not None:
            raise RecordingError(file, "has no quaternions", "leave out order=")
        return "", ()
    kind, names = there[0]
    if kind == "numbered" and said.order is None:
        fact = f"its columns {', '.join(names)} do not say which number is the scalar"
        raise RecordingError(file, fact, "say order='xyzw' or order='wxyz', or name them qx, qy, qz, qw")
    if kind != "numbered" and said.order is not None:
        raise RecordingError(file, f"names its columns {', '.join(names)}", "leave out order=")
    return kind, names


def _scales(
    file: Path, known: Mapping[str, tuple[int, str]], names: Sequence[str], argument: str, given: str | None,
    otherwise: str | None,
) -> list[float]:  # fmt: skip
    """What makes SI units of columns: by the unit in each name, or the given one, or what is taken otherwise."""
    out = []
    allowed = ALLOWED[argument]
    for name in names:
        unit = known[name][1]
        if unit and unit not in allowed:
            fact = f"its column {name!r} is in {unit}"
            raise RecordingError(file, fact, f"give it in {' or '.join(allowed)}")
        if unit and given is not None and unit != given:
            cure = f"leave out {argument}=, or correct the header"
            raise RecordingError(file, f"its header says {unit} for {name!r}, and you {given}", cure)
        taken = unit or given or otherwise
        if taken is None:
            small, plain = ("mm", "m") if argument == "units" else ("deg", "rad")
            cure = f"say {argument}='{small}' or {argument}='{plain}', or put the unit into the header: {name}_{small}"
            raise RecordingError(file, f"does not say in which unit {name!r} is", cure)
        out.append(SCALES[taken])
    return out


def _check_lengths(
    file: Path, points: Matrix, lines: Indices, notes: list[str], scale: float, place: str
) -> None:  # fmt: skip
    size = np.abs(points).max(axis=1)
    if size.max() > FAR:
        i = int(np.argmax(size > FAR))
        fact = f"{place} {lines[i]} has a coordinate of {size[i]:g} m: this looks like millimetres"
        raise RecordingError(file, fact, "say units='mm', or name the columns x_mm, y_mm, z_mm")
    if scale == SCALES["mm"] and size.max() < NEAR:
        notes.append(f"no coordinate is beyond {1e3 * size.max():.3g} mm: are they metres?")


def _rotations(file: Path, kind: str, values: Matrix, lines: Indices, said: Units, notes: list[str]) -> Array:
    from scipy.spatial.transform import Rotation

    if kind == "matrix":
        matrices = values.reshape(-1, 3, 3)
        for line, R in zip(lines, matrices, strict=True):
            if not rotation_gap(R) < ROTATION:
                raise RecordingError(file, f"{said.place} {line} has no rotation", rotation_cure(R))
        return matrices
    if kind in ("quaternion", "numbered"):
        values = values[:, ORDERS[said.order or "xyzw"]]
        _check_quaternions(file, values, lines, said.place)
        flips = np.flatnonzero(np.sum(values[1:] * values[:-1], axis=1) < 0) + 1
        if flips.size:
            where = ", ".join(str(lines[i]) for i in flips[:5]) + (", ..." if flips.size > 5 else "")
            many = f"{flips.size} quaternion{'s change' if flips.size > 1 else ' changes'}"
            notes.append(f"{many} sign ({said.place} {where}): read as the rotation that it is, by the shorter way")
        return Rotation.from_quat(values).as_matrix()
    far = np.abs(values).max(axis=1) > FULL
    if far.any() and said.angles != "rad":
        i = int(np.argmax(far))
        fact = f"{said.place} {lines[i]} has an angle of {np.abs(values[i]).max():g} rad, over a turn: "
        fact += "it looks like degrees"
        raise RecordingError(file, fact, "say angles='deg', or name the columns so, as in roll_deg")
    if kind == "vector":
        return Rotation.from_rotvec(values).as_matrix()
    return Rotation.from_euler("ZYX" if kind == "KUKA" else "xyz", values).as_matrix()


def _check_quaternions(file: Path, values: Matrix, lines: Indices, place: str) -> None:
    off = np.abs(np.linalg.norm(values, axis=1) - 1)
    if (off > UNIT).any():
        i = int(np.argmax(off > UNIT))
        fact = f"{place} {lines[i]} has a quaternion of length {np.linalg.norm(values[i]):.6g}"
        more = f", and {int((off > UNIT).sum()) - 1} {place}s after it" if (off > UNIT).sum() > 1 else ""
        raise RecordingError(file, f"{fact}, {off[i]:.2g} away from 1{more}", "give unit quaternions, qw the scalar")
