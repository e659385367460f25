"""Shoulder, elbow and wrist are found by how the axes meet, or asked for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, urdf
from holokin.base.errors import NoArmError, UnknownNameError
from holokin.strategies.constraints import Constraint
from holokin.symbolic import Function, symbol


def angle(robot: hk.Robot, constraint: Constraint) -> Function:
    """q -> the arm angle (1,), whatever the redundancy."""
    q = symbol("q", robot.n)
    g = constraint.expand(hk.position(robot), robot.kinematics(q), q)
    return Function("angle", {"q": q}, {"g": g})


def postures(robot: hk.Robot, count: int = 5) -> np.ndarray:
    low, high = np.maximum(robot.lower, -1.5), np.minimum(robot.upper, 1.5)
    return np.random.default_rng(3).uniform(low, high, (count, robot.n))


@pytest.mark.parametrize("name", ["panda", "iiwa14"])
def test_the_arm_of_seven_joints_is_its_second_fourth_and_sixth(name: str) -> None:
    robot = hk.load(name)
    found = angle(robot, hk.arm_angle())
    by_index = angle(robot, hk.arm_angle(joints=(1, 3, 5)))
    by_name = angle(robot, hk.arm_angle(joints=tuple(robot.joint_names[i] for i in (1, 3, 5))))
    for q in postures(robot):
        assert found(q) == by_index(q) == by_name(q)


def test_where_along_its_axes_a_file_puts_the_frames_does_not_matter(panda: hk.Robot) -> None:
    """The same arm, its frames slid along their axes: the same angle, though the origins are elsewhere."""
    joints, slid = [], np.eye(4)
    for i, joint in enumerate(panda.joints):
        shift, back = np.eye(4), np.eye(4)
        shift[:3, 3] = (0.05 + 0.02 * i) * joint.axis
        back[:3, 3] = -shift[:3, 3]
        joints.append(replace(joint, placement=slid @ joint.placement @ shift))
        slid = back
    tips = tuple(replace(tip, placement=slid @ tip.placement) for tip in panda.tips)
    other = replace(panda, joints=tuple(joints), tips=tips)
    f, g = angle(panda, hk.arm_angle()), angle(other, hk.arm_angle())
    apart = angle(other, hk.arm_angle(joints=(1, 3, 5)))
    for q in postures(panda):
        assert other.pose(q) == pytest.approx(panda.pose(q), abs=1e-12)
        assert g(q) == pytest.approx(f(q), abs=1e-9)
        assert abs(apart(q) - f(q)) > 1e-3


@pytest.mark.parametrize("file", ["simple_humanoid.urdf", "icub.urdf", "human.urdf"])
def test_a_humanoids_shoulder_is_the_arms_and_not_the_waists(file: str) -> None:
    """The shoulder's own joints do not move it, the waist's do; the arm angle does not feel the wrist's joints."""
    tip = {"simple_humanoid.urdf": "l_wrist", "icub.urdf": "l_gripper", "human.urdf": "left_hand"}[file]
    robot = hk.from_urdf(urdf(file), tip=tip)
    shoulder = next(i for i, name in enumerate(robot.joint_names) if "shoulder" in name.lower())
    f = angle(robot, hk.arm_angle())
    named = angle(robot, hk.arm_angle(joints=(shoulder + 1, shoulder + 3, shoulder + 5)))
    waist = angle(robot, hk.arm_angle(joints=(1, 3, 5)))  # the second, fourth and sixth joint of the tree
    for q in postures(robot):
        assert f(q) == pytest.approx(named(q), abs=1e-9)
        assert abs(f(q) - waist(q)) > 1e-2
        for i in range(shoulder + 6, robot.n):
            assert f(q + 0.3 * np.eye(robot.n)[i]) == pytest.approx(f(q), abs=1e-9)


def test_a_shoulder_whose_axes_do_not_meet_is_asked_for_by_name() -> None:
    """A G1's shoulder axes pass each other by millimetres: behind a waist no silent choice, all joints are listed."""
    robot = hk.from_urdf(urdf("g1_29dof_rev_1_0.urdf"), tip="left_rubber_hand")
    with pytest.raises(NoArmError, match=r"joints=\(shoulder, elbow, wrist\)") as caught:
        angle(robot, hk.arm_angle())
    assert caught.value.chain == robot.joint_names
    for name in robot.joint_names:
        assert name in str(caught.value)
    locked = {f"waist_{axis}_joint": 0.0 for axis in ("yaw", "roll", "pitch")}
    arm = hk.from_urdf(urdf("g1_29dof_rev_1_0.urdf"), tip="left_rubber_hand", locked=locked)
    named = hk.arm_angle(joints=("left_shoulder_roll_joint", "left_elbow_joint", "left_wrist_pitch_joint"))
    q = np.array([0.2, 0.4, 0.3, 0.9, 0.2, 0.3, 0.4])
    for constraint in (named, hk.arm_angle()):  # seven hinges alone have points by the rule for those
        G = hk.holonomic(hk.pose(arm), constraint)
        assert hk.pose(arm).jacobian(q) @ G(q) == pytest.approx(np.eye(6), abs=1e-9)


OFFSETS = {  # (axes, steps from each joint to the next) at q = 0, [m], and where shoulder, elbow and wrist are then
    "Sawyer": (
        "z y x y x y x",
        [(0, 0, 0.317), (0.081, 0.1925, 0), (0, 0, 0), (0.4, -0.1685, 0), (0, 0, 0), (0.4, 0.1363, 0), (0, 0, 0)],
        [(0, 0, 0.317), (0.481, 0.024, 0.317), (0.881, 0.1603, 0.317)],
    ),
    "SIA50D": (  # the shoulder's second axis passes the first, the third passes the second
        "z -y z -y z -y z",
        [(0, 0, 0.54), (0.145, 0, 0), (0, 0, 0.875), (0, 0, 0), (0, 0, 0), (0, 0, 0.61), (0, 0, 0)],
        [(0, 0, 0.54), (0.145, 0, 1.415), (0.145, 0, 2.025)],
    ),
    "two pairs and a spherical wrist": (  # the third axis 12 mm beside the first, as on a Gen3
        "z y z y z y z",
        [(0, 0, 0.28), (0, 0, 0), (0, 0.012, 0.42), (0, 0, 0), (0, -0.012, 0.31), (0, 0, 0), (0, 0, 0)],
        [(0, 0, 0.28), (0, 0.012, 0.70), (0, 0, 1.01)],
    ),
}


@pytest.mark.parametrize("name", OFFSETS)
def test_an_arm_of_seven_hinges_whose_axes_pass_each_other_has_the_points_of_elias_and_wen(
    name: str, tmp_path: Path
) -> None:
    axes, steps, known = OFFSETS[name]
    directions = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1", "-y": "0 -1 0"}
    links = "".join(f'<link name="l{i}"/>' for i in range(8))
    joints = "".join(
        f'<joint name="j{i + 1}" type="continuous"><parent link="l{i}"/><child link="l{i + 1}"/>'
        f'<origin xyz="{" ".join(map(str, step))}"/><axis xyz="{directions[axis]}"/></joint>'
        for i, (axis, step) in enumerate(zip(axes.split(), steps, strict=True))
    )
    file = tmp_path / "arm.urdf"
    file.write_text(f'<robot name="arm">{links}{joints}</robot>')
    robot = hk.load(file)
    arm = hk.strategies.constraints.find_arm(hk.pose(robot))
    assert arm.places(hk.pose(robot))(np.zeros(7)) == pytest.approx(np.array(known), abs=1e-9)
    G = hk.holonomic(hk.pose(robot), hk.arm_angle())
    q = np.array([0.2, -0.5, 0.3, 0.9, 0.4, -0.8, 0.1])
    assert hk.pose(robot).jacobian(q) @ G(q) == pytest.approx(np.eye(6), abs=1e-9)


def test_a_gripper_behind_six_hinges_makes_no_arm_of_seven() -> None:
    """Three of a Z1's axes are parallel: no elbow between them."""
    with pytest.raises(NoArmError):
        hk.strategies.constraints.find_arm(hk.pose(hk.load(urdf("z1.urdf"))))


def test_joints_go_by_name_or_by_index_from_0(panda: hk.Robot) -> None:
    task = hk.pose(panda)
    pairs = [
        (hk.lock(2), hk.lock("panda_joint3")),
        (hk.lock(-1), hk.lock("panda_joint7")),
        (hk.strategies.constraints.height(3), hk.strategies.constraints.height("panda_joint4")),
    ]
    for by_index, by_name in pairs:
        a, b = hk.holonomic(task, by_index), hk.holonomic(task, by_name)
        assert np.array_equal(a(PANDA_START), b(PANDA_START))
    for wrong in (hk.lock(7), hk.strategies.constraints.height(-8), hk.arm_angle(joints=(1, 3, 9))):
        with pytest.raises(UnknownNameError, match=r"unknown index of a joint.*0 \(panda_joint1\)"):
            hk.holonomic(task, wrong)
    with pytest.raises(UnknownNameError, match="unknown joint 'panda_joint8'"):
        hk.holonomic(task, hk.strategies.constraints.height("panda_joint8"))


def test_the_heights_of_two_joints_are_two_rows(irb140: hk.Robot) -> None:
    both = hk.strategies.constraints.height(3, "q6")
    assert (both.rows, both.name) == (2, "height of q[3], q6")
    q = np.array([0.1, 0.9, 0.2, 0.3, 0.4, 0.5])
    f = angle(irb140, both)
    (line,) = irb140.skeleton(q)  # begins at the base
    assert f(q) == pytest.approx([line[4][2], line[6][2]], abs=1e-12)
