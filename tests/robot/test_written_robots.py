"""Robots written as URDF and MJCF: the same robot again, to us, to Pinocchio and to MuJoCo."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import holokin as hk
from conftest import PANDA_START, sampled, urdf
from holokin.base.errors import ArgumentError, ShapeError
from holokin.robot import LinkShape, servo, weighed
from holokin.robot.links import between, drawn_links, merged, solid

mujoco = pytest.importorskip("mujoco")


def same_masses(one: hk.Robot, other: hk.Robot) -> None:
    """Each joint carries the same mass with the same inertia; links without mass may have gained a millionth gram."""
    wanted, found = (
        {r.joints[k].name if k >= 0 else "": body for k, body in merged(r.bodies).items()} for r in (one, other)
    )
    assert set(wanted) <= set(found)
    for joint, body in found.items():
        if joint not in wanted:
            assert body.mass < 1e-8
            continue
        assert body.mass == pytest.approx(wanted[joint].mass, rel=1e-12)
        assert np.abs(body.center - wanted[joint].center).max() < 1e-12
        assert np.abs(body.inertia - wanted[joint].inertia).max() < 1e-12 * np.abs(body.inertia).max()


def again(robot: hk.Robot, form: str, folder: Path) -> hk.Robot:
    """The robot, written and read."""
    tips = [tip.name for tip in robot.tips]
    if form == "mjcf":
        return hk.robot.from_mjcf(hk.robot.to_mjcf(robot), tip=tips)
    (folder / "robot.urdf").write_text(hk.robot.to_urdf(robot))
    return hk.from_urdf(folder / "robot.urdf", tip=tips)


@pytest.mark.parametrize("form", ["urdf", "mjcf"])
@sampled(4, "name", hk.robot.catalogue())
def test_a_robot_of_the_catalogue_is_itself_after_it_was_written(name: str, form: str, tmp_path: Path) -> None:
    robot = hk.load(name)
    back = again(robot, form, tmp_path)
    order = [back.joint_names.index(joint) for joint in robot.joint_names]
    q = np.random.default_rng(1).uniform(-1, 1, robot.n)
    theirs = np.empty(robot.n)
    theirs[order] = q
    for tip in robot.tips:
        assert np.abs(back.pose(theirs, tip.name) - robot.pose(q, tip.name)).max() < 1e-12
        assert np.abs(back.jacobian(theirs, tip.name)[:, order] - robot.jacobian(q, tip.name)).max() < 1e-12
    assert np.array_equal(back.lower[order], robot.lower)  # no limit stays none
    assert np.array_equal(back.upper[order], robot.upper)
    if form == "urdf":
        assert np.array_equal(back.max_velocity[order], robot.max_velocity)
    same_masses(weighed(robot), back)


ARMS = [
    ("panda.urdf", ["panda_leftfinger", "panda_rightfinger"]),  # of which one follows the other
    ("tiago.urdf", ["arm_7_link"]),  # with its head and fingers, and rotations a hair from pitch = 90 degrees
]


@pytest.mark.parametrize("form", ["urdf", "mjcf"])
@pytest.mark.parametrize(("file", "tips"), ARMS)
def test_masses_and_followers_survive(file: str, tips: list[str], form: str, tmp_path: Path) -> None:
    robot = hk.from_urdf(urdf(file), tip=tips)
    back = again(robot, form, tmp_path)
    assert back.joint_names == robot.joint_names
    rng = np.random.default_rng(2)
    for q in rng.uniform(-1, 1, (3, robot.n)):
        for tip in tips:
            assert np.abs(back.pose(q, tip) - robot.pose(q, tip)).max() < 1e-12
            assert np.abs(back.jacobian(q, tip) - robot.jacobian(q, tip)).max() < 1e-12
    same_masses(robot, back)


def test_pinocchio_and_mujoco_find_the_source_s_mass_matrix_and_gravity_torque(tmp_path: Path) -> None:
    source = pin.buildModelFromUrdf(str(urdf("panda.urdf")))
    fingers = [i for i, name in enumerate(source.names) if "finger" in name]
    source = pin.buildReducedModel(source, fingers, pin.neutral(source))
    robot = hk.from_urdf(urdf("panda.urdf"), tip="panda_hand_tcp")
    written = pin.buildModelFromXML(hk.robot.to_urdf(robot))
    model = mujoco.MjModel.from_xml_string(hk.robot.to_mjcf(robot))
    data, extra = mujoco.MjData(model), written.createData()
    for q in (PANDA_START, np.zeros(7), -PANDA_START):
        M, g = pin.crba(source, source.createData(), q), pin.computeGeneralizedGravity(source, source.createData(), q)
        M = np.triu(M) + np.triu(M, 1).T
        N, h = (
            pin.crba(written, extra, q),
            pin.computeGeneralizedGravity(written, extra, q),
        )
        assert np.abs(np.triu(N) - np.triu(M)).max() < 1e-12
        assert np.abs(h - g).max() < 1e-11
        data.qpos[:], data.qvel[:] = q, 0
        mujoco.mj_forward(model, data)
        columns = np.zeros((7, 7))
        for i in range(7):
            mujoco.mj_mulM(model, data, columns[i], np.eye(7)[i])
        assert np.abs(columns - M).max() < 1e-12
        assert np.abs(data.qfrc_bias - g).max() < 1e-11


def test_mujoco_takes_a_mass_at_a_point(tmp_path: Path) -> None:
    """As the wrist of an iCub has it: 0.1 kg without any moment of inertia."""
    mujoco = pytest.importorskip("mujoco")
    iner = '<inertial><mass value="0.1"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'
    joint = '<joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>'
    (tmp_path / "r.urdf").write_text(f'<robot name="r"><link name="a"/><link name="b">{iner}</link>{joint}</robot>')
    robot = hk.load(tmp_path / "r.urdf")
    model = mujoco.MjModel.from_xml_string(hk.robot.to_mjcf(robot))
    assert model.body_mass[-1] == 0.1 and 0 < model.body_inertia[-1].max() < 1e-9


def test_a_follower_follows_in_mujoco() -> None:
    robot = hk.from_urdf(urdf("panda.urdf"), tip=["panda_leftfinger", "panda_rightfinger"])
    model = mujoco.MjModel.from_xml_string(hk.robot.to_mjcf(robot))
    data = mujoco.MjData(model)
    model.opt.gravity[:] = 0
    data.joint("panda_finger_joint1").qpos[0] = 0.03  # the other one is at 0
    mujoco.mj_step(model, data, 500)
    first, second = (float(data.joint(f"panda_finger_joint{k}").qpos[0]) for k in (1, 2))
    assert abs(first - second) < 1e-4 < 0.01 < first


def test_placeholders_are_said_and_weigh_what_their_density_says(panda: hk.Robot) -> None:
    for write in (hk.robot.to_urdf, hk.robot.to_mjcf):
        assert "Placeholders: this robot's description has no masses" in write(panda)
        assert "1000 kg/m^3" in write(panda)
        assert "500 kg/m^3" in write(panda, density=500.0)
    whole, half = (sum(b.mass for b in weighed(panda, density).bodies) for density in (1000.0, 500.0))
    assert whole == pytest.approx(2 * half)
    arm = hk.from_urdf(urdf("panda.urdf"), tip="panda_hand_tcp")
    assert "Placeholders" not in hk.robot.to_urdf(arm)
    assert weighed(arm) is arm


@pytest.mark.parametrize(("start", "end"), [([0, 0, 0], [0.3, 0.1, -0.2]), ([0, 0, 0.1], [0, 0, 0.5])])
def test_a_capsule_weighs_what_mujoco_says(start: list[float], end: list[float]) -> None:
    capsule = LinkShape("link", 0, *between(np.array(start), np.array(end), 0.07))
    ends = " ".join(map(str, start + end))
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><body><freejoint/><geom type="capsule" fromto="{ends}" '
        'size="0.07" density="850"/></body></worldbody></mujoco>'
    )
    body = solid(capsule, 850.0)
    assert body.mass == pytest.approx(model.body_mass[1], rel=1e-12)
    assert np.abs(np.linalg.eigvalsh(body.inertia) - np.sort(model.body_inertia[1])).max() < 1e-12
    assert np.abs(body.center - model.body_ipos[1]).max() < 1e-12
    axis = np.subtract(end, start) / np.linalg.norm(np.subtract(end, start))
    assert axis @ body.inertia @ axis == pytest.approx(np.linalg.eigvalsh(body.inertia)[0])


def test_the_arm_is_drawn_from_joint_to_joint(panda: hk.Robot) -> None:
    drawn = [link.shape for link in drawn_links(panda) if link.shape.length]
    line = panda.skeleton(PANDA_START)[0]
    assert sum(shape.length for shape in drawn) == pytest.approx(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    assert hk.robot.to_mjcf(panda).count('type="capsule"') == len(drawn) == hk.robot.to_urdf(panda).count("<cylinder")


def test_a_servo_alone_settles_as_a_critically_damped_oscillator() -> None:
    """x(t) = x0 (1 + w t) exp(-w t) of one joint with its weight compensated, w = 2 pi f."""
    upright = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    robot = hk.from_dh([{"a": 0.6, "joint": "q"}], base=upright)
    drive = servo(robot, "position", [0.0], frequency=2.0, compensated=True)
    model = mujoco.MjModel.from_xml_string(hk.robot.to_mjcf(robot, servo=drive))
    model.opt.timestep, data = 1e-4, mujoco.MjData(model)
    data.qpos[0], w = 0.4, 2 * np.pi * 2.0
    for t in np.arange(1, 5001) * 1e-4:
        mujoco.mj_step(model, data)
        assert abs(data.qpos[0] - 0.4 * (1 + w * t) * np.exp(-w * t)) < 2e-3
    loose = mujoco.MjModel.from_xml_string(
        hk.robot.to_mjcf(robot, servo=servo(robot, "position", [0.0], frequency=2.0))
    )
    data = mujoco.MjData(loose)
    mujoco.mj_step(loose, data, 3000)
    body = weighed(robot).bodies[0]
    sag = body.mass * 9.81 * (0.3 * np.cos(data.qpos[0])) / servo(robot, "position", [0.0], frequency=2.0).stiffness[0]
    assert abs(data.qpos[0]) == pytest.approx(sag, rel=1e-3)


@pytest.mark.campaign
def test_servos_and_efforts_are_written(panda: hk.Robot) -> None:
    for kind, tag in (("position", "position"), ("velocity", "velocity"), ("torque", "motor")):
        model = mujoco.MjModel.from_xml_string(
            hk.robot.to_mjcf(panda, servo=servo(panda, kind, PANDA_START), effort=87.0)
        )
        assert model.nu == 7
        assert [model.actuator(i).name for i in range(7)] == list(panda.joint_names)
        assert model.actuator_forcerange.tolist() == [[-87.0, 87.0]] * 7
        assert hk.robot.to_mjcf(panda, servo=servo(panda, kind, PANDA_START)).count(f"<{tag} ") == 7
    efforts = [87.0] * 4 + [12.0] * 3
    assert [float(x) for x in re.findall('effort="(.*?)"', hk.robot.to_urdf(panda, effort=efforts))] == efforts


def test_names_that_xml_does_not_hold_are_escaped(tmp_path: Path) -> None:
    robot = hk.from_dh([{"a": 0.5, "joint": 'a"<&b'}, {"a": 0.5, "joint": "base"}], name="r&d", tip="base")
    for form in ("urdf", "mjcf"):
        back = again(robot, form, tmp_path)
        assert back.joint_names == robot.joint_names
        assert np.abs(back.pose([0.3, 0.4]) - robot.pose([0.3, 0.4])).max() < 1e-12


def test_what_makes_no_sense_is_refused(panda: hk.Robot) -> None:
    with pytest.raises(ArgumentError, match="density"):
        hk.robot.to_mjcf(panda, density=0.0)
    with pytest.raises(ArgumentError, match="effort"):
        hk.robot.to_urdf(panda, effort=-1.0)
    with pytest.raises(ShapeError, match="effort"):
        hk.robot.to_urdf(panda, effort=[1.0, 2.0])
    with pytest.raises(ArgumentError, match="use one of position, velocity, torque"):
        servo(panda, "hydraulic", PANDA_START)
    with pytest.raises(ArgumentError, match="servo"):
        hk.robot.to_mjcf(panda, servo=servo(hk.load("ppr"), "position", [1, 1, 1]))
