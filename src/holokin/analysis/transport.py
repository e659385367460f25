"""Carrying a posture along a straight line in task coordinates by a strategy: dq = G(q) dx."""

from __future__ import annotations

from ..control import checked_rate, runge_kutta
from ..strategy import Strategy
from ..types import Vector

STEPS = 32
"""Runge-Kutta steps of one transport: on segments of 0.5 m and 0.5 rad the error is about 1e-8 rad."""


def transport(strategy: Strategy, q: Vector, dx: Vector, steps: int = STEPS) -> Vector:
    """The posture (n,) that the strategy leads to from q (n,) while x moves by dx (m,) at constant rates.

    Raises:
        SingularityError: on the way.
    """
    rate = checked_rate(strategy)
    for _ in range(steps):
        q = runge_kutta(rate, q, 1.0 / steps, dx, dx, dx)
    return q
