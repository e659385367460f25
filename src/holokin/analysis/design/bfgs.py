"""Least cost over a few dozen numbers, of a cost that may end: SciPy's BFGS before a wall. [NW06]

Where a posture is not found the cost says None. There a wall stands: a value that rises away from the last point, so
that the search along a line turns back.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.types import Vector

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

FIRST = 0.1
"""Length of the first step."""

STEPS = 200
"""Steps at most; the designs of our tests take 10 to 60."""

ENOUGH = 1e-9
"""Relative decrease below which two steps one after another are the last."""

STEEP = 10.0
"""Height and slope of the wall over the value at the last point."""

Cost = Callable[[Vector, Any], "tuple[float, Vector, Any] | None"]
"""(x, state of a point nearby) -> (value, slope, state), or None where it is not defined."""


def descend(cost: Cost, x: Vector, state: Any) -> tuple[Vector, float, Any]:
    """(x, value, state) of a local least cost near x. The cost must be defined at x."""
    from scipy.optimize import minimize

    found = cost(x, state)
    if found is None:
        return x, np.inf, state
    at, (value, slope, state) = x, found
    scale, small, tried = max(1.0, float(np.linalg.norm(slope)) / FIRST), 0, {x.tobytes(): found}

    def walled(y: Vector) -> tuple[float, Vector]:
        new = cost(y, state)
        if new is not None:
            tried[y.tobytes()] = new
            return new[0] / scale, new[1] / scale
        height, away = 1.0 + STEEP * abs(value), y - at
        far = float(np.linalg.norm(away)) or 1.0
        return (value + height * (1.0 + far)) / scale, height * away / (far * scale)

    def keep(intermediate_result: OptimizeResult) -> None:
        nonlocal at, value, state, small
        new = tried.get(intermediate_result.x.tobytes())
        if new is None:  # a point of the wall is no answer
            raise StopIteration
        small = small + 1 if value - new[0] <= ENOUGH * abs(value) else 0
        at, (value, _, state) = intermediate_result.x.copy(), new
        tried.clear()
        if small >= 2:
            raise StopIteration

    minimize(walled, x, jac=True, method="BFGS", callback=keep, options={"maxiter": STEPS, "gtol": 0.0})
    return at, value, state
