"""What a leaf serves, and what it costs: estimates, by many straight lines side by side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...base.errors import HolokinError
from ...base.types import Array, Flags, Indices, Matrix
from ...motion.checks import Clear
from ...strategies import HolonomicStrategy, holonomic
from ...strategies.constraints import custom
from ...strategies.tasks.task import Task
from ..coverage import regular_starts
from ..coverage.candidates import Candidate, candidates
from ..coverage.line_ends import along_leaf, one_by_one
from ..coverage.starts import postures_at
from .searched_poses import SearchedPoses
from .sheet import allowed_postures, known
from .sheet_growth import Go

LAWS = 6
"""Laws of which leaves are looked at all over the workspace. On a Panda the first three made up the cover."""

SHORTEST = 1 / 64
"""Share of a straight line below which a step is given up: what lies behind is reached from pose to pose."""

JUMP, JUMPS = 0.5, 10.0
"""Difference of joints [rad or m] that counts as a jump between neighbours, and what the share of these pairs costs."""

MARGIN = 0.1
"""Share of a joint's range next to a limit that counts as near it."""

ROUGH = 64
"""Poses by which laws are put in order."""

STARTS = 8
"""Postures at one pose through which leaves of each law are tried."""


def cost_of(strategy: HolonomicStrategy, q: Matrix, poses: SearchedPoses) -> float:
    """Of postures (k, n) at the poses, NaN for none: the mean of |G|, over what it is at the least, of the share of
    joints near a limit, and of neighbours between which the joints jump: they are off by more than JUMP from
    (G_i e_ij - G_j e_ji) / 2, e_ij the task error from one pose to the other."""
    robot, there = strategy.task.robot, known(q)
    Q, G = q[there], strategy.gain.batch(q[there])[0]
    span = robot.upper - robot.lower
    room = np.minimum(Q - robot.lower, robot.upper - Q)
    near = float(np.mean(room < MARGIN * np.where(np.isfinite(span), span, 0.0)))
    place = np.cumsum(there) - 1
    pairs = poses.pairs[there[poses.pairs].all(axis=1)]
    (i, j), T = place[pairs].T, poses.T[there]
    error = [strategy.task.error(Q[a], T[b, :3, 3], T[b, :3, :3]) for a, b in ((i, j), (j, i))]
    moved = (np.einsum("kij,kj->ki", G[i], error[0]) - np.einsum("kij,kj->ki", G[j], error[1])) / 2
    jumps = float(np.mean(np.abs(Q[j] - Q[i] - moved).max(axis=1) > JUMP)) if len(pairs) else 0.0
    return float(np.sqrt(np.mean(np.sum(G**2, axis=(1, 2)))) * (1 + near + JUMPS * jumps))


def fitting_laws(
    task: Task, T: Array, center: Matrix, strategies: Sequence[HolonomicStrategy] | None, clear: Clear | None
) -> list[Candidate]:
    """The laws whose leaves are tried: those given; else of all that fit, those whose leaves serve most at the centre.

    Where nothing is redundant there is one: its leaves are the branches of the arm.
    """
    if strategies is not None:
        return [Candidate(one.name, {}, task, one) for one in strategies]
    if task.n == task.m:
        only = holonomic(task, custom(lambda _q: [], rows=0), name="branch")
        return [Candidate("branch", {}, task, only)]
    starts = postures_at(task, center, STARTS)
    starts = starts if len(starts) else regular_starts(task)[:STARTS]
    found = [one for one in candidates(task, starts) if one.strategy is not None]
    some = T[:: max(1, len(T) // ROUGH)]
    sizes = [lines_served(one, starts, some, clear, 0.0)[0] for one in found]
    return [found[i] for i in _best(sizes, len(found))]


def lines_served(
    law: Candidate, starts: Matrix, T: Array, clear: Clear | None, rcond: float, native: int | None = None,
    levels: Matrix | None = None,
) -> tuple[Flags, Array]:  # fmt: skip
    """(which poses of T (k, 4, 4) the leaves of a law through postures (s, n) serve (s, k), postures (s, k, n)), along
    the straight path from each; levels: of the poses (k, r) for a start, by default that of the start."""
    shape = len(starts), len(T)
    if law.strategy is None:
        return np.zeros(shape, dtype=bool), np.zeros((*shape, law.task.n))
    try:
        ends = along_leaf(law.strategy, starts, T, levels, native, SHORTEST)
    except HolokinError:  # it is singular at a start
        return np.zeros(shape, dtype=bool), np.zeros((*shape, law.task.n))
    q = ends.q.reshape(-1, law.task.n)
    within = ends.reached.ravel() & law.task.robot.within(q)
    return allowed_postures(law.strategy, q, within, rcond, clear).reshape(shape), ends.q


def side_by_side(
    strategy: HolonomicStrategy, T: Array, clear: Clear | None, rcond: float, native: int | None,
    levels: Matrix | None = None,
) -> Go:  # fmt: skip
    """The straight paths of a leaf to poses T (k, 4, 4), many side by side; levels: of the poses (k, r), by default
    that of the posture from which a path begins."""

    def go(begin: Matrix, at: Indices) -> tuple[Matrix, Flags]:
        q, reached = one_by_one(strategy, begin, T[at], native, None if levels is None else levels[at])
        return q, allowed_postures(strategy, q, reached & strategy.task.robot.within(q), rcond, clear)

    return go


def _best(served: list[Flags], count: int) -> Indices:
    """The laws with the widest leaf, and those that add most to what is served: the first LAWS of them."""
    widest = np.array([flags.mean(axis=1).max(initial=0.0) for flags in served])
    together = np.array([flags.any(axis=0).mean() for flags in served])
    order = np.argsort(-(widest + 0.5 * together), kind="stable")
    return np.asarray(order[: min(LAWS, count)], dtype=int)
