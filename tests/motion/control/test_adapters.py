"""Other libraries as controllers, and the texts by which they get our robots."""

from __future__ import annotations

import importlib
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import holokin as hk
from conftest import PANDA_START
from holokin.motion.control import PostureTask
from holokin.motion.control.libraries import LIBRARIES
from holokin.robot import to_mjcf, to_urdf

every = pytest.mark.parametrize("library", LIBRARIES)


def maker(library: str) -> Callable[..., hk.motion.control.ControlLaw]:
    """Skips where placo is not installed: alone of the three it is no part of the test extra."""
    if library == "placo":
        pytest.importorskip(library)
    return LIBRARIES[library].law


@pytest.mark.parametrize("name", ["ppr", "planar-3r", "irb140", "panda", "iiwa14"])
def test_a_robot_written_as_urdf_is_the_same_robot_to_pinocchio_and_to_us(name: str, tmp_path) -> None:
    robot = hk.load(name)
    file = tmp_path / "again.urdf"
    file.write_text(to_urdf(robot))
    again = hk.from_urdf(file)
    model = pin.buildModelFromUrdf(str(file))
    data = model.createData()
    for q in np.random.default_rng(0).uniform(-1, 1, (3, robot.n)):
        posture = pin.neutral(model)
        for value, joint in zip(q, robot.joint_names, strict=True):
            theirs = model.joints[model.getJointId(joint)]
            posture[theirs.idx_q : theirs.idx_q + theirs.nq] = (
                [value] if theirs.nq == 1 else [np.cos(value), np.sin(value)]
            )
        pin.framesForwardKinematics(model, data, posture)
        theirs = data.oMf[model.getFrameId(robot.tips[0].name)].homogeneous
        assert np.abs(robot.pose(q) - theirs).max() < 1e-12
        assert np.abs(robot.pose(q) - again.pose(q)).max() < 1e-12
        assert np.abs(robot.jacobian(q) - again.jacobian(q)).max() < 1e-12
    assert again.joint_names == robot.joint_names
    finite = np.isfinite(robot.lower)
    assert np.abs(again.lower - robot.lower)[finite].max(initial=0) < 1e-15


@pytest.mark.parametrize("name", ["ppr", "irb140", "panda", "iiwa14"])
def test_a_robot_written_as_mjcf_is_the_same_robot_to_mujoco(name: str) -> None:
    mujoco = pytest.importorskip("mujoco")
    robot = hk.load(name)
    model = mujoco.MjModel.from_xml_string(to_mjcf(robot))
    data = mujoco.MjData(model)
    linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    for q in np.random.default_rng(0).uniform(-1, 1, (3, robot.n)):
        for value, joint in zip(q, robot.joint_names, strict=True):
            data.joint(joint).qpos[0] = value
        mujoco.mj_forward(model, data)
        site = data.site(robot.tips[0].name)
        assert np.abs(site.xpos - robot.pose(q)[:3, 3]).max() < 1e-12
        assert np.abs(site.xmat.reshape(3, 3) - robot.pose(q)[:3, :3]).max() < 1e-12
        mujoco.mj_jacSite(model, data, linear, angular, model.site(robot.tips[0].name).id)
        assert np.abs(np.vstack([linear, angular]) - robot.jacobian(q)).max() < 1e-12


@every
def test_without_a_posture_task_a_library_is_the_pseudo_inverse(panda: hk.Robot, library: str) -> None:
    task = hk.pose(panda)
    point = panda.pose(PANDA_START)[:3, 3]
    loop = hk.circle(point, point - [0.1, 0, 0])
    theirs = hk.simulate(maker(library)(panda), task, loop, PANDA_START, dt=0.04)
    ours = hk.simulate(hk.motion.control.closed_loop(hk.moore_penrose(task), 25.0), task, loop, PANDA_START, dt=0.04)
    assert theirs.tracking_error() < 1e-4
    assert np.abs(theirs.drift()).max() == pytest.approx(0.163, abs=2e-3)
    assert np.abs(theirs.q - ours.q).max() < 1e-3


@every
def test_with_a_posture_task_it_repeats_but_two_paths_differ(panda: hk.Robot, library: str) -> None:
    task = hk.pose(panda)
    point = panda.pose(PANDA_START)[:3, 3]
    loop = hk.circle(point, point - [0.1, 0, 0])
    posture = PostureTask(1e-5 if library == "placo" else 1e-2, gain=1.0)
    law = maker(library)(panda, posture)
    walk = hk.simulate(law, task, loop, PANDA_START, dt=0.04, cycles=2)
    assert np.abs(walk.drift()[1]).max() < 1e-6
    a, b = (hk.simulate(law, task, way, PANDA_START, dt=0.04).q[-1] for way in loop.halves())
    assert np.abs(a - b).max() > 1e-3


@pytest.mark.parametrize("library", ["pink", "mink"])
def test_a_run_has_one_configuration_which_its_steps_update(
    panda: hk.Robot, library: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    module, made = importlib.import_module(library), []

    class Counted(module.Configuration):
        def __init__(self, *arguments, **named) -> None:
            made.append(1)
            super().__init__(*arguments, **named)

    monkeypatch.setattr(module, "Configuration", Counted)
    law, fresh = maker(library)(panda, PostureTask(1e-3)), maker(library)(panda, PostureTask(1e-3))
    step, rng = law.begin(PANDA_START), np.random.default_rng(0)
    for _ in range(5):
        q, pose = PANDA_START + rng.uniform(-0.1, 0.1, 7), panda.pose(PANDA_START + rng.uniform(-0.1, 0.1, 7))
        before = len(made)
        dq = step(q, pose, np.zeros(6), 0.01)
        assert len(made) == before
        assert np.abs(dq - fresh.begin(PANDA_START)(q, pose, np.zeros(6), 0.01)).max() < 1e-9


@pytest.mark.parametrize("library", ["pink", "placo"])
def test_limits_of_a_library_can_be_left_out(panda: hk.Robot, library: str) -> None:
    """A target 5 cm away in a step of 1 ms: pink's own limits are of speed, too; placo's are of position alone."""
    pose, edge = panda.pose(PANDA_START), PANDA_START.copy()
    pose[0, 3] += 0.05
    edge[3] = panda.upper[3] - 1e-6
    beyond = panda.pose(edge + [0, 0, 0, 0.02, 0, 0, 0])
    rates = []
    for limits in (True, False):
        step = maker(library)(panda, limits=limits).begin(PANDA_START)
        over = np.abs(step(PANDA_START, pose, np.zeros(6), 1e-3)) / panda.max_velocity
        rates.append(over.max() if library == "pink" else (edge + step(edge, beyond, np.zeros(6), 1.0))[3])
    bound = 1.0 if library == "pink" else panda.upper[3]
    assert rates[0] < bound + 1e-3 < rates[1]
