"""The fewest sets that cover a share of all elements: an integer program, solved with a bound (HiGHS, by SciPy)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.types import Flags, Indices, Value, Vector
from .integer_program import Optimum, least

PREFERENCE = 0.2
"""Weight of the costs of sets against what they cover, once their number is decided: a set that costs the most is given
up for one that costs nothing and covers a fifth of all elements less."""

NEARLY = 1e-3
"""Share of its value that a program about sets of a known number may miss."""

ROUND = 1e-6
"""What a bound may be off."""


@dataclass(frozen=True, eq=False)
class Cover(Value):
    """Sets that cover.

    chosen: their indices. least: no fewer of the sets given cover as much: proven where it equals the number chosen.
    covered: what they cover, by weight.
    """

    chosen: Indices
    least: int
    covered: float

    @property
    def proven(self) -> bool:
        """Whether no fewer sets will do."""
        return self.least == len(self.chosen)


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
    alive = not_within_another(sets, costs)
    each = np.ones(sets.shape[1]) if weights is None else weights
    patterns, which = np.unique(sets[alive], axis=1, return_inverse=True)
    kept = patterns.any(axis=0)
    many = np.asarray(np.bincount(which.ravel(), each, patterns.shape[1])[kept], dtype=float)
    patterns = patterns[:, kept]
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
    found = least(
        np.concatenate([costs, -gains]), vstack([covers, total, count]).tocsr(), low, high, whole, seconds, gap
    )
    return found if found.x is None else Optimum(np.round(found.x[:c]), found.bound)


def _greedy(patterns: Flags, weights: Vector, goal: float) -> Vector:
    """Always the set that covers most of what is left."""
    x, left = np.zeros(len(patterns)), weights.astype(float)
    while weights.sum() - left.sum() < goal:
        best = int(np.argmax(patterns @ left))
        x[best], left = 1.0, np.where(patterns[best], 0.0, left)
    return x


def not_within_another(sets: Flags, costs: Vector) -> Indices:
    """The sets that are not within another one that costs no more."""
    sizes = sets.sum(axis=1)
    kept: list[int] = []
    order = np.lexsort((costs, -sizes))
    for i in order:
        inside = [j for j in kept if costs[j] <= costs[i] and not (sets[i] & ~sets[j]).any()]
        if sizes[i] and not inside:
            kept.append(int(i))
    return np.sort(np.array(kept, dtype=int))
