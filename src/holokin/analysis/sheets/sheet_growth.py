"""How far a leaf reaches: by straight lines from a posture, then from neighbour to neighbour."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ...base.errors import HolokinError
from ...base.types import Array, Flags, Indices, Matrix
from ...motion.checks import Clear
from ...motion.ik.inverse_function import AGREE
from ...strategies import HolonomicStrategy, holonomic
from ...strategies.constraints import custom
from ...strategies.tasks.task import Task
from ..coverage import regular_starts
from ..coverage.leaf_lines import along_leaf, native_from, one_by_one
from ..coverage.starts import Candidate, candidates, postures_at
from .sheet import allowed_postures, known

# Share of its neighbours that need not lead to a pose that is grown: at a hollow edge of a sheet a straight path to a
# neighbour leaves it. Where a leaf ends between two sides of a sheet, half of them do not lead across.
FAILING = 0.25

# (postures (k, n) to begin from, numbers of poses (k,)) -> (postures there (k, n), which is served (k,)).
Go = Callable[[Matrix, Indices], tuple[Matrix, Flags]]


def grown(q: Matrix, near: Indices, go: Go) -> tuple[Matrix, Indices]:
    """A sheet's postures at k poses, grown from those it has.

    Wave after wave the poses next to it are reached straight from a neighbour. So poses behind a hole or a corner of
    the leaf are reached, too, which no straight path from its start does. A pose is taken only if no neighbour
    that the sheet serves leads to another posture, and three quarters of them to the same: else the leaf overlaps
    itself, or ends between them.

    Args:
        q: the postures (k, n) that it has, NaN for none. near: of each pose its neighbours (k, m), nearest first.

    Returns:
        (postures (k, n), NaN where it does not serve; the wave in which each was reached (k,), -1 for never).
    """
    q = q.copy()
    wave, tried, count = np.where(known(q), 0, -1), np.zeros(near.shape, dtype=bool), 0
    while True:
        count += 1
        can = (wave >= 0)[near] & ~tried & (wave < 0)[:, None]
        front = np.flatnonzero(can.any(axis=1))
        if not len(front):
            return q, wave
        column = np.argmax(can[front], axis=1)
        tried[front, column] = True
        postures, served = go(q[near[front, column]], front)
        ask, other = np.nonzero(
            served[:, None] & (wave >= 0)[near[front]] & (column[:, None] != np.arange(near.shape[1]))
        )
        asked, failed = 1 + np.bincount(ask, minlength=len(front)), np.zeros(len(front))
        if len(ask):
            there, reached = go(q[near[front[ask], other]], front[ask])
            differs = reached & ~(np.abs(there - postures[ask]).max(axis=1) <= AGREE)
            failed = np.bincount(ask, ~reached, len(front))
            served[ask[differs]] = False
        served &= failed <= FAILING * asked
        tried[front[~served & (asked > 1)]] = True
        q[front[served]], wave[front[served]] = postures[served], count


def one_function(q: Matrix, wave: Indices, pairs: Indices, go: Go) -> tuple[Matrix, Matrix]:
    """A sheet's postures without those that contradict their neighbours, so that it is one function of the pose.

    Where a leaf overlaps itself, as after a turn round the base, it comes to one pose with two postures. Of two
    neighbours of which one leads to another posture of the other, that which was reached later is left out. So is a
    posture that was grown, if more than a quarter of its neighbours do not lead to it at all. Postures that were
    reached straight from the start are kept: the straight paths between them and the start are on the leaf.

    Returns:
        (postures (k, n), NaN where it does not serve; the other postures (l, n) of the leaf, at poses left out).
    """
    q = q.copy()
    both = pairs[known(q[pairs]).all(axis=1)]
    if not len(both):
        return q, q[:0]
    postures, served = go(q[both[:, 0]], both[:, 1])
    differs = ~(np.abs(postures - q[both[:, 1]]).max(axis=1) <= AGREE)
    clash, apart = both[served & differs], both[~served]
    consistent, out = known(q), []
    count = np.bincount(clash.ravel(), minlength=len(q))
    for i in np.lexsort((-count, -wave)).tolist():  # the latest first
        near, failing = _others(both, i), _others(apart, i)
        split = wave[i] > 0 and consistent[failing].sum() > FAILING * consistent[near].sum()
        if split or consistent[_others(clash, i)].any():
            consistent[i] = False
            out.append(i)
    others = []
    for i in out:
        begin = [j for j in _others(clash, i) if consistent[j]][:1]
        there, reached = go(q[begin], np.full(len(begin), i))
        others += list(there[reached])
    q[out] = np.nan
    return q, np.array(others).reshape(-1, q.shape[1])


def _others(pairs: Indices, i: int) -> Indices:
    """What is beside i in some pairs (e, 2)."""
    rows = pairs[(pairs == i).any(axis=1)].ravel()
    return rows[rows != i]


# --- What a leaf serves, and what it costs: estimates, by many straight lines side by side.

MOST_STRATEGIES = 6  # whose leaves are tried all over the workspace. On a Panda the first three made up the cover.

# Share of a straight line below which a step is given up: what lies behind is reached from pose to pose.
SHORTEST = 1 / 64

ROUGH = 64  # poses by which strategies are put in order
STARTS = 8  # postures at one pose through which leaves of each strategy are tried


def fitting_candidates(
    task: Task, T: Array, center: Matrix, strategies: Sequence[HolonomicStrategy] | None, clear: Clear | None
) -> list[Candidate]:
    """The strategies whose leaves are tried: those given; else of all that fit, those whose leaves serve most at the
    centre.

    Where nothing is redundant there is one: its leaves are the branches of the arm.
    """
    if strategies is not None:
        return [Candidate(strategy.name, {}, task, strategy) for strategy in strategies]
    if task.n == task.m:
        only = holonomic(task, custom(lambda _q: [], rows=0), name="branch")
        return [Candidate("branch", {}, task, only)]
    starts = postures_at(task, center, STARTS)
    starts = starts if len(starts) else regular_starts(task)[:STARTS]
    fitting = [candidate for candidate in candidates(task, starts) if candidate.strategy is not None]
    some = T[:: max(1, len(T) // ROUGH)]
    served = [lines_served(candidate, starts, some, clear, 0.0)[0] for candidate in fitting]
    # Those with the widest leaf, and those that add most to what is served.
    worth = [flags.mean(axis=1).max(initial=0.0) + 0.5 * flags.any(axis=0).mean() for flags in served]
    return [fitting[i] for i in np.argsort(-np.array(worth), kind="stable")[:MOST_STRATEGIES]]


def lines_served(
    candidate: Candidate, starts: Matrix, T: Array, clear: Clear | None, rcond: float
) -> tuple[Flags, Array]:
    """(which poses of T (k, 4, 4) the leaves of a strategy through postures (s, n) serve (s, k), postures (s, k, n)),
    along the straight path from each."""
    shape = len(starts), len(T)
    if candidate.strategy is None:
        return np.zeros(shape, dtype=bool), np.zeros((*shape, candidate.task.n))
    try:
        ends = along_leaf(candidate.strategy, starts, T, None, native_from(len(T)), SHORTEST)
    except HolokinError:  # it is singular at a start
        return np.zeros(shape, dtype=bool), np.zeros((*shape, candidate.task.n))
    q = ends.q.reshape(-1, candidate.task.n)
    within = ends.reached.ravel() & candidate.task.robot.within(q)
    return allowed_postures(candidate.strategy, q, within, rcond, clear).reshape(shape), ends.q


def side_by_side(strategy: HolonomicStrategy, T: Array, clear: Clear | None, rcond: float) -> Go:
    """The straight paths of a leaf to poses T (k, 4, 4), many side by side."""

    def go(begin: Matrix, which: Indices) -> tuple[Matrix, Flags]:
        q, reached = one_by_one(strategy, begin, T[which], native_from(len(T)))
        return q, allowed_postures(strategy, q, reached & strategy.task.robot.within(q), rcond, clear)

    return go
