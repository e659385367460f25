"""Leaves are local: loops that wind round a place where the law is not defined drift without curvature."""

from __future__ import annotations

import numpy as np
import pytest

import holokin as hk
from conftest import PPR_START
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


def test_a_leaf_round_the_base_ends_a_turn_further(planar_3r: hk.Robot) -> None:
    strategy = hk.holonomic(hk.position(planar_3r), hk.lock(2))
    loop = hk.circle(planar_3r.pose(R3_START)[:3, 3], [0, 0, 0])
    walk = hk.drift(strategy, loop, R3_START, cycles=2, limits=False)
    assert walk.turns.tolist() == [[1, 0, 0], [2, 0, 0]]
    assert "whole turns: q1 by +2" in walk.sentence


def test_a_loop_that_can_be_drawn_together_does_not_wind(planar_3r: hk.Robot) -> None:
    strategy = hk.holonomic(hk.position(planar_3r), hk.lock(2))
    point = planar_3r.pose(R3_START)[:3, 3]
    assert not hk.drift(strategy, hk.circle(point, point - [0.2, 0, 0]), R3_START).turns.any()


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
