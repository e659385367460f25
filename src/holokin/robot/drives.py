"""`Servo`: what drives each joint of a robot on physics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError
from ..base.types import ArrayLike, Value, Vector, positive
from ..symbolic import Function, symbol
from .inertia import mass_matrix_expression
from .links import weighed
from .model import Robot

ServoKind = Literal["position", "velocity", "torque"]
"""What a servo is told."""

SERVOS: tuple[ServoKind, ...] = get_args(ServoKind)
"""The kinds of servos."""


@dataclass(frozen=True, eq=False)
class Servo(Value):
    """The drives of a robot: what they are commanded, and their gains. Make one with `servo`.

    position: torque = stiffness (command - q) - damping dq. velocity: torque = damping (command - dq). torque: what
    is commanded; stiffness and damping are then those of a law of computed torques, per unit of inertia.

    Attributes:
        kind: "position", "velocity" or "torque".
        stiffness: (n,) [N m/rad, N/m; torque: 1/s^2], zero for velocity.
        damping: (n,) [N m s/rad, N s/m; torque: 1/s].
        compensated: whether the weight of the links is carried by a torque of its own, known from the model.
    """

    kind: ServoKind
    stiffness: Vector
    damping: Vector
    compensated: bool = False


@typed
def servo(
    robot: Robot, kind: ServoKind, q: ArrayLike, *, frequency: float = 25.0, damping_ratio: float = 1.0,
    compensated: bool | None = None,
) -> Servo:  # fmt: skip
    """Servos whose gains fit the inertia of each joint at a posture.

    With M the mass matrix and w = 2 pi frequency: stiffness_i = M_ii w^2, damping_i = 2 damping_ratio M_ii w of a
    position servo, damping_i = M_ii w of a velocity servo, and w^2 and 2 damping_ratio w for torques.

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
    scale = np.ones(robot.n) if kind == "torque" else inertia
    stiffness = np.zeros(robot.n) if kind == "velocity" else scale * w**2
    damping = scale * w * (1.0 if kind == "velocity" else 2 * zeta)
    return Servo(kind, stiffness, damping, kind != "position" if compensated is None else compensated)  # type: ignore[arg-type]
