"""`Plant`: a robot with its servos as a MuJoCo model, and where the robot's joints are in it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..base.arguments import typed
from ..base.shown import Shown
from ..base.types import Indices, positive
from ..errors import ArgumentError, RobotFileError
from ..robot import DENSITY, Robot, Servo, knows_masses, to_mjcf
from ..robot.mjcf import mujoco_module


@dataclass(frozen=True, eq=False)
class Plant(Shown):
    """A robot with its servos as a MuJoCo model. Make one with `make_plant`.

    Attributes:
        robot, servo: what it was made of.
        model: the `mujoco.MjModel`.
        origin: where the model is from, in words.
        places, dofs, actuators, bodies: (n,) indices of each coordinate in qpos, in qvel, of its actuator and its body.
    """

    robot: Robot
    servo: Servo
    model: Any
    origin: str
    places: Indices
    dofs: Indices
    actuators: Indices
    bodies: Indices


@typed
def make_plant(robot: Robot, servo: Servo, *, dt: float = 1e-3, density: float = DENSITY) -> Plant:
    """The MuJoCo model of a robot: its own MJCF file where it was read from one, else what `to_mjcf` writes.

    Of an own file all actuators of the robot's joints are replaced by the servo; the rest of the file stays. A robot
    that got another base or tool since it was read is written anew. The weight acts along -z of the base.

    Args:
        dt: step of the physics [s].
        density: of the capsules that stand for links without masses [kg/m^3].

    Raises:
        MissingExtraError: mujoco is not installed. ArgumentError, ShapeError: as of `to_mjcf`.
    """
    mujoco = mujoco_module()
    dt = positive("dt", dt, "give a positive step in seconds")
    if len(servo.damping) != robot.n:
        raise ArgumentError("the servo's joints", len(servo.damping), f"make one for the {robot.n} of {robot.name!r}")
    file = _own_file(robot)
    model = None if file is None else _driven(mujoco, robot, servo, file)
    if model is not None and _is_of(mujoco, model, robot):
        origin = str(file)
    else:
        model = mujoco.MjModel.from_xml_string(to_mjcf(robot, servo=servo, density=density))
        origin = "the masses of its description" if knows_masses(robot) else f"solid capsules of {density:g} kg/m^3"
    model.opt.timestep = dt
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    joints = [model.joint(name) for name in robot.joint_names]
    at = [joint.id for joint in joints]
    driven = {int(model.actuator_trnid[k, 0]): k for k in range(model.nu)}
    return Plant(
        robot, servo, model, origin, model.jnt_qposadr[at].copy(), model.jnt_dofadr[at].copy(),
        np.array([driven[k] for k in at]), model.jnt_bodyid[at].copy(),
    )  # fmt: skip


def _own_file(robot: Robot) -> Path | None:
    """The MJCF file that a robot was read from; None of one that is from elsewhere, or put together of parts."""
    file = Path(robot.source)
    try:
        if file.suffix.lower() not in (".xml", ".mjcf") or not file.is_file():
            return None
    except OSError:  # a source in words, too long for a name
        return None
    return file


def _is_of(mujoco: Any, model: Any, robot: Robot) -> bool:
    """Whether the tip of a robot is in a model, where the robot has it."""
    tip, data = robot.tips[0].name, mujoco.MjData(model)
    for name in robot.joint_names:
        if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) < 0:
            return False
    q = np.clip(np.zeros(robot.n), robot.lower, robot.upper)
    for name, value in zip(robot.joint_names, q, strict=True):
        data.joint(name).qpos[0] = value
    mujoco.mj_kinematics(model, data)
    for kind, word in ((mujoco.mjtObj.mjOBJ_SITE, "site"), (mujoco.mjtObj.mjOBJ_BODY, "body")):
        index = mujoco.mj_name2id(model, kind, tip.removesuffix(" (site)"))
        if index >= 0:
            at = (data.site_xpos if word == "site" else data.xpos)[index]
            return bool(np.abs(at - robot.pose(q)[:3, 3]).max() < 1e-6)
    return False


def _driven(mujoco: Any, robot: Robot, servo: Servo, file: Path) -> Any:
    """The model of a file, with the servo on the robot's joints."""
    spec = mujoco.MjSpec.from_file(str(file))
    for actuator in list(spec.actuators):
        if actuator.trntype == mujoco.mjtTrn.mjTRN_JOINT and actuator.target in robot.joint_names:
            spec.delete(actuator)
    for key in list(spec.keys):
        spec.delete(key)  # of another number of controls
    for name, stiffness, damping in zip(robot.joint_names, servo.stiffness, servo.damping, strict=True):
        gain, bias = np.zeros(10), np.zeros(10)
        gain[0] = {"position": stiffness, "velocity": damping, "torque": 1.0}[servo.kind]
        if servo.kind != "torque":
            bias[1:3] = -stiffness, -damping
        spec.add_actuator(
            target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT, gaintype=mujoco.mjtGain.mjGAIN_FIXED,
            biastype=mujoco.mjtBias.mjBIAS_AFFINE, gainprm=gain, biasprm=bias,
        )  # fmt: skip
    if servo.compensated:
        for body in spec.bodies[1:]:
            body.gravcomp = 1.0
    try:
        return spec.compile()
    except ValueError as problem:  # missing meshes, which kinematics do without
        cure = "put its meshes where it says, or give the robot by URDF"
        raise RobotFileError(file, f"is no MJCF that MuJoCo runs ({problem})", cure) from None
