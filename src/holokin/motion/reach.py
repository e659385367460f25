"""Can the tool get there at all? Asked only after following has failed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..control import Plan
from ..symbolic import Function, jacobian, symbol
from ..task import Task
from ..tolerances import TOLERANCES
from ..types import Matrix, Vector

TARGETS = 24
"""Targets of the rest of the path that are tried."""

RESTARTS = 5
"""Random postures tried besides the last one before a target is called out of reach."""

LOOKS = 60
"""Postures that one search for a target looks at. A target that is reached takes some ten."""

BUDGET = 900
"""Postures that are looked at in all: a second for a Panda. Where they do not suffice, nothing is said of the reach.
A count and not a clock, so that the answer is the same on every machine."""


def out_of_reach(plan: Plan, q: Vector, step: int, limits: bool) -> tuple[float, float] | None:
    """(share of the path, distance [m or rad]) of the first target from a step on that no search reaches; else None.

    Least squares within the joint limits from the last posture, then from random ones.
    """
    look, left = _errors(plan.task), BUDGET
    for i in np.unique(np.linspace(step, plan.steps - 1, TARGETS).astype(int)):
        position, rotation = plan.target(int(i), 1.0)
        q, missing, used = _nearest(plan.task, look, q, position, rotation, limits, left)
        left -= used
        if missing > TOLERANCES.tracking / 10:
            return ((i + 1) / plan.steps, missing) if left > 0 else None
    return None


def _errors(task: Task) -> Callable[[Vector, Vector, Matrix], tuple[Vector, Matrix]]:
    """(q, p, R) -> the task error (m,) and its exact derivative (m, n)."""
    q, p, R = symbol("q", task.n), symbol("p", 3), symbol("R", 3, 3)
    e = task.error_expression(task.robot.kinematics(q, task.tip), p, R)
    made = Function("reach", {"q": q, "p": p, "R": R}, {"e": e, "D": jacobian(e, q)})

    def look(q: Vector, position: Vector, rotation: Matrix) -> tuple[Vector, Matrix]:
        error, derivative = made(q, position, rotation)
        return np.atleast_1d(error), np.reshape(derivative, (task.m, task.n))

    return look


def _nearest(
    task: Task, look: Callable[[Vector, Vector, Matrix], tuple[Vector, Matrix]], q: Vector, position: Vector,
    rotation: Matrix, limits: bool, budget: int,
) -> tuple[Vector, float, int]:  # fmt: skip
    """(posture nearest to a target of those found, its distance, postures looked at)."""
    from scipy.optimize import least_squares

    robot = task.robot
    lower = robot.lower if limits else np.full(robot.n, -np.inf)
    upper = robot.upper if limits else np.full(robot.n, np.inf)
    free = lower < upper  # a joint whose limits are equal stays where it is
    here = np.clip(q, lower, upper)
    span = np.clip(lower, q - np.pi, None)[free], np.clip(upper, None, q + np.pi)[free]
    rng = np.random.default_rng(0)

    def posture(values: Vector) -> Vector:
        full = here.copy()
        full[free] = values
        return full

    def far(posture: Vector) -> float:
        return float(np.abs(look(posture, position, rotation)[0]).max())

    best, least, used = here, far(here), 1
    for trial in range((RESTARTS + 1) if free.any() else 0):
        if least <= TOLERANCES.tracking / 10 or used >= budget:
            break
        found = least_squares(
            lambda values: look(posture(values), position, rotation)[0],
            here[free] if trial == 0 else rng.uniform(*span),
            jac=lambda values: look(posture(values), position, rotation)[1][:, free],
            bounds=(lower[free], upper[free]),
            xtol=1e-10,
            max_nfev=min(LOOKS, budget - used),
        )
        used += int(found.nfev)
        missing = float(np.abs(found.fun).max())
        if missing < least:
            best, least = posture(found.x), missing
    return best, least, used
