"""Where the joints are one function of the tool pose, and where a loop of the tool does not bring them back."""

from __future__ import annotations

import numpy as np
import pytest

import holokin as hk
from holokin.base.errors import ArgumentError

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
