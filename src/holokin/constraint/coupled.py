"""Orientation coupled to position, the paper's (27), (28)."""

from __future__ import annotations

from ..robot import Kinematics
from ..symbolic import SX
from ..task import Task, orientation_angles, representation_margin
from ..types import ArrayLike
from .base import Constraint, as_gain


def coupled(gain: ArrayLike, orientation: str = "zyz") -> Constraint:
    """g(q) = phi(q) + Lambda p(q): orientation angles phi (3,) follow the position p (3,). [ZR11, (28)]

    Args:
        gain: Lambda in rad/m, a number (times the identity) or a matrix (3, 3). The paper adds rad and m,
            which is a hidden gain of 1 rad/m (theory E6).
        orientation: "zyz", "rpy" or "rotation-vector".

    Rows: 3, so it completes a position task (m = 3) of a six-joint arm. Algorithmic singularities: every
    singularity of the full 6-row Jacobian, the wrist's included (theory E5); and where the angles are undefined.

    Raises:
        UnknownNameError: an unknown orientation. ShapeError, NotFiniteError: a bad gain.
    """
    L = as_gain(gain, (3, 3))
    orientation_angles(orientation, SX.eye(3))

    def expression(_task: Task, k: Kinematics, _q: SX) -> SX:
        return orientation_angles(orientation, k.rotation) + SX(L) @ k.position

    def margin(_task: Task, k: Kinematics, _q: SX) -> SX:
        return representation_margin(orientation, orientation_angles(orientation, k.rotation))

    return Constraint(f"coupled ({orientation})", 3, expression, (True, True, True), margin)
