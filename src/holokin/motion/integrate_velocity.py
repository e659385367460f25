"""Following by velocity: dq = G(q) x', integrated by Runge-Kutta of order 4 with fixed steps, as the paper does."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..base.errors import TrackingError
from ..base.tolerances import TOLERANCES
from ..base.types import Vector, kept
from ..strategies import NumericStrategy, Strategy, checked_rate
from ..symbolic import SX, Function, fabs, fmax, fmin, runge_kutta, symbol
from ..symbolic.native import VelocityRules
from .ik.native_follower import NativeFollower
from .ik.plan import Plan


@kept
def path_rate(strategy: Strategy) -> Function:
    """(q, p, R, v, w) -> (dq, rcond, margin, largest task error): G x' for a tool pose and how it moves.

    x' are the task rates of the pose (p, R) that moves with v and turns with w; the error is that from q to it.
    """
    strategy = strategy.looped
    e, task = strategy.expressions, strategy.task
    (p, R), v, w = task.target_symbols(), symbol("v", 3 * task.frames), symbol("w", 3 * task.frames)
    found = e.rate(task.rates_expression(R, v, w))
    error, off = task.error_expression(e.kinematics, p, R), SX(0)
    for i in range(task.m):
        off = fmax(off, fabs(error[i]))
    margin = fmin(strategy.margin_expression, task.margin_expression(R))
    outputs = {"dq": found.X, "rcond": found.rcond, "margin": margin, "off": off}
    return Function("path_rate", {"q": e.q, "p": p, "R": R, "v": v, "w": w}, outputs, found.system, strategy.transport)


def velocity_stepper(strategy: Strategy, plan: Plan) -> Callable[[Vector, int], Vector]:
    """(q, step) -> q after that step of the plan.

    Raises:
        SingularityError (when called): G is not defined there. TrackingError: the tool lost the path.
    """
    rate, error = checked_rate(strategy), strategy.task.error_function

    def step(q: Vector, i: int) -> Vector:
        new = runge_kutta(rate, q, *plan.step_rates(i))
        p, R = plan.target(i, 1.0)
        off = float(np.abs(error(new, p, R)).max())
        if not off < TOLERANCES.tracking:
            rcond = strategy.gain(q)[1]
            raise TrackingError(
                f"the tool is {off:.3g} (m or rad) off the path, with an rcond of {rcond:.1e} (1 is good, 0 singular)",
                "use more samples, or keep the path away from singular postures",
            )
        return new

    return step


def velocity_rules() -> VelocityRules:
    """The rules of native code: when a posture is sound, and when the tool has lost the path."""
    return VelocityRules(TOLERANCES.singular, TOLERANCES.representation, TOLERANCES.tracking)


def native_velocity(
    strategy: Strategy, plan: Plan, q0: Vector, limits: bool, *, load: bool, build: bool
) -> NativeFollower | None:
    """The same steps as native code, many in one call; None without it, see `Function.follower`, and of Python's G."""
    if isinstance(strategy, NumericStrategy):
        return None
    kernel = path_rate(strategy).follower("velocity", load=load, build=build)
    if kernel is None:
        return None
    return NativeFollower(kernel, plan, q0.copy(), velocity_rules(), limits)
