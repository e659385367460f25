"""`controller`: a strategy as one control step, for a loop in real time (theory 5.9).

    dq = [J; J_g]^-1 [x' + K e; -K_g (g(q) - c)]

e is the task error, so the tool comes back to its path, and g - c the distance from the leaf, so the joints come
back to theirs. Limits are met by going slower along the path, never by leaving the leaf. Without a constraint it
is dq = G (x' + K e).
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import Any

import numpy as np

from ..arguments import Made, made
from ..codegen import LARGEST, Port, StepKernel, StepMemory, enabled, engine, tell
from ..errors import ArgumentError, NativeError, ShapeError
from ..strategies import HolonomicStrategy, Strategy
from ..symbolic import SX, Function, fabs, fmax, fmin, if_else, symbol, vec, vertcat
from ..tolerances import TOLERANCES
from ..types import Array, ArrayLike, Vector, frozen, number
from .leaf import leaf_value

HELD = 1e-6
"""Share of the wanted speed below which a joint stands at its limit."""


class StepStatus(IntEnum):
    """What became of a step; from SINGULAR on dq is zero."""

    OK = 0
    SLOWED = 1
    LIMIT = 2
    SINGULAR = 3
    NOT_FINITE = 4


class Controller(Made):
    """One control step of a strategy. Make one with `controller`.

    `step(q, x_des, dx_des) -> dq`: q (n,); x_des, the wanted tool pose (4, 4), or position (3,) for a position task;
    dx_des (m,) its rate in task rows. dq (n,) is the same array at every call of a thread; copy it to keep it.

    Threads may share a controller: each has its own dq, status and scale, and none sees another's. A thread that
    never steps, such as one that watches, reads status and scale of the last step that any thread made.
    """

    step: Callable[[ArrayLike, ArrayLike, ArrayLike], Vector]

    def __init__(self, strategy: Strategy, step: Function, dt: float, gain: float, leaf_gain: float, leaf: Vector):
        self.strategy, self.dt, self.leaf = strategy, dt, frozen(leaf)
        task = strategy.task
        self._function = step
        self._memory = StepMemory(task.n, [np.zeros(task.n + 2)])
        held = np.append(leaf, (dt, gain, leaf_gain))
        shapes = list(step.input_shapes.values())[:3]
        self.engine = "CasADi's virtual machine"
        if enabled() and step.program.instructions <= LARGEST:
            try:
                kernel = StepKernel(*self.generated)
                self.step = kernel.bind(held, self._memory, lambda *arguments: _converted(arguments, shapes))
                self.engine = engine()
                return
            except NativeError as problem:
                tell(problem)
        self.step = _machine(step, held, self._memory)

    def __repr__(self) -> str:
        return f"Controller({self.strategy.name!r}, dt={self.dt:g}, {self.engine})"

    @property
    def status(self) -> StepStatus:
        """What became of this thread's last step."""
        return StepStatus(int(self._memory.last[-1]))

    @property
    def scale(self) -> float:
        """How far this thread's last step was slowed, 0 to 1: go on along the path by scale * dt."""
        return float(self._memory.last[-2])

    @property
    def generated(self) -> tuple[Any, list[tuple[int, ...]], list[tuple[int, ...]], dict[str, float]]:
        """What native code is made of: (function, input shapes, output shapes, thresholds)."""
        f = self._function
        figures = {"SINGULAR": TOLERANCES.singular, "REPRESENTATION": TOLERANCES.representation, "HELD": HELD}
        return f.program, list(f.input_shapes.values()), list(f.output_shapes.values()), figures


def _converted(arguments: tuple[Any, ...], shapes: Sequence[tuple[int, ...]]) -> tuple[Array, ...]:
    """The arguments of a step in new arrays: contiguous, aligned, of this machine's doubles. Nothing else is let in.

    Raises:
        ArgumentError: not three, or not of real numbers. ShapeError.
    """
    if len(arguments) != 3:
        raise ArgumentError("the arguments of a step", len(arguments), "give q, x_des and dx_des")
    out = []
    for what, value, shape in zip(("q", "x_des", "dx_des"), arguments, shapes, strict=True):
        try:
            given = np.asarray(value)
            if given.dtype.kind not in "fiubO":  # of complex numbers a part would be lost
                raise TypeError
            if given.shape != shape:
                raise ShapeError(what, shape, given.shape)
            array = np.empty(shape)
            with np.errstate(over="ignore"):  # of longer floats: infinite here, which has a status
                array[...] = given
        except (TypeError, ValueError):
            raise ArgumentError(what, value, f"give real numbers of shape {shape}") from None
        except OverflowError:
            raise ArgumentError(what, "beyond all floats", f"give real numbers of shape {shape}") from None
        out.append(array)
    return tuple(out)


class _MachineMemory(threading.local):
    """What a thread needs for steps on the virtual machine: (trigger, arguments, results, out, dq)."""

    def __init__(self, port: Port, held: Vector, memory: StepMemory) -> None:
        *arguments, held_in = port.arguments
        held_in[...] = held
        self.all = (port.trigger, arguments, port.results, memory.out, memory.dq)


def _machine(function: Function, held: Vector, memory: StepMemory) -> Callable[..., Vector]:
    """The step by CasADi's virtual machine, on memory of its own, and each thread's own."""
    mine, latest = _MachineMemory(function.port(), held, memory), memory.latest
    shapes = tuple(function.input_shapes.values())[:3]
    double, least, clear = np.dtype(float), TOLERANCES.singular, TOLERANCES.representation

    def step(*arguments: Any) -> Vector:
        try:
            q, pose, dx = arguments
            fit = (q.shape, pose.shape, dx.shape) == shapes and q.dtype is pose.dtype is dx.dtype is double
        except (ValueError, AttributeError):  # not three, or no arrays
            fit = False
        values = arguments if fit else _converted(arguments, shapes)
        trigger, (q_in, pose_in, dx_in), results, out, dq = mine.all
        latest[0], memory.stepped = out, True
        q_in[...], pose_in[...], dx_in[...] = values
        trigger()
        rates, scale, conditioning, margin, room, given = results
        share = scale.item()
        size = rates @ rates + share + given.item()
        if size - size == 0.0 and conditioning.item() > least and margin.item() > clear:
            dq[...] = rates
            out[-2] = share
            out[-1] = 0 if share >= 1.0 else 1 if room.item() > HELD else 2
            return dq
        out[:-1] = 0.0
        out[-1] = StepStatus.SINGULAR if np.isfinite(given.item()) else StepStatus.NOT_FINITE
        return dq

    return step


@made
def controller(
    strategy: Strategy,
    *,
    dt: float,
    start: ArrayLike | None = None,
    gain: float | None = None,
    leaf_gain: float | None = None,
    limits: bool = True,
) -> Controller:
    """A strategy as a control step, native code if there is a compiler, else CasADi's virtual machine.

    Threads may share it; see `Controller`.

    Args:
        dt: the loop's step [s].
        start: posture (n,) whose leaf is held; needed by a strategy with a constraint.
        gain, leaf_gain: K and K_g [1/s]; 0.1/dt by default, an error then fades by a tenth each step.
        limits: keep joint speeds, and positions one step ahead, by slowing along the path.

    Raises:
        ArgumentError: no start for a strategy with a constraint, or a bad dt or gain. ShapeError, NotFiniteError.
    """
    dt = number("dt", dt)
    if not (np.isfinite(dt) and dt > 0):
        raise ArgumentError("dt", dt, "give a positive step in seconds")
    given = (("gain", gain), ("leaf_gain", leaf_gain))
    gains = [0.1 / dt if value is None else number(what, value) for what, value in given]
    for (what, _), value in zip(given, gains, strict=True):
        if not (np.isfinite(value) and 0 <= value * dt < 2):
            raise ArgumentError(what, value, f"give a number from 0 to below 2/dt = {2 / dt:g}; more is unstable")
    leaf, function = np.zeros(0), step_function(strategy, limits)
    _, *shapes = function.input_shapes.values()
    if isinstance(strategy, HolonomicStrategy) and strategy.task.n > strategy.task.m:
        if start is None:
            raise ArgumentError("start", None, f"{strategy.name!r} has leaves: give a posture on the one to hold")
        q0 = strategy.task.robot.checked(start, "the start posture")
        _, _, conditioning, margin, *_ = function(q0, *(np.zeros(shape) for shape in shapes))
        strategy.check(q0, conditioning, margin)
        leaf = leaf_value(strategy, q0)
    return Controller(strategy, function, dt, gains[0], gains[1], leaf)


def step_function(strategy: Strategy, limits: bool) -> Function:
    """(q, pose, dx, held) -> (dq, scale, conditioning, margin, room, given), with held = (c, dt, K, K_g).

    pose (4, 4), or (3,) where the task is a position. Step and gains are data, so one compiled step serves them all.
    room is the scale that position limits allow; given is finite where all arguments are, also those not needed.
    """
    e, task = strategy.expressions, strategy.task
    r = task.n - task.m if isinstance(strategy, HolonomicStrategy) else 0
    pose = symbol("pose", 3) if task.orientation is None else symbol("pose", 4, 4)
    p, R = (pose, SX.eye(3)) if task.orientation is None else (pose[:3, 3], pose[:3, :3])
    dx, held = symbol("dx", task.m), symbol("held", r + 3)
    c, dt, gain, leaf_gain = held[:r], held[r], held[r + 1], held[r + 2]
    u = dx + gain * task.error_expression(e.kinematics, p, R)
    if isinstance(strategy, HolonomicStrategy):
        found = strategy.expressions.rate(u, leaf_gain * strategy.leaf_gap(c))
    else:
        found = e.rate(u)
    dq, fast, room = found.X, SX(1), SX(1)
    if limits:
        for i, joint in enumerate(task.robot.coordinates):
            if np.isfinite(joint.max_velocity):
                fast = fmin(fast, joint.max_velocity / fmax(fabs(dq[i]), 1e-12))
            for bound, sign in ((joint.upper, 1.0), (joint.lower, -1.0)):
                if np.isfinite(bound):
                    left, speed = fmax(sign * (bound - e.q[i]), 0), sign * dq[i] * dt
                    room = fmin(room, if_else(speed > 1e-12, left / fmax(speed, 1e-12), 1))
    given, scale = SX(0), fmin(fast, room)
    values = vertcat(e.q, vec(pose), dx, held)
    for i in range(values.shape[0]):
        given = given + fabs(values[i]) / 1024  # their sum is finite where they are
    outputs = {
        "dq": scale * dq,
        "scale": scale,
        "conditioning": found.conditioning,
        "margin": strategy.margin_expression,
        "room": room,
        "given": given,
    }
    return Function("step", {"q": e.q, "pose": pose, "dx": dx, "held": held}, outputs, found.system)
