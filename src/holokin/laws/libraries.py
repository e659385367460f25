"""pink, mink and placo as controllers: the libraries themselves, run as their users run them.

Each takes the wanted pose at the end of the step as its target, solves its quadratic programme and answers with
the joint rates. The kinematics are handed over as text (`to_urdf`, `to_mjcf`), so all run on the same arm.
A posture cost of 0 leaves the redundant joint to the library.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MissingExtraError
from ..motion.control_law import ControlLaw, Law
from ..robot import Robot, to_mjcf, to_urdf
from ..types import ArrayLike, Matrix, Vector


@dataclass(frozen=True)
class PostureTask:
    """What users give these libraries: a preferred posture (that of the start if None), its cost and its gain.

    gain and the tool task's own are shares of the error removed in one step, as in pink and mink.
    """

    cost: float = 0.0
    gain: float = 1.0
    preferred: tuple[float, ...] | None = None


def pink_law(
    robot: Robot, posture: PostureTask = PostureTask(), *, gain: float = 1.0, solver: str = "quadprog",
    damping: float = 1e-12, name: str | None = None,
) -> ControlLaw:  # fmt: skip
    """pink's solve_ik with a frame task on the robot's first tip, and a posture task if it costs something.

    Raises: MissingExtraError.
    """
    pink, pin = _extra("pink", "pin-pink", "pink"), _extra("pinocchio", "pin-pink", "pink")
    with _urdf_file(robot) as path:
        model = pin.buildModelFromUrdf(path)
    order = np.array([model.joints[model.getJointId(joint)].idx_v for joint in robot.joint_names])
    places = [model.joints[model.getJointId(joint)] for joint in robot.joint_names]

    def full(q: Vector) -> Vector:
        out = pin.neutral(model)
        for value, joint in zip(q, places, strict=True):
            out[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
        return out

    def begin(q0: Vector) -> Law:
        data = model.createData()
        tool = pink.tasks.FrameTask(robot.tips[0].name, position_cost=1.0, orientation_cost=1.0, gain=gain)
        tasks = [tool]
        if posture.cost > 0:
            rest = pink.tasks.PostureTask(cost=posture.cost, gain=posture.gain)
            rest.set_target(full(_preferred(posture, q0)))
            tasks.append(rest)

        def law(q: Vector, pose: Matrix, twist: Vector, dt: float) -> Vector:
            configuration = pink.Configuration(model, data, full(q))
            tool.set_target(pin.SE3(pose[:3, :3], pose[:3, 3]))
            v = pink.solve_ik(configuration, tasks, dt, solver=solver, damping=damping, safety_break=False)
            return v[order]

        return law

    return ControlLaw(name or _label("pink", posture), begin)


def mink_law(
    robot: Robot, posture: PostureTask = PostureTask(), *, gain: float = 1.0, solver: str = "daqp",
    damping: float = 1e-12, name: str | None = None,
) -> ControlLaw:  # fmt: skip
    """mink's solve_ik with a frame task on a site at the robot's first tip, and a posture task if it costs something.

    Raises: MissingExtraError.
    """
    mink, mujoco = _extra("mink", "mink", "mink"), _extra("mujoco", "mink", "mink")
    model = mujoco.MjModel.from_xml_string(to_mjcf(robot))
    order = np.array([model.joint(joint).dofadr[0] for joint in robot.joint_names])
    places = np.array([model.joint(joint).qposadr[0] for joint in robot.joint_names])

    def full(q: Vector) -> Vector:
        out = np.zeros(model.nq)
        out[places] = q
        return out

    def begin(q0: Vector) -> Law:
        configuration = mink.Configuration(model)
        tool = mink.FrameTask(robot.tips[0].name, "site", position_cost=1.0, orientation_cost=1.0, gain=gain)
        tasks = [tool]
        if posture.cost > 0:
            rest = mink.PostureTask(model, cost=posture.cost, gain=posture.gain)
            rest.set_target(full(_preferred(posture, q0)))
            tasks.append(rest)

        def law(q: Vector, pose: Matrix, twist: Vector, dt: float) -> Vector:
            configuration.update(full(q))
            tool.set_target(mink.SE3.from_matrix(pose))
            return mink.solve_ik(configuration, tasks, dt, solver=solver, damping=damping)[order]

        return law

    return ControlLaw(name or _label("mink", posture), begin)


def placo_law(robot: Robot, posture: PostureTask = PostureTask(), *, name: str | None = None) -> ControlLaw:
    """placo's KinematicsSolver with a soft frame task on the robot's first tip, and a soft joints task as posture.

    A step goes all the way to the target, as placo's do. Raises: MissingExtraError.
    """
    placo = _extra("placo", "placo", "placo")

    def begin(q0: Vector) -> Law:
        with _urdf_file(robot) as path:
            wrapper = placo.RobotWrapper(path, placo.Flags.ignore_collisions)
        solver = placo.KinematicsSolver(wrapper)
        solver.mask_fbase(True)
        tool = solver.add_frame_task(robot.tips[0].name, np.eye(4))
        tool.configure("tool", "soft", 1.0, 1.0)
        if posture.cost > 0:
            rest = solver.add_joints_task()
            wish = _preferred(posture, q0)
            rest.set_joints({joint: float(v) for joint, v in zip(robot.joint_names, wish, strict=True)})
            rest.configure("posture", "soft", posture.cost)

        def law(q: Vector, pose: Matrix, twist: Vector, dt: float) -> Vector:
            for joint, value in zip(robot.joint_names, q, strict=True):
                wrapper.set_joint(joint, float(value))
            wrapper.update_kinematics()
            solver.dt = dt
            tool.T_world_frame = pose
            solver.solve(True)
            wrapper.update_kinematics()
            return (np.array([wrapper.get_joint(joint) for joint in robot.joint_names]) - q) / dt

        return law

    return ControlLaw(name or _label("placo", posture), begin)


def _preferred(posture: PostureTask, q0: Vector) -> Vector:
    wish: ArrayLike = q0 if posture.preferred is None else np.asarray(posture.preferred, dtype=float)
    return np.asarray(wish, dtype=float)


def _label(library: str, posture: PostureTask) -> str:
    return library if posture.cost == 0 else f"{library}, posture cost {posture.cost:g}"


@contextlib.contextmanager
def _urdf_file(robot: Robot) -> Iterator[str]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot.urdf"
        path.write_text(to_urdf(robot), "utf-8")
        yield str(path)


def _extra(module: str, package: str, extra: str) -> Any:
    """An optional library. Raises: MissingExtraError."""
    try:
        with Path(os.devnull).open("w") as nothing, contextlib.redirect_stdout(nothing):  # some print when imported
            return importlib.import_module(module)
    except ImportError:
        raise MissingExtraError(package, extra) from None
