"""The repeatable law nearest to a given one: the planimeter's optimum from any start, arms beside the radial law."""

from __future__ import annotations

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, PPR_RADIUS, sampled
from holokin.analysis.coverage.pose_postures import chart_of, coordinates_of
from holokin.analysis.curvature import ball, box
from holokin.analysis.design.closest_strategy import SampledSeries, series_over
from holokin.base.errors import ArgumentError
from holokin.symbolic import SX, sin

OPTIMUM = 0.035229
"""rms of |A - A'| over the disc and all leaves, A = dq3/dx along the pseudo-inverse of the PPR arm (theory 5.4)."""


def slope(relative: float) -> float:
    """rms of |A - A'| from that of |G - G'| / |G|: |Z|^2 = 2 and |G|^2 = 3/2 everywhere on the PPR arm."""
    return relative * np.sqrt(1.5 / 2)


@sampled(1, "start", [(0.9, -0.3, np.pi / 4), (1.0, 0.5, -2.0), (0.0, 0.0, 3.0)])
def test_the_nearest_law_of_the_planimeter_is_the_known_optimum_from_any_start(
    ppr: hk.Robot, start: tuple[float, ...]
) -> None:
    found = hk.analysis.design.closest_holonomic(
        hk.moore_penrose(hk.position(ppr)), ball(start, PPR_RADIUS, along=10.0)
    )
    assert found.terms == 70
    assert slope(found.steps[1]) == pytest.approx(OPTIMUM, rel=0.01)
    assert slope(found.ours.rms) == pytest.approx(OPTIMUM, rel=0.02)
    assert found.radial is not None
    assert slope(found.radial.rms) == pytest.approx(0.035674, rel=0.01)
    assert found.bound is not None
    assert found.ours.largest > found.bound > 0.05
    assert found.steps[1] < found.steps[0]  # the least squares alone give 0.0356
    assert hk.involutivity(found.strategy, hk.around(start, 0.3)).holonomic


@pytest.mark.campaign
def test_the_deviation_is_that_of_the_strategy_itself(ppr: hk.Robot) -> None:
    """And one full turn of joint 3 leads to the same planes: the series has its period."""
    mp = hk.moore_penrose(hk.position(ppr))
    found = hk.analysis.design.closest_holonomic(
        mp, ball((0.9, -0.3, 0.8), PPR_RADIUS, along=10.0), degree=2, samples=512
    )
    rho, angle, q3 = np.random.default_rng(0).uniform([[0], [0], [-np.pi]], [[1], [2 * np.pi], [np.pi]], (3, 2000))
    x = PPR_RADIUS * np.sqrt(rho)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    center = hk.position(ppr)([0.9, -0.3, 0.8])
    Q = np.column_stack([center + x - np.column_stack([np.cos(q3), np.sin(q3)]), q3])
    assert hk.analysis.curvature.deviation(mp, found.strategy, Q).rms == pytest.approx(found.ours.rms, rel=0.03)
    assert found.strategy.batch(Q + [0, 0, 2 * np.pi]) == pytest.approx(found.strategy.batch(Q), abs=1e-12)


@pytest.mark.campaign
def test_over_a_joint_box_it_is_nearer_than_radial(panda: hk.Robot) -> None:
    """A Panda, positions and turns; and its position task with four redundant joints."""
    for task, degree in ((hk.pose(panda), 2), (hk.position(panda), 2)):
        mp = hk.moore_penrose(task)
        found = hk.analysis.design.closest_holonomic(mp, hk.around(PANDA_START, 0.15), degree=degree, samples=1024)
        assert found.radial is not None
        assert found.ours.rms < 0.97 * found.radial.rms
        assert found.ours.extra_speed > 0  # the pseudo-inverse is the slowest
        assert found.bound is None
        assert hk.involutivity(found.strategy, hk.around(PANDA_START, 0.1)).holonomic


@pytest.mark.campaign
def test_the_nearest_law_of_a_repeatable_one_is_this_law(panda: hk.Robot) -> None:
    """Its own constraint where it has one; where it has rows alone, which nobody integrated, radial of it."""
    task, region = hk.pose(panda), hk.around(PANDA_START, 0.15)
    held = hk.analysis.design.closest_holonomic(hk.holonomic(task, hk.arm_angle()), region, degree=2, samples=256)
    assert held.ours.largest < 1e-12
    assert held.least_slope == pytest.approx(1.0)

    def rows(q: SX) -> SX:
        return SX([[1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0]]) + 3 * sin(q[2]) * SX([[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]])

    law = hk.strategies.pfaffian(task, rows)
    found = hk.analysis.design.closest_holonomic(law, region, degree=2, samples=256)
    assert found.terms == 0
    assert found.ours.rms < 1e-5 < found.steps[1]
    Q = region.sample(5, 3)
    assert found.strategy.batch(Q) == pytest.approx(law.batch(Q), abs=1e-3)


@pytest.mark.parametrize("rows", [None, (0, 1)])
def test_its_derivatives_are_those_of_differences(panda: hk.Robot, rows: tuple[int, ...] | None) -> None:
    """r = 4, and r = 5."""
    task, Q = hk.position(panda, rows=rows), hk.around(PANDA_START, 0.2).sample(40)
    law = hk.holonomic(task, hk.linear(np.linalg.svd(task.jacobian(PANDA_START))[2][task.m :]))
    c = coordinates_of(chart_of(task, np.eye(3)), Q)
    mp, series = hk.moore_penrose(task), series_over(law, c, Q, 2, None)
    problem = SampledSeries.of(mp, law, series, np.linspace(1, 2, c.d), Q)
    cost, x = problem.cost(0.01), 0.02 * np.random.default_rng(0).normal(size=problem.white.shape[1])
    way, h = np.random.default_rng(1).normal(size=len(x)), 1e-6
    here, ahead, behind = (cost(x + s * h * way, None) for s in (0, 1, -1))
    assert here is not None and ahead is not None and behind is not None
    assert here[1] @ way == pytest.approx((ahead[0] - behind[0]) / (2 * h), rel=1e-5)


def test_bad_regions_are_told_with_their_cure(ppr: hk.Robot, irb140: hk.Robot) -> None:
    mp = hk.moore_penrose(hk.position(ppr))
    with pytest.raises(ArgumentError, match=r"`along` of the ball is 0.0; give hk.analysis.curvature.ball"):
        hk.analysis.design.closest_holonomic(mp, ball((0.9, -0.3, 0.8), 0.1))
    with pytest.raises(ArgumentError, match="redundant joints is 0"):
        hk.analysis.design.closest_holonomic(hk.moore_penrose(hk.pose(irb140)), hk.around(np.full(6, 0.3), 0.1))
    with pytest.raises(ArgumentError, match="give another base, or a smaller region"):
        hk.analysis.design.closest_holonomic(mp, box([-1, -1, -2], [1, 1, 2]), base=hk.custom(lambda q: q[2] ** 2))
    with pytest.raises(ArgumentError, match="the degree is 0"):
        hk.analysis.design.closest_holonomic(mp, hk.around((0.9, -0.3, 0.8), 0.1), degree=0)
