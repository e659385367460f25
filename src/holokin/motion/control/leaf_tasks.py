"""The leaf of a holonomic strategy as a task of pink and of mink: error g(q) - c, Jacobian dg/dq.

As an equality constraint, A dq = b with A = J_g and b = -gain (g(q) - c), it takes the redundant joints out of the
quadratic programme: what remains of it is the tool.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, ShapeError
from ...base.types import ArrayLike, Matrix, Vector, finite, number
from ...robot import start_posture
from ...robot.model_joints import ModelJoints, places_in
from ...strategies import HolonomicStrategy
from ..ik.leaf import leaf_value
from .extra_library import extra


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
    strategy: HolonomicStrategy, q0: ArrayLike, *, cost: ArrayLike = 1.0, gain: float = 1.0, lm_damping: float = 0.0,
    prefix: str = "", joints: Sequence[str] | None = None,
) -> Any:  # fmt: skip
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
    made = _checked(strategy, q0, cost, gain, lm_damping, joints)
    return _class_of("pink", "pin-pink", "pink.tasks")(strategy, prefix, *made)


@typed
def mink_task(
    strategy: HolonomicStrategy, q0: ArrayLike, *, cost: ArrayLike = 1.0, gain: float = 1.0, lm_damping: float = 0.0,
    prefix: str = "", joints: Sequence[str] | None = None,
) -> Any:  # fmt: skip
    """The leaf of a strategy through a posture q0 as a `mink.Task`: e(q) = g(q) - g(q0), J = dg/dq.

    Give it to mink's `solve_ik` among the `constraints`, which then holds the leaf, or among the `tasks`, as a cost.
    Joints are found in the model by their names; it may have others, as fingers or a free joint, on which g does not
    depend.

    Args:
        q0, cost, gain, lm_damping, prefix, joints: as of `pink_task`.

    Raises:
        MissingExtraError: mink is not installed. Else as `pink_task`.
    """
    made = _checked(strategy, q0, cost, gain, lm_damping, joints)
    return _class_of("mink", "mink", "mink")(strategy, prefix, *made)


@cache
def _class_of(library: str, package: str, module: str) -> Any:
    """The task of a library; made when asked for, since its parent is the library's."""
    parent = extra(module, package, library).Task

    def init(
        self: Any, strategy: HolonomicStrategy, prefix: str, q0: Vector, names: Sequence[str] | None, cost: Vector,
        gain: float, lm_damping: float,
    ) -> None:  # fmt: skip
        parent.__init__(self, cost=cost, gain=gain, lm_damping=lm_damping)
        self._hold(strategy, q0, prefix, names)

    about = f"The leaf of a strategy as a task of {library}: see `holokin.{library}_task`."
    members = {"__init__": init, "__doc__": about, "__module__": __name__}
    return type(f"{library.title()}LeafTask", (LeafTask, parent), members)


def _checked(
    strategy: HolonomicStrategy, q0: ArrayLike, cost: ArrayLike, gain: float, lm_damping: float,
    joints: Sequence[str] | None,
) -> tuple[Vector, tuple[str, ...] | None, Vector, float, float]:  # fmt: skip
    """(start, names, cost, gain, damping) as they must be."""
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
    return q0, names, np.broadcast_to(weights, rows).copy(), share, damping
