"""How far a sheet reaches: from pose to neighbouring pose, as long as its leaf goes on."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...base.types import Flags, Indices, Matrix
from ...motion.ik.inverse_function import AGREE
from .sheet import known

FAILING = 0.25
"""Share of its neighbours that need not lead to a pose that is grown: at a hollow edge of a sheet a straight path to a
neighbour leaves it. Where a leaf ends between two sides of a sheet, half of them do not lead across."""

Go = Callable[[Matrix, Indices], tuple[Matrix, Flags]]
"""(postures (k, n) to begin from, numbers of poses (k,)) -> (postures there (k, n), which is served (k,))."""


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
        at = np.flatnonzero(can.any(axis=1))
        if not len(at):
            return q, wave
        column = np.argmax(can[at], axis=1)
        tried[at, column] = True
        found, served = go(q[near[at, column]], at)
        ask, other = np.nonzero(served[:, None] & (wave >= 0)[near[at]] & (column[:, None] != np.arange(near.shape[1])))
        asked, failed = 1 + np.bincount(ask, minlength=len(at)), np.zeros(len(at))
        if len(ask):
            there, reached = go(q[near[at[ask], other]], at[ask])
            differs = reached & ~(np.abs(there - found[ask]).max(axis=1) <= AGREE)
            failed = np.bincount(ask, ~reached, len(at))
            served[ask[differs]] = False
        served &= failed <= FAILING * asked
        tried[at[~served & (asked > 1)]] = True
        q[at[served]], wave[at[served]] = found[served], count


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
    found, served = go(q[both[:, 0]], both[:, 1])
    differs = ~(np.abs(found - q[both[:, 1]]).max(axis=1) <= AGREE)
    clash, apart = both[served & differs], both[~served]
    kept, out = known(q), []
    count = np.bincount(clash.ravel(), minlength=len(q))
    for i in np.lexsort((-count, -wave)).tolist():  # the latest first
        near, failing = _others(both, i), _others(apart, i)
        split = wave[i] > 0 and kept[failing].sum() > FAILING * kept[near].sum()
        if split or kept[_others(clash, i)].any():
            kept[i] = False
            out.append(i)
    others = []
    for i in out:
        begin = [j for j in _others(clash, i) if kept[j]][:1]
        there, reached = go(q[begin], np.full(len(begin), i))
        others += list(there[reached])
    q[out] = np.nan
    return q, np.array(others).reshape(-1, q.shape[1])


def _others(pairs: Indices, i: int) -> Indices:
    """What is beside i in some pairs (e, 2)."""
    rows = pairs[(pairs == i).any(axis=1)].ravel()
    return rows[rows != i]
