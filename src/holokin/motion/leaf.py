"""Following by leaf: Newton on [f(q) - x; g(q) - c], never jumping to another branch.

The joints become a function of the tool pose: the same pose gives the same joints, whatever happened
before. A step is accepted only while Newton contracts fast, which by the Newton-Kantorovich theorem means
that the root found is the one continued from the last [Deu04, section 3.1]; else it is halved.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..control import Plan
from ..errors import ArgumentError, BranchError, NotFiniteError, ShapeError
from ..strategy import Strategy
from ..symbolic import LeafRules
from ..tolerances import TOLERANCES
from ..types import ArrayLike, Matrix, Vector
from .native import NativeWalk

ALMOST = 1e-7
"""A correction this small squares to round-off in the next step."""

_MOST = 12
"""Newton steps: contraction by 1/8 a step gets from 1 to 1e-10 in them; it is quadratic long before."""


Target = Callable[[float], tuple[Vector, Matrix, Vector]]
"""share in [0, 1] -> (position (3,), rotation (3, 3), leaf value c (r,)) wanted there."""


def leaf_walker(strategy: Strategy, q0: Vector) -> Callable[[Vector, Target], Vector]:
    """(q, target) -> the posture at target(1), continued from q, which is at target(0); on the branch of q0.

    Raises (when called):
        SingularityError: [J; J_g] is singular there. BranchError: the leaf ends.
    """
    correct = strategy.leaf_step
    pose = strategy.task.robot.pose(q0, strategy.task.tip)
    side = correct(q0, pose[:3, 3], pose[:3, :3], leaf_value(strategy, q0))[3]

    def newton(q: Vector, p: Vector, R: Matrix, c: Vector) -> Vector | None:
        before = np.inf
        for _ in range(_MOST):
            dq, conditioning, margin, here = correct(q, p, R, c)
            size = float(np.abs(dq).max())
            sound = conditioning > TOLERANCES.singular and margin > TOLERANCES.representation
            if not sound or here != side:
                return None
            if before <= ALMOST:
                return q + dq if size <= before else q
            if not size <= TOLERANCES.contraction * before:
                return None
            q, before = q + dq, size
        return None

    def walk(q: Vector, target: Target) -> Vector:
        share, width = 0.0, 1.0
        while share < 1.0:
            goal = min(1.0, share + width)
            found = newton(q, *target(goal))
            if found is not None:
                q, share, width = found, goal, 2 * width
                continue
            width /= 2
            if width < TOLERANCES.smallest_step:
                _give_up(strategy, q)
        return q

    return walk


def leaf_stepper(strategy: Strategy, plan: Plan, q0: Vector) -> Callable[[Vector, int], Vector]:
    """(q, step) -> q after that step of the plan, on the leaf through q0. Raises (when called): as `leaf_walker`."""
    walk, c = leaf_walker(strategy, q0), leaf_value(strategy, q0)
    return lambda q, i: walk(q, lambda share: (*plan.target(i, share), c))


def native_leaf(strategy: Strategy, plan: Plan, q0: Vector, limits: bool) -> NativeWalk | None:
    """The same steps as native code, many in one call; None without a compiler."""
    kernel = strategy.leaf_step.follower("leaf")
    if kernel is None:
        return None
    (p, R), c, t = plan.first, leaf_value(strategy, q0), TOLERANCES
    side = float(strategy.leaf_step(q0, p, R, c)[3])
    rules = LeafRules(t.singular, t.representation, t.contraction, ALMOST, t.smallest_step, side, _MOST)
    return NativeWalk(kernel, plan, np.concatenate([q0, p, R.ravel(), c]), rules, limits)


def leaf_value(strategy: Strategy, q: Vector) -> Vector:
    """g(q) (r,); empty when nothing is redundant. Raises: NotFiniteError."""
    if strategy.task.n == strategy.task.m:
        return np.zeros(0)
    value = np.atleast_1d(strategy.constraint_value(q))
    if not np.isfinite(value).all():
        raise NotFiniteError(f"the constraint of {strategy.name!r} at q = {q.tolist()}", value.tolist())
    return value


def settle(strategy: Strategy, q0: ArrayLike, leaf: ArrayLike = 0.0) -> Vector:
    """The posture (n,) with the tool pose of q0 on another leaf g(q) = c, reached by the self-motion from q0.

    A strategy keeps the leaf of its start posture. To hold a *stationary* cost the start must be on the leaf 0 of
    `stationary(cost)`, to hold a certain arm angle on that angle's leaf: begin from here.

    Args:
        leaf: c (r,), or one number for all rows.

    Raises:
        SingularityError, BranchError: no such posture before a singular one. ArgumentError: no constraint.
        ShapeError, NotFiniteError.
    """
    task = strategy.task
    start = task.robot.checked(q0, "the start posture")
    if strategy.constraint is None:
        raise ArgumentError("the strategy", strategy.name, "settling needs a constraint: hk.holonomic(task, g)")
    strategy(start)
    at = leaf_value(strategy, start)
    try:
        goal = np.broadcast_to(np.asarray(leaf, dtype=float), at.shape)
    except ValueError:
        raise ShapeError("the leaf", at.shape, np.shape(leaf)) from None
    if not np.isfinite(goal).all():
        raise NotFiniteError("the leaf", goal.tolist())
    pose = task.robot.pose(start, task.tip)
    p, R = pose[:3, 3], pose[:3, :3]
    return leaf_walker(strategy, start)(start, lambda share: (p, R, at + share * (goal - at)))


def _give_up(strategy: Strategy, q: Vector) -> None:
    strategy(q)  # raises if it is singular already here
    raise BranchError(
        f"the leaf of {strategy.name!r} ends at q = {np.array2string(q, precision=6)}: there [J; J_g] turns "
        "singular and no nearby posture on it follows the path",
        "choose another constraint, or another leaf (start posture)",
    )
