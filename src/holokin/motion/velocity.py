"""Following by velocity: dq = G(q) x', integrated by Runge-Kutta of order 4 with fixed steps, as the paper does."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..control.plan import Plan
from ..errors import TrackingError
from ..strategy import Strategy
from ..tolerances import TOLERANCES
from ..types import Vector


def velocity_stepper(strategy: Strategy, plan: Plan) -> Callable[[Vector, int], Vector]:
    """(q, step) -> q after that step of the plan.

    Raises (when called):
        SingularityError: G is not defined there. TrackingError: the tool lost the path.
    """
    rate, error = strategy.rate, strategy.task.error_function
    x0, x1, x2 = plan.rates

    def velocity(q: Vector, dx: Vector) -> Vector:
        dq, conditioning, margin = rate(q, dx)
        strategy.check(q, conditioning, margin)
        return dq

    def step(q: Vector, i: int) -> Vector:
        h = plan.h[i]
        k1 = velocity(q, x0[i])
        k2 = velocity(q + h / 2 * k1, x1[i])
        k3 = velocity(q + h / 2 * k2, x1[i])
        k4 = velocity(q + h * k3, x2[i])
        new = q + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
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
