"""How far a robot's tool gets from its base, without CasADi: a list of robots is printed at once."""

from __future__ import annotations

import numpy as np

from ..base.arguments import typed
from ..base.types import Array, Matrix, Vector
from .joints import Tip, foot_of, joints_above
from .model import Robot
from .numeric import joint_frames, placed

_SAMPLES = 2048
"""Postures of which the farthest are improved: for the robots of the catalogue 16 times as many change no digit."""

_STARTS = 8
"""Postures that are improved."""


@typed
def reach(robot: Robot, tip: str | None = None) -> float:
    """The largest distance [m] of a tip from where the robot stands, max |p(q) - foot| within the joint limits.

    It is the farthest of random postures, the best of which are improved by a truncated Newton method. Infinite for a
    slider without limits; a hinge without limits turns once round.

    Raises:
        UnknownNameError: no such tip.
    """
    from scipy.optimize import minimize

    end = robot.tip(tip)
    if not (np.isfinite(robot.upper - robot.lower) | robot.hinges).all():
        return float("inf")
    lower, upper = robot.ranges(np.pi)
    Q = np.random.default_rng(0).uniform(lower, upper, (_SAMPLES, robot.n))
    foot = foot_of(robot.joints, end.joint)
    far = np.linalg.norm(_points(robot, Q, end)[0] - foot, axis=1)

    def cost(q: Vector) -> tuple[float, Vector]:
        p, J = _points(robot, q[None], end)
        step = p[0] - foot
        return -float(step @ step) / 2, -J[0].T @ step

    bounds = list(zip(lower, upper, strict=True))
    starts = Q[np.argsort(-far)[:_STARTS]]
    return float(np.sqrt(-2 * min(minimize(cost, q, jac=True, method="TNC", bounds=bounds).fun for q in starts)))


def _points(robot: Robot, Q: Matrix, end: Tip) -> tuple[Matrix, Array]:
    """Points p (k, 3) of a tip at postures (k, n), and dp/dq (k, 3, n)."""
    frames = joint_frames(robot, Q)
    axes = [R @ joint.axis for joint, (_, R) in zip(robot.joints, frames, strict=True)]  # it turns about its own axis
    point = placed(frames, end.joint, end.placement, len(Q))[0]
    J = np.zeros((len(Q), 3, robot.n))
    for index in joints_above(robot.joints, end.joint):
        joint, axis = robot.joints[index], axes[index]
        step = axis if joint.kind == "prismatic" else np.cross(axis, point - frames[index][0])
        J[:, :, joint.coordinate] += joint.multiplier * step
    return point, J
