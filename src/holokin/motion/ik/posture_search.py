"""All postures at a tool pose on a leaf, as far as a search from many starts finds them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, ShapeError
from ...base.poses import PoseLike, given_pose
from ...base.tolerances import TOLERANCES
from ...base.types import Array, ArrayLike, Flags, Indices, Matrix, Value, Vector, finite, tool_pose, whole
from ...path.workspaces import sobol
from ...robot import Robot
from ...strategies import HolonomicStrategy, Strategy
from ...strategies.self_motions import joint_gap, least_motion
from ...strategies.tasks.task import Task, of_one_tool
from .leaf import check_levels, leaf_step, with_leaves
from .newton import Correct, newton
from .whole_turns import free_hinges, turned

STEPS = 60
"""Newton steps from one start. Of 4096 starts on an iiwa 14 and a Panda that get anywhere, 99 % take less than 40."""

LONGEST = 0.5
"""Largest joint motion [joint units] of one step: a longer one leaves the place where the slopes mean something."""

EXACT = 1e-10
"""Last correction [joint units] of a posture that counts as found."""

MOST_STARTS = 1_000_000
"""They are all gone from at once: a million take two minutes and a gigabyte."""

SAMPLED = 8
"""Postures at which it is looked at which hinges may turn round without a change of g."""

APART = 1e-6
"""Distance [joint units] below which two postures are one: well over `EXACT`, well under what tells branches apart."""


@dataclass(frozen=True, eq=False)
class Postures(Value):
    """The postures q (k, n) found at one tool pose (4, 4) on the leaf c (r,), in the order of their joints.

    Each is at the pose and on the leaf, if there is one; of those that differ by whole turns of hinges it is one, see
    `near` of `all_postures`. found (k,): from how many of the `starts` each was found; rcond (k,): how regular [J; J_g]
    is there. `singular` starts ended where it is singular; postures that lie there are not counted. `outside` postures
    lie outside the joint limits and were left out.
    """

    q: Matrix
    pose: Matrix
    level: Vector
    found: Vector
    rcond: Vector
    starts: int
    singular: int
    outside: int

    def __len__(self) -> int:
        return len(self.q)

    @property
    def unseen(self) -> float:
        """About how likely one more start is to find a posture that is not yet here: the share of starts whose posture
        no other start found [Goo53]."""
        return float(np.sum(self.found == 1)) / self.starts

    @property
    def sentence(self) -> str:
        """What was found, and by which search."""
        many = f"{len(self)} posture{'' if len(self) == 1 else 's'}"
        least = f", each from {int(self.found.min())} of them at least" if len(self) else ""
        left = f"; {self.outside} more outside the joint limits" if self.outside else ""
        more = f"; one more start would find another with a chance of {self.unseen:.1g}" if self.unseen else ""
        leaf = " on this leaf" if len(self.level) else ""
        return (
            f"{many} at this tool pose{leaf} found by Newton's method from {self.starts} starts spread over the "
            f"joint ranges{least}{left}{more}; a search, no proof that there are no others"
        )

    def __str__(self) -> str:
        return self.sentence


@typed
def all_postures(
    strategy: Strategy,
    pose: PoseLike,
    level: ArrayLike = 0.0,
    *,
    limits: bool = True,
    starts: int = 1024,
    near: ArrayLike | None = None,
) -> Postures:
    """All postures with f(q) = x and g(q) = c that Newton's method finds from many starts: the branches of a leaf.

    A six-axis arm, or one of seven axes with a joint locked, has at most 16, or a curve of them [Pri86]. A rule that
    ties several joints may have more: 26 were found of a Panda with 4 q1 + 3 q3 held. `inverse` keeps to the one that
    it began with. Where nothing is redundant, n = m, any strategy will do, as `moore_penrose(task)`: all postures with
    f(q) = x. The starts are a low-discrepancy sequence over the joint ranges, the same at every call.

    Args:
        pose: of the tool (4, 4).
        level: c (r,), or one number for all rows.
        limits: False keeps postures beyond the joint limits, too.
        starts: how many; more find rarer postures.
        near: a posture (n,): of answers that differ by whole turns of hinges, which keep the pose and the level, the
            one nearest to it is given; the search begins there, too. Without it, the one nearest to the middle of the
            ranges with limits, else to 0.

    Raises:
        ArgumentError: a strategy without leaves. ShapeError.
    """
    strategy = with_leaves(strategy)
    task, count = strategy.task, whole("starts", starts)
    of_one_tool(task, "all_postures")
    if count > MOST_STARTS:
        raise ArgumentError("starts", count, f"give at most {MOST_STARTS:,}")
    wanted = tool_pose("a tool pose", given_pose("a tool pose", pose))
    p, R = wanted[:3, 3], wanted[:3, :3]
    given, r = finite("the leaf", level), strategy.constraint.rows
    if given.shape not in ((), (r,)):
        raise ShapeError("the leaf", (r,), given.shape)
    c = np.broadcast_to(given, (r,))
    check_levels(strategy, c)
    aim = _preferred(task.robot, limits) if near is None else task.robot.checked(near, "near")
    free = free_hinges(strategy, spread(task.robot, SAMPLED))
    begun = spread(task.robot, count, ~free & task.robot.hinges)
    begun = begun if near is None else np.vstack([aim, begun[1:]])
    q, rcond, arrived = leaf_postures(strategy, begun, p, R, c)
    regular = arrived & (rcond > TOLERANCES.singular)
    singular = int(np.sum(arrived & ~regular))
    classes = _distinct(task.robot, q[regular])
    chosen = [turned(strategy, members, free, aim, limits) for members in classes]
    inside = np.array([within for _, within in chosen], dtype=bool)
    kept = np.array([one for one, _ in chosen]).reshape(-1, task.n)[inside]
    found = np.array([len(members) for members in classes], dtype=float)[inside]
    order = np.lexsort(np.round(kept, 6).T[::-1])
    at = strategy.gain.batch(kept[order])[1].ravel() if len(kept) else np.zeros(0)
    return Postures(kept[order], wanted, c.copy(), found[order], at, count, singular, int(np.sum(~inside)))


def spread(robot: Robot, count: int, counted: Flags | None = None) -> Matrix:
    """Postures (count, n) of low discrepancy over the joint ranges, hinges over a turn at most.

    counted (n,): hinges whose whole turns count, which are spread over their range, or over two turns without one.
    """
    several = np.zeros(robot.n, dtype=bool) if counted is None else counted
    reach = np.where(robot.hinges, np.where(several, 2 * np.pi, np.pi), 1.0)
    ranged = (~robot.hinges | several) & np.isfinite(robot.lower) & np.isfinite(robot.upper)
    low, high = np.where(ranged, robot.lower, -reach), np.where(ranged, robot.upper, reach)
    return low + (high - low) * sobol(robot.n, count, seed=0)


def postures_from(task: Task, q: Matrix, p: Matrix, R: Array) -> tuple[Matrix, Flags]:
    """(postures (k, n) with the tool at p (k, 3), R (k, 3, 3), whether Newton's method got there (k,)) from starts."""
    return newton(to_poses(task, p, R), q, steps=STEPS, longest=LONGEST, exact=EXACT)


def to_poses(task: Task, p: Matrix, R: Array) -> Correct:
    """The least joint motion that, to first order, takes the tool to p (k, 3), R (k, 3, 3): a step of `newton`."""

    def correct(q: Matrix, i: Indices) -> tuple[Matrix, Flags]:
        e = task.error_function.batch(q, p[i], R[i]).reshape(len(q), task.m, 1)
        return least_motion(task.jacobian_batch(q)[0], e)[:, :, 0], np.ones(len(q), dtype=bool)

    return correct


def leaf_postures(
    strategy: HolonomicStrategy, q: Matrix, p: Array, R: Array, c: Vector
) -> tuple[Matrix, Vector, Flags]:
    """(postures (k, n), rcond (k,), whether Newton's method got there (k,)) from starts (k, n), on one leaf c (r,).

    Args:
        p, R: tool positions (k, 3) and rotations (k, 3, 3), or one of each for all.
    """
    step, rcond, own = leaf_step(strategy), np.zeros(len(q)), p.ndim > 1

    def correct(q: Matrix, i: Indices) -> tuple[Matrix, Flags]:
        dq, quality, margin, _ = step.batch(q, p[i] if own else p, R[i] if own else R, c)
        rcond[i] = np.ravel(quality)
        return dq.reshape(q.shape), np.ravel(margin) > TOLERANCES.representation

    q, arrived = newton(correct, q, steps=STEPS, longest=LONGEST, exact=EXACT)
    return q, rcond, arrived


def _distinct(robot: Robot, q: Matrix) -> list[Matrix]:
    """Postures (k, n), those that differ by whole turns of hinges together, as they were found."""
    classes: list[list[Vector]] = []
    for one in q:
        known = np.array([members[0] for members in classes]).reshape(-1, robot.n)
        near = np.abs(joint_gap(robot, known, one)).max(axis=1) < APART
        if near.any():
            classes[int(np.argmax(near))].append(one)
        else:
            classes.append([one])
    return [np.array(members) for members in classes]


def _preferred(robot: Robot, limits: bool) -> Vector:
    """Where hinges (n,) are by choice: within limits in the middle of their range, else about 0."""
    bounded = limits & np.isfinite(robot.lower) & np.isfinite(robot.upper)
    with np.errstate(invalid="ignore"):
        return np.where(bounded, 0.5 * (robot.lower + robot.upper), 0.0)
