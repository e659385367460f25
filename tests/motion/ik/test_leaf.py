"""Leaves: moving onto one, inverse kinematics on one, and what a full turn counts."""

from __future__ import annotations

from functools import cache

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import PANDA_START, sampled, urdf
from holokin.base.errors import ArgumentError, BranchError, HolokinError, NotFiniteError, ShapeError, UndecidedError
from holokin.motion.ik import InverseStatus
from holokin.strategies import HolonomicStrategy

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
    with pytest.raises(BranchError, match="leads no farther than"):
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
    with pytest.raises(UndecidedError):
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


# --- Inverse kinematics on other levels than that of the start: joints as a function of the pose and of c.


PANDA = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
LAWS = {
    "lock 3": lambda: hk.lock(2), "q1 - q3": lambda: hk.linear([1, 0, -1, 0, 0, 0, 0]), "arm angle": hk.arm_angle,
    "tilted": lambda: hk.strategies.constraints.tilted(hk.lock(2), lambda x: 0.3 * x[0] * x[1]),
}  # fmt: skip


@cache
def of_panda(name: str) -> tuple[HolonomicStrategy, hk.InverseKinematics]:
    strategy = hk.holonomic(hk.pose(hk.load("panda")), LAWS[name]())
    return strategy, hk.ik(strategy, PANDA, limits=False)


def poses_and_levels(name: str, seed: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Poses within a few centimetres of the start's, and levels within 0.4 of its own."""
    rng = np.random.default_rng(seed)
    strategy, _ = of_panda(name)
    poses = np.tile(strategy.task.pose(PANDA), (count, 1, 1))
    poses[:, :3, 3] += rng.uniform(-0.06, 0.06, (count, 3))
    turns = [pin.exp3(v) for v in rng.uniform(-0.2, 0.2, (count, 3))]
    poses[:, :3, :3] = turns @ poses[:, :3, :3]
    return poses, np.ravel(strategy.constraint_value(PANDA)) + rng.uniform(-0.4, 0.4, (count, 1))


@sampled(1, "name", LAWS)
def test_the_joints_are_those_of_the_pose_and_of_the_level_whatever_was_asked_before(name: str) -> None:
    """Pinocchio says where the tool is; g says which leaf it is; the leaf is reached by self-motion as well."""
    strategy, ik = of_panda(name)
    model = pin.buildModelFromUrdf(str(urdf("panda.urdf")))
    data, hand = model.createData(), model.getFrameId("panda_hand")
    fingers = np.zeros(model.nq - 7)
    pin.framesForwardKinematics(model, data, np.concatenate([PANDA, fingers]))
    tip = np.linalg.inv(data.oMf[hand].homogeneous) @ strategy.task.pose(PANDA)
    poses, levels = poses_and_levels(name, 0, 6)
    found = [ik(pose, level=c) for pose, c in zip(poses, levels, strict=True)]
    for pose, c, q in zip(poses, levels, found, strict=True):
        pin.framesForwardKinematics(model, data, np.concatenate([q, fingers]))
        assert np.abs(data.oMf[hand].homogeneous @ tip - pose).max() < 1e-9
        assert np.abs(strategy.constraint_value(q) - c).max() < 1e-12
        moved = hk.motion.ik.move_to_leaf(strategy, PANDA, c)
        assert np.abs(hk.ik(strategy, moved)(pose) - q).max() < 1e-10
        assert ik.agrees(q, level=c) and not ik.agrees(q)
    again = [ik(pose, level=c) for pose, c in zip(poses[::-1], levels[::-1], strict=True)][::-1]
    np.testing.assert_array_equal(again, found)
    batch = ik.batch(poses, level=levels)
    assert batch.reached.all() and np.abs(batch.q - found).max() < 1e-12


@sampled(1, "name", LAWS)
def test_a_loop_of_hand_and_elbow_brings_the_joints_back(name: str) -> None:
    """A closed path of the pair (pose, level), which an operator leads: every place of it has its joints."""
    strategy, ik = of_panda(name)
    T, c0, q, seen = strategy.task.pose(PANDA), np.ravel(strategy.constraint_value(PANDA)), PANDA, []
    for s in np.linspace(0, 2, 161):
        pose, c = T.copy(), c0 + 0.4 * np.sin(2 * np.pi * s)
        pose[:3, 3] += [0.05 * np.sin(4 * np.pi * s), 0.05 * (1 - np.cos(2 * np.pi * s)), 0.0]
        q = ik.near(pose, q, level=c)
        seen.append(q)
        if abs(np.sin(2 * np.pi * s)) > 0.1:
            assert ik.agrees(q, level=c)
    seen = np.array(seen)
    assert np.ptp(seen, axis=0).max() > 0.3
    assert np.abs(seen[80:] - seen[:81]).max() < 1e-9 and np.abs(seen[-1] - PANDA).max() < 1e-9
    assert np.abs(np.diff(seen, axis=0)).max() < 0.2


@pytest.mark.campaign
@sampled(1, "name", LAWS)
def test_the_nearest_pose_on_another_level_is_that_of_the_leaf_there(name: str) -> None:
    """Referees: `ik(pose, level)` within reach; beyond it, a start that self-motion leads to, on its own leaf."""
    strategy, ik = of_panda(name)
    poses, levels = poses_and_levels(name, 2, 6)
    for pose, c in zip(poses, levels, strict=True):
        found = ik.nearest(pose, level=c)
        assert found.status is InverseStatus.REACHED and np.abs(found.q - ik(pose, level=c)).max() < 1e-8
        far = pose.copy()
        far[:3, 3] += [0.5, 0.1, 0.1]
        found, moved = ik.nearest(far, level=c), hk.motion.ik.move_to_leaf(strategy, PANDA, c)
        theirs = hk.ik(strategy, moved, limits=False).nearest(far)
        assert found.status is InverseStatus.CLAMPED and np.abs(found.q - theirs.q).max() < 1e-6
        assert np.abs(strategy.constraint_value(found.q) - c).max() < 1e-9
        assert np.abs(ik.nearest(far, level=c).q - found.q).max() == 0.0
    assert np.abs(ik.nearest(poses[0]).q - ik(poses[0])).max() < 1e-8  # the level of the start is as it was


@pytest.mark.campaign
def test_a_loop_of_hand_and_elbow_beyond_reach_and_back_brings_the_joints_back_in_steps() -> None:
    strategy, ik = of_panda("lock 3")
    T, c0, q = strategy.task.pose(PANDA), np.ravel(strategy.constraint_value(PANDA)), PANDA
    step, clamped = strategy.task.robot.max_velocity * 0.01, 0
    for s in np.linspace(0.0, 1.0, 401):
        pose = T.copy()
        pose[0, 3] += 0.5 * np.sin(np.pi * s) ** 2
        found = ik.nearest(pose, q, level=c0 + 0.3 * np.sin(2 * np.pi * s), step=step)
        assert (np.abs(found.q - q) <= step + 1e-12).all()
        q, clamped = found.q, clamped + (found.status is InverseStatus.CLAMPED)
    assert clamped > 100 and np.abs(q - PANDA).max() < 1e-6


def test_an_angle_goes_to_its_level_by_the_shorter_way() -> None:
    strategy, ik = of_panda("arm angle")
    c, T = strategy.constraint_value(PANDA), strategy.task.pose(PANDA)
    near = ik(T, level=c + 0.3)
    assert np.abs(ik(T, level=c + 0.3 - 2 * np.pi) - near).max() < 1e-9
    assert np.abs(near - PANDA).max() > 0.05


def test_native_code_and_the_virtual_machine_have_the_same_joints(monkeypatch: pytest.MonkeyPatch) -> None:
    strategy, ik = of_panda("lock 3")
    poses, levels = poses_and_levels("lock 3", 1, 4)
    native = ik.batch(poses, level=levels)
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    slow = hk.ik(hk.holonomic(strategy.task, hk.lock(2)), PANDA)
    assert "virtual machine" in slow.engine
    assert np.abs(slow.batch(poses, level=levels).q - native.q).max() < 1e-12
    assert np.abs(slow.near(poses[0], PANDA, level=levels[0]) - native.q[0]).max() < 1e-12


def test_where_no_level_of_the_leaf_reaches_the_pose_it_is_said() -> None:
    """At full stretch no other elbow is left."""
    strategy, ik = of_panda("lock 3")
    far = strategy.task.pose(PANDA)
    far[0, 3] += 0.6
    with pytest.raises(HolokinError):
        ik(far, level=0.4)
    with pytest.raises(BranchError):
        ik.near(far, PANDA, level=0.4)
    assert ik.batch(far[None], level=0.4).status[0] == InverseStatus.LEAF_ENDS


def test_limits_hold_on_other_levels_as_well() -> None:
    """The elbow of a Panda goes round, until a joint is at its limit."""
    strategy, free = of_panda("arm angle")
    robot, T = strategy.task.robot, strategy.task.pose(PANDA)
    levels = strategy.constraint_value(PANDA) + np.linspace(-3.0, 3.0, 31)[:, None]
    ik, poses = hk.ik(strategy, PANDA), np.tile(T, (31, 1, 1))
    kept, all_ = ik.batch(poses, level=levels), free.batch(poses, level=levels)
    within = ((all_.q >= robot.lower) & (all_.q <= robot.upper)).all(axis=1)
    assert (kept.status[all_.reached & within] == InverseStatus.REACHED).all() and within.sum() > 5
    assert (kept.status[all_.reached & ~within] == InverseStatus.LIMIT).all() and (all_.reached & ~within).any()


def test_bad_levels_are_refused_with_a_cure() -> None:
    strategy, ik = of_panda("lock 3")
    T = strategy.task.pose(PANDA)
    for level, error in (
        ([0.1, 0.2], ShapeError),
        (np.nan, HolokinError),
        ("up", ArgumentError),
        (45.0, ArgumentError),
    ):
        for call in (
            lambda c: ik(T, level=c),
            lambda c: ik.near(T, PANDA, level=c),
            lambda c: ik.batch(T[None], level=c),
            lambda c: ik.nearest(T, level=c),
        ):
            with pytest.raises(error):
                call(level)
    with pytest.raises(ShapeError):
        ik.batch(np.tile(T, (3, 1, 1)), level=[[0.1], [0.2]])
    region = hk.unique_region(strategy, PANDA, budget=60)
    with pytest.raises(ArgumentError, match="region is of one level"):
        hk.ik(strategy, PANDA, region=region)(T, level=0.3)
