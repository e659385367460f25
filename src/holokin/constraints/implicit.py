"""`Implicit`: a constraint by auxiliary unknowns, for those who need it smooth and simple: proofs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..robot import Kinematics
from ..symbolic import SX, vertcat
from ..task import Task
from ..types import Value, Vector

if TYPE_CHECKING:
    from .base import Constraint

Together = Callable[[Task, Kinematics, list[SX]], SX]
"""What several constraints make of their values g: (task, kinematics, [g_1, ...]) -> g."""


@dataclass(frozen=True, eq=False)
class Implicit(Value):
    """g(q) = g(q, z(q)) with unknowns z (k,) that solve as many equations h(q, z) = 0.

    A null vector by Householder reflections has kinks where a sign changes, though it is smooth itself. As an unknown
    of J z = 0, |z|^2 = 1 it is the root of polynomials of J.

    size: k of a task. rows: (task, kinematics, q, z) -> (g (rows,), h (k,)), where d h / d z is regular wherever g is
    smooth. at: z (k,) at a posture (n,).
    """

    size: Callable[[Task], int]
    rows: Callable[[Task, Kinematics, SX, SX], tuple[SX, SX]]
    at: Callable[[Task, Vector], Vector]


def joined(constraints: Sequence[Constraint], together: Together) -> Implicit | None:
    """The unknowns of several constraints, one after the other; nothing where none has any."""
    if all(c.implicit is None for c in constraints):
        return None

    def size(task: Task) -> int:
        return sum(c.implicit.size(task) for c in constraints if c.implicit is not None)

    def rows(task: Task, k: Kinematics, q: SX, z: SX) -> tuple[SX, SX]:
        values, equations, first = [], [SX(0, 1)], 0
        for c in constraints:
            if c.implicit is None:
                values.append(c.expand(task, k, q))
                continue
            last = first + c.implicit.size(task)
            g, h = c.implicit.rows(task, k, q, z[first:last])
            values.append(g)
            equations.append(h)
            first = last
        return together(task, k, values), vertcat(*equations)

    def at(task: Task, q: Vector) -> Vector:
        return np.concatenate([c.implicit.at(task, q) for c in constraints if c.implicit is not None])

    return Implicit(size, rows, at)
