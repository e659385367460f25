"""`export_sheets`: a map of sheets as C: each sheet's inverse kinematics, and a table that says which is asked."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...analysis.sheets import Sheets
from ...analysis.sheets.sheet import STATIONS, features, seen_features
from ...base.arguments import typed
from ...base.errors import ArgumentError, ExportError
from ...base.types import Array, positive
from ...version import __version__
from .c_folder import Exported, c_name, c_texts, operations_of, write_export
from .c_text import line

PIECES = 1000
"""Pieces of a straight path on one sheet, at most."""

TESTED = 64
"""Poses of the self-test."""

VECTORS = 16
"""Postures of the self-test of each sheet."""

CLOSE = 1e-7
"""What a posture of the self-test may be off [joint unit]."""


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
    texts |= {
        f"{short}_sheets.h": _header(short, head, found),
        f"{short}_sheets.c": _library(short, head, found),
        f"{short}_sheets_selftest.c": _selftest(short, head, found),
        "CMakeLists.txt": _build(short, head, len(found)),
    }
    write_export(Path(folder), texts, f"project({short}_sheets C)")
    return Exported(Path(folder), f"{short}_sheets", tuple(texts), operations)


def _header(name: str, head: str, sheets: Sheets) -> str:
    n, up = sheets.task.n, name.upper()
    return f"""/* {head}

   Poses are 4x4 matrices by rows (16 numbers): the tool in the base frame. Lengths in m, angles in rad. */
#ifndef {up}_SHEETS_H
#define {up}_SHEETS_H

#ifdef __cplusplus
extern "C" {{
#endif

enum {{ {up}_SHEETS = {len(sheets)}, {up}_SHEETS_N = {n} }};

/* The joints q at a tool pose, a function of the pose alone. Returns the sheet, or -1 where no sheet serves the pose:
   then q stays. */
int {name}_sheets(const double target[16], double q[{n}]);

/* The same for a loop: q is the last answer, on `sheet`, which is kept while it serves the pose and leads to it. Then
   another sheet is taken, with joints elsewhere; -1 where none serves, or only this one with joints elsewhere. */
int {name}_sheets_near(const double target[16], double q[{n}], int sheet);

/* The joints of one sheet at a tool pose; 0 where it does not serve it: then q stays. */
int {name}_sheets_of(int sheet, const double target[16], double q[{n}]);

#ifdef __cplusplus
}}
#endif

#endif
"""


def _library(name: str, head: str, sheets: Sheets) -> str:
    n, S = sheets.task.n, len(sheets)
    begin, of = [sheet.begin for sheet in sheets.sheets], [sheet.begin_at for sheet in sheets.sheets]
    seen_by = seen_features(sheets.task)
    X = features(np.concatenate([sheets.poses[sheets.served], *of]), sheets.length) @ seen_by
    seen = not np.array_equal(seen_by, np.eye(12))
    ends = np.cumsum([int(sheets.served.sum()), *map(len, begin)])
    includes = "\n".join(f'#include "sheet_{s}/{name}_{s}.h"' for s in range(S))

    return f"""/* {head} */
#include "{name}_sheets.h"
#include <math.h>
{includes}

enum {{ SERVED = 1, PIECES = {PIECES}, SAMPLED = {ends[0]} }};

/* Sampled poses that have a sheet, then the stations of each sheet: position, and {sheets.length:g} / sqrt(2) times the
   rotation by rows{", as far as the task tells them apart" if seen else ""}; and half the squared length. */
static const double places[{len(X)}][12] = {{
{_rows(X)}
}};
static const double halves[{len(X)}] = {{{_numbers(0.5 * np.sum(X**2, axis=1))}}};

/* Where the sampled poses end, and the stations of each sheet; the sheets of the poses, the joints of the stations. */
static const int ends[{S + 1}] = {{{", ".join(map(str, ends.tolist()))}}};
static const int labels[{ends[0]}] = {{{", ".join(map(str, sheets.labels[sheets.served].tolist()))}}};
static const double joints[{len(X) - ends[0]}][{n}] = {{
{_rows(np.concatenate(begin))}
}};

/* A wanted pose as the sheets take it. */
static void given(const double target[16], double wanted[16]) {{
  for (int i = 0; i < 16; i++) wanted[i] = {_numbered(sheets)};
}}

/* The nearest of the stations of a sheet, of the sampled poses for -1, further away than `beyond`, which becomes how
   far it is. Returns -1 where there is none. */
static int nearest(const double target[16], int sheet, double *beyond) {{
  const double turn = {float(sheets.length / np.sqrt(2))!r};
  double at[12], least = INFINITY;
  int found = -1;
  for (int i = 0; i < 3; i++) {{
    at[i] = target[4 * i + 3];
    for (int j = 0; j < 3; j++) at[3 + 3 * i + j] = turn * target[4 * i + j];
  }}
{_SEEN.format(_rows(seen_by)) if seen else ""}  for (int p = sheet < 0 ? 0 : ends[sheet]; p < ends[sheet + 1]; p++) {{
    double value = halves[p];
    for (int i = 0; i < 12; i++) value -= at[i] * places[p][i];
    if (value > *beyond && value < least) least = value, found = p;
  }}
  *beyond = least;
  return found;
}}

/* The posture of a sheet, straight from q. Returns whether there is one. */
static int go(int sheet, const double target[16], double q[{n}]) {{
  double wanted[16], leaf[{max(1, n - sheets.task.m)}];
  int status = -2;
  given(target, wanted);
  switch (sheet) {{
{_cases(name, sheets)}
  }}
  return status == 0 || status == SERVED;
}}

int {name}_sheets_of(int sheet, const double target[16], double q[{n}]) {{
  double at[{n}], beyond = -INFINITY;
  if (sheet < 0 || sheet >= {S}) return 0;
  for (int k = 0; k < {STATIONS}; k++) {{
    const int p = nearest(target, sheet, &beyond);
    if (p < 0) return 0;
    for (int i = 0; i < {n}; i++) at[i] = joints[p - SAMPLED][i];
    if (!go(sheet, target, at)) continue;
    for (int i = 0; i < {n}; i++) q[i] = at[i];
    return 1;
  }}
  return 0;
}}

static int any_but(int none, const double target[16], double q[{n}]) {{
  double beyond = -INFINITY;
  const int p = nearest(target, -1, &beyond), first = p < 0 ? -1 : labels[p];
  if (first >= 0 && first != none && {name}_sheets_of(first, target, q)) return first;
  for (int sheet = 0; sheet < {S}; sheet++)
    if (sheet != first && sheet != none && {name}_sheets_of(sheet, target, q)) return sheet;
  return -1;
}}

int {name}_sheets(const double target[16], double q[{n}]) {{ return any_but(-1, target, q); }}

int {name}_sheets_near(const double target[16], double q[{n}], int sheet) {{
  double at[{n}], own[{n}];
  int same = {name}_sheets_of(sheet, target, own);
  for (int i = 0; i < {n}; i++) at[i] = q[i];
  same = same && go(sheet, target, at);
  for (int i = 0; same && i < {n}; i++) same = fabs(at[i] - own[i]) < 1e-6;
  if (!same) return any_but(sheet, target, q);
  for (int i = 0; i < {n}; i++) q[i] = own[i];
  return sheet;
}}
"""


_SEEN = """  static const double S[12][12] = {{
{}
  }};
  double given_at[12];
  for (int i = 0; i < 12; i++) given_at[i] = at[i], at[i] = 0.0;
  for (int i = 0; i < 12; i++)
    for (int j = 0; j < 12; j++) at[j] += given_at[i] * S[i][j];
"""
"""C that leaves out of a point what the task leaves free of a pose."""


def _numbered(sheets: Sheets) -> str:
    """Number i of a wanted pose: of a task of positions it is the position alone."""
    return "target[i]" if sheets.task.orientation else "i < 3 ? target[4 * i + 3] : 0.0"


def _cases(name: str, sheets: Sheets) -> str:
    rows = []
    for s, sheet in enumerate(sheets.sheets):
        level = "".join(f"leaf[{i}] = {float(c)!r}; " for i, c in enumerate(sheet.level))
        rows.append(f"    case {s}: {level}status = {name}_{s}_inverse(q, wanted, leaf, PIECES); break;")
    return "\n".join(rows)


def _selftest(name: str, head: str, sheets: Sheets) -> str:
    rows = np.flatnonzero(sheets.served)[:: max(1, int(sheets.served.sum()) // TESTED)]
    answers = sheets.batch(sheets.poses[rows])
    n, k = sheets.task.n, len(rows)
    return f"""/* {head} */
#include "{name}_sheets.h"
#include <math.h>
#include <stdio.h>

static const double poses[{k}][16] = {{
{_rows(sheets.poses[rows].reshape(k, 16))}
}};
static const double joints[{k}][{n}] = {{
{_rows(answers.q)}
}};
static const int sheets[{k}] = {{{", ".join(map(str, answers.sheet.tolist()))}}};

int main(void) {{
  int wrong = 0;
  for (int p = 0; p < {k}; p++) {{
    double q[{n}], off = 0;
    const int sheet = {name}_sheets(poses[p], q);
    for (int i = 0; i < {n}; i++) off = fmax(off, fabs(q[i] - joints[p][i]));
    if (sheet != sheets[p] || !(off < {CLOSE!r})) wrong++, printf("pose %d: sheet %d, off by %g\\n", p, sheet, off);
  }}
  printf("%d of {k} poses have the joints of the map\\n", {k} - wrong);
  return wrong != 0;
}}
"""


def _build(name: str, head: str, count: int) -> str:
    heading = "\n".join(f"# {one.strip()}" for one in head.splitlines())
    folders = "\n".join(f"add_subdirectory(sheet_{s})" for s in range(count))
    libraries = " ".join(f"{name}_{s}_double" for s in range(count))
    return f"""{heading}
#   cmake -B build && cmake --build build && ctest --test-dir build
cmake_minimum_required(VERSION 3.10)
project({name}_sheets C)
set(CMAKE_C_STANDARD 99)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()
enable_testing()
{folders}
add_library({name}_sheets STATIC {name}_sheets.c)
target_include_directories({name}_sheets PUBLIC ${{CMAKE_CURRENT_SOURCE_DIR}})
target_link_libraries({name}_sheets PUBLIC {libraries})
add_executable({name}_sheets_selftest {name}_sheets_selftest.c)
target_link_libraries({name}_sheets_selftest {name}_sheets)
add_test(NAME {name}_sheets_selftest COMMAND {name}_sheets_selftest)
"""


def _rows(values: Array) -> str:
    return ",\n".join(f"  {{{_numbers(row)}}}" for row in values)


def _numbers(values: Array) -> str:
    return ", ".join(map(repr, values.tolist()))
