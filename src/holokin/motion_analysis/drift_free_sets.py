"""Postures of a self-motion at which small loops do not drift, with one redundant joint. [KK89]"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from ..base.arguments import typed
from ..base.types import ArrayLike, Value, Vector
from ..errors import ArgumentError
from ..strategies import Strategy, self_motion, unit_null
from .curvature_of_planes import curvature, curvature_function, pairs


@dataclass(frozen=True, eq=False)
class DriftFree(Value):
    """A posture q (n,) whose curvature vanishes in a task plane, so that small loops in it do not drift.

    `slope` [1 / (task unit i * task unit j)]: d kappa / ds along the self-motion. Near it, small loops of one
    direction drift towards q, those of the other away from it.
    """

    q: Vector
    plane: tuple[int, int]
    slope: float

    @property
    def attracts(self) -> str:
        """The direction of loops, in the plane (x_i, x_j), that drift towards it."""
        return "counter-clockwise" if self.slope < 0 else "clockwise"


@typed
def drift_free(
    strategy: Strategy, q0: ArrayLike, plane: tuple[int, int] = (0, 1), *, step: float = 0.02, limits: bool = True
) -> tuple[DriftFree, ...]:
    """The postures with the tool pose of q0 at which small loops in a task plane do not drift, and their stability.

    Zeros along the self-motion of kappa = n . F_ij; a counter-clockwise loop nears those where kappa falls, a
    clockwise one those where it rises (theory 2a).

    Args:
        plane: two rows (i, j) of the task.

    Raises:
        ArgumentError: not one redundant joint, or no such plane. SingularityError: J is singular at q0.
    """
    from scipy.optimize import brentq

    task = strategy.task
    i, j = plane
    if not (0 <= i < task.m and 0 <= j < task.m and i != j):
        raise ArgumentError("plane", plane, f"name two of the {task.m} task rows, from 0")
    curve = self_motion(task, q0, step=step, limits=limits)
    column = pairs(task.m).index((min(i, j), max(i, j)))
    sign = 1.0 if i < j else -1.0
    F = curvature_function(strategy).batch(curve.q)[0].reshape(len(curve.q), task.n, -1)[:, :, column] * sign
    normals = [unit_null(task, curve.q[0], None)]
    for q in curve.q[1:]:
        normals.append(unit_null(task, q, normals[-1]))
    kappa = np.einsum("ka,ka->k", F, np.array(normals))
    found = []
    for k in np.flatnonzero(kappa[:-1] * kappa[1:] < 0):
        low, high, n = float(curve.s[k]), float(curve.s[k + 1]), normals[k]

        def value(s: float, n=n) -> float:
            q = curve.at(s)
            return float(unit_null(task, q, n) @ curvature(strategy, q)[:, i, j])

        s = float(cast(float, brentq(value, low, high, xtol=1e-13 * (high - low))))
        h = min(0.05 * (high - low), s - low, high - s) or 0.05 * (high - low)
        slope = (value(min(high, s + h)) - value(max(low, s - h))) / (2 * h)
        found.append(DriftFree(curve.at(s), (i, j), slope))
    return tuple(found)
