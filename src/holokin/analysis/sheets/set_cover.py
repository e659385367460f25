"""Integer programs (HiGHS, by SciPy): the fewest sheets that cover a share of poses, and which one serves each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ...base.poses import pose_from
from ...base.types import Array, Flags, Indices, Value, Vector
from ...motion.ik.inverse_function import AGREE, answers
from ...path.path import straight
from .sheet import Sheet, known

# --- Linear programs, some of whose unknowns are whole numbers, between 0 and 1: by HiGHS, which SciPy brings.

NODES = 5000  # nodes of the search tree after which the best x is taken: the same one on a slow and on a fast machine


class Optimum(NamedTuple):
    """x (k,), None where time was too short to find any; bound: no x has less, -inf where nothing is known."""

    x: Vector | None
    bound: float


def least(
    cost: Vector, rows: Any, low: Vector, high: Vector, whole: Flags, seconds: float, gap: float = 1e-4
) -> Optimum:
    """min cost x   with   low <= rows x <= high,   0 <= x <= 1,   x whole where it is to be.

    Args:
        rows: a sparse matrix (r, k). seconds: after which the best x that was found is taken. gap: share of the least
            cost by which that of x may be higher.
    """
    from scipy.optimize import Bounds, LinearConstraint, milp

    limits: Any = low, high
    options = {"time_limit": seconds, "node_limit": NODES, "mip_rel_gap": gap}
    unknowns = {"integrality": np.asarray(whole, dtype=int), "bounds": Bounds(0.0, 1.0)}
    result = milp(cost, constraints=LinearConstraint(rows, *limits), options=options, **unknowns)
    known = getattr(result, "mip_dual_bound", None)
    bound = result.fun if known is None and result.status == 0 else known
    return Optimum(result.x, -np.inf if bound is None else float(bound))


# Weight of the costs of sets against what they cover, once their number is decided: a set that costs the most is
# given up for one that costs nothing and covers a fifth of all elements less.
PREFERENCE = 0.2

NEARLY = 1e-3  # share of its value that a program about sets of a known number may miss
ROUND = 1e-6  # what a bound may be off


@dataclass(frozen=True, eq=False)
class Cover(Value):
    """Sets that cover.

    chosen: their indices. least: no fewer of the sets given cover as much: proven where it equals the number chosen.
    covered: what they cover, by weight.
    """

    chosen: Indices
    least: int
    covered: float


def fewest(
    sets: Flags, wanted: float, costs: Vector, seconds: float, weights: Vector | None = None, preferred: float = 0.0
) -> Cover:
    """The fewest of some sets (c, k) that cover `wanted` of the elements, by weight; of equally many, those that cover
    more and cost less.

    min sum x   with   y_p <= sum_{c covers p} x_c,   sum w_p y_p >= wanted,   x in {0, 1}, 0 <= y <= 1;
    elements that the same sets cover are one, with weight w.

    Args:
        costs: of each set (c,), from 0 to 1. seconds: for each of the two programs. weights: of the elements (k,);
            by default 1. preferred: weight up to which covering more comes before all costs.
    """
    alive = _not_within_another(sets, costs)
    each = np.ones(sets.shape[1]) if weights is None else weights
    patterns, which = np.unique(sets[alive], axis=1, return_inverse=True)
    coverable = patterns.any(axis=0)
    many = np.asarray(np.bincount(which.ravel(), each, patterns.shape[1])[coverable], dtype=float)
    patterns = patterns[:, coverable]
    goal = min(wanted, float(many.sum())) - ROUND
    if goal <= 0:
        return Cover(np.zeros(0, dtype=int), 0, 0)
    ones, none = np.ones(len(alive)), np.zeros(len(many))
    first = _solved(patterns, many, ones, none, (goal, None), seconds)
    x = _greedy(patterns, many, goal) if first.x is None else first.x
    bound = max(1, int(np.ceil(first.bound - ROUND))) if np.isfinite(first.bound) else 1
    size = int(x.sum())
    gains = many / many.sum()
    if preferred > goal:
        widest = _solved(patterns, many, 0 * ones, gains, (goal, size), seconds).x
        reached = goal if widest is None else float(many[patterns[widest.astype(bool)].any(axis=0)].sum())
        goal = max(goal, min(preferred, reached) - ROUND)
    second = _solved(patterns, many, costs[alive] * (PREFERENCE / size), gains, (goal, size), seconds)
    best = x if second.x is None else second.x
    chosen = alive[best.astype(bool)]
    return Cover(chosen, min(bound, size), float(each[sets[chosen].any(axis=0)].sum()))


def _solved(
    patterns: Flags, weights: Vector, costs: Vector, gains: Vector, demands: tuple[float, int | None], seconds: float
) -> Optimum:
    """min costs x - gains y; demands: weight that is to be covered, and the number of sets, or None."""
    from scipy.sparse import csr_matrix, eye, hstack, vstack

    c, k = patterns.shape
    goal, size = demands
    covers = hstack([csr_matrix(patterns.T.astype(float)), -eye(k)])
    total = csr_matrix(np.concatenate([np.zeros(c), weights])[None])
    count = csr_matrix(np.concatenate([np.ones(c), np.zeros(k)])[None])
    low = np.concatenate([np.zeros(k), [goal, size or 0]])
    high = np.concatenate([np.full(k + 1, np.inf), [size or np.inf]])
    whole, gap = np.arange(c + k) < c, 0.0 if size is None else NEARLY
    optimum = least(
        np.concatenate([costs, -gains]), vstack([covers, total, count]).tocsr(), low, high, whole, seconds, gap
    )
    return optimum if optimum.x is None else Optimum(np.round(optimum.x[:c]), optimum.bound)


def _greedy(patterns: Flags, weights: Vector, goal: float) -> Vector:
    """Always the set that covers most of what is left."""
    x, left = np.zeros(len(patterns)), weights.astype(float)
    while weights.sum() - left.sum() < goal:
        best = int(np.argmax(patterns @ left))
        x[best], left = 1.0, np.where(patterns[best], 0.0, left)
    return x


def _not_within_another(sets: Flags, costs: Vector) -> Indices:
    """The sets that are not within another one that costs no more."""
    sizes = sets.sum(axis=1)
    largest: list[int] = []
    order = np.lexsort((costs, -sizes))
    for i in order:
        inside = [j for j in largest if costs[j] <= costs[i] and not (sets[i] & ~sets[j]).any()]
        if sizes[i] and not inside:
            largest.append(int(i))
    return np.sort(np.array(largest, dtype=int))


# --- Which sheet serves a pose where several do: so that neighbouring poses have one sheet as often as can be.

SECONDS = 60.0  # for the linear program

# What a later sheet costs at a pose against a change between neighbours: of equal choices the first sheet.
LATER_SHEET = 1e-6

# Shares of the straight way between two neighbours at which a sheet is to have a posture.
BETWEEN = (0.25, 0.5, 0.75)


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
    """Whether each sheet's joints q (S, k, n) continue (S, e) straight from one pose of a pair to the other.

    Where signs tell the posture of a pose they do if poses on the way have one, too.
    """
    goes_on = np.zeros((len(sheets), len(pairs)), dtype=bool)
    for s, sheet in enumerate(sheets):
        both = np.flatnonzero(known(q[s][pairs]).all(axis=1))
        i, j = pairs[both].T
        if sheet.single:
            way, count = straight(T[i, :3, 3], T[i, :3, :3], T[j, :3, 3], T[j, :3, :3]), len(both)
            on_it = (pose_from(*way.at(np.full(count, share), np.arange(count))) for share in BETWEEN)
            goes_on[s, both] = np.all([sheet.postures(poses)[1] for poses in on_it], axis=0)
            continue
        there, reached = answers(sheet.ik, T[j], q[s, i])
        goes_on[s, both] = reached & (np.abs(there - q[s, j]).max(axis=1) < AGREE)
    return goes_on


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
    labels = np.where(served.any(axis=0), np.argmax(served, axis=0), -1)
    both = (labels[pairs] >= 0).all(axis=1)
    edges, on = pairs[both], goes_on[:, both]
    if not len(edges):
        return Labels(labels, edges, 0)
    bound = 0
    if S > 1:
        own = served & (same == np.arange(S)[:, None])
        x, value = _relaxed(own, edges, on, same)
        labels = np.where(labels < 0, -1, np.argmax(x, axis=0))
        bound = max(0, int(np.ceil(len(edges) - value - ROUND))) if np.isfinite(value) else 0
    i, j = edges.T
    unbroken = (on & (same[:, i] == labels[i]) & (same[:, j] == labels[j])).any(axis=0)
    return Labels(labels, edges[~unbroken], bound if S > 1 else int((~unbroken).sum()))


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
    served_poses, row = np.unique(poses, return_inverse=True)
    each_once = csr_matrix((np.ones(first), (row, np.arange(first))), shape=(len(served_poses), count))
    matrix = vstack([below(0), below(1), each_once]).tocsr()
    low = np.concatenate([np.full(2 * len(once), -np.inf), np.ones(len(served_poses))])
    high = np.concatenate([np.zeros(2 * len(once)), np.ones(len(served_poses))])
    cost: Vector = np.concatenate([LATER_SHEET * which, -np.ones(len(once))]).astype(float)
    optimum = least(cost, matrix, low, high, np.zeros(count, dtype=bool), SECONDS)
    x = np.where(served, 1.0 - LATER_SHEET * np.arange(S)[:, None], -1.0)
    if optimum.x is not None:
        x[served] = optimum.x[:first]
    return x, LATER_SHEET * (S - 1) * k - optimum.bound
