"""Can the tool get there at all? Asked only after following has failed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..sampling import Plan
from ..task import Task
from ..tolerances import TOLERANCES
from ..types import Matrix, Vector

TARGETS = 24
"""Targets of the rest of the path that are tried."""

RESTARTS = 64
"""Random postures tried besides the last one before a target is called out of reach, 5 ms each. At eleven poses far
out on a Panda's circle of 0.35 m, one start in three got there; with 8 starts one of them was missed."""

LOOKS = 200
"""Postures that one search for a target looks at. A target that is reached takes some six."""

BUDGET = 5_000
"""Postures that are looked at in all: at most a second for a Panda. Where they do not suffice, nothing is said of the
reach. A count and not a clock, so that the answer is the same on every machine."""

STALLED, AFTER = 0.99, 20
"""A search that makes the error no smaller than this share within so many looks ends: close to a stretched arm, each
step gains less than the one before, and the looks are needed for other postures."""

STATIONARY = 1e-3
"""Largest cosine between the error that is left and what a joint does to it at which a search has got to its end."""

REACHED = TOLERANCES.tracking / 10
"""Error [m or rad] at which a target counts as reached."""

Look = Callable[[Vector], tuple[Vector, Matrix]]
"""q (n,) -> the error (m,) to a target and its derivative (m, n)."""


@dataclass(frozen=True, eq=False)
class _Search:
    """Where a search ended: posture, error that is left, whether nothing nearby is nearer, number of postures seen."""

    q: Vector
    missing: float
    stationary: bool
    looks: int


def out_of_reach(plan: Plan, q: Vector, step: int, limits: bool) -> tuple[float, float] | None:
    """(share of the path, distance [m or rad]) of the first target from a step on that no search reaches; else None.

    Least squares within the joint limits from the last posture, then from random ones. None also where the searches
    did not come to an end, since nothing is known then.
    """
    errors, left = _errors(plan.task), BUDGET
    for i in np.unique(np.linspace(step, plan.steps - 1, TARGETS).astype(int)):
        position, rotation = plan.target(int(i), 1.0)
        found = _nearest(plan.task, lambda q, p=position, R=rotation: errors(q, p, R), q, limits, left)
        left -= found.looks
        if found.missing > REACHED:
            known = found.stationary and left > 0
            return ((i + 1) / plan.steps, found.missing) if known else None
        q = found.q
    return None


def pose_out_of_reach(task: Task, position: Vector, rotation: Matrix, q: Vector, limits: bool) -> float | None:
    """Distance [m or rad] of a tool pose that no search from q or elsewhere reaches; else None, as also where the
    searches did not come to an end."""
    errors = _errors(task)
    found = _nearest(task, lambda q: errors(q, position, rotation), q, limits, BUDGET)
    known = found.missing > REACHED and found.stationary and found.looks < BUDGET
    return found.missing if known else None


def _errors(task: Task) -> Callable[[Vector, Vector, Matrix], tuple[Vector, Matrix]]:
    """(q, p, R) -> the task error (m,) and its derivative (m, n)."""

    def errors(q: Vector, position: Vector, rotation: Matrix) -> tuple[Vector, Matrix]:
        error, derivative = task.error_and_slope(q, position, rotation)
        return np.atleast_1d(error), np.reshape(derivative, (task.m, task.n))

    return errors


def _nearest(task: Task, look: Look, q: Vector, limits: bool, budget: int) -> _Search:
    """The best of a search from q and, where it does not reach the target, of some from random postures."""
    robot = task.robot
    lower = robot.lower if limits else np.full(robot.n, -np.inf)
    upper = robot.upper if limits else np.full(robot.n, np.inf)
    best = _search(look, np.clip(q, lower, upper), lower, upper, min(budget, LOOKS))
    looks, rng = best.looks, np.random.default_rng(0)
    low, high = np.where(np.isfinite(lower), lower, q - np.pi), np.where(np.isfinite(upper), upper, q + np.pi)
    for _ in range(RESTARTS):
        if best.missing <= REACHED or looks >= budget:
            break
        begin = np.clip(rng.uniform(np.minimum(low, high), np.maximum(low, high)), lower, upper)
        found = _search(look, begin, lower, upper, min(budget - looks, LOOKS))
        looks += found.looks
        best = found if found.missing < best.missing else best
    return _Search(best.q, best.missing, best.stationary, looks)


def _search(look: Look, q: Vector, lower: Vector, upper: Vector, most: int) -> _Search:
    """Damped least squares; a joint at its limit stays there while the error pushes it out. [GVL13, section 6.1]"""
    error, D = look(q)
    damping, looks, stationary, before = 1e-6, 1, False, np.inf
    while looks < most and np.isfinite(error).all() and np.isfinite(D).all():
        if np.abs(error).max() <= REACHED / 10:
            break
        if looks % AFTER == 0:
            if np.linalg.norm(error) > STALLED * before:
                break
            before = float(np.linalg.norm(error))
        slope = D.T @ error
        free = ~(((q <= lower) & (slope >= 0)) | ((q >= upper) & (slope <= 0)))
        sizes = np.linalg.norm(D, axis=0) * np.linalg.norm(error)
        stationary = not (np.abs(slope[free]) > STATIONARY * sizes[free]).any()
        if stationary:
            break
        A = D[:, free]
        normal = A @ A.T + damping * max(float(np.trace(A @ A.T)), 1e-300) * np.eye(len(error))
        moved = q.copy()
        moved[free] -= A.T @ np.linalg.solve(normal, error)
        moved = np.clip(moved, lower, upper)
        there, derivative = look(moved)
        looks += 1
        if np.isfinite(there).all() and there @ there < error @ error:
            q, error, D, damping = moved, there, derivative, max(damping / 10, 1e-12)
        else:
            damping *= 10
            if damping > 1e12:
                break
    return _Search(q, float(np.abs(error).max()), stationary, looks)
