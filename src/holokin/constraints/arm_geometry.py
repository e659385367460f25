"""Shoulder, elbow and wrist of an arm, found by how the axes of its joints meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..errors import NoArmError
from ..robot import Kinematics, Robot
from ..symbolic import SX
from ..task import Task
from ..types import Matrix, Vector

MEET = 1e-4
"""Distance [m] up to which axes meet: URDF files round right angles to 1.5708, a hundredth of a millimetre on 2 m."""

TURNED = 1e-3
"""Angle [rad] from which two axes are not parallel."""


@dataclass(frozen=True)
class Point:
    """A point on the moving side of a joint: `offset` (3,) in that joint's frame, None for the frame's origin."""

    joint: int
    offset: tuple[float, float, float] | None

    def expression(self, task: Task, k: Kinematics, q: SX) -> SX:
        """Where it is (3,) in the base frame."""
        if self.offset is None:
            return k.origins[task.robot.joints[self.joint].name]
        placement = np.eye(4)
        placement[:3, 3] = self.offset
        return task.robot.kinematics_at(q, self.joint, placement).position


@dataclass(frozen=True, eq=False)
class _Axis:
    """The axis of a joint at q = 0, in the base frame: its origin and direction (3,)."""

    joint: int
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

    def point(self, place: Vector) -> Point:
        """A place in the base frame as one on this joint's moving side."""
        if np.linalg.norm(place - self.origin) < MEET:
            return Point(self.joint, None)
        x, y, z = (self.frame[:3, :3].T @ (place - self.origin)).tolist()
        return Point(self.joint, (x, y, z))


def shoulder_elbow_wrist(task: Task) -> tuple[Point, Point, Point]:
    """Shoulder, elbow and wrist on the chain from the base to the task's tip.

    The shoulder is where three consecutive hinges meet, the elbow on the next hinge, at its point next to the
    shoulder, the wrist where the three hinges after it meet, or the two after it (a Panda's third stands aside). Of
    several such arms on the chain, as a waist before a shoulder may make them, it is the last.

    Raises:
        NoArmError: there are no such joints; it lists those of the chain.
    """
    axes = _chain(task.robot, task.tip)
    for first in range(len(axes) - 6, -1, -1):
        elbow = axes[first + 3]
        shoulder = _meeting(axes[first : first + 3])
        wrist = _meeting(axes[first + 4 : first + 7])
        if wrist is None or len(axes) < first + 7:
            wrist = _meeting(axes[first + 4 : first + 6])
        if shoulder is not None and wrist is not None and elbow.hinge:
            return (
                axes[first + 1].point(shoulder),
                elbow.point(elbow.foot(shoulder)),
                axes[first + 5].point(wrist),
            )
    raise NoArmError(task.robot.name, [task.robot.joints[axis.joint].name for axis in axes])


def _chain(robot: Robot, tip: str | None) -> list[_Axis]:
    """The axes of the joints from the base to a tip, at q = 0."""
    frames: list[Matrix] = []
    for joint in robot.joints:
        frames.append((frames[joint.parent] if joint.parent >= 0 else np.eye(4)) @ joint.placement)
    at = next((t for t in robot.tips if t.name == tip), robot.tips[0]).joint
    found: list[_Axis] = []
    while at >= 0:
        joint = robot.joints[at]
        found.append(_Axis(at, frames[at], frames[at][:3, :3] @ joint.axis, joint.kind == "revolute"))
        at = joint.parent
    return found[::-1]


def _meeting(axes: Sequence[_Axis]) -> Vector | None:
    """The point (3,) where two or three consecutive hinges meet, or None."""
    turned = all(np.linalg.norm(np.cross(a.direction, b.direction)) > TURNED for a, b in pairwise(axes))
    if not turned or not all(axis.hinge for axis in axes):
        return None
    across = [np.eye(3) - np.outer(axis.direction, axis.direction) for axis in axes]
    feet = [P @ axis.origin for P, axis in zip(across, axes, strict=True)]
    point: Vector = np.linalg.solve(np.sum(across, axis=0), np.sum(feet, axis=0))
    return point if max(np.linalg.norm(point - axis.foot(point)) for axis in axes) < MEET else None
