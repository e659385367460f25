"""Following by velocity: dq = G(q) x', integrated by Runge-Kutta of order 4 with fixed steps, as the paper does."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..codegen import VelocityRules
from ..errors import TrackingError
from ..sampling import Plan
from ..strategies import Strategy, checked_rate, runge_kutta
from ..tolerances import TOLERANCES
from ..types import Vector
from .native import NativeWalk


def velocity_stepper(strategy: Strategy, plan: Plan) -> Callable[[Vector, int], Vector]:
    """(q, step) -> q after that step of the plan.

    Raises (when called):
        SingularityError: G is not defined there. TrackingError: the tool lost the path.
    """
    rate, error = checked_rate(strategy), strategy.task.error_function

    def step(q: Vector, i: int) -> Vector:
        new = runge_kutta(rate, q, *plan.step_rates(i))
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


def native_velocity(
    strategy: Strategy, plan: Plan, q0: Vector, limits: bool, *, load: bool, build: bool
) -> NativeWalk | None:
    """The same steps as native code, many in one call; None without it, see `Function.follower`."""
    kernel, t = strategy.path_rate.follower("velocity", load=load, build=build), TOLERANCES
    if kernel is None:
        return None
    return NativeWalk(kernel, plan, q0.copy(), VelocityRules(t.singular, t.representation, t.tracking), limits)
