"""Many tool poses at once: from start postures along straight lines, all lines side by side in arrays.

It is how strategies and their leaves are compared before a few are looked at closely: a hundred times faster than one
pose after the other, but a step is judged by Newton's own convergence alone, so that it may, rarely, change branches.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...base.tolerances import TOLERANCES
from ...base.types import Array, Flags, Indices, Matrix, Value, Vector, kept
from ...motion.ik.leaf import leaf_step
from ...motion.self_motions.posture_search import newton
from ...path.path import straight
from ...strategies import HolonomicStrategy
from ...strategies.self_motion_curves import least_motion
from ...strategies.tasks.frame_task import completing, leaves_free
from ...strategies.tasks.task import Task
from ...symbolic import SX, Function, as_map, factorise, runge_kutta, symbol
from ...symbolic.rotations import exp_so3

NATIVE, MANY = 16, 300
"""Lines side by side from which on native code runs, and poses from which on building it pays."""


def native_from(poses: int) -> int | None:
    """Lines from which on native code runs, where a strategy is asked at so many poses; None for as many as usual."""
    return NATIVE if poses >= MANY else None


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
    strategy: HolonomicStrategy,
    starts: Matrix,
    poses: Array,
    levels: Vector | None = None,
    native_from: int | None = None,
    shortest: float = 1 / 256,
    first: float = 0.125,
) -> LineEnds:
    """From each start (s, n) to each pose (k, 4, 4), on the start's own leaf, or from it to that of level c (r,).

    native_from: lines side by side from which on native code runs, which takes a second to build; see `Function.batch`.
    shortest: share of a line below which a step is given up: the leaf ends there, or bends too sharply to be of use.
    first: share that the first step tries.
    """
    lines = _Lines.each_to_each(strategy.task, starts, poses)
    q, share = _followed(strategy, lines, levels, native_from, first=first, shortest=shortest)
    return LineEnds(q.reshape(len(starts), len(poses), -1), share.reshape(len(starts), len(poses)))


def one_by_one(
    strategy: HolonomicStrategy,
    starts: Matrix,
    poses: Array,
    native_from: int | None = None,
    levels: Vector | None = None,
) -> tuple[Matrix, Flags]:
    """(postures (k, n), which lines led to their poses (k,)): from start i (k, n) to pose i (k, 4, 4) nearby, on its
    leaf, or to the leaf of level c (r,). Lines between neighbours are tried in one step first."""
    lines = _Lines(strategy.task, starts, poses)
    q, share = _followed(strategy, lines, levels, native_from, first=1.0, shortest=1 / 16)
    return q, share >= 1.0


def _followed(
    strategy: HolonomicStrategy,
    lines: _Lines,
    levels: Vector | None,
    native_from: int | None,
    *,
    first: float,
    shortest: float,
) -> tuple[Matrix, Vector]:
    """(postures (k, n) to which lines were followed, the share of each that was); steps as shares of the lines."""
    step, count = leaf_step(strategy), len(lines.q)
    from_level = np.reshape(strategy.constraint_value.batch(lines.q), (count, -1))
    gap = np.zeros_like(from_level)
    if levels is not None:
        gap = strategy.constraint.nearest(np.broadcast_to(levels, from_level.shape) - from_level)
    start_side = step.batch(lines.q, *lines.at(np.arange(count), np.zeros(count)), from_level)[3]
    q, share, width, live = lines.q.copy(), np.zeros(count), np.full(count, first), np.arange(count)
    # At most 400 rounds of steps, which grow and shrink with each line: lines of regular leaves take ten
    for _ in range(400):
        if not len(live):
            break
        goal = np.minimum(1.0, share[live] + width[live])
        (p, R), level, side = lines.at(live, goal), from_level[live] + goal[:, None] * gap[live], start_side[live]

        def correct(q: Matrix, i: Indices, p=p, R=R, level=level, side=side) -> tuple[Matrix, Flags]:
            """A posture is good where corrections shrink fast and det [J; J_g] keeps its sign. The first one, at most
            0.35 rad or m, is the motion of the joints in that step."""
            dq, rcond, margin, sign = step.batch(q, p[i], R[i], level[i], native_from=native_from)
            sound = (rcond > TOLERANCES.singular) & (margin > TOLERANCES.representation) & (sign == side[i])
            return dq, sound & (np.abs(dq).max(axis=1) <= 0.35)

        # Five corrections, each at most an eighth of the last one, down to what is right for comparisons
        ends, good = newton(correct, q[live], steps=5, exact=1e-8, contraction=TOLERANCES.contraction)
        q[live[good]], share[live[good]] = ends[good], goal[good]
        width[live] = np.where(good, np.minimum(1.0, 2 * width[live]), 0.4 * width[live])
        live = live[(share[live] < 1.0) & (width[live] > shortest)]
    return q, share


STEPS = 32
"""Runge-Kutta steps of a line that least joint motion follows, of about 0.05 rad each."""


def along_radial(task: Task, starts: Matrix, poses: Array) -> LineEnds:
    """From each start to each pose with least joint speed: the leaf of `radial(moore_penrose(task), start)`."""
    lines = _Lines.each_to_each(task, starts, poses)
    path, count, h = lines.path, len(lines.q), 1.0 / STEPS
    ways, _ = _radial_step(task).repeated(STEPS, 2, lines.q, np.zeros((count, 1)), path.rotation, path.move, path.turn)
    # A line is singular where a joint would make over four full turns along it; NaN is not good.
    ways = np.concatenate([lines.q[:, None], ways], axis=1)
    with np.errstate(invalid="ignore"):
        good = (np.abs(np.diff(ways, axis=1)).max(axis=2) < 25.0 * h).cumprod(axis=1).sum(axis=1)
    q, live, share = ways[np.arange(count), good], good == STEPS, good * h
    # Two corrections take away what the steps' errors have left
    p, R = lines.at(np.arange(count), np.ones(count))
    for _ in range(2):
        J, e = task.jacobian_batch(q[live])[0], task.error(q[live], p[live], R[live])
        q[live] += least_motion(J, e[:, :, None])[:, :, 0]
    exact = np.abs(task.error(q, p, R)).max(axis=1) < 1e-6
    share = np.where(exact, share, np.minimum(share, 1 - h))
    return LineEnds(q.reshape(len(starts), len(poses), -1), share.reshape(len(starts), len(poses)))


@kept
def _radial_step(task: Task) -> Function:
    """(q, s, R, move, turn) -> (posture, share) after a Runge-Kutta step of dq/ds = J^+ x' along a straight line."""
    q, s, (_, R) = symbol("q", task.n), symbol("s", 1), task._target_symbols()
    move, turn, dx = symbol("move", 3 * task.frames), symbol("turn", 3 * task.frames), symbol("dx", task.m)
    rates = as_map([R, move, turn], task._rates_expression(R, move, turn))
    J = task.jacobian_expression(task.kinematics(q), q)
    joints = as_map([q, dx], factorise(J.T).solve_transposed(dx))

    def rate(q: SX, share: SX) -> SX:
        return joints(q, rates(exp_so3(share * turn) @ R, move, turn))

    h = 1.0 / STEPS
    outputs = {"q_next": runge_kutta(rate, q, h, s, s + h / 2, s + h), "s_next": s + h}
    return Function("radial_step", {"q": q, "s": s, "R": R, "move": move, "turn": turn}, outputs)


class _Lines:
    """Straight lines from the poses at starts (k, n) to poses (k, 4, 4)."""

    def __init__(self, task: Task, starts: Matrix, poses: Array) -> None:
        self.q = starts
        p0, R0 = task._poses(np.asarray(starts))
        p, R = poses[:, :3, 3], poses[:, :3, :3]
        if leaves_free(task):
            p, R = completing(task).batch(p0, R0, p, R)
        self.path = straight(p0, R0, p, R)
        if not any(task._angular):
            self.path = replace(self.path, turn=np.zeros_like(self.path.turn))

    @classmethod
    def each_to_each(cls, task: Task, starts: Matrix, poses: Array) -> _Lines:
        """From each start (s, n) to each pose (k, 4, 4): s k lines, those of a start together."""
        return cls(task, np.repeat(starts, len(poses), axis=0), np.tile(poses, (len(starts), 1, 1)))

    def at(self, which: Indices, share: Vector) -> tuple[Matrix, Array]:
        """Positions and rotations of some lines at their shares."""
        return self.path.at(share, which)
