"""Carrying a posture along a straight line in task coordinates by a strategy: dq = G(q) dx."""

from __future__ import annotations

import numpy as np

from ...base.types import Matrix, Vector
from ...strategies import Strategy, checked_rate
from ...symbolic import runge_kutta

STEPS = 32
"""Runge-Kutta steps of one transport: on segments of 0.5 m and 0.5 rad the error is about 1e-8 rad."""


def transport(strategy: Strategy, q: Vector, dx: Vector, steps: int = STEPS) -> Vector:
    """The posture (n,) that the strategy leads to from q (n,) while x moves by dx (m,) at constant rates.

    Raises:
        SingularityError: on the way.
    """
    return straight_postures(strategy, q, dx, steps)[-1]


def straight_postures(strategy: Strategy, q: Vector, dx: Vector, steps: int = STEPS) -> Matrix:
    """The postures (steps + 1, n) of `transport`, from q to where it leads. Raises: SingularityError."""
    rate, postures = checked_rate(strategy), [q]
    for _ in range(steps):
        postures.append(runge_kutta(rate, postures[-1], 1.0 / steps, dx, dx, dx))
    return np.array(postures)
