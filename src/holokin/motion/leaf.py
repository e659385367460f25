"""Following by leaf: Newton on [f(q) - x; g(q) - c], never jumping to another branch.

The joints become a function of the tool pose: the same pose gives the same joints, whatever happened
before. A step is accepted only while Newton contracts fast, which by the Newton-Kantorovich theorem means
that the root found is the one continued from the last [Deu04, section 3.1]; else it is halved.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..control.plan import Plan
from ..errors import BranchError
from ..strategy import Strategy
from ..tolerances import TOLERANCES
from ..types import Matrix, Vector

_ALMOST = 1e-7
"""A correction this small squares to round-off in the next step."""

_MOST = 12
"""Newton steps: contraction by 1/8 a step gets from 1 to 1e-10 in them; it is quadratic long before."""


def leaf_stepper(strategy: Strategy, plan: Plan, q0: Vector) -> Callable[[Vector, int], Vector]:
    """(q, step) -> q after that step of the plan, on the leaf through q0.

    Raises (when called):
        SingularityError: [J; J_g] is singular there. BranchError: the leaf ends.
    """
    task = strategy.task
    c = np.atleast_1d(strategy.constraint_value(q0)) if task.n > task.m else np.zeros(0)
    correct = strategy.leaf_step
    sign = np.sign(correct(q0, *plan.first, c)[3])

    def newton(q: Vector, p: Vector, R: Matrix) -> Vector | None:
        before = np.inf
        for _ in range(_MOST):
            dq, conditioning, margin, determinant = correct(q, p, R, c)
            size = float(np.abs(dq).max())
            sound = conditioning > TOLERANCES.singular and margin > TOLERANCES.representation
            if not sound or determinant * sign <= 0:
                return None
            if before <= _ALMOST:
                return q + dq if size <= before else q
            if not size <= TOLERANCES.contraction * before:
                return None
            q, before = q + dq, size
        return None

    def step(q: Vector, i: int) -> Vector:
        share, width = 0.0, 1.0
        while share < 1.0:
            goal = min(1.0, share + width)
            p, R = plan.target(i, goal)
            found = newton(q, p, R)
            if found is not None:
                q, share, width = found, goal, 2 * width
                continue
            width /= 2
            if width < TOLERANCES.smallest_step:
                _give_up(strategy, q)
        return q

    return step


def _give_up(strategy: Strategy, q: Vector) -> None:
    strategy(q)  # raises if it is singular already here
    raise BranchError(
        f"the leaf of {strategy.name!r} ends at q = {np.array2string(q, precision=6)}: there [J; J_g] turns "
        "singular and no nearby posture on it follows the path",
        "choose another constraint, or another leaf (start posture)",
    )
