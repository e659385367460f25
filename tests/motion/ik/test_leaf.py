"""Leaves: moving onto one, inverse kinematics on one, and what a full turn counts."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import PANDA_START
from holokin.base.errors import ArgumentError, BranchError, EmptyRegionError, NotFiniteError, ShapeError

R3_START = np.array([0.3, 0.9, 0.7])


@pytest.fixture(scope="module")
def panda_pose(panda: hk.Robot) -> hk.Task:
    return hk.pose(panda)


def test_settling_finds_the_least_cost_that_the_self_motion_offers(panda: hk.Robot, panda_pose: hk.Task) -> None:
    preferred = PANDA_START + [0.2, -0.1, 0.3, 0.1, -0.2, 0.1, 0.0]
    strategy = hk.holonomic(panda_pose, hk.stationary(hk.strategies.constraints.posture_cost(preferred)))
    q = hk.motion.ik.move_to_leaf(strategy, PANDA_START)
    assert abs(strategy.constraint_value(q)) < 1e-13
    assert np.abs(panda.pose(q) - panda.pose(PANDA_START)).max() < 1e-13
    target = panda.pose(PANDA_START)
    held = {"type": "eq", "fun": lambda p: panda_pose.error(p, target[:3, 3], target[:3, :3])}
    best = minimize(
        lambda p: 0.5 * np.sum((p - preferred) ** 2), PANDA_START, constraints=held, options={"ftol": 1e-15}
    )
    assert np.abs(best.x - q).max() < 1e-6


def test_settling_sets_an_arm_angle_and_following_keeps_it(panda: hk.Robot, panda_pose: hk.Task) -> None:
    strategy = hk.holonomic(panda_pose, hk.arm_angle())
    now = strategy.constraint_value(PANDA_START)
    q = hk.motion.ik.move_to_leaf(strategy, PANDA_START, now + 0.4)
    assert strategy.constraint_value(q) == pytest.approx(now + 0.4, abs=1e-13)
    point = panda.pose(PANDA_START)[:3, 3]
    walk = hk.follow(strategy, hk.circle(point, point - [0.05, 0, 0]), q, samples=60)
    assert np.ptp(strategy.constraint_value.batch(walk.q)) < 1e-12


def test_settling_beyond_the_elbows_reach_ends_where_the_self_motion_turns(panda_pose: hk.Task) -> None:
    with pytest.raises(BranchError, match="ends at"):
        hk.motion.ik.move_to_leaf(
            hk.holonomic(panda_pose, hk.strategies.constraints.height("panda_joint4")), PANDA_START, 5.0
        )
    for leaf, error in (([0.0, 1.0], ShapeError), (np.nan, NotFiniteError)):
        with pytest.raises(error):
            hk.motion.ik.move_to_leaf(hk.holonomic(panda_pose, hk.lock(2)), PANDA_START, leaf)


def test_inverse_kinematics_is_a_function_of_the_pose_to_the_last_bit(panda: hk.Robot, panda_pose: hk.Task) -> None:
    strategy = hk.radial(hk.moore_penrose(panda_pose), PANDA_START)
    ik = hk.ik(strategy, PANDA_START)
    home = panda.pose(PANDA_START)
    rng = np.random.default_rng(0)
    for _ in range(5):
        pose = home.copy()
        pose[:3, 3] += rng.uniform(-0.06, 0.06, 3)
        pose[:3, :3] = Rotation.from_rotvec(rng.uniform(-0.2, 0.2, 3)).as_matrix() @ home[:3, :3]
        q = ik(pose)
        assert np.abs(panda.pose(q) - pose).max() < 1e-13
        ik(home)  # elsewhere in between
        assert np.array_equal(ik(pose), q)
    point = home[:3, 3] + [0.05, 0.02, 0]
    direct = hk.follow(strategy, hk.line(home[:3, 3], point), PANDA_START, samples=30).q[-1]
    roundabout = hk.polyline([home[:3, 3], home[:3, 3] + [0, 0.08, 0.03], point])
    assert np.abs(ik(point) - direct).max() < 1e-13
    assert np.abs(ik(point) - hk.follow(strategy, roundabout, PANDA_START, samples=60).q[-1]).max() < 1e-12
    for bad, error in ((np.eye(3), ShapeError), ([np.nan, 0, 0], NotFiniteError)):
        with pytest.raises(error):
            ik(bad)
    with pytest.raises(ArgumentError, match="radial"):
        hk.ik(hk.moore_penrose(panda_pose), PANDA_START)


def test_a_loop_round_the_base_comes_home_but_for_full_turns_T15(planar_3r: hk.Robot) -> None:
    """A holonomic strategy on a loop that does not contract: the base joint ends 2 pi further, the others at home."""
    strategy = hk.holonomic(hk.position(planar_3r), hk.lock(2))
    point = planar_3r.pose(R3_START)[:3, 3]
    drift = hk.drift(strategy, hk.circle(point, [0, 0, 0]), R3_START, cycles=2, samples=120, limits=False)
    assert drift.since_start[0] == pytest.approx([2 * np.pi, 0, 0], abs=1e-12)
    assert drift.since_start[1] == pytest.approx([4 * np.pi, 0, 0], abs=1e-12)


@pytest.mark.campaign
@pytest.mark.parametrize("orientation", ["twist", "rotation-vector"])
def test_a_rotation_vector_passes_half_a_turn(panda: hk.Robot, orientation: str) -> None:
    """The start is turned by 2.92 rad; 0.4 rad more about the same axis lead past pi."""
    R = panda.pose(PANDA_START)[:3, :3]
    w = Rotation.from_matrix(R).as_rotvec()
    start = panda.pose(PANDA_START)[:3, 3]
    path = hk.line(start, start + [0.01, 0, 0], turn=0.4 * w / np.linalg.norm(w))
    walk = hk.follow(hk.holonomic(hk.pose(panda, orientation), hk.lock(2)), path, PANDA_START, samples=50)
    assert (
        np.abs(panda.pose(walk.q[-1])[:3, :3] - Rotation.from_rotvec(0.4 * w / np.linalg.norm(w)).as_matrix() @ R).max()
        < 1e-12
    )


def test_curvature_is_not_judged_in_its_own_round_off(iiwa14: hk.Robot) -> None:
    strategy = hk.holonomic(hk.pose(iiwa14), hk.arm_angle())
    for q4 in (1e-2, 1e-3):
        assert hk.involutivity(strategy, hk.around([0.1, 0.6, 0.2, q4, 0.1, 0.6, 0.1], q4 / 10)).holonomic
    with pytest.raises(EmptyRegionError, match="nearly"):
        hk.involutivity(strategy, hk.around([0.1, 0.6, 0.2, 1e-6, 0.1, 0.6, 0.1], 1e-7))


def test_the_witness_shows_the_defect(irb140: hk.Robot) -> None:
    given = hk.moore_penrose(hk.position(irb140))
    v = hk.involutivity(given, hk.around(np.deg2rad([10.0, 70.0, 10.0, 20.0, 50.0, 30.0]), 0.3))
    F = hk.curvature(given, v.witness)[:, v.plane[0], v.plane[1]]
    assert v.defect == pytest.approx(np.linalg.norm(F), rel=1e-12)


def test_a_planar_tool_may_be_tilted() -> None:
    """Its turn is still the derivative of a coordinate, and the coordinate is the turn."""
    tool = np.eye(4)
    tool[:3, :3] = Rotation.from_euler("x", 90, degrees=True).as_matrix()
    task = hk.pose(hk.from_dh([{"a": 1.0}] * 3, tool=tool))
    assert task._exact
    assert task(R3_START)[2] == pytest.approx(R3_START.sum())


def test_what_is_not_a_number_or_no_weight_is_said_so(ppr: hk.Robot, panda: hk.Robot) -> None:
    logarithm = hk.holonomic(hk.position(ppr), hk.custom(lambda q: ca.log(q[0])))
    start = np.array([-1.0, 0.0, 0.3])
    tool = ppr.pose(start)[:3, 3]
    with pytest.raises(NotFiniteError, match="constraint of 'custom'"):
        hk.follow(logarithm, hk.line(tool, tool + [0.1, 0, 0]), start)
    with pytest.raises(NotFiniteError, match="what defines"):
        hk.strategies.pfaffian(hk.position(ppr), lambda q: [[ca.log(q[0]), 0, 1]])(start)
    for W in (lambda q: [[1, 0, 0], [0, -0.3, 0.5], [0, 0, 1]], lambda q: ca.diag(ca.vertcat(1, -1, 1))):
        with pytest.raises(ArgumentError, match="symmetric positive definite"):
            hk.weighted(hk.position(ppr), W)
    for rows in ([0, 1, 2, 5], [3, 4]):
        with pytest.raises(ArgumentError, match="rpy"):
            hk.pose(panda, rows=rows)
