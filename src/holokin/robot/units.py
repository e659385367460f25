"""Are joints in rad, and places in metres? What is far beyond all limits and all reach is in other units."""

from __future__ import annotations

import numpy as np

from ..errors import ArgumentError
from ..types import Array, ArrayLike, Matrix, Vector
from .model import WOUND, Robot

FAR = 100.0
"""Reaches of an arm from its base at which a place is not in metres: millimetres make a thousand of one."""


def start_posture(robot: Robot, q: ArrayLike) -> Vector:
    """q as (n,) finite floats, for starts that may be beyond the joint limits.

    Raises:
        ShapeError, NotFiniteError, ArgumentError: as `Robot.checked`. JointLimitError: a joint is more than two turns
        beyond its limits, as degrees are.
    """
    start = robot.checked(q, "the start posture")
    if robot.beyond(start).max() > WOUND:
        robot.check_limits(start)
    return start


def longest_reach(robot: Robot, tip: str | None = None) -> float:
    """A distance [m] from the base beyond which no posture brings a tip: links in a line, slides at their ends.

    Infinite with a slide without limits.
    """
    chosen = next((t for t in robot.tips if t.name == tip), robot.tips[0])
    total, at = float(np.linalg.norm(chosen.placement[:3, 3])), chosen.joint
    while at >= 0:
        joint = robot.joints[at]
        total += float(np.linalg.norm(joint.placement[:3, 3]))
        if joint.kind == "prismatic":
            slide = robot.coordinates[joint.coordinate]
            total += abs(joint.multiplier) * max(-slide.lower, slide.upper) + abs(joint.offset)
        at = joint.parent
    return total


def doubtful_unit(robot: Robot, places: Matrix, tip: str | None = None) -> str:
    """What to say of places (k, 3) that are all too far from the base to be in metres; empty of others."""
    least, reach = float(np.linalg.norm(places, axis=-1).min()), longest_reach(robot, tip)
    if not FAR * reach < least < np.inf:
        return ""
    return f"at least {least:.4g} m from the base, where {robot.name} reaches {reach:.3g} m: give metres"


def check_metres(robot: Robot, poses: Array, tip: str | None = None) -> None:
    """Raises: ArgumentError where the poses (k, 4, 4) of a workspace are too far away to be in metres."""
    if said := doubtful_unit(robot, poses[:, :3, 3], tip):
        first = poses[0, :3, 3].tolist()
        raise ArgumentError("the position of the first pose of the workspace", first, f"all are {said}")
