"""`follow`: a strategy, a path and a start posture give a trajectory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Literal, get_args

import numpy as np

from ..base.arguments import typed
from ..base.errors import (
    KEPT,
    ArgumentError,
    BranchError,
    JointLimitError,
    LimitReachedError,
    OpenPathError,
    OutOfReachError,
    PathError,
    PathSingularityError,
    SingularityError,
    SingularityKind,
    TrackingError,
)
from ..base.poses import pose_from
from ..base.progress import progress
from ..base.tolerances import TOLERANCES
from ..base.types import ArrayLike, Matrix, Vector, kept, positive, whole
from ..path import Path, line_segment
from ..path.editing import AnyPath
from ..path.path import straight
from ..robot import start_posture
from ..strategies import HolonomicStrategy, NumericStrategy, Strategy, checked_rate, first_jump, jump_near, may_jump
from ..strategies.tasks.task import Task, of_one_tool
from ..symbolic import SX, Function, fabs, fmax, fmin, runge_kutta, symbol
from ..symbolic.native import VelocityRules
from .ik.branch import branch_code
from .ik.leaf import TRIES, jump_problem, leaf_step, leaf_stepper, leaf_value, move_to_leaf, native_leaf
from .ik.plan import NativeFollower, Plan, check_start, make_plan
from .ik.pose_paths import out_of_reach
from .ik.postures_of_pose import all_postures
from .self_motions.least_squares import nearest_postures
from .trajectory import Status, Trajectory, record, trajectory_of

# --- Following by velocity: dq = G(q) x', integrated by Runge-Kutta of order 4 with fixed steps, as the paper does.


@kept
def path_rate(strategy: Strategy) -> Function:
    """(q, p, R, v, w) -> (dq, rcond, margin, largest task error): G x' for a tool pose and how it moves.

    x' are the task rates of the pose (p, R) that moves with v and turns with w; the error is that from q to it.
    """
    strategy = strategy.looped
    e, task = strategy.expressions, strategy.task
    (p, R), v, w = task._target_symbols(), symbol("v", 3 * task.frames), symbol("w", 3 * task.frames)
    solution = e.rate(task._rates_expression(R, v, w))
    error, off = task._error_expression(e.kinematics, p, R), SX(0)
    for i in range(task.m):
        off = fmax(off, fabs(error[i]))
    margin = fmin(strategy._margin_expression, task._margin_expression(R))
    inputs = {"q": e.q, "p": p, "R": R, "v": v, "w": w}
    outputs = {"dq": solution.X, "rcond": solution.rcond, "margin": margin, "off": off}
    return Function("path_rate", inputs, outputs, solution.system, strategy.transport)


def _velocity_stepper(strategy: Strategy, plan: Plan) -> Callable[[Vector, int], Vector]:
    """(q, step) -> q after that step of the plan.

    Raises:
        SingularityError (when called): G is not defined there. TrackingError: the tool lost the path.
    """
    rate, error = checked_rate(strategy), strategy.task._error_function

    def step(q: Vector, i: int) -> Vector:
        new = runge_kutta(rate, q, *plan.step_rates(i))
        p, R = plan.target(i, 1.0)
        off = float(np.abs(error(new, p, R)).max())
        if not off < TOLERANCES.tracking:
            rcond = strategy.gain(q)[1]
            raise TrackingError(
                f"the tool is {off:.3g} (m or rad) off the path, with an rcond of {rcond:.1e} (1 is good, 0 singular)",
                "use more samples, or keep the path away from singular postures",
            )
        return new

    return step


def velocity_rules() -> VelocityRules:
    """The rules of native code: when a posture is sound, and when the tool has lost the path."""
    return VelocityRules(TOLERANCES.singular, TOLERANCES.representation, TOLERANCES.tracking)


@dataclass(frozen=True, eq=False)
class Stepper:
    """The steps along a plan: `step`, (q, step of the plan) -> q after it, and the same in native code."""

    step: Callable[[Vector, int], Vector]
    native: NativeFollower | None = None


def stepper(
    strategy: Strategy,
    leaf: HolonomicStrategy | None,
    plan: Plan,
    q0: Vector,
    limits: bool,
    tries: int = TRIES,
    *,
    load: bool,
    build: bool,
) -> Stepper:
    """The steps on the leaf through q0 (n,), of a strategy that is followed on one, or by velocity.

    Args:
        tries: pieces of one step in Python. load, build: as of `Function.follower`.
    """
    if leaf is not None:
        native = native_leaf(leaf, plan, q0, limits, load=load, build=build)
        return Stepper(leaf_stepper(leaf, plan, q0, tries), native)
    kernel = None  # as of G that is a Python function
    if not isinstance(strategy, NumericStrategy):
        kernel = path_rate(strategy).follower("velocity", load=load, build=build)
    native = None if kernel is None else NativeFollower(kernel, plan, q0.copy(), velocity_rules(), limits)
    return Stepper(_velocity_stepper(strategy, plan), native)


Following = Literal["velocity", "leaf"]
"""How a path is followed: by integrating dq = G x', or on a leaf."""

NATIVE_FROM = 5_000
"""Steps from which following is worth a compiler's second, once. Native code that this process has is always used."""

CACHED_FROM = 1_000
"""Steps from which native code is looked for among the libraries built before: its C must be written to know its name,
which takes 0.05 s, as long as some 700 steps on the virtual machine."""

BLOCK = 10_000
"""Native steps between two looks at the clock and the keyboard."""


@typed
def follow(
    strategy: Strategy,
    path: AnyPath,
    q0: ArrayLike,
    *,
    samples: int = 500,
    cycles: int = 1,
    method: Following | None = None,
    limits: bool = True,
    native: bool = False,
) -> Trajectory:
    """Follow a path from a start posture.

    Args:
        samples: steps a cycle, at least; corners of the path are always hit.
        cycles: runs of a closed path.
        method: "velocity" integrates dq = G x' by fixed-step RK4, as the paper does; "leaf" solves
            [f(q) - x; g(q) - c] = 0 at every sample, for a `HolonomicStrategy`. By default "leaf" for those,
            else "velocity".
        limits: stop at joint limits; False ignores them.
        native: build native code at once, a second's work, for a strategy that will follow many short paths; else it
            is built where a path has many steps.

    The orientation targets are the path's turns applied to its own rotation at the start, or, where it has none, to the
    tool's orientation at q0; positions are the path's. What the task leaves free of them moves no joint.

    Returns:
        A trajectory.

    Raises:
        StartError: the tool at q0 is not at the start of the path; `approach` goes there.
        JointLimitError: q0 is outside the limits.
        OpenPathError: several cycles of an open path. ArgumentError, ShapeError, NotFiniteError: bad arguments.
        PathError (LimitReachedError, OutOfReachError, PathSingularityError, BranchError, TrackingError): could not
            be followed to its end; `.trajectory` holds what was computed.
    """
    task, robot = strategy.task, strategy.task.robot
    # The start, how the strategy is followed from there, and the targets of the path.
    start = start_posture(robot, q0, limits)
    leaf = by_leaf(strategy, method)
    if whole("cycles", cycles) > 1 and not path.closed:
        raise OpenPathError(f"following {cycles} cycles", path.gap)
    strategy(start)
    plan = make_plan(task, path, whole("samples", samples), task._place(start)[1])
    check_start(task, start, *plan.first)
    walk = partial(_walk, strategy, leaf, plan, start, int(cycles), limits, native)
    return _to_jump(strategy, plan, int(cycles), walk)


def build_native(strategy: Strategy) -> None:
    """Build, or load, the native code by which a strategy follows paths; without a compiler nothing happens."""
    leaf = by_leaf(strategy)
    if leaf is None:
        path_rate(strategy).follower("velocity")
    else:
        leaf_step(leaf).follower("leaf", lambda: branch_code(leaf))


def by_leaf(strategy: Strategy, method: Following | None = None) -> HolonomicStrategy | None:
    """The strategy, where it is followed by leaf; None where by velocity. Raises: ArgumentError."""
    if method not in (None, *get_args(Following)):
        raise ArgumentError("method", method, f"use one of {', '.join(get_args(Following))}")
    if isinstance(strategy, HolonomicStrategy):
        return strategy if method != "velocity" else None
    if method == "leaf":
        cure = f"{strategy.name!r} has no constraint to hold: use 'velocity', or {HolonomicStrategy.cure}"
        raise ArgumentError("method", method, cure)
    return None


def _walk(
    strategy: Strategy, leaf: HolonomicStrategy | None, plan: Plan, q: Vector, cycles: int, limits: bool, native: bool
) -> Trajectory:
    method = "velocity" if leaf is None else "leaf"
    robot = strategy.task.robot
    lower, upper = robot.lower - TOLERANCES.limit, robot.upper + TOLERANCES.limit
    total = whole("the number of steps of all cycles", cycles * plan.steps)
    postures = np.empty((total + 1, len(q)))
    postures[0] = q
    done = 0

    def so_far(status: Status) -> Trajectory:
        postures.flags.writeable = False  # the trajectory keeps them as they are
        return _record(strategy, plan, postures[: done + 1], cycles, status)

    load, build = native or total >= CACHED_FROM, native or total >= NATIVE_FROM
    chosen = stepper(strategy, leaf, plan, q, limits, load=load, build=build)
    step, fast = chosen.step, chosen.native
    steps = _native_steps(fast, plan, q, cycles, postures) if fast is not None else ()
    with progress(f"following by {method}: {strategy.name}", total) as report:
        try:
            # In native code as far as it goes; it may halt at a limit or where the leaf ends.
            for done, q in steps:  # noqa: B007  q goes on below
                report(done)
            if fast is not None and done < total:
                fast.halted()
            # The rest in Python, a step at a time.
            for k in range(done, total):
                q = step(q, k % plan.steps)
                if limits and not ((q >= lower) & (q <= upper)).all():
                    robot.check_limits(q)
                done = k + 1
                postures[done] = q
                report(done)
        except JointLimitError as problem:
            fact = f"stopped {plan.where(done)}: {problem}"
            raise LimitReachedError(fact, KEPT, so_far(Status.LIMIT)) from None
        except (SingularityError, BranchError, TrackingError) as problem:
            where = plan.where(done)
            undefined = isinstance(problem, SingularityError) and problem.kind is SingularityKind.REPRESENTATION
            beyond = None if undefined else out_of_reach(plan, q, done % plan.steps, limits)
            if beyond is not None:
                fact = f"stopped {where}: {beyond.fact}"
                raise OutOfReachError(fact, "move or shrink the path", so_far(Status.OUT_OF_REACH)) from None
            fact = f"stopped {where}: {problem.fact if isinstance(problem, PathError) else problem}"
            if isinstance(problem, SingularityError):
                walk = so_far(Status.SINGULAR)
                raise PathSingularityError(problem.kind, fact, KEPT, walk) from None
            status = Status.BRANCH if isinstance(problem, BranchError) else Status.LOST
            raise type(problem)(fact, problem.cure, so_far(status)) from None
    return so_far(Status.COMPLETE)


def _to_jump(strategy: Strategy, plan: Plan, cycles: int, walk: Callable[[], Trajectory]) -> Trajectory:
    """A walk, which ends where g of a holonomic strategy jumps. Raises: BranchError, and what the walk raises."""
    if not (isinstance(strategy, HolonomicStrategy) and may_jump(strategy)):
        return walk()
    ended: PathError | None = None
    try:
        trajectory = walk()
    except PathError as problem:
        trajectory, ended = problem.trajectory, problem
    met = first_jump(strategy, trajectory.q)
    if met is None and isinstance(ended, BranchError):
        near = jump_near(strategy, trajectory.q[-1])
        met = None if near is None else (len(trajectory.q) - 1, near)
    if met is not None:
        last, jump = met
        before = _record(strategy, plan, trajectory.q[: last + 1], cycles, Status.JUMP)
        raise jump_problem(strategy, jump, f"stopped {plan.where(last)}: ", before) from ended
    if ended is not None:
        raise ended
    return trajectory


def _native_steps(
    fast: NativeFollower, plan: Plan, q: Vector, cycles: int, postures: Matrix
) -> Iterator[tuple[int, Vector]]:
    """(steps done, posture) after each block of native steps; ends early where they halt."""
    done = 0
    for _ in range(cycles):
        for first in range(0, plan.steps, BLOCK):
            last = min(plan.steps, first + BLOCK)
            count = fast.run(q, first, last, postures[done + 1 : done + 1 + last - first])
            done += count
            q = postures[done].copy()
            yield done, q
            if count < last - first:
                return


def _record(strategy: Strategy, plan: Plan, q: Matrix, cycles: int, status: Status) -> Trajectory:
    task = strategy.task

    def dq(samples: int) -> Matrix:  # at the start and at the ends of the steps
        rates = plan.rates_at_ends()
        dx = np.vstack([rates[:1], rates[1 + np.arange(samples - 1) % plan.steps]])[:samples]
        return strategy.rate.batch(q[:samples], dx)[0].reshape(samples, task.n)

    def residual(samples: int) -> Vector:
        leaf = by_leaf(strategy)
        if leaf is None or task.n == task.m:
            return np.zeros(samples)
        values = leaf.constraint_value.batch(q[:samples]).reshape(samples, -1)
        return np.abs(leaf.constraint.nearest(values - values[0])).max(axis=1)

    return record(task, plan, q, dq, cycles, status, residual)


Way = Literal["joints", "tool"]
"""What goes straight: the joints, or the tool."""

NEAR = 1e-12
"""Way [m or rad] that is none."""


@typed
def approach(
    strategy: Strategy,
    path: Path,
    q0: ArrayLike,
    *,
    by: Way = "joints",
    level: ArrayLike | None = None,
    samples: int = 100,
    speed: float = 0.5,
) -> Trajectory:
    """From any posture to one with the tool at the start of a path: `follow(strategy, path, approach(...).q[-1])`.

    The posture that is gone to is the one to which the strategy leads along the straight line of the tool: on the leaf
    through q0, or on the leaf asked for, to which the self-motion leads first. Where no straight line leads there, it
    is the nearest one that is found on the leaf; of a strategy without leaves, at the pose.

    Args:
        by: "joints" moves all joints evenly, as a robot's point-to-point motion does, wherever the tool then goes;
            "tool" moves the tool along the straight line.
        level: c (r,) of a strategy with leaves, as of `move_to_leaf`.
        samples: steps, at least. speed: of the fastest joint [joint units per s].

    Raises:
        PathError, SingularityError: the start of the path was not reached; by="tool": not along the straight line.
        JointLimitError: q0 is outside the limits. ArgumentError, ShapeError, NotFiniteError.
    """
    if by not in get_args(Way):
        raise ArgumentError("by", by, f"use one of {', '.join(get_args(Way))}")
    task, count = strategy.task, whole("samples", samples)
    of_one_tool(task, "an approach")
    robot = task.robot
    start = robot.checked(q0, "the start posture")
    robot.check_limits(start)
    positive("speed", speed, "give a positive speed of the joints")
    if level is not None and not isinstance(strategy, HolonomicStrategy):
        raise ArgumentError("level", level, f"{strategy.name!r} has none: leave it out, or {HolonomicStrategy.cure}")
    # Go to the level first, by the self-motion.
    rows = [start]
    if level is not None and isinstance(strategy, HolonomicStrategy):
        level_now = leaf_value(strategy, start)
        change = strategy.constraint.nearest(leaf_value(strategy, move_to_leaf(strategy, start, level)) - level_now)
        for share in np.linspace(0.0, 1.0, count + 1)[1:]:
            rows.append(move_to_leaf(strategy, rows[-1], level_now + share * change))
    # Then along the straight line of the tool; where that does not lead, to the nearest posture at its end.
    pose = task.pose(rows[-1])
    rotation = pose[:3, :3] if path.rotation is None else path.rotation
    way = straight(pose[:3, 3], pose[:3, :3], path.start, rotation)
    if np.abs(task.error(rows[-1], path.start, rotation)).max() <= NEAR:
        reached = np.array(rows)
    else:
        entry = Path((line_segment(pose[:3, 3], path.start, way.turn),), rotation=pose[:3, :3])
        try:
            reached = np.array([*rows[:-1], *follow(strategy, entry, rows[-1], samples=count).q])
        except (PathError, SingularityError):
            goal = _nearest_posture(strategy, path.start, rotation, rows[-1]) if by == "joints" else None
            if goal is None:
                raise
            reached = np.array([start, goal])
    # The joints themselves may go straight.
    if by == "joints":
        reached = start + np.linspace(0.0, 1.0, count + 1)[:, None] * (reached[-1] - start)
        reached[0] = start
    robot.check_limits(reached[-1])
    return recorded(task, reached, speed)


def _nearest_posture(strategy: Strategy, p: Vector, R: Matrix, near: Vector) -> Vector | None:
    """The posture nearest to another (n,) of those found at a pose, on the same leaf; None if there is none."""
    task = strategy.task
    if isinstance(strategy, HolonomicStrategy):
        postures = all_postures(strategy, pose_from(p, R), leaf_value(strategy, near), limits=True, near=near).q
        return postures[np.argmin(np.abs(postures - near).max(axis=1))] if len(postures) else None
    nearest = nearest_postures(task, p[None], R[None], near[None], limits=True)
    return nearest.q[0] if nearest.reached[0] and nearest.missing[0] <= TOLERANCES.start else None


def recorded(task: Task, q: Matrix, speed: float) -> Trajectory:
    """Postures (k, n) one after the other, the fastest joint at a speed."""
    moves = np.abs(np.diff(q, axis=0)).max(axis=1)
    q = q[np.concatenate([[True], moves > NEAR])]
    steps = np.abs(np.diff(q, axis=0)).max(axis=1) / speed
    t = np.concatenate([[0.0], np.cumsum(steps)])
    rates = np.vstack([np.diff(q, axis=0) / steps[:, None], np.zeros((1, task.n))])
    if len(q) > 1:
        rates[-1] = rates[-2]
    return trajectory_of(task, t, q, lambda count: rates[:count], marks=(0, len(q) - 1) if len(q) > 1 else (0,))
