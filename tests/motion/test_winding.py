"""Leaves are local: loops that wind round a place where the law is not defined drift without curvature."""

from __future__ import annotations

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, PPR_START, sampled
from holokin.analysis.audit.questions import plane_loop
from holokin.base.errors import OpenPathError, PathError
from holokin.motion import Cause
from holokin.symbolic import cos, horzcat, sin

R3_START = np.array([0.3, 0.8, 0.5])


@pytest.fixture(scope="module")
def half_the_polar_angle() -> hk.Strategy:
    """dq3 = d(atan2(y, x)) / 2 on the PPR arm: holonomic, but not defined where the tool is at the origin."""

    def rows(q):
        x, y = q[0] + cos(q[2]), q[1] + sin(q[2])
        dx, dy, dq3 = horzcat(1, 0, -sin(q[2])), horzcat(0, 1, cos(q[2])), horzcat(0, 0, 1)
        return 2 * (x**2 + y**2) * dq3 - (x * dy - y * dx)

    return hk.strategies.pfaffian(hk.position(hk.load("ppr")), rows)


def test_a_holonomic_law_drifts_by_half_a_turn_round_the_origin(half_the_polar_angle: hk.Strategy) -> None:
    point = half_the_polar_angle.task.robot.pose(PPR_START)[:3, 3]
    assert hk.involutivity(half_the_polar_angle, hk.around(PPR_START, 0.3)).holonomic
    loop = hk.circle(point, [0, 0, 0])
    walk = hk.drift(half_the_polar_angle, loop, PPR_START, cycles=2, limits=False)
    assert walk.trajectory.drift()[:, 2] == pytest.approx([np.pi, np.pi])
    assert walk.turns.tolist() == [[0, 0, 0], [0, 0, 1]], "two rounds make one turn of the hinge; sliders have none"
    found = hk.motion.winding(half_the_polar_angle, loop, PPR_START, limits=False)
    assert found.cause is Cause.WINDING
    assert found.jump[2] == pytest.approx(np.pi, abs=0.05)
    assert found.between[1] < 0.5 < found.between[0], "the circle through the origin has half the size"
    assert "not defined" in found.sentence


@pytest.mark.campaign
@sampled(1, "center", [[0.3, -0.2, 0.0], [0.9, 0.1, 0.0], [0.6, 0.5, 0.0]])
def test_the_loop_that_passes_the_origin_is_found_where_it_is(
    half_the_polar_angle: hk.Strategy, center: list[float]
) -> None:
    """|p + s (c - p)| = s |c - p| at s = |p|^2 / (2 p . (p - c)); a loop with s > 1 leaves the origin outside."""
    p = half_the_polar_angle.task.robot.pose(PPR_START)[:3, 3]
    found = hk.motion.winding(half_the_polar_angle, hk.circle(p, center), PPR_START, limits=False)
    at = p @ p / (2 * p @ (p - center))
    if at < 1:
        assert found.cause is Cause.WINDING
        assert found.between[1] <= at <= found.between[0]
        assert found.between[0] - found.between[1] < 0.1
    else:
        assert found.cause is Cause.NONE


def test_a_leaf_round_the_base_ends_a_turn_further(planar_3r: hk.Robot) -> None:
    strategy = hk.holonomic(hk.position(planar_3r), hk.lock(2))
    loop = hk.circle(planar_3r.pose(R3_START)[:3, 3], [0, 0, 0])
    walk = hk.drift(strategy, loop, R3_START, cycles=2, limits=False)
    assert walk.turns.tolist() == [[1, 0, 0], [2, 0, 0]]
    assert "whole turns: q1 by +2" in walk.sentence
    found = hk.motion.winding(strategy, loop, R3_START, limits=False)
    assert found.cause is Cause.WINDING
    assert found.jump == pytest.approx([2 * np.pi, 0, 0])
    assert "drift 6.283 rad (q1 by +1 turn);" in str(found)


def test_a_loop_that_can_be_drawn_together_does_not_wind(planar_3r: hk.Robot) -> None:
    strategy = hk.holonomic(hk.position(planar_3r), hk.lock(2))
    point = planar_3r.pose(R3_START)[:3, 3]
    found = hk.motion.winding(strategy, hk.circle(point, point - [0.2, 0, 0]), R3_START)
    assert found.cause is Cause.NONE
    assert not hk.drift(strategy, hk.circle(point, point - [0.2, 0, 0]), R3_START).turns.any()


@sampled(1, "rows", [(0, 1), (0, 5), (3, 4)])
def test_drift_by_curvature_fades_as_the_loop_is_drawn_together(panda: hk.Robot, rows: tuple[int, int]) -> None:
    """As its area does: the drift of half the loop is about a quarter."""
    task = hk.pose(panda)
    tool = panda.pose(PANDA_START)
    loop = plane_loop(task, tool[:3, 3], tool[:3, :3], *rows)
    found = hk.motion.winding(hk.moore_penrose(task), loop, PANDA_START, samples=100)
    assert found.cause is Cause.CURVATURE
    half = np.abs(found.drifts[found.sizes == 0.5][0]).max() / np.abs(found.drift).max()
    assert half == pytest.approx(0.25, abs=0.05)


def test_the_prytz_planimeter_does_not_wind(ppr: hk.Robot) -> None:
    """Its drift is large, 4.8 rad round a circle of 1.7 m, and yet by curvature alone."""
    point = ppr.pose(PPR_START)[:3, 3]
    found = hk.motion.winding(hk.moore_penrose(hk.position(ppr)), hk.circle(point, [0, 0, 0]), PPR_START, limits=False)
    assert np.abs(found.drift).max() > 4
    assert found.cause is Cause.CURVATURE


def test_a_tool_that_turns_round_once_cannot_be_drawn_together(panda: hk.Robot) -> None:
    point = panda.pose(PANDA_START)[:3, 3]
    third = [0, 0, 2 * np.pi / 3]
    strategy = hk.moore_penrose(hk.pose(panda))
    round_once = hk.polyline([point] * 4, turns=[third] * 3)
    found = hk.motion.winding(strategy, round_once, PANDA_START, limits=False)
    assert found.cause is Cause.TOOL_TURNS
    there_and_back = hk.polyline([point] * 5, turns=[third, third, [0, 0, -4 * np.pi / 3], [0.2, 0, 0]])
    home = hk.path.join(there_and_back, hk.polyline([point] * 2, turns=[[-0.2, 0, 0]]))
    assert hk.motion.winding(strategy, home, PANDA_START, limits=False).cause is not Cause.TOOL_TURNS


def test_only_what_can_be_followed_is_judged(ppr: hk.Robot, half_the_polar_angle: hk.Strategy) -> None:
    point = ppr.pose(PPR_START)[:3, 3]
    with pytest.raises(OpenPathError):
        hk.motion.winding(half_the_polar_angle, hk.line(point, point + [0.1, 0, 0]), PPR_START)
    with pytest.raises(PathError):
        hk.motion.winding(half_the_polar_angle, hk.circle(point, point / 2), PPR_START, limits=False)


@pytest.mark.campaign
def test_an_audit_round_the_base_tells_turns_from_curvature(planar_3r: hk.Robot) -> None:
    task = hk.position(planar_3r)
    law = hk.motion.control.closed_loop(hk.holonomic(task, hk.lock(2)))
    loop = hk.circle(planar_3r.pose(R3_START)[:3, 3], [0, 0, 0], speed=4.0)
    found = hk.audit(law, task, [loop], q0=R3_START, dt=0.01, cycles=3)
    assert found.verdict is hk.analysis.audit.Repeatability.DRIFTS
    assert "whole turns in the first cycle: q1 by +1" in found["cycles"].sentence
    assert "small loops at the start do not drift" in found.sentence
    curved = hk.audit(hk.moore_penrose(task), task, q0=R3_START, dt=0.02, cycles=3)
    assert "small loops at the start" not in curved.sentence
