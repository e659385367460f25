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
from .robot_program import Program, docstring, header, program_name
from .targets import MILLISECOND, Wiring, every_millisecond, table

LONGEST = 30.0
"""Seconds of a trajectory that the arm takes."""

DIALECT = Dialect("Kortex", "", "", ("", ""), own=(6, 7), kinds=("joint",))

TEXT = '''"""
{remarks}

python {name}.py IP USER PASSWORD
"""

import csv
import sys
import threading
from pathlib import Path

from kortex_api.autogen.client_stubs.BaseClientRpc import BaseClient
from kortex_api.autogen.messages import Base_pb2, Session_pb2
from kortex_api.RouterClient import RouterClient
from kortex_api.SessionManager import SessionManager
from kortex_api.TCPTransport import TCPTransport

ip, user, password = sys.argv[1:]
with Path(__file__).with_suffix(".csv").open() as file:
    rows = [[float(x) for x in row] for row in list(csv.reader(file))[1:]]

transport = TCPTransport()
router = RouterClient(transport, RouterClient.basicErrorCallback)
transport.connect(ip, 10000)
session = SessionManager(router)
session.CreateSession(
    Session_pb2.CreateSessionInfo(
        username=user, password=password, session_inactivity_timeout=60000, connection_inactivity_timeout=2000
    )
)
base = BaseClient(router)


def done(begin):
    """Begin a motion, and wait for its end. A motion that the arm breaks off ends the program."""
    ended, last = threading.Event(), []

    def hear(notification):
        if notification.action_event in (Base_pb2.ACTION_END, Base_pb2.ACTION_ABORT):
            last.append(notification.action_event)
            ended.set()

    handle = base.OnNotificationActionTopic(hear, Base_pb2.NotificationOptions())
    begin()
    heard = ended.wait({wait:.0f})
    base.Unsubscribe(handle)
    if not heard or last[0] == Base_pb2.ACTION_ABORT:
        raise SystemExit(f"stopped: {{base.GetTrajectoryErrorReport()}}")


def to_start():
    """To the first row, no joint faster than 10 degrees/s."""
    action = Base_pb2.Action()
    action.reach_joint_angles.constraint.type = Base_pb2.JOINT_CONSTRAINT_SPEED
    action.reach_joint_angles.constraint.value = 10.0
    for i, angle in enumerate(rows[0][:{axes}]):
        action.reach_joint_angles.joint_angles.joint_angles.add(joint_identifier=i, value=angle % 360.0)
    base.ExecuteAction(action)


def play():
    trajectory = Base_pb2.PreComputedJointTrajectory(mode=Base_pb2.TRAJECTORY_CONTINUITY_MODE_POSITION)
    n = {axes}
    for i, row in enumerate(rows):
        rates = dict(joint_speeds=row[n : 2 * n], joint_accelerations=row[2 * n :])
        trajectory.trajectory_elements.add(joint_angles=row[:n], time_from_start=i * {step:g}, **rates)
    base.PlayPreComputedJointTrajectory(trajectory)


done(to_start)
done(play)
session.CloseSession()
transport.disconnect()
'''


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
    wait = timed.duration + 60.0
    text = TEXT.format(name=short, remarks=docstring(head), axes=axes, step=MILLISECOND, wait=wait)
    return replace(head.program({f"{short}.py": text, f"{short}.csv": table(columns, rows, 7)}, goals), targets=len(q))
