"""Franka: the joints at every millisecond as a table, and a Python program that sends them through libfranka.

Grammar: Franka Robotics, pylibfranka 0.21 (Robot, start_joint_position_control, readOnce, writeOnce, JointPositions,
motion_finished), and the greatest accelerations and jerks of libfranka's include/franka/rate_limiting.h. The table is
for C++ as well: the callback of franka::Robot::control returns a row a millisecond.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...base.arguments import typed
from ...base.errors import ExportError
from ...base.types import Matrix
from ...base.units import SI
from ...motion import TimedTrajectory
from .moves import Dialect
from .robot_program import Program, docstring, header, program_name
from .targets import MILLISECOND, Wiring, every_millisecond, table

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
    goals, q = every_millisecond(timed, wiring, DIALECT)
    _within_limits(q)
    short = program_name(name, about, 64, goals)
    head = header(timed, about, goals, ["rad; one row a millisecond", "the program needs pylibfranka and numpy"])
    text = TEXT.format(name=short, remarks=docstring(head), step=MILLISECOND)
    files = {f"{short}.py": text, f"{short}.csv": table([f"q{i} [rad]" for i in range(1, 8)], q, 12)}
    return replace(head.program(files, goals), targets=len(q))


def _within_limits(q: Matrix) -> None:
    """Raises: ExportError: rows q (k, 7), a millisecond apart, from rest to rest, are too much for the robot."""
    still = np.vstack([q[:1].repeat(3, axis=0), q, q[-1:].repeat(3, axis=0)])
    for what, order, most in (("an acceleration", 2, ACCELERATION), ("a jerk", 3, JERK)):
        rates = np.abs(np.diff(still, order, axis=0)).max(axis=0) / MILLISECOND**order
        if rates.max() > most:
            fact = f"joint {int(np.argmax(rates)) + 1} has {what} of {rates.max():.4g} rad/s^{order}"
            raise ExportError(f"{fact}, and the robot takes {most:g}", f"give the motion a limit of {what.split()[1]}")
