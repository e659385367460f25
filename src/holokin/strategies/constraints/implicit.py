"""`Implicit`: a constraint by auxiliary unknowns, for those who need it smooth and simple: proofs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ...base.types import Value, Vector
from ...robot import Kinematics
from ...symbolic import SX
from ..tasks.task import Task


@dataclass(frozen=True, eq=False)
class Implicit(Value):
    """g(q) = g(q, z(q)) with unknowns z (k,) that solve as many equations h(q, z) = 0.

    A null vector by Householder reflections has kinks where a sign changes, though it is smooth itself. As an unknown
    of J z = 0, |z|^2 = 1 it is the root of polynomials of J.

    size: k of a task. rows: (task, kinematics, q, z) -> (g (rows,), h (k,)), where d h / d z is regular wherever g is
    smooth. at: (task, q) -> z (k,) at a posture (n,).
    """

    size: Callable[[Task], int]
    rows: Callable[[Task, Kinematics, SX, SX], tuple[SX, SX]]
    at: Callable[[Task, Vector], Vector]
