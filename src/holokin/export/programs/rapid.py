"""ABB RAPID: `MoveAbsJ`, `MoveL` and `MoveC` to joint targets, in the times and at the speeds of the timed trajectory.

Grammar: ABB, "Technical reference manual: RAPID Instructions, Functions and Data types" (3HAC050917), MoveAbsJ, MoveL,
MoveC, CirPathMode, CalcRobT, GripLoad, SetDO, jointtarget, robjoint, extjoint, speeddata; "RAPID kernel" (3HAC050946),
identifiers of at most 32 characters; "Application manual: Arc and Arc Sensor" (3HAC050988), ArcLStart, ArcL, ArcLEnd,
ArcCStart, ArcC, ArcCEnd with their speed, seam, weld, zone, tool and WObj.
"""

from __future__ import annotations

from collections.abc import Sequence

from ...base.arguments import typed
from ...base.errors import ArgumentError, ExportError
from ...base.types import not_negative
from ...motion import TimedTrajectory
from .moves import Dialect, ProcessLines, ToolTolerance
from .robot_program import Program, checked_name, header, program_name
from .targets import Targets, Wiring, targets, with_lines, zones

NAME = 32
"""Characters of a RAPID identifier."""

ARCS = "ArcLStart ArcL ArcLEnd ArcCStart ArcC ArcCEnd"
"""Moves of an arc welder."""

DIALECT = Dialect(
    "RAPID",
    "SetDO do{number},{state}",
    "WaitTime {seconds:g}",
    ("0", "1"),
    external=6,
    forbidden=r"^\s*(END)?(PROC|MODULE|FUNC|TRAP)\b",
    end=";",
)


@typed
def to_rapid(
    timed: TimedTrajectory,
    *,
    name: str | None = None,
    about: str = "",
    wiring: Wiring | None = None,
    tolerance: float | ToolTolerance = 2e-3,
    lines: ProcessLines | None = None,
    zone: str | float = "z1",
    tool: str = "tool0",
    base: str | None = None,
    payload: str | None = None,
    arc: Sequence[str] | None = None,
) -> Program:
    """A RAPID module NAME.mod with one procedure of moves to joint targets in degrees, external axes in degrees or mm.

    A `MoveAbsJ` has its time as \\T. A `MoveL` or `MoveC` has its speed as \\V in mm/s; it goes to
    CalcRobT(jointtarget), the pose with the axis configuration that the controller itself computes of our joints. The
    first move goes to the start at v100 and stops; corners and the end are `fine`, the others have the zone.

    Args:
        name: of the procedure, at most 30 letters, digits and underscores; the module has _M at its end.
        about: a line of the header: the strategy.
        wiring: of the controller's axes: six of the robot, six external ones (a YuMi's seventh axis is the first).
        tolerance: of the joints [rad or m], see `Program.deviation`, or of the tool. A controller smooths between
            targets in its own way.
        lines: of the process. "output 3 on" sets the signal do3.
        zone: of targets passed without a stop: the name of zonedata, or a radius [m].
        arc: names of the seamdata and the welddata: from the start of the process to its end the moves are ArcLStart,
            ArcL, ArcC and ArcLEnd. While the arc burns the controller takes the speed of the welddata.
        tool, base, payload: names of the tooldata, the wobjdata and the loaddata; base and payload may be left out.

    Raises:
        ExportError: a robot of other than six axes, external ones left out. ArgumentError: bad names, wiring or lines.
    """
    names = (zone, tool, base, payload, *(arc or ()))
    for what in names:
        if isinstance(what, str):
            checked_name(what, NAME, "RAPID", program=False)
    if arc is not None and (len(arc) != 2 or not isinstance(zone, str)):
        raise ArgumentError("arc", list(arc), "give the names of the seamdata and the welddata, and a zone by its name")
    goals = targets(timed, wiring, DIALECT, tolerance, lines)
    short = program_name(name, about, NAME - 2, goals, (*names, ARCS if arc else None))
    # The targets, then the moves to them.
    places, reduced = _zones(goals, zone)
    used = tool if base is None else f"{tool}\\WObj:={base}"
    more = [f"degrees, external axes degrees or mm; zone {zone}, tool {used}", *reduced]
    head = header(timed, about, goals, more, 76)
    text = [f"MODULE {short}_M", *(f"  ! {line}" for line in head.lines)]
    text += [line for i in range(len(goals.q)) for line in _declared(f"p{i + 1}", goals, i)]
    text += [line for i in goals.via for line in _declared(f"c{i + 2}", goals, i, via=True)]
    moves = [[f"    MoveAbsJ p1\\NoEOffs,v100,fine,{used};"]]
    for i, (move, seconds) in enumerate(zip(goals.moves, goals.seconds, strict=True), 2):
        way, end = f"{places[i - 1]},{used};", f"CalcRobT(p{i},{used})"
        if move.kind == "joint":
            moves.append([f"    MoveAbsJ p{i}\\NoEOffs,v1000\\T:={seconds:.4f},{way}"])
        elif move.kind == "linear":
            moves.append([f"    MoveL {end},v1000\\V:={1e3 * move.speed:.3f},{way}"])
        else:
            moves.append([f"    MoveC CalcRobT(c{i},{used}),{end},", f"      v1000\\V:={1e3 * move.speed:.3f},{way}"])
    notes = []
    if arc is not None:
        declared, notes = _welded(goals, moves, f"{arc[0]},{arc[1]}", zone, used)
        text += declared
    load = [] if payload is None else [f"GripLoad {payload};"]
    body = with_lines(goals, moves)
    if goals.via:  # the tool turns evenly from the start to the end of an arc, not along with the arc
        body = ["CirPathMode\\ObjectFrame;", *body, "CirPathMode\\PathFrame;"]
    text += ["", f"  PROC {short}()", *(f"    {line.strip()}" for line in [*load, *body])]
    text += ["  ENDPROC", "ENDMODULE", ""]
    return head.program({f"{short}_M.mod": "\n".join(text)}, goals, notes)


def _welded(
    goals: Targets, moves: list[list[str]], data: str, zone: str | float, used: str
) -> tuple[list[str], list[str]]:
    """Puts the moves of the arc into the place of those along the seam; returns speeddata, and notes.

    Raises: ExportError: joint moves along the seam.
    """
    speeds: dict[str, str] = {}
    welded: set[str] = set()
    for i in range(goals.on, goals.off + 1):
        move = goals.moves[i - 1] if i else None
        place = "Start" if i == goals.on else "End" if i == goals.off else ""
        way = f"{'fine' if place or goals.stops[i] else zone},{used};"
        if move is None or move.kind == "joint":
            if place != "Start":
                fact = f"the move to target {i + 1} is a joint move, and no arc burns on one"
                raise ExportError(fact, "give linear = true, and a larger tool_tolerance")
            # A joint move led here: the arc starts where the torch stands.
            moves[i].append(f"    ArcLStart CalcRobT(p{i + 1},{used}),v100,{data},{way}")
            continue
        speed = speeds.setdefault(f"{1e3 * move.speed:.3f}", f"s{len(speeds) + 1}")
        welded |= {f"{1e3 * move.speed:.4g}"} if place != "Start" else set()
        if move.kind == "linear":
            moves[i] = [f"    ArcL{place} CalcRobT(p{i + 1},{used}),{speed},{data},{way}"]
        else:
            via = f"CalcRobT(c{i + 1},{used}),CalcRobT(p{i + 1},{used})"
            moves[i] = [f"    ArcC{place} {via},", f"      {speed},{data},{way}"]
    declared = [f"  CONST speeddata {name}:=[{speed},500,5000,1000];" for speed, name in speeds.items()]
    said = f"while the arc burns its speed is that of the welddata: set weld_speed to {', '.join(sorted(welded))} mm/s"
    return declared, [said]


def _declared(name: str, goals: Targets, i: int, via: bool = False) -> list[str]:
    row = goals.shown(goals.via[i] if via else goals.q[i])
    own = ",".join(f"{x:.6f}" for x in row[: goals.own])
    other = [f"{x:.6f}" for x in row[goals.own :]]
    other += ["9E+09"] * (6 - len(other))  # stands for an external axis that there is not
    return [f"  CONST jointtarget {name}:=[[{own}],", f"    [{','.join(other)}]];"]


def _zones(goals: Targets, zone: str | float) -> tuple[list[str], list[str]]:
    """The zone of each target, and what the header says of them. The controller itself halves named ones."""
    if isinstance(zone, str):
        last = len(goals.q) - 1
        return ["fine" if i in (0, last) or stop else zone for i, stop in enumerate(goals.stops)], []
    radii, less = zones(goals, not_negative("zone", zone))
    sentences = [f"the zone is half a move at {less} targets, where that is less"] if less else []
    return [f"z1\\Z:={1e3 * radius:.3f}" if radius else "fine" for radius in radii], sentences
