"""Yaskawa INFORM: a job .JBI of MOVJ and MOVL to positions in pulses.

Grammar: Yaskawa, "DX200 / YRC1000 Options: Instructions for INFORM Language" (MOVJ, MOVL, DOUT, TIMER, comments of at
most 32 characters), and "DX200 Options: Instructions for Data Transmission Function" (the form of a job file: //POS
with ///NPOS, ///TOOL, ///POSTYPE PULSE, ///PULSE; //INST with ///DATE, ///ATTR, ///GROUP1). The order of seven axes,
S L U R B T E, is that of Ros_CtrlGroup_ConvertToRosPos in CtrlGroup.c of ros-industrial/motoman.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, ExportError
from ...base.types import Matrix, positive, whole
from ...motion import TimedTrajectory
from .moves import Dialect, ProcessLines, ToolTolerance
from .robot_program import Program, header, program_name
from .targets import Targets, Wiring, speed_shares, targets, with_lines

NAME, REMARK = 32, 32
"""Characters of a job's name and of a comment."""

LEVELS = 8
"""The largest position level, PL."""

DIALECT = Dialect(
    "INFORM",
    "DOUT OT#({number}) {state}",
    "TIMER T={seconds:.2f}",
    ("OFF", "ON"),
    own=(6, 7),
    external=3,
    kinds=("joint", "linear"),
    forbidden=r"^/|^END\b|^NOP\b|^'.{33}",
)


@typed
def to_inform(
    timed: TimedTrajectory, pulses: Sequence[float], *, name: str | None = None, about: str = "",
    wiring: Wiring | None = None, tolerance: float | ToolTolerance = 2e-3, lines: ProcessLines | None = None,
    speeds: Sequence[float] | None = None, zone: int = 1, tool: int = 0, group: int = 1,
    written: datetime | None = None,
) -> Program:  # fmt: skip
    """An INFORM job NAME.JBI of one robot of six or seven axes, with up to three base axes; positions are in pulses.

    A MOVJ has a share of the axes' greatest speed (VJ, in hundredths of a per cent), since INFORM knows no time of a
    move; a MOVL has its speed (V, in tenths of mm/s). The notes of the program say how much these roundings change the
    speed. There are no circular moves.

    Args:
        pulses: of each axis, the robot's six or seven in the controller's order, then the base axes [pulses per degree,
            or per mm of sliding ones], as the controller's parameters have them.
        name: of the job, at most 32 letters, digits and underscores.
        about: a line of the header: the strategy.
        wiring: of the controller's axes: S, L, U, R, B, T, and base axes as external ones. The axis E of an arm of
            seven is the third joint from the base and the controller's last axis: by default it is put there.
        tolerance: of the joints [rad or m], see `Program.deviation`, or of the tool.
        lines: of the process.
        speeds: greatest speeds of the joints [rad/s or m/s] as the controller knows them; by default the limits of the
            motion.
        zone: 0 to 8, the position level PL of targets passed without a stop; corners and the end are PL=0.
        tool: number of the tool.
        group: number of the robot on its controller: the right arm of an SDA is 2.
        written: the date in the header; by default now.

    Raises:
        ExportError: a robot of other than six or seven axes; an external joint that does not carry the arm; a move too
            slow or too fast for VJ or V.
        ArgumentError: bad names, numbers, wiring or lines.
    """
    for what, value, least, most in (("zone", zone, 0, LEVELS), ("tool", tool, 0, 63), ("group", group, 1, 8)):
        if whole(what, value, least) > most:
            raise ArgumentError(what, value, f"give a whole number from {least} to {most}")
    wiring = _seven_axes(timed, wiring or Wiring())
    goals, moves, note = _rounded(timed, wiring, tolerance, lines, speeds, zone)
    short = program_name(name, about, NAME, goals).upper()
    head = header(timed, about, goals, ["positions in pulses", *_order(wiring), f"tool {tool}, PL {zone}"], REMARK)
    remarks = [f"'{line}" for line in head.lines]
    body = ["NOP", *remarks, *with_lines(goals, moves), "END"]
    counts = _counts(goals, pulses)
    bases = counts.shape[1] - goals.own
    date = written or datetime.now()
    text = ["/JOB", f"//NAME {short}", "//POS", f"///NPOS {len(counts)},{len(counts) * bool(bases)},0,0,0,0"]
    text += [f"///TOOL {tool}", "///POSTYPE PULSE", "///PULSE"]
    text += [f"C{i:05d}={','.join(map(str, row[: goals.own]))}" for i, row in enumerate(counts)]
    text += [f"BC{i:05d}={','.join(map(str, row[goals.own :]))}" for i, row in enumerate(counts) if bases]
    groups = f"RB{group},BS{group}" if bases else f"RB{group}"
    text += ["//INST", f"///DATE {date:%Y/%m/%d %H:%M}", "///ATTR SC,RW", f"///GROUP1 {groups}"]
    files = {f"{short}.JBI": "\n".join([*text, *body, ""])}
    return head.program(files, goals, [note])


def _seven_axes(timed: TimedTrajectory, wiring: Wiring) -> Wiring:
    """The wiring with the joints of an arm of seven in the controller's order S, L, U, R, B, T, E.

    Raises: ExportError: an external joint that does not carry the arm, which no base axis is.
    """
    names = timed.joint_names
    own = [name for name in names if name not in wiring.external]
    for name in set(wiring.external) & set(names):
        if own and names.index(str(name)) > names.index(own[0]):
            within = names.index(str(name)) < names.index(own[-1])
            where = "between joints of the arm" if within else "behind the arm, as a turntable"
            cure = (
                "INFORM has arms of seven axes: leave it out of external=" if within else "export to another language"
            )
            raise ExportError(f"{name} lies {where}, and no base axis of INFORM does", cure)
    if wiring.axes is not None or len(own) != 7:
        return wiring
    return replace(wiring, axes=(*own[:2], *own[3:], own[2]))


def _order(wiring: Wiring) -> list[str]:
    """Which joints the axes of an arm of seven are, in words."""
    named = zip("SLURBTE", wiring.axes or (), strict=False)
    return ["axes " + ", ".join(f"{axis} = {entry}" for axis, entry in named)] if len(wiring.axes or ()) == 7 else []


def _counts(goals: Targets, pulses: Sequence[float]) -> Matrix:
    """Pulses of every target (k, axes). Raises: ArgumentError."""
    if len(pulses) != goals.q.shape[1]:
        cure = f"give one for each of {goals.q.shape[1]} axes, pulses per degree or per mm"
        raise ArgumentError("the pulses of the axes", list(pulses), cure)
    each = np.array([positive("the pulses of an axis", abs(x)) * np.sign(x) for x in pulses])
    return np.rint(goals.shown() * each).astype(int)


def _rounded(
    timed: TimedTrajectory,
    wiring: Wiring,
    tolerance: float | ToolTolerance,
    lines: ProcessLines | None,
    speeds: Sequence[float] | None,
    zone: int,
) -> tuple[Targets, list[list[str]], str]:
    """(targets, the instruction of each move, by how much rounding changes their speeds in words).

    Where a tolerance of the tool's speed is kept but for the roundings, the targets are chosen anew to leave room for
    them, unless they take half of it.
    """
    goals = targets(timed, wiring, DIALECT, tolerance, lines)
    moves, rounded, passing = _moves(goals, speed_shares(goals, speeds), zone)
    if isinstance(tolerance, ToolTolerance):
        room = tolerance.speed
        while goals.tool is not None and (excess := goals.tool.speed + passing - tolerance.speed) > 0.0:
            room -= max(excess, tolerance.speed / 10)
            if room < tolerance.speed / 2:
                break
            goals = targets(timed, wiring, DIALECT, replace(tolerance, speed=room), lines)
            moves, rounded, passing = _moves(goals, speed_shares(goals, speeds), zone)
    note = f"the roundings of VJ and V change the speed of a move by up to {100 * passing:.2g} %"
    note += f", of one that starts or stops by up to {100 * rounded:.2g} %" if rounded > passing else ""
    return goals, moves, note


def _moves(goals: Targets, shares: Matrix, zone: int) -> tuple[list[list[str]], float, float]:
    """(the instruction of each move, the largest share by which rounding changes a speed, of moves without a ramp).

    Raises: ExportError: a speed that INFORM does not take.
    """
    bases = goals.q.shape[1] > goals.own
    text = [[f"MOVJ {_position(0, bases)} VJ=10.00 PL=0"]]
    largest = passing = 0.0
    for i, (move, share) in enumerate(zip(goals.moves, shares.tolist(), strict=True), 1):
        joint = move.kind == "joint"
        exact = 100.0 * share if joint else 1e3 * move.speed
        value = round(exact, 2 if joint else 1)
        word, least, most = ("VJ", 0.01, 100.0) if joint else ("V", 0.1, 1500.0)
        if not least <= value <= most:
            fact = f"the move to target {i + 1} needs {word}={exact:.3g}, and INFORM takes {least:g} to {most:g}"
            raise ExportError(fact, "change the speed of the path, or take linear moves")
        change = abs(value / exact - 1.0)
        rests = i == 1 or goals.stops[i - 1], i == len(goals.moves) or goals.stops[i]
        largest, passing = max(largest, change), passing if any(rests) else max(passing, change)
        level = 0 if rests[1] else zone
        verb = f"MOVJ {_position(i, bases)} VJ={value:.2f}" if joint else f"MOVL {_position(i, bases)} V={value:.1f}"
        text.append([f"{verb} PL={level}"])
    return text, largest, passing


def _position(i: int, bases: bool) -> str:
    return f"C{i:05d} BC{i:05d}" if bases else f"C{i:05d}"
