"""The laws of a session: a strategy or a control law, with a name, a colour, and what a job file says of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ...analysis.coverage import locked_joints
from ...base.errors import ArgumentError, HolokinError, NoArmError
from ...base.types import Value, Vector
from ...motion.control import ControlLaw
from ...strategies import HolonomicStrategy, Strategy, holonomic, moore_penrose, radial
from ...strategies.constraints import arm_angle, find_arm, lock
from ...strategies.tasks.task import Task


@dataclass(frozen=True, eq=False)
class Law(Value):
    """One law of a session.

    Attributes:
        name: as it is shown. colour: its index in the palette.
        rule: a strategy, or a control law (q, pose, twist, dt) -> dq.
        task: what it serves.
        level: the leaf g(q) = c (r,) that a holonomic law holds; None is that of the session's start posture.
        keys: what a job file says of it, kind and its keys; None of a law that a job cannot say.
        label: its name in a job, where one strategy is run for several tasks; else empty.
    """

    name: str
    colour: int
    rule: Strategy | ControlLaw
    task: Task
    level: Vector | None = None
    keys: Mapping[str, Any] | None = None
    label: str = ""

    @property
    def holonomic(self) -> bool:
        """True where it has leaves, so that the tool pose tells its joints."""
        return isinstance(self.rule, HolonomicStrategy)

    @property
    def strategy(self) -> Strategy | None:
        """The strategy; None of a control law."""
        return self.rule if isinstance(self.rule, Strategy) else None


def default_laws(task: Task, q0: Vector) -> tuple[Law, ...]:
    """Laws to begin with, all defined at a posture (n,).

    The pseudo-inverse; the joints locked that fix the self-motion best; the arm angle, where the task leaves one joint
    of an arm with shoulder, elbow and wrist; the radial law of the pseudo-inverse.

    Raises:
        ArgumentError: the robot has no joint to spare.
    """
    names = task.robot.joint_names
    redundant(task)
    pinv = moore_penrose(task, name="pseudo-inverse")
    joints = [names[i] for i in locked_joints(task, q0)]
    found: list[tuple[str, Strategy, Mapping[str, Any]]] = [("pseudo-inverse", pinv, {"kind": "moore-penrose"})]
    said = f"lock {', '.join(joints)}"
    found.append((said, holonomic(task, lock(*joints), name=said), {"kind": "lock", "joints": joints}))
    if task.n - task.m == 1:
        try:
            find_arm(task)
            angle = holonomic(task, arm_angle(), name="arm angle")
            found.append(("arm angle", angle, {"kind": "arm-angle"}))
        except NoArmError:
            pass
    found.append(("radial", radial(pinv, q0, name="radial"), {"kind": "radial"}))
    return tuple(
        Law(name, colour, rule, task, None, keys)
        for colour, (name, rule, keys) in enumerate(found)
        if defined(rule, q0)
    )


def defined(rule: Strategy, q: Vector) -> bool:
    """Whether a strategy is defined at a posture (n,)."""
    try:
        rule(q)
    except HolokinError:
        return False
    return True


def redundant(task: Task) -> None:
    """Raises: ArgumentError: a task that leaves no joint free, so that there is nothing to see."""
    if task.n <= task.m:
        cure = "the studio shows redundant joints: give a task with fewer rows, or a robot with more joints"
        raise ArgumentError(f"the number of joints to spare of the {task.name}", task.n - task.m, cure)
