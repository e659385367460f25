"""`controller`: a strategy as one compiled control step, and what watches a loop in real time (theory 5.9).

    dq = [J; J_g]^-1 [x' + K e; c' - K_g (g(q) - c)]

e is the task error, so the tool is led back to its path, and g - c the distance from the leaf, so the joints are led
back to theirs. The level c is that of the start, or an input of each step, as the tool's pose is, with its rate c'.
Limits are met by going slower along the path, never by leaving the leaf. A joint that has no speed limit gets one, so
that no step is without a bound. The step stands still, with a status, where the tool is lost (e is large) and where the
posture is nearly singular. Without a constraint it is dq = G (x' + K e).
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from math import isfinite
from typing import Any, TypeGuard

import numpy as np

from ..base.arguments import made, typed
from ..base.errors import ArgumentError, NativeError, NotFiniteError, ShapeError, TrackingError
from ..base.poses import PoseLike, pose_cure, with_matrices
from ..base.tolerances import TOLERANCES
from ..base.types import (
    Array,
    ArrayLike,
    Matrix,
    NoTruthValue,
    Vector,
    finite,
    frozen,
    in_order,
    number,
    positive,
    right_last_row,
)
from ..robot import Coordinate, start_posture
from ..strategies import HolonomicStrategy, Strategy, check_solved
from ..symbolic import SX, Function, fabs, fmax, fmin, if_else, symbol, vec, vertcat
from ..symbolic.native import LARGEST, Port, StepKernel, StepMemory, enabled, engine, tell
from .control.control_law import ControlLaw, Step, feedback, tracking, wanted_symbols
from .ik.leaf import leaf_value

# --- The control step as one expression: (q, pose, twist, parameters) -> joint rates, and what its status is made of.

UNLIMITED = {"rad": 2 * np.pi, "m": 2.0}
"""Speed [unit/s] of a joint that has no limit of its own: a turn a second, which few arms reach, and what fast linear
axes do. MJCF has no speed limits, and a strategy's rates grow without a bound towards the end of its leaf."""


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
    solution = feedback(strategy, dx, error, gain, *leaf)
    dq, fast, room, holding = solution.X, SX(1), SX(1), SX(0)
    # By how much to slow down so that speeds, singular postures and position limits are kept.
    if limits:
        for i, joint in enumerate(task.robot.coordinates):
            fastest = fastest_rate(joint)
            if np.isfinite(fastest):
                fast = fmin(fast, fastest / fmax(fabs(dq[i]), 1e-12))
            if joint.unit in UNLIMITED:  # half of rcond is about half the way to a singular posture
                fast = fmin(fast, 0.5 * solution.rcond / fmax(fabs(dq[i]) * dt, 1e-12))
            ends = [sign * (end - e.q[i]) for end, sign in ((joint.upper, 1), (joint.lower, -1)) if np.isfinite(end)]
            if ends:  # how far the joint is from the end that it goes to
                left, motion = ends[0], (1 if np.isfinite(joint.upper) else -1) * dq[i] * dt
                if len(ends) == 2:
                    left, motion = if_else(motion > 0, ends[0], ends[1]), fabs(motion)
                own = if_else(motion > 1e-12, fmax(left, 0) / fmax(motion, 1e-12), 1)
                room, holding = fmin(room, own), holding + if_else(own <= AT_LIMIT, 2.0**i, 0)
    # Finite where all arguments are: their sum by halves, since a processor adds many pairs at once.
    values = vertcat(e.q, vec(pose), twist, parameters) / 1024
    while (rows := values.shape[0]) > 1:
        half = rows // 2
        values = vertcat(values[:half] + values[half : 2 * half], values[2 * half :])
    # The largest error of the tool, by which it counts as lost.
    largest = SX(0)
    for i, unit in enumerate(task.units):
        if unit in UNLIMITED:  # of other units, as of thrust, nobody knows what is far
            largest = fmax(largest, fabs(error[i]))
    scale = fmin(fast, room)
    outputs = {
        "dq": scale * dq,
        "scale": scale,
        "rcond": solution.rcond,
        "margin": fmin(strategy._margin_expression, task._margin_expression(R)),
        "room": room,
        "off": largest,
        "given": values,
        "holding": holding,
    }
    inputs = {"q": e.q, "pose": pose, "twist": twist, "parameters": parameters}
    return Function("step", inputs, outputs, solution.system, strategy.transport)


# --- The control step on CasADi's virtual machine, where there is no compiler.


class _Memory(threading.local):
    """What a thread needs for steps on the virtual machine: (trigger, arguments, results, its results of a step)."""

    def __init__(self, port: Port, parameters: Vector, memory: StepMemory) -> None:
        port.arguments[-1][...] = parameters
        self.all = (port.trigger, port.arguments, port.results, memory.out)


def _machine_step(
    function: Function, parameters: Vector, memory: StepMemory, convert: Callable[..., tuple[Array, Array, Array]]
) -> Rates:
    """The step by CasADi's virtual machine, on memory of its own, and each thread's own."""
    mine, latest = _Memory(function.port(), parameters, memory), memory.latest
    change = parameters.flags.writeable
    shapes = tuple(function.input_shapes.values())[:3]
    double, least, clear = np.dtype(float), TOLERANCES.singular, TOLERANCES.representation
    ok, slowed, limit = (int(status) for status in (StepStatus.OK, StepStatus.SLOWED, StepStatus.LIMIT))

    def step(q: Any, pose: Any, twist: Any) -> Vector:
        try:
            fit = (q.shape, pose.shape, twist.shape) == shapes and q.dtype is pose.dtype is twist.dtype is double
            fit = fit and (pose.ndim == 1 or (len(pose) == 4 and pose[3].tolist() == [0.0, 0.0, 0.0, 1.0]))
        except AttributeError:  # no arrays
            fit = False
        if not fit:
            q, pose, twist = convert(q, pose, twist)
        # Write the arguments into the memory of the machine, and run it.
        trigger, (q_in, pose_in, twist_in, parameters_in), results, out = mine.all
        latest[0], memory.stepped = out, True
        q_in[...], pose_in[...], twist_in[...] = q, pose, twist
        if change:
            parameters_in[...] = parameters
        trigger()
        # Zero rates and a status where the step is not sound.
        rates, scale, rcond, margin, room, off, given, holding = results
        share = scale.item()
        size = rates @ rates + share + given.item()
        most, singular = parameters_in[-2:].tolist()
        sound = isfinite(size) and rcond.item() > max(least, singular) and margin.item() > clear
        if sound and off.item() <= most:
            out[-3], out[-2] = share, holding.item()
            out[-1] = ok if share >= 1.0 else slowed if room.item() > AT_LIMIT else limit
            return rates.copy()
        out[-3] = out[-2] = 0.0
        given_all = isfinite(given.item())
        out[-1] = StepStatus.NOT_FINITE if not given_all else StepStatus.LOST if sound else StepStatus.SINGULAR
        return np.zeros(len(rates))

    return step


LONGEST_STEP = 10.0
"""Longest step of a control loop [s]: a longer one is in milliseconds."""

MOST_ERROR = 0.1
"""Error of the tool [m, and rad] beyond which a step stands still: feedback corrects millimetres, and what is further
away is in other units, of another path, or out of the arm's reach."""

LARGEST_ERROR = 1e30
"""What stands for no bound of the error: all parameters of a step are finite, also in single precision."""

LEAST_RCOND = 1e-3
"""rcond of [J; J_g], or of J, up to which a step stands still: there a joint moves about a thousand times as far as the
tool, so at 1 mm/s the fastest arms are at their limits."""


class Controller(ControlLaw):
    """A strategy as one compiled control step. Make one with `controller`.

    `step` is for a loop of your own, with the dt of the controller; `status`, `scale` and `holding` tell of the last
    one. It is a `ControlLaw`, too: `begin(q0)` starts a run with memory of its own, for `simulate` and `audit`, whose
    steps take their own dt. Every run holds the leaf of the controller's `start`, whatever its q0, as every step does.

    Threads may share a controller: each has its own status and scale, and none sees another's. A thread that
    never steps, such as one that watches, reads status and scale of the last step that any thread made.

    Attributes:
        strategy: what it was made of. dt: its step [s]. engine: what runs, native code or the virtual machine.
        parameters: (c, c', dt, K, K_g, most error, least rcond), the numbers of the compiled step besides its inputs.
    """

    def __init__(self, compiled: _Compiled):
        super().__init__(f"controller, {compiled.strategy.name}", compiled.begin)
        self.strategy, self.parameters, self.engine = compiled.strategy, compiled.parameters, compiled.engine
        self.dt = float(compiled.parameters[-5])
        self._compiled = compiled
        self._rates, self._memory = compiled.bound(compiled.parameters)

    def __repr__(self) -> str:
        held = f", held at the position limit of {', '.join(self.holding)}" if self.holding else ""
        return f"Controller({self.strategy.name!r}, dt={self.dt:g}, {self.engine}{held})"

    def __str__(self) -> str:
        status = f"{self.status.name.lower().replace('_', ' ')}, at {self.scale:.0%} of the wanted speed"
        held = f", held at the position limit of {', '.join(self.holding)}" if self.holding else ""
        return f"the last step: {status}{held}; {self.name}, every {1e3 * self.dt:g} ms by {self.engine}"

    def to_dict(self) -> dict[str, Any]:
        """What became of the last step, ready for JSON."""
        status = self.status.name.lower()
        return {"status": status, "scale": self.scale, "holding": list(self.holding), "engine": self.engine}

    def step(
        self,
        q: ArrayLike,
        pose: PoseLike,
        twist: ArrayLike,
        level: ArrayLike | None = None,
        level_rate: ArrayLike = 0.0,
    ) -> Vector:
        """Joint rates for the next dt: [J; J_g] dq = [x' + K e; c' - K_g (g(q) - c)], slowed where limits ask for it.

        Args:
            q: joints now, (n,).
            pose: where the tool is wanted at the end of the step, (4, 4); for a position task also the point (3,).
            twist: the constant twist that takes the wanted pose of now there, (6,), linear first, in the base frame
                [m/s, rad/s]; for a position task also the velocity (3,).
            level: c (r,) that is wanted at the end of the step, or one number for all rows; by default that of the
                start.
            level_rate: the constant rate c' (r,) that takes the wanted level of now there.

        Of a task of F > 1 frames poses are (F, 4, 4) and twists (F, 6), or points and velocities both (F, 3); of a
        `custom_task` of m > 3 rows a point (m,) and how fast it moves.

        Returns:
            dq (n,), a new array. It is zero where `status` is SINGULAR, NOT_FINITE or LOST; nothing is raised then.

        Raises:
            ArgumentError: an argument is no array of real numbers, or the pose's last row is not 0, 0, 0, 1, as of a
                transposed matrix (that its rotation is one is not looked at); a level where there is no leaf.
            ShapeError.
        """
        if level is None:
            return self._rates(q, pose, twist)
        return self._levelled(level, level_rate)(q, pose, twist)

    @cached_property
    def _levelled(self) -> _Levelled:
        return _Levelled(self._compiled, self._memory)

    @property
    def status(self) -> StepStatus:
        """What became of this thread's last step."""
        return StepStatus(int(self._memory.last[-1]))

    @property
    def scale(self) -> float:
        """How far this thread's last step was slowed, 0 to 1: go on along the path by scale * dt."""
        return float(self._memory.last[-3])

    @property
    def holding(self) -> tuple[str, ...]:
        """The joints that stand at a position limit and would go beyond it: where the status is LIMIT, these hold the
        tool. The path does not go on then, unless it turns round or another leaf is taken; a loop that waits, waits
        for ever."""
        bits = int(self._memory.last[-2])
        return tuple(name for i, name in enumerate(self.strategy.task.robot.joint_names) if bits >> i & 1)

    @property
    def leaf(self) -> Vector:
        """c = g(start) (r,): the leaf that it holds; empty where there is none."""
        return self.parameters[: self._compiled.rows]

    @property
    def generated(self) -> tuple[Any, list[tuple[int, ...]], list[tuple[int, ...]], dict[str, float]]:
        """What native code is made of: (function, input shapes, output shapes, thresholds)."""
        return _generated(self._compiled.function)


@dataclass(frozen=True, eq=False)
class _Compiled:
    """The compiled step of a strategy with its parameters; what `Controller` and its runs have in common."""

    strategy: Strategy
    function: Function
    parameters: Vector
    kernel: StepKernel | None
    engine: str

    @property
    def rows(self) -> int:
        """Of the leaf that it holds, r; 0 where there is none."""
        return len(self.parameters) // 2 - 2

    def bound(self, parameters: Vector, memory: StepMemory | None = None) -> tuple[Rates, StepMemory]:
        """The step with parameters, which are read at each call, and the memory that tells of the last one."""
        n = self.strategy.task.n
        memory = memory or StepMemory(n, [np.zeros(n + 3)])
        if self.kernel is not None:
            return self.kernel.bind(parameters, memory, self.converted), memory
        return _machine_step(self.function, parameters, memory, self.converted), memory

    def converted(self, *arguments: Any) -> tuple[Array, Array, Array]:
        """(q, pose, twist) in new arrays as the compiled step takes them. Raises: ArgumentError, ShapeError."""
        q, pose, twist, _ = self.function.input_shapes.values()
        frames, point = self.strategy.task.frames, len(pose) == 1
        several = () if frames == 1 else (frames,)
        a, b, c = arguments
        points = (pose, (*several, 3)) if point else ()  # of a position task whole poses and twists will do, too
        T = _numbers("pose", with_matrices("pose", b), tuple(dict.fromkeys(((*several, 4, 4), *points))))
        v = _numbers("twist", c, tuple(dict.fromkeys(((*several, 6), *points))))
        whole, moved = T.shape == (*several, 4, 4), v.shape == (*several, 6)
        for matrix in T.reshape(-1, 4, 4) if whole else ():
            if np.isfinite(matrix[3]).all():
                right_last_row("pose", matrix)
        if point:
            T = T[..., :3, 3].ravel()[: pose[0]] if whole else T
            v = v[..., :3].ravel()[: twist[0]] if moved else v
        if hasattr(a, "keys"):
            a = in_order("q", a, self.strategy.task.robot.joint_names)
        return _numbers("q", a, (q,)), T.reshape(pose).copy(), v.reshape(twist).copy()

    def begin(self, _q0: Vector) -> Step:
        """A run: a step with memory and dt of its own. Raises (when it runs): SingularityError, ArgumentError."""
        parameters = self.parameters.copy()
        rates, memory = self.bound(parameters)
        known, highest = float(parameters[-5]), float(max(parameters[-4:-2]))

        def step(q: Vector, pose: Matrix, twist: Vector, dt: float) -> Vector:
            nonlocal known
            if dt != known:
                if not (0 < dt < np.inf and dt * highest < 2):
                    most = f"a positive step below {2 / highest:g} s" if highest else "a positive step"
                    raise ArgumentError("the dt of a run", dt, f"give {most}, or smaller gains: the loop is unstable")
                parameters[-5] = known = dt
            dq = rates(q, pose, twist)
            if memory.last[-1] >= StepStatus.SINGULAR:
                self.check(q, pose, twist, parameters)
                cure = "give a smaller twist, a pose nearer by, or smaller gains"
                raise NotFiniteError("the joint rates", "overflow", cure)
            return dq

        return step

    def check(self, q: ArrayLike, pose: PoseLike, twist: ArrayLike, parameters: Vector) -> None:
        """Raises: SingularityError, saying of which kind, or NotFiniteError, unless the step can be made."""
        arguments = self.converted(q, pose, twist)
        for what, value in zip(("q", "pose", "twist"), arguments, strict=True):
            if not np.isfinite(value).all():
                raise NotFiniteError(what, value.tolist())
        _, _, rcond, margin, _, off, *_ = self.function(*arguments, parameters)
        most_error, least_rcond = map(float, parameters[-2:])
        check_solved(self.strategy, arguments[0], rcond, margin, least_rcond)
        if not off <= most_error:
            raise TrackingError(
                f"the tool is {float(off):.3g} (m or rad) from where it is wanted, "
                f"a control step corrects at most {most_error:.3g}",
                "give poses in metres that begin at the tool (hk.motion.approach leads to them), "
                "or a larger most_error",
            )


class _Levelled(threading.local):
    """A thread's own step whose level is given: (level, rate) -> the step (q, pose, twist) -> dq."""

    def __init__(self, compiled: _Compiled, memory: StepMemory) -> None:
        self._parameters = compiled.parameters.copy()
        self._rates, self._compiled = compiled.bound(self._parameters, memory)[0], compiled
        self._shape = (compiled.rows,)

    def __call__(self, level: ArrayLike, rate: ArrayLike) -> Rates:
        (r,) = self._shape
        if not r:
            name = self._compiled.strategy.name
            raise ArgumentError("level", level, f"{name!r} holds no leaf: leave it out, or {HolonomicStrategy.cure}")
        for what, value, first in (("level", level, 0), ("level_rate", rate, r)):
            self._parameters[first : first + r] = _numbers(what, value, (self._shape, ()))
        return self._rates


def _numbers(what: str, value: Any, shapes: tuple[tuple[int, ...], ...]) -> Array:
    """An argument in a new array: contiguous, aligned, of this machine's doubles. Nothing else is let in.

    Raises:
        ArgumentError: not of real numbers.
        ShapeError: of none of the shapes.
    """
    wanted = " or ".join(map(str, shapes))
    try:
        given = np.asarray(value)
        if given.dtype.kind not in "fiubO":  # of complex numbers a part would be lost
            raise TypeError
        if given.shape not in shapes:
            cure = pose_cure(given) if what == "pose" else ""
            raise ShapeError(what, shapes[0] if len(shapes) == 1 else wanted, given.shape, cure)
        array = np.empty(given.shape)
        with np.errstate(over="ignore"):  # of longer floats: infinite here, which has a status
            array[...] = given
    except (TypeError, ValueError):
        raise ArgumentError(what, value, f"give real numbers of shape {wanted}") from None
    except OverflowError:
        raise ArgumentError(what, "beyond all floats", f"give real numbers of shape {wanted}") from None
    return array


@made
def controller(
    strategy: Strategy,
    *,
    dt: float,
    q0: ArrayLike | None = None,
    gain: float | None = None,
    constraint_gain: float | None = None,
    limits: bool = True,
    most_error: float = MOST_ERROR,
    least_rcond: float = LEAST_RCOND,
) -> Controller:
    """A strategy as a control step, native code if there is a compiler, else CasADi's virtual machine.

    [J; J_g] dq = [x' + K e; c' - K_g (g(q) - c)], or dq = G (x' + K e) without a constraint. c = g(q0) and c' = 0,
    unless a step is given others. `Controller` says how it is called; threads may share it.

    Args:
        dt: the loop's step [s], not milliseconds: one in which a joint can move by more than 1 rad is warned of.
        q0: posture (n,) whose leaf is held by every step and in every run; needed by a strategy with a
            constraint. A strategy without one has no leaf, and its start does not matter.
        gain: K [1/s], how fast an error of the tool fades; 0.1/dt by default, by a tenth each step.
        constraint_gain: K_g [1/s], how fast the joints are led back to their leaf; 0.1/dt by default.
        limits: keep joint speeds, and positions one step ahead, by slowing along the path. A joint without a speed
            limit may turn once a second, or move 2 m/s: give the robot its own by `hk.with_limits`.
        most_error: error e of the tool, of each row in m or rad, beyond which a step stands still with the status LOST;
            infinite for none.
        least_rcond: rcond of [J; J_g], or of J, up to which a step stands still with the status SINGULAR.

    Raises:
        ArgumentError: no start for a strategy with a constraint, a bad dt, gain or bound. ShapeError, NotFiniteError.
        SingularityError: the strategy is singular at the start. JointLimitError: with limits, q0 is beyond them.
    """
    # The step, the gains, with which the loop must be stable, and the bounds.
    dt = number("dt", dt)
    if not 0 < dt <= LONGEST_STEP:
        raise ArgumentError("dt", dt, f"give the step in seconds, positive and at most {LONGEST_STEP:g}: 1 ms is 0.001")
    _warn_of_long_steps(strategy, dt)
    gains = []
    for what, given in (("gain", gain), ("constraint_gain", constraint_gain)):
        value = 0.1 / dt if given is None else number(what, given)
        if not (np.isfinite(value) and 0 <= value * dt < 2):
            cure = f"give a number from 0 to below 2/dt = {2 / dt:g}; more is unstable"
            raise ArgumentError(what, value, cure)
        gains.append(value)
    bounds = _bounds(most_error, least_rcond)
    # The leaf of the start, and the compiled step, which must be regular there.
    leaf, function = np.zeros(0), step_function(strategy, limits)
    if has_leaf(strategy):
        if q0 is None:
            raise ArgumentError("q0", None, f"{strategy.name!r} keeps g(q) = c: give a posture with that c")
        q0 = start_posture(strategy.task.robot, q0, limits)
        leaf = leaf_value(strategy, q0)
    else:
        q0 = None
    parameters = np.concatenate([leaf, np.zeros(len(leaf)), (dt, *gains, *bounds)])
    compiled = _compiled(strategy, function, frozen(parameters))
    if q0 is not None:
        still = np.zeros(6) if strategy.task.frames == 1 else np.zeros((strategy.task.frames, 6))
        compiled.check(q0, strategy.task.pose(q0), still, compiled.parameters)
    return Controller(compiled)


def _warn_of_long_steps(strategy: Strategy, dt: float) -> None:
    """Tells the log of a step in which a joint at full speed moves by more than 1 rad or m: it may be right for a tool
    that creeps.

    Rates are good for one step, and in this one the tool gets half its distance from the joint away from where they led
    at its start. Steps of up to 0.1 s stay below it on all arms of the catalogue.
    """
    speeds = np.where(np.isfinite(strategy.task.robot.max_velocity), strategy.task.robot.max_velocity, 0.0)
    i = int(np.argmax(speeds))
    if speeds[i] * dt > 1.0:
        joint = strategy.task.robot.coordinates[i]
        motion = f"at its full speed {joint.name} moves by {speeds[i] * dt:.2g} {joint.unit} in it"
        text = f"a step of dt = {dt:g} s is long: {motion}; dt is in seconds, 1 ms is 0.001"
        logging.getLogger("holokin").warning("%s", text)


def _bounds(most_error: float, least_rcond: float) -> tuple[float, float]:
    """(most error, least rcond) of a step. Raises: ArgumentError."""
    most, least = number("most_error", most_error), number("least_rcond", least_rcond)
    if not most > 0:
        raise ArgumentError("most_error", most, "give a positive error in m and rad, or math.inf for none")
    if not 0 <= least < 1:
        raise ArgumentError("least_rcond", least, "give a number from 0 to below 1, as 1e-3")
    return min(most, LARGEST_ERROR), max(least, TOLERANCES.singular)


def _compiled(strategy: Strategy, function: Function, parameters: Vector) -> _Compiled:
    """As native code, or else on the virtual machine: a warning tells, or of a step that is too long its engine."""
    machine, size = "CasADi's virtual machine", function.program.instructions
    if size > LARGEST:
        machine += f" (the step takes {size:,} operations written out, {LARGEST:,} are the most for C)"
    elif enabled():
        try:
            return _Compiled(strategy, function, parameters, StepKernel(*_generated(function)), engine())
        except NativeError as problem:
            tell(problem)
    return _Compiled(strategy, function, parameters, None, machine)


def _generated(f: Function) -> tuple[Any, list[tuple[int, ...]], list[tuple[int, ...]], dict[str, float]]:
    thresholds = {"SINGULAR": TOLERANCES.singular, "REPRESENTATION": TOLERANCES.representation, "AT_LIMIT": AT_LIMIT}
    return f.program, list(f.input_shapes.values()), list(f.output_shapes.values()), thresholds


class LoopWatch(NoTruthValue, ask="`.starved`"):
    """Tells whether the joints of a control loop move as they are commanded.

    It sums over the steps share = sum dq . (q_next - q) / sum dt dq . dq, which is 1 where the joints follow. Position
    servos that are sent q + dt dq from the measured q hardly move: they share a few percent. The first time that the
    share is below a half, the log "holokin" gets a warning.

    Args:
        dt: the loop's step [s].
        log: whether to warn.
    """

    @typed
    def __init__(self, dt: float, log: bool = True) -> None:
        self.dt = positive("dt", dt, "give the step in seconds")
        self._made = self._asked = 0.0
        self._last: tuple[Vector, Vector] | None = None
        self._quiet = not log

    def see(self, q: ArrayLike, dq: ArrayLike) -> None:
        """One step: where the joints are (n,), and the rates (n,) that they are commanded from there.

        Raises: ShapeError: not as many as before. NotFiniteError, ArgumentError.
        """
        posture = finite("q", q, ("n",) if self._last is None else self._last[0].shape)
        rates = finite("dq", dq, posture.shape)
        if self._last is not None:
            before, asked = self._last
            self._made += float((posture - before) @ asked)
            self._asked += self.dt * float(asked @ asked)
        self._last = posture.copy(), rates.copy()
        if self.starved and not self._quiet:
            self._quiet = True  # once is enough
            logging.getLogger("holokin").warning("%s", self.sentence)

    @property
    def share(self) -> float:
        """The share of the commanded motion that was made; 1 before any."""
        return self._made / self._asked if self._asked else 1.0

    @property
    def starved(self) -> bool:
        """Whether the joints make less than half of what is commanded, so that the loop is fed the wrong joints: a
        servo that merely lags makes up for it. It is judged from dt dq . dq = 0.01 rad^2/s on, a second at 0.1
        rad/s."""
        return self._asked > 0.01 and self.share < 0.5

    @property
    def sentence(self) -> str:
        """What is to be said of it, with the cure."""
        if not self.starved:
            return f"the joints make {self.share:.0%} of the motion that is commanded"
        share = max(self.share, 0.0)
        return (
            f"the joints make {share:.0%} of the motion that is commanded: with position servos feed back the "
            "commanded joints, not the measured ones; with others, look whether the drives are on"
        )

    def __str__(self) -> str:
        return self.sentence

    def to_dict(self) -> dict[str, Any]:
        """The verdict and the share, ready for JSON."""
        return {"starved": self.starved, "share": self.share}
