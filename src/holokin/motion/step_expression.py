"""The control step as one expression: (q, pose, twist, parameters) -> joint rates, and what its status is made of."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import Any, TypeGuard

import numpy as np

from ..base.types import NoTruthValue, Vector
from ..robot import Coordinate
from ..strategies import HolonomicStrategy, Strategy
from ..symbolic import SX, Function, fabs, fmax, fmin, if_else, symbol, vec, vertcat
from .control.control_law import feedback, tracking, wanted_symbols

UNLIMITED = {"rad": 2 * np.pi, "m": 2.0}
"""Speed [unit/s] of a joint that has no limit of its own: a turn a second, which few arms reach, and what fast linear
axes do. MJCF has no speed limits, and a law's rates grow without a bound towards the end of its leaf."""


TOWARDS_SINGULAR = 0.5
"""Share of rcond that a joint may move in a step [rad or m]: about half the way to a singular posture, so that no step
leads past one."""


AT_LIMIT = 1e-6
"""Share of the wanted speed below which a joint stands at its limit."""

Rates = Callable[[Any, Any, Any], Vector]
"""(q, pose, twist) -> dq, a new array."""


class StepStatus(NoTruthValue, IntEnum, ask="`is StepStatus.OK`"):
    """What became of a step; from SINGULAR on dq is zero."""

    OK = 0
    SLOWED = 1
    LIMIT = 2
    SINGULAR = 3
    NOT_FINITE = 4
    LOST = 8  # 5 to 7 are of exported C


def has_leaf(strategy: Strategy) -> TypeGuard[HolonomicStrategy]:
    """True where a step of the strategy has a leaf to hold: it has a constraint, and joints to spare."""
    return isinstance(strategy, HolonomicStrategy) and strategy.task.n > strategy.task.m


def fastest_rate(joint: Coordinate) -> float:
    """The speed [unit/s] that a step keeps a joint to: its limit, or that of one that has none."""
    return joint.max_velocity if np.isfinite(joint.max_velocity) else UNLIMITED.get(joint.unit, np.inf)


def step_function(strategy: Strategy, limits: bool) -> Function:
    """(q, pose, twist, parameters) -> (dq, scale, rcond, margin, room, off, given, holding).

    parameters = (c, c', dt, K, K_g, most error, least rcond): c is wanted at the end of the step, c' takes it there.
    pose (4, 4) and twist (6,), or both (3,) where the task is a position, as in `wanted_symbols`. One compiled step
    serves all parameters. room is the scale that position limits allow; off the largest row of e; given is finite where
    all arguments are, also those not needed; holding is the sum of 2^i over the joints i that stand at a position limit
    and would go beyond it. With limits no joint moves by more than half of rcond.
    """
    strategy = strategy.looped
    e, task = strategy.expressions, strategy.task
    r = task.n - task.m if has_leaf(strategy) else 0
    (pose, twist), (p, R, twists) = wanted_symbols(task)
    parameters = symbol("parameters", 2 * r + 5)
    c, rate = parameters[:r], parameters[r : 2 * r]
    dt, gain, constraint_gain = (parameters[2 * r + i] for i in range(3))
    dx, error = tracking(task, e.kinematics, p, R, twists, dt)
    leaf = (c - dt * rate, constraint_gain, rate) if r else ()
    found = feedback(strategy, dx, error, gain, *leaf)
    dq, fast, room, holding = found.X, SX(1), SX(1), SX(0)
    if limits:
        for i, joint in enumerate(task.robot.coordinates):
            fastest = fastest_rate(joint)
            if np.isfinite(fastest):
                fast = fmin(fast, fastest / fmax(fabs(dq[i]), 1e-12))
            if joint.unit in UNLIMITED:
                fast = fmin(fast, TOWARDS_SINGULAR * found.rcond / fmax(fabs(dq[i]) * dt, 1e-12))
            ends = [sign * (end - e.q[i]) for end, sign in ((joint.upper, 1), (joint.lower, -1)) if np.isfinite(end)]
            if ends:  # how far the joint is from the end that it goes to
                speed = (1 if np.isfinite(joint.upper) else -1) * dq[i] * dt
                left, speed = (
                    (ends[0], speed) if len(ends) == 1 else (if_else(speed > 0, ends[0], ends[1]), fabs(speed))
                )
                its = if_else(speed > 1e-12, fmax(left, 0) / fmax(speed, 1e-12), 1)
                room, holding = fmin(room, its), holding + if_else(its <= AT_LIMIT, 2.0**i, 0)
    largest = SX(0)
    for i, unit in enumerate(task.units):
        if unit in UNLIMITED:  # of other units, as of thrust, nobody knows what is far
            largest = fmax(largest, fabs(error[i]))
    scale = fmin(fast, room)
    given = _sum_by_halves(vertcat(e.q, vec(pose), twist, parameters) / 1024)  # finite where all of them are
    outputs = {
        "dq": scale * dq,
        "scale": scale,
        "rcond": found.rcond,
        "margin": fmin(strategy.margin_expression, task.margin_expression(R)),
        "room": room,
        "off": largest,
        "given": given,
        "holding": holding,
    }
    inputs = {"q": e.q, "pose": pose, "twist": twist, "parameters": parameters}
    return Function("step", inputs, outputs, found.system, strategy.transport)


def _sum_by_halves(values: SX) -> SX:
    """The sum of a column's rows: a processor adds many pairs at once, but a running sum one by one."""
    while (rows := values.shape[0]) > 1:
        half = rows // 2
        values = vertcat(values[:half] + values[half : 2 * half], values[2 * half :])
    return values
