"""`Servo`: what drives each joint of a robot on physics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..arguments import typed
from ..errors import ArgumentError
from ..symbolic import Function, symbol
from ..types import ArrayLike, Value, Vector, positive
from .inertia import mass_matrix_expression
from .links import weighed
from .model import Robot

SERVOS = ("position", "velocity", "torque")
"""The kinds of servos."""


@dataclass(frozen=True, eq=False)
class Servo(Value):
    """The drives of a robot: what they are commanded, and their gains. Make one with `servo`.

    position: torque = stiffness (command - q) - damping dq. velocity: torque = damping (command - dq). torque: what is
    commanded.

    Attributes:
        kind: "position", "velocity" or "torque".
        stiffness: (n,) [N m/rad, N/m], zero but for position.
        damping: (n,) [N m s/rad, N s/m], zero for torque.
        compensated: whether the weight of the links is carried by a torque of its own, known from the model.
    """

    kind: Literal["position", "velocity", "torque"]
    stiffness: Vector
    damping: Vector
    compensated: bool = False


@typed
def servo(
    robot: Robot, kind: str, q: ArrayLike, *, frequency: float = 10.0, damping_ratio: float = 1.0,
    compensated: bool | None = None,
) -> Servo:  # fmt: skip
    """Servos whose gains fit the inertia of each joint at a posture.

    With M the mass matrix and w = 2 pi frequency: stiffness_i = M_ii w^2, damping_i = 2 damping_ratio M_ii w of a
    position servo, and damping_i = M_ii w of a velocity servo.

    Args:
        kind: "position", "velocity" or "torque".
        q: the posture (n,).
        frequency: of the closed loop of each joint alone [Hz].
        compensated: whether the weight of the links is carried by torques of its own; by default of velocity and
            torque servos, and not of position servos, whose stiffness carries it.

    Raises:
        ArgumentError: an unknown kind, or a number that is not positive. ShapeError, NotFiniteError.
    """
    if kind not in SERVOS:
        raise ArgumentError("the kind of servo", kind, f"use one of {', '.join(SERVOS)}")
    w, zeta = 2 * np.pi * positive("frequency", frequency), positive("damping_ratio", damping_ratio)
    at, heavy = robot.checked(q), weighed(robot)
    s = symbol("q", robot.n)
    M = Function("mass_matrix", {"q": s}, {"M": mass_matrix_expression(heavy, s)})(at)
    inertia = np.diag(np.reshape(M, (robot.n, robot.n)))
    none = np.zeros(robot.n)
    gains = {"position": (inertia * w**2, 2 * zeta * inertia * w), "velocity": (none, inertia * w)}
    stiffness, damping = gains.get(kind, (none, none))
    return Servo(kind, stiffness, damping, kind != "position" if compensated is None else compensated)  # type: ignore[arg-type]
