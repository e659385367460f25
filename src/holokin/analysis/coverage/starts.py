"""What somebody would begin with: a task, start postures, the laws that fit, a workspace."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from ...base.errors import ArgumentError, NoArmError, NotFiniteError
from ...base.types import Array, Flags, Matrix, Value, Vector
from ...motion.ik.pose_paths import nearest_postures, surely_beyond
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
from ...strategies.constraints.arm import TURNED
from ...strategies.radial_strategy import least_motion
from ...strategies.tasks.task import Task
from ...strategies.tasks.task_kinds import pose, position
from .cover_workspace import Reach

POSTURES = 2000
"""Postures looked at for a start: among so many random ones of seven joints some are far from singular."""

SHARE = 0.5
"""Share of a joint's range, about its middle, in which a start posture lies: a quarter is left on either side."""

FREE = 1.2
"""Range [rad or m] on either side of zero for a joint without limits."""

SPREAD = 8
"""Postures at one tool pose from which laws are tried: with more, no better leaf was found on five arms."""

SEEDS = 96
"""Random postures from which those of a tool pose are searched for."""

CENTRED, STEP = (2, 5, 12), 0.3
"""Steps after which postures on the way to the middle of the joints' ranges are kept; share of the way of a step."""

EXACT = 1e-3
"""Error [m or rad] of a start's tool pose that does not matter: the start itself says which leaf it is."""


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


def task_of_kind(robot: Robot, tip: str | None, kind: str | None) -> Task:
    """The task of a kind, "pose", "axis" (the tool may spin about its z axis) or "position", or one that fits.

    Raises:
        ArgumentError: no joint is left free. TaskTooLargeError.
    """
    if kind is None:
        return fitting_task(robot, tip)
    if kind == "position":
        found = position(robot, tip)
    else:
        found = pose(robot, "axis", tip=tip) if kind == "axis" else pose(robot, tip=tip)
    check_redundant(found)
    return found


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
    lower, upper = robot.ranges(FREE)
    shares = np.random.default_rng(0).uniform((1 - SHARE) / 2, (1 + SHARE) / 2, (POSTURES, robot.n))
    Q = np.round(unwound(robot, lower + shares * (upper - lower)), 2)
    Q = Q[robot.within(Q)]
    return Q[np.argsort([-regular(task, q) for q in Q], kind="stable")]


def postures_at(task: Task, pose: Matrix, count: int = SPREAD) -> Matrix:
    """Postures (k, n) within the joint limits with the tool at a pose (4, 4), far from each other; none where there
    are none. The most comfortable is the first.

    Searched for from random postures, so that they are of all branches and all over the self-motions, and moved from
    there by self-motion towards the middle of the joints' ranges. No hinge has a whole turn too many.
    """
    p, R = pose[:3, 3], pose[:3, :3]
    lower, upper = task.robot.ranges(FREE)
    near = np.random.default_rng(0).uniform(lower, upper, (SEEDS, task.n))
    if not nearest_postures(task, p[None], R[None], near[:1], limits=True).reached[0]:
        return np.zeros((0, task.n))
    found = nearest_postures(task, np.tile(p, (SEEDS, 1)), np.tile(R, (SEEDS, 1, 1)), near, limits=True)
    Q = unwound(task.robot, _centred(task, found.q[found.reached], p, R))
    Q = Q[task.robot.within(Q)]
    values = np.array([_comfort(task, q) for q in Q])
    chosen = [int(np.argmax(values))]
    away = np.full(len(Q), np.inf)
    while len(chosen) < min(count, len(Q)):
        away = np.minimum(away, np.linalg.norm(Q - Q[chosen[-1]], axis=1))
        chosen.append(int(np.argmax(away * values)))
    return Q[chosen]


def _centred(task: Task, Q: Matrix, p: Vector, R: Matrix) -> Matrix:
    """Postures (k, n) with the tool at a pose, and others behind them (j k, n) on their ways to the middle of the
    joints' ranges.
    """
    lower, upper = task.robot.ranges(FREE)
    middle, found = (lower + upper) / 2, [Q]
    for k in range(max(CENTRED)):
        J = task.jacobian_batch(Q)[0]
        off = STEP * (middle - Q)
        e = task.error(Q, p, R) - np.einsum("kmn,kn->km", J, off)
        Q = Q + off + least_motion(J, e[:, :, None])[:, :, 0]
        if k + 1 in CENTRED:
            sound = np.abs(task.error(Q, p, R)).max(axis=1, initial=0.0) < EXACT
            found.append(Q[sound])
    return np.vstack(found)


def _comfort(task: Task, q: Vector) -> float:
    """How far a posture is from limits and singular postures, 0 to 1: least distance to a limit over half the joint's
    range, times `regular`."""
    robot = task.robot
    spans = (robot.upper - robot.lower) / 2
    free = ~np.isfinite(spans)
    shares = np.minimum(q - robot.lower, robot.upper - q)[~free] / spans[~free]
    return float(max(0.0, shares.min(initial=1.0)) * regular(task, q))


def unwound(robot: Robot, Q: Matrix) -> Matrix:
    """The same postures (k, n) with every hinge turned back by whole turns, as near to the middle of its range as that
    brings it; left as it is where the limits do not allow this.
    """
    lower, upper = robot.ranges(FREE)
    turns = np.where(_returns(robot), np.round((Q - (lower + upper) / 2) / (2 * np.pi)), 0.0)
    found = Q - 2 * np.pi * turns
    return np.where(robot.beyond(found) <= 0, found, Q)


def _returns(robot: Robot) -> Flags:
    """Which coordinates (n,) bring the robot back to where it was by a whole turn: angles without a broken gear."""
    whole = robot.hinges.copy()
    for joint in robot.joints:
        whole[joint.coordinate] &= float(joint.multiplier).is_integer()
    return whole


def regular(task: Task, q: Vector) -> float:
    """How far [J; rows of the locked joints] is from singular at q, 1 at best: smallest singular value over largest."""
    J = task.jacobian(q)
    locked = locked_joints(task, q)
    others = [i for i in range(task.n) if i not in locked]
    values = np.linalg.svd(J[:, others], compute_uv=False)
    return float(values[-1] / values[0]) if values[0] > 0 else 0.0


def locked_joints(task: Task, q: Vector) -> list[int]:
    """The r joints that determine the self-motion best: pivots of its basis N (n, r)."""
    N: Matrix = task.null_space(q).copy()
    chosen: list[int] = []
    for _ in range(task.n - task.m):
        sizes = np.linalg.norm(N, axis=1)
        sizes[chosen] = 0.0
        pivot = int(np.argmax(sizes))
        chosen.append(pivot)
        direction = N[pivot] / max(sizes[pivot], 1e-300)
        N = N - np.outer(N @ direction, direction)
    return sorted(chosen)


# --- The laws that fit a robot and its task: what `advise` compares.

TRANSVERSAL = 0.03
"""Least singular value of A N, rows of A and basis N orthonormal, from which a law is tried: below it the tool must
hardly move before the law's joints do."""

MOST_LOCKS, MOST_PAIRS = 10, 4
"""Sets of joints to lock, and linear laws, that are tried: those that fix the self-motion best. All seven joints of a
7R arm fit in; of the 84 sets of an arm of nine joints the others are worse at the start already."""

LEVEL_OF_COST = 0.0
"""The level of a stationary constraint at which its cost is stationary."""


@dataclass(frozen=True, eq=False)
class Candidate(Value):
    """A law to try: a name, what a job file says of it, and its constraint, None for `radial` of the pseudo-inverse.

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
    """The laws that fit: each has r = n - m rows and fixes the self-motion at one of the starts (k, n) at least.

    One redundant joint: each joint locked, differences or sums of parallel joints, the arm angle (both definitions),
    the elbow's height, stationary costs, radial. Several: sets of joints locked; the trunk locked (all joints before
    those of an arm of seven) over each law of the arm; stationary costs by Chang's basis; radial.
    """
    r = task.n - task.m
    bases = [_basis(task, q) for q in starts]
    found = list(_locks(task, bases))
    trunk = _trunk(task)
    inner = [] if len(trunk) != r - 1 else [*_pairs(task, starts, trunk), *_arms(task)]
    for name, keys, constraint in inner:
        if trunk:
            names = [task.robot.joint_names[i] for i in trunk]
            name = f"lock {', '.join(names)} over {name}"
            keys = {"kind": "stack", "constraints": [{"kind": "lock", "joints": names}, dict(keys)]}
            constraint = stack(lock(*names), constraint)
        found.append(_candidate(task, name, keys, constraint))
    found += _stationary(task, starts)
    return [c for c in found if _fixes(c, starts, bases)] + [Candidate("radial", {"kind": "radial"}, task)]


Named = tuple[str, Mapping[str, Any], Constraint]


def _candidate(
    task: Task, name: str, keys: Mapping[str, Any], constraint: Constraint, level: float | None = None
) -> Candidate:
    return Candidate(name, keys, task, holonomic(task, constraint, name=name), level)


def _locks(task: Task, bases: list[Matrix]) -> Iterator[Candidate]:
    """Sets of r joints to lock, those that fix the self-motion best first."""
    names = task.robot.joint_names
    sets = list(combinations(range(task.n), task.n - task.m))
    sizes = [max(_least(N[list(joints)]) for N in bases) for joints in sets]
    for i in np.argsort(-np.array(sizes), kind="stable")[:MOST_LOCKS]:
        joints = [names[j] for j in sets[i]]
        yield _candidate(task, f"lock {', '.join(joints)}", {"kind": "lock", "joints": joints}, lock(*joints))


def _pairs(task: Task, starts: Matrix, trunk: list[int]) -> Iterator[Named]:
    """Differences or sums of two parallel hinges, whichever fixes the self-motion better."""
    names, n = task.robot.joint_names, task.n
    free = [i for i in range(n) if i not in trunk]
    rows: list[tuple[float, Vector]] = []
    N = [_basis(task, q) for q in starts]
    for i, j in _parallel(task, free):
        best = max(((_size_of(row, N), row) for row in (_row(n, i, j, -1.0), _row(n, i, j, 1.0))), key=lambda e: e[0])
        rows.append(best)
    rows.sort(key=lambda entry: -entry[0])
    for _, row in rows[:MOST_PAIRS]:
        i, j = np.flatnonzero(row)
        name = f"{names[i]} {'-' if row[j] < 0 else '+'} {names[j]}"
        yield name, {"kind": "linear", "matrix": [row.tolist()]}, linear(row, name=name)


def _row(n: int, i: int, j: int, sign: float) -> Vector:
    row = np.zeros(n)
    row[i], row[j] = 1.0, sign
    return row


def _size_of(row: Vector, bases: Iterable[Matrix]) -> float:
    return max(float(np.linalg.norm(row @ N)) / 2**0.5 for N in bases)


def _parallel(task: Task, among: list[int]) -> Iterator[tuple[int, int]]:
    """Pairs of hinges whose axes are parallel where all joints stand at zero."""
    robot = task.robot
    axes = robot.jacobian(np.zeros(task.n), task.tip)[3:]
    for i, j in combinations(among, 2):
        both = robot.hinges[i] and robot.hinges[j] and axes[:, i].any() and axes[:, j].any()
        if both and np.linalg.norm(np.cross(axes[:, i], axes[:, j])) < TURNED:
            yield i, j


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


def _trunk(task: Task) -> list[int]:
    """The joints that come before those of an arm of as many joints as the task has rows, and one more."""
    order = sorted({joint.coordinate for joint in task.robot.joints})
    return order[: task.n - task.m - 1]


def _stationary(task: Task, starts: Matrix) -> Iterator[Candidate]:
    """Costs that are stationary under self-motions: joint centring, manipulability, gravity."""
    r, robot = task.n - task.m, task.robot
    free = None if r == 1 else tuple(robot.joint_names[i] for i in locked_joints(task, starts[0]))
    more = {} if free is None else {"free": list(free)}
    costs = {"centring": centring_cost(), "manipulability": manipulability_cost(), "gravity": gravity_cost()}
    if not (np.isfinite(robot.lower) & np.isfinite(robot.upper)).any():
        del costs["centring"]
    if not robot.bodies or robot.planar:
        del costs["gravity"]
    for word, cost in costs.items():
        keys = {"kind": "stationary", "cost": word, **more, "level": LEVEL_OF_COST}
        yield _candidate(task, f"stationary {word}", keys, stationary(cost, free=free), LEVEL_OF_COST)


def _basis(task: Task, q: Vector) -> Matrix:
    """An orthonormal basis (n, r) of the self-motions at q."""
    return np.linalg.qr(task.null_space(q))[0]


def _least(rows: Matrix) -> float:
    """The least singular value."""
    return float(np.linalg.svd(rows, compute_uv=False)[-1])


def _fixes(candidate: Candidate, starts: Matrix, bases: list[Matrix]) -> bool:
    """Whether at some start the rows of its constraint, made unit, tell every self-motion."""
    if candidate.strategy is None:
        return True
    for q, N in zip(starts, bases, strict=True):
        try:
            A = candidate.strategy.rows(q)
        except NotFiniteError:
            continue
        sizes = np.linalg.norm(A, axis=1, keepdims=True)
        if (sizes > 0).all() and _least(A / sizes @ N) > TRANSVERSAL:
            return True
    return False


# --- What `advise` proposes where it is not told: a start, a workspace; and which poses of one any posture reaches.

POSES = 64
"""Poses by which a workspace is proposed."""

SIDES = (0.15, 0.1, 0.07, 0.05)
"""Half sides of a workspace that is proposed, over the length of the arm: the first one nearly all in reach."""

NEARLY = 0.97
"""Share of its poses that are reached then within the joint limits, by some posture."""

TILT, SPIN = 0.25, 0.5
"""Its turns [rad]: those of a tool that follows a gently curved surface."""


def first_start(task: Task) -> Vector:
    """The most comfortable of the regular start postures."""
    found = regular_starts(task)
    return found[int(np.argmax([_comfort(task, q) for q in found]))]


def proposed_workspace(task: Task, q0: Vector) -> PoseRange:
    """A box round the tool at a start posture, with turns about its orientation there."""
    robot, at = task.robot, task.pose(q0)
    length = sum(float(np.linalg.norm(joint.step)) for joint in robot.joints[1:]) or 1.0
    tilt, spin = (0.0, 0.0) if robot.planar or task.orientation is None else (TILT, SPIN)

    def box(side: float) -> PoseRange:
        half = side * length * np.array([1.0, 1.0, 0.0 if robot.planar else 1.0])
        return pose_range(box=(at[:3, 3].round(3), half.round(3)), rotation=at[:3, :3], tilt=tilt, spin=spin)

    for side in SIDES[:-1]:
        if reached(task, box(side).poses(POSES), q0)[1].within.mean() >= NEARLY:
            return box(side)
    return box(SIDES[-1])


def reached(task: Task, T: Array, start: Vector | None) -> tuple[Matrix, Reach]:
    """Postures (k, n) at poses (k, 4, 4), within the limits if there are such, NaN where there are none."""
    p, R = np.ascontiguousarray(T[:, :3, 3]), np.ascontiguousarray(T[:, :3, :3])
    near = np.tile(regular_starts(task)[0] if start is None else start, (len(T), 1))
    Q, found_with = np.full_like(near, np.nan), {}
    rest = np.flatnonzero(~surely_beyond(task, p, R))
    for limits in (True, False):
        found_with[limits] = np.isfinite(Q).all(axis=1)
        if len(rest):
            found = nearest_postures(task, p[rest], R[rest], near[rest], limits=limits)
            Q[rest[found.reached]] = found.q[found.reached]
            found_with[limits][rest] = found.reached
            rest = rest[~found.reached]
    return Q, Reach(found_with[False], found_with[True])
