"""Staubli VAL3: a program .pgx of movej, movel and movec.

Grammar: Staubli, "VAL3 Reference Manual" (version 7): programs as XML with <Locals> and <Code>, jointRx, pointRx, mdesc
(accel, decel, vel in per cent; tvel in mm/s, rvel in degrees/s; blend, leave, reach), jointToPoint, waitEndMove, delay.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from ...base.arguments import typed
from ...base.errors import ExportError
from ...base.types import Vector, not_negative
from ...motion import TimedTrajectory
from .moves import Dialect, ProcessLines, ToolTolerance
from .robot_program import Program, checked_name, header, program_name
from .targets import Targets, Wiring, speed_shares, targets, with_lines, zones

NAME = 15
"""Characters of a VAL3 name."""

LOCALS = {"l_jA": "jointRx", "l_jB": "jointRx", "l_pA": "pointRx", "l_pB": "pointRx", "l_mDesc": "mdesc"}
"""Variables of the program, with their types."""

DIALECT = Dialect(
    "VAL3",
    "diOut{number}={state}",
    "delay({seconds:g})",
    ("false", "true"),
    halt="waitEndMove()",
    forbidden=r"\]\]>|^(begin|end)\b",
)


@typed
def to_val3(
    timed: TimedTrajectory, *, name: str | None = None, about: str = "", wiring: Wiring | None = None,
    tolerance: float | ToolTolerance = 2e-3, lines: ProcessLines | None = None, speeds: Sequence[float] | None = None,
    zone: float = 1e-3, tool: str = "flange", base: str = "world",
) -> Program:  # fmt: skip
    """A VAL3 program NAME.pgx of a robot of six joints, in degrees, for an application that has its tool and frame.

    A movej has its share of the joints' nominal speeds (mdesc.vel), since VAL3 knows no time of a move; movel and movec
    have their speed in mm/s (mdesc.tvel). They go to jointToPoint(tool, frame, joints), the point that the controller
    itself computes of our joints.

    Args:
        name: of the program, at most 15 letters, digits and underscores.
        about: a line of the header: the strategy.
        wiring: of the controller's six joints.
        tolerance: of the joints [rad or m], see `Program.deviation`, or of the tool.
        lines: of the process. "output 3 on" sets the application's dio variable diOut3.
        speeds: nominal speeds of the joints [rad/s], as the controller knows them; by default the limits of the motion.
        zone: [m] of leave and reach at targets that are passed; at most half a move.
        tool, base: names of a tool and a frame of the application.

    Raises:
        ExportError: a robot of other than six joints; a move faster than the nominal speed.
        ArgumentError: bad names, wiring or lines.
    """
    goals = targets(timed, wiring, DIALECT, tolerance, lines)
    short = program_name(name, about, NAME, goals, (tool, base))
    for what in (tool, base):
        checked_name(what, NAME, "VAL3", program=False)
    radii, less = zones(goals, not_negative("zone", zone))
    more = ["degrees, mm", f"tool {tool}, frame {base}"]
    more += [f"leave and reach are half a move at {less} targets, where that is less"] if less else []
    head = header(timed, about, goals, more)
    facts = [f"// {line}" for line in head.lines]
    shares = speed_shares(goals, speeds)
    first = ["l_mDesc.accel=100", "l_mDesc.decel=100", "l_mDesc.vel=10", "l_mDesc.blend=off"]
    first += [*_joints("A", goals, goals.q[0]), f"movej(l_jA,{tool},l_mDesc)", "waitEndMove()"]
    first.append("l_mDesc.rvel=10000")  # degrees/s: on linear moves the speed in mm/s is to bind
    moves = [_move(goals, i, float(shares[i]), float(radii[i + 1]), (tool, base)) for i in range(len(goals.moves))]
    body = with_lines(goals, [first, *moves])
    local = '      <Local name="{}" type="{}" xsi:type="array" size="1" />'
    declared = [local.format(name, kind) for name, kind in LOCALS.items()]
    spaces = 'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"'
    spaces += ' xmlns="http://www.staubli.com/robotics/VAL3/Program/2"'
    text = ['<?xml version="1.0" encoding="utf-8"?>', f"<Programs {spaces}>"]
    text += [f'  <Program name="{escape(short)}" access="public">', "    <Locals>", *declared, "    </Locals>"]
    text += ["    <Code><![CDATA[begin", *(f"  {line}" for line in [*facts, *body, "waitEndMove()"])]
    text += ["end]]></Code>", "  </Program>", "</Programs>", ""]
    return head.program({f"{short}.pgx": "\n".join(text)}, goals)


def _move(goals: Targets, i: int, share: float, radius: float, cell: tuple[str, str]) -> list[str]:
    """The lines of a move to target i + 1. Raises: ExportError: too fast."""
    move, (tool, base) = goals.moves[i], cell
    blend = "off" if not radius else "joint" if move.kind == "joint" else "Cartesian"
    lines = [f"l_mDesc.blend={blend}"]
    lines += [f"l_mDesc.leave={1e3 * radius:.3f}", f"l_mDesc.reach={1e3 * radius:.3f}"] if radius else []
    lines += _joints("A", goals, goals.q[i + 1])
    if move.kind == "joint":
        if share > 1.0:
            fact = f"the move to target {i + 2} takes {100 * share:.3g} % of the nominal speed"
            raise ExportError(fact, "slow the motion, or give the controller's speeds=")
        return [*lines, f"l_mDesc.vel={100 * share:.6g}", f"movej(l_jA,{tool},l_mDesc)"]
    lines += ["l_mDesc.vel=100", f"l_mDesc.tvel={1e3 * move.speed:.6g}", f"l_pA=jointToPoint({tool},{base},l_jA)"]
    if move.kind == "linear":
        return [*lines, f"movel(l_pA,{tool},l_mDesc)"]
    via = [*_joints("B", goals, goals.via[i]), f"l_pB=jointToPoint({tool},{base},l_jB)"]
    return [*lines, *via, f"movec(l_pB,l_pA,{tool},l_mDesc)"]


def _joints(which: str, goals: Targets, row: Vector) -> list[str]:
    return [f"l_j{which}={{{','.join(f'{x:.6f}' for x in goals.shown(row))}}}"]
