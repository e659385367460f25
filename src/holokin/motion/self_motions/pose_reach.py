"""Whether a tool pose can be reached at all, by which posture best, and which joint's limit is in the way.

All postures of a pose are looked at where the inverse of six hinges gives them. The best one lies between two of a
curve, where two joints are equally far beyond their limits, or where one turns back.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...base.poses import pose_from
from ...base.tolerances import TOLERANCES
from ...base.types import Array, Flags, Indices, Matrix, Result, Value, Vector, frozen, kept
from ...robot import Robot
from ...robot.closed_form import ArmClass, ClosedInverse, GeneralInverse, arm_class, general_inverse
from ...robot.closed_form.closed_inverse import DOUBT
from ...strategies.tasks.frame_task import asks_whole_pose
from ...strategies.tasks.task import Task
from .curve_cuts import cuts_of
from .least_squares import nearest_postures, surely_beyond
from .posture_search import EXACT, newton, to_poses
from .self_motions import SelfMotions, cut_class, self_motions_at
from .stretches import CLOSER, Stretches

TOGETHER = 256
"""Poses whose curves are looked at together: as many as stay in a processor's memory."""

BENDS = 1.0
"""Distance of a curve from the line between neighbours over what an even bend has, a quarter of it at most."""

SMALL = 1e-9
"""Gain [joint units] for which it is not looked closer."""


@dataclass(frozen=True, eq=False)
class Reach(Result, Value):
    """Which of k poses the arm reaches, by which posture best, and what is in the way where it does not.

    q (k, n): the best posture: where none is within the joint limits, as little beyond as possible; else as far from
    them as possible, by a closed form, or one that was found. Hinges are at the best of their turns; NaN where no
    posture has the pose. complete: whether all postures are known, up to the resolution of `SelfMotions`; else a search
    tells.
    """

    robot: Robot
    q: Matrix
    complete: bool

    @cached_property
    def anyhow(self) -> Flags:
        """Which poses some posture has (k,)."""
        return frozen(np.isfinite(self.q).all(axis=1))

    @cached_property
    def beyond(self) -> Vector:
        """How far the best posture is beyond the joint limits (k,) [joint units], at most 0 within; inf without one."""
        return frozen(np.where(self.anyhow, self.robot.beyond(self.q).max(axis=1), np.inf))

    @property
    def within(self) -> Flags:
        """Which poses some posture within the joint limits has (k,)."""
        return self.beyond <= TOLERANCES.limit

    @cached_property
    def joint(self) -> Indices:
        """The joint that is in the way (k,): farthest beyond its limits at the best posture, or nearest to them."""
        return frozen(np.argmax(np.where(self.anyhow[:, None], self.robot.beyond(self.q), 0.0), axis=1))

    def obstacle(self, i: int) -> str | None:
        """Why no posture within the limits has pose i, in words; None where one has."""
        if self.within[i]:
            return None
        return self.obstacles(np.array([i]))[0][0]

    def obstacles(self, which: Indices) -> list[tuple[str, int]]:
        """(why no posture within the limits has them, at how many), of poses of which that is so; limits by joint."""
        every, best = ("every posture", " at best") if self.complete else ("every posture found", "")
        rows: list[tuple[str, int]] = []
        reached = which[self.anyhow[which]]
        for joint in np.unique(self.joint[reached]):
            past = self.beyond[reached][self.joint[reached] == joint]
            amounts = dict.fromkeys(f"{x:.2g}" for x in (past.min(), past.max()))
            name, unit = self.robot.joint_names[joint], self.robot.coordinates[joint].unit
            by = f"{name} by {' to '.join(amounts)} {unit}{best}"
            rows.append((f"{every} is beyond the joint limits: {by}", len(past)))
        rows.sort(key=lambda row: -row[1])
        if len(reached) < len(which):
            none = "no posture has the pose" if self.complete else "no posture was found"
            rows.append((none, len(which) - len(reached)))
        return rows

    def __str__(self) -> str:
        k, within, anyhow = len(self.within), int(self.within.sum()), int(self.anyhow.sum())
        return f"{within} of {k} poses are reached within the joint limits, {anyhow} at all"


# --- Turns of hinges.


class Turns(NamedTuple):
    """Where the turns of each joint are counted from (n,), and how much each is; infinite where a turn is not the same
    posture."""

    middle: Vector
    period: Vector


@kept
def turns_of(robot: Robot) -> Turns:
    """Those of a robot."""
    turning = robot.hinges.copy()
    for joint in robot.joints:
        turning[joint.coordinate] &= float(joint.multiplier).is_integer()
    lower, upper = np.isfinite(robot.lower), np.isfinite(robot.upper)
    middle = np.zeros(robot.n)
    middle[lower] = robot.lower[lower] + 2 * np.pi
    middle[upper] = robot.upper[upper] - 2 * np.pi
    middle[lower & upper] = 0.5 * (robot.lower[lower & upper] + robot.upper[lower & upper])
    return Turns(middle, np.where(turning, 2 * np.pi, np.inf))


def at_best_turns(robot: Robot, q: Array) -> Array:
    """The same postures (..., n) with each hinge at the turn that is farthest within its limits, or least beyond."""
    middle, period = turns_of(robot)
    return q - np.where(np.isfinite(period), period, 0.0) * np.round((q - middle) / period)


# --- Whether poses are reached.


def reach_of(
    task: Task, p: Matrix, R: Array, near: Matrix, *, limits: bool = True, every: SelfMotions | None = None
) -> Reach:
    """Whether tool poses p (k, 3), R (k, 3, 3) can be reached, and by which posture best.

    Args:
        near: postures (k, n) from which a search begins, where there is no closed form.
        limits: False asks for any posture, not for the best one.
        every: all postures there, where they are known already.
    """
    if not all_known(task):
        return Reach(task.robot, _found(task, p, R, near, limits), complete=False)
    if every is not None:
        return Reach(task.robot, _best_of(every, limits), complete=True)
    q, rest = np.full((len(p), task.n), np.nan), np.flatnonzero(~surely_beyond(task, p, R))
    if task.n > task.m and cut_class(task) is None and len(rest):
        # Curves without a closed form take longer than to find a posture within the limits, where one is near.
        nearest = nearest_postures(task, p[rest], R[rest], near[rest], limits=limits, restarts=0).q
        nearest, reached = newton(to_poses(task, p[rest], R[rest]), nearest, steps=6, exact=EXACT)
        reached &= task.robot.beyond(nearest).max(axis=1) <= (TOLERANCES.limit if limits else np.inf)
        q[rest[reached]], rest = nearest[reached], rest[~reached]
    for first in range(0, len(rest), TOGETHER):
        some = rest[first : first + TOGETHER]
        postures = every_posture(task, p[some], R[some])
        if postures is not None:
            q[some] = _best_of(postures, limits)
    return Reach(task.robot, q, complete=True)


def _best_of(postures: SelfMotions, limits: bool) -> Matrix:
    """The best posture (S, n) at each pose, NaN where there is none; with limits also between those given."""
    robot, q = postures.task.robot, np.full((len(postures.p), postures.task.n), np.nan)
    excess = robot.beyond(at_best_turns(robot, postures.q)).max(axis=1)
    order = np.lexsort((excess, postures.pose))
    pose, first = np.unique(postures.pose[order], return_index=True)
    q[pose] = at_best_turns(robot, postures.q[order[first]])
    if limits:
        _refine(postures, excess, q)
    return q


def all_known(task: Task) -> bool:
    """Whether the inverse of six hinges gives all postures of a task's poses: else they are searched for."""
    return bool(cuts_of(task)) if task.n - task.m == 1 else _inverse(task) is not None


def every_posture(task: Task, p: Matrix, R: Array) -> SelfMotions | None:
    """All postures at poses, where `all_known`; those of an arm without a redundant joint one by one."""
    if task.n > task.m:
        return self_motions_at(task, p, R) if all_known(task) else None
    inverse = _inverse(task)
    if inverse is None:
        return None
    if isinstance(inverse, GeneralInverse):
        postures = inverse.postures(pose_from(p, R), np.zeros(0))
        q, pose = postures.q, postures.row
    else:
        answers = inverse.answers(pose_from(p, R), np.zeros((1, 0)))
        pose, sign = np.nonzero(answers[:, :, 9] > -DOUBT)
        q = np.zeros((len(pose), task.n))
        q[:, inverse.others] = answers[pose, sign, :6]
    return SelfMotions(task, p, R, q, pose, np.arange(len(q)), np.zeros(len(q), dtype=bool))


@kept
def _inverse(task: Task) -> ClosedInverse | GeneralInverse | None:
    """The inverse of a task that leaves no joint free; None where there is none."""
    if not asks_whole_pose(task) or task.n != 6:
        return None
    arm = arm_class(task.robot, (), task.tip)
    if isinstance(arm, ArmClass):
        return ClosedInverse(arm, limits=False)
    inverse = general_inverse(task.robot, (), task.tip)
    return inverse if isinstance(inverse, GeneralInverse) else None


def _found(task: Task, p: Matrix, R: Array, near: Matrix, limits: bool) -> Matrix:
    """Postures (k, n) that a search finds, within the limits if there are such, NaN where there are none."""
    q = np.full((len(p), task.n), np.nan)
    rows = np.flatnonzero(~surely_beyond(task, p, R))
    for within in (False, True)[: 1 + limits]:
        if not len(rows):
            break
        nearest = nearest_postures(task, p[rows], R[rows], near[rows], limits=within)
        rows = rows[nearest.reached]
        q[rows] = nearest.q[nearest.reached] if within else at_best_turns(task.robot, nearest.q[nearest.reached])
        rows = rows[task.robot.beyond(q[rows]).max(axis=1, initial=-np.inf) > 0]
    return q


def obstacle_at(task: Task, p: Vector, R: Matrix, near: Vector, limits: bool) -> tuple[str | None, Vector]:
    """(what is in the way of a pose p (3F,), R (3F, 3), in words; the posture nearest to it that a search met).

    None where a posture has the pose, and where a search did not come to an end, since nothing is known then.
    """
    if all_known(task):
        reach = reach_of(task, p[None], R[None], near[None], limits=limits)
        return (None if not limits and reach.anyhow[0] else reach.obstacle(0)), near
    nearest = nearest_postures(task, p[None], R[None], near[None], limits=limits)
    if nearest.reached[0] or not nearest.ended[0]:
        return None, nearest.q[0]
    reach = reach_of(task, p[None], R[None], near[None], limits=False)
    if reach.within[0] and limits:
        return None, reach.q[0]
    off = f"no search came closer to it than {nearest.missing[0]:.3g} (m or rad)"
    if not limits or not reach.anyhow[0]:
        return f"{off}, even without joint limits", nearest.q[0]
    return f"{off} within the joint limits; {reach.obstacle(0)}", nearest.q[0]


# --- The best posture, between two postures of a curve.


def _refine(postures: SelfMotions, excess: Vector, q: Matrix) -> None:
    """The best postures (S, n) at poses, the best of the given ones before, improved in place."""
    robot = postures.task.robot

    def excess_of(Q: Matrix, _: Indices | None = None) -> Vector:
        return robot.beyond(at_best_turns(robot, Q)).max(axis=1)

    # Pairs of neighbours between which a better posture may lie: no joint's excess falls faster than the joint moves.
    known = np.full(len(q), np.inf)
    np.minimum.at(known, postures.pose, excess)
    least = known[postures.pose] - SMALL
    distance = np.linalg.norm(np.diff(postures.q, axis=0), axis=1)
    near = 0.5 * (excess[:-1] + excess[1:]) - 1.5 * distance < least[:-1]
    first = np.flatnonzero(near & (distance > 0) & (np.diff(postures.curve) == 0))
    move = postures.q[first + 1] - postures.q[first]
    ends = [robot.beyond(at_best_turns(robot, postures.q[i])) for i in (first, first + 1)]
    bound = (0.5 * (ends[0] + ends[1] - np.abs(move)) - _bends(postures, first)).max(axis=1, initial=-np.inf)
    first = first[bound < least[first]]
    # Those that are left when they were looked at, by the same bound; then the best one of each pose.
    pose = postures.pose[first]
    stretches = Stretches.between(
        postures.task, postures.p[pose], postures.R[pose], postures.q[first], postures.q[first + 1]
    )
    low, high, value = stretches.bracket(excess_of)
    np.minimum.at(known, pose, value)
    left = value - 2 * (high - low) * np.linalg.norm(stretches.move, axis=1) < known[pose]
    found, value = stretches.some(left).part(low[left], high[left]).least(excess_of, CLOSER[1:])
    order = np.lexsort((value, pose[left]))
    which, index = np.unique(pose[left][order], return_index=True)
    best, value = at_best_turns(robot, found[order[index]]), value[order[index]]
    better = value < excess_of(q[which])
    q[which[better]] = best[better]


def _bends(postures: SelfMotions, first: Indices) -> Matrix:
    """How far joints may be (k, n) from the straight lines from some postures to the next, by the bends at both."""
    last, bends = len(postures.q) - 1, np.zeros((len(first), postures.task.n))
    for i in (first, first + 1):
        before, after = np.maximum(i - 1, 0), np.minimum(i + 1, last)
        inner = (postures.curve[before] == postures.curve[i]) & (postures.curve[after] == postures.curve[i])
        moves = [postures.q[i] - postures.q[before], postures.q[after] - postures.q[i]]
        lengths = [np.maximum(np.linalg.norm(move, axis=1), 1e-12)[:, None] for move in moves]
        turn = np.abs(moves[1] / lengths[1] - moves[0] / lengths[0]) / (lengths[0] + lengths[1])
        bends = np.maximum(bends, np.where(inner[:, None], turn, 0.0))
    return BENDS * bends * np.sum((postures.q[first + 1] - postures.q[first]) ** 2, axis=1)[:, None]
