"""MJCF: MuJoCo's own kinematics as the referee, URDFs that MuJoCo reads, and what is refused."""

from __future__ import annotations

import re
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, urdf
from holokin.base.errors import ArgumentError, MassError, MissingExtraError, RobotFileError, UnknownNameError
from mjcf_bench import ARM, site_pose

mujoco = pytest.importorskip("mujoco")


def test_the_pose_is_mujocos() -> None:
    model = mujoco.MjModel.from_xml_string(ARM)
    robot = hk.robot.from_mjcf(ARM, tip="pen")
    numbers = {model.joint(i).name or f"joint {i}": i for i in range(model.njnt)}
    assert robot.joint_names == ("lift", "turn", "bend", "joint 4")
    for q in np.random.default_rng(3).uniform(-2, 2, (20, robot.n)):
        values = {numbers[name]: value for name, value in zip(robot.joint_names, q, strict=True)}
        values[numbers["last"]] = np.deg2rad(-15) + 0.2 - 1.5 * q[2]  # MuJoCo's law of a joint equality
        assert np.abs(robot.pose(q) - site_pose(model, "pen", values)).max() < 1e-13
    assert robot.lower == pytest.approx([-1, np.deg2rad(-170), -np.inf, -np.inf])
    assert robot.upper == pytest.approx([2, np.deg2rad(170), np.inf, np.inf])
    assert np.isinf(robot.max_velocity).all()  # MuJoCo has none


def test_file_text_and_live_model_are_one_robot(tmp_path: Path) -> None:
    (tmp_path / "bench.xml").write_text(ARM)
    q = [0.4, -0.3, 1.1, 0.7]
    pose = hk.robot.from_mjcf(ARM, tip="pen").pose(q)
    for robot in (
        hk.load(tmp_path / "bench.xml", tip="pen"),
        hk.robot.from_mjcf(tmp_path / "bench.xml", tip="pen"),
        hk.robot.from_mjcf(mujoco.MjModel.from_xml_string(ARM), tip="pen"),
    ):
        assert np.array_equal(robot.pose(q), pose)
    assert hk.robot.model_tips(tmp_path / "bench.xml") == {
        "cube": (),
        "pen": ("lift", "turn", "bend", "joint 4", "last"),
    }


@pytest.mark.parametrize(
    ("file", "tip"),
    [("panda.urdf", "panda_hand_tcp"), ("xarm7.urdf", "link_eef"), ("tiago.urdf", "arm_7_link")],
)
def test_a_urdf_read_by_mujoco_is_the_urdf_read_here(file: str, tip: str) -> None:
    from holokin.robot.formats.urdf import essentials

    text = re.sub(
        r"<(inertial|visual|collision)\b.*?</\1>",
        "",
        ET.tostring(essentials(urdf(file).read_bytes(), file), "unicode"),
        flags=re.DOTALL,
    )
    head = '<mujoco><compiler fusestatic="false" boundmass="1e-3" boundinertia="1e-6" balanceinertia="true"/></mujoco>'
    model = mujoco.MjModel.from_xml_string(text.replace("</robot>", f"{head}</robot>"))
    ours, theirs = hk.from_urdf(urdf(file), tip=tip), hk.robot.from_mjcf(model, tip=tip)
    assert ours.joint_names == theirs.joint_names
    soft = {joint.get("name"): joint.find("safety_controller") for joint in ET.fromstring(text).iter("joint")}
    limits = [-np.inf if (s := soft[n]) is None else float(s.get("soft_lower_limit", "-inf")) for n in ours.joint_names]
    assert ours.lower == pytest.approx(np.maximum(theirs.lower, limits), abs=1e-15)  # MuJoCo reads no soft limits
    for q in np.random.default_rng(7).uniform(-2, 2, (10, ours.n)):
        assert np.abs(ours.pose(q) - theirs.pose(q)).max() < 1e-12
        assert np.abs(ours.jacobian(q) - theirs.jacobian(q)).max() < 1e-12


def test_what_is_written_is_read_back(panda: hk.Robot) -> None:
    again = hk.robot.from_mjcf(hk.robot.to_mjcf(panda))
    assert (again.joint_names, again.tips[0].name) == (panda.joint_names, "panda_hand_tcp")
    assert np.abs(again.pose(PANDA_START) - panda.pose(PANDA_START)).max() < 1e-14


MESHED = """
<mujoco><asset><mesh name="m" file="nowhere.stl"/><texture name="t" type="2d" file="no.png"/>
  <material name="paint" texture="t"/></asset>
  <worldbody><body name="a"><joint name="j" axis="0 0 1"/>{inertial}<geom type="mesh" mesh="m" material="paint"/>
    <body name="b" pos="1 0 0"><joint name="k" axis="0 1 0"/>{inertial}<geom type="mesh" mesh="m"/>
      <site name="s" pos="1 0 0" material="paint"/></body></body></worldbody>
  <actuator><motor joint="j"/></actuator><sensor><jointpos joint="j"/></sensor>
  <keyframe><key qpos="0.1 0.2"/></keyframe></mujoco>
"""


def test_missing_meshes_do_no_harm_to_the_kinematics() -> None:
    robot = hk.robot.from_mjcf(MESHED.format(inertial=""))
    assert robot.pose([0.3, 0.0])[:3, 3] == pytest.approx([2 * np.cos(0.3), 2 * np.sin(0.3), 0])
    with pytest.raises(MassError, match="no masses"):  # they would come from the meshes
        hk.robot.mass_matrix_expression(robot, hk.symbolic.symbol("q", 2))
    given = MESHED.format(inertial='<inertial pos="0.5 0 0" mass="3" diaginertia="1 2 3"/>')
    assert [body.mass for body in hk.robot.from_mjcf(given).bodies] == [3.0, 3.0]
    stand = given.replace('<body name="a">', '<body name="stand"><geom type="mesh" mesh="m"/></body><body name="a">')
    assert [body.mass for body in hk.robot.from_mjcf(stand, tip="s").bodies] == [
        3.0,
        3.0,
    ]  # what stands still may lack one
    camera = given.replace('<body name="b"', '<body name="camera"><geom type="mesh" mesh="m"/></body><body name="b"')
    assert hk.robot.from_mjcf(camera, tip="s").bodies == ()  # what is carried may not


FOUR_BAR = """
<mujoco><worldbody>
  <body name="hand"><joint name="arm" axis="0 0 1"/><geom size="0.1"/>
    <site name="flange" pos="0 0 0.1"/>
    <body name="left" pos="0 0 0.2"><joint name="l" axis="0 1 0"/><geom size="0.1"/>
      <site name="left_tip" pos="0 0 0.3"/></body>
    <body name="right" pos="0.1 0 0.2"><joint name="r" axis="0 1 0"/><geom size="0.1"/>
      <site name="right_tip" pos="0 0 0.3"/></body>
  </body>
  <body name="target" mocap="true"/>
</worldbody><equality>{}</equality></mujoco>
"""


def test_a_chain_through_a_closed_loop_is_refused_and_one_beside_it_is_not() -> None:
    for loop in (
        '<connect body1="left" body2="right" anchor="0 0 0.3"/>',
        '<weld body1="left" body2="right"/>',
        '<connect site1="left_tip" site2="right_tip"/>',
    ):
        with pytest.raises(RobotFileError, match=r"joint 'l' is part of a closed loop.*'left'.*'right'.*lock"):
            hk.robot.from_mjcf(FOUR_BAR.format(loop), tip="left_tip")
        assert hk.robot.from_mjcf(FOUR_BAR.format(loop), tip="flange").joint_names == ("arm",)
        assert hk.robot.from_mjcf(FOUR_BAR.format(loop), tip="left_tip", locked={"l": 0.0}).joint_names == ("arm",)
    for no_loop in (
        '<connect body1="left" body2="right" anchor="0 0 0.3" active="false"/>',
        '<weld body1="left" body2="target"/>',  # dragged by a mouse or a hand
    ):
        assert hk.robot.from_mjcf(FOUR_BAR.format(no_loop), tip="left_tip").joint_names == ("arm", "l")
    with pytest.raises(RobotFileError, match=r"joint 'arm' is part of a closed loop.*'world'"):
        hk.robot.from_mjcf(FOUR_BAR.format('<weld body1="left" body2="world"/>'), tip="left_tip")


def test_a_tendon_that_ties_joints_is_a_loop() -> None:
    text = FOUR_BAR.format('<tendon tendon1="split"/>').replace(
        "<equality>",
        '<tendon><fixed name="split"><joint joint="l" coef="1"/><joint joint="r" coef="1"/></fixed></tendon><equality>',
    )
    with pytest.raises(RobotFileError, match="equality of tendon 'split'"):
        hk.robot.from_mjcf(text, tip="left_tip")
    assert hk.robot.from_mjcf(text, tip="flange").n == 1


def test_couplings_of_joints() -> None:
    held = hk.robot.from_mjcf(FOUR_BAR.format('<joint joint1="l" polycoef="0.4 0 0 0 0"/>'), tip="left_tip")
    assert held.joint_names == ("arm",)
    assert held.pose([0.0])[:3, 3] == pytest.approx([0.3 * np.sin(0.4), 0, 0.2 + 0.3 * np.cos(0.4)])
    bent = FOUR_BAR.format('<joint joint1="l" joint2="r" polycoef="0 1 2 0 0"/>')
    with pytest.raises(
        RobotFileError, match="'l' is of type \"revolute that follows 'r' by a polynomial of degree 2\""
    ):
        hk.robot.from_mjcf(bent, tip="left_tip")


@pytest.mark.parametrize(
    ("joint", "kind"), [("<freejoint name='f'/>", "free"), ("<joint name='f' type='ball'/>", "ball")]
)
def test_free_and_ball_joints_are_refused_on_the_chain_alone(joint: str, kind: str) -> None:
    text = (
        f"<mujoco><worldbody><body name='torso'>{joint}<geom size='0.1'/><body name='leg'><joint name='hip'/>"
        "<geom size='0.1'/></body></body></worldbody></mujoco>"
    )
    with pytest.raises(RobotFileError, match=f"joint 'f' is of type '{kind}'; choose base= below it"):
        hk.robot.from_mjcf(text)
    assert hk.robot.from_mjcf(text, base="torso").joint_names == ("hip",)


@pytest.mark.parametrize(
    ("model", "error", "said"),
    [
        ("<mujoco><worldbody>", RobotFileError, "is no MJCF that MuJoCo reads"),
        (
            "<mujoco><worldbody><body><joint axis='0 0 0'/></body></worldbody></mujoco>",
            RobotFileError,
            "is no MJCF that MuJoCo takes",
        ),
        ("gone.xml", RobotFileError, "no such file"),
        (3, ArgumentError, "give an MJCF file"),
    ],
)
def test_what_is_no_mjcf_is_named(model: object, error: type[Exception], said: str) -> None:
    with pytest.raises(error, match=said) as caught:
        hk.robot.from_mjcf(model)
    assert "\n" not in str(caught.value)
    with pytest.raises(UnknownNameError, match="unknown body or site"):
        hk.robot.from_mjcf(ARM, tip="pan")


def test_without_mujoco_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(MissingExtraError, match=r"holokin\[mujoco\]"):
        hk.robot.from_mjcf(ARM)


@pytest.mark.parametrize("before", ["\n", " \n\t"])
def test_what_mujoco_takes_before_the_declaration_is_taken(before: str, tmp_path: Path) -> None:
    text = hk.robot.to_mjcf(hk.load("planar-3r"))
    (tmp_path / "arm.xml").write_text(f'{before}<?xml version="1.0"?>\n{text[text.index("<mujoco") :]}')
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml")).nq == hk.load(tmp_path / "arm.xml").n == 3
