"""Which sheet serves a pose where several do: so that neighbouring poses have one sheet as often as can be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base.types import Array, Flags, Indices, Value, Vector
from ..inverse_kinematics.inverse_function import leads_to
from .candidate_sheets import features
from .integer_program import least
from .sheet import Sheet, known

NEIGHBOURS = 8
"""Nearest poses of each pose that count as its neighbours."""

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


def neighbours(T: Array, length: float, count: int = NEIGHBOURS) -> Indices:
    """Pairs (e, 2) of poses (k, 4, 4) that are near each other: each with its nearest `count`."""
    from scipy.spatial import KDTree

    if len(T) < 2:
        return np.zeros((0, 2), dtype=int)
    X = features(T, length)
    near = np.asarray(KDTree(X).query(X, min(count + 1, len(X)))[1]).reshape(len(X), -1)[:, 1:]
    pairs = np.column_stack([np.repeat(np.arange(len(X)), near.shape[1]), near.ravel()])
    return np.unique(np.sort(pairs, axis=1), axis=0)


def continued(sheets: Sequence[Sheet], T: Array, q: Array, pairs: Indices) -> Flags:
    """Whether each sheet's joints q (S, k, n) continue (S, e) straight from one pose of a pair to the other."""
    found = np.zeros((len(sheets), len(pairs)), dtype=bool)
    for s, sheet in enumerate(sheets):
        for e in np.flatnonzero(known(q[s][pairs]).all(axis=1)):
            i, j = pairs[e]
            found[s, e] = leads_to(sheet.ik, T[j], q[s, i], q[s, j])
    return found


def labelled(served: Flags, pairs: Indices, goes_on: Flags) -> Labels:
    """The choice of sheets, of those that serve each pose, with the fewest cuts between neighbours.

    max sum z - small sum s x   with   sum_s x_ps = 1,   z_es <= x_is,   z_es <= x_js,   0 <= x, z <= 1
    over the edges e = (i, j) on which sheet s continues; what is not whole is rounded.

    Args:
        served: which sheet serves which pose (S, k). pairs: neighbours (e, 2). goes_on: as of `continued` (S, e).
    """
    S = len(served)
    of = np.where(served.any(axis=0), np.argmax(served, axis=0), -1)
    both = (of[pairs] >= 0).all(axis=1)
    edges, on = pairs[both], goes_on[:, both]
    if not len(edges):
        return Labels(of, edges, 0)
    bound = 0
    if S > 1:
        x, value = _relaxed(served, edges, on)
        of = np.where(of < 0, -1, np.argmax(x, axis=0))
        bound = max(0, int(np.ceil(len(edges) - value - ROUND))) if np.isfinite(value) else 0
    cut = ~((of[edges[:, 0]] == of[edges[:, 1]]) & on[of[edges[:, 0]], np.arange(len(edges))])
    return Labels(of, edges[cut], bound if S > 1 else int(cut.sum()))


def _relaxed(served: Flags, edges: Indices, on: Flags) -> tuple[Array, float]:
    """(x (S, k), the most edges that can be kept) of the linear program."""
    from scipy.sparse import csr_matrix, vstack

    S, k = served.shape
    column = np.full((S, k), -1)
    column[served] = np.arange(served.sum())
    s, e = np.nonzero(on)
    first = int(served.sum())
    z, count = first + np.arange(len(s)), first + len(s)
    rows = np.arange(len(s))

    def below(end: int) -> csr_matrix:
        ones = np.ones(len(s))
        places = (np.concatenate([rows, rows]), np.concatenate([z, column[s, edges[e, end]]]))
        return csr_matrix((np.concatenate([ones, -ones]), places), shape=(len(s), count))

    which, poses = np.nonzero(served)
    here, at = np.unique(poses, return_inverse=True)
    one = csr_matrix((np.ones(first), (at, np.arange(first))), shape=(len(here), count))
    matrix = vstack([below(0), below(1), one]).tocsr()
    low = np.concatenate([np.full(2 * len(s), -np.inf), np.ones(len(here))])
    high = np.concatenate([np.zeros(2 * len(s)), np.ones(len(here))])
    cost: Vector = np.concatenate([PREFERENCE * which, -np.ones(len(s))]).astype(float)
    found = least(cost, matrix, low, high, np.zeros(count, dtype=bool), SECONDS)
    x = np.where(served, 1.0 - PREFERENCE * np.arange(S)[:, None], -1.0)
    if found.x is not None:
        x[served] = found.x[:first]
    return x, PREFERENCE * (S - 1) * k - found.bound
