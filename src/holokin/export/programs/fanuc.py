"""FANUC TP programs as .LS text: joint, linear and circular moves to positions J1, J2, ..., each in its time.

Grammar: FANUC, "R-30iB Handling Tool Operator's Manual" (B-83284EN): program header, motion instructions J, L and C in
sec, msec, mm/sec and cm/min, to positions of which each is given by its joints, DO, WAIT, PAYLOAD, remarks of at most
32 characters. J2/J3: ROS-Industrial's fanuc_driver (J23_factor).
"""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.types import Array, whole
from ...motion import TimedTrajectory
from .moves import Dialect, ProcessLines, ToolTolerance
from .robot_program import Program, header, program_name
from .targets import Move, Targets, Wiring, targets, with_lines

NAME, SHORT = 36, 8
"""Characters of a program's name: the most an R-30iB takes, and what every controller takes, given by default."""

REMARK = 32
"""Characters of a remark in the program."""

MOTIONS = ("J ", "L ", "C ")

ROUNDED = 2e-3
"""Share by which a whole number may change the speed of a move."""

IN_MS, LONGEST_MOVE = 32_000, 3_200_000
"""Milliseconds that a motion instruction takes as such, and at all."""

DIALECT = Dialect(
    "FANUC's TP language",
    "DO[{number}]={state}",
    "WAIT {seconds:.2f}(sec)",
    ("OFF", "ON"),
    external=3,
    forbidden=r";|^/|^!.{33}",
)


@typed
def to_fanuc(
    timed: TimedTrajectory, *, name: str | None = None, about: str = "", wiring: Wiring | None = None,
    coupled: bool = False, tolerance: float | ToolTolerance = 2e-3, lines: ProcessLines | None = None, zone: int = 100,
    tool: int = 1, base: int = 0, payload: int | None = None, written: datetime | None = None,
) -> Program:  # fmt: skip
    """A TP program NAME.LS of moves to joint positions in degrees, external axes E1 to E3 in degrees or mm.

    Joint moves have their time in ms, linear and circular ones their speed in mm/s or cm/min where that is a whole
    number, else their time; positions have the three decimals of the pendant, so joints are right to 9e-6 rad.

    Args:
        name: of the program, at most 36 letters, digits and underscores; by default 8.
        about: a line of the header: the strategy.
        wiring: of the controller's axes: J1 to J6, and E1 to E3 as external ones.
        coupled: write J3 as FANUC counts it on arms whose J3 keeps its angle to the floor while J2 moves:
            J3 = joint 3 - joint 2, after signs and offsets. False writes the joints of the model as they are, which
            is right where the model has that coupling, or the arm none.
        tolerance: of the joints [rad or m], see `Program.deviation`, or of the tool.
        lines: of the process.
        zone: 0 to 100, the CNT of targets passed without a stop; corners and the end are FINE.
        tool, base, payload: numbers of the tool frame (UT), the user frame (UF) and the payload schedule.
        written: the date in the header; by default now.

    Raises:
        ExportError: a robot of other than six axes, external ones left out. ArgumentError: bad names, wiring or lines.
    """
    for what, value, most in (("base", base, 9), ("tool", tool, 10), ("zone", zone, 100), ("payload", payload, 10)):
        if value is not None and whole(what, value, 0) > most:
            raise ArgumentError(what, value, f"give a whole number from 0 to {most}")
    goals = targets(timed, wiring, DIALECT, tolerance, lines)
    if coupled:
        goals = replace(goals, q=_coupled(goals.q), via={i: _coupled(row) for i, row in goals.via.items()})
    short = program_name(name, about, NAME if name else SHORT, goals).upper()
    counted = "J3 = joint 3 - joint 2" if coupled else "J3 = joint 3 of the model (no coupling)"
    more = ["degrees, external axes degrees or mm", counted, f"UF {base}, UT {tool}"]
    head = header(timed, about, goals, more, REMARK)
    body = [f"!{line.replace(';', ',')}" for line in head.lines]  # a semicolon ends a statement
    body += [f"UFRAME_NUM={base}", f"UTOOL_NUM={tool}"]
    body += [f"PAYLOAD[{payload}]"] if payload is not None else []
    body += with_lines(goals, [["J P[1] 10% FINE"], *_moves(goals, zone)])
    text = _listing(short, body, goals, f"UF : {base}, UT : {tool}", written or datetime.now())
    return head.program({f"{short}.LS": text}, goals)


def _coupled(q: Array) -> Array:
    """Axes (..., 6) with J3 counted from the floor."""
    q = q.copy()
    q[..., 2] -= q[..., 1]
    return q


def _moves(goals: Targets, zone: int) -> list[list[str]]:
    """The instruction of each move; positions on the way of circular ones have the numbers after all targets.

    Linear and circular moves have a speed, which the operator tunes; where no whole number is that, their time.
    """
    times = np.rint(1e3 * np.concatenate([[0.0], np.cumsum(goals.seconds)])).astype(int)
    number = {i: len(goals.q) + k for k, i in enumerate(goals.via, 1)}
    last = len(times) - 1
    moves = []
    for i, move in enumerate(goals.moves, 1):
        lasts = max(1, int(times[i] - times[i - 1]))
        if lasts > LONGEST_MOVE:
            raise ArgumentError("the time of a move [ms]", lasts, f"a move takes at most {LONGEST_MOVE}")
        time = f"{lasts}msec" if lasts <= IN_MS else f"{lasts / 1e3:.1f}sec"
        way = f"{_speed(move) or time} {'FINE' if i == last or goals.stops[i] else f'CNT{zone}'}"
        if move.kind == "circular":
            moves.append([f"C P[{number[i - 1]}]\n    :  P[{i + 1}] {way}"])
        else:
            moves.append([f"{'J' if move.kind == 'joint' else 'L'} P[{i + 1}] {way}"])
    return moves


def _speed(move: Move) -> str:
    """The speed of a linear or circular move as the pendant has it, in whole numbers; empty where none is near."""
    for unit, factor in (("mm/sec", 1e3), ("cm/min", 6e3)) if move.kind != "joint" else ():
        exact = factor * move.speed
        if 1 <= exact <= 2000 and abs(round(exact) / exact - 1.0) <= ROUNDED:
            return f"{round(exact)}{unit}"
    return ""


def _listing(name: str, body: list[str], goals: Targets, frames: str, written: datetime) -> str:
    date = f"DATE {written:%y-%m-%d  TIME %H:%M:%S}"
    axes = [f"J{k}" for k in range(1, 7)] + [f"E{k}" for k in range(1, 4)]
    units = ["mm" if length else "deg" for length in goals.lengths]
    attributes = {"OWNER\t\t": "MNEDITOR", "COMMENT\t\t": '"holokin"', "PROG_SIZE\t": 0, "CREATE\t\t": date}
    attributes |= {"MODIFIED\t": date, "FILE_NAME\t": "", "VERSION\t\t": 0, "LINE_COUNT\t": len(body)}
    attributes |= {"MEMORY_SIZE\t": 0, "PROTECT\t\t": "READ_WRITE"}
    task = {"STACK_SIZE": 0, "TASK_PRIORITY": 50, "TIME_SLICE": 0, "BUSY_LAMP_OFF": 0, "ABORT_REQUEST": 0}
    task["PAUSE_REQUEST"] = 0
    lines = [f"/PROG  {name}", "/ATTR", *(f"{key}= {value};" for key, value in attributes.items())]
    lines.append("TCD:  " + ",\n      ".join(f"{key}\t= {value}" for key, value in task.items()) + ";")
    lines += ["DEFAULT_GROUP\t= 1,*,*,*,*;", "CONTROL_CODE\t= 00000000 00000000;", "/MN"]
    lines += [f"{i:4d}:{'' if text[:2] in MOTIONS else '  '}{text} ;" for i, text in enumerate(body, 1)]
    lines.append("/POS")
    every = np.vstack([goals.q, *goals.via.values()])
    for i, row in enumerate(np.round(goals.shown(every), 3) + 0.0, 1):
        cells = [f"{axis}={x:10.3f} {unit}" for axis, x, unit in zip(axes, row, units, strict=False)]
        groups = ["\t" + ",\t".join(cells[k : k + 3]) for k in range(0, len(cells), 3)]
        lines += [f"P[{i}]{{", "   GP1:", f"\t{frames},\t", ",\n".join(groups), "};"]
    return "\n".join([*lines, "/END", ""])
