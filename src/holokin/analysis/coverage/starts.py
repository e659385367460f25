"""What somebody would begin with: a task that leaves joints free, and regular, comfortable start postures."""

from __future__ import annotations

import numpy as np

from ...base.errors import ArgumentError
from ...base.types import Flags, Matrix, Vector
from ...motion.ik.reach import nearest_postures
from ...robot import Robot
from ...strategies.self_motions import least_motion
from ...strategies.tasks.task import Task
from ...strategies.tasks.task_kinds import pose, position

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
    if found.n == found.m:
        cure = (
            "the robot is not redundant for this task: hk.inverse finds the joints of a pose; take the task 'axis' if "
            "the tool may spin, or 'position'; or leave the task out"
        )
        raise ArgumentError(f"the number of redundant joints of {robot.name!r} for its {kind}", 0, cure)
    return found


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
    values = np.array([comfort(task, q) for q in Q])
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


def comfort(task: Task, q: Vector) -> float:
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
