"""A change over the cycles is below the tolerance only where its whole interval is, and a log of whole numbers hides
what it rounds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import holokin as hk
from holokin.analysis.audit import LogVerdict, Trend
from holokin.analysis.audit.logs import Recording
from holokin.analysis.audit.trend import Visits, judge

TOLERANCE = 1e-3
SHAPES: dict[str, Callable[[np.ndarray, np.random.Generator], np.ndarray]] = {
    "step": lambda c, rng: (c >= rng.integers(1, len(c))) * 1.0,
    "drift": lambda c, _: c / c[-1],
    "decay": lambda c, rng: 1 - rng.uniform(0.4, 0.9) ** c,
    "alternation": lambda c, _: c % 2,
}


def visits(y: np.ndarray, noise: float) -> Visits:
    """Visits of an arm whose joint 2 is spare, with the changes y (k, P)."""
    k, phases = y.shape
    q = y[:, :, None] * np.array([0.0, 1.0, 0.0])
    axes = np.tile([[0.0], [1.0], [0.0]], (phases, 1, 1))
    return Visits(q, axes, np.arange(float(k)), 0 * q, np.full((phases, 1), noise), np.zeros(phases))


@pytest.mark.parametrize("shape", SHAPES)
def test_a_change_over_the_tolerance_is_never_below_it_and_one_below_never_over(shape: str) -> None:
    """Changes of a fifth of the tolerance to five times as much, at one phase or all, in noise known or not."""
    rng, wrong, seen = np.random.default_rng(5), 0, 0
    for _ in range(60):
        k, size = int(rng.integers(5, 24)), TOLERANCE * 5 ** rng.uniform(-1, 1)
        noise = size * 10 ** rng.uniform(-2.5, -0.3)
        where = np.ones(64) if rng.uniform() < 0.5 else (np.arange(64) == rng.integers(64)) * 1.0
        change = size * SHAPES[shape](np.arange(float(k)), rng)
        size, y = np.ptp(change), change[:, None] * where + noise * rng.normal(size=(k, 64))
        found = judge(visits(y, noise if rng.uniform() < 0.5 else 0.0), TOLERANCE)
        if found.change > 0:
            seen += 1
            wrong += found.change_range[1] < TOLERANCE < 0.99 * size or (found.beyond and size < TOLERANCE)
            assert found.change_range[0] <= found.change <= found.change_range[1]
    assert seen >= 30 and wrong <= 1  # with 99 % confidence


def test_a_step_after_any_cycle_is_seen() -> None:
    rng = np.random.default_rng(2)
    for cycle in range(1, 12):
        y = 0.01 * (np.arange(12) >= cycle)[:, None] + 1e-3 * rng.normal(size=(12, 64))
        found = judge(visits(y, 0.0), TOLERANCE)
        assert found.beyond and found.trend is not Trend.NONE


@pytest.mark.parametrize("decimals", [4, 6, None])
def test_the_least_drift_that_a_log_shows_is_that_of_its_digits(decimals: int | None) -> None:
    """Cycles that are the same to the last digit: what these digits hide is not excluded."""
    robot, t = hk.load("planar-3r"), np.arange(601) / 30
    q = np.array([0.3, 0.9, 0.7]) + 0.2 * np.sin(np.pi * t[:, None] + np.arange(3))
    log = Recording(robot.joint_names, t, q if decimals is None else q.round(decimals), "log")
    found = hk.audit_recording(log, robot)
    assert found.verdict is LogVerdict.REPEATS
    assert found.detectable >= (1e-12 if decimals is None else 10.0**-decimals)
