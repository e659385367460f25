"""Shoulder, elbow and wrist of an arm: found by how the axes of its joints meet, or named."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ...base.arguments import check, typed
from ...base.errors import ArgumentError, NoArmError
from ...base.poses import pose_from
from ...base.shown import Shown
from ...base.types import Matrix, Vector, finite
from ...robot import Kinematics, Robot, joints_above
from ...symbolic import SX, Function, horzcat, symbol
from ..tasks.task import Task

MEET = 1e-4
"""Distance [m] up to which axes meet: URDF files round right angles to 1.5708, a hundredth of a millimetre on 2 m."""

TURNED = 1e-3
"""Angle [rad] from which two axes are not parallel."""


@dataclass(frozen=True)
class Point:
    """A point on the moving side of a joint: `offset` (3,) in that joint's frame, None for the frame's origin.

    `place` says which point it is.
    """

    joint: int
    offset: tuple[float, float, float] | None
    place: str

    def expression(self, task: Task, k: Kinematics, q: SX) -> SX:
        """Where it is (3,) in the base frame. Raises: ArgumentError: the task's robot has no such joint."""
        name = dict(enumerate(joint.name for joint in task.robot.joints)).get(self.joint)
        if name not in k.origins:
            raise ArgumentError("the robot of the task", task.robot.name, "give that on which the arm was found")
        if self.offset is None:
            return k.origins[name]
        return task.robot.kinematics_at(q, self.joint, pose_from(self.offset)).position


@dataclass(frozen=True)
class Arm(Shown):
    """The shoulder, elbow and wrist that an arm angle is measured by."""

    shoulder: Point
    elbow: Point
    wrist: Point

    @property
    def sentence(self) -> str:
        """Which points they are."""
        return f"shoulder {self.shoulder.place}; elbow {self.elbow.place}; wrist {self.wrist.place}"

    def __str__(self) -> str:
        return self.sentence

    @typed
    def expressions(self, task: Task, k: Kinematics, q: SX) -> tuple[SX, SX, SX]:
        """Shoulder, elbow and wrist (3,) each, in the base frame."""
        shoulder, elbow, wrist = (point.expression(task, k, q) for point in (self.shoulder, self.elbow, self.wrist))
        return shoulder, elbow, wrist

    @typed
    def places(self, task: Task) -> Function:
        """q (n,) -> shoulder, elbow and wrist, the rows of a matrix (3, 3), in the base frame [m]."""
        q = symbol("q", task.n)
        points = self.expressions(task, task.kinematics(q), q)
        return Function("arm", {"q": q}, {"points": horzcat(*points).T})


@dataclass(frozen=True, eq=False)
class _Axis:
    """The axis of a joint at q = 0, in the base frame: its origin and direction (3,)."""

    joint: int
    name: str
    frame: Matrix
    direction: Vector
    hinge: bool

    @property
    def origin(self) -> Vector:
        """The origin of the joint's frame."""
        return self.frame[:3, 3]

    def foot(self, point: Vector) -> Vector:
        """The point of the axis next to another point."""
        return self.origin + ((point - self.origin) @ self.direction) * self.direction

    def place(self, at: Vector, words: str) -> _Place:
        """A place in the base frame as one on this joint's moving side."""
        if np.linalg.norm(at - self.origin) < MEET:
            return _Place(at, Point(self.joint, None, words))
        x, y, z = (self.frame[:3, :3].T @ (at - self.origin)).tolist()
        return _Place(at, Point(self.joint, (x, y, z), words))


@dataclass(frozen=True, eq=False)
class _Place:
    """Where a point is (3,) at q = 0, in the base frame."""

    at: Vector
    point: Point


@typed
def find_arm(task: Task, joints: Sequence[Any] | None = None, tip: str | None = None) -> Arm:
    """Shoulder, elbow and wrist on the chain from the base to the task's tip, and which points these are.

    The shoulder is where three consecutive hinges meet, the elbow on the next hinge, at its point next to the shoulder,
    the wrist where the three hinges after it meet, or the two after it (a Panda's third stands aside). Of several such
    arms on the chain, as a waist before a shoulder may make them, it is the last.

    A chain of seven hinges, none parallel to the next, always has them, if need be by the rule of [EW23]: shoulder
    where the first two axes meet, or on the first, next to the second; wrist where the last three meet, or the last
    two, or the two before the last, or on the last, next to the one before; elbow where the fourth axis meets the fifth
    (with a wrist of three axes: the third) or the third (the fifth), or on the fourth, next to the shoulder. So arms
    whose axes pass each other, as a Gen3's or a Sawyer's, have them too.

    Args:
        joints: shoulder, elbow and wrist named: each a joint, by name or by index in q, for the origin of its frame, or
            (joint, (x, y, z)), for a point in that frame [m].
        tip: of a robot with several arms, that of the one to look at; by default the task's, of several the first.

    Raises:
        NoArmError: no such joints; it lists those of the chain. UnknownNameError: an unknown joint. ArgumentError.
    """
    if joints is not None:
        if len(joints) != 3:
            raise ArgumentError("the points of an arm", joints, "name three: shoulder, elbow, wrist")
        return Arm(*(_named(task.robot, joint) for joint in joints))
    task.robot.check_links()
    if tip is not None:
        task.robot.pose(np.zeros(task.n), tip)
    axes = _chain(task.robot, task.tip if tip is None else tip)
    for first in range(len(axes) - 6, -1, -1):
        shoulder, wrist = _meeting(axes[first : first + 3]), _meeting(axes[first + 4 : first + 7])
        if wrist is None or len(axes) < first + 7:
            wrist = _meeting(axes[first + 4 : first + 6])
        if shoulder is not None and wrist is not None and axes[first + 3].hinge:
            return Arm(shoulder.point, _next_to(axes[first + 3], shoulder).point, wrist.point)
    if len(axes) == 7 and all(axis.hinge for axis in axes) and _turned(axes):
        shoulder = _meeting(axes[:3]) or _meeting(axes[:2]) or _beside(axes[0], axes[1])
        spherical, pairs = _meeting(axes[4:]), [axes[3:5], axes[2:4]]
        wrist = spherical or _meeting(axes[5:]) or _meeting(axes[4:6]) or _beside(axes[6], axes[5])
        first, second = pairs[::-1] if spherical else pairs
        elbow = _meeting(first) or _meeting(second) or _next_to(axes[3], shoulder)
        return Arm(shoulder.point, elbow.point, wrist.point)
    raise NoArmError(task.robot.name, [axis.name for axis in axes])


def _named(robot: Robot, joint: Any) -> Point:
    """The origin of a joint's frame, which may be that of a joint that mimics another, or a point in it."""
    joint, offset = joint if isinstance(joint, tuple | list) and len(joint) == 2 else (joint, None)
    check("a point of an arm", str | int, joint)
    names = [j.name for j in robot.joints]
    name = joint if joint in names else robot.joint_names[robot.joint_index(joint)]
    words = f"at the origin of {name}"
    if offset is None:
        return Point(names.index(name), None, words)
    x, y, z = finite(f"the point in the frame of {name}", offset, (3,)).tolist()
    return Point(names.index(name), (x, y, z), f"at ({x:g}, {y:g}, {z:g}) in the frame of {name}")


def _chain(robot: Robot, tip: str | None) -> list[_Axis]:
    """The axes of the joints from the base to a tip, at q = 0."""
    frames: list[Matrix] = []
    for joint in robot.joints:
        frames.append((frames[joint.parent] if joint.parent >= 0 else np.eye(4)) @ joint.placement)
    end = next((t for t in robot.tips if t.name == tip), robot.tips[0])
    found: list[_Axis] = []
    for at in joints_above(robot.joints, end.joint):
        joint = robot.joints[at]
        direction = frames[at][:3, :3] @ joint.axis
        found.append(_Axis(at, joint.name, frames[at], direction, joint.kind == "revolute"))
    return found[::-1]


def _meeting(axes: Sequence[_Axis]) -> _Place | None:
    """The point where two or three consecutive hinges meet, on the moving side of the second; or None."""
    if not _turned(axes) or not all(axis.hinge for axis in axes):
        return None
    across = [np.eye(3) - np.outer(axis.direction, axis.direction) for axis in axes]
    feet = [P @ axis.origin for P, axis in zip(across, axes, strict=True)]
    point: Vector = np.linalg.solve(np.sum(across, axis=0), np.sum(feet, axis=0))
    if not max(np.linalg.norm(point - axis.foot(point)) for axis in axes) < MEET:
        return None
    return axes[1].place(point, f"where the axes of {', '.join(axis.name for axis in axes)} meet")


def _turned(axes: Sequence[_Axis]) -> bool:
    """Whether no axis is parallel to the next."""
    return all(np.linalg.norm(np.cross(a.direction, b.direction)) > TURNED for a, b in pairwise(axes))


def _beside(axis: _Axis, other: _Axis) -> _Place:
    """The point of an axis next to another one, not parallel to it."""
    a, b = axis.direction, other.direction
    along = np.linalg.lstsq(np.stack([a, -b], axis=1), other.origin - axis.origin, rcond=None)[0]
    return axis.place(axis.origin + along[0] * a, f"on the axis of {axis.name}, next to that of {other.name}")


def _next_to(axis: _Axis, shoulder: _Place) -> _Place:
    """The point of an axis next to the shoulder."""
    return axis.place(axis.foot(shoulder.at), f"on the axis of {axis.name}, at the point nearest to the shoulder")
