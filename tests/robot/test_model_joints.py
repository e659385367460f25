"""Joints in the configurations of other libraries' models: MuJoCo and Pinocchio themselves are the referees."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, urdf
from holokin.base.errors import ArgumentError, NotFiniteError, ShapeError, UnknownNameError
from mjcf_bench import ARM, site_pose

mujoco = pytest.importorskip("mujoco")

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
    with pytest.raises(
        UnknownNameError, match=r"did you mean 'left/panda_joint7'.*known: cube, lamp, left/panda"
    ) as told:
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
