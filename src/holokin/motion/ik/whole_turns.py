"""Whole turns of hinges: which of them keep the tool pose and the leaf, and the turns nearest to a posture."""

from __future__ import annotations

from itertools import product

import numpy as np

from ...base.tolerances import TOLERANCES
from ...base.types import Flags, Matrix, Vector
from ...strategies import HolonomicStrategy

SAME = 1e-8
"""Change of pose and of level, over 1 + its size, that counts as round-off: an answer is right to 1e-10 of a joint, and
a turn that is not kept changes it by far more."""

TURNS = 3
"""Turns of a hinge that are tried where g depends on them, those nearest to what is wished."""

AT_ONCE = 2_200
"""Postures that are tried for one answer at most: three turns of seven hinges."""


def keeps(strategy: HolonomicStrategy, q: Matrix, moved: Matrix) -> Flags:
    """Which of the postures moved (k, n) have the tool pose and the level of q (1, n) or (k, n)."""
    task, rows = strategy.task, strategy.constraint.rows

    def level(Q: Matrix) -> Matrix:
        return strategy.constraint_value.batch(Q).reshape(len(Q), rows)

    c = level(q)
    same = _small(strategy.constraint.nearest(level(moved) - c), c)
    if same.any():
        (p, R), (p2, R2) = task.poses(q[same] if len(q) == len(moved) else q), task.poses(moved[same])
        same[same] = _small(p2 - p, p) & _small((R2 - R).reshape(len(R2), -1), np.ones(1))
    return same


def _small(change: Matrix, size: Matrix | Vector) -> Flags:
    with np.errstate(invalid="ignore"):
        return np.all(np.abs(change) <= SAME * (1.0 + np.abs(size)), axis=1)


def free_hinges(strategy: HolonomicStrategy, Q: Matrix) -> Flags:
    """Which hinges (n,) may make a whole turn at each of the postures (k, n) without a change of pose or level.

    Postures where g has no value say nothing. A locked joint is none of them, and neither is one that a sum of angles
    counts, or that drives another joint through a gear.
    """
    defined = np.isfinite(strategy.constraint_value.batch(Q)).reshape(len(Q), -1).all(axis=1)
    free = strategy.task.robot.hinges.copy()
    for j in np.flatnonzero(free):
        turn = np.zeros(Q.shape[1])
        turn[j] = 2 * np.pi
        free[j] = bool(defined.any()) and bool(keeps(strategy, Q[defined], Q[defined] + turn).all())
    return free


def turned(
    strategy: HolonomicStrategy, members: Matrix, free: Flags, near: Vector, limits: bool
) -> tuple[Vector, bool]:
    """(that of a posture's turns nearest to another one, near (n,), whether it is within the limits, if these count).

    members (k, n): one posture, as it was found, at some turns of its hinges: all at the pose and on the leaf. Where a
    hinge is free it takes any turn; of the others those near to `near` are tried together.
    """
    robot = strategy.task.robot
    low, high = (robot.lower, robot.upper) if limits else (np.full(robot.n, -np.inf), np.full(robot.n, np.inf))
    low, high = low - TOLERANCES.limit, high + TOLERANCES.limit
    for free_ones in (free, np.zeros_like(free)):  # a hinge that was free elsewhere need not be so here
        tried = np.vstack([members, _choices(members[0], robot.hinges, free_ones, near, low, high)])
        tried = np.where(free_ones, _turns(tried, near, low, high), tried)
        inside = np.all((tried >= low) & (tried <= high), axis=1)
        good = tried[inside][keeps(strategy, members[:1], tried[inside])] if inside.any() else tried[:0]
        if len(good):
            return good[np.argmin(np.square(good - near).sum(axis=1))], True
        if not free_ones.any() or keeps(strategy, members[:1], tried[:1])[0]:
            break
    return members[0], False


def _turns(q: Matrix, near: Vector, low: Vector, high: Vector) -> Matrix:
    """Hinges at the turn that is nearest to `near` within the limits, in [near - pi, near + pi) without any."""
    k = -np.floor((q - near + np.pi) / (2 * np.pi))
    first, last = np.ceil((low - q) / (2 * np.pi)), np.floor((high - q) / (2 * np.pi))
    return q + 2 * np.pi * np.minimum(np.maximum(k, first), last)


def _choices(q: Vector, hinges: Flags, free: Flags, near: Vector, low: Vector, high: Vector) -> Matrix:
    """The posture with its hinges that are not free at the turns within the limits nearest to `near`, all together."""
    options: list[list[float]] = []
    for j in np.flatnonzero(hinges & ~free):
        wish = np.round((near[j] - q[j]) / (2 * np.pi))
        first, last = np.ceil((low[j] - q[j]) / (2 * np.pi)), np.floor((high[j] - q[j]) / (2 * np.pi))
        around = sorted({0.0, *np.arange(wish - TURNS, wish + TURNS + 1), first, last}, key=lambda k: abs(k - wish))
        options.append([k for k in around if first <= k <= last][:TURNS])
    while np.prod([len(one) for one in options], dtype=float) > AT_ONCE:
        options = [one[:-1] if len(one) > 1 else one for one in options]
    tuples = list(product(*options))
    turns = np.array(tuples, dtype=float).reshape(len(tuples), len(options))
    tried = np.tile(q, (len(turns), 1))
    tried[:, hinges & ~free] += 2 * np.pi * turns
    return tried
