"""`export_sheets`: a map of sheets as C: each sheet's inverse kinematics, and a table that says which is asked."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...analysis.sheets import Sheets
from ...analysis.sheets.sheet import STATIONS, features, seen_features
from ...base.arguments import typed
from ...base.errors import ArgumentError, ExportError
from ...base.types import Array, positive
from ...version import __version__
from .c_folder import Exported, c_name, c_texts, operations_of, write_export
from .c_text import line, text

VECTORS = 16
"""Postures of the self-test of each sheet."""


@typed
def export_sheets(
    found: Sheets, folder: str | Path, *, name: str | None = None, dt: float = 0.001, origin: str = "Python"
) -> Exported:
    """Write a map of sheets as C99: `NAME_sheets(target, q)` gives the sheet of a tool pose and its joints.

    Each sheet is an export of its own, in a folder sheet_0, sheet_1, ..., with its control step. A table of the sampled
    poses says which is asked first, as `s(pose)` does. `NAME_sheets_near` keeps the sheet of a loop while it serves.

    Args:
        found: the map, without a scene and without a least rcond: C does not look at these.
        folder: made if need be; files there that holokin did not write are left alone, or refused if in the way.
        name: C name, the prefix of all symbols; by default that of the robot.
        dt: the loop's step of the sheets' control steps [s].
        origin: what it was exported from, for the readme.

    Returns:
        What was written.

    Raises:
        ArgumentError: no sheets, a scene, a least rcond; a name that is no C name; files in the way. ExportError:
        nothing is redundant, or a strategy has no C. WriteError.
    """
    positive("dt", dt)
    if not len(found):
        raise ArgumentError("the sheets", 0, "give a map that serves something")
    if found.scene is not None or any(sheet.rcond for sheet in found.sheets):
        cure = "C does not look at obstacles, nor at a least rcond: make the map without, and check its motions"
        raise ArgumentError("the map", "it has a scene, or a least rcond", cure)
    if found.task.n == found.task.m:
        cure = "ask `s(pose)` in Python, or give a task with fewer rows: C has inverse kinematics of redundant arms"
        raise ExportError("nothing is redundant, the sheets are branches of the arm", cure)
    short = c_name(found.task.robot.name) if name is None else str(name)
    texts: dict[str, str] = {}
    operations: dict[str, int] = {}
    for s, sheet in enumerate(found.sheets):
        source, of = c_texts(sheet.strategy, sheet.q0, dt, f"{short}_{s}", True, VECTORS, origin)
        texts |= {f"sheet_{s}/{file}": content for file, content in of.items()}
        operations |= {f"sheet {s} {key}": count for key, count in operations_of(source).items()}
    head = f"{line(found.sentence)}\n   Written by holokin {__version__} from: {line(origin)}."
    words = _words(short, head, found)
    for file, template in (("sheets.h", "sheets.h"), ("sheets.c", "sheets.c"), ("sheets_selftest.c", "selftest.c")):
        texts[f"{short}_{file}"] = text(f"sheets/{template}", words)
    texts["CMakeLists.txt"] = text("sheets/CMakeLists.txt", words)
    write_export(Path(folder), texts, f"project({short}_sheets C)")
    return Exported(Path(folder), f"{short}_sheets", tuple(texts), operations)


def _words(name: str, head: str, sheets: Sheets) -> dict[str, Any]:
    """What the templates need: the sampled poses and the stations of each sheet, and the poses of the self-test."""
    # The table of poses: those that have a sheet, then the stations; only what the task sees of them counts.
    n, S = sheets.task.n, len(sheets)
    begin, of = [sheet.begin for sheet in sheets.sheets], [sheet.begin_at for sheet in sheets.sheets]
    seen_by = seen_features(sheets.task)
    X = features(np.concatenate([sheets.poses[sheets.served], *of]), sheets.length) @ seen_by
    seen = not np.array_equal(seen_by, np.eye(12))
    ends = np.cumsum([int(sheets.served.sum()), *map(len, begin)])
    # The call of each sheet, on its level.
    cases = []
    for s, sheet in enumerate(sheets.sheets):
        level = "".join(f"leaf[{i}] = {float(c)!r}; " for i, c in enumerate(sheet.level))
        cases.append(f"    case {s}: {level}status = {name}_{s}_inverse(q, wanted, leaf, PIECES); break;")
    # Some 64 poses of the self-test, with the answers of the map.
    rows = np.flatnonzero(sheets.served)[:: max(1, int(sheets.served.sum()) // 64)]
    answers = sheets.batch(sheets.poses[rows])
    return {
        "name": name,
        "NAME": name.upper(),
        "head": head,
        "n": n,
        "count": S,
        "includes": "\n".join(f'#include "sheet_{s}/{name}_{s}.h"' for s in range(S)),
        "pieces": 1000,  # of a straight path on one sheet, at most
        "sampled": ends[0],
        "length": f"{sheets.length:g}",
        "seen_words": ", as far as the task tells them apart" if seen else "",
        "places_count": len(X),
        "places": _rows(X),
        "halves": _numbers(0.5 * np.sum(X**2, axis=1)),
        "ends_count": S + 1,
        "ends": ", ".join(map(str, ends.tolist())),
        "labels": ", ".join(map(str, sheets.labels[sheets.served].tolist())),
        "stations_count": len(X) - ends[0],
        "stations": _rows(np.concatenate(begin)),
        "number": "target[i]" if sheets.task.orientation else "i < 3 ? target[4 * i + 3] : 0.0",
        "turn": repr(float(sheets.length / np.sqrt(2))),
        "seen_code": text("sheets/seen.c", {"rows": _rows(seen_by)}) if seen else "",
        "rows": max(1, n - sheets.task.m),
        "cases": "\n".join(cases),
        "most_stations": STATIONS,
        "tested": len(rows),
        "tested_poses": _rows(sheets.poses[rows].reshape(len(rows), 16)),
        "tested_joints": _rows(answers.q),
        "tested_sheets": ", ".join(map(str, answers.sheet.tolist())),
        "close": 1e-7,  # what a posture of the self-test may be off [joint unit]
        "heading": "\n".join(f"# {words.strip()}" for words in head.splitlines()),
        "folders": "\n".join(f"add_subdirectory(sheet_{s})" for s in range(S)),
        "libraries": " ".join(f"{name}_{s}_double" for s in range(S)),
    }


def _rows(values: Array) -> str:
    return ",\n".join(f"  {{{_numbers(row)}}}" for row in values)


def _numbers(values: Array) -> str:
    return ", ".join(map(repr, values.tolist()))
