"""Following by velocity: dq = G(q) x', integrated by Runge-Kutta of order 4 with fixed steps, as the paper does."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..control import Plan, checked_rate, runge_kutta
from ..errors import TrackingError
from ..strategy import Strategy
from ..tolerances import TOLERANCES
from ..types import Vector


def velocity_stepper(strategy: Strategy, plan: Plan) -> Callable[[Vector, int], Vector]:
    """(q, step) -> q after that step of the plan.

    Raises (when called):
        SingularityError: G is not defined there. TrackingError: the tool lost the path.
    """
    rate, error = checked_rate(strategy), strategy.task.error_function
    x0, x1, x2 = plan.rates

    def step(q: Vector, i: int) -> Vector:
        new = runge_kutta(rate, q, plan.h[i], x0[i], x1[i], x2[i])
        p, R = plan.target(i, 1.0)
        off = float(np.abs(error(new, p, R)).max())
        if not off < TOLERANCES.tracking:
            figure = strategy.gain(q)[1]
            raise TrackingError(
                f"the tool is {off:.3g} (m or rad) off the path, with a conditioning of {figure:.1e} (0 is singular)",
                "use more samples, or keep the path away from singular postures",
            )
        return new

    return step
