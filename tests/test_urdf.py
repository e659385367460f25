"""URDF files: agreement with Pinocchio on every moving chain, and what malformed files get."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import holokin as hk
from conftest import PANDA_START, urdf, urdf_files
from holokin.errors import ArgumentError, RobotFileError, UnknownNameError
from holokin.robot.urdf import MOVING, _read

TOLERANCE = 1e-12


@cache
def readable(path: Path) -> dict[str, tuple[str, ...]] | str:
    """Tips with a moving joint of a file, or why it cannot be compared."""
    try:
        tips = hk.urdf_tips(path)
    except RobotFileError as problem:
        return str(problem)
    moving = {tip: joints for tip, joints in tips.items() if joints}
    return moving or "none of its joints moves"


@cache
def pinocchio_model(path: Path) -> pin.Model:
    return pin.buildModelFromUrdf(str(path))  # mimic joints as joints of their own: values are set below


def values(path: Path, robot: hk.Robot, q: np.ndarray, rng: np.random.Generator) -> dict[str, float]:
    """The value of every moving joint of the file: ours from q, mimics from their masters, others at random."""
    joints = {j.name: j for j in _read(path).joints if j.type in MOVING}
    known = dict(zip(robot.joint_names, q, strict=True))

    def value(name: str) -> float:
        mimic = joints[name].mimic
        if mimic is not None and mimic.joint in joints:
            gain = 1.0 if mimic.multiplier is None else mimic.multiplier
            return gain * value(mimic.joint) + (mimic.offset or 0.0)
        return known.setdefault(name, float(rng.uniform(-1, 1)))

    return {name: value(name) for name in joints}


def pinocchio_posture(model: pin.Model, joint_values: dict[str, float]) -> np.ndarray:
    q = pin.neutral(model)
    for name, value in joint_values.items():
        joint = model.joints[model.getJointId(name)]
        q[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
    return q


def robot_of(path: Path, tip: str) -> hk.Robot | None:
    """The robot, or None for a chain that mimics a joint which the file does not have (there is one such file)."""
    try:
        return hk.from_urdf(path, tip=tip)
    except RobotFileError as problem:
        assert "mimics" in str(problem)
        assert path.name == "alex_psyonic_hands.urdf"
        return None


def compare(path: Path, tip: str) -> float:
    """Largest difference of pose and Jacobian (columns of mimics folded into their masters') over three postures."""
    robot = robot_of(path, tip)
    if robot is None:
        return 0.0
    model = pinocchio_model(path)
    data, frame = model.createData(), model.getFrameId(tip, pin.BODY)
    rng = np.random.default_rng(len(tip))
    worst = 0.0
    for _ in range(3):
        q = rng.uniform(-1.5, 1.5, robot.n)
        posture = pinocchio_posture(model, values(path, robot, q, rng))
        J = pin.computeFrameJacobian(model, data, posture, frame, pin.LOCAL_WORLD_ALIGNED)
        pin.framesForwardKinematics(model, data, posture)
        folded = np.zeros((6, robot.n))
        for joint in robot.joints:
            column = J[:, model.joints[model.getJointId(joint.name)].idx_v]
            folded[:, joint.coordinate] += joint.multiplier * column
        differences = (robot.pose(q) - data.oMf[frame].homogeneous, robot.jacobian(q) - folded)
        worst = max(worst, *(float(np.abs(d).max()) for d in differences))
    return worst


@pytest.mark.parametrize("path", urdf_files(), ids=lambda p: p.stem)
def test_every_moving_chain_agrees_with_pinocchio(path: Path) -> None:
    tips = readable(path)
    if isinstance(tips, str):
        pytest.skip(f"{path.name}: {tips}")
    assert tips
    for tip in tips:
        assert compare(path, tip) < TOLERANCE, tip


def test_the_comparison_above_is_not_empty() -> None:
    found = [readable(path) for path in urdf_files()]
    chains = [tip for tips in found if not isinstance(tips, str) for tip in tips]
    assert len(found) >= 60
    assert sum(isinstance(tips, str) for tips in found) <= 4
    assert len(chains) > 500
    hands = urdf("alex_psyonic_hands.urdf")
    assert sum(robot_of(hands, tip) is None for tip in readable(hands)) <= 10


def test_a_robot_may_have_several_tips() -> None:
    path = urdf("panda.urdf")
    both = hk.from_urdf(path, tip=["panda_leftfinger", "panda_rightfinger"])
    assert both.n == 8 or both.n == 9
    q = np.concatenate([PANDA_START, np.full(both.n - 7, 0.01)])
    for tip in ("panda_leftfinger", "panda_rightfinger"):
        alone = hk.from_urdf(path, tip=tip)
        index = [both.joint_names.index(name) for name in alone.joint_names]
        assert both.pose(q, tip) == pytest.approx(alone.pose(q[index]), abs=1e-15)
        J = np.zeros((6, both.n))
        J[:, index] = alone.jacobian(q[index])
        assert both.jacobian(q, tip) == pytest.approx(J, abs=1e-15)
    assert hk.position(both, tip="panda_rightfinger")(q) == pytest.approx(both.pose(q, "panda_rightfinger")[:3, 3])
    assert len(both.skeleton(q)) == 2


def test_a_locked_joint_is_a_fixed_posture() -> None:
    path = urdf("panda.urdf")
    free = hk.from_urdf(path, tip="panda_hand_tcp")
    held = hk.from_urdf(path, tip="panda_hand_tcp", locked={"panda_joint3": 0.2, "panda_finger_joint1": 0.01})
    assert held.n == 6
    keep = [0, 1, 3, 4, 5, 6]
    assert held.pose(PANDA_START[keep]) == pytest.approx(free.pose(PANDA_START), abs=1e-14)
    assert held.jacobian(PANDA_START[keep]) == pytest.approx(free.jacobian(PANDA_START)[:, keep], abs=1e-14)


def test_a_base_inside_the_tree_is_where_poses_count_from() -> None:
    path = urdf("panda.urdf")
    whole, part = hk.from_urdf(path, tip="panda_link7"), hk.from_urdf(path, tip="panda_link7", base="panda_link3")
    stem = hk.from_urdf(path, tip="panda_link3")
    assert whole.pose(PANDA_START) == pytest.approx(stem.pose(PANDA_START[:3]) @ part.pose(PANDA_START[3:]), abs=1e-14)


def write(folder: Path, joints: str, links: str = "abcd") -> Path:
    file = folder / "robot.urdf"
    body = "".join(f'<link name="{name}"/>' for name in links)
    file.write_text(f'<robot name="tiny">{body}{joints}</robot>')
    return file


def joint(name: str, kind: str, parent: str, child: str, inside: str = "") -> str:
    limit = '<limit lower="-1" upper="2" velocity="3" effort="1"/>' if kind in ("revolute", "prismatic") else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0 0 1" rpy="0 0 0"/><axis xyz="0 0 2"/>{limit}{inside}</joint>'
    )


def test_mimic_prismatic_continuous_and_limits(tmp_path: Path) -> None:
    file = write(
        tmp_path,
        joint("slide", "prismatic", "a", "b")
        + joint("turn", "continuous", "b", "c")
        + joint("follow", "revolute", "c", "d", '<mimic joint="turn" multiplier="-2" offset="0.5"/>'),
    )
    robot = hk.from_urdf(file)
    assert robot.joint_names == ("slide", "turn")
    assert (robot.lower.tolist(), robot.upper.tolist()) == ([-1.0, -np.inf], [2.0, np.inf])
    assert robot.max_velocity.tolist() == [3.0, np.inf]
    T = robot.pose([0.25, 0.3])
    assert T[:3, 3] == pytest.approx([0, 0, 3.25])
    assert np.arctan2(T[1, 0], T[0, 0]) == pytest.approx(0.3 - 2 * 0.3 + 0.5)
    assert robot.jacobian([0.25, 0.3])[5] == pytest.approx([0.0, -1.0])


def test_a_mimic_whose_master_is_elsewhere_brings_the_master_along(tmp_path: Path) -> None:
    file = write(
        tmp_path,
        joint("master", "revolute", "a", "b")
        + joint("other", "revolute", "a", "c", '<mimic joint="master" multiplier="3"/>')
        + joint("last", "revolute", "c", "d"),
    )
    robot = hk.from_urdf(file, tip="d")
    assert robot.joint_names == ("master", "last")
    T = robot.pose([0.1, 0.2])
    assert np.arctan2(T[1, 0], T[0, 0]) == pytest.approx(0.5)
    held = hk.from_urdf(file, tip="d", locked={"master": 0.1})
    assert held.pose([0.2]) == pytest.approx(T)


@pytest.mark.parametrize(
    ("joints", "tip", "said"),
    [
        (joint("x", "revolute", "a", "b") + joint("y", "revolute", "a", "c"), None, "give tip="),
        (joint("x", "floating", "a", "b"), "b", "floating"),
        (joint("x", "revolute", "a", "b").replace('xyz="0 0 2"', 'xyz="0 0 0"'), "b", "axis"),
        (joint("x", "revolute", "a", "b", '<mimic joint="x"/>'), "b", "mimics"),
        (joint("x", "revolute", "a", "b", '<mimic joint="nowhere"/>'), "b", "mimics"),
        ("", "a", "no joints"),
    ],
)
def test_a_file_that_cannot_be_used_says_why(tmp_path: Path, joints: str, tip: str | None, said: str) -> None:
    links = "abc" if 'child link="c"' in joints else "ab"
    file = write(tmp_path, joints, links)
    with pytest.raises(RobotFileError, match=said) as caught:
        hk.from_urdf(file, tip=tip)
    assert "robot.urdf" in str(caught.value)


@pytest.mark.parametrize("text", ["", "not xml <", "<html></html>", "<robot></robot>", "\x00\x01"])
def test_what_is_not_a_urdf_is_named(tmp_path: Path, text: str) -> None:
    file = tmp_path / "wrong.urdf"
    file.write_text(text)
    with pytest.raises(RobotFileError, match=r"wrong\.urdf"):
        hk.from_urdf(file, tip="x")
    with pytest.raises(RobotFileError, match="no such file"):
        hk.load(tmp_path / "missing.urdf", tip="x")


def test_unknown_links_and_joints_are_named_with_what_there_is() -> None:
    path = urdf("panda.urdf")
    for arguments in (
        {"tip": "panda_hand_tpc"},
        {"tip": "panda_link7", "base": "x"},
        {"tip": "panda_link7", "locked": {"x": 0}},
    ):
        with pytest.raises(UnknownNameError, match="known:"):
            hk.from_urdf(path, **arguments)
    with pytest.raises(UnknownNameError, match="did you mean 'panda_hand_tcp'"):
        hk.from_urdf(path, tip="panda_hand_tpc")
    with pytest.raises(ArgumentError, match="panda_joint3"):
        hk.from_urdf(path, tip="panda_link7", locked={"panda_joint3": np.nan})
    with pytest.raises(RobotFileError, match="not below base"):
        hk.from_urdf(path, tip="panda_link2", base="panda_link3")
    with pytest.raises(UnknownNameError):
        hk.from_urdf(path, tip="panda_link7").pose(np.zeros(7), "elsewhere")
