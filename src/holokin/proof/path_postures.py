"""The postures of a leaf along a path that a proof starts from: not proven themselves, and found in bounded time."""

from __future__ import annotations

import numpy as np

from ..base.errors import BranchError, SingularityError, TrackingError
from ..base.types import Matrix, Vector
from ..motion.ik.leaf import LeafPath, leaf_follower, leaf_step, leaf_value, newton_on_leaf
from ..motion.ik.plan import Plan, check_start, make_plan
from ..path.synchronized_paths import AnyPath
from ..strategies import HolonomicStrategy
from .certificate import Extent

PIECES = 100
"""Pieces of a sample's step that are tried at most. `follow` may take 20,000 of them beside a singularity, to go as
near to it as it can; a proof ends long before, where its cells would be too small."""


def walked(strategy: HolonomicStrategy, path: AnyPath, q0: Vector, samples: int) -> tuple[Matrix, Extent, str]:
    """(postures (k, n) at the start and the samples, why they end, where) along a path, limits ignored.

    Raises:
        StartError: the tool at the start is not where the path begins. ArgumentError: paths that do not fit the task.
        SingularityError, BranchError, TrackingError: not even a first step is possible.
    """
    task = strategy.task
    strategy(q0)
    plan = make_plan(task, path, samples, task.place(q0)[1])
    check_start(task, q0, *plan.first)
    go, c = leaf_follower(strategy, q0, PIECES), leaf_value(strategy, q0)
    correct = leaf_step(strategy)
    side = float(correct(q0, *plan.first, c)[3])
    found = [q0]
    for step in range(plan.steps):
        try:  # a posture on another branch would leave cells that do not join
            near = newton_on_leaf(correct, found[-1], *plan.target(step, 1.0), c, side)
            found.append(go(found[-1], _way(plan, step, c)) if near is None else near[0])
        except (SingularityError, BranchError, TrackingError) as problem:
            if not step:
                raise
            why = Extent.SINGULAR if isinstance(problem, SingularityError) else Extent.END
            return np.array(found), why, plan.where(step).removeprefix("in cycle 1, ")
    return np.array(found), Extent.WHOLE, ""


def _way(plan: Plan, step: int, c: Vector) -> LeafPath:
    return LeafPath(lambda share: (*plan.target(step, share), c), *plan.bends(step))
