"""KUKA KRL: blocks of `SPTP`, and `LIN` and `CIRC`, to joint targets, in the times and speeds of the timed trajectory.

Grammar: KUKA System Software 8.3, "Operating and Programming Instructions for System Integrators": DEF, DEFDAT,
E6AXIS, E6POS, PTP_SPLINE, SPTP, TIME_BLOCK, LIN, CIRC, $VEL.CP, $ORI_TYPE, $CIRC_TYPE, $APO.CDIS, BAS, $OUT, WAIT SEC;
names of at most 24 characters. FORWARD(axes, error) gives the E6POS of an E6AXIS, with its status and turn.
"""

from __future__ import annotations

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.types import not_negative, whole
from ...motion import TimedTrajectory
from .moves import Dialect, ProcessLines, ToolTolerance
from .robot_program import Program, header, program_name
from .targets import Targets, Wiring, targets, with_lines, zones

NAME = 24
"""Characters of a KRL name."""

FRAMES = {"tool": 16, "base": 32, "payload": 16}
"""Largest numbers of tools, bases and loads."""

DIALECT = Dialect(
    "KRL",
    "$OUT[{number}]={state}",
    "WAIT SEC {seconds:g}",
    ("FALSE", "TRUE"),
    external=6,
    forbidden=r"^\s*(&|DEF|END\b|ENDDAT)",
)


@typed
def to_krl(
    timed: TimedTrajectory,
    *,
    name: str | None = None,
    about: str = "",
    wiring: Wiring | None = None,
    tolerance: float | ToolTolerance = 2e-3,
    lines: ProcessLines | None = None,
    zone: float = 1e-3,
    tool: int | None = None,
    base: int | None = None,
    payload: int | None = None,
) -> Program:
    """A KRL program NAME.src with its data list NAME.dat: E6AXIS targets in degrees, external axes in degrees or mm.

    Joint moves from rest to rest are one PTP_SPLINE, which passes through all its targets, with a TIME_BLOCK of their
    times (from KSS 8.3 on). LIN and CIRC have their speed in $VEL.CP; they go to FORWARD(E6AXIS), the pose with the
    status and turn that the controller itself computes of our joints. The first target is reached by SPTP with a tenth
    of the axis speed. Where the process begins or ends amid joint moves, their block ends: there the robot stops.

    Args:
        name: of the program, at most 24 letters, digits and underscores.
        about: a line of the header: the strategy.
        wiring: of the controller's axes: A1 to A6, and E1 to E6 as external ones. A robot of seven axes (iiwa) has
            another controller and language.
        tolerance: of the joints [rad or m], see `Program.deviation`, or of the tool.
        lines: of the process.
        zone: [m] at which LIN and CIRC go on to the next target ($APO.CDIS).
        tool, base, payload: numbers of the tool, the base and the load; by default those that are set.

    Raises:
        ExportError: a robot of other than six axes, external ones left out. ArgumentError: bad names, numbers, wiring
            or lines.
    """
    # The targets, and the numbers of the cell.
    goals = targets(timed, wiring, DIALECT, tolerance, lines)
    short = program_name(name, about, NAME, goals)
    numbers = {"tool": tool, "base": base, "payload": payload}
    for what, value in numbers.items():
        if value is not None and whole(what, value, 0) > FRAMES[what]:
            raise ArgumentError(what, value, f"give its number, 0 to {FRAMES[what]}")
    more = ["degrees, external axes degrees or mm; TIME_BLOCK needs KSS 8.3 or later"]
    used = [f"{what} {value}" for what, value in numbers.items() if value is not None]
    more += [", ".join(used)] if used else []
    head = header(timed, about, goals, more, 76)
    facts = [f"; {line}" for line in head.lines]
    # The program, and the data list of its targets.
    declared = ["DECL INT XERR", *(f"DECL E6POS {point}" for point in _poses(goals))]
    frames = [f"BAS(#{what.upper()},{numbers[what]})" for what in ("tool", "base") if numbers[what] is not None]
    frames += [f"$LOAD=LOAD_DATA[{payload}]"] if payload is not None else []
    text = ["&ACCESS RVP", "&REL 1", f"DEF {short}()", *(declared if goals.linear else []), *facts]
    text += ["BAS(#INITMOV,0)", *frames, "BAS(#VEL_PTP,10)", *_computed(goals)]
    text += ["$ORI_TYPE=#VAR", "$CIRC_TYPE=#BASE"] if goals.linear else []  # the tool turns evenly along a move
    text += [f"$APO.CDIS={1e3 * not_negative('zone', zone):g}"] if goals.linear else []
    text += with_lines(goals, [["SPTP XP1", "BAS(#VEL_PTP,100)", "BAS(#ACC_PTP,100)"], *_moves(goals, zone)])
    data = ["&ACCESS RVP", "&REL 1", f"DEFDAT {short} PUBLIC"]
    named = {f"XP{i}": row for i, row in enumerate(goals.q, 1)} | {f"XC{i + 2}": row for i, row in goals.via.items()}
    words = [f"A{i}" for i in range(1, 7)] + [f"E{i}" for i in range(1, 7)]
    for point, row in named.items():
        values = ",".join(f"{word} {x:.6f}" for word, x in zip(words, goals.shown(row), strict=False))
        data.append(f"DECL E6AXIS {point}={{{values}}}")
    files = {f"{short}.src": "\n".join([*text, "END", ""]), f"{short}.dat": "\n".join([*data, "ENDDAT", ""])}
    return head.program(files, goals)


def _poses(goals: Targets) -> list[str]:
    """The poses that are computed of targets: those of linear and circular moves."""
    ends = [f"XF{i}" for i, move in enumerate(goals.moves, 2) if move.kind != "joint"]
    return ends + [f"XG{i + 2}" for i in goals.via]


def _computed(goals: Targets) -> list[str]:
    """The lines that compute them, and stop the program where that fails."""
    lines = []
    for point in _poses(goals):
        axes = point.replace("XF", "XP").replace("XG", "XC")
        lines += [f"{point}=FORWARD({axes},XERR)", "IF XERR<>0 THEN", "HALT", "ENDIF"]
    return lines


def _moves(goals: Targets, zone: float) -> list[list[str]]:
    """The lines of the moves to each target but the first; a block of joint moves stands at its last one."""
    radii, _ = zones(goals, zone)
    ends = {*np.flatnonzero(goals.stops).tolist(), len(goals.t) - 1}
    ends |= {k for k, given in ((goals.on, goals.lines.on), (goals.off, goals.lines.off)) if given}
    text: list[list[str]] = []
    block: list[int] = []
    speed = ""
    for i, move in enumerate(goals.moves, 1):
        if move.kind == "joint":
            block.append(i)
            goes_on = i < len(goals.moves) and goals.moves[i].kind == "joint" and i not in ends
            text.append([] if goes_on else _block(goals, block))
            block = block if goes_on else []
            continue
        word = f"LIN XF{i + 1}" if move.kind == "linear" else f"CIRC XG{i + 1},XF{i + 1}"
        faster = f"$VEL.CP={move.speed:.6f}"
        text.append([faster] * (faster != speed) + [word + (" C_DIS" if radii[i] else "")])
        speed = faster
    return text


def _block(goals: Targets, block: list[int]) -> list[str]:
    """A PTP_SPLINE through targets that follow each other."""
    times = goals.t[[block[0] - 1, *block]]
    total = times[-1] - times[0]
    lines = ["PTP_SPLINE", f"  SPTP XP{block[0]}", "  TIME_BLOCK START"]
    for k, seconds in zip(block, times[1:] - times[:-1], strict=True):
        lines += [f"  SPTP XP{k + 1}", f"  TIME_BLOCK PART = {100 * seconds / total:.5f}"]
    return [*lines, f"  TIME_BLOCK END = {total:.4f}", "ENDSPLINE"]
