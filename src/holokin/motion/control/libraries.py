"""pink, mink and placo as control laws: the libraries themselves, run as their own examples run them.

Each takes the wanted pose at the end of the step as its target, solves its quadratic programme and answers with
the joint rates. The kinematics are handed over as text (`to_urdf`, `to_mjcf`), so all run on the same arm.
A posture cost of 0 leaves the redundant joint to the library. A run has one configuration, which each step updates.
"""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...base.arguments import typed
from ...base.shown import Shown
from ...base.types import Matrix, Vector
from ...robot import Robot, to_mjcf, to_urdf
from ...robot.model_joints import mujoco_joints, pinocchio_joints
from ...strategies import HolonomicStrategy
from .control_law import ControlLaw, Step
from .extra_library import extra
from .leaf_tasks import mink_task, pink_task


@dataclass(frozen=True)
class PostureTask(Shown):
    """What users give these libraries: a preferred posture (that of the start if None), its cost and its gain.

    gain and the tool task's own are shares of the error removed in one step, as in pink and mink.
    """

    cost: float = 0.0
    gain: float = 1.0
    preferred: tuple[float, ...] | None = None

    def target(self, q0: Vector) -> Vector:
        """The posture (n,) that it prefers in a run from q0."""
        return np.asarray(q0 if self.preferred is None else self.preferred, dtype=float)


@typed
def pink_law(
    robot: Robot, posture: PostureTask = PostureTask(), *, leaf: HolonomicStrategy | None = None, gain: float = 1.0,
    solver: str = "quadprog", damping: float = 1e-12, limits: bool = True, name: str | None = None,
) -> ControlLaw:  # fmt: skip
    """pink's solve_ik with a frame task on the robot's first tip, and a posture task if it costs something.

    Args:
        leaf: a strategy whose leaf through the start of a run is held by an equality constraint, `pink_task`.
        limits: pink's own default, limits of position and speed; False for none.

    Raises:
        MissingExtraError: pink is not installed.
    """
    pink, pin = extra("pink", "pin-pink", "pink"), extra("pinocchio", "pin-pink", "pink")
    with _urdf_file(robot) as path:
        model = pin.buildModelFromUrdf(path)
    joints = pinocchio_joints(model, robot.joint_names)

    def full(q: Vector) -> Vector:
        return joints.write(q, pin.neutral(model))

    def begin(q0: Vector) -> Step:
        configuration = pink.Configuration(model, model.createData(), full(q0), copy_data=False)
        tool = pink.tasks.FrameTask(robot.tips[0].name, position_cost=1.0, orientation_cost=1.0, gain=gain)
        tasks = [tool]
        if posture.cost > 0:
            rest = pink.tasks.PostureTask(cost=posture.cost, gain=posture.gain)
            rest.set_target(full(posture.target(q0)))
            tasks.append(rest)
        options = {"solver": solver, "damping": damping, "limits": None if limits else [], "safety_break": False}
        if leaf is not None:
            options["constraints"] = [pink_task(leaf, q0)]

        def step(q: Vector, pose: Matrix, twist: Vector, dt: float) -> Vector:
            configuration.update(full(q))
            tool.set_target(pin.SE3(pose[:3, :3], pose[:3, 3]))
            return pink.solve_ik(configuration, tasks, dt, **options)[joints.columns]

        return step

    return ControlLaw(name or _label("pink", posture, leaf, limits), begin)


@typed
def mink_law(
    robot: Robot, posture: PostureTask = PostureTask(), *, leaf: HolonomicStrategy | None = None, gain: float = 1.0,
    solver: str = "daqp", damping: float = 1e-12, limits: bool = True, name: str | None = None,
) -> ControlLaw:  # fmt: skip
    """mink's solve_ik with a frame task on a site at the robot's first tip, and a posture task if it costs something.

    Args:
        leaf: a strategy whose leaf through the start of a run is held by an equality constraint, `mink_task`.
        limits: mink's own default, limits of position; False for none.

    Raises:
        MissingExtraError: mink is not installed.
    """
    mink, mujoco = extra("mink", "mink", "mink"), extra("mujoco", "mink", "mink")
    model = mujoco.MjModel.from_xml_string(to_mjcf(robot))
    joints = mujoco_joints(model, robot.joint_names)

    def full(q: Vector) -> Vector:
        return joints.write(q, np.zeros(model.nq))

    def begin(q0: Vector) -> Step:
        configuration = mink.Configuration(model)
        tool = mink.FrameTask(robot.tips[0].name, "site", position_cost=1.0, orientation_cost=1.0, gain=gain)
        tasks = [tool]
        if posture.cost > 0:
            rest = mink.PostureTask(model, cost=posture.cost, gain=posture.gain)
            rest.set_target(full(posture.target(q0)))
            tasks.append(rest)
        options = {"solver": solver, "damping": damping, "limits": None if limits else []}
        if leaf is not None:
            options["constraints"] = [mink_task(leaf, q0)]

        def step(q: Vector, pose: Matrix, twist: Vector, dt: float) -> Vector:
            configuration.update(full(q))
            tool.set_target(mink.SE3.from_matrix(pose))
            return mink.solve_ik(configuration, tasks, dt, **options)[joints.columns]

        return step

    return ControlLaw(name or _label("mink", posture, leaf, limits), begin)


@typed
def placo_law(
    robot: Robot, posture: PostureTask = PostureTask(), *, limits: bool = True, name: str | None = None
) -> ControlLaw:
    """placo's KinematicsSolver with a soft frame task on the robot's first tip, and a soft joints task as posture.

    A step goes all the way to the target, as placo's do.

    Args:
        limits: placo's own default, limits of position; False for none.

    Raises:
        MissingExtraError: placo is not installed.
    """
    placo = extra("placo", "placo", "placo")

    def begin(q0: Vector) -> Step:
        with _urdf_file(robot) as path:
            wrapper = placo.RobotWrapper(path, placo.Flags.ignore_collisions)
        solver = placo.KinematicsSolver(wrapper)
        solver.mask_fbase(True)
        solver.enable_joint_limits(limits)
        tool = solver.add_frame_task(robot.tips[0].name, np.eye(4))
        tool.configure("tool", "soft", 1.0, 1.0)
        if posture.cost > 0:
            rest = solver.add_joints_task()
            target = posture.target(q0).tolist()
            rest.set_joints(dict(zip(robot.joint_names, target, strict=True)))
            rest.configure("posture", "soft", posture.cost)

        def step(q: Vector, pose: Matrix, twist: Vector, dt: float) -> Vector:
            for joint, value in zip(robot.joint_names, q, strict=True):
                wrapper.set_joint(joint, float(value))
            wrapper.update_kinematics()
            solver.dt = dt
            tool.T_world_frame = pose
            solver.solve(True)
            wrapper.update_kinematics()
            return (np.array([wrapper.get_joint(joint) for joint in robot.joint_names]) - q) / dt

        return step

    return ControlLaw(name or _label("placo", posture, None, limits), begin)


@dataclass(frozen=True)
class Library:
    """A law of a robot and a posture task, and the package that has the library; the extra is named like its module."""

    law: Callable[..., ControlLaw]
    package: str


LIBRARIES = {
    "pink": Library(pink_law, "pin-pink"), "mink": Library(mink_law, "mink"), "placo": Library(placo_law, "placo"),
}  # fmt: skip
"""By the names of their modules, which are kinds of law of a survey."""


def _label(library: str, posture: PostureTask, leaf: HolonomicStrategy | None, limits: bool) -> str:
    cost = f", posture cost {posture.cost:g}" if posture.cost else ""
    held = f", leaf of {leaf.name}" if leaf is not None else ""
    return f"{library}{cost}{held}{'' if limits else ', no limits'}"


@contextlib.contextmanager
def _urdf_file(robot: Robot) -> Iterator[str]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot.urdf"
        path.write_text(to_urdf(robot), "utf-8")
        yield str(path)
