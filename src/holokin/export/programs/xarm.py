"""UFACTORY xArm: a Python program for the maker's SDK, of joint moves that go on without a stop.

Grammar: UFACTORY, xArm-Python-SDK 1.18, doc/api/xarm_api.md: set_servo_angle (angles of all joints; a speed, at most
180 degrees/s, here that of the joint that moves farthest; radius None for a move from rest to rest, 0 for one that goes
on to the next), set_cgpio_digital, set_pause_time, motion_enable, set_mode, set_state; codes other than 0 are errors.
"""

from __future__ import annotations

import numpy as np

from ...base.arguments import typed
from ...base.errors import ExportError
from ...motion import TimedTrajectory
from .moves import Dialect, ProcessLines, ToolTolerance
from .robot_program import Program, header, program_name, python_text
from .targets import Wiring, targets, with_lines

SLOWEST, FASTEST, SWIFTEST = 0.0058, 180.0, 1145.0
"""Degrees per second, and per second^2, that the SDK takes: others it replaces by these without a word."""

DIALECT = Dialect(
    "xArm",
    "done(arm.set_cgpio_digital({number}, {state}))",
    "done(arm.set_pause_time({seconds:g}))",
    ("0", "1"),
    own=(5, 6, 7),
    kinds=("joint",),
    forbidden=r"^(def|class|import|from)\b",
)


@typed
def to_xarm(
    timed: TimedTrajectory,
    *,
    name: str | None = None,
    about: str = "",
    wiring: Wiring | None = None,
    tolerance: float | ToolTolerance = 2e-3,
    lines: ProcessLines | None = None,
) -> Program:
    """A Python program NAME.py for the SDK of UFACTORY's arms of five, six or seven joints, in degrees.

    Each move has the speed of its fastest joint, since set_servo_angle knows no time of a move. The first one leads to
    the first target at 10 degrees/s. The program ends at the first call that the controller refuses.

    Args:
        name: of the file.
        about: a line of the header: the strategy.
        wiring: of the joints J1 to J7.
        tolerance: of the joints [rad], see `Program.deviation`, or of the tool.
        lines: of the process, in Python; the arm is `arm`. "output 3 on" sets the controller's output 3.

    Raises:
        ExportError: a robot of other than five to seven axes; a move too slow or too fast for the SDK.
        ArgumentError: bad names, wiring or lines.
    """
    goals = targets(timed, wiring, DIALECT, tolerance, lines)
    short = program_name(name, about, 64, goals)
    shown = goals.shown()
    speeds = np.abs(np.diff(shown, axis=0)).max(axis=1) / goals.seconds
    for i, speed in enumerate(speeds.tolist(), 2):
        if not SLOWEST <= speed <= FASTEST:
            fact = f"the move to target {i} needs {speed:.3g} deg/s, and the SDK takes {SLOWEST:g} to {FASTEST:g}"
            raise ExportError(fact, "change the speed of the path")
    moves = []
    for i, (row, speed) in enumerate(zip(shown, [10.0, *speeds.tolist()], strict=True)):
        stop = ", stop=True" if i in (0, len(shown) - 1) or goals.stops[i] else ""
        moves.append([f"move([{', '.join(f'{x:.6f}' for x in row)}], {speed:.6f}{stop})"])
    fastest = timed.limits.acceleration.min()
    acceleration = min(float(np.rad2deg(fastest)), SWIFTEST)
    said = f"degrees; joints gather speed at {acceleration:.6g} deg/s^2"
    head = header(timed, about, goals, [said, "the program needs xarm-python-sdk"])
    body = "\n".join(with_lines(goals, moves))
    text = python_text("xarm", short, head, acceleration=f"{acceleration:g}", body=body)
    return head.program({f"{short}.py": text}, goals)
