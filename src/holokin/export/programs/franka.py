"""Franka: the joints at every millisecond as a table, and a Python program that sends them through libfranka.

Grammar: Franka Robotics, pylibfranka 0.21 (Robot, start_joint_position_control, readOnce, writeOnce, JointPositions,
motion_finished), and the greatest accelerations and jerks of libfranka's include/franka/rate_limiting.h. The table is
for C++ as well: the callback of franka::Robot::control returns a row a millisecond.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, ExportError
from ...base.types import Matrix
from ...base.units import SI
from ...motion import TimedTrajectory
from .moves import Dialect, finer
from .robot_program import Program, header, program_name
from .targets import Wiring, targets, wired

STEP = 1e-3
"""Seconds of a control cycle."""

ACCELERATION, JERK = 10.0, 5000.0
"""The most that a Franka Research 3 takes of a joint [rad/s^2, rad/s^3]."""

DIALECT = Dialect("libfranka", "", "", ("", ""), own=(7,), kinds=("joint",), units=SI)

TEXT = '''"""
{remarks}

python {name}.py IP
"""

import sys
from pathlib import Path

import numpy as np
from pylibfranka import ControllerMode, JointPositions, Robot


def play(robot, rows):
    """Send a row a millisecond; after a lost message the rows of its time are left out, as libfranka wants it."""
    control = robot.start_joint_position_control(ControllerMode.JointImpedance)
    elapsed = 0.0
    while True:
        state, period = control.readOnce()
        elapsed += period.to_sec()
        i = min(round(elapsed / {step:g}), len(rows) - 1)
        command = JointPositions(rows[i].tolist())
        command.motion_finished = i == len(rows) - 1
        control.writeOnce(command)
        if command.motion_finished:
            return


def to_start(q, first):
    """From rest to rest, by a polynomial of degree five, no joint faster than 0.2 rad/s."""
    seconds = max(1.0, 1.875 * float(np.abs(first - q).max()) / 0.2)
    s = np.linspace(0.0, 1.0, round(seconds / {step:g}) + 1)[:, None]
    return q + s**3 * (10.0 - 15.0 * s + 6.0 * s**2) * (first - q)


robot = Robot(sys.argv[1])
rows = np.loadtxt(Path(__file__).with_suffix(".csv"), delimiter=",", skiprows=1)
play(robot, to_start(np.array(robot.read_once().q_d), rows[0]))
play(robot, rows)
'''


@typed
def to_franka(
    timed: TimedTrajectory, *, name: str | None = None, about: str = "", wiring: Wiring | None = None
) -> Program:
    """A table NAME.csv of the seven joints [rad] at every millisecond, and NAME.py, which sends it by pylibfranka.

    Between the samples of the motion the joints are those of the polynomial of degree five through positions, rates and
    accelerations of both. The program moves to the first row slowly, first.

    Args:
        name: of the files.
        about: a line of the header: the strategy.
        wiring: of the seven joints.

    Raises:
        ExportError: a robot of other than seven axes; an acceleration or jerk that the robot refuses.
        ArgumentError: the step of the motion is no whole number of milliseconds; a bad name or wiring.
    """
    each = round(timed.dt / STEP)
    if each < 1 or abs(each * STEP - timed.dt) > 1e-9:
        raise ArgumentError("dt of the trajectory", timed.dt, "retime it with whole milliseconds, as dt=0.004")
    goals = targets(timed, wiring, DIALECT, None, None)
    short = program_name(name, about, 64, goals)
    q = wired(timed, goals.wiring, DIALECT, finer(timed, each)[1])[0]
    fastest = _greatest(q)
    goals = replace(goals, deviation=fastest * STEP**2 / 8)  # the height of a parabola's arc over a step
    head = header(timed, about, goals, ["rad; one row a millisecond", "the program needs pylibfranka and numpy"])
    remarks = "\n".join(line.replace('"', "'").replace("\\", "/") for line in head.lines)
    rows = [",".join(f"{x:.12f}" for x in row) for row in q + 0.0]
    table = "\n".join([",".join(f"q{i} [rad]" for i in range(1, 8)), *rows, ""])
    text = TEXT.format(name=short, remarks=remarks, step=STEP)
    return replace(head.program({f"{short}.py": text, f"{short}.csv": table}, goals), targets=len(q))


def _greatest(q: Matrix) -> float:
    """The greatest acceleration of rows q (k, 7), a step apart, from rest to rest. Raises: ExportError: too much."""
    still = np.vstack([q[:1].repeat(3, axis=0), q, q[-1:].repeat(3, axis=0)])
    for what, order, most in (("jerk", 3, JERK), ("acceleration", 2, ACCELERATION)):
        rates = np.abs(np.diff(still, order, axis=0)).max(axis=0) / STEP**order
        if rates.max() > most:
            fact = f"{what} of {rates.max():.4g} rad/s^{order} at joint {int(np.argmax(rates)) + 1}"
            raise ExportError(f"{fact}, and the robot takes {most:g}", f"give the motion a limit of {what}")
    return float(rates.max())
