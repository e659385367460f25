"""Curvature of a strategy that is a Python function, from differences of its values, with what it may be wrong by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.arguments import typed
from ...base.errors import FunctionError, NotFiniteError, SingularityError
from ...base.types import Array, ArrayLike, Matrix, Value, Vector
from ...strategies import NumericStrategy
from .differences import noise_of, slope

OUTSIDE = (FunctionError, NotFiniteError, SingularityError)
"""What a function may raise, or return, where it is not defined."""


@dataclass(frozen=True, eq=False)
class MeasuredCurvature(Value):
    """F (n, m, m) at a posture, as `hk.curvature`, with `error` (m, m): how long what is wrong of F_ij may be.

    noise: standard deviation of the values of G [their units]. step: the shortest one that was used [joint units].
    """

    F: Array
    error: Matrix
    noise: float
    step: float

    @property
    def sizes(self) -> Matrix:
        """|F_ij| (m, m)."""
        return np.linalg.norm(self.F, axis=0)


@typed
def measured_curvature(strategy: NumericStrategy, q: ArrayLike) -> MeasuredCurvature:
    """F_ij = (1 - G J) (DG_j[G_i] - DG_i[G_j]) at q (n,), with the derivatives of `differences`.

    1 - G J projects on the self-motions along range G, so that F is the vertical part of the brackets (theory 1.1).

    Raises:
        FunctionError, NotFiniteError, ShapeError, ArgumentError: as a call of the strategy at q.
    """
    at = strategy.task.robot.checked(q)
    G, m = strategy(at), strategy.task.m
    lengths = np.linalg.norm(G, axis=0)

    def value(q: Vector) -> Array:
        try:
            return strategy.value(q)
        except OUTSIDE:
            return np.full(G.shape, np.nan)

    noise = max(noise_of(value, at, G[:, i] / lengths[i]) for i in range(m))
    slopes = [slope(value, at, G[:, i] / lengths[i], noise) for i in range(m)]
    vertical = np.eye(len(G)) - G @ strategy.task.jacobian(at)
    along = np.stack([one.value * length for one, length in zip(slopes, lengths, strict=True)])  # (i, n, j): DG_j[G_i]
    wrong = np.stack([one.error * length for one, length in zip(slopes, lengths, strict=True)])
    brackets = along.transpose(1, 0, 2) - along.transpose(1, 2, 0)
    error = float(np.linalg.norm(vertical, 2)) * (wrong + wrong.T)
    np.fill_diagonal(error, 0.0)
    return MeasuredCurvature(np.einsum("ab,bij->aij", vertical, brackets), error, noise, min(s.step for s in slopes))
