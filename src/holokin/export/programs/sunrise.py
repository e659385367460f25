"""KUKA Sunrise: a Java class for an LBR iiwa with splines of joint targets.

Grammar: KUKA, "Sunrise.OS, Operating and Programming Instructions for System Integrators": RoboticsAPIApplication, ptp,
SplineJP of SplineMotionJP segments, JointPosition [rad], setJointVelocityRel (a share of the axes' greatest speed, also
of a segment), ThreadUtil.milliSleep. How they are called: the public class of iiwa_stack and of ros_sunrise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...base.arguments import typed
from ...base.errors import ExportError
from ...motion import TimedTrajectory
from ..c.c_text import text
from .moves import Dialect, ProcessLines, ToolTolerance
from .robot_program import Program, header, program_name
from .targets import Wiring, speed_shares, targets, with_lines

NAME = 64
"""Characters of a class's name, of which Java has no most."""

MOST = 1000
"""Targets of a class: Java takes 65,535 bytes for the code that fills an array, and a target needs 61."""

DIALECT = Dialect(
    "Sunrise",
    "",
    "ThreadUtil.milliSleep({milliseconds:.0f})",
    ("", ""),
    own=(7,),
    kinds=("joint",),
    forbidden=r"^\s*\}|^\s*(class|import|package)\b",
    end=";",
)


@typed
def to_sunrise(
    timed: TimedTrajectory,
    *,
    name: str | None = None,
    about: str = "",
    wiring: Wiring | None = None,
    tolerance: float | ToolTolerance = 2e-3,
    lines: ProcessLines | None = None,
    speeds: Sequence[float] | None = None,
) -> Program:
    """A Java class NAME.java for Sunrise.OS: SplineJP motions of an LBR iiwa through joint targets, from rest to rest.

    A segment has the share of the axes' greatest speed that gives it its time, since Sunrise knows no time of one. The
    first target is reached by a ptp with a tenth of the axis speed.

    Args:
        name: of the class, letters, digits and underscores.
        about: a line of the header: the strategy.
        wiring: of the axes A1 to A7.
        tolerance: of the joints [rad], see `Program.deviation`, or of the tool.
        lines: of the process, in Java. Outputs belong to an I/O group of the project, of which only its lines know.
        speeds: greatest speeds of the joints [rad/s] as the controller knows them; by default the limits of the motion.

    Raises:
        ExportError: a robot of other than seven axes; too many targets; a move faster than the greatest speed.
        ArgumentError: bad names, wiring or lines.
    """
    goals = targets(timed, wiring, DIALECT, tolerance, lines)
    if len(goals.t) > MOST:
        raise ExportError(f"{len(goals.t)} targets, and a class of Java holds {MOST}", "give a larger tolerance")
    short = program_name(name, about, NAME, goals)
    shares = speed_shares(goals, speeds)
    if shares.max() > 1.0:
        fact = f"the move to target {int(np.argmax(shares)) + 2} takes {100 * shares.max():.3g} % of the greatest speed"
        raise ExportError(fact, "slow the motion, or give the controller's speeds=")
    # The targets, and a spline up to each stop.
    rows = np.column_stack([goals.shown(), [0.1, *shares]])
    cells = [f"        {{{', '.join(f'{x:.6f}' for x in row[:7])}, {row[7]:.9f}}}," for row in rows]
    ends = [i for i in range(1, len(rows)) if goals.stops[i] or i == len(rows) - 1]
    first = dict(zip(ends, [1, *(end + 1 for end in ends)], strict=False))
    moves = [["lbr.move(target(0));"]]
    moves += [[f"lbr.move(spline({first[i]}, {i}));"] if i in first else [] for i in range(1, len(rows))]
    head = header(timed, about, goals, ["degrees; shares of the axes' greatest speeds"])
    words = {"name": short, "remarks": "\n".join(f"// {line}" for line in head.lines), "targets": "\n".join(cells)}
    words["body"] = "\n".join(f"        {line}" for line in with_lines(goals, moves))
    return head.program({f"{short}.java": text("sunrise.java", words, "programs")}, goals)
