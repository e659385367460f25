"""Can the tool get there at all? Asked only after following has failed."""

from __future__ import annotations

import numpy as np

from ..control import Plan
from ..tolerances import TOLERANCES
from ..types import Matrix, Vector

TARGETS = 24
"""Targets of the rest of the path that are tried."""

RESTARTS = 8
"""Random postures tried besides the last one before a target is called out of reach."""


def out_of_reach(plan: Plan, q: Vector, step: int, limits: bool) -> tuple[float, float] | None:
    """(share of the path, distance [m or rad]) of the first target from a step on that no posture reaches; else None.

    Least squares within the joint limits from the last posture, then from random ones.
    """
    for i in np.unique(np.linspace(step, plan.steps - 1, TARGETS).astype(int)):
        found, missing = _nearest(plan, q, *plan.target(int(i), 1.0), limits)
        if missing > TOLERANCES.tracking / 10:
            return (i + 1) / plan.steps, missing
        q = found
    return None


def _nearest(plan: Plan, q: Vector, position: Vector, rotation: Matrix, limits: bool) -> tuple[Vector, float]:
    from scipy.optimize import least_squares

    robot = plan.task.robot
    lower = robot.lower if limits else np.full(robot.n, -np.inf)
    upper = robot.upper if limits else np.full(robot.n, np.inf)
    q = np.clip(q, lower, upper)
    free = lower < upper  # a joint with equal limits stands still
    bounds = lower[free], upper[free]
    span = np.clip(bounds[0], q[free] - np.pi, None), np.clip(bounds[1], None, q[free] + np.pi)

    def error(moving: Vector) -> Vector:
        posture = q.copy()
        posture[free] = moving
        return plan.task.error(posture, position, rotation)

    rng = np.random.default_rng(0)
    best, least = q, float(np.abs(error(q[free])).max())
    for trial in range(RESTARTS + 1 if free.any() else 0):
        guess = q[free] if trial == 0 else rng.uniform(*span)
        found = least_squares(error, guess, bounds=bounds, xtol=1e-12)
        missing = float(np.abs(found.fun).max())
        if missing < least:
            best, least = q.copy(), missing
            best[free] = found.x
        if least <= TOLERANCES.tracking / 10:
            break
    return best, least
