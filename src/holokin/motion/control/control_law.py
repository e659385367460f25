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

from ...base.arguments import Made, typed
from ...base.errors import ArgumentError
from ...base.types import Matrix, Value, Vector
from ...robot import Kinematics
from ...strategies import HolonomicStrategy, NumericStrategy, Strategy, check_regular
from ...strategies.tasks.task import Task, check_representation
from ...symbolic import SX, Function, Solution, symbol, vertcat

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
    F, point = task.frames, task.point
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
    dx = task.rates_expression(R, *task.velocities(twist))
    return dx, task.error_expression(k, p, R) - dt * dx


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
    name: str,
    task: Task,
    rate: Callable[[Symbols], Solution],
    strategy: Strategy | None = None,
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
        p, R = task.target_symbols()
        twist, dt, start = symbol("twist", 6 * task.frames), symbol("dt", 1), symbol("start", task.n)
        dx, error = tracking(task, k, p, R, twist, dt)
        found = rate(Symbols(q, k, task.jacobian_expression(k, q), dx, error, dt, start))
        margin = task.margin_expression(k.rotation) if strategy is None else strategy.margin_expression
        inputs = {"q": q, "p": p, "R": R, "twist": twist, "dt": dt, "start": start}
        outputs = {"dq": found.X, "rcond": found.rcond, "margin": margin}
        return Function("law", inputs, outputs, found.system, None if strategy is None else strategy.transport)

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
    dx, margin = task.rates(R[None], each[:, 0].reshape(1, -1), each[:, 1].reshape(1, -1))
    check_representation(task, q, float(margin[0]))
    return strategy(q) @ dx[0]
