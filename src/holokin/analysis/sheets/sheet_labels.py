"""Which sheet serves a pose where several do: so that neighbouring poses have one sheet as often as can be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...base.types import Array, Flags, Indices, Value, Vector
from ...motion.ik.inverse_function import AGREE
from ...motion.ik.quiet_answers import answers
from .integer_program import least
from .sheet import Sheet, known

ROUND = 1e-6
"""What a bound may be off."""

SECONDS = 60.0
"""For the linear program."""

PREFERENCE = 1e-6
"""What a later sheet costs at a pose against a change between neighbours: of equal choices the first sheet."""


@dataclass(frozen=True, eq=False)
class Labels(Value):
    """A sheet for each pose (k,), -1 where there is none.

    cuts: pairs (c, 2) of neighbours whose joints do not continue from one to the other. least: no choice of sheets has
    fewer, by a linear program.
    """

    of: Indices
    cuts: Indices
    least: int


def continued(sheets: Sequence[Sheet], T: Array, q: Array, pairs: Indices) -> Flags:
    """Whether each sheet's joints q (S, k, n) continue (S, e) straight from one pose of a pair to the other."""
    found = np.zeros((len(sheets), len(pairs)), dtype=bool)
    for s, sheet in enumerate(sheets):
        both = np.flatnonzero(known(q[s][pairs]).all(axis=1))
        i, j = pairs[both].T
        there, reached = answers(sheet.ik, T[j], q[s, i])
        found[s, both] = reached & (np.abs(there - q[s, j]).max(axis=1) < AGREE)
    return found


def same_postures(q: Array) -> Indices:
    """Of each sheet's joints q (S, k, n) the first sheet that has the same (S, k): parts of one leaf overlap."""
    S, k, _ = q.shape
    first = np.repeat(np.arange(S)[:, None], k, axis=1)
    for s in range(S):
        for t in range(s):
            same = (first[s] == s) & (np.abs(q[s] - q[t]).max(axis=1) < AGREE)  # false of NaN
            first[s, same] = first[t, same]
    return first


def labelled(served: Flags, pairs: Indices, goes_on: Flags, same: Indices | None = None) -> Labels:
    """The choice of sheets, of those that serve each pose, with the fewest cuts between neighbours.

    max sum z - small sum s x   with   sum_s x_ps = 1,   z_es <= x_is,   z_es <= x_js,   0 <= x, z <= 1
    over the edges e = (i, j) on which sheet s continues; what is not whole is rounded. Where sheets have the same
    posture, that of the first stands for all.

    Args:
        served: which sheet serves which pose (S, k). pairs: neighbours (e, 2). goes_on: as of `continued` (S, e).
        same: as of `same_postures` (S, k); by default no two sheets have the same.
    """
    S, k = served.shape
    same = np.repeat(np.arange(S)[:, None], k, axis=1) if same is None else same
    of = np.where(served.any(axis=0), np.argmax(served, axis=0), -1)
    both = (of[pairs] >= 0).all(axis=1)
    edges, on = pairs[both], goes_on[:, both]
    if not len(edges):
        return Labels(of, edges, 0)
    bound = 0
    if S > 1:
        own = served & (same == np.arange(S)[:, None])
        x, value = _relaxed(own, edges, on, same)
        of = np.where(of < 0, -1, np.argmax(x, axis=0))
        bound = max(0, int(np.ceil(len(edges) - value - ROUND))) if np.isfinite(value) else 0
    i, j = edges.T
    kept = (on & (same[:, i] == of[i]) & (same[:, j] == of[j])).any(axis=0)
    return Labels(of, edges[~kept], bound if S > 1 else int((~kept).sum()))


def _relaxed(served: Flags, edges: Indices, on: Flags, same: Indices) -> tuple[Array, float]:
    """(x (S, k), the most edges that can be kept) of the linear program."""
    from scipy.sparse import csr_matrix, vstack

    S, k = served.shape
    column = np.full((S, k), -1)
    column[served] = np.arange(served.sum())
    s, e = np.nonzero(on)
    ends = np.stack([column[same[s, edges[e, end]], edges[e, end]] for end in (0, 1)])
    _, once = np.unique(np.vstack([ends, e]), axis=1, return_index=True)
    ends = ends[:, once]
    first = int(served.sum())
    z, count = first + np.arange(len(once)), first + len(once)
    rows = np.arange(len(once))

    def below(end: int) -> csr_matrix:
        ones = np.ones(len(once))
        places = (np.concatenate([rows, rows]), np.concatenate([z, ends[end]]))
        return csr_matrix((np.concatenate([ones, -ones]), places), shape=(len(once), count))

    which, poses = np.nonzero(served)
    here, at = np.unique(poses, return_inverse=True)
    one = csr_matrix((np.ones(first), (at, np.arange(first))), shape=(len(here), count))
    matrix = vstack([below(0), below(1), one]).tocsr()
    low = np.concatenate([np.full(2 * len(once), -np.inf), np.ones(len(here))])
    high = np.concatenate([np.zeros(2 * len(once)), np.ones(len(here))])
    cost: Vector = np.concatenate([PREFERENCE * which, -np.ones(len(once))]).astype(float)
    found = least(cost, matrix, low, high, np.zeros(count, dtype=bool), SECONDS)
    x = np.where(served, 1.0 - PREFERENCE * np.arange(S)[:, None], -1.0)
    if found.x is not None:
        x[served] = found.x[:first]
    return x, PREFERENCE * (S - 1) * k - found.bound
