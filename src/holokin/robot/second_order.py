"""Second derivatives of the forward kinematics, in closed form: cross products of Jacobian columns. [HC20]"""

from __future__ import annotations

from ..symbolic import SX, cross, vertcat
from .model import Robot


def hessian_expression(robot: Robot, q: SX, tip: str | None = None) -> list[SX]:
    """H_i (n, n) for the six rows i of the geometric Jacobian, H_i[a, b] = d J_ia / d q_b [m or 1 per joint unit^2].

    A joint b at or before a turns a's column, w_b x (v_a, w_a); one behind it moves the tool's point, w_a x v_b.
    """
    moving = robot.columns(q, tip)
    out = [SX.zeros(robot.n, robot.n) for _ in range(6)]
    for i, (a, gain_a, v_a, w_a) in enumerate(moving):
        for j, (b, gain_b, v_b, w_b) in enumerate(moving):
            linear, angular = (cross(w_b, v_a), cross(w_b, w_a)) if j <= i else (cross(w_a, v_b), SX.zeros(3, 1))
            column = gain_a * gain_b * vertcat(linear, angular)
            for row in range(6):
                out[row][a, b] = out[row][a, b] + column[row]
    return out
