"""What somebody would begin with: a task, start postures, the strategies that fit, a workspace."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Literal

import numpy as np

from ...base.errors import ArgumentError, NoArmError, NotFiniteError
from ...base.types import Array, Indices, Matrix, Value, Vector
from ...motion.self_motions.least_squares import nearest_postures
from ...motion.self_motions.pose_reach import Reach, at_best_turns, every_posture, reach_of
from ...path.workspaces import PoseRange
from ...path.workspaces import workspace as pose_range
from ...robot import Robot
from ...strategies import HolonomicStrategy, holonomic
from ...strategies.constraints import (
    Constraint,
    arm_angle,
    centring_cost,
    find_arm,
    gravity_cost,
    height,
    linear,
    lock,
    manipulability_cost,
    stack,
    stationary,
)
from ...strategies.self_motion_curves import least_motion
from ...strategies.tasks.task import Task
from ...strategies.tasks.task_kinds import pose, position
from ...symbolic.linear import null_space

FREE = 1.2
"""Range [rad or m] on either side of zero for a joint without limits."""

SPREAD = 8
"""Postures at one tool pose from which strategies are tried: with more, no better leaf was found on five arms."""


def fitting_task(robot: Robot, tip: str | None = None) -> Task:
    """A task with fewer rows than joints: the pose, else the position, else the first rows of it.

    Raises:
        ArgumentError: a robot of one joint, which is never redundant.
    """
    if robot.n < 2:
        raise ArgumentError(f"the number of joints of {robot.name!r}", robot.n, "it needs two, to be redundant")
    if robot.n > (3 if robot.planar else 6):
        return pose(robot, tip=tip)
    if robot.n > (2 if robot.planar else 3):
        return position(robot, tip)
    return position(robot, tip, rows=range(robot.n - 1))


def task_of_kind(robot: Robot, tip: str | None, kind: Literal["pose", "axis", "position"] | None) -> Task:
    """The task of a kind, "pose", "axis" (the tool may spin about its z axis) or "position", or one that fits.

    Raises:
        ArgumentError: no joint is left free. RowsError.
    """
    if kind is None:
        return fitting_task(robot, tip)
    task = position(robot, tip) if kind == "position" else pose(robot, "axis" if kind == "axis" else "twist", tip=tip)
    check_redundant(task)
    return task


def check_redundant(task: Task) -> None:
    """Raises: ArgumentError: each tool pose has finitely many postures, among which no rule can choose."""
    if task.n == task.m:
        cure = "hk.ik finds the joints of a pose; take the task 'axis' if the tool may spin, or 'position'"
        raise ArgumentError(f"the number of redundant joints of {task.robot.name!r} for its {task.name}", 0, cure)


def kinds_that_fit(robot: Robot) -> tuple[str, ...]:
    """The kinds of task that leave a joint free, the largest first."""
    rows = {"pose": 3, "position": 2} if robot.planar else {"pose": 6, "axis": 5, "position": 3}
    return tuple(kind for kind, m in rows.items() if robot.n > m)


def check_that_joints_move(robot: Robot) -> None:
    """Raises: ArgumentError: a joint whose two limits are one, as of exporters that leave them at 0."""
    for joint in robot.coordinates:
        if joint.lower == joint.upper:
            cure = f"give it a range in the robot description, or hold it: locked={{{joint.name!r}: {joint.lower:g}}}"
            raise ArgumentError(f"the range of joint {joint.name!r}", [joint.lower, joint.upper], cure)


def regular_starts(task: Task) -> Matrix:
    """Start postures (k, n) in the middle of the joint limits, rounded to a hundredth, the most regular first."""
    robot = task.robot
    check_that_joints_move(robot)
    # Among 2,000 random postures of seven joints some are far from singular; a quarter of each range is left on either
    # side
    lower, upper = robot.ranges(FREE)
    shares = np.random.default_rng(0).uniform(0.25, 0.75, (2000, robot.n))
    Q = np.round(unwound(robot, lower + shares * (upper - lower)), 2)
    Q = Q[robot.within(Q)]
    return Q[np.argsort(-regular(task, Q), kind="stable")]


def postures_at(task: Task, pose: Matrix, count: int = SPREAD) -> Matrix:
    """Postures (k, n) within the joint limits with the tool at a pose (4, 4), far from each other; none where there
    are none. The most comfortable is the first."""
    Q = postures_within_limits(task, pose)
    if not len(Q):
        return Q
    # The most comfortable, then those that are comfortable and far from all before
    values = _comfort(task, Q)
    chosen = [int(np.argmax(values))]
    away = np.full(len(Q), np.inf)
    while len(chosen) < min(count, len(Q)):
        away = np.minimum(away, np.linalg.norm(Q - Q[chosen[-1]], axis=1))
        chosen.append(int(np.argmax(away * values)))
    return Q[chosen]


def postures_within_limits(task: Task, pose: Matrix) -> Matrix:
    """Postures (k, n) within the joint limits with the tool at a pose (4, 4).

    They are those of all its self-motions, some tenths of a radian apart, where these are known. Elsewhere they are
    searched for from random postures, and moved by self-motion towards the middle of the joints' ranges. No hinge
    has a whole turn too many.
    """
    p, R, seeds = pose[:3, 3], pose[:3, :3], 96
    lower, upper = task.robot.ranges(FREE)
    near = np.random.default_rng(0).uniform(lower, upper, (seeds, task.n))
    every = every_posture(task, p[None], R[None])
    best = reach_of(task, p[None], R[None], near[:1], every=every)
    if not best.within[0]:
        return np.zeros((0, task.n))
    if every is None:
        # Postures of all branches, and others on their ways to the middle of the ranges
        nearest = nearest_postures(task, np.tile(p, (seeds, 1)), np.tile(R, (seeds, 1, 1)), near, limits=True)
        Q = _centred(task, nearest.q[nearest.reached], p, R)
    else:
        Q = np.vstack([best.q, at_best_turns(task.robot, every.q)])
    Q = unwound(task.robot, Q)
    return Q[task.robot.within(Q)]


def _centred(task: Task, Q: Matrix, p: Vector, R: Matrix) -> Matrix:
    """Postures (k, n) with the tool at a pose, and others behind them (j k, n) on their ways to the middle of the
    joints' ranges, after 2, 5 and 12 steps of 0.3 of the way.
    """
    lower, upper = task.robot.ranges(FREE)
    middle, postures = (lower + upper) / 2, [Q]
    for k in range(1, 13):
        J = task.jacobian_batch(Q)[0]
        off = 0.3 * (middle - Q)
        e = task.error(Q, p, R) - np.einsum("kmn,kn->km", J, off)
        Q = Q + off + least_motion(J, e[:, :, None])[:, :, 0]
        if k in (2, 5, 12):  # an error of 1e-3 does not matter: the start itself says which leaf it is
            postures.append(Q[np.abs(task.error(Q, p, R)).max(axis=1, initial=0.0) < 1e-3])
    return np.vstack(postures)


def _comfort(task: Task, Q: Matrix) -> Vector:
    """How far postures (k, n) are from limits and singular postures (k,), 0 to 1: least distance to a limit over half
    the joint's range, times `regular`."""
    robot = task.robot
    spans = (robot.upper - robot.lower) / 2
    free = ~np.isfinite(spans)
    shares = np.minimum(Q - robot.lower, robot.upper - Q)[:, ~free] / spans[~free]
    return np.maximum(0.0, shares.min(axis=1, initial=1.0)) * regular(task, Q)


def unwound(robot: Robot, Q: Matrix) -> Matrix:
    """The same postures (k, n) with every hinge turned back by whole turns, as near to the middle of its range as that
    brings it; left as it is where the limits do not allow this.
    """
    # Angles without a broken gear bring the robot back to where it was by a whole turn
    returns = robot.hinges.copy()
    for joint in robot.joints:
        returns[joint.coordinate] &= float(joint.multiplier).is_integer()
    lower, upper = robot.ranges(FREE)
    turns = np.where(returns, np.round((Q - (lower + upper) / 2) / (2 * np.pi)), 0.0)
    back = Q - 2 * np.pi * turns
    return np.where(robot.beyond(back) <= 0, back, Q)


def regular(task: Task, Q: Matrix) -> Vector:
    """How far (k,) [J; rows of the locked joints] is from singular at postures (k, n), 1 at best: smallest singular
    value over largest."""
    J = np.nan_to_num(task.jacobian_batch(Q)[0])
    locked = np.zeros(Q.shape, dtype=bool)
    np.put_along_axis(locked, _pivots(null_space(J)), True, axis=1)
    others = np.argsort(locked, axis=1, kind="stable")[:, : task.m]
    values = np.linalg.svd(np.take_along_axis(J, others[:, None], axis=2), compute_uv=False)
    return values[:, -1] / np.maximum(values[:, 0], 1e-300)


def locked_joints(task: Task, q: Vector) -> list[int]:
    """The r joints that determine the self-motion best: pivots of its basis N (n, r)."""
    return sorted(_pivots(task.null_space(q)[None])[0].tolist())


def _pivots(N: Array) -> Indices:
    """Pivots (k, r) of bases (k, n, r): rows that are longest, one after the other, without their parts along those
    before."""
    count, n, r = N.shape
    rows, chosen, left = np.arange(count), np.zeros((count, 0), dtype=np.intp), np.ones((count, n), dtype=bool)
    for _ in range(r):
        sizes = np.where(left, np.linalg.norm(N, axis=2), 0.0)
        pivot = np.argmax(sizes, axis=1)
        left[rows, pivot] = False
        chosen = np.column_stack([chosen, pivot])
        direction = N[rows, pivot] / np.maximum(sizes[rows, pivot], 1e-300)[:, None]
        N = N - (N @ direction[:, :, None]) * direction[:, None]
    return chosen


# --- The strategies that fit a robot and its task: what `advise` compares.


@dataclass(frozen=True, eq=False)
class Candidate(Value):
    """A strategy to try: a name, what a job file says of it, and its constraint, None for `radial` of the
    pseudo-inverse.

    `level`: the leaf that it asks for, None where any will do.
    """

    name: str
    keys: Mapping[str, Any]
    task: Task
    strategy: HolonomicStrategy | None = None
    level: float | None = None

    @property
    def kind(self) -> str:
        """Its kind, as job files call it."""
        return str(self.keys["kind"])


def candidates(task: Task, starts: Matrix) -> list[Candidate]:
    """The strategies that fit: each has r = n - m rows and fixes the self-motion at one of the starts (k, n) at least.

    One redundant joint: each joint locked, differences or sums of parallel joints, the arm angle (both definitions),
    the elbow's height, stationary costs, radial. Several: sets of joints locked; the trunk locked (all joints before
    those of an arm of seven) over each strategy of the arm; stationary costs by Chang's basis; radial.
    """
    bases = [np.linalg.qr(task.null_space(q))[0] for q in starts]
    rules = [*_locks(task, bases)]
    # The trunk: the joints that come before those of an arm of as many joints as the task has rows, and one more
    trunk = sorted({joint.coordinate for joint in task.robot.joints})[: task.n - task.m - 1]
    names = [task.robot.joint_names[i] for i in trunk]
    arm_rules = [*_pairs(task, bases, trunk), *_arms(task)] if len(trunk) == task.n - task.m - 1 else []
    for name, keys, constraint in arm_rules:
        if trunk:
            name = f"lock {', '.join(names)} over {name}"
            keys = {"kind": "stack", "constraints": [{"kind": "lock", "joints": names}, dict(keys)]}
            constraint = stack(lock(*names), constraint)
        rules.append((name, keys, constraint))
    fitting = [Candidate(name, keys, task, holonomic(task, rule, name=name)) for name, keys, rule in rules]
    # A cost is stationary at level 0 of its constraint
    for name, keys, rule in _stationary(task, starts):
        fitting.append(Candidate(name, keys, task, holonomic(task, rule, name=name), level=0.0))
    return [c for c in fitting if _fixes(c, starts, bases)] + [Candidate("radial", {"kind": "radial"}, task)]


Named = tuple[str, Mapping[str, Any], Constraint]


def _locks(task: Task, bases: list[Matrix]) -> Iterator[Named]:
    """The ten sets of r joints to lock that fix the self-motion best, these first: all seven joints of a 7R arm; of the
    84 sets of an arm of nine joints the others are worse at the start already.
    """
    sets = list(combinations(range(task.n), task.n - task.m))
    sizes = [max(_least(N[list(joints)]) for N in bases) for joints in sets]
    for i in np.argsort(-np.array(sizes), kind="stable")[:10]:
        names = [task.robot.joint_names[j] for j in sets[i]]
        yield f"lock {', '.join(names)}", {"kind": "lock", "joints": names}, lock(*names)


def _pairs(task: Task, bases: list[Matrix], trunk: list[int]) -> Iterator[Named]:
    """Differences or sums of two parallel hinges, whichever fixes the self-motion better; the four best of these."""
    robot, rows = task.robot, []
    axes = robot.jacobian(np.zeros(task.n), task.tip)[3:]
    for i, j in combinations([i for i in range(task.n) if i not in trunk and robot.hinges[i]], 2):
        # Parallel to a thousandth, where all joints stand at zero
        if axes[:, i].any() and axes[:, j].any() and np.linalg.norm(np.cross(axes[:, i], axes[:, j])) < 1e-3:
            both = np.eye(task.n)[i] + np.array([[-1.0], [1.0]]) * np.eye(task.n)[j]
            sizes = [max(float(np.linalg.norm(row @ N)) for N in bases) for row in both]
            rows.append((max(sizes), both[int(np.argmax(sizes))]))
    for _, row in sorted(rows, key=lambda entry: -entry[0])[:4]:
        i, j = np.flatnonzero(row)
        name = f"{robot.joint_names[i]} {'-' if row[j] < 0 else '+'} {robot.joint_names[j]}"
        yield name, {"kind": "linear", "matrix": [row.tolist()]}, linear(row, name=name)


def _arms(task: Task) -> Iterator[Named]:
    """The arm angle by both definitions, and the height of the elbow."""
    try:
        elbow = find_arm(task).elbow
    except NoArmError:
        return
    for kind in ("stereographic", "conventional"):
        yield f"arm angle ({kind})", {"kind": "arm-angle", "definition": kind}, arm_angle(definition=kind)
    name = task.robot.joints[elbow.joint].name
    yield f"height of {name}", {"kind": "height", "joints": [name]}, height(name)


def _stationary(task: Task, starts: Matrix) -> Iterator[Named]:
    """Costs that are stationary under self-motions: joint centring, manipulability, gravity."""
    robot, free = task.robot, None
    if task.n - task.m > 1:
        free = tuple(robot.joint_names[i] for i in locked_joints(task, starts[0]))
    more = {} if free is None else {"free": list(free)}
    costs = {"manipulability": manipulability_cost()}
    if (np.isfinite(robot.lower) & np.isfinite(robot.upper)).any():
        costs = {"centring": centring_cost(), **costs}
    if robot.bodies and not robot.planar:
        costs["gravity"] = gravity_cost()
    for word, cost in costs.items():
        keys = {"kind": "stationary", "cost": word, **more, "level": 0.0}
        yield f"stationary {word}", keys, stationary(cost, free=free)


def _least(rows: Matrix) -> float:
    """The least singular value."""
    return float(np.linalg.svd(rows, compute_uv=False)[-1])


def _fixes(candidate: Candidate, starts: Matrix, bases: list[Matrix]) -> bool:
    """Whether at some start the rows of its constraint, made unit, tell every self-motion.

    Least singular values of 0.03 or less are too few: the tool must hardly move before the strategy's joints do.
    """
    if candidate.strategy is None:
        return True
    for q, N in zip(starts, bases, strict=True):
        with suppress(NotFiniteError):
            A = candidate.strategy.rows(q)
            sizes = np.linalg.norm(A, axis=1, keepdims=True)
            if (sizes > 0).all() and _least(A / sizes @ N) > 0.03:
                return True
    return False


# --- What `advise` proposes where it is not told: a start, a workspace; and which poses of one any posture reaches.


def first_start(task: Task) -> Vector:
    """The most comfortable of the regular start postures."""
    starts = regular_starts(task)
    return starts[np.argmax(_comfort(task, starts))]


def proposed_workspace(task: Task, q0: Vector) -> PoseRange:
    """A box round the tool at a start posture, with turns about its orientation there as of a tool that follows a
    gently curved surface: the largest of four that is nearly all in reach within the joint limits, by some posture.
    """
    robot, tool = task.robot, task.pose(q0)
    length = sum(float(np.linalg.norm(joint.step)) for joint in robot.joints[1:]) or 1.0
    tilt, spin = (0.0, 0.0) if robot.planar or task.orientation is None else (0.25, 0.5)

    def box(side: float) -> PoseRange:
        half = side * length * np.array([1.0, 1.0, 0.0 if robot.planar else 1.0])
        return pose_range(box=(tool[:3, 3].round(3), half.round(3)), rotation=tool[:3, :3], tilt=tilt, spin=spin)

    def served(space: PoseRange) -> float:
        """Share of 64 poses that some posture within the limits has."""
        T = space.poses(64)
        p, R = np.ascontiguousarray(T[:, :3, 3]), np.ascontiguousarray(T[:, :3, :3])
        if (every := every_posture(task, p, R)) is None:
            return float(reached(task, T, q0).within.mean())
        return len(np.unique(every.pose[robot.within(at_best_turns(robot, every.q))])) / len(T)

    # Half sides over the length of the arm; 97 % of 64 poses are nearly all
    sides = (side for side in (0.15, 0.1, 0.07) if served(box(side)) >= 0.97)
    return box(next(sides, 0.05))


def reached(task: Task, T: Array, start: Vector | None) -> Reach:
    """By which postures poses (k, 4, 4) are reached; a search begins at a start (n,), else at a regular posture."""
    near = np.tile(regular_starts(task)[0] if start is None else start, (len(T), 1))
    return reach_of(task, np.ascontiguousarray(T[:, :3, 3]), np.ascontiguousarray(T[:, :3, :3]), near)
