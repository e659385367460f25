"""Kinova Gen3: the joints at every millisecond as a table, and a Python program that sends them as one trajectory.

Grammar: Kinova, Kortex API, PreComputedJointTrajectory and PreComputedJointTrajectoryElement (degrees, seconds),
BaseClient.PlayPreComputedJointTrajectory, Action.reach_joint_angles; its conditions (from 0 s in steps of 1 ms, at most
30 s, from where the arm is): precomputed_joint_trajectories.md of Kinovarobotics/matlab_kortex.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...base.arguments import typed
from ...base.errors import ExportError
from ...motion import TimedTrajectory
from .moves import Dialect
from .robot_program import Program, header, program_name, python_text
from .targets import MILLISECOND, Wiring, every_millisecond, table

LONGEST = 30.0
"""Seconds of a trajectory that the arm takes."""

DIALECT = Dialect("Kortex", "", "", ("", ""), own=(6, 7), kinds=("joint",))


@typed
def to_kinova(
    timed: TimedTrajectory, *, name: str | None = None, about: str = "", wiring: Wiring | None = None
) -> Program:
    """A table NAME.csv of joints, rates and accelerations in degrees at every millisecond, and NAME.py, which sends it.

    The program is for the Kortex API of the Gen3. It moves to the first row at 10 degrees/s, first; the arm judges the
    trajectory as a whole before it moves along it.

    Args:
        name: of the files.
        about: a line of the header: the strategy.
        wiring: of the six or seven joints.

    Raises:
        ExportError: a robot of other than six or seven axes; a motion of more than 30 s.
        ArgumentError: the step of the motion is no whole number of milliseconds; a bad name or wiring.
    """
    goals, q = every_millisecond(timed, wiring, DIALECT)
    if timed.duration > LONGEST:
        fact = f"the motion takes {timed.duration:.4g} s, and the arm takes trajectories of {LONGEST:g} s"
        raise ExportError(fact, "make the motion faster, or divide the path")
    short = program_name(name, about, 64, goals)
    shown = goals.shown(q)
    rates = np.gradient(shown, MILLISECOND, axis=0)
    rows = np.hstack([shown, rates, np.gradient(rates, MILLISECOND, axis=0)])
    axes = q.shape[1]
    units = {"q": "deg", "v": "deg/s", "a": "deg/s^2"}
    columns = [f"{what}{i} [{unit}]" for what, unit in units.items() for i in range(1, axes + 1)]
    head = header(timed, about, goals, ["degrees; one row a millisecond", "the program needs kortex_api"])
    wait = f"{timed.duration + 60.0:.0f}"
    text = python_text("kinova", short, head, axes=axes, step=f"{MILLISECOND:g}", wait=wait)
    return replace(head.program({f"{short}.py": text, f"{short}.csv": table(columns, rows, 7)}, goals), targets=len(q))
