"""`hk.ik`: the same pose, the same joints; alone, from nearby, and many at once."""

from __future__ import annotations

import pickle
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import PANDA_START
from holokin.base.errors import ArgumentError, BranchError, HolokinError, JointLimitError, OutOfReachError
from holokin.motion.ik import InverseStatus
from holokin.path.workspaces import pose_cloud
from holokin.symbolic.native import kernel

DOWN = np.diag([1.0, -1.0, -1.0])


def poses_of_the_box(
    count: int, seed: int = 0, center=(0.5, 0.0, 0.3), half=(0.25, 0.4, 0.3), tilt: float = 40, spin: float = 90
) -> np.ndarray:
    """(count, 4, 4): in a box, tool down, tilted by up to `tilt` and spun by +-`spin` [deg]."""
    rng = np.random.default_rng(seed)
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, 3] = center + rng.uniform(-1, 1, (count, 3)) * half
    axis, lean = rng.uniform(-np.pi, np.pi, count), np.deg2rad(tilt) * np.sqrt(rng.uniform(size=count))
    tilted = np.stack([lean * np.cos(axis), lean * np.sin(axis), np.zeros(count)], axis=1)
    spun = np.outer(np.deg2rad(spin) * rng.uniform(-1, 1, count), [0, 0, 1])
    poses[:, :3, :3] = (Rotation.from_rotvec(tilted) * Rotation.from_rotvec(spun)).as_matrix() @ DOWN
    return poses


def inner(count: int, seed: int = 0) -> np.ndarray:
    """Those of a smaller box, between any two of which the leaf of a locked joint 3 does not end."""
    return poses_of_the_box(count, seed, (0.5, 0.0, 0.35), (0.08, 0.1, 0.1), 20, 45)


@pytest.fixture(scope="module")
def ik(panda: hk.Robot) -> hk.motion.ik.InverseKinematics:
    return hk.ik(hk.holonomic(hk.pose(panda), hk.arm_angle()), PANDA_START, limits=False)


def test_a_batch_answers_each_pose_as_a_single_call_does_and_raises_nothing(ik, panda: hk.Robot) -> None:
    poses = poses_of_the_box(12)
    poses[3, :3, 3] = [3.0, 0.0, 0.0]
    poses[4, 0, 3] = np.nan
    poses[5, :3, :3] *= 1.01
    poses[6, :3, 0] *= -1.0
    found = ik.batch(poses)
    assert len(found) == 12
    assert found.status[[4, 5, 6]].tolist() == [InverseStatus.NOT_FINITE, *2 * [InverseStatus.NOT_A_ROTATION]]
    assert found.status[3] in (InverseStatus.LEAF_ENDS, InverseStatus.SINGULAR, InverseStatus.NOT_CONVERGED)
    assert np.isnan(found.last[[4, 5, 6]]).all()
    assert np.isfinite(found.last[3]).all()
    assert found.count(InverseStatus.REACHED) == found.reached.sum() > 4
    for pose, q, reached in zip(poses, found.q, found.reached, strict=True):
        if reached:
            assert np.array_equal(ik(pose), q)
            assert panda.pose(q) == pytest.approx(pose, abs=1e-12)
        else:
            assert np.isnan(q).all()
            with pytest.raises(HolokinError):
                ik(pose)


def test_a_pose_that_no_posture_reaches_is_told_so(ik) -> None:
    far = poses_of_the_box(1)[0]
    far[:3, 3] = [3.0, 0.0, 0.0]
    with pytest.raises(OutOfReachError):
        ik(far)


def test_a_rotation_that_is_none_is_refused_with_how_far_it_is_from_one(ik) -> None:
    pose = poses_of_the_box(1)[0]
    scaled, mirrored = pose.copy(), pose.copy()
    scaled[:3, :3] *= 1.01
    mirrored[:3, 0] *= -1.0
    with pytest.raises(ArgumentError, match=r"is 0\.02 away from 1"):
        ik(scaled)
    with pytest.raises(ArgumentError, match="left-handed"):
        ik.near(mirrored, PANDA_START)


@pytest.mark.campaign
@pytest.mark.parametrize("native_code", ["1", "0"])
def test_a_transposed_pose_is_refused_wherever_one_comes_in(
    panda: hk.Robot, native_code: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOLOKIN_NATIVE", native_code)
    strategy = hk.holonomic(hk.pose(panda), hk.lock(2))
    ik, step = hk.ik(strategy, PANDA_START), hk.controller(strategy, dt=1e-3, q0=PANDA_START)
    point = hk.controller(hk.moore_penrose(hk.position(panda)), dt=1e-3)
    pose = panda.pose(PANDA_START)
    turned, lost = np.ascontiguousarray(pose.T), pose.copy()
    lost[3, 1] = np.nan
    assert ik.batch([pose, turned, lost]).status.tolist() == [
        InverseStatus.REACHED, InverseStatus.NOT_A_ROTATION, InverseStatus.NOT_FINITE,
    ]  # fmt: skip
    assert ik.nearest(turned, PANDA_START).status is InverseStatus.NOT_A_ROTATION
    for matrix in (turned, pose.T, turned.tolist()):
        for ask in (
            ik,
            ik.nearest,
            lambda wanted: ik.near(wanted, PANDA_START),
            lambda wanted: hk.motion.ik.all_postures(strategy, wanted, starts=4),
            lambda wanted: step.step(PANDA_START, wanted, np.zeros(6)),
            lambda wanted: point.step(PANDA_START, wanted, np.zeros(6)),
            lambda wanted: pose_cloud([wanted]),
        ):
            with pytest.raises(ArgumentError, match="is the matrix transposed"):
                ask(matrix)


def test_a_rotation_of_too_few_digits_is_told_so(ik) -> None:
    with pytest.raises(ArgumentError, match="with all its digits"):
        ik(poses_of_the_box(1)[0].round(3))


def test_from_a_posture_nearby_the_same_joints_are_found_though_it_is_not_on_the_leaf(ik) -> None:
    pose = poses_of_the_box(1)[0]
    q, rng = ik(pose), np.random.default_rng(1)
    for _ in range(10):
        assert ik.near(pose, q + rng.uniform(-0.05, 0.05, 7)) == pytest.approx(q, abs=1e-12)


def test_a_posture_of_another_branch_is_refused_as_a_beginning(planar_3r: hk.Robot) -> None:
    ik = hk.ik(hk.holonomic(hk.position(planar_3r), hk.lock(2)), [0.3, 0.9, 0.7])
    with pytest.raises(BranchError, match="another branch"):
        ik.near([1.5, 0.5], [0.3, -2.2, 0.7])


def test_limits_are_looked_at_unless_told_otherwise(panda: hk.Robot, ik) -> None:
    strict, poses = hk.ik(ik.strategy, ik.q0), poses_of_the_box(20)
    free, held = ik.batch(poses), strict.batch(poses)
    slack = 1e-9
    beyond = ((free.q < panda.lower - slack) | (free.q > panda.upper + slack)).any(axis=1)
    assert 0 < beyond.sum() < free.reached.sum()
    assert np.array_equal(held.status == InverseStatus.LIMIT, beyond)
    assert np.array_equal(held.last[beyond], free.q[beyond])
    assert np.isnan(held.q[beyond]).all()
    with pytest.raises(JointLimitError):
        strict(poses[np.argmax(beyond)])


def test_both_engines_look_at_limits(planar_3r: hk.Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = hk.with_limits(planar_3r, lower=[-0.2, 0.5, -3.0], upper=[0.8, 1.3, 3.0])
    law, q0 = hk.holonomic(hk.position(robot), hk.lock(2)), np.array([0.3, 0.9, 0.7])
    points = robot.pose(q0)[:2, 3] + np.random.default_rng(5).uniform(-1.0, 1.0, (40, 2))
    found = []
    for flag in ("1", "0"):
        monkeypatch.setenv("HOLOKIN_NATIVE", flag)
        free, held = (hk.ik(law, q0, limits=limits).batch(points) for limits in (False, True))
        beyond = (robot.beyond(free.q) > 1e-9).any(axis=1)
        assert 5 < beyond.sum() < free.reached.sum() - 5
        assert np.array_equal(held.status == InverseStatus.LIMIT, beyond)
        found.append(held.status)
    assert np.array_equal(*found)


def test_without_redundancy_inverse_follows_the_branch_of_the_start(irb140: hk.Robot) -> None:
    task, start = hk.pose(irb140), np.deg2rad([10.0, 70.0, 10.0, 20.0, 50.0, 30.0])
    ik = hk.ik(hk.holonomic(task, hk.custom(lambda q: q[:0], rows=0)), start)
    rng = np.random.default_rng(0)
    for q in start + rng.uniform(-0.15, 0.15, (10, 6)):
        assert ik(irb140.pose(q)) == pytest.approx(q, abs=1e-11)


@pytest.mark.campaign
def test_twenty_thousand_poses_have_the_same_joints_in_any_order(panda: hk.Robot) -> None:
    """In random order, sorted, each from the last answer, and after excursions out of reach."""
    ik = hk.ik(hk.holonomic(hk.pose(panda), hk.lock(2)), PANDA_START)
    if "native" not in ik.engine:
        pytest.skip("a minute on the virtual machine")
    poses = inner(20_000)
    sorted_order = np.argsort(poses[:, 0, 3])
    found, again = ik.batch(poses), ik.batch(poses[sorted_order], threads=1)
    assert found.reached.all()
    assert np.array_equal(again.q, found.q[sorted_order])
    away, worst = poses[0].copy(), 0.0
    away[:3, 3] = [1.4, 0.3, 0.2]
    q = ik.q0
    for k, i in enumerate(sorted_order):
        if k % 1000 == 999:
            with pytest.raises(HolokinError):
                ik.near(away, q)
            lost = ik.batch(away[None])
            assert not lost.reached[0]
        q = ik.near(poses[i], q)
        worst = max(worst, float(np.abs(q - found.q[i]).max()))
    assert worst < 1e-12


def test_a_hand_that_goes_round_the_base_keeps_its_turn_and_a_new_one_does_not(planar_3r: hk.Robot) -> None:
    """Where near and cold differ: round the hole that the locked arm cannot reach, by a full turn of the base joint."""
    start = np.array([0.3, 0.9, 0.7])
    ik = hk.ik(hk.holonomic(hk.position(planar_3r), hk.lock(2)), start, limits=False)
    tool, q = planar_3r.pose(start)[:2, 3], start
    for angle in np.linspace(0, 2 * np.pi, 200)[1:]:
        c, s = np.cos(angle), np.sin(angle)
        q = ik.near([c * tool[0] - s * tool[1], s * tool[0] + c * tool[1]], q)
    assert q - start == pytest.approx([2 * np.pi, 0, 0], abs=1e-11)
    assert ik(tool) == pytest.approx(start, abs=1e-12)


def test_threads_do_not_change_the_answers(ik) -> None:
    poses = inner(400, seed=2)
    one, four = ik.batch(poses, threads=1), ik.batch(poses, threads=4)
    assert np.array_equal(one.q, four.q, equal_nan=True)
    assert np.array_equal(one.status, four.status)
    with pytest.raises(ArgumentError):
        ik.batch(poses, threads=0)


def test_threads_that_lead_hands_get_what_each_gets_alone_to_the_last_bit(ik, panda: hk.Robot) -> None:
    """What a call keeps for the next one is its thread's own."""
    ways, angle = np.random.default_rng(3).uniform(-0.12, 0.12, (4, 3)), np.linspace(0, 2 * np.pi, 300)
    hands = np.tile(panda.pose(PANDA_START), (4, 300, 1, 1))
    hands[..., :3, 3] += ways[:, None] * np.stack([np.sin(angle), np.cos(angle) - 1, np.sin(2 * angle)], axis=1)

    def lead(hand: np.ndarray) -> np.ndarray:
        answers = [PANDA_START]
        for pose in hand:
            answers.append(ik.near(pose, answers[-1]))
        return np.array(answers)

    alone = []
    for hand in hands:
        with ThreadPoolExecutor(1) as pool:
            alone.append(pool.submit(lead, hand).result())
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as pool:
            together = list(pool.map(lead, hands))
    finally:
        sys.setswitchinterval(before)
    assert np.array_equal(together, alone)
    assert np.abs(np.array(alone)[:, 1:] - [ik.batch(hand).q for hand in hands]).max() < 1e-12


def test_after_its_engine_is_asked_no_call_builds_anything(
    planar_3r: hk.Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    ik = hk.ik(hk.holonomic(hk.position(planar_3r), hk.lock(2)), [0.3, 0.9, 0.7])
    assert ik.engine
    for module, name in ((kernel, "library"), (kernel, "_module"), (kernel, "bound_call")):
        monkeypatch.setattr(module, name, None)
    assert planar_3r.pose(ik([1.5, 0.5]))[:2, 3] == pytest.approx([1.5, 0.5], abs=1e-12)
    assert ik.near([1.5, 0.5], ik.q0) == pytest.approx(ik([1.5, 0.5]), abs=1e-12)


def test_an_inverse_and_its_solutions_can_be_pickled(planar_3r: hk.Robot) -> None:
    ik = hk.ik(hk.holonomic(hk.position(planar_3r), hk.lock(2)), [0.3, 0.9, 0.7])
    q = ik([1.5, 0.5])
    again = pickle.loads(pickle.dumps(ik))
    assert np.array_equal(again([1.5, 0.5]), q)
    found = pickle.loads(pickle.dumps(ik.batch([[1.5, 0.5], [9.0, 0.0]])))
    assert found.reached.tolist() == [True, False]


def test_without_a_redundant_joint_the_pose_tells_the_joints_of_the_starts_branch(irb140: hk.Robot) -> None:
    task, q = hk.pose(irb140), np.deg2rad([10.0, 40.0, -10.0, 20.0, 50.0, 30.0])
    ik = hk.ik(hk.moore_penrose(task), q)
    there = q + [0.1, -0.1, 0.1, 0.2, -0.1, 0.3]
    assert ik(irb140.pose(there)) == pytest.approx(there, abs=1e-9)
    space = hk.workspace(box=(irb140.pose(q)[:3, 3], [0.02, 0.02, 0.02]))
    for refused in (lambda: hk.radial(hk.moore_penrose(task), q), lambda: hk.design(task, space, q)):
        with pytest.raises(ArgumentError, match=r"hk.ik\(hk.moore_penrose\(task\), start\)"):
            refused()
    with pytest.raises(HolokinError, match=r"to hk\.ik"):
        hk.holonomic(task, hk.lock(0))
    with pytest.raises(ArgumentError, match="give a strategy with leaves"):
        hk.ik(hk.moore_penrose(hk.position(irb140)), q)


@pytest.mark.parametrize("native", ["0", "1"])
def test_no_pose_has_no_joints(native: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOLOKIN_NATIVE", native)
    robot = hk.load("planar-3r")
    ik = hk.ik(hk.holonomic(hk.position(robot), hk.lock(0)), [0.3, 0.7, -0.5])
    assert ik.batch(np.zeros((0, 4, 4))).q.shape == (0, 3)
