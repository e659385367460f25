"""`ControlLaw`: a law that runs in a loop and need not be of the form dq = G(q) dx (3).

It may have feedback, damping, a preferred posture, memory: whatever it is, it is called once a step with the
joints and the wanted motion of the tool, and answers with joint rates. Laws with feedback measure the error where the
tool is wanted now, see `tracking`, and those that hold a leaf share one equation, see `feedback`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, cast

import numpy as np

from ...base.arguments import Made, made, typed
from ...base.errors import ArgumentError, LimitReachedError, ShapeError, posture_text
from ...base.types import ArrayLike, Matrix, Value, Vector, finite, frozen, not_negative, numbers
from ...robot import Kinematics
from ...strategies import (
    HolonomicStrategy,
    NumericStrategy,
    Strategy,
    check_exact,
    check_regular,
    geometric_stiffness,
    gradient_and_stiffness,
    holonomic,
)
from ...strategies.constraints import Constraint, Cost
from ...strategies.tasks.task import Task, check_representation
from ...symbolic import (
    SX,
    Function,
    NearestPoint,
    Solution,
    factorise,
    jacobian,
    least_norm,
    runge_kutta,
    symbol,
    vec,
    vertcat,
)
from ...symbolic.linear import null_space_expression

Step = Callable[[Vector, Matrix, Vector, float], Vector]
"""(q, pose, twist, dt) -> dq, one step of a run of a control law.

q (n,): the joints now. pose (4, 4): where the tool is wanted at the end of the step. twist (6,): the constant twist
(linear first, base frame) that takes the wanted pose of now there. dt [s]: the step. dq (n,): joint rates over it.
Of a task of F > 1 frames poses are (F, 4, 4) and twists (F, 6).
"""


@dataclass(frozen=True, eq=False)
class ControlLaw(Made, Value):
    """A control law: `begin(q0)` starts a run of it at the posture q0 and returns the `Step` of that run.

    What a law remembers lives in its run, so every run begins afresh. `simulate` and `audit` take control laws;
    `controller` returns one that is compiled.
    """

    name: str
    begin: Callable[[Vector], Step]

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r})"


@typed
def as_control_law(thing: Any) -> ControlLaw:
    """A control law of what people have: a `ControlLaw`, a `Strategy` (dq = G x'), or a function (q, pose, twist, dt).

    A function is called as it is, in every run: what it remembers, it keeps from run to run.

    Raises:
        ArgumentError: none of these.
    """
    if isinstance(thing, ControlLaw):
        return thing
    if isinstance(thing, Strategy):
        return open_loop(thing)
    if callable(thing):
        step = cast(Step, thing)
        return ControlLaw(getattr(thing, "__name__", type(thing).__name__), lambda _q0: step)
    cure = "give a ControlLaw, a Strategy, or a function of (q, pose, twist, dt)"
    raise ArgumentError("the control law", thing, cure)


@dataclass(frozen=True, eq=False)
class Symbols:
    """What the expression of a law is made of.

    q (n,) and its kinematics and task Jacobian J (m, n); the wanted rate dx (m,) and the task error (m,) to the
    pose wanted now; the step dt [s]; the posture at which the run began, `start` (n,).
    """

    q: SX
    kinematics: Kinematics
    J: SX
    dx: SX
    error: SX
    dt: SX
    q0: SX


def wanted_symbols(task: Task) -> tuple[tuple[SX, SX], tuple[SX, SX, SX]]:
    """(pose, twist) as a control step takes them, and of these (p, R, twists) as `tracking` does.

    pose (4F, 4) and twist (6F,), one frame below the other; or both (point,), where the task has no orientation.
    """
    F, point = task.frames, task._point
    if task.orientation is not None:
        pose, twist = symbol("pose", 4 * F, 4), symbol("twist", 6 * F)
        p, R = (vertcat(*(pose[4 * f : 4 * f + 3, columns] for f in range(F))) for columns in (3, slice(3)))
        return (pose, twist), (p, R, twist)
    pose, twist, more = symbol("pose", point), symbol("twist", point), SX.zeros(3 * F - point, 1)
    v = vertcat(twist, more)
    twists = vertcat(*(vertcat(v[i : i + 3], SX.zeros(3, 1)) for i in range(0, 3 * F, 3)))
    return (pose, twist), (vertcat(pose, more), vertcat(*([SX.eye(3)] * F)), twists)


def tracking(task: Task, k: Kinematics, p: SX, R: SX, twist: SX, dt: SX) -> tuple[SX, SX]:
    """(x', e), both (m,): the wanted task rate, and the task error to where the tool is wanted now.

    It is wanted at the pose (p, R) after dt, and moves there with the twist (6,), so e = error to (p, R) - dt x'.
    """
    dx = task._rates_expression(R, *task._velocities(twist))
    return dx, task._error_expression(k, p, R) - dt * dx


def feedback(
    strategy: Strategy,
    dx: SX,
    error: SX,
    gain: SX | float,
    leaf: SX | None = None,
    constraint_gain: SX | float = 0.0,
    leaf_rate: SX | float | None = None,
) -> Solution:
    """dq of [J; J_g] dq = [x' + K e; c' - K_g (g(q) - c)], or of dq = G (x' + K e): feedback to the path and to a leaf.

    It serves the closed loop, the asymptotically cyclic law, the controller and the exported C.

    Args:
        dx, error: x' and e (m,), see `tracking`.
        gain: K [1/s].
        leaf: c (r,), of a strategy with a constraint g; None for no feedback to a leaf.
        constraint_gain: K_g [1/s].
        leaf_rate: c' (r,), None for a leaf that stays.

    Returns:
        dq (n,) with its rcond.
    """
    u = dx + gain * error
    if leaf is None:
        return strategy.expressions.rate(u)
    if not isinstance(strategy, HolonomicStrategy):
        raise ArgumentError("the strategy", strategy, HolonomicStrategy.cure)
    back = constraint_gain * strategy.leaf_gap(leaf)
    return strategy.expressions.rate(u, back if leaf_rate is None else leaf_rate + back)


def compiled(
    name: str, task: Task, rate: Callable[[Symbols], Solution], strategy: Strategy | None = None
) -> ControlLaw:
    """A control law from an expression of its rates, compiled when first begun.

    Args:
        rate: symbols -> dq (n,) with its rcond, 1 where nothing can be singular.
        strategy: the one whose expressions `rate` uses, if any.
    """

    @cache
    def function() -> Function:
        q = symbol("q", task.n) if strategy is None else strategy.expressions.q
        k = task.kinematics(q)
        p, R = task._target_symbols()
        twist, dt, start = symbol("twist", 6 * task.frames), symbol("dt", 1), symbol("start", task.n)
        dx, error = tracking(task, k, p, R, twist, dt)
        solution = rate(Symbols(q, k, task.jacobian_expression(k, q), dx, error, dt, start))
        margin = task._margin_expression(k.rotation) if strategy is None else strategy._margin_expression
        inputs = {"q": q, "p": p, "R": R, "twist": twist, "dt": dt, "start": start}
        outputs = {"dq": solution.X, "rcond": solution.rcond, "margin": margin}
        return Function("law", inputs, outputs, solution.system, None if strategy is None else strategy.transport)

    def begin(q0: Vector) -> Step:
        rates = function()

        def step(q: Vector, pose: Matrix, twist: Vector, dt: float) -> Vector:
            dq, rcond, margin = rates(q, *task.target(pose), twist.ravel(), np.array([dt]), q0)
            check_regular(task, name, q, rcond, margin)
            return dq

        return step

    return ControlLaw(name, begin)


@typed
def open_loop(strategy: Strategy) -> ControlLaw:
    """dq = G(q) x': a strategy as it stands, without feedback. [ZR11, (3)]"""
    if isinstance(strategy, NumericStrategy):
        return ControlLaw(strategy.name, lambda _q0: partial(_numeric_step, strategy))
    looped = strategy.looped
    return compiled(strategy.name, strategy.task, lambda s: looped.expressions.rate(s.dx), looped)


def _numeric_step(strategy: NumericStrategy, q: Vector, pose: Matrix, twist: Vector, dt: float) -> Vector:
    """dq = G(q) x' of a strategy that is a Python function."""
    task = strategy.task
    _, R = task.target(pose)
    each = twist.reshape(task.frames, 2, 3)
    dx, margin = task._tool_rates(R[None], each[:, 0].reshape(1, -1), each[:, 1].reshape(1, -1))
    check_representation(task, q, float(margin[0]))
    return strategy(q) @ dx[0]


@made
def impedance_with_memory(
    task: Task, potential: Cost, force: ArrayLike | None = None, *, name: str = "impedance with memory"
) -> ControlLaw:
    """dq = W(F) J^T F', F' = (J W(F) J^T)^-1 x', W(F) = (K - Gamma(F))^-1: variant (iii) of theory 2d.

    The force F at the tool is carried along. tau_0 = grad U - J^T F never changes, so the law is the extended Jacobian
    of the potential U - tau_0 . q: it is holonomic from every start, but which leaves it has depends on the start.
    Each step is one Runge-Kutta step of order 4 of (q, F).

    Args:
        potential: U with Hess U = K.
        force: F (m,) at the start of every run; zero by default.

    Raises:
        ArgumentError: a task whose J is not df/dq (a twist). ShapeError: the force has not m entries.
    """
    check_exact(task)
    force_at_start = np.zeros(task.m) if force is None else frozen(finite("the force", force, (task.m,)))

    @cache
    def compiled_functions() -> tuple[Function, Function]:
        # dq and F' of the springs under a force, as one function.
        q, F, dx = symbol("q", task.n), symbol("F", task.m), symbol("dx", task.m)
        k = task.kinematics(q)
        J = task.jacobian_expression(k, q)
        stiffness = gradient_and_stiffness(task, k, q, potential)[1] - geometric_stiffness(task, k, q)(q, F)
        extended = factorise(vertcat(J, null_space_expression(J).T @ stiffness))
        dq = extended.solve(vertcat(dx, SX.zeros(task.n - task.m, 1)))
        dF = factorise(J.T).solve(stiffness @ dq)  # J^T F' = (K - Gamma) dq, since tau_0 stays
        outputs = {"dq": dq, "dF": dF, "rcond": extended.rcond(), "margin": task._margin_expression(k.rotation)}
        R, twist = task._target_symbols()[1], symbol("twist", 6 * task.frames)
        rates = {"dx": task._rates_expression(R, *task._velocities(twist))}
        task_rates = Function("task_rates", {"R": R, "twist": twist}, rates)
        return Function("impedance", {"q": q, "F": F, "dx": dx}, outputs), task_rates

    def begin(q0: Vector) -> Step:
        flow, task_rates = compiled_functions()
        F = force_at_start.copy()

        def step(q: Vector, pose: Matrix, twist: Vector, dt: float) -> Vector:
            nonlocal F

            def slope(y: Vector, dx: Vector) -> Vector:  # of y = (the motion since the start of the step, force)
                posture = q + y[: task.n]
                dq, dF, rcond, margin = flow(posture, y[task.n :], dx)
                check_regular(task, name, posture, rcond, margin)
                return np.append(dq, dF)

            # x' is held over the step, so it is the same at its three places.
            _, R = task.target(pose)
            dx = np.atleast_1d(task_rates(R, twist.ravel()))
            y = runge_kutta(slope, np.append(np.zeros(task.n), F), dt, dx, dx, dx)
            F = y[task.n :]
            return y[: task.n] / dt

        return step

    return ControlLaw(name, begin)


# --- The laws of the textbooks that are not of the form dq = G(q) x' (3), each under its own name.
#
# All follow the wanted pose with feedback: u = x' + K e, K [1/s] `gain`, e the task error to the pose wanted now. With
# gain 1/dt a step goes all the way to the pose wanted at its end. Gains are not negative; every law takes a `name`.

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
        LimitReachedError (when it runs, with limits): no joint rates within the limits follow the path.
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
                raise LimitReachedError(
                    f"{name}: at q = {posture_text(q)} no joint rates within the limits follow the path",
                    "go slower, or choose another start or path",
                )
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
        RowsError: g has not r rows. ShapeError: the leaf has not.
    """
    K, K_g = not_negative("gain", gain), not_negative("constraint_gain", constraint_gain)
    strategy = holonomic(task, g).looped
    c = frozen(finite("the leaf", np.atleast_1d(numbers("the leaf", level)), (g.rows,), "give one for each row of g"))

    def rate(s: Symbols) -> Solution:
        if exact:
            return feedback(strategy, s.dx, s.error, K, SX(c), K_g)
        N = null_space_expression(s.J)
        minimum_norm = least_norm(s.J, s.dx + K * s.error)
        back = K_g * strategy.leaf_gap(SX(c))
        return minimum_norm._replace(X=minimum_norm.X + N @ factorise(strategy.expressions.planes @ N).solve(back))

    return compiled(name, task, rate, strategy)


def _projected(s: Symbols, K: float, z: SX) -> Solution:
    """J^+ (x' + K e - J z) + z, which is J^+ (x' + K e) + (1 - J^+ J) z."""
    minimum_norm = least_norm(s.J, s.dx + K * s.error - s.J @ z)
    return minimum_norm._replace(X=minimum_norm.X + z)
