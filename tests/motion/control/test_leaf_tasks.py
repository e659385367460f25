"""The leaf of a strategy as a task of pink and of mink: what Pinocchio, MuJoCo and these libraries make of it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import mink
import mujoco
import numpy as np
import pink
import pinocchio as pin
import pytest

import holokin as hk
from conftest import IIWA_START, PANDA_START, sampled, urdf
from holokin.base.errors import ArgumentError, MissingExtraError, NotFiniteError, ShapeError, UnknownNameError
from holokin.motion.control import PostureTask, mink_law, pink_law
from holokin.robot import to_mjcf, to_urdf

TASKS = {"pink": hk.motion.control.pink_task, "mink": hk.motion.control.mink_task}
LAWS = {"pink": pink_law, "mink": mink_law}
every = pytest.mark.parametrize("library", TASKS)


def configuration(library: str, robot: hk.Robot, q: np.ndarray) -> Any:
    """A library's configuration at a posture of a robot whose joints are in the model's order."""
    if library == "mink":
        return mink.Configuration(mujoco.MjModel.from_xml_string(to_mjcf(robot)), q)
    model = pin.buildModelFromXML(to_urdf(robot))
    return pink.Configuration(model, model.createData(), pin.integrate(model, pin.neutral(model), q))


def solved(library: str, *arguments: Any, **named: Any) -> np.ndarray:
    """The displacement that a library finds: its velocity at dt = 1 s."""
    if library == "mink":
        return mink.solve_ik(*arguments, 1.0, "daqp", limits=[], **named)
    return pink.solve_ik(*arguments, 1.0, "quadprog", limits=[], **named)


def tool_task(library: str, robot: hk.Robot, pose: np.ndarray) -> Any:
    """A library's task of the tool at a pose."""
    if library == "mink":
        task: Any = mink.FrameTask(robot.tips[0].name, "site", position_cost=1.0, orientation_cost=1.0)
        task.set_target(mink.SE3.from_matrix(pose))
        return task
    task = pink.tasks.FrameTask(robot.tips[0].name, position_cost=1.0, orientation_cost=1.0)
    task.set_target(pin.SE3(pose))
    return task


def elbow_of_pinocchio(model: pin.Model, q: np.ndarray, joint: str) -> tuple[float, np.ndarray]:
    """(height of a joint in the frame of its base, its derivative (nv,)) by Pinocchio alone."""
    data, number = model.createData(), model.getJointId(joint)
    pin.computeJointJacobians(model, data, q)
    J = pin.getJointJacobian(model, data, number, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    return float(data.oMi[number].translation[2]), J[2]


def railed(order: int) -> hk.Robot:
    """A UR10e on a rail: with the joint of the rail first, as models have it, or last."""
    rail, arm = hk.load("rail"), hk.load("ur10e")
    names = [*arm.joint_names, *rail.joint_names]
    return hk.compose(rail, arm, order=names if order else [names[-1], *names[:-1]])


def panda_with_fingers() -> tuple[hk.Robot, pin.Model]:
    file = urdf("panda.urdf")
    return hk.from_urdf(file, tip="panda_hand_tcp"), pin.buildModelFromUrdf(str(file))


def fingers_before_the_arm() -> tuple[hk.Robot, pin.Model]:
    """A model whose joints before and after those of the arm are not the robot's."""
    arm, model = hk.load("panda"), pin.Model()
    more = pin.buildModelFromXML(to_urdf(arm))
    for name in ("aaa", "bbb"):
        model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), name)
    return arm, pin.appendModel(model, more, 0, pin.SE3.Identity())


MODELS: dict[str, Callable[[], tuple[hk.Robot, pin.Model]]] = {
    "fingers after the arm": panda_with_fingers,
    "joints before the arm": fingers_before_the_arm,
    "joints without limits": lambda: (hk.load("gen3"), pin.buildModelFromXML(to_urdf(hk.load("gen3")))),
    "another order": lambda: (railed(1), pin.buildModelFromXML(to_urdf(railed(0)))),
}


@pytest.mark.parametrize("model", MODELS)
def test_the_height_of_a_joint_is_that_of_pinocchio_whatever_else_the_model_has(model: str) -> None:
    robot, theirs = MODELS[model]()
    start = np.linspace(0.3, -0.9, robot.n)
    joint = robot.joint_names[3]
    leaf = hk.motion.control.pink_task(hk.holonomic(hk.pose(robot), hk.strategies.constraints.height(joint)), start)
    assert isinstance(leaf, pink.tasks.Task)
    for seed in range(3):
        q = pin.integrate(theirs, pin.neutral(theirs), np.random.default_rng(seed).uniform(-1, 1, theirs.nv))
        at = pink.Configuration(theirs, theirs.createData(), q)
        height, slope = elbow_of_pinocchio(theirs, q, joint)
        assert leaf.compute_error(at) == pytest.approx(height - robot_height(robot, start, joint), abs=1e-12)
        assert np.abs(leaf.compute_jacobian(at) - slope).max() < 1e-12


def robot_height(robot: hk.Robot, q: np.ndarray, joint: str) -> float:
    """The same height at a posture of ours, again by Pinocchio, of the robot written as URDF."""
    model = pin.buildModelFromXML(to_urdf(robot))
    columns = [model.joints[model.getJointId(name)].idx_v for name in robot.joint_names]
    v = np.zeros(model.nv)
    v[columns] = q
    return elbow_of_pinocchio(model, pin.integrate(model, pin.neutral(model), v), joint)[0]


def test_a_floating_base_and_a_change_of_models_do_not_matter(panda: hk.Robot) -> None:
    """g counts in the frame of the robot's base, wherever that is."""
    strategy = hk.holonomic(hk.pose(panda), hk.strategies.constraints.height("panda_joint4"))
    leaf, q = hk.motion.control.pink_task(strategy, PANDA_START), PANDA_START + 0.2
    standing = configuration("pink", panda, q)
    model = pin.buildModelFromXML(to_urdf(panda), pin.JointModelFreeFlyer())
    base = pin.SE3ToXYZQUAT(pin.exp6(np.array([1.0, -2.0, 0.5, 0.3, 0.4, -0.9])))
    flying = pink.Configuration(model, model.createData(), np.concatenate([base, q]))
    height, slope = elbow_of_pinocchio(standing.model, q, "panda_joint4")
    for _ in range(2):
        for at, before in ((standing, 0), (flying, 6)):
            assert leaf.compute_error(at) == pytest.approx(height - robot_height(panda, PANDA_START, "panda_joint4"))
            J = leaf.compute_jacobian(at)
            assert np.abs(J[:, before:] - slope).max() < 1e-12 and not J[:, :before].any()


def test_the_height_of_a_joint_is_that_of_mujoco_beside_a_free_body_and_with_other_names() -> None:
    arm = hk.load("panda")
    text = to_mjcf(arm).replace('name="panda_', 'name="left/panda_')
    loose = '<worldbody><body name="cup" pos="1 0 0"><freejoint/><geom size="0.1"/></body>'
    model = mujoco.MjModel.from_xml_string(text.replace("<worldbody>", loose, 1))
    assert model.joint("left/panda_joint1").qposadr[0] == 7
    strategy = hk.holonomic(hk.pose(arm), hk.strategies.constraints.height("panda_joint4"))
    leaf = hk.motion.control.mink_task(strategy, PANDA_START, prefix="left/")
    named = hk.motion.control.mink_task(strategy, PANDA_START, joints=[f"left/{name}" for name in arm.joint_names])
    assert isinstance(leaf, mink.Task)
    data, J = mujoco.MjData(model), np.zeros((3, model.nv))
    number = model.joint("left/panda_joint4").id
    heights = []
    for q in (PANDA_START, *np.random.default_rng(0).uniform(-1, 1, (3, 7))):
        at = mink.Configuration(model, np.concatenate([[0.3, 0.1, 0.2, 1.0, 0.0, 0.0, 0.0], q]))
        data.qpos = at.q
        mujoco.mj_forward(model, data)
        heights.append(data.xanchor[number][2])
        mujoco.mj_jac(model, data, J, None, data.xanchor[number], model.jnt_bodyid[number])
        assert leaf.compute_error(at) == pytest.approx(heights[-1] - heights[0], abs=1e-12)
        assert np.abs(leaf.compute_jacobian(at) - J[2]).max() < 1e-12
        assert np.array_equal(leaf.compute_error(at), named.compute_error(at))
    with pytest.raises(ArgumentError, match="begin with 'left/'"):
        hk.motion.control.mink_task(strategy, PANDA_START).compute_error(at)


@every
def test_a_step_is_the_one_solution_of_tool_and_leaf(library: str, panda: hk.Robot) -> None:
    """[J; J_g] dq = [tool's way; c - g(q)], off the leaf: the programme has nothing left to choose."""
    strategy = hk.holonomic(hk.pose(panda), hk.arm_angle())
    leaf = TASKS[library](strategy, PANDA_START)
    q = PANDA_START + 0.05 * np.sin(np.arange(7))
    at, pose = configuration(library, panda, q), panda.pose(q)
    pose[:3, 3] += [0.01, -0.02, 0.015]
    dq = solved(library, at, [tool_task(library, panda, pose)], constraints=[leaf])
    rows = np.vstack([panda.jacobian(q), strategy.rows(q)])
    way = np.concatenate([[0.01, -0.02, 0.015, 0, 0, 0], strategy.g(PANDA_START) - strategy.g(q)])
    assert np.abs(dq - np.linalg.solve(rows, way)).max() < 1e-6


@every
@sampled(1, "hard", [True, False], ids=["constraint", "cost"])
def test_the_joints_are_led_to_another_leaf_by_the_self_motion(library: str, hard: bool, panda: hk.Robot) -> None:
    strategy = hk.holonomic(hk.pose(panda), hk.strategies.constraints.height("panda_joint4"))
    leaf = TASKS[library](strategy, PANDA_START, gain=0.5)
    at, tool = configuration(library, panda, PANDA_START), tool_task(library, panda, panda.pose(PANDA_START))
    leaf.level = leaf.level - 0.02
    for _ in range(60):
        roles = {"constraints": [leaf]} if hard else {}
        at.integrate_inplace(solved(library, at, [tool, *([] if hard else [leaf])], **roles), 1.0)
    assert np.abs(at.q - hk.motion.ik.move_to_leaf(strategy, PANDA_START, leaf.level)).max() < 1e-6
    leaf.set_target_from_configuration(configuration(library, panda, PANDA_START))
    assert leaf.compute_error(at) == pytest.approx(-0.02, abs=1e-6)


@every
def test_the_gain_is_the_share_of_the_error_that_a_step_removes(library: str, panda: hk.Robot) -> None:
    strategy = hk.holonomic(hk.pose(panda), hk.linear([1, 0, -1, 0, 0, 0, 0]))
    for gain in (0.0, 0.25, 1.0):
        leaf = TASKS[library](strategy, PANDA_START, gain=gain)
        leaf.level = leaf.level + 0.01
        at = configuration(library, panda, PANDA_START)
        at.integrate_inplace(solved(library, at, [tool_task(library, panda, panda.pose(PANDA_START))],
            constraints=[leaf]), 1.0)  # fmt: skip
        assert leaf.compute_error(at) == pytest.approx(-0.01 * (1 - gain), abs=1e-6)


@every
@sampled(1, ("name", "start"), [("panda", PANDA_START), ("iiwa14", IIWA_START + [0, 0, 0.2, 0, 0.1, 0, 0])])
def test_two_paths_agree_100_times_better_than_by_a_posture_task_at_the_same_tracking(
    library: str, name: str, start: np.ndarray
) -> None:
    robot = hk.load(name)
    task = hk.pose(robot)
    point = robot.pose(start)[:3, 3]
    circle = hk.circle(point, point - [0.1, 0, 0])
    strategy = hk.holonomic(task, hk.linear([1, 0, -1, 0, 0, 0, 0]))
    apart, tracking = [], []
    for law in (LAWS[library](robot, PostureTask(1e-3)), LAWS[library](robot, leaf=strategy)):
        a, b = (hk.simulate(law, task, way, start, dt=0.01) for way in circle.halves())
        apart.append(np.abs(a.q[-1] - b.q[-1]).max())
        tracking.append(max(a.tracking_error(), b.tracking_error()))
    assert apart[0] > 100 * apart[1]
    assert tracking[1] < 1.5 * tracking[0]


@every
def test_where_the_leaf_ends_the_tool_falls_behind_and_the_leaf_is_kept(
    library: str, panda: hk.Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With limits of speed: pink's own, a `VelocityLimit` for mink."""
    strategy = hk.holonomic(hk.pose(panda), hk.strategies.constraints.height("panda_joint4"))
    goal, leaf = panda.pose(PANDA_START), TASKS[library](strategy, PANDA_START)
    at = configuration(library, panda, PANDA_START)
    for k in range(1, 151):
        goal[1, 3] = panda.pose(PANDA_START)[1, 3] - 0.001 * k
        tool = tool_task(library, panda, goal)
        if library == "pink":
            v = pink.solve_ik(at, [tool], 0.01, "quadprog", constraints=[leaf])
        else:
            speeds = dict(zip(panda.joint_names, panda.max_velocity, strict=True))
            limits = [mink.ConfigurationLimit(at.model), mink.VelocityLimit(at.model, speeds)]
            v = mink.solve_ik(at, [tool], 0.01, "daqp", limits=limits, constraints=[leaf])
        assert (np.abs(v) <= panda.max_velocity * (1 + 1e-6)).all()
        at.integrate_inplace(v, 0.01)
        assert np.abs(leaf.compute_error(at)).max() < 2e-5
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")  # for one pose
    assert hk.ik(strategy, PANDA_START).batch(goal[None]).status[0] == hk.motion.ik.InverseStatus.LEAF_ENDS
    assert 0.01 < np.linalg.norm(panda.pose(at.q)[:3, 3] - goal[:3, 3]) < 0.02


def test_a_joint_without_limits_turns_on_beyond_half_a_turn() -> None:
    """Pinocchio has its cosine and sine alone; g = q1 / 3 is none of theirs."""
    robot = hk.load("gen3")
    strategy = hk.holonomic(hk.pose(robot), hk.linear([1 / 3, 0, 0, 0, 0, 0, 0]))
    at = configuration("pink", robot, np.full(7, 0.4))
    leaf = hk.motion.control.pink_task(strategy, np.full(7, 0.4))
    for i in range(1, 9):
        at.integrate_inplace(np.eye(7)[0], 1.0)
        assert leaf.compute_error(at) == pytest.approx(i / 3, abs=1e-12)


def test_an_angle_is_led_back_by_its_shorter_way() -> None:
    robot = hk.load("panda")
    strategy = hk.holonomic(hk.pose(robot), hk.arm_angle())
    leaf = hk.motion.control.mink_task(strategy, PANDA_START)
    leaf.level = leaf.level + 2 * np.pi - 0.1
    assert leaf.compute_error(configuration("mink", robot, PANDA_START)) == pytest.approx(0.1, abs=1e-12)


@every
def test_a_model_without_the_joint_is_refused(library: str, panda: hk.Robot, iiwa14: hk.Robot) -> None:
    strategy = hk.holonomic(hk.pose(panda), hk.lock(2))
    at = configuration(library, iiwa14, IIWA_START)
    with pytest.raises(UnknownNameError, match="panda_joint1"):
        TASKS[library](strategy, PANDA_START).compute_error(at)
    found = TASKS[library](strategy, PANDA_START, joints=iiwa14.joint_names).compute_error(at)
    assert found == pytest.approx(IIWA_START[2] - PANDA_START[2])


def test_a_joint_of_several_degrees_of_freedom_is_refused(panda: hk.Robot) -> None:
    model = pin.Model()
    number = 0
    for i, kind in enumerate([pin.JointModelSpherical(), *[pin.JointModelRZ()] * 6]):
        number = model.addJoint(number, kind, pin.SE3.Identity(), f"panda_joint{i + 1}")
    leaf = hk.motion.control.pink_task(hk.holonomic(hk.pose(panda), hk.lock(2)), PANDA_START)
    with pytest.raises(ArgumentError, match="panda_joint1"):
        leaf.compute_error(pink.Configuration(model, model.createData(), pin.neutral(model)))


@every
def test_bad_arguments_name_their_cure(library: str, panda: hk.Robot) -> None:
    make, task = TASKS[library], hk.pose(panda)
    strategy = hk.holonomic(task, hk.lock(2))
    with pytest.raises(ArgumentError, match="give a strategy with leaves"):
        make(hk.moore_penrose(task), PANDA_START)
    for wrong in ({"gain": 1.5}, {"gain": np.nan}, {"cost": -1.0}, {"lm_damping": -1.0}):
        with pytest.raises(ArgumentError, match=next(iter(wrong))):
            make(strategy, PANDA_START, **wrong)
    with pytest.raises(ShapeError, match="cost"):
        make(strategy, PANDA_START, cost=[1.0, 2.0])
    with pytest.raises(ShapeError, match="panda_joint7"):
        make(strategy, PANDA_START, joints=["panda_joint1"])
    irb = hk.load("irb140")
    nothing = hk.holonomic(hk.pose(irb), hk.custom(lambda _q: [], rows=0))
    with pytest.raises(ArgumentError, match="redundant"):
        make(nothing, [0.1, 0.2, 0.1, 0.3, 0.6, 0.3])


@every
def test_where_g_is_not_finite_it_is_said(library: str, panda: hk.Robot) -> None:
    root = hk.holonomic(hk.pose(panda), hk.custom(lambda q: (q[2] - 0.1) ** 0.5))
    with pytest.raises(NotFiniteError):
        TASKS[library](root, PANDA_START).compute_error(configuration(library, panda, np.zeros(7)))


@every
def test_a_library_that_is_missing_is_named_with_its_extra(
    library: str, panda: hk.Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    from holokin.motion.control import libraries

    libraries._class_of.cache_clear()
    for name in [name for name in sys.modules if name.split(".")[0] == library]:
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(MissingExtraError, match=rf"holokin\[{library}\]"):
        TASKS[library](hk.holonomic(hk.pose(panda), hk.lock(2)), PANDA_START)
