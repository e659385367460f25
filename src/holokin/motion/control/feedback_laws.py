"""The laws of the textbooks that are not of the form dq = G(q) x' (3), each under its own name.

All follow the wanted pose with feedback: u = x' + K e, K [1/s] `gain`, e the task error to the pose wanted now.
With gain 1/dt a step goes all the way to the pose wanted at its end. Gains are not negative; every law takes a `name`.
"""

from __future__ import annotations

import numpy as np

from ...base.arguments import made
from ...base.errors import InfeasibleError, ShapeError
from ...base.types import ArrayLike, Matrix, Vector, finite, frozen, not_negative, numbers
from ...strategies import Strategy, holonomic
from ...strategies.constraints import Constraint, Cost
from ...strategies.tasks.task import Task
from ...symbolic import SX, NearestPoint, Solution, factorise, jacobian, least_norm, vec, vertcat
from ...symbolic.null_space import null_space_expression
from .control_law import ControlLaw, Step, Symbols, compiled, feedback

GAIN = 10.0
"""Default K [1/s]: an error halves in 0.07 s, and steps up to 0.1 s are far from unstable."""


@made
def closed_loop(strategy: Strategy, gain: float = GAIN, *, name: str | None = None) -> ControlLaw:
    """dq = G (x' + K e): closed-loop inverse kinematics of any strategy. [Sic90]"""
    K = not_negative("gain", gain)
    label = f"closed loop, {strategy.name}" if name is None else name
    looped = strategy.looped
    return compiled(label, strategy.task, lambda s: feedback(looped, s.dx, s.error, K), looped)


@made
def damped(task: Task, damping: float = 0.05, gain: float = GAIN, *, name: str = "damped least squares") -> ControlLaw:
    """dq = J^T (J J^T + damping^2)^-1 (x' + K e): bounded at singularities, where the tool lags. [NH86], [Wam86]

    Args:
        damping: in the units of J's singular values; against which metres and radians count alike.
    """
    K, size = not_negative("gain", gain), not_negative("damping", damping)

    def rate(s: Symbols) -> Solution:
        # least squares of [J; damping] dq = [u; 0], without squaring J
        tall = factorise(vertcat(s.J, size * SX.eye(task.n)))
        return Solution(tall.solve(vertcat(s.dx + K * s.error, SX.zeros(task.n, 1))), SX(1))

    return compiled(name, task, rate)


@made
def gradient_projection(
    task: Task, cost: Cost, weight: float = 1.0, gain: float = GAIN, *, name: str = "gradient projection"
) -> ControlLaw:
    """dq = J^+ (x' + K e) - weight (1 - J^+ J) grad U: the posture task of most libraries. [Lie77]

    It repeats after a while, but which joints belong to a pose depends on the way and the speed.

    Args:
        cost: U, for instance `posture_cost(q_preferred)`.
        weight: [1/s] of a cost in joint units squared.
    """
    K = not_negative("gain", gain)

    def rate(s: Symbols) -> Solution:
        U = cost.expression(task, s.kinematics, s.q)
        if U.shape != (1, 1):
            raise ShapeError(f"the cost {cost.name!r}", (1, 1), U.shape, "give a scalar")
        return _projected(s, K, -weight * jacobian(U, s.q).T)

    return compiled(name, task, rate)


@made
def repetitive_motion(
    task: Task, rate: float = 1.0, gain: float = GAIN, *, limits: bool = False, name: str = "repetitive motion"
) -> ControlLaw:
    """The minimum of 1/2 |dq + rate (q - q(0))|^2 on J dq = x' + K e: repetitive motion planning. [ZWX03, ZZ11]

    Without limits it is dq = J^+ (x' + K e) - rate (1 - J^+ J)(q - q(0)), gradient projection on the posture that
    the run began with. The error of closing a loop falls with rate^-2 (theory 2g).

    Args:
        rate: [1/s].
        limits: keep joint speeds, and positions one step ahead, within the robot's limits, by a quadratic programme.

    Raises:
        InfeasibleError (when it runs, with limits): no joint rates within the limits follow the path.
    """
    K, pull = not_negative("gain", gain), not_negative("rate", rate)
    if not limits:
        return compiled(name, task, lambda s: _projected(s, K, -pull * (s.q - s.q0)))
    wanted = compiled(name, task, lambda s: Solution(vertcat(s.dx + K * s.error, vec(s.J)), SX(1)))
    nearest, robot = NearestPoint(task.n, task.m), task.robot

    def begin(q0: Vector) -> Step:
        ask = wanted.begin(q0)

        def step(q: Vector, pose: Matrix, twist: Vector, dt: float) -> Vector:
            values = ask(q, pose, twist, dt)
            u, J = values[: task.m], values[task.m :].reshape(task.n, task.m).T
            lower = np.maximum(-robot.max_velocity, (robot.lower - q) / dt)
            upper = np.minimum(robot.max_velocity, (robot.upper - q) / dt)
            dq = nearest(-pull * (q - q0), J, u, np.minimum(lower, upper), np.maximum(lower, upper))
            if dq is None:
                raise InfeasibleError(name, q)
            return dq

        return step

    return ControlLaw(name, begin)


@made
def asymptotically_cyclic(
    task: Task,
    g: Constraint,
    level: ArrayLike,
    constraint_gain: float = 1.0,
    gain: float = GAIN,
    *,
    exact: bool = True,
    name: str = "asymptotically cyclic",
) -> ControlLaw:
    """[J; J_g] dq = [x' + K e; -K_g (g(q) - leaf)]: cyclic once on the leaf, which it nears as e^(-K_g t). [DLO92]

    Args:
        g: constraint of r = n - m rows.
        level: the level (r,) of g to converge to.
        constraint_gain: K_g [1/s].
        exact: False for dq = J^+ (x' + K e) - K_g N (J_g N)^-1 (g - leaf), which converges only to O(1/K_g).

    Raises:
        ConstraintRowsError: g has not r rows. ShapeError: the leaf has not.
    """
    K, K_g = not_negative("gain", gain), not_negative("constraint_gain", constraint_gain)
    strategy = holonomic(task, g).looped
    c = frozen(finite("the leaf", np.atleast_1d(numbers("the leaf", level)), (g.rows,), "give one for each row of g"))

    def rate(s: Symbols) -> Solution:
        if exact:
            return feedback(strategy, s.dx, s.error, K, SX(c), K_g)
        N = null_space_expression(s.J)
        least = least_norm(s.J, s.dx + K * s.error)
        back = K_g * strategy.leaf_gap(SX(c))
        return least._replace(X=least.X + N @ factorise(strategy.expressions.planes @ N).solve(back))

    return compiled(name, task, rate, strategy)


def _projected(s: Symbols, K: float, z: SX) -> Solution:
    """J^+ (x' + K e - J z) + z, which is J^+ (x' + K e) + (1 - J^+ J) z."""
    least = least_norm(s.J, s.dx + K * s.error - s.J @ z)
    return least._replace(X=least.X + z)
