"""All postures at a tool pose on a leaf, as far as a search from many starts finds them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arguments import typed
from ..errors import ArgumentError, ShapeError
from ..robot import Robot
from ..strategies import HolonomicStrategy
from ..strategies.self_motions import least_motion
from ..symbolic import wrapped
from ..task import Task, of_one_tool
from ..tolerances import TOLERANCES
from ..types import Array, ArrayLike, Flags, Indices, Matrix, Value, Vector, finite, tool_pose, whole
from ..workspaces import sobol
from .leaf import leaf_step
from .newton import newton

STEPS = 60
"""Newton steps from one start. Of 4096 starts on an iiwa 14 and a Panda that get anywhere, 99 % take less than 40."""

LONGEST = 0.5
"""Largest joint motion [joint units] of one step: a longer one leaves the place where the slopes mean something."""

EXACT = 1e-10
"""Last correction [joint units] of a posture that counts as found."""

MOST_STARTS = 1_000_000
"""They are all gone from at once: a million take two minutes and a gigabyte."""

APART = 1e-6
"""Distance [joint units] below which two postures are one: well over `EXACT`, well under what tells branches apart."""


@dataclass(frozen=True, eq=False)
class Postures(Value):
    """The postures q (k, n) found at one tool pose (4, 4) on the leaf c (r,), in the order of their joints.

    Angles are in [-pi, pi), or within the joint limits where these were asked for. found (k,): from how many of the
    `starts` each was found; rcond (k,): how regular [J; J_g] is there. `singular` starts ended where it is singular;
    postures that lie there are not counted. `outside` postures lie outside the joint limits and were left out.
    """

    q: Matrix
    pose: Matrix
    leaf: Vector
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
        return (
            f"{many} at this tool pose on this leaf found by Newton's method from {self.starts} starts spread over the "
            f"joint ranges{least}{left}{more}; a search, no proof that there are no others"
        )

    def __str__(self) -> str:
        return self.sentence


@typed
def all_postures(
    strategy: HolonomicStrategy,
    pose: ArrayLike,
    leaf: ArrayLike = 0.0,
    *,
    limits: bool = False,
    starts: int = 1024,
) -> Postures:
    """All postures with f(q) = x and g(q) = c that Newton's method finds from many starts: the branches of a leaf.

    A seven-axis arm has up to 16 for one tool pose and one level, and `inverse` keeps to the one that it began with.
    The starts are a low-discrepancy sequence over the joint ranges, the same at every call.

    Args:
        pose: of the tool (4, 4).
        leaf: c (r,), or one number for all rows.
        limits: True keeps only postures within the joint limits.
        starts: how many; more find rarer postures.

    Raises:
        ShapeError, ArgumentError.
    """
    task, count = strategy.task, whole("starts", starts)
    of_one_tool(task, "all_postures")
    if count > MOST_STARTS:
        raise ArgumentError("starts", count, f"give at most {MOST_STARTS:,}")
    wanted = tool_pose("a tool pose", finite("a tool pose", pose, (4, 4)))
    p, R = wanted[:3, 3], wanted[:3, :3]
    given, r = finite("the leaf", leaf), strategy.constraint.rows
    if given.shape not in ((), (r,)):
        raise ShapeError("the leaf", (r,), given.shape)
    c = np.broadcast_to(given, (r,))
    q, rcond, arrived = _on_leaf(strategy, spread(task.robot, count), p, R, c)
    regular = arrived & (rcond > TOLERANCES.singular)
    singular = int(np.sum(arrived & ~regular))
    kept, found = _merged(task.robot, q[regular])
    kept, inside = _within(task.robot, kept, limits)
    order = np.lexsort(np.round(kept[inside], 6).T[::-1])
    at = strategy.gain.batch(kept[inside][order])[1].ravel() if inside.any() else np.zeros(0)
    outside = int(np.sum(~inside))
    return Postures(kept[inside][order], wanted, c.copy(), found[inside][order], at, count, singular, outside)


def spread(robot: Robot, count: int) -> Matrix:
    """Postures (count, n) of low discrepancy over the joint ranges, hinges over a turn at most."""
    low, high = np.where(robot.hinges, -np.pi, -1.0), np.where(robot.hinges, np.pi, 1.0)
    slides = ~robot.hinges & np.isfinite(robot.lower) & np.isfinite(robot.upper)
    low, high = np.where(slides, robot.lower, low), np.where(slides, robot.upper, high)
    return low + (high - low) * sobol(robot.n, count, seed=0)


def postures_from(task: Task, q: Matrix, p: Matrix, R: Array) -> tuple[Matrix, Flags]:
    """(postures (k, n) with the tool at p (k, 3), R (k, 3, 3), whether Newton's method got there (k,)) from starts."""

    def correct(q: Matrix, i: Indices) -> tuple[Matrix, Flags]:
        e = task.error_function.batch(q, p[i], R[i]).reshape(len(q), task.m, 1)
        return least_motion(task.jacobian_batch(q)[0], e)[:, :, 0], np.ones(len(q), dtype=bool)

    return newton(correct, q, steps=STEPS, longest=LONGEST, exact=EXACT)


def _on_leaf(strategy: HolonomicStrategy, q: Matrix, p: Vector, R: Matrix, c: Vector) -> tuple[Matrix, Vector, Flags]:
    """(postures (k, n), rcond (k,), whether Newton's method got there (k,)) from starts (k, n), on one leaf."""
    step, rcond = leaf_step(strategy), np.zeros(len(q))

    def correct(q: Matrix, i: Indices) -> tuple[Matrix, Flags]:
        dq, quality, margin, _ = step.batch(q, p, R, c)
        rcond[i] = np.ravel(quality)
        return dq.reshape(q.shape), np.ravel(margin) > TOLERANCES.representation

    q, arrived = newton(correct, q, steps=STEPS, longest=LONGEST, exact=EXACT)
    return q, rcond, arrived


def _merged(robot: Robot, q: Matrix) -> tuple[Matrix, Vector]:
    """(different postures (k, n), hinges in [-pi, pi); how often each was met (k,))."""
    q = np.where(robot.hinges, wrapped(q), q)
    kept: list[Vector] = []
    count: list[int] = []
    for one in q:
        gap = np.array(kept).reshape(-1, robot.n) - one
        near = np.abs(np.where(robot.hinges, wrapped(gap), gap)).max(axis=1) < APART
        if near.any():
            count[int(np.argmax(near))] += 1
        else:
            kept, count = [*kept, one], [*count, 1]
    return np.array(kept).reshape(-1, robot.n), np.array(count, dtype=float)


def _within(robot: Robot, q: Matrix, limits: bool) -> tuple[Matrix, Flags]:
    """(postures turned by whole turns to where they are within the limits, which of them are); all without limits."""
    if not limits:
        return q, np.ones(len(q), dtype=bool)
    low, high = robot.lower - TOLERANCES.limit, robot.upper + TOLERANCES.limit
    turns = np.ceil((low - q) / (2 * np.pi))
    moved = q + 2 * np.pi * np.where(robot.hinges & np.isfinite(turns), turns, 0.0)
    return moved, np.all((moved >= low) & (moved <= high), axis=1)
