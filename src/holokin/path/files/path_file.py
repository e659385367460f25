"""`read_paths`: the paths in a file of a CAM system, a drawing program or a spreadsheet, whatever its kind."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from ...base.arguments import typed
from ...base.errors import ArgumentError, FileError
from ...base.files import is_folder, listed, shown
from ...base.tables import Units
from ...base.types import Value, positive
from ..path import Waypoints
from .apt import is_apt, read_apt
from .drawings import read_svg
from .dxf import read_dxf
from .gcode import is_gcode, read_gcode
from .moves import Moves
from .pose_table import read_table_of_paths

ARGUMENTS = {
    "table": ("columns", "angles", "order", "maker", "ignore", "axis"),
    "APT": ("axis", "rapid_speed"),
    "G-code": ("axis", "rotary", "rapid_speed"),
    "DXF": (),
    "SVG": ("pixel",),
}
"""Kind of a file -> the arguments that it may need besides its units."""

LARGEST = 20_000_000
"""Bytes of a file: a drawing of a million points, or a program of half as many moves."""


@dataclass(frozen=True, eq=False)
class PathFile(Value):
    """The paths of a file, by name and in its order, what they were read as, and what was repaired or assumed."""

    file: str
    kind: str
    paths: tuple[Waypoints, ...]
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.paths)

    @typed
    def named(self, name: str | int) -> Waypoints:
        """The path of a name, or of a number, counted from 1. Raises: ArgumentError: there is none."""
        names = [path.name for path in self.paths]
        if isinstance(name, int) and 1 <= name <= len(names):
            return self.paths[name - 1]
        if name not in names:
            raise ArgumentError("a path of the file", name, f"it has {listed(names)}")
        return self.paths[names.index(str(name))]


@typed
def read_paths(
    file: str | Path,
    units: Literal["m", "mm", "in"] | None = None,
    columns: Sequence[str] | None = None,
    *,
    angles: Literal["rad", "deg"] | None = None,
    order: Literal["xyzw", "wxyz"] | None = None,
    maker: str | None = None,
    ignore: Sequence[str] = (),
    axis: Literal["into", "out"] | None = None,
    rotary: str | None = None,
    rapid_speed: float | None = None,
    pixel: float | None = None,
    tolerance: float = 1e-5,
) -> PathFile:
    """The paths in a file of a CAM system, a drawing program or a spreadsheet, whatever its kind.

    The kind is told by the text of the file: a table (CSV), cutter locations (APT, CLS), G-code, DXF or SVG. Nothing is
    guessed: what is assumed or repaired is said in `notes`, what is not understood is refused with its line.

    A table names its columns in its first line, in any order, with a unit behind a name, as in x_mm, "x [in]" or
    roll_deg: x, y, z; for the tool's direction i, j, k or nx, ny, nz; or for its orientation qx, qy, qz, qw, or q1 to
    q4 or q0 to q3 with their `order`, or roll, pitch, yaw (about the axes x, y, z of the frame, in this order), or rx,
    ry, rz, a rotation vector, or a, b, c of KUKA, w, p, r of FANUC, o, a, t of Kawasaki, a, e, r of Comau; or T00, T01,
    ..., T23, the first three rows of the pose's matrix; for times t, time, stamp, timestamp, sec or seconds, or sec and
    nanosec; for the speed of the move to a row speed_mm_s or feed_mm_min; path, seam or operation for the name of a
    row's path. Columns named name, label, comment, remark, note, id, index, number, point, line or row are passed over;
    any other is refused.

    In a program a rapid move ends a path and leads to the next one.

    Args:
        units: of lengths where the file does not say it.
        columns: names of the columns of a table without a header.
        angles: of the columns of a table where their names do not say it.
        order: of the numbers of a quaternion in columns q1 to q4 or q0 to q3.
        maker: whose angles a, b, c are ("KUKA", "Mitsubishi") or rx, ry, rz ("UR", "Yaskawa", "Staubli").
        ignore: columns to leave out, by their names in the header, or patterns with *, as in ["tool_*"].
        axis: whether a direction of the tool in the file points "into" the work or "out" of it, from the tool's tip to
            its holder. By default "out" in programs, as APT has it, and "into" in tables, with a note.
        rotary: the machine for whose rotary axes A, B, C a G-code program is written: their letters in the order from
            the workpiece to the tool, with - for those whose numbers count the turn of the table instead of that of the
            tool, as in "CA" or "-C-A". X, Y, Z are the tool's tip in the frame of the workpiece.
        rapid_speed: [m/s] at which rapid moves are made part of the paths; by default they divide them.
        pixel: size of a pixel [m] of an SVG drawing that does not state it: 1e-3 where its numbers are millimetres.
        tolerance: of the splines that stand for the curves of drawings [m].

    Raises:
        FileError: no such file; a line that is not understood; no units, or two; no paths. MissingExtraError: an extra
            of drawings is not installed. ArgumentError: an argument of another kind of file.
    """
    place = Path(file)
    positive("tolerance", tolerance)
    if rapid_speed is not None:
        positive("rapid_speed", rapid_speed)
    text = _text(place)
    kind = _kind(text)
    if kind != "DXF" and (bad := re.search("[\udc80-\udcff\\0]", text)):  # it says its own encoding
        line = text[: bad.start()].count("\n") + 1
        raise FileError(place, f"line {line} is no text in UTF-8", "save it as text in UTF-8")
    given = {"columns": columns, "angles": angles, "order": order, "maker": maker, "ignore": ignore or None}
    given |= {"axis": axis, "rotary": rotary, "rapid_speed": rapid_speed, "pixel": pixel}
    given |= {"units": units} if kind == "SVG" else {}
    for name, value in given.items():
        if value is not None and name not in ARGUMENTS[kind]:
            raise ArgumentError(name, value, f"leave it out: {place} is read as {kind}, which has no use for it")
    # The paths, each kind by its own grammar.
    notes: list[str] = []
    if kind == "table":
        into = None if axis is None else axis == "into"
        said = Units(
            units,
            angles,
            order,
            False,
            tuple(ignore),
            columns=None if columns is None else tuple(columns),
            maker=maker,
            into=into,
        )
        paths = read_table_of_paths(place, text, said)
    elif kind in ("APT", "G-code"):
        moves = Moves(place, rapid_speed)
        if kind == "APT":
            read_apt(place, text, moves, units, axis == "into")
        else:
            read_gcode(place, text, moves, units, rotary, axis == "into")
        paths, notes = moves.paths, moves.notes
    elif kind == "DXF":
        paths, notes = read_dxf(place, text, units, tolerance)
    else:
        paths = read_svg(place, text, pixel, tolerance)
    if not paths:
        raise FileError(place, f"is read as {kind}, and has no path", "look whether it is whole")
    if any(path.axes is not None for path in paths):
        notes.append(
            "the file has directions of the tool, but not how it is turned about them: it turns as little as it can"
        )
    return PathFile(str(place), kind, _named_apart(paths), tuple(notes))


def _text(file: Path) -> str:
    """The text of a file. Raises: FileError: it has none."""
    if is_folder(file):
        raise FileError(file, "is a folder", "give a file")
    try:
        if file.stat().st_size > LARGEST:
            raise FileError(file, f"has over {LARGEST:,} bytes", "simplify it, or divide it")
        return file.read_text("utf-8-sig")
    except UnicodeDecodeError as problem:
        line = file.read_bytes()[: problem.start].count(b"\n") + 1
        raise FileError(file, f"line {line} is no text in UTF-8", "save it as text in UTF-8") from None
    except OSError as problem:
        raise FileError(file, f"cannot be read ({shown(str(problem))})", "check the file") from None


def _kind(text: str) -> str:
    """What the text of a file is, by its first lines or by words that no other kind has."""
    if "<svg" in text:
        return "SVG"
    if re.match(r"(?:\s*999\s*\n.*\n)*\s*0\s*\n\s*SECTION\s*\n", text):
        return "DXF"
    if is_apt(text):
        return "APT"
    return "G-code" if is_gcode(text) else "table"


def _named_apart(paths: Sequence[Waypoints]) -> tuple[Waypoints, ...]:
    """The paths with names that differ: "path 1" where there is none, "SEAM 2" for the second SEAM."""
    out, count = [], Counter()
    for number, path in enumerate(paths, 1):
        name = path.name or f"path {number}"
        count[name] += 1
        out.append(replace(path, name=name if count[name] == 1 else f"{name} {count[name]}"))
    return tuple(out)
