"""pink, mink and placo as control laws: the libraries themselves, run as their own examples run them.

Each takes the wanted pose at the end of the step as its target, solves its quadratic programme and answers with
the joint rates. The kinematics are handed over as text (`to_urdf`, `to_mjcf`), so all run on the same arm.
A posture cost of 0 leaves the redundant joint to the library. A run has one configuration, which each step updates.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, ShapeError
from ...base.extra_module import extra_module
from ...base.types import ArrayLike, Matrix, Shown, Vector, finite, number
from ...robot import Robot, start_posture, to_mjcf, to_urdf
from ...robot.model import ModelJoints, mujoco_joints, pinocchio_joints, places_in
from ...strategies import HolonomicStrategy
from ..ik.leaf import leaf_value
from .control_law import ControlLaw, Step


def extra(module: str, package: str, name: str) -> Any:
    """An optional library, by the extra that has it. Raises: MissingExtraError."""
    with Path(os.devnull).open("w") as nothing, contextlib.redirect_stdout(nothing):  # some print when imported
        return extra_module(module, name, package)


# --- The leaf of a holonomic strategy as a task of pink and of mink: error g(q) - c, Jacobian dg/dq.
#
# As an equality constraint, A dq = b with A = J_g and b = -gain (g(q) - c), it takes the redundant joints out of the
# quadratic programme: what remains of it is the tool.


class LeafTask:
    """What the tasks for pink and mink have in common: they are one, and a task of their library, too.

    Attributes:
        strategy: whose leaf is held. level: c (r,) of the leaf g(q) = c, set to hold another one.
        cost, gain, lm_damping: of the library, cost one number a row.
    """

    strategy: HolonomicStrategy
    level: Vector
    cost: Any
    gain: float
    lm_damping: float
    _model: Any
    _joints: ModelJoints | None

    def _hold(self, strategy: HolonomicStrategy, q0: Vector, prefix: str, names: Sequence[str] | None) -> None:
        self.strategy, self.level = strategy, leaf_value(strategy, q0)
        self._near, self._prefix, self._names = q0, prefix, names
        self._model, self._joints = None, None  # of the last call

    def compute_error(self, configuration: Any) -> Vector:
        """e(q) = g(q) - c (r,), its angles in (-pi, pi].

        Raises:
            NotFiniteError: g is not finite there. UnknownNameError, ArgumentError: the model lacks a joint.
        """
        q, _ = self._posture(configuration)
        return self.strategy.constraint.nearest(self.strategy.g(q) - self.level)

    def compute_jacobian(self, configuration: Any) -> Matrix:
        """dg/dq (r, nv), zero for the joints of the model that the robot has not. Raises: as `compute_error`."""
        q, joints = self._posture(configuration)
        J = np.zeros((len(self.level), joints.velocities))
        J[:, joints.columns] = self.strategy.rows(q)
        return J

    def set_target_from_configuration(self, configuration: Any) -> None:
        """Hold the leaf on which a configuration of the library lies."""
        self.level = leaf_value(self.strategy, self._posture(configuration)[0])

    def __repr__(self) -> str:
        name = type(self).__name__
        return f"{name}({self.strategy.name!r}, level={self.level.tolist()}, cost={self.cost}, gain={self.gain})"

    def _posture(self, configuration: Any) -> tuple[Vector, ModelJoints]:
        joints = self._joints
        if joints is None or configuration.model is not self._model:
            robot = self.strategy.task.robot
            joints = places_in(configuration.model, robot.joint_names, robot.hinges, self._prefix, self._names)
            self._joints = joints
            self._model = configuration.model
        self._near = q = joints.read(configuration.q, self._near)
        return q, joints


@typed
def pink_task(
    strategy: HolonomicStrategy,
    q0: ArrayLike,
    *,
    cost: ArrayLike = 1.0,
    gain: float = 1.0,
    lm_damping: float = 0.0,
    prefix: str = "",
    joints: Sequence[str] | None = None,
) -> Any:
    """The leaf of a strategy through a posture q0 as a `pink.tasks.Task`: e(q) = g(q) - g(q0), J = dg/dq.

    Give it to pink's `solve_ik` among the `constraints`, which then holds the leaf, or among the `tasks`, as a cost.
    Joints are found in the model by their names; it may have others, as fingers or a floating base, on which g does
    not depend. A joint that Pinocchio keeps as cosine and sine is read within half a turn of where it was last.

    Args:
        q0: posture (n,) of the strategy's robot, whose leaf is held.
        cost: weight among the tasks, a number or one a row (r,) [cost / unit of g]. Constraints have none.
        gain: share of the error that is removed in a step, 0 to 1; the first step of a constraint removes all with 1.
        lm_damping: of the library: more damping where the error is large.
        prefix: what stands before the robot's joint names in the model, as "left/".
        joints: the model's names of the robot's joints, in the robot's order, where they differ by more.

    Raises:
        MissingExtraError: pink is not installed. ArgumentError: a strategy without leaves, a bad cost, gain or name.
        ShapeError, NotFiniteError: start or cost.
        UnknownNameError (when called): the model has no joint of that name.
    """
    return _leaf_task("pink", strategy, q0, cost, gain, lm_damping, prefix, joints)


@typed
def mink_task(
    strategy: HolonomicStrategy,
    q0: ArrayLike,
    *,
    cost: ArrayLike = 1.0,
    gain: float = 1.0,
    lm_damping: float = 0.0,
    prefix: str = "",
    joints: Sequence[str] | None = None,
) -> Any:
    """The leaf of a strategy through a posture q0 as a `mink.Task`: e(q) = g(q) - g(q0), J = dg/dq.

    Give it to mink's `solve_ik` among the `constraints`, which then holds the leaf, or among the `tasks`, as a cost.
    Joints are found in the model by their names; it may have others, as fingers or a free joint, on which g does not
    depend.

    Args:
        q0, cost, gain, lm_damping, prefix, joints: as of `pink_task`.

    Raises:
        MissingExtraError: mink is not installed. Else as `pink_task`.
    """
    return _leaf_task("mink", strategy, q0, cost, gain, lm_damping, prefix, joints)


@cache
def _class_of(library: Literal["pink", "mink"]) -> Any:
    """The task of a library; made when asked for, since its parent is the library's."""
    module, package = {"pink": ("pink.tasks", "pin-pink"), "mink": ("mink", "mink")}[library]
    about = f"The leaf of a strategy as a task of {library}: see `holokin.{library}_task`."
    members = {"__doc__": about, "__module__": __name__}
    return type(f"{library.title()}LeafTask", (LeafTask, extra(module, package, library).Task), members)


def _leaf_task(
    library: Literal["pink", "mink"],
    strategy: HolonomicStrategy,
    q0: ArrayLike,
    cost: ArrayLike,
    gain: float,
    lm_damping: float,
    prefix: str,
    joints: Sequence[str] | None,
) -> Any:
    """The task of a library, of arguments as they must be."""
    robot, rows = strategy.task.robot, strategy.constraint.rows
    if not rows:
        raise ArgumentError("the strategy", strategy, "give one with redundant joints: here nothing is left to hold")
    q0 = start_posture(robot, q0, False)
    strategy(q0)
    names = None if joints is None else tuple(joints)
    if names is not None and len(names) != robot.n:
        cure = f"name all joints, in the robot's order: {', '.join(robot.joint_names)}"
        raise ShapeError("joints", (robot.n,), (len(names),), cure)
    weights = finite("cost", cost)
    if weights.shape not in ((), (rows,)):
        raise ShapeError("cost", f"() or ({rows},)", weights.shape)
    if (weights < 0).any():
        raise ArgumentError("cost", cost, "give numbers from 0 on")
    share, damping = number("gain", gain), number("lm_damping", lm_damping)
    if not 0 <= share <= 1:
        raise ArgumentError("gain", gain, "give the share of the error that is removed in a step, from 0 to 1")
    if not 0 <= damping < np.inf:
        raise ArgumentError("lm_damping", lm_damping, "give a number from 0 on")
    task = _class_of(library)(cost=np.broadcast_to(weights, rows).copy(), gain=share, lm_damping=damping)
    task._hold(strategy, q0, prefix, names)
    return task


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
    robot: Robot,
    posture: PostureTask = PostureTask(),
    *,
    leaf: HolonomicStrategy | None = None,
    gain: float = 1.0,
    solver: str = "quadprog",
    damping: float = 1e-12,
    limits: bool = True,
    name: str | None = None,
) -> ControlLaw:
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
        # The task of the tool, that of the posture, and the leaf as a constraint.
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
    robot: Robot,
    posture: PostureTask = PostureTask(),
    *,
    leaf: HolonomicStrategy | None = None,
    gain: float = 1.0,
    solver: str = "daqp",
    damping: float = 1e-12,
    limits: bool = True,
    name: str | None = None,
) -> ControlLaw:
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
        # The task of the tool, that of the posture, and the leaf as a constraint.
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
        # A solver with a fixed base, a task of the tool and one of the posture.
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

        # All the way to the target, and the rates that lead there.
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
    "pink": Library(pink_law, "pin-pink"),
    "mink": Library(mink_law, "mink"),
    "placo": Library(placo_law, "placo"),
}
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
