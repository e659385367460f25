"""`hk.ik`: the same pose, the same joints; alone, from nearby, and many at once."""

from __future__ import annotations

import pickle
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import PANDA_START, campaign, sampled
from holokin.base.errors import ArgumentError, BranchError, HolokinError, JointLimitError, OutOfReachError
from holokin.motion.ik import InverseStatus
from holokin.path.workspaces import pose_cloud
from holokin.symbolic import wrapped
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
    assert np.isnan(found.last[3:7]).all()  # no posture of the arm has the first of these: no path is gone
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
            lambda wanted: hk.motion.ik.all_postures(strategy, wanted),
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


# --- All postures at a pose on a leaf: each is there, within the limits, and the one that was asked with is among them.


TASKS = {
    "yumi-arm": hk.pose,
    "panda": hk.pose,
    "iiwa14": hk.pose,
    "planar-3r": hk.position,
    "ppr": hk.position,
}


def laws(name: str, rng: np.random.Generator) -> list[hk.Strategy]:
    """A strategy for each kind of dependence on whole turns: none, on one joint, on sums, on half turns, on all."""
    task = TASKS[name](hk.load(name))
    n, j = task.n, int(rng.integers(task.n))
    whole, half = rng.integers(-2, 3, n).astype(float), rng.normal(size=n)
    whole[j], a, b = 1.0, *rng.choice(n, 2, replace=False)
    made = [
        hk.holonomic(task, g)
        for g in (
            hk.lock(j),
            hk.linear(whole),
            hk.linear(half),
            hk.custom(lambda q: 0.5 * q[int(a)] + 0.3 * q[int(b)] ** 2, name="half turns"),
            hk.custom(lambda q: q[int(a)] + q[int(b)], angular=True, name="an angle"),
        )
    ]
    return [*made, hk.holonomic(task, hk.arm_angle())] if n == 7 else made


@sampled(2, "name", TASKS)
@pytest.mark.parametrize("seed", range(1))
def test_every_posture_that_is_found_is_on_the_leaf_and_at_the_pose_and_q_is_among_them(name: str, seed: int) -> None:
    rng = np.random.default_rng([seed, len(name)])
    made = laws(name, rng)
    for law in rng.permutation(np.array(made, dtype=object))[: 2 if made[0].task.n == 7 else None]:
        task, robot = law.task, law.task.robot
        low, high = np.maximum(robot.lower, -6.0), np.minimum(robot.upper, 6.0)
        q = rng.uniform(low, high)
        try:
            if np.linalg.cond(np.vstack([task.jacobian(q), law.rows(q)])) > 1e3:
                continue
            c = law.g(q)
        except HolokinError:
            continue
        for limits, near in ((False, None), (True, None), (True, q), (False, q)):
            found = hk.motion.ik.all_postures(law, robot.pose(q), c, limits=limits, near=near)
            for i, one in enumerate(found.q):
                assert np.abs(law.constraint.nearest(law.g(one) - c)).max() < 1e-8 * (1 + np.abs(c).max()), law.name
                assert np.abs(task.error(one, *task._place(q))).max() < 1e-8
                others = np.where(robot.hinges, wrapped(found.q[:i] - one), found.q[:i] - one)
                assert not len(others) or np.abs(others).max(axis=1).min() > 1e-6
                if limits:
                    robot.check_limits(one)
            away = found.q - q
            if near is None:  # it is there, perhaps at other turns, which then keep pose and level, too
                away = np.where(robot.hinges, wrapped(away), away)
            assert np.abs(away).max(axis=1).min(initial=np.inf) < 1e-6, (law.name, limits, near)


@pytest.mark.campaign
def test_a_locked_joint_of_more_than_a_turn_stays_where_it_is_locked() -> None:
    """Whole turns that looked for limits alone had it at 2.8803 - 2 pi = -3.4029."""
    robot = hk.load("yumi-arm")
    law = hk.holonomic(hk.pose(robot), hk.lock(4))
    for level in (2.8803, -3.4, 4.5, -5.0):
        q = np.array([0.3, -0.8, 0.4, 0.2, level, 0.5, 1.0])
        found = hk.motion.ik.all_postures(law, robot.pose(q), level, limits=True)
        assert found.q[:, 4] == pytest.approx(np.full(len(found), level), abs=1e-9)
        assert np.abs(found.q - q).max(axis=1).min() < 1e-9


def test_of_several_turns_the_nearest_to_a_posture_is_given() -> None:
    """The hinges of a UR10e have two turns each: of each answer one is given."""
    robot = hk.load("ur10e")
    law = hk.holonomic(hk.pose(robot), hk.custom(lambda q: q[0:0], rows=0))
    for seed in range(3):
        q = np.random.default_rng(seed).uniform(-6.2, 6.2, 6)
        q[2] = wrapped(q[2])
        found = hk.motion.ik.all_postures(law, robot.pose(q), np.zeros(0), limits=True, near=q)
        assert np.abs(found.q - q).max(axis=1).min() < 1e-8
        assert len(found) <= 8


@pytest.mark.parametrize("name", ["irb140", campaign("name", "ur10e")])
def test_an_arm_without_redundancy_needs_no_constraint(name: str) -> None:
    """Referees: the robot's own posture, and of a spherical wrist that each posture has one with its wrist flipped."""
    robot, rng = hk.load(name), np.random.default_rng(len(name))
    law, count = hk.moore_penrose(hk.pose(robot)), []
    for _ in range(4):
        q = rng.uniform(np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi))
        pose = robot.pose(q)
        found = hk.motion.ik.all_postures(law, pose, limits=False)
        within = hk.motion.ik.all_postures(law, pose, near=q)
        assert np.abs(wrapped(found.q - q)).max(axis=1).min() < 1e-8 and np.abs(within.q - q).max(axis=1).min() < 1e-8
        assert robot.within(within.q).all() and "leaf" not in found.sentence
        assert max(np.abs(robot.pose(one) - pose).max() for one in found.q) < 1e-8
        flipped = found.q + np.array([0, 0, 0, np.pi, 0, np.pi])
        flipped[:, 4] *= -1
        if name == "irb140":
            assert all(np.abs(wrapped(found.q - one)).max(axis=1).min() < 1e-7 for one in flipped)
        count.append(len(found))
    assert set(count) <= {2, 4, 6, 8} and 8 in count


def test_a_redundant_arm_needs_one(panda: hk.Robot) -> None:
    with pytest.raises(ArgumentError, match="holonomic"):
        hk.motion.ik.all_postures(hk.moore_penrose(hk.pose(panda)), np.eye(4))


# --- Where the joints are one function of the tool pose, and where a loop of the tool does not bring them back.


README_START = [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]
ROW = np.array([1.0, 0, -1, 0, 0, 0, 0])

PAIRS = {
    "5 cm": (
        [-2.170729372113713, 1.3690924229288275, -2.070729372113713, -1.7642936736380397, -1.506071491481258,
         3.6717294994354273, -0.1929596234190993],
        [-1.9377003726986681, 1.025413296762297, -1.8377003726986685, -2.0607874349768878, -0.6818148684113225,
         3.3351065585361486, -1.3422306109761204],
    ),
    "3.9 m": (
        [-1.558268562285103, -1.1682078529947475, -1.4582685622851028, -2.323141074543961, -0.8624925442550151,
         3.2472048753800347, 0.7380968269504715],
        [1.6633424466932525, 1.5723723225194792, 1.7633424466932524, -2.215624273335204, -1.5755183841874365,
         2.8916033886797665, 1.188637486944424],
    ),
}  # fmt: skip
"""Pairs of postures of the README's leaf with one tool pose."""


@pytest.mark.parametrize("size, apart", [("5 cm", 1.149), ("3.9 m", 3.222)])
def test_a_closed_loop_of_the_tool_on_the_readmes_leaf_that_does_not_bring_the_joints_back(
    size: str, apart: float
) -> None:
    """The rule is linear, so the straight line of joints between two postures of the leaf stays on it."""
    panda = hk.load("panda")
    a, b = np.array(PAIRS[size])
    level = README_START[0] - README_START[2]
    joints = a + np.linspace(0.0, 1.0, 400)[:, None] * (b - a)
    np.testing.assert_allclose(joints @ ROW, level, atol=1e-12)
    assert ((panda.lower <= joints) & (joints <= panda.upper)).all()
    extended = np.array([np.vstack([panda.jacobian(q), ROW]) for q in joints])
    determinants = np.linalg.det(extended)
    assert determinants.min() > 1e-4 or determinants.max() < -1e-4  # regular all along
    assert np.abs(panda.pose(a) - panda.pose(b)).max() < 1e-11  # the loop of the tool is closed
    assert np.abs(b - a).max() == pytest.approx(apart, abs=1e-3)  # and the joints end elsewhere


@pytest.mark.parametrize("size", PAIRS)
def test_pinocchio_finds_one_tool_pose_for_both_postures(size: str) -> None:
    pin = pytest.importorskip("pinocchio")
    model = pin.buildModelFromXML(hk.robot.to_urdf(hk.load("panda")))
    data = model.createData()
    poses = []
    for q in PAIRS[size]:
        pin.forwardKinematics(model, data, np.array(q))
        poses.append(data.oMi[model.njoints - 1].homogeneous.copy())
    assert np.abs(poses[0] - poses[1]).max() < 1e-9


def test_two_poses_a_millimetre_apart_may_have_joints_far_apart_though_no_joint_turned_fully() -> None:
    """Between them lies the shadow of a place where the leaf ends: straight paths pass it on either side."""
    panda = hk.load("panda")
    ik = hk.ik(hk.holonomic(hk.pose(panda), hk.lock(2)), README_START)
    R = np.array([
        [-0.3830620429654401, 0.6789896766821064, 0.6262878652810316],
        [0.8594212394548654, 0.013433424176621278, 0.5110916515545464],
        [0.33861276469295454, 0.7340249056224314, -0.5886839844203121],
    ])  # fmt: skip
    points = [
        [0.6507113208620439, 0.4241735654065602, 0.2478166537758964],
        [0.650237079103221, 0.42359340544686175, 0.24778488625551276],
    ]
    answers = []
    for point in points:
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = R, point
        answers.append(ik(pose))
        assert np.abs(panda.pose(answers[-1]) - pose).max() < 1e-8
    assert np.linalg.norm(np.subtract(points[0], points[1])) < 1e-3
    assert all(((panda.lower <= q) & (q <= panda.upper)).all() for q in answers)
    difference = answers[1] - answers[0]
    assert np.abs(difference).max() > 3.0
    assert np.abs(difference - 2 * np.pi * np.round(difference / (2 * np.pi))).max() > 1.0  # not by full turns


def test_an_inverse_keeps_its_cusps_and_says_whether_it_has_a_region() -> None:
    strategy, q0 = hk.holonomic(hk.position(hk.load("planar-3r")), hk.linear([[0.3, 0, 1]])), [0.3, 0.9, 0.7]
    ik = hk.ik(strategy, q0)
    found, other = hk.cusps(ik, starts=50), hk.cusps(strategy, q0, starts=50)
    assert found is hk.cusps(ik, starts=50) and np.array_equal(found.q, other.q) and found.sentence == other.sentence
    assert hk.cusps(ik, starts=60).starts == 60 and hk.cusps(ik, starts=50) is found
    assert "no region was asked for" in str(ik) and "hk.unique_region" in str(ik)
    region = hk.unique_region(strategy, q0, hk.workspace(box=([1.0, 2.17], [0.1, 0.1])), limits=False, budget=500)
    assert str(region) in str(hk.ik(strategy, q0, region=region))
    with pytest.raises(ArgumentError, match="leave it out"):
        hk.cusps(ik, q0)
    with pytest.raises(ArgumentError, match="give the posture"):
        hk.cusps(strategy)
