"""Judging joint postures at equal tool poses: does the drift stay, fade or vanish, and which limit comes first."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from ..task import Task
from ..types import Array, Matrix, Vector


class Homecoming(Enum):
    """What an audit found; the text says what it means."""

    COMES_HOME = "comes home: equal tool poses gave equal joints, in everything that was tested"
    BUT_FOR_THE_STEP = "comes home but for the step of the loop: feedback to the leaf, or a shorter step, mends it"
    CONVERGES = "settles: cycles repeat in the end, but the joints at a pose depend on the way, the speed or the past"
    DRIFTS = "drifts: every cycle leaves the joints elsewhere"
    UNKNOWN = "cannot be judged: the law failed, as told below"


class Trend(Enum):
    """How the joint drift of one cycle goes on over the cycles."""

    ZERO = "no drift beyond the tolerance"
    DECAYS = "the drift fades: the cycles settle"
    CONSTANT = "the drift goes on"


@dataclass(frozen=True, eq=False)
class DriftTrend:
    """Trend, with the factor `ratio` from one cycle's drift to the next (NaN for ZERO), the `rate` (n,) of the last
    cycles [joint units a cycle] and what is still to come of a fading drift, `remaining` (n,)."""

    trend: Trend
    ratio: float
    rate: Vector
    remaining: Vector


def drift_trend(drift: Matrix, threshold: float) -> DriftTrend:
    """Judge the drifts (c, n) of successive cycles.

    The postures' sums p_c, along the direction in which they spread most, are fitted by a + b (1 - r^c) / (1 - r),
    which is a + b c for r = 1. The drift fades when |r|^c < 1/2 and the last quarter of the cycles drifts less
    than half as fast as the first, or within the threshold; and so does the second half by itself, so that what
    goes on beneath a transient is seen.
    """
    count, n = drift.shape
    zero = np.zeros(n)
    postures = np.vstack([zero, np.cumsum(drift, axis=0)])
    if (postures.max(axis=0) - postures.min(axis=0)).max() <= threshold:
        return DriftTrend(Trend.ZERO, float("nan"), zero, zero)
    axis = np.linalg.svd(postures - postures.mean(axis=0))[2][0]
    y = postures @ axis
    ratio = _ratio(y)
    quarter = max(1, count // 4)
    early, late = abs(y[quarter] - y[0]), abs(y[-1] - y[-1 - quarter])
    fades = abs(ratio) ** count < 0.5 and (late < 0.5 * early or late <= threshold)
    tail = drift[count // 2 :]
    if fades and len(tail) >= 3:
        fades = drift_trend(tail, threshold).trend is not Trend.CONSTANT
    rate = drift[-max(1, count // 2) :].mean(axis=0)
    if not fades:
        return DriftTrend(Trend.CONSTANT, ratio, rate, np.where(rate != 0, np.copysign(np.inf, rate), 0.0))
    return DriftTrend(Trend.DECAYS, ratio, rate, drift[-1] * ratio / (1 - ratio))


def _ratio(y: Vector) -> float:
    """r of the best fit a + b (1 - r^c) / (1 - r) to y (c + 1,), r from -1 to 1.05."""
    if len(y) == 3:
        return float((y[2] - y[1]) / (y[1] - y[0])) if y[1] != y[0] else 1.0
    c = np.arange(len(y))

    def misfit(r: float) -> float:
        f = c.astype(float) if abs(1 - r) < 1e-9 else (1 - np.sign(r) ** c * np.abs(r) ** c) / (1 - r)
        f, rest = f - f.mean(), y - y.mean()
        return float(rest @ rest - (f @ rest) ** 2 / max(float(f @ f), 1e-300))

    tries = np.concatenate([-1 + np.linspace(0, 1, 41), 1 - np.logspace(-0.01, -5, 80), [1.0, 1.01, 1.02, 1.05]])
    misfits = np.array([misfit(r) for r in tries])
    best = int(np.argmin(misfits))
    from scipy.optimize import minimize_scalar

    low, high = tries[max(best - 1, 0)], tries[min(best + 1, len(tries) - 1)]
    finer = minimize_scalar(misfit, bounds=(low, high), method="bounded", options={"xatol": 1e-9})
    return float(finer.x if finer.fun < misfits[best] else tries[best])


def first_limit(lower: Vector, upper: Vector, q: Matrix, rate: Matrix) -> tuple[int, float] | None:
    """(joint, cycles) of the first joint at a limit when the postures q (P, n) of a cycle go on at their rates (P, n)
    [joint units a cycle]; None when none moves towards one."""
    room = np.where(rate > 0, upper - q, q - lower)
    cycles = np.full(q.shape, np.inf)
    np.divide(np.maximum(room, 0.0), np.abs(rate), out=cycles, where=rate != 0)
    _, joint = np.unravel_index(int(np.argmin(cycles)), cycles.shape)
    return (int(joint), float(cycles.min())) if np.isfinite(cycles.min()) else None


def to_pose(task: Task, q: Matrix, position: Matrix, rotation: Array) -> tuple[Matrix, Vector]:
    """Postures (k, n) moved to tool poses (k, 3), (k, 3, 3) close by, dq = J^+ e, and the largest joint's move (k,).

    What remains between two visits so moved is motion of the joints that the gap of the tool does not explain.
    """
    error = task.error_batch(q, position, rotation)
    jacobian, _ = task.jacobian_batch(q)
    gram = jacobian @ jacobian.transpose(0, 2, 1)
    trace = np.trace(gram, axis1=1, axis2=2)[:, None, None]
    weights = np.linalg.solve(gram + 1e-9 * trace * np.eye(task.m), error[:, :, None])
    move = (jacobian.transpose(0, 2, 1) @ weights)[:, :, 0]
    return q + move, np.abs(move).max(axis=1)


def spread(visits: Array) -> Matrix:
    """Largest distance of each joint between visits (c, P, n) of the same poses -> (P, n)."""
    return visits.max(axis=0) - visits.min(axis=0)
