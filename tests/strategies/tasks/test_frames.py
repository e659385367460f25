"""Tasks of an axis free to spin, of one tool in another's frame, of a line of sight, of an expression of one's own."""

from __future__ import annotations

import shutil
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import IRB_START, PANDA_START
from holokin.robot import Joint, Robot, Tip
from holokin.strategies.tasks.frame_task import FrameTask


@pytest.fixture(scope="module")
def both_hands() -> Robot:
    """Two Pandas on one base, 0.6 m apart, turned towards each other."""
    arm = hk.load("panda")
    sides = (np.eye(4), np.eye(4))
    sides[0][1, 3], sides[1][1, 3] = 0.3, -0.3
    sides[1][:2, :2] = [[0.8, -0.6], [0.6, 0.8]]
    joints, coordinates, tips = [], [], []
    for name, side in zip(("left", "right"), sides, strict=True):
        first = len(joints)
        for joint in arm.joints:
            parent = joint.parent + first if joint.parent >= 0 else -1
            placement = side @ joint.placement if parent < 0 else joint.placement
            joints.append(
                Joint(f"{name}_{joint.name}", joint.kind, parent, placement, joint.axis, joint.coordinate + first)
            )
        coordinates += [type(c)(f"{name}_{c.name}", c.kind, c.lower, c.upper, c.max_velocity) for c in arm.coordinates]
        tips.append(Tip(name, arm.tips[0].joint + first, arm.tips[0].placement))
    return Robot("two pandas", tuple(coordinates), tuple(joints), tuple(tips))


def slope_of(task: hk.Task, q: np.ndarray, h: float = 1e-6) -> np.ndarray:
    return np.array([(task(q + h * e) - task(q - h * e)) / (2 * h) for e in np.eye(len(q))]).T


def torch(tilt_deg: float = 35.0) -> Robot:
    """An IRB 140 with a torch that is bent by an angle against its last axis, as welding torches are."""
    arm = hk.load("irb140")
    bend = np.eye(4)
    bend[:3, :3] = Rotation.from_euler("y", tilt_deg, degrees=True).as_matrix()
    bend[:3, 3] = [0.08, 0.0, 0.25]
    tip = arm.tips[0]
    return Robot("torch", arm.coordinates, arm.joints, (Tip("wire", tip.joint, tip.placement @ bend),))


@pytest.mark.parametrize("axis", ["x", "y", "z", (0.6, 0.0, 0.8)])
def test_the_axis_coordinates_are_the_turn_that_takes_the_reference_direction_to_that_of_the_tool(axis: object) -> None:
    """SciPy's rotation vectors are the referee: a turn about a line across the reference direction."""
    robot = torch()
    task = hk.pose(robot, "axis", axis=axis)
    a = np.asarray(task.axis)
    for q in IRB_START + np.random.default_rng(1).uniform(-0.8, 0.8, (20, 6)):
        direction, down = robot.pose(q)[:3, :3] @ a, np.array([0.0, 0.0, -1.0])
        assert np.abs(task.reference @ a - down).max() < 1e-12
        ax, ay = task(q)[3:]
        turn = Rotation.align_vectors([direction], [down])[0].magnitude()
        assert np.hypot(ax, ay) == pytest.approx(turn, abs=1e-9)
        assert np.linalg.norm(np.cross(down, direction)) == pytest.approx(np.sin(np.hypot(ax, ay)), abs=1e-9)
        assert np.abs(task.jacobian(q) - slope_of(task, q)).max() < 1e-7


def test_straight_down_is_as_good_as_any_direction_and_straight_up_is_refused() -> None:
    robot = torch(0.0)
    task, down = hk.pose(robot, "axis"), np.deg2rad([0, 40, -10, 0, -30, 0])
    assert np.abs(robot.pose(down)[:3, 2] - [0, 0, -1]).max() < 1e-12
    assert np.abs(task(down)[3:]).max() < 1e-12
    assert np.abs(task.jacobian(down) - slope_of(task, down)).max() < 1e-7
    with pytest.raises(hk.HolokinError, match="representation"):
        hk.pose(robot, "axis", reference=np.eye(3)).jacobian(down)


def test_a_spin_of_the_tool_about_its_axis_is_a_self_motion() -> None:
    robot = torch()
    task = hk.pose(robot, "axis")
    J = robot.jacobian(IRB_START)
    spin = np.linalg.solve(J, np.append(np.zeros(3), robot.pose(IRB_START)[:3, 2]))
    assert np.abs(task.jacobian(IRB_START) @ spin).max() < 1e-12
    assert np.abs(spin).max() > 0.5


def test_a_welder_by_the_pseudo_inverse_drifts_and_one_on_a_leaf_returns() -> None:
    robot = torch()
    task = hk.pose(robot, "axis")
    p = robot.pose(IRB_START)[:3, 3]
    seam = hk.circle(p, p - [0.06, 0.0, 0.0])
    drift = hk.drift(hk.moore_penrose(task), seam, IRB_START, cycles=2)
    assert drift.largest[0] > 1e-3
    for law in (hk.holonomic(task, hk.lock(3)), hk.holonomic(task, hk.lock(5))):
        found = hk.follow(law, seam, IRB_START, samples=200, cycles=2)
        assert found.status is hk.motion.Status.COMPLETE
        assert np.abs(found.drift()).max() < 1e-12
        wanted, got = robot.pose(IRB_START)[:3, 2], robot.pose(found.q[70])[:3, 2]
        assert np.abs(wanted - got).max() < 1e-12


def test_inverse_kinematics_of_an_axis_is_that_of_following(panda: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")  # for two poses
    task = hk.pose(panda, "axis")
    law = hk.holonomic(task, hk.lock(2, 6))
    ik, pose = hk.ik(law, PANDA_START), panda.pose(PANDA_START)
    pose[:3, 3] += [0.1, -0.15, 0.05]
    pose[:3, :3] = Rotation.from_rotvec([0.3, -0.2, 0.0]).as_matrix() @ pose[:3, :3]
    q = ik(pose)
    assert np.abs(panda.pose(q)[:3, 3] - pose[:3, 3]).max() < 1e-9
    assert np.abs(panda.pose(q)[:3, 2] - pose[:3, 2]).max() < 1e-9
    assert np.abs(q[[2, 6]] - PANDA_START[[2, 6]]).max() < 1e-12
    spun = pose.copy()
    spun[:3, :3] = pose[:3, :3] @ Rotation.from_rotvec([0, 0, 0.4]).as_matrix()
    assert np.abs(ik(spun) - q).max() < 1e-9  # the spin asked for is not the task's


def test_one_tool_in_the_frame_of_another_moves_as_their_poses_say(both_hands: Robot) -> None:
    task = hk.strategies.tasks.relative_pose(both_hands, "left", "right")
    rng = np.random.default_rng(2)
    for q in np.tile(PANDA_START, 2) + rng.uniform(-0.5, 0.5, (5, 14)):
        left, right = both_hands.pose(q, "left"), both_hands.pose(q, "right")
        assert np.abs(task.pose(q) - np.linalg.solve(right, left)).max() < 1e-12
        dq, h = rng.uniform(-1, 1, 14), 1e-6
        after, before = task.pose(q + h * dq), task.pose(q - h * dq)
        v = (after[:3, 3] - before[:3, 3]) / (2 * h)
        w = Rotation.from_matrix(after[:3, :3] @ before[:3, :3].T).as_rotvec() / (2 * h)
        assert np.abs(task.jacobian(q) @ dq - np.append(v, w)).max() < 1e-7


@pytest.mark.campaign
def test_two_arms_repeat_what_one_does_on_the_other(both_hands: Robot) -> None:
    """r = 8: the right arm and the left one's third joint are held by rules."""
    task = hk.strategies.tasks.relative_pose(both_hands, "left", "right")
    q0 = np.tile(PANDA_START, 2)
    p = task.pose(q0)[:3, 3]
    loop = hk.circle(p, p + [0.0, 0.06, 0.0])
    assert hk.drift(hk.moore_penrose(task), loop, q0).largest[0] > 1e-3
    apart = np.delete(np.eye(7), 2, axis=0)
    rules = hk.strategies.constraints.stack(hk.lock(2, 9), hk.linear(np.hstack([apart, apart])))
    found = hk.follow(hk.holonomic(task, rules), loop, q0, samples=100)
    assert found.status is hk.motion.Status.COMPLETE
    assert np.abs(found.drift()).max() < 1e-12
    assert np.ptp(found.q[:, 7:]) > 0.01


@pytest.mark.campaign
def test_a_camera_looks_at_a_point_where_its_line_of_sight_is_zero(panda: Robot) -> None:
    point = np.array([0.7, 0.2, 0.1])
    task = hk.strategies.tasks.line_of_sight(panda, point)
    assert task.m == 2
    assert task.units == ("rad", "rad")
    rates = np.random.default_rng(3).uniform(-1, 1, (3, 7))
    for q in PANDA_START + 0.4 * rates:
        T = panda.pose(q)
        seen = T[:3, :3].T @ (point - T[:3, 3])
        angle = np.arctan2(np.hypot(seen[0], seen[1]), seen[2])
        assert np.linalg.norm(task(q)) == pytest.approx(angle, abs=1e-12)
        assert np.abs(task.jacobian(q) - slope_of(task, q)).max() < 1e-7
    x = task(PANDA_START)
    law = hk.holonomic(task, hk.lock(0, 1, 2, 3, 6))
    found = hk.follow(law, hk.line(np.append(x, 0), np.zeros(3)), PANDA_START, samples=100)
    T = panda.pose(found.q[-1])
    assert np.linalg.norm(np.cross(T[:3, 2], point - T[:3, 3])) < 1e-9


def test_an_expression_of_ones_own_is_a_task(panda: Robot) -> None:
    """The tool's distance from the base axis and its height: m = 2, J = df/dq, and a leaf that is returned to."""

    def cylinder(q: ca.SX) -> ca.SX:
        p = panda.kinematics(q).position
        return ca.vertcat(ca.sqrt(p[0] ** 2 + p[1] ** 2), p[2])

    task = hk.custom_task(panda, cylinder, units=("m", "m"), names=("radius", "height"), name="cylinder")
    p = panda.pose(PANDA_START)[:3, 3]
    assert task(PANDA_START) == pytest.approx([np.hypot(p[0], p[1]), p[2]], abs=1e-12)
    assert task.row_names == ("radius", "height")
    assert np.abs(task.jacobian(PANDA_START) - slope_of(task, PANDA_START)).max() < 1e-7
    x = np.append(task(PANDA_START), 0)
    law = hk.holonomic(task, hk.lock(0, 2, 4, 5, 6))
    found = hk.follow(law, hk.circle(x, x + [0.05, 0, 0]), PANDA_START, samples=100)
    assert np.abs(found.drift()).max() < 1e-12
    assert np.abs(found.error).max() < 1e-9
    assert hk.drift(hk.moore_penrose(task), hk.circle(x, x + [0.05, 0, 0]), PANDA_START).largest[0] > 1e-3


def test_bad_frames_are_refused_with_their_cure(panda: Robot, both_hands: Robot) -> None:
    with pytest.raises(hk.HolokinError, match="axis of the tool"):
        hk.pose(panda, "axis", axis="w")
    with pytest.raises(hk.HolokinError, match="must not vanish"):
        hk.pose(panda, "axis", axis=(0, 0, 0))
    with pytest.raises(hk.HolokinError, match="relative to"):
        hk.strategies.tasks.relative_pose(both_hands, "left", "left")
    with pytest.raises(hk.HolokinError, match="a unit of each row"):
        hk.custom_task(panda, lambda q: q[:4], units=())
    with pytest.raises(hk.HolokinError, match="8"):
        hk.custom_task(panda, lambda q: ca.vertcat(q, q[0]), units=("rad",) * 8)
    with pytest.raises(hk.HolokinError, match="units="):
        hk.custom_task(panda, lambda q: q[:2], units=("rad",))
    with pytest.raises(hk.HolokinError, match="rows of a task"):
        FrameTask(panda, "axis", (0, 5), np.eye(3))


@pytest.mark.campaign
@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler here")
@pytest.mark.parametrize("kind", ["axis", "relative"])
def test_exported_c_does_what_python_does(kind: str, both_hands: Robot, tmp_path: Path) -> None:
    """The self-test of an export compares every function with vectors from Python, within its tolerances."""
    if kind == "axis":
        law, start = hk.holonomic(hk.pose(torch(), "axis"), hk.lock(3)), IRB_START
    else:
        task = hk.strategies.tasks.relative_pose(both_hands, "left", "right")
        law, start = hk.holonomic(task, hk.lock(*range(7, 14), 2)), np.tile(PANDA_START, 2)
    written = hk.export.export_c(law, tmp_path, q0=start, name="law", vectors_count=8)
    assert all(line.endswith("passed") for line in hk.export.check(written))
