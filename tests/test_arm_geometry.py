"""Shoulder, elbow and wrist are found by how the axes meet, or asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, urdf
from holokin.constraints import Constraint
from holokin.errors import NoArmError, UnknownNameError
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


def test_joints_go_by_name_or_by_index_from_0(panda: hk.Robot) -> None:
    task = hk.pose(panda)
    pairs = [
        (hk.lock(2), hk.lock("panda_joint3")),
        (hk.lock(-1), hk.lock("panda_joint7")),
        (hk.constraints.height(3), hk.constraints.height("panda_joint4")),
    ]
    for by_index, by_name in pairs:
        a, b = hk.holonomic(task, by_index), hk.holonomic(task, by_name)
        assert np.array_equal(a(PANDA_START), b(PANDA_START))
    for wrong in (hk.lock(7), hk.constraints.height(-8), hk.arm_angle(joints=(1, 3, 9))):
        with pytest.raises(UnknownNameError, match=r"unknown index of a joint.* known: 0 \(panda_joint1\), 1 "):
            hk.holonomic(task, wrong)
    with pytest.raises(UnknownNameError, match="unknown joint 'panda_joint8'"):
        hk.holonomic(task, hk.constraints.height("panda_joint8"))


def test_the_heights_of_two_joints_are_two_rows(irb140: hk.Robot) -> None:
    both = hk.constraints.height(3, "q6")
    assert (both.rows, both.name) == (2, "height of q[3], q6")
    q = np.array([0.1, 0.9, 0.2, 0.3, 0.4, 0.5])
    f = angle(irb140, both)
    (line,) = irb140.skeleton(q)  # begins at the base
    assert f(q) == pytest.approx([line[4][2], line[6][2]], abs=1e-12)
