"""The time-optimal law on random curves of joints: its time is that of toppra, and the limits hold on a finer grid."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from holokin.motion.timing import Stretch, TimeLaw, time_optimal

SEEDS = [*range(4), *(pytest.param(k, marks=pytest.mark.campaign) for k in range(4, 120))]


def drawn(seed: int) -> tuple[Stretch, np.ndarray, np.ndarray, float]:
    """A curve of 1 to 8 joints, revolute and prismatic, some at rest, with limits of speed and acceleration; with or
    without a bound of ds/dt."""
    draw = np.random.default_rng(seed)
    n, k = int(draw.integers(1, 9)), int(draw.integers(8, 60))
    s = np.linspace(0, 10 ** draw.uniform(-1, 1.5), k)
    waves = np.sin(s[:, None] / s[-1] * draw.uniform(0.5, 12, n) + draw.uniform(0, 6, n))
    q = waves * 10 ** draw.uniform(-2, 0.5, n) * (draw.random(n) < 0.85) + s[:, None] * draw.normal(size=n) / s[-1]
    speed = 10 ** draw.uniform(-1, 1) if draw.random() < 0.5 else np.inf
    velocity = np.where(draw.random(n) < 0.8, 10 ** draw.uniform(-0.5, 1, n), np.inf)
    return Stretch(s, q), velocity, 10 ** draw.uniform(-0.5, 1.5, n), float(speed)


def by_toppra(
    stretch: Stretch, s: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, speed: float, mean: float
) -> float:
    """Seconds that toppra finds for the same curve on a grid s. It gets s / mean: it works best at rates near 1."""
    pytest.importorskip("toppra")  # it has wheels for Linux alone
    from toppra.algorithm import TOPPRA
    from toppra.constraint import DiscretizationType, JointAccelerationConstraint, JointVelocityConstraint
    from toppra.interpolator import AbstractGeometricPath

    base: Any = AbstractGeometricPath

    class Curve(base):  # with s as one more joint, whose speed is the rate
        dof = stretch.q.shape[1] + 1
        path_interval = np.array([0.0, stretch.length / mean])
        waypoints = None

        def __call__(self, s: Any, order: int = 0) -> np.ndarray:
            at = np.atleast_1d(np.asarray(s, dtype=float))
            more = (at, np.ones_like(at), np.zeros_like(at))[order]
            known = stretch.derivatives(np.minimum(mean * at, stretch.length))[order]
            found = np.column_stack([mean**order * known, more])
            return found if np.ndim(s) else found[0]

    most = np.minimum(np.append(velocity, speed / mean), 1e3)
    bounds = [np.column_stack([-x, x]) for x in (most, np.append(acceleration, 1e6))]
    constraints = [
        JointVelocityConstraint(bounds[0]),
        JointAccelerationConstraint(bounds[1], DiscretizationType.Interpolation),
    ]
    grid = s / mean
    rates: Any = TOPPRA(constraints, Curve(), gridpoints=grid, solver_wrapper="seidel").compute_parameterization(0, 0)[
        1
    ]
    return float((2 * np.diff(grid) / (rates[:-1] + rates[1:])).sum())


@pytest.mark.parametrize("seed", SEEDS)
def test_no_law_is_faster_and_none_of_the_limits_is_exceeded(seed: int) -> None:
    stretch, velocity, acceleration, speed = drawn(seed)
    law: TimeLaw = time_optimal(stretch, 1, velocity, acceleration, np.full(len(velocity), np.inf), speed)
    _, (s, *rates) = law.within(20_000)
    _, dq, ddq, _ = stretch.motion(s, rates)
    assert rates[0].max() <= speed * (1 + 1e-9) and s[-1] == pytest.approx(stretch.length, rel=1e-12)
    assert (np.abs(dq) / velocity).max() < 1.01
    share = np.abs(ddq) / acceleration
    assert np.quantile(share.max(axis=1), 0.999) < 1.01  # between the points of the grid; `retime` slows down by that
    grid = np.append(law.c[0], stretch.length)
    optimum = by_toppra(stretch, grid, velocity, acceleration, speed, stretch.length / law.duration)
    assert law.duration == pytest.approx(optimum, rel=1e-3)
