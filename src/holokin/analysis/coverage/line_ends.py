"""Many tool poses at once: from start postures along straight lines, all lines side by side in arrays.

It is how laws and their leaves are compared before a few are looked at closely: a hundred times faster than one pose
after the other, but a step is judged by Newton's own convergence alone, so that it may, rarely, change branches.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...base.tolerances import TOLERANCES
from ...base.types import Array, Flags, Indices, Matrix, Value, Vector
from ...motion.ik.leaf import leaf_step
from ...motion.ik.newton import newton
from ...path.straight_path import straight
from ...strategies import HolonomicStrategy
from ...strategies.tasks.free_motion import completing, leaves_free
from ...strategies.tasks.task import Task
from ...symbolic import Function, runge_kutta

FIRST = 0.35
"""Longest first correction of a step [rad or m]: it is the motion of the joints in that step."""

SHORTEST = 1 / 256
"""Share of a line below which a step is given up: the leaf ends there, or bends too sharply to be of use."""

ROUNDS = 400
"""Rounds of steps at most: lines of regular leaves take ten."""

NEAR = 1 / 16
"""The same for lines between neighbours, which are tried in one step first."""

NEWTONS = 5
"""Corrections of a step: from 0.35 rad, each at most an eighth of the last one; they are quadratic long before."""

EXACT = 1e-8
"""A correction after which a posture is right for comparisons [rad or m]."""

STEPS = 32
"""Runge-Kutta steps of a line of a radial strategy: a step is then about 0.05 rad."""

FAST = 25.0
"""Joint rate over a whole line [rad or m] from which a radial strategy's line counts as singular: four full turns."""


@dataclass(frozen=True, eq=False)
class LineEnds(Value):
    """Postures (s, k, n) at the ends of lines from s starts to k poses; where a line ends early, its last posture."""

    q: Array
    share: Matrix

    @property
    def reached(self) -> Flags:
        """Which lines led to their poses (s, k)."""
        return self.share >= 1.0


def along_leaf(
    strategy: HolonomicStrategy, starts: Matrix, poses: Array, levels: Vector | None = None,
    native_from: int | None = None, shortest: float = SHORTEST,
) -> LineEnds:  # fmt: skip
    """From each start (s, n) to each pose (k, 4, 4), on the start's own leaf, or from it to that of level c (r,).

    native_from: lines side by side from which on native code runs, which takes a second to build; see `Function.batch`.
    shortest: share of a line below which a step is given up.
    """
    lines = _Lines.each_to_each(strategy.task, starts, poses)
    q, share = _followed(strategy, lines, levels, native_from, 0.125, shortest)
    return LineEnds(q.reshape(len(starts), len(poses), -1), share.reshape(len(starts), len(poses)))


def one_by_one(
    strategy: HolonomicStrategy, starts: Matrix, poses: Array, native_from: int | None = None,
    levels: Vector | None = None,
) -> tuple[Matrix, Flags]:  # fmt: skip
    """(postures (k, n), which lines led to their poses (k,)): from start i (k, n) to pose i (k, 4, 4) nearby, on its
    leaf, or to the leaf of level c (r,)."""
    q, share = _followed(strategy, _Lines(strategy.task, starts, poses), levels, native_from, 1.0, NEAR)
    return q, share >= 1.0


def _followed(
    strategy: HolonomicStrategy, lines: _Lines, levels: Vector | None, native_from: int | None, first: float,
    shortest: float,
) -> tuple[Matrix, Vector]:  # fmt: skip
    """(postures (k, n) to which lines were gone, the share of each that was gone); steps as shares of the lines."""
    correct, count = leaf_step(strategy), len(lines.q)
    from_level = np.reshape(strategy.constraint_value.batch(lines.q), (count, -1))
    gap = np.zeros_like(from_level)
    if levels is not None:
        gap = strategy.constraint.nearest(np.broadcast_to(levels, from_level.shape) - from_level)
    p, R = lines.at(np.arange(count), np.zeros(count))
    side = correct.batch(lines.q, p, R, from_level)[3]
    q, share, width = lines.q.copy(), np.zeros(count), np.full(count, first)
    live = np.arange(count)
    for _ in range(ROUNDS):
        if not len(live):
            break
        goal = np.minimum(1.0, share[live] + width[live])
        p, R = lines.at(live, goal)
        level = from_level[live] + goal[:, None] * gap[live]
        at, good = _newton(correct, q[live], p, R, level, side[live], native_from)
        moved = live[good]
        q[moved], share[moved] = at[good], goal[good]
        width[live] = np.where(good, np.minimum(1.0, 2 * width[live]), 0.4 * width[live])
        live = live[(share[live] < 1.0) & (width[live] > shortest)]
    return q, share


def _newton(
    step: Function, q: Matrix, p: Matrix, R: Array, level: Matrix, side: Vector, native_from: int | None
) -> tuple[Matrix, Flags]:
    """One step's postures and which of them are good: corrections shrink fast, det [J; J_g] keeps its sign."""

    def correct(at: Matrix, i: Indices) -> tuple[Matrix, Flags]:
        dq, rcond, margin, now = step.batch(at, p[i], R[i], level[i], native_from=native_from)
        sound = (rcond > TOLERANCES.singular) & (margin > TOLERANCES.representation) & (now == side[i])
        return dq, sound & (np.abs(dq).max(axis=1) <= FIRST)

    return newton(correct, q, steps=NEWTONS, exact=EXACT, contraction=TOLERANCES.contraction)


def along_radial(task: Task, starts: Matrix, poses: Array) -> LineEnds:
    """From each start to each pose with least joint speed: the leaf of `radial(moore_penrose(task), start)`."""
    lines = _Lines.each_to_each(task, starts, poses)
    q, count, h = lines.q.copy(), len(lines.q), 1.0 / STEPS
    share, live = np.zeros(count), np.arange(count)
    velocity, angular = lines.rates
    for i in range(STEPS):

        def rate(at: Matrix, s: float, live: Indices = live) -> Matrix:
            R = lines.at(live, np.full(len(live), s))[1]
            dx, _ = task.rates(R, velocity[live], angular[live])
            return _least_rate(task, at, dx)

        there = runge_kutta(rate, q[live], h, i * h, (i + 0.5) * h, (i + 1) * h)
        good = np.abs(there - q[live]).max(axis=1) < FAST * h  # NaN is not
        live = live[good]
        q[live], share[live] = there[good], (i + 1) * h
    p, R = lines.at(np.arange(count), np.ones(count))
    for _ in range(2):  # what the steps' errors have left
        q[live] += _least_rate(task, q[live], task.error(q[live], p[live], R[live]))
    exact = np.abs(task.error(q, p, R)).max(axis=1) < 1e-6
    share = np.where(exact, share, np.minimum(share, 1 - h))
    return LineEnds(q.reshape(len(starts), len(poses), -1), share.reshape(len(starts), len(poses)))


def _least_rate(task: Task, Q: Matrix, dx: Matrix) -> Matrix:
    """J^+ dx (k, n) at postures (k, n), not finite where J is singular."""
    J, _ = task.jacobian_batch(Q)
    gram = J @ J.transpose(0, 2, 1)
    gram[np.linalg.det(gram) < 1e-300] = np.nan
    return np.einsum("kij,ki->kj", J, np.linalg.solve(gram, dx[..., None])[..., 0])


class _Lines:
    """Straight lines from the poses at starts (k, n) to poses (k, 4, 4)."""

    def __init__(self, task: Task, starts: Matrix, poses: Array) -> None:
        self.q = starts
        p0, R0 = task.poses(np.asarray(starts))
        p, R = poses[:, :3, 3], poses[:, :3, :3]
        if leaves_free(task):
            p, R = completing(task).batch(p0, R0, p, R)
        self.path = straight(p0, R0, p, R)
        if not any(task.angular):
            self.path = replace(self.path, turn=np.zeros_like(self.path.turn))

    @classmethod
    def each_to_each(cls, task: Task, starts: Matrix, poses: Array) -> _Lines:
        """From each start (s, n) to each pose (k, 4, 4): s k lines, those of a start together."""
        return cls(task, np.repeat(starts, len(poses), axis=0), np.tile(poses, (len(starts), 1, 1)))

    @property
    def rates(self) -> tuple[Matrix, Matrix]:
        """Velocity and angular velocity (k, 3) over a whole line."""
        return self.path.move, self.path.turn

    def at(self, which: Indices, share: Vector) -> tuple[Matrix, Array]:
        """Positions and rotations of some lines at their shares."""
        return self.path.at(share, which)
