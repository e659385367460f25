"""One law after a dragged tool: from a posture to the joints of a tool pose, or where it stays and why."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...base.errors import HolokinError
from ...base.poses import PoseLike, given_pose, pose_from, pose_numbers
from ...base.tolerances import TOLERANCES
from ...base.types import Array, Value, Vector, tool_pose
from ...motion import StepStatus, controller
from ...motion.control import ControlLaw
from ...motion.ik import InverseStatus, inverse
from ...motion.ik.leaf import PathEnd, leaf_value, leaf_walk, straight_path
from ...motion.ik.quiet_answers import how_far, is_native
from ...path.straight_path import StraightPath, straight
from ...strategies import HolonomicStrategy, Strategy
from ...strategies.tasks.free_motion import completed
from ...strategies.tasks.task import Task
from .session_laws import Law
from .states import LawStatus

PERIOD = 0.1
"""Step of a law that follows by velocity [s]: no joint goes farther in a step than at its full speed in this time."""

LONG, TURN = 0.01, 0.05
"""Longest step of the target [m], [rad]: a Panda's joints then move by 0.02 rad, and errors stay below 1e-4."""

CORRECTIONS = 12
"""Steps at the end of the way that take the tool to its target: Newton's method needs three."""

MOST = 400
"""Steps of one way at most: four metres."""

PIECES = 60
"""Pieces of one path along a leaf where there is no native code: 0.1 s of a Panda's joint locked, at most."""

STRETCHED = 0.03
"""Smallest over largest singular value of J, in m and rad as they come, below which an arm that stops is stretched or
folded, and its law no reason: on ways out of a Panda's workspace it was at most 0.02, where it is ready it is 0.1."""

EXACT = 1e-9
"""Error [m or rad] at which a tool is at its target."""

DOUBTFUL = 1e-4
"""The same of a control law, which may have no feedback."""


@dataclass(frozen=True, eq=False)
class Move(Value):
    """Where a law stands after a target: joints (n,), its status, and a sentence where it does not follow."""

    q: Vector
    status: LawStatus
    sentence: str = ""


Follower = Callable[[Vector, Array, bool], Move]
"""(posture, poses (F, 4, 4), whether to wait for the compiler) -> the move to them."""


def poses_of(task: Task, pose: PoseLike) -> Array:
    """(F, 4, 4) of a pose (4, 4), or of one for each of the F frames of a task.

    Raises:
        ShapeError, NotFiniteError, ArgumentError: what is no pose.
    """
    given = pose_numbers("a tool pose", pose)
    shaped = given[None] if task.frames == 1 and given.ndim == 2 else given
    poses = given_pose("a tool pose", shaped, (task.frames, 4, 4))
    for one in poses:
        tool_pose("a tool pose", one)
    return poses


def follower(law: Law, q0: Vector, limits: bool) -> Follower:
    """What takes a law from a posture to a tool pose; a holonomic one on the leaf through `q0` (n,).

    Raises:
        HolokinError: the law is not defined there.
    """
    if isinstance(law.rule, HolonomicStrategy):
        return _by_leaf(law.rule, q0, limits)
    if isinstance(law.rule, Strategy):
        return _by_velocity(law.rule, limits)
    return _by_steps(law.rule, law.task, limits)


def _by_leaf(strategy: HolonomicStrategy, q0: Vector, limits: bool) -> Follower:
    """In a region round the start the same pose has the same joints, whatever the path of the tool."""
    ik, task = inverse(strategy, q0, limits), strategy.task
    level = leaf_value(strategy, q0)

    def go(q: Vector, poses: Array, wait: bool) -> tuple[Vector, InverseStatus]:
        pose = poses[0] if task.frames == 1 else poses
        if wait and is_native(ik):
            try:
                return ik.near(pose, q), InverseStatus.REACHED
            except HolokinError:
                return how_far(ik, pose, q)
        walk, at = leaf_walk(strategy, q, PIECES), leaf_value(strategy, q)  # no compiler, or it is not done yet
        levels = at, at + strategy.constraint.nearest(level - at)
        last, ended = walk(q, straight_path(task, task.place(q), task.target(poses), levels))
        return last, InverseStatus.REACHED if ended is PathEnd.REACHED else InverseStatus.LEAF_ENDS

    def follow(q: Vector, poses: Array, wait: bool) -> Move:
        last, status = go(q, poses, wait)
        if status is InverseStatus.LIMIT or (limits and status is InverseStatus.REACHED and _beyond(task, last)):
            return Move(q, LawStatus.LIMIT, limit_sentence(task, last))
        if status is InverseStatus.REACHED:
            return Move(last, LawStatus.FOLLOWING)
        return Move(q, *stopped(task, strategy.name, last))

    return follow


def _beyond(task: Task, q: Vector) -> bool:
    """Whether a posture (n,) is beyond the joint limits."""
    return bool((task.robot.beyond(q) > TOLERANCES.limit).any())


def _by_velocity(strategy: Strategy, limits: bool) -> Follower:
    """Small steps along the straight path, each slowed where a joint would be too fast, then Newton's method."""
    task = strategy.task
    law = controller(strategy, dt=PERIOD, gain=1 / PERIOD, limits=limits)
    still = np.zeros(6) if task.frames == 1 else np.zeros((task.frames, 6))
    error = task.error_function

    def follow(q: Vector, poses: Array, _wait: bool) -> Move:
        path, steps = _way(task, q, poses)
        seen, status = [q], StepStatus.OK
        for k in range(1, steps + CORRECTIONS + 1):
            target = path.at(k / steps) if k < steps else task.target(poses)
            seen.append(seen[-1] + PERIOD * law.step(seen[-1], _pose(task, target), still))
            status = law.status
            if status >= StepStatus.LIMIT:
                break
            if k >= steps and np.abs(error(seen[-1], *target)).max() < EXACT:
                return Move(seen[-1], LawStatus.FOLLOWING)
        if status is StepStatus.LIMIT:
            return Move(q, LawStatus.LIMIT, limit_sentence(task, seen[-1]))
        return Move(q, *stopped(task, strategy.name, *seen))

    return follow


def _by_steps(rule: ControlLaw, task: Task, limits: bool) -> Follower:
    """A control law along the straight path, as `simulate` runs it."""

    def follow(q: Vector, poses: Array, _wait: bool) -> Move:
        path, steps = _way(task, q, poses)
        F = task.frames
        twist = np.hstack([path.move.reshape(F, 3), path.turn.reshape(F, 3)]) / (steps * PERIOD)
        at = q
        try:
            step = rule.begin(q.copy())
            for k in range(1, steps + CORRECTIONS + 1):
                target = _pose(task, path.at(min(1.0, k / steps)))
                rates = twist if k <= steps else np.zeros((F, 6))
                at = at + PERIOD * np.asarray(step(at.copy(), target, rates[0] if F == 1 else rates, PERIOD))
        except HolokinError as problem:
            return Move(q, LawStatus.STOPPED, str(problem))
        except Exception as problem:  # noqa: BLE001  a control law of somebody's own may throw anything
            return Move(q, LawStatus.STOPPED, f"{rule.name} threw {type(problem).__name__}: {problem}; correct it")
        if at.shape != q.shape or not np.isfinite(at).all():
            return Move(q, LawStatus.STOPPED, f"{rule.name} returned no {len(q)} finite joint rates; correct it")
        if limits and _beyond(task, at):
            return Move(q, LawStatus.LIMIT, limit_sentence(task, at))
        off = float(np.abs(task.error_function(at, *task.target(poses))).max())
        if off < DOUBTFUL:
            return Move(at, LawStatus.FOLLOWING)
        return Move(q, *stopped(task, rule.name, at))

    return follow


def _way(task: Task, q: Vector, poses: Array) -> tuple[StraightPath, int]:
    """The straight path of the tools from a posture to poses, and its number of steps."""
    here = task.place(q)
    path = straight(*here, *completed(task, task.target(poses), here))
    far = float(np.linalg.norm(path.move.reshape(-1, 3), axis=1).max())
    turned = float(np.linalg.norm(path.turn.reshape(-1, 3), axis=1).max())
    return path, int(np.clip(np.ceil(max(far / LONG, turned / TURN)), 1, MOST))


def _pose(task: Task, target: tuple[Vector, Array]) -> Array:
    """(4, 4), or (F, 4, 4), of positions (3F,) and rotations (3F, 3)."""
    F = task.frames
    poses = pose_from(target[0].reshape(F, 3), target[1].reshape(F, 3, 3))
    return poses[0] if F == 1 else poses


def stopped(task: Task, name: str, *seen: Vector) -> tuple[LawStatus, str]:
    """Why a law got no farther: on the postures (n,) of its way the arm is stretched, or the law alone is singular."""
    J, margin = task.jacobian_batch(np.array(seen))
    if margin.min() < 2 * TOLERANCES.representation:
        cure = "turn the tool less, or choose a task with another orientation"
        return LawStatus.SINGULAR, f"The angles of the {task.name} are singular on the way; {cure}."
    s = np.linalg.svd(J[np.isfinite(J).all(axis=(1, 2))], compute_uv=False)
    if (s[:, -1] / s[:, 0]).min(initial=1.0) < STRETCHED:
        return LawStatus.OUT_OF_REACH, "The arm is stretched or folded, and reaches no farther this way; drag it back."
    cure = "drag it back, or choose another law or leaf"
    return LawStatus.SINGULAR, f"{name} is singular on the way, the arm itself is not; {cure}."


def limit_sentence(task: Task, q: Vector) -> str:
    """Which joint is at or beyond its limit at a posture (n,), with the cure."""
    robot = task.robot
    i = int(np.argmax(robot.beyond(q)))
    bound = robot.lower[i] if robot.lower[i] - q[i] >= q[i] - robot.upper[i] else robot.upper[i]
    unit = robot.coordinates[i].unit
    return f"{robot.joint_names[i]} would pass its limit of {bound:.4g} {unit}; drag it back, or choose another law."
