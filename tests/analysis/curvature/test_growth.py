"""Many joints: a system solved by numbers is the one written out, and two arms make one robot."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import holokin as hk
from chains import chain, shared_bend
from conftest import PANDA_START, campaign, fails, urdf
from holokin.base.errors import SingularityError
from holokin.motion import follow_path as following
from holokin.motion.control_step import StepStatus
from holokin.motion.ik.leaf import leaf_step
from holokin.symbolic import function as function_module
from holokin.symbolic import linear
from holokin.symbolic.native import LARGEST
from holokin.symbolic.native import toolchain as native

Patch = pytest.MonkeyPatch
compiled = pytest.mark.skipif(native.compiler() is None, reason="no C compiler here")


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Of this file: nothing of an earlier run is loaded, and what two tests use is built once."""
    with Patch.context() as patch:
        patch.setenv("HOLOKIN_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


def panda() -> hk.Strategy:
    return hk.holonomic(hk.pose(hk.load("panda")), hk.arm_angle())


def snake() -> hk.Strategy:
    return hk.holonomic(hk.position(chain(12)), shared_bend(12))


# --- a system for numbers ---


def both_ways(make: Callable[[], hk.Strategy], monkeypatch: Patch) -> list[hk.Strategy]:
    """The same strategy with its solves written out, and left to numbers; their functions are built."""
    out = []
    for dense_from in (99, 0):
        monkeypatch.setattr(linear, "DENSE_FROM", dense_from)
        strategy = make()
        strategy.gain, strategy.rate, leaf_step(strategy)
        out.append(strategy)
    return out


@pytest.mark.parametrize("make", [panda, campaign("make", snake)])
@pytest.mark.parametrize("engine", ["virtual machine", pytest.param("native", marks=compiled)])
def test_a_system_left_to_numbers_is_the_one_written_out(
    make: Callable[[], hk.Strategy], engine: str, monkeypatch: Patch
) -> None:
    """G, its rcond, the leaf's Newton step and the sign of det [J; J_g], on 600 postures."""
    written, numbers = both_ways(make, monkeypatch)
    assert written.gain.program.after is None
    assert numbers.gain.program.after is not None
    monkeypatch.setattr(function_module, "NATIVE_FROM", 1 if engine == "native" else 10**9)
    n = written.task.n
    Q = (PANDA_START if n == 7 else np.full(n, 0.15)) + np.random.default_rng(4).uniform(-0.1, 0.1, (600, n))
    p, R = written.task.robot.pose_batch(Q + 0.01)
    c = np.atleast_2d(written.constraint_value.batch(Q).T).T * 0.9
    gain, rate = (lambda s: s.gain), (lambda s: s.rate)
    for arguments, verb in (((Q,), gain), ((Q, np.ones(written.task.m)), rate), ((Q, p, R, c), leaf_step)):
        ours, theirs = (verb(one).batch(*arguments, threads=1) for one in (numbers, written))
        for a, b in zip(ours, theirs, strict=True):
            assert a.shape == b.shape
            assert np.abs(a - b).max() < 1e-11 * max(1.0, np.abs(b).max()), verb
        one = verb(numbers)(*(value[0] if len(value) == 600 else value for value in arguments))
        for a, b in zip(one, theirs, strict=True):
            assert np.abs(a - b[0]).max() < 1e-11 * max(1.0, np.abs(b[0]).max())
    side = leaf_step(numbers).batch(Q, p, R, c)[3]
    A = np.concatenate([written.task.jacobian_batch(Q)[0], np.array([written.rows(q) for q in Q])], axis=1)
    assert np.array_equal(side, np.sign(np.linalg.det(A)))


@pytest.mark.parametrize("native_from", [pytest.param(1, marks=[compiled, pytest.mark.campaign]), 10**9])
def test_a_long_arm_comes_home(native_from: int, monkeypatch: Patch) -> None:
    monkeypatch.setattr(following, "NATIVE_FROM", native_from)
    monkeypatch.setenv("HOLOKIN_NATIVE", str(int(native_from == 1)))
    strategy, q0 = snake(), np.full(12, 0.2)
    at = strategy.task.robot.pose(q0)[:3, 3]
    walk = hk.follow(strategy, hk.circle(at, at - [0.1, 0.05, 0]), q0, samples=60, cycles=2)
    assert np.abs(walk.drift()).max() < 1e-12
    assert walk.residual.max() < 1e-11
    assert np.ptp(walk.q, axis=0).max() > 0.05


@pytest.mark.parametrize("flag", [pytest.param("1", marks=compiled), "0"])
def test_a_long_arms_step_tells_its_troubles(flag: str, monkeypatch: Patch) -> None:
    """Stretched it is singular; what is not finite is not finite; else the step is the textbook's."""
    monkeypatch.setenv("HOLOKIN_NATIVE", flag)
    strategy, q0 = snake(), np.full(12, 0.2)
    task, robot = strategy.task, strategy.task.robot
    servo = hk.controller(strategy, dt=1e-3, q0=q0, gain=10.0, constraint_gain=20.0)
    q = q0 + np.random.default_rng(4).uniform(-0.05, 0.05, 12)
    goal, dx = robot.pose(q0)[:3, 3].copy(), np.array([0.1, -0.2, 0.0])
    gap = strategy.constraint_value(q) - strategy.constraint_value(q0)
    u = np.concatenate([(dx + 10.0 * (goal - 1e-3 * dx - robot.pose(q)[:3, 3]))[:2], -20.0 * gap])
    expected = np.linalg.solve(np.vstack([task.jacobian(q), strategy.rows(q)]), u)
    assert servo.step(q, goal, dx) == pytest.approx(expected, abs=1e-11)
    assert servo.status is StepStatus.OK
    assert not servo.step(np.zeros(12), goal, dx).any()
    assert servo.status is StepStatus.SINGULAR
    assert not servo.step(np.full(12, np.nan), goal, dx).any()
    assert servo.status is StepStatus.NOT_FINITE
    fails(SingularityError, "", lambda: strategy(np.zeros(12)))


def test_a_system_that_numbers_find_singular_is_not_a_number() -> None:
    from holokin.symbolic.native.emit import solve_numbers

    for A in (np.zeros((3, 3)), np.diag([1.0, 0.0, 2.0]), np.full((3, 3), np.nan), np.ones((3, 3))):
        X, figures = np.zeros((3, 2)), np.ones(2)
        solve_numbers(A, np.ones((3, 2)), X, figures)
        assert not figures[0] > 1e-15
    X, figures = np.zeros((3, 2, 5)), np.zeros((2, 5))
    rng = np.random.default_rng(4)
    A, B = rng.normal(size=(3, 3, 5)), rng.normal(size=(3, 2, 5))
    solve_numbers(A, B, X, figures)
    for i in range(5):
        assert A[..., i] @ X[..., i] == pytest.approx(B[..., i])
        assert figures[1, i] == np.sign(np.linalg.det(A[..., i]))


@pytest.mark.campaign
def test_the_code_of_sixty_joints_stays_short() -> None:
    """Written out it would be 459,000 operations."""
    strategy = hk.holonomic(hk.position(chain(60)), shared_bend(60))
    servo = hk.controller(strategy, dt=1e-3, q0=np.full(60, 0.02), most_error=10.0, limits=False)
    assert servo.generated[0].instructions < 10_000 < LARGEST
    dq = servo.step(np.full(60, 0.021), np.array([0.5, 0.3, 0.0]), np.zeros(3))
    assert servo.status is StepStatus.OK
    assert np.isfinite(dq).all()


# --- two arms ---


def baxter(**more) -> hk.Robot:
    return hk.from_urdf(urdf("baxter.urdf"), base="left_gripper", tip="right_gripper", **more)


def test_from_hand_to_hand_two_arms_are_one_chain_as_pinocchio_has_it() -> None:
    robot = baxter()
    assert robot.n == 14
    model = pin.buildModelFromUrdf(str(urdf("baxter.urdf")))
    data = model.createData()
    left, right = (model.getFrameId(f"{side}_gripper") for side in ("left", "right"))
    place = [model.joints[model.getJointId(name)].idx_q for name in robot.joint_names]
    for q in np.random.default_rng(4).uniform(np.maximum(robot.lower, -3), np.minimum(robot.upper, 3), (5, 14)):
        full = pin.neutral(model)
        full[place] = q
        pin.framesForwardKinematics(model, data, full)
        relative = (data.oMf[left].inverse() * data.oMf[right]).homogeneous
        assert np.abs(robot.pose(q) - relative).max() < 1e-12
        J = robot.jacobian(q)
        for j in range(14):
            step = 1e-6 * np.eye(14)[j]
            slope = (robot.pose(q + step) - robot.pose(q - step)) / 2e-6
            turn = slope[:3, :3] @ relative[:3, :3].T
            assert slope[:3, 3] == pytest.approx(J[:3, j], abs=1e-8)
            assert turn[[2, 0, 1], [1, 2, 0]] == pytest.approx(J[3:, j], abs=1e-8)


def test_another_base_moves_no_mass_and_no_limit() -> None:
    robot, usual = baxter(), hk.from_urdf(urdf("baxter.urdf"), tip=["left_gripper", "right_gripper"])
    assert sum(b.mass for b in robot.bodies) == pytest.approx(sum(b.mass for b in usual.bodies))
    assert sorted(robot.joint_names) == sorted(usual.joint_names)
    for name in robot.joint_names:
        a, b = robot.joint_index(name), usual.joint_index(name)
        assert (robot.lower[a], robot.upper[a]) == (usual.lower[b], usual.upper[b])
    held = baxter(locked={"left_w2": 0.3})
    q = np.random.default_rng(4).uniform(-0.5, 0.5, 14)
    q[robot.joint_index("left_w2")] = 0.3
    rest = [i for i, name in enumerate(robot.joint_names) if name != "left_w2"]
    assert held.pose(q[rest]) == pytest.approx(robot.pose(q), abs=1e-14)


def test_an_arm_seen_from_its_hand_is_the_inverse() -> None:
    path = urdf("panda.urdf")
    arm = hk.from_urdf(path, tip="panda_hand_tcp", locked={"panda_finger_joint1": 0.0})
    back = hk.from_urdf(path, base="panda_hand_tcp", tip="panda_link0")
    assert back.joint_names == arm.joint_names[:7][::-1]
    q = np.random.default_rng(4).uniform(arm.lower, arm.upper)[:7]
    assert back.pose(q[::-1]) @ arm.pose(q) == pytest.approx(np.eye(4), abs=1e-14)


@pytest.mark.campaign
def test_two_hands_carry_a_part_round_a_loop_and_all_fourteen_joints_come_home(monkeypatch: Patch) -> None:
    """The left arm does four tenths of what the right one does, mirrored; one more row holds."""
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")  # native code of so many joints: `test_a_long_arm_comes_home`
    robot = baxter()
    q0 = np.zeros(14)
    for side, sign in (("left", -1), ("right", 1)):
        for joint, value in {"s0": 0.3, "s1": -0.5, "e0": 0.4, "e1": 1.1, "w0": 0.2, "w1": 0.7, "w2": 0.1}.items():
            q0[robot.joint_index(f"{side}_{joint}")] = value * (1 if joint in ("s1", "e1", "w1") else sign)
    rows = np.zeros((8, 14))
    for k, joint in enumerate(("s0", "s1", "e0", "e1", "w0", "w1", "w2")):
        rows[k, robot.joint_index(f"left_{joint}")] = 1.0
        rows[k, robot.joint_index(f"right_{joint}")] = -0.4 if joint in ("s1", "e1", "w1") else 0.4
    rows[7] = np.random.default_rng(4).normal(size=14)
    strategy = hk.holonomic(hk.pose(robot), hk.linear(rows))
    at = robot.pose(q0)[:3, 3]
    walk = hk.follow(strategy, hk.circle(at, at + [0.04, 0.03, 0]), q0, samples=60, cycles=2)
    assert np.abs(walk.drift()).max() < 1e-12
    assert np.ptp(walk.q, axis=0).min() > 1e-3
    assert np.abs(rows @ (walk.q - q0).T).max() < 1e-12


ODD_TREE = """<robot name="odd">
  <link name="root"/><link name="a"/><link name="slide seen from b"/><link name="b"/><link name="c"/><link name="d"/>
  <joint name="turn" type="revolute"><parent link="root"/><child link="a"/><origin xyz="0 0.1 0.3" rpy="0.2 0 1"/>
    <axis xyz="0 1 1"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="slide" type="prismatic"><parent link="a"/><child link="b"/><origin xyz="0.2 0 0" rpy="0 0.4 0"/>
    <axis xyz="1 0 2"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="still" type="fixed"><parent link="b"/><child link="slide seen from b"/><origin xyz="0 0 0.1"/></joint>
  <joint name="copy" type="revolute"><parent link="slide seen from b"/><child link="c"/><origin xyz="0.3 0 0"/>
    <axis xyz="0 0 1"/><mimic joint="turn" multiplier="-0.5" offset="0.2"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="other" type="continuous"><parent link="a"/><child link="d"/><origin xyz="0 0.4 0" rpy="1 0 0"/>
    <axis xyz="1 0 0"/></joint>
</robot>"""


def test_sliders_and_mimics_turn_round_with_the_tree(tmp_path: Path) -> None:
    """Seen from c: a mimic, a fixed joint and a slider on the way up, another branch on the way down."""
    file = tmp_path / "odd.urdf"
    file.write_text(ODD_TREE)
    usual = hk.from_urdf(file, tip=["c", "d"])
    turned = hk.from_urdf(file, base="c", tip=["root", "d"])
    assert set(turned.joint_names) == set(usual.joint_names) == {"turn", "slide", "other"}
    for values in np.random.default_rng(4).uniform(-1, 1, (5, 3)):
        q = dict(zip(usual.joint_names, values, strict=True))
        there, here = (np.array([q[name] for name in robot.joint_names]) for robot in (usual, turned))
        c, d = usual.pose(there, "c"), usual.pose(there, "d")
        assert turned.pose(here, "root") @ c == pytest.approx(np.eye(4), abs=1e-14)
        assert c @ turned.pose(here, "d") == pytest.approx(d, abs=1e-14)


def test_a_base_at_the_end_of_the_tree_asks_for_a_tip() -> None:
    from holokin.base.errors import RobotFileError

    fails(RobotFileError, "give tip=", lambda: hk.from_urdf(urdf("panda.urdf"), base="panda_hand_tcp"))


@pytest.mark.parametrize("native_from", [pytest.param(1, marks=[compiled, pytest.mark.campaign]), 10**9])
def test_a_constraint_written_in_tiny_units_follows_as_well(native_from: int, monkeypatch: Patch) -> None:
    """det [J; J_g] of 16 joints would be 1e-84; the sign is all that is needed."""
    monkeypatch.setattr(following, "NATIVE_FROM", native_from)
    monkeypatch.setenv("HOLOKIN_NATIVE", str(int(native_from == 1)))
    bends = 1e-6 * np.diff(np.eye(16), 2, axis=0)
    strategy, q0 = hk.holonomic(hk.position(chain(16)), hk.linear(bends)), np.full(16, 0.15)
    at = strategy.task.robot.pose(q0)[:3, 3]
    walk = hk.follow(strategy, hk.circle(at, at - [0.05, 0.02, 0]), q0, samples=40)
    assert np.abs(walk.drift()).max() < 1e-9
