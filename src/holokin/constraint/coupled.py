"""Orientation coupled to position, the paper's (27), (28)."""

from __future__ import annotations

from ..errors import UnknownNameError
from ..robot import Kinematics
from ..symbolic import SX
from ..symbolic.geometry import log_so3, rpy_angles, zyz_angles
from ..task import Task
from ..types import ArrayLike
from .base import Constraint, as_gain

_ANGLES = {"zyz": zyz_angles, "rpy": rpy_angles, "rotation-vector": log_so3}


def coupled(gain: ArrayLike, orientation: str = "zyz") -> Constraint:
    """g(q) = phi(q) + Lambda p(q): orientation angles phi (3,) follow the position p (3,). [ZR11, (28)]

    Args:
        gain: Lambda in rad/m, a number (times the identity) or a matrix (3, 3). The paper adds rad and m,
            which is a hidden gain of 1 rad/m (theory E6).
        orientation: "zyz", "rpy" or "rotation-vector".

    Rows: 3, so it completes a position task (m = 3) of a six-joint arm. Algorithmic singularities: every
    singularity of the full 6-row Jacobian, the wrist's included, and the representation's (theory E5).

    Raises:
        UnknownNameError: an unknown orientation. ShapeError, NotFiniteError: a bad gain.
    """
    if orientation not in _ANGLES:
        raise UnknownNameError("orientation of a coupled constraint", orientation, tuple(_ANGLES))
    L = as_gain(gain, (3, 3))

    def expression(_task: Task, k: Kinematics, _q: SX) -> SX:
        return _ANGLES[orientation](k.rotation) + SX(L) @ k.position

    return Constraint(f"coupled ({orientation})", 3, expression, (True, True, True))
