"""How far a robot's tool gets from its base."""

from __future__ import annotations

import numpy as np

from ..arguments import typed
from .model import Robot

_SAMPLES = 4096
"""Postures of which the farthest are improved: for the robots of the catalogue four times as many change no digit."""

_STARTS = 12
"""Postures that are improved."""


@typed
def reach(robot: Robot, tip: str | None = None) -> float:
    """The largest distance [m] of a tip from the origin of the base frame, max |p(q)| within the joint limits.

    It is the farthest of random postures, the best of which are improved by L-BFGS-B: a lower bound that may in principle
    be missed, not one that can be exceeded by mistake. Infinite for a slider without limits.

    Raises:
        UnknownNameError: no such tip.
    """
    from scipy.optimize import minimize

    if not (np.isfinite([robot.lower, robot.upper]).all(axis=0) | robot.hinges).all():
        return float("inf")
    lower = np.where(np.isfinite(robot.lower), robot.lower, np.maximum(-np.pi, robot.upper - 2 * np.pi))
    upper = np.where(np.isfinite(robot.upper), robot.upper, lower + 2 * np.pi)
    Q = np.random.default_rng(0).uniform(lower, upper, (_SAMPLES, robot.n))
    far = np.linalg.norm(robot.pose_batch(Q, tip)[0], axis=1)

    def cost(q: np.ndarray) -> tuple[float, np.ndarray]:
        p = robot.pose(q, tip)[:3, 3]
        return -float(p @ p) / 2, -robot.jacobian(q, tip)[:3].T @ p

    found = [
        minimize(cost, q, jac=True, method="L-BFGS-B", bounds=list(zip(lower, upper, strict=True))).fun
        for q in Q[np.argsort(-far)[:_STARTS]]
    ]
    return float(np.sqrt(-2 * min(found)))
