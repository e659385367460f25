"""What a robot's masses give: the joint-space mass matrix and the gravity potential. [Kha87]"""

from __future__ import annotations

import numpy as np

from ..base.errors import MassError
from ..base.poses import pose_from
from ..base.types import Vector
from ..symbolic import SX, dot
from .joints import Body
from .model import Robot


def mass_matrix_expression(robot: Robot, q: SX) -> SX:
    """M(q) (n, n), symmetric: kinetic energy 1/2 dq^T M dq [kg m^2, kg m, kg].

    M = sum_b m J_v^T J_v + J_w^T R I R^T J_w over the bodies b. Raises: MassError: the description has no masses.
    """
    total = SX.zeros(robot.n, robot.n)
    for body in _bodies(robot):
        k = robot.kinematics_at(q, body.joint, pose_from(body.center))
        v, w = k.jacobian[:3, :], k.rotation.T @ k.jacobian[3:, :]
        total = total + body.mass * (v.T @ v) + w.T @ SX(body.inertia) @ w
    return total


def potential_expression(robot: Robot, q: SX, gravity: Vector) -> SX:
    """U = - sum_b m g . c_b [J]. Raises: MassError."""
    total = SX(0)
    for body in _bodies(robot):
        total = total - body.mass * dot(
            SX(gravity), robot.kinematics_at(q, body.joint, pose_from(body.center)).position
        )
    return total


def _bodies(robot: Robot) -> tuple[Body, ...]:
    moving = tuple(body for body in robot.bodies if body.joint >= 0)
    if not moving:
        raise MassError(robot.name, "has no masses")
    for body in moving:
        if not (np.isfinite(body.mass) and body.mass > 0 and np.isfinite(body.inertia).all()):
            raise MassError(robot.name, f"has a mass of {body.mass} kg")
    return moving
