"""The catalogue against other packages' numbers: every robot's pose, and the limits that a package has, too."""

from __future__ import annotations

import numpy as np
import pytest

import holokin as hk
from conftest import Command, urdf
from holokin.robot import reach
from published_poses import POSES, Published


@pytest.mark.parametrize("published", POSES, ids=lambda p: f"{p.robot}-{p.tip}")
def test_the_pose_is_the_published_one(published: Published) -> None:
    """To 1e-6 m, or to the rounding of the source where that is coarser (`position` and `rotation`)."""
    robot = hk.load(published.robot)
    for q, numbers in published.poses:
        pose = robot.pose(q, published.tip)
        assert np.abs(pose[:3, 3] - numbers[:3]).max() < published.position
        assert np.abs(pose[:3, :3].ravel() - numbers[3:]).max() < published.rotation


def test_every_arm_of_the_catalogue_is_compared_with_something() -> None:
    elsewhere = {"panda", "irb140", "iiwa14", "ppr", "planar-3r"}  # tests/test_robot.py
    made_of = {"rail", "rail-ur10e", "planar-base", "mobile-ur5e", "yumi-arm"}  # chosen numbers, and parts of others
    assert {p.robot for p in POSES} | {"fr3"} | elsewhere | made_of == set(hk.catalogue())


def test_the_fr3_has_the_links_of_a_panda_and_limits_of_its_own() -> None:
    fr3, panda = hk.load("fr3"), hk.from_urdf(urdf("panda.urdf"), tip="panda_link8")
    for q in np.random.default_rng(0).uniform(-2, 2, (10, 7)):
        assert np.abs(fr3.pose(q) - panda.pose(q)).max() < 1e-12
    assert (fr3.max_velocity[:4] > panda.max_velocity[:4]).all()
    assert fr3.max_velocity.tolist() == [2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26]


def test_the_xarm7_is_the_urdf_of_example_robot_data() -> None:
    ours, theirs = hk.load("xarm7"), hk.from_urdf(urdf("xarm7.urdf"))
    assert ours.joint_names == theirs.joint_names
    for q in np.random.default_rng(0).uniform(-2, 2, (10, 7)):
        assert np.abs(ours.pose(q) - theirs.pose(q)).max() < 2e-5  # the URDF's right angles are 1.5708
    assert ours.lower == pytest.approx(theirs.lower, abs=1e-3)  # the URDF has them in rad, to five digits
    assert ours.upper == pytest.approx(theirs.upper, abs=1e-3)
    assert ours.max_velocity == pytest.approx(theirs.max_velocity, abs=2e-3)


@pytest.mark.parametrize("name", ["ur5e", "ur10e"])
def test_the_ur_arms_are_those_of_their_analytic_kinematics(name: str) -> None:
    arm = getattr(pytest.importorskip("ur_analytic_ik"), name)
    robot = hk.load(name)
    for q in np.random.default_rng(1).uniform(-3, 3, (20, 6)):
        assert np.abs(robot.pose(q) - arm.forward_kinematics(*q)).max() < 1e-12


def test_the_reach_is_never_exceeded_and_is_the_known_one_of_straight_arms() -> None:
    assert reach(hk.load("planar-3r")) == pytest.approx(3.0, abs=1e-9)
    assert reach(hk.load("iiwa7")) == pytest.approx(0.34 + 0.4 + 0.4 + 0.126, abs=1e-9)  # upright and straight
    assert reach(hk.load("rail")) == 3.0
    assert reach(hk.from_dh([{"a": 1.0}, {"kind": "prismatic"}])) == np.inf
    ur5e = hk.load("ur5e")
    far = reach(ur5e)
    points = ur5e.pose_batch(np.random.default_rng(5).uniform(ur5e.lower, ur5e.upper, (20_000, 6)))[0]
    assert far - 0.05 < np.linalg.norm(points, axis=1).max() <= far
    yumi = hk.load("yumi")
    assert reach(yumi, "left_flange") == pytest.approx(reach(yumi, "right_flange"), abs=1e-4)


def test_the_list_of_robots_has_joints_reach_and_source(holokin: Command) -> None:
    lines = holokin("robots").out.splitlines()
    assert [line.split()[0] for line in lines] == list(hk.catalogue())
    (ur5e,) = [line for line in lines if line.startswith("ur5e")]
    assert ur5e.split()[1:6] == ["6", "joints", "reach", "1.130", "m"]
    assert "Universal Robots" in ur5e
