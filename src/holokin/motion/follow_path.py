"""`follow`: a strategy, a path and a start posture give a trajectory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Literal, get_args

import numpy as np

from ..base.arguments import typed
from ..base.errors import (
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
from ..base.errors.motion_errors import KEPT
from ..base.progress import progress
from ..base.tolerances import TOLERANCES
from ..base.types import ArrayLike, Matrix, Vector, whole
from ..path.synchronized_paths import AnyPath
from ..robot import start_posture
from ..strategies import HolonomicStrategy, Strategy, first_jump, jump_near, may_jump
from .ik.branch import branch_code
from .ik.leaf import jump_problem, leaf_step, leaf_stepper, native_leaf
from .ik.native_follower import NativeFollower
from .ik.plan import Plan, check_start, make_plan
from .ik.reach import out_of_reach
from .integrate_velocity import native_velocity, path_rate, velocity_stepper
from .recorded_trajectory import record
from .trajectory import Status, Trajectory

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
    start = start_posture(robot, q0, limits)
    leaf = by_leaf(strategy, method)
    if whole("cycles", cycles) > 1 and not path.closed:
        raise OpenPathError(f"following {cycles} cycles", path.gap)
    strategy(start)
    plan = make_plan(task, path, whole("samples", samples), task.place(start)[1])
    check_start(task, start, *plan.first)
    once = partial(_walk, strategy, leaf, plan, start, int(cycles), limits, native)
    return _to_jump(strategy, plan, int(cycles), once)


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
    strategy: Strategy, leaf: HolonomicStrategy | None, plan: Plan, q: Vector, cycles: int, limits: bool,
    native: bool,
) -> Trajectory:  # fmt: skip
    method = "velocity" if leaf is None else "leaf"
    stepper = velocity_stepper(strategy, plan) if leaf is None else leaf_stepper(leaf, plan, q)
    robot = strategy.task.robot
    lower, upper = robot.lower - TOLERANCES.limit, robot.upper + TOLERANCES.limit
    total = whole("the number of steps of all cycles", cycles * plan.steps)
    postures = np.empty((total + 1, len(q)))
    postures[0] = q
    done = 0

    def so_far(status: Status) -> Trajectory:
        postures.flags.writeable = False  # the trajectory keeps them as they are
        return _record(strategy, plan, postures[: done + 1], cycles, status)

    sources = {"load": native or total >= CACHED_FROM, "build": native or total >= NATIVE_FROM}
    if leaf is None:
        fast = native_velocity(strategy, plan, q, limits, **sources)
    else:
        fast = native_leaf(leaf, plan, q, limits, **sources)
    steps = _native_steps(fast, plan, q, cycles, postures) if fast is not None else ()
    with progress(f"following by {method}: {strategy.name}", total) as report:
        try:
            for done, q in steps:  # noqa: B007  q goes on below
                report(done)
            if fast is not None and done < total:
                fast.halted()
            for step in range(done, total):
                q = stepper(q, step % plan.steps)
                if limits and not ((q >= lower) & (q <= upper)).all():
                    robot.check_limits(q)
                done = step + 1
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
    """A walk, which ends where g of a holonomic strategy jumps. Raises: JumpError, and what the walk raises."""
    if not (isinstance(strategy, HolonomicStrategy) and may_jump(strategy)):
        return walk()
    ended: PathError | None = None
    try:
        found = walk()
    except PathError as problem:
        found, ended = problem.trajectory, problem
    met = first_jump(strategy, found.q)
    if met is None and isinstance(ended, BranchError):
        near = jump_near(strategy, found.q[-1])
        met = None if near is None else (len(found.q) - 1, near)
    if met is not None:
        last, jump = met
        kept = _record(strategy, plan, found.q[: last + 1], cycles, Status.JUMP)
        raise jump_problem(strategy, jump, f"stopped {plan.where(last)}: ", kept) from ended
    if ended is not None:
        raise ended
    return found


def _native_steps(
    fast: NativeFollower, plan: Plan, q: Vector, cycles: int, postures: Matrix
) -> Iterator[tuple[int, Vector]]:
    """(steps done, posture) after each block of native steps; ends early where they halt."""
    done = 0
    for _ in range(cycles):
        for first in range(0, plan.steps, BLOCK):
            last = min(plan.steps, first + BLOCK)
            did = fast.run(q, first, last, postures[done + 1 : done + 1 + last - first])
            done += did
            q = postures[done].copy()
            yield done, q
            if did < last - first:
                return


def _joint_rates(strategy: Strategy, plan: Plan, q: Matrix) -> Matrix:
    """Joint rates (k, n) of a strategy at postures (k, n), one after the other of a plan from its start on."""
    rates = plan.rates_at_ends()
    index = 1 + np.arange(len(q) - 1) % plan.steps
    return strategy.rate.batch(q, np.vstack([rates[:1], rates[index]])[: len(q)])[0].reshape(len(q), strategy.task.n)


def _record(strategy: Strategy, plan: Plan, q: Matrix, cycles: int, status: Status) -> Trajectory:
    task = strategy.task

    def dq(samples: int) -> Matrix:
        return _joint_rates(strategy, plan, q[:samples])

    def residual(samples: int) -> Vector:
        leaf = by_leaf(strategy)
        if leaf is None or task.n == task.m:
            return np.zeros(samples)
        values = leaf.constraint_value.batch(q[:samples]).reshape(samples, -1)
        return np.abs(leaf.constraint.nearest(values - values[0])).max(axis=1)

    return record(task, plan, q, dq, cycles, status, residual)
