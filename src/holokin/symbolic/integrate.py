"""The Runge-Kutta step of order 4, for numbers and for expressions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


def runge_kutta(rate: Callable[[Any, Any], Any], y: Any, h: float, start: Any, middle: Any, end: Any) -> Any:
    r"""y after a step h of y' = rate(y, u), u the input at its start, middle and end.

    $y + h/6 (k_1 + 2 k_2 + 2 k_3 + k_4)$. y, u and the rates are NumPy arrays of any shape, or expressions.
    """
    k1 = rate(y, start)
    k2 = rate(y + h / 2 * k1, middle)
    k3 = rate(y + h / 2 * k2, middle)
    k4 = rate(y + h * k3, end)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
