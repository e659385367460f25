"""MJCF: MuJoCo's own kinematics as the referee, URDFs that MuJoCo reads, and what is refused."""

from __future__ import annotations

import gc
import re
import sys
import weakref
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, urdf
from holokin.base.errors import (
    ArgumentError,
    MissingExtraError,
    NotFiniteError,
    RobotFileError,
    ShapeError,
    UnknownNameError,
)
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
    ("file", "tip"), [("panda.urdf", "panda_hand_tcp"), ("xarm7.urdf", "link_eef"), ("tiago.urdf", "arm_7_link")]
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
    with pytest.raises(RobotFileError):  # they would come from the meshes
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


# --- Joints in the configurations of other libraries' models: MuJoCo and Pinocchio themselves are the referees.


SIDES = ("left/", "right/")


def two_pandas() -> mujoco.MjModel:
    """A cube that flies, a lamp on a ball joint, two Pandas, and fingers between them."""
    scene = mujoco.MjSpec()
    cube = scene.worldbody.add_body(pos=[1, 1, 1])
    cube.add_freejoint(name="cube")
    cube.add_geom(size=[0.1, 0.1, 0.1])
    lamp = scene.worldbody.add_body(pos=[2, 1, 1])
    lamp.add_joint(type=mujoco.mjtJoint.mjJNT_BALL, name="lamp")
    lamp.add_geom(size=[0.1, 0.1, 0.1])
    for side, y in zip(SIDES, (0.5, -0.5), strict=True):
        arm = mujoco.MjSpec.from_string(hk.robot.to_mjcf(hk.load("panda")))
        scene.attach(arm, prefix=side, frame=scene.worldbody.add_frame(pos=[0, y, 0]))
        finger = scene.worldbody.add_body(name=f"{side}finger")
        finger.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, name=f"{side}finger")
        finger.add_geom(size=[0.1, 0.1, 0.1])
    return scene.compile()


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return two_pandas()


@pytest.fixture(scope="module")
def panda() -> hk.Robot:
    return hk.load("panda")


@pytest.mark.parametrize(("side", "y"), [("left/", 0.5), ("right/", -0.5)])
def test_joints_put_into_qpos_take_the_site_where_the_robot_says(
    model: mujoco.MjModel, panda: hk.Robot, side: str, y: float
) -> None:
    data = mujoco.MjData(model)
    before = data.qpos.copy()
    assert panda.put(model, data.qpos, PANDA_START, prefix=side) is data.qpos
    mujoco.mj_kinematics(model, data)
    wanted = panda.pose(PANDA_START)[:3, 3] + [0, y, 0]
    assert np.abs(data.site(f"{side}panda_hand_tcp").xpos - wanted).max() < 1e-12
    assert (data.qpos != before).sum() == panda.n
    assert np.array_equal(panda.q_of(model, data.qpos, prefix=side), PANDA_START)
    other = SIDES[1 - SIDES.index(side)]
    assert np.array_equal(panda.q_of(model, data.qpos, prefix=other), np.zeros(7))


def test_a_robot_of_the_model_itself_needs_no_prefix_and_has_mujocos_poses() -> None:
    """With references, a joint without a name, and a joint that follows another."""
    model = mujoco.MjModel.from_xml_string(ARM)
    robot, rng = hk.robot.from_mjcf(model, tip="pen"), np.random.default_rng(0)
    names = [model.joint(i).name for i in range(model.njnt)]
    for _ in range(5):
        q, qpos = rng.uniform(-1, 1, robot.n), rng.uniform(-1, 1, model.nq)
        qpos[3:7] /= np.linalg.norm(qpos[3:7])
        robot.put(model, qpos, q)
        bend, last = (int(model.jnt_qposadr[names.index(name)]) for name in ("bend", "last"))
        qpos[last] = model.qpos0[last] + 0.2 - 1.5 * (qpos[bend] - model.qpos0[bend])
        moved = {i: qpos[model.jnt_qposadr[i]] for i in range(model.njnt) if names[i] != "loose"}
        assert np.abs(robot.pose(robot.q_of(model, qpos)) - site_pose(model, "pen", moved)).max() < 1e-12


def test_velocities_are_found_where_mujoco_has_them(model: mujoco.MjModel, panda: hk.Robot) -> None:
    """v = J dq, MuJoCo's own Jacobian the referee; a free joint has 7 numbers in qpos and 6 in qvel."""
    data, rates = mujoco.MjData(model), np.linspace(-0.3, 0.4, 7)
    panda.put(model, data.qpos, PANDA_START, prefix="right/")
    panda.put_rates(model, data.qvel, rates, prefix="right/")
    mujoco.mj_forward(model, data)
    linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_jacSite(model, data, linear, angular, model.site("right/panda_hand_tcp").id)
    twist = np.concatenate([linear @ data.qvel, angular @ data.qvel])
    assert np.abs(twist - panda.jacobian(PANDA_START) @ rates).max() < 1e-12
    assert np.array_equal(panda.rates_of(model, data.qvel, prefix="right/"), rates)


def test_a_batch_has_the_joints_of_each_row(model: mujoco.MjModel, panda: hk.Robot) -> None:
    qpos = np.random.default_rng(1).normal(size=(4, 3, model.nq))
    q = panda.q_of(model, qpos, prefix="left/")
    assert q.shape == (4, 3, 7)
    for i in np.ndindex(4, 3):
        assert np.array_equal(q[i], panda.q_of(model, qpos[i], prefix="left/"))
    back = panda.put(model, np.zeros((4, 3, model.nq)), q, prefix="left/")
    assert np.array_equal(panda.q_of(model, back, prefix="left/"), q)
    assert np.count_nonzero(back) == q.size
    all_alike = panda.put(model, np.zeros((5, model.nq)), PANDA_START, prefix="left/")
    assert (panda.q_of(model, all_alike, prefix="left/") == PANDA_START).all()
    q[:] = 0  # a copy: what was read is no window into qpos
    assert np.count_nonzero(panda.q_of(model, qpos, prefix="left/")) == q.size


def test_another_order_of_joints_and_other_names_are_the_same_posture(model: mujoco.MjModel, panda: hk.Robot) -> None:
    turned = hk.robot.ordered(panda, panda.joint_names[::-1])
    qpos = panda.put(model, np.zeros(model.nq), PANDA_START, prefix="left/")
    assert np.array_equal(turned.q_of(model, qpos, prefix="left/"), PANDA_START[::-1])
    names = [f"left/{name}" for name in panda.joint_names]
    assert np.array_equal(panda.q_of(model, qpos, joints=names), PANDA_START)


def test_a_pinocchio_model_with_joints_kept_as_cosine_and_sine_is_read_to_the_nearest_turn() -> None:
    pin = pytest.importorskip("pinocchio")
    model = pin.buildModelFromUrdf(str(urdf("kinova.urdf")))
    robot = hk.robot.from_pinocchio(model, tip=model.frames[-1].name)
    assert model.nq > robot.n  # some joints have no limits
    q, data = np.random.default_rng(2).uniform(-3, 3, robot.n), model.createData()
    configuration = robot.put(model, pin.neutral(model), q)
    pin.framesForwardKinematics(model, data, configuration)
    assert np.abs(data.oMf[-1].homogeneous - robot.pose(q)).max() < 1e-12
    assert np.abs(robot.q_of(model, configuration) - q).max() < 1e-12
    far = q + 2 * np.pi * (robot.hinges & (np.abs(robot.upper) > 1e6))
    assert np.abs(robot.q_of(model, configuration, near=far) - far).max() < 1e-12


def test_a_prefix_that_is_missing_is_named(model: mujoco.MjModel, panda: hk.Robot) -> None:
    for wrong in ("", "middle/"):
        with pytest.raises(ArgumentError, match=r"begin with 'left/' or 'right/'"):
            panda.q_of(model, np.zeros(model.nq), prefix=wrong)


def test_a_joint_that_is_not_there_is_told_with_those_that_are(model: mujoco.MjModel, panda: hk.Robot) -> None:
    names = [f"left/{name}" for name in panda.joint_names]
    with pytest.raises(UnknownNameError, match="did you mean 'left/panda_joint7'") as told:
        panda.q_of(model, np.zeros(model.nq), joints=[*names[:6], "left/panda_joint_7"])
    assert "right/finger" in str(told.value)
    with pytest.raises(UnknownNameError, match="MuJoCo model 'shoulder_pan_joint'"):
        hk.load("ur5e").q_of(model, np.zeros(model.nq))


@pytest.mark.parametrize(
    ("name", "fact"), [("cube", "a free joint"), ("lamp", "a ball joint"), ("left/finger", "slide")]
)
def test_a_joint_of_another_kind_is_refused(model: mujoco.MjModel, panda: hk.Robot, name: str, fact: str) -> None:
    names = [f"left/{joint}" for joint in panda.joint_names]
    with pytest.raises(ArgumentError, match=fact):
        panda.q_of(model, np.zeros(model.nq), joints=[name, *names[1:]])


def test_bad_configurations_and_names_are_refused(model: mujoco.MjModel, panda: hk.Robot) -> None:
    qpos, names = np.zeros(model.nq), [f"left/{joint}" for joint in panda.joint_names]
    for wrong in (np.zeros(model.nv), np.zeros(7), np.zeros(()), np.zeros((model.nq, 2))):
        with pytest.raises(ShapeError, match="the configuration"):
            panda.q_of(model, wrong, prefix="left/")
        with pytest.raises(ShapeError, match="the configuration"):
            panda.put(model, wrong, PANDA_START, prefix="left/")
    with pytest.raises(ShapeError, match="the velocity"):
        panda.rates_of(model, qpos, prefix="left/")
    for bad in (PANDA_START[:6], np.zeros((2, 7))):
        with pytest.raises(ShapeError, match="the joints"):
            panda.put(model, qpos, bad, prefix="left/")
    with pytest.raises(NotFiniteError, match="the joints"):
        panda.put(model, qpos, np.full(7, np.nan), prefix="left/")
    assert not qpos.any()  # nothing was written
    spoilt = panda.put(model, qpos.copy(), PANDA_START, prefix="left/")
    spoilt[7 + 4 + 2] = np.nan
    with pytest.raises(NotFiniteError, match="at panda_joint3;"):
        panda.q_of(model, spoilt, prefix="left/")
    assert np.isfinite(panda.q_of(model, spoilt, prefix="right/")).all()
    fixed = np.zeros(model.nq)
    fixed.flags.writeable = False
    for no_array in (fixed, [0.0] * model.nq, np.zeros(model.nq, dtype=int), None):
        with pytest.raises(ArgumentError, match="written to"):
            panda.put(model, no_array, PANDA_START, prefix="left/")
    with pytest.raises(ArgumentError, match="each joint once"):
        panda.q_of(model, qpos, joints=[names[0]] * 7)
    with pytest.raises(ShapeError, match="name one for each of panda_joint1"):
        panda.q_of(model, qpos, joints=names[:6])
    for no_model in (mujoco.MjData(model), None, "panda"):
        with pytest.raises(ArgumentError, match="not its data"):
            panda.q_of(no_model, qpos)


def test_a_model_that_is_no_longer_used_is_not_kept(panda: hk.Robot) -> None:
    model = two_pandas()
    panda.q_of(model, np.zeros(model.nq), prefix="left/")
    watched = weakref.ref(model)
    del model
    gc.collect()
    assert watched() is None
