"""One Runge-Kutta step of a strategy, for all who integrate dq = G(q) x'."""

from __future__ import annotations

from collections.abc import Callable

from ..types import Vector
from .base import Strategy


def checked_rate(strategy: Strategy) -> Callable[[Vector, Vector], Vector]:
    """(q, dx) -> dq = G(q) dx. Raises (when called): SingularityError."""

    def rate(q: Vector, dx: Vector) -> Vector:
        dq, conditioning, margin = strategy.rate(q, dx)
        strategy.check(q, conditioning, margin)
        return dq

    return rate


def runge_kutta(
    rate: Callable[[Vector, Vector], Vector], q: Vector, h: float, start: Vector, middle: Vector, end: Vector
) -> Vector:
    """q after a step h of order 4, with the task rates x' at its start, middle and end."""
    k1 = rate(q, start)
    k2 = rate(q + h / 2 * k1, middle)
    k3 = rate(q + h / 2 * k2, middle)
    k4 = rate(q + h * k3, end)
    return q + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
