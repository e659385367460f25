"""ABB RAPID: `MoveAbsJ` to joint targets, each in the time that the timed trajectory takes to it.

Grammar: ABB, "Technical reference manual: RAPID Instructions, Functions and Data types" (3HAC050917), MoveAbsJ,
jointtarget, robjoint, extjoint; "RAPID kernel" (3HAC050946), identifiers of at most 32 characters.
"""

from __future__ import annotations

from ..base.arguments import typed
from ..motion import TimedTrajectory
from .robot_program import Program, Wiring, header, program_name, targets

NAME = 32
"""Characters of a RAPID identifier."""

UNUSED = "9E+09"
"""What stands for an external axis that there is not."""


@typed
def to_rapid(
    timed: TimedTrajectory, *, name: str | None = None, about: str = "", wiring: Wiring | None = None,
    tolerance: float = 2e-3, zone: str = "z1", tool: str = "tool0",
) -> Program:  # fmt: skip
    """A RAPID module NAME.mod with one procedure of `MoveAbsJ` in degrees, external axes in degrees or mm.

    Every move has its time as \\T. The first goes to the start at v100 and stops; corners and the end are `fine`,
    the others `zone`.

    Args:
        name: of the procedure, at most 30 letters, digits and underscores; the module has _M at its end.
        about: a line of the header: the law.
        wiring: of the controller's axes: six of the robot, six external ones (a YuMi's seventh axis is the first).
        tolerance: [rad or m] see `Program.deviation`. A controller smooths between targets in its own way.
        zone: name of the zonedata of targets passed without a stop.
        tool: name of the tooldata.

    Raises:
        ExportError: a robot of other than six axes, external ones left out. ArgumentError: bad names or wiring.
    """
    wiring = wiring or Wiring()
    found = targets(timed, wiring, 6, 6, "RAPID", tolerance)
    short = program_name(name, about or "holokin", NAME - 2, "RAPID")
    for what in (zone, tool):
        program_name(what, "", NAME, "RAPID")
    more = [f"degrees, external axes degrees or mm; zone {zone}, tool {tool}"]
    lines = [f"MODULE {short}_M", *(f"  ! {line}" for line in header(timed, about, found, wiring, more, 76))]
    shown = found.shown()
    for i, row in enumerate(shown, 1):
        own = ",".join(f"{x:.6f}" for x in row[: found.own])
        other = [f"{x:.6f}" for x in row[found.own :]]
        lines.append(f"  CONST jointtarget p{i}:=[[{own}],")
        lines.append(f"    [{','.join(other + [UNUSED] * (6 - len(other)))}]];")
    lines += ["", f"  PROC {short}()", f"    MoveAbsJ p1\\NoEOffs,v100,fine,{tool};"]
    last = len(shown) - 1
    for i, seconds in enumerate(found.seconds, 1):
        here = "fine" if i == last or found.stops[i] else zone
        lines.append(f"    MoveAbsJ p{i + 1}\\NoEOffs,v1000\\T:={seconds:.4f},{here},{tool};")
    lines += ["  ENDPROC", "ENDMODULE", ""]
    return Program({f"{short}_M.mod": "\n".join(lines)}, len(shown), found.deviation)
