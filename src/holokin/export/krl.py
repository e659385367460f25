"""KUKA KRL: blocks of `SPTP` to joint targets, each block in the time of the timed trajectory.

Grammar: KUKA System Software 8.3, "Operating and Programming Instructions for System Integrators": DEF, DEFDAT,
E6AXIS, PTP_SPLINE, SPTP, TIME_BLOCK; names of at most 24 characters.
"""

from __future__ import annotations

from ..base.arguments import typed
from ..motion import TimedTrajectory
from .robot_program import Program, Wiring, header, program_name, targets

NAME = 24
"""Characters of a KRL name."""


@typed
def to_krl(
    timed: TimedTrajectory, *, name: str | None = None, about: str = "", wiring: Wiring | None = None,
    tolerance: float = 2e-3,
) -> Program:  # fmt: skip
    """A KRL program NAME.src with its data list NAME.dat: E6AXIS targets in degrees, external axes in degrees or mm.

    From rest to rest one PTP_SPLINE, which passes through all its targets, with a TIME_BLOCK of their times (from
    KSS 8.3 on). The first target is reached by SPTP with a tenth of the axis speed.

    Args:
        name: of the program, at most 24 letters, digits and underscores.
        about: a line of the header: the law.
        wiring: of the controller's axes: A1 to A6, and E1 to E6 as external ones. A robot of seven axes (iiwa) has
            another controller and language.
        tolerance: [rad or m] see `Program.deviation`.

    Raises:
        ExportError: a robot of other than six axes, external ones left out. ArgumentError: bad names or wiring.
    """
    wiring = wiring or Wiring()
    found = targets(timed, wiring, 6, 6, "KRL", tolerance)
    short = program_name(name, about or "holokin", NAME, "KRL")
    more = ["degrees, external axes degrees or mm; TIME_BLOCK needs KSS 8.3 or later"]
    facts = [f"; {line}" for line in header(timed, about, found, wiring, more, 76)]
    words = [f"A{i}" for i in range(1, 7)] + [f"E{i}" for i in range(1, 7)]
    lines = ["&ACCESS RVP", "&REL 1", f"DEF {short}()", *facts, "BAS(#INITMOV,0)", "BAS(#VEL_PTP,10)", "SPTP XP1"]
    lines += ["BAS(#VEL_PTP,100)", "BAS(#ACC_PTP,100)"]
    for part in found.parts:
        times = found.t[part.start : part.stop]
        total = times[-1] - times[0]
        lines += ["PTP_SPLINE", f"  SPTP XP{part.start + 1}", "  TIME_BLOCK START"]
        for k, seconds in zip(part[1:], times[1:] - times[:-1], strict=True):
            lines += [f"  SPTP XP{k + 1}", f"  TIME_BLOCK PART = {100 * seconds / total:.5f}"]
        lines += [f"  TIME_BLOCK END = {total:.4f}", "ENDSPLINE"]
    data = ["&ACCESS RVP", "&REL 1", f"DEFDAT {short} PUBLIC"]
    for i, row in enumerate(found.shown(), 1):
        values = ",".join(f"{word} {x:.6f}" for word, x in zip(words, row, strict=False))
        data.append(f"DECL E6AXIS XP{i}={{{values}}}")
    files = {f"{short}.src": "\n".join([*lines, "END", ""]), f"{short}.dat": "\n".join([*data, "ENDDAT", ""])}
    return Program(files, len(found.t), found.deviation)
