"""`Implicit`: a constraint by auxiliary unknowns, for those who need it smooth and simple: proofs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

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

    size: (k, s) of a task. rows: (task, kinematics, q, z, scale) -> (g (rows,), h (k,)), where d h / d z is regular
    wherever g is smooth. at: (task, q, scale) -> z (k,) at a posture (n,). scale: numbers (s,) from a posture near all
    that are of interest, which make unknowns of the size 1; h depends on them, g does not.
    """

    size: Callable[[Task], tuple[int, int]]
    rows: Callable[[Task, Kinematics, SX, SX, SX], tuple[SX, SX]]
    at: Callable[[Task, Vector, Vector], Vector]
    scale: Callable[[Task, Vector], Vector] = lambda _task, _q: np.zeros(0)


def joined(constraints: Sequence[Constraint], together: Together) -> Implicit | None:
    """The unknowns of several constraints, one after the other; nothing where none has any."""
    parts = [c.implicit for c in constraints if c.implicit is not None]
    if not parts:
        return None

    def split(task: Task, values: Any, which: int) -> list[Any]:
        ends = np.cumsum([0, *(part.size(task)[which] for part in parts)]).tolist()
        return [values[a:b] for a, b in pairwise(ends)]

    def size(task: Task) -> tuple[int, int]:
        unknowns, numbers = zip(*(part.size(task) for part in parts), strict=True)
        return sum(unknowns), sum(numbers)

    def rows(task: Task, k: Kinematics, q: SX, z: SX, scale: SX) -> tuple[SX, SX]:
        own = zip(parts, split(task, z, 0), split(task, scale, 1), strict=True)
        found = [part.rows(task, k, q, *given) for part, *given in own]
        values = iter(g for g, _ in found)
        g = [c.expand(task, k, q) if c.implicit is None else next(values) for c in constraints]
        return together(task, k, g), vertcat(*(h for _, h in found))

    def at(task: Task, q: Vector, scale: Vector) -> Vector:
        own = zip(parts, split(task, scale, 1), strict=True)
        return np.concatenate([part.at(task, q, given) for part, given in own])

    return Implicit(size, rows, at, lambda task, q: np.concatenate([part.scale(task, q) for part in parts]))
