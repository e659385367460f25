"""Robots put together: poses are products, columns stand side by side, names and orders as asked for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import Command, assert_refused, urdf, write_job
from holokin.app.job import open_job
from holokin.app.job.job_parts import build_robot
from holokin.base.errors import ArgumentError, RobotFileError, ShapeError, UnknownNameError
from holokin.robot import Capsule, with_capsules


def pose(xyz: list[float], rpy: list[float]) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_euler("xyz", rpy).as_matrix(), xyz
    return T


def test_the_pose_of_an_arm_on_a_rail_is_the_product_of_both() -> None:
    rail, arm = hk.load("rail"), hk.load("ur10e")
    whole = hk.compose(rail, arm)
    assert whole.joint_names == rail.joint_names + arm.joint_names
    assert (whole.name, [tip.name for tip in whole.tips]) == ("rail+ur10e", ["tool0"])
    q = np.array([1.2, 0.3, -1.1, 1.4, -0.8, 0.7, 0.2])
    assert np.abs(whole.pose(q) - rail.pose(q[:1]) @ arm.pose(q[1:])).max() < 1e-15
    assert whole.jacobian(q)[:, 0] == pytest.approx([1, 0, 0, 0, 0, 0])
    assert whole.jacobian(q)[:, 1:] == pytest.approx(arm.jacobian(q[1:]), abs=1e-15)
    assert whole.lower == pytest.approx(np.concatenate([rail.lower, arm.lower]))
    assert np.abs(hk.load("rail-ur10e").pose(q) - whole.pose(q)).max() == 0


def test_a_part_stands_where_it_is_mounted_and_a_base_where_it_is_put() -> None:
    base, arm = hk.load("planar-base"), hk.load("ur5e")
    whole = hk.compose(base, hk.robot.Part(arm, pose=[0.1, 0.2, 0.3], rpy=[0.4, 0.5, 0.6]))
    q = np.random.default_rng(0).uniform(-1, 1, 9)
    expected = base.pose(q[:3]) @ pose([0.1, 0.2, 0.3], [0.4, 0.5, 0.6]) @ arm.pose(q[3:])
    assert np.abs(whole.pose(q) - expected).max() < 1e-15
    hung = hk.with_base_pose(arm, [0, 0, 2], [np.pi, 0, 0])
    assert np.abs(hung.pose(q[3:]) - pose([0, 0, 2], [np.pi, 0, 0]) @ arm.pose(q[3:])).max() < 1e-15
    assert hung.name == "ur5e"


def test_a_tool_is_a_tip_beyond_the_flange(panda: hk.Robot) -> None:
    q = [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]
    torch = hk.with_tool(panda, [0.1, 0, 0.2], [0, 0.7, 0], name="torch")
    assert [tip.name for tip in torch.tips] == ["torch"]
    assert np.abs(torch.pose(q) - panda.pose(q) @ pose([0.1, 0, 0.2], [0, 0.7, 0])).max() < 1e-15
    yumi = hk.with_tool(hk.load("yumi"), [0, 0, 0.1], tip="right_flange", name="right_gripper")
    assert [tip.name for tip in yumi.tips] == ["left_flange", "right_gripper"]
    with pytest.raises(UnknownNameError, match="left_flange"):
        hk.with_tool(yumi, tip="flange")
    with pytest.raises(ArgumentError, match="name of two tips is 'left_flange'"):
        hk.with_tool(yumi, tip="right_gripper", name="left_flange")


def test_the_two_arms_of_a_yumi_do_not_move_each_other() -> None:
    arm, yumi = hk.load("yumi-arm"), hk.load("yumi")
    q = np.random.default_rng(4).uniform(-1, 1, 14)
    mounts = {"left_flange": yumi.joints[0].placement, "right_flange": yumi.joints[7].placement}
    for tip, mine, others in (("left_flange", slice(0, 7), slice(7, 14)), ("right_flange", slice(7, 14), slice(0, 7))):
        assert np.abs(yumi.pose(q, tip) - mounts[tip] @ arm.pose(q[mine])).max() < 1e-15
        assert not yumi.jacobian(q, tip)[:, others].any()


def test_joints_stand_in_the_order_asked_for() -> None:
    whole = hk.compose(hk.load("rail"), hk.load("ur10e"))
    order = [*whole.joint_names[1:], "rail_joint"]
    turned = hk.compose(hk.load("rail"), hk.load("ur10e"), order=order)
    q = np.random.default_rng(1).uniform(0, 1, 7)
    mine = q[[order.index(name) for name in whole.joint_names]]
    assert turned.joint_names == tuple(order)
    assert np.array_equal(turned.pose(q), whole.pose(mine))
    assert turned.upper[-1] == 3.0
    for wrong in (order[:-1], [*order[:-1], order[0]], [*order, "x"]):
        with pytest.raises(ArgumentError, match="order of the joints"):
            hk.compose(hk.load("rail"), hk.load("ur10e"), order=wrong)


def test_masses_go_with_the_part_that_has_them() -> None:
    arm = hk.from_urdf(urdf("panda.urdf"), tip="panda_link8")
    whole = hk.compose(hk.load("rail"), hk.robot.Part(arm, pose=[0, 0, 0.5], rpy=[0, 0, 0.3]))
    q = hk.symbolic.symbol("q", 8)
    M = hk.symbolic.Function("M", {"q": q}, {"M": hk.robot.mass_matrix_expression(whole, q)})(np.full(8, 0.2))
    moving = sum(body.mass for body in arm.bodies)  # the rail carries all of the arm, its base included
    assert M[0, 0] == pytest.approx(moving)


def test_the_inertia_of_a_base_turns_with_its_mounting(tmp_path: Path) -> None:
    inertia = '<mass value="5"/><origin xyz="0.1 0 0"/><inertia ixx="1" iyy="2" izz="3" ixy="0" ixz="0" iyz="0"/>'
    (tmp_path / "a.urdf").write_text(
        f'<robot name="a"><link name="foot"><inertial>{inertia}</inertial></link><link name="hand"/>'
        '<joint name="j" type="continuous"><parent link="foot"/><child link="hand"/></joint></robot>'
    )
    arm = hk.load(tmp_path / "a.urdf")
    q = hk.symbolic.symbol("q", 4)
    for rpy, about_z in (([0, 0, 0], 3 + 5 * 0.01), ([np.pi / 2, 0, 0], 2 + 5 * 0.01), ([0, np.pi / 2, 0], 1.0)):
        whole = hk.compose(hk.load("planar-base"), hk.robot.Part(arm, rpy=rpy))
        M = hk.symbolic.Function("M", {"q": q}, {"M": hk.robot.mass_matrix_expression(whole, q)})(np.zeros(4))
        assert M[2, 2] == pytest.approx(about_z)


def test_names_that_clash_are_named_and_a_prefix_parts_them() -> None:
    arm = hk.load("ur5e")
    with pytest.raises(ArgumentError, match=r"name of two joints is 'shoulder_pan_joint'; give a part a prefix"):
        hk.compose(arm, hk.robot.Part(arm, on="base", pose=[0, 1, 0]))
    both = hk.compose(
        hk.robot.Part(arm, prefix="left_"), hk.robot.Part(arm, on="base", pose=[0, 1, 0], prefix="right_")
    )
    assert [tip.name for tip in both.tips] == ["left_tool0", "right_tool0"]
    q = np.zeros(12)
    assert both.pose(q, "right_tool0")[:3, 3] - both.pose(q, "left_tool0")[:3, 3] == pytest.approx([0, 1, 0])
    with pytest.raises(UnknownNameError, match="tip to mount a part on 'hand'"):
        hk.compose(arm, hk.robot.Part(arm, on="hand", prefix="b_"))
    with pytest.raises(ArgumentError, match="parts of a robot"):
        hk.compose()


JOB = """
[robot]
tool = { xyz = [0, 0, 0.1], rpy = [0, 0.2, 0] }
base_pose = { xyz = [1, 0, 0], rpy_deg = [0, 0, 90] }
order = ["rail_joint", "wrist_3_joint", "shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint",
    "wrist_2_joint"]
[[robot.parts]]
name = "rail"
[[robot.parts]]
name = "arm.toml"
rpy_deg = [0, 0, 30]
"""
FILE = """
source = "mine"
order = {order}
[tool]
xyz = [0, 0, 0.1]
rpy = [0, 0.2, 0]
[base]
xyz = [1, 0, 0]
rpy_deg = [0, 0, 90]
[[parts]]
name = "rail"
[[parts]]
name = "arm.toml"
rpy = [0, 0, 0.5235987755982988]
"""
ARM = 'source = "mine"\n[[parts]]\nname = "ur10e"\n'


def test_a_job_and_a_robot_file_put_together_what_python_does(tmp_path: Path) -> None:
    (tmp_path / "arm.toml").write_text(ARM)
    file = write_job(tmp_path, robot=JOB)
    of_job = build_robot(open_job(str(file))[1], file)
    (tmp_path / "cell.toml").write_text(FILE.format(order=list(of_job.joint_names)))
    whole = hk.compose(
        hk.load("rail"), hk.robot.Part(hk.load("ur10e"), rpy=[0, 0, np.pi / 6]), order=list(of_job.joint_names)
    )
    of_python = hk.with_base_pose(hk.with_tool(whole, [0, 0, 0.1], [0, 0.2, 0]), [1, 0, 0], [0, 0, np.pi / 2])
    q = np.random.default_rng(8).uniform(0, 1, 7)
    for robot in (of_job, hk.load(tmp_path / "cell.toml")):
        assert (robot.joint_names, robot.tips[0].name) == (of_python.joint_names, "tool")
        assert np.abs(robot.pose(q) - of_python.pose(q)).max() < 1e-15
    assert of_job.joint_names[1] == "wrist_3_joint"


def test_a_tool_and_a_mounting_of_one_robot_in_a_job(tmp_path: Path) -> None:
    keys = (
        'name = "ur5e"\ntool = { xyz = [0, 0, 0.2] }\nbase_pose = { xyz = [0, 0, 1], rpy = [3.141592653589793, 0, 0] }'
    )
    file = write_job(tmp_path, robot=f"[robot]\n{keys}\n")
    robot = build_robot(open_job(str(file))[1], file)
    q = [0.1, -1.2, 1.3, -1.4, 1.5, 0.6]
    expected = pose([0, 0, 1], [np.pi, 0, 0]) @ hk.load("ur5e").pose(q) @ pose([0, 0, 0.2], [0, 0, 0])
    assert np.abs(robot.pose(q) - expected).max() < 1e-15


@pytest.mark.parametrize(
    ("robot", "words"),
    [
        ("[robot]\n", ("[robot]", "names no robot", "give name, or parts")),
        ('[robot]\nname = "ur5e"\ntool = { xyz = [0, 0] }\n', ("[robot.tool.xyz]", "at least 3")),
        ('[robot]\nname = "ur5e"\ntool = { xzy = [0, 0, 0] }\n', ("[robot.tool.xzy] is an unknown key", "'xyz'")),
        (
            '[robot]\nname = "ur5e"\ntool = { rpy = [0, 0, 0], rpy_deg = [0, 0, 0] }\n',
            ("[robot.tool]", "leave out one"),
        ),
        ('[robot]\ntip = "x"\n[[robot.parts]]\nname = "rail"\n', ("[robot]", "tip stands beside parts")),
        ("[[robot.parts]]\nprefix = 'a'\n", ("[robot.parts.0.name] is missing",)),
        ('[[robot.parts]]\nname = "rail"\nin = "x"\n', ("[robot.parts.0.in] is an unknown key", "known: ")),
        ('[[robot.parts]]\nname = "rail"\n[[robot.parts]]\nname = "rail"\n', ("[robot]", "two joints", "prefix")),
        ('[[robot.parts]]\nname = "rail"\n[[robot.parts]]\nname = "ur5e"\non = "x"\n', ("[robot]", "'x'", "carriage")),
        ('[robot]\nname = "ur5e"\norder = ["a"]\n', ("order of the joints", "shoulder_pan_joint")),
    ],
)
def test_a_composition_that_makes_no_sense_is_refused_by_key(
    holokin: Command, tmp_path: Path, robot: str, words: tuple[str, ...]
) -> None:
    assert_refused(holokin("run", write_job(tmp_path, robot=robot), "--out", tmp_path / "o"), "job.toml", *words)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[[parts]]\nname = 'gone.toml'\n", "no such file"),
        ("[[parts]]\nprefix = 'a'\n", "a part lacks 'name'"),
        ("[[parts]]\nname = 'rail'\nat = 1\n", "unknown key 'at'"),
        ("[[parts]]\nname = 'rail'\nxyz = [1]\n", "three numbers"),
        ("[[parts]]\nname = 'rail'\n[[joints]]\na = 1\n", "has 'joints' beside 'parts'"),
        ("[[parts]]\nname = 'cell.toml'\n", "parts within parts"),
        ("parts = []\n", "parts of a robot"),
        ("[[parts]]\nname = 'a.urdf'\ntip = 3\n", "tip is 3; give text"),
        ("order = 3\n[[parts]]\nname = 'rail'\n", "order is 3"),
        ("convention = 'urdf'\n[[joints]]\na = 1\n", "unknown key 'a'"),
        ("convention = 'urdf'\n[[joints]]\naxis = [0, 0, 0]\n", "has axis"),
        ("convention = 'urdf'\n[[joints]]\nkind = 'ball'\n", "'ball'"),
        ("convention = 'urdf'\n[[joints]]\nrpy = [0, 0, 0]\nrpy_deg = [0, 0, 0]\n", "rpy and rpy_deg"),
    ],
)
def test_a_robot_file_of_parts_or_frames_with_a_fault_is_named(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "cell.toml"
    file.write_text(f"source = 'y'\n{text}")
    with pytest.raises(RobotFileError, match=said) as caught:
        hk.load(file)
    assert "\n" not in str(caught.value)


def test_a_table_beside_an_arm_rides_with_it_on_a_rail_and_stands_still_on_the_ground() -> None:
    bare = hk.load("ur10e")
    table = hk.obstacle("table", Capsule(0.1), [0.9, 0.9, 0.2])
    arm = replace(with_capsules(bare), shapes=(*with_capsules(bare).shapes, table))
    for whole, stands in ((hk.with_base_pose(arm, [0, 0, 1]), True), (hk.compose(hk.load("rail"), arm), False)):
        found = whole.shapes[-1]
        assert (found.obstacle, found.joint < 0) == (stands, stands)
    along = np.linspace(whole.lower[0], whole.upper[0], 5)
    Q = np.column_stack([along, np.tile([0.3, -1.1, 1.4, -0.8, 0.7, 0.2], (5, 1))])
    near, still = (
        {one.pair: one.least for one in hk.check(rows, robot=whole).pairs if "table" in one.pair} for rows in (Q, Q[:1])
    )
    assert near and near == pytest.approx(still, abs=1e-9)


def test_joints_as_in_a_urdf_are_a_file_too(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(
        "source = 'y'\nconvention = 'urdf'\ntip = 'pen'\n[base]\nxyz = [0, 0, 1]\n[tool]\nxyz = [0.1, 0, 0]\n"
        "[[joints]]\nxyz = [1, 2, 3]\nrpy = [0.1, 0.2, 0.3]\naxis = [0, 1, 1]\nlower = -90\nupper = 90\n"
        "degrees = true\n"
        "[[joints]]\njoint = 's'\nkind = 'prismatic'\nxyz = [0, 0.5, 0]\n"
    )
    robot = hk.load(tmp_path / "a.toml")
    assert (robot.joint_names, robot.tips[0].name, robot.upper[0]) == (("q1", "s"), "pen", np.pi / 2)
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_rotvec(0.7 * np.array([0, 1, 1]) / np.sqrt(2)).as_matrix()
    placed = pose([0, 0, 1], [0, 0, 0]) @ pose([1, 2, 3], [0.1, 0.2, 0.3])
    expected = placed @ turn @ pose([0, 0.5, 0.4], [0, 0, 0])
    assert np.abs(robot.pose([0.7, 0.4]) - expected @ pose([0.1, 0, 0], [0, 0, 0])).max() < 1e-15


@pytest.mark.parametrize("seed", range(4))
def test_a_tool_and_a_mounting_are_given_as_a_pose_or_as_position_and_turn(panda: hk.Robot, seed: int) -> None:
    """Referee: the product of the poses, T_base f(q) T_tool; the turn as SciPy writes roll, pitch, yaw."""
    rng = np.random.default_rng(seed)
    (at, to), (turn, lean) = rng.uniform(-0.3, 0.3, (2, 3)), rng.uniform(-3, 3, (2, 3))
    tool, base = (hk.pose_of(p, Rotation.from_euler("xyz", rpy)) for p, rpy in ((at, turn), (to, lean)))
    q = rng.uniform(panda.lower, panda.upper)
    wanted = base @ panda.pose(q) @ tool
    for robot in (
        hk.with_base_pose(hk.with_tool(panda, tool), base),
        hk.with_base_pose(hk.with_tool(panda, at, turn), to, lean),
        hk.with_tool(hk.compose(hk.robot.Part(panda, pose=base)), tool),
    ):
        assert robot.tip == "tool" and f"tip={robot.tip!r}" in repr(robot)
        assert np.abs(robot.pose(q) - wanted).max() < 1e-12
    for bad in (2 * tool, tool.T, tool[:3], at[:2]):
        with pytest.raises((ArgumentError, ShapeError), match="a tool"):
            hk.with_tool(panda, bad)
    with pytest.raises(ArgumentError, match="has its turn"):
        hk.with_tool(panda, tool, turn)
    assert hk.robot.coordinates(["a", "b"]).tip is None
