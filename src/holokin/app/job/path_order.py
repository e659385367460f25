"""The order of several paths, and a posture for each: the fewest changes of sheet, then the least time between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...base.types import Indices, Matrix, Value, Vector

CHANGE = 1e6
"""Cost of a change of sheet, in seconds: more than all ways of a job take together."""

MOST_TRANSITIONS = 3e8
"""Steps of the exact search over all orders: subsets of paths, times pairs of postures. Some seconds."""

MOST_POSTURES = 60
"""Postures among which an order is looked for: 12 paths on 5 sheets take a tenth of a second, some hundred times."""

MOST_SETS = 4096
"""Sets of paths that a number of sheets serves, of which the largest are kept: all of 12 paths."""

ROUNDS = 20
"""Rounds of exchanges by which an order is improved at most; each is taken only where it saves time."""


@dataclass(frozen=True, eq=False)
class Choices(Value):
    """Postures (k,) at which N paths may begin, each with the way that follows from it along its path.

    path (k,): of which path it is. sheet (k,): a number of the sheet on which it runs. first (k,): seconds from where
    the motion begins; between (k, k): from the end of one to the beginning of another; last (k,): from its end to where
    the motion ends. Infinite where there is no way.
    """

    path: Indices
    sheet: Indices
    first: Vector
    between: Matrix
    last: Vector

    @property
    def costs(self) -> Matrix:
        """Seconds between, with `CHANGE` for each change of sheet (k, k); infinite within a path."""
        cost = self.between + CHANGE * (self.sheet[:, None] != self.sheet)
        return np.where(self.path[:, None] == self.path, np.inf, cost)


@dataclass(frozen=True)
class PathSequence(Value):
    """Chosen postures in the order in which they are gone through, and whether no order has a lower cost."""

    chosen: tuple[int, ...]
    cost: float
    exact: bool

    @property
    def changes(self) -> int:
        """How often the sheet changes."""
        return int(self.cost // CHANGE)


def in_order(choices: Choices, order: Sequence[int]) -> tuple[float, list[int]]:
    """The least cost of paths in an order, and the posture of each: dynamic programming from one to the next."""
    members = [np.flatnonzero(choices.path == p) for p in order]
    costs = choices.costs
    cost, back = choices.first[members[0]], []
    for a, b in pairwise(members):
        total = cost[:, None] + costs[np.ix_(a, b)]
        back.append(total.argmin(axis=0))
        cost = total.min(axis=0)
    total = cost + choices.last[members[-1]]
    last = int(total.argmin())
    chosen = [last]
    for step in reversed(back):
        chosen.append(int(step[chosen[-1]]))
    return float(total[last]), [int(m[i]) for m, i in zip(members, reversed(chosen), strict=True)]


def best_sequence(choices: Choices, given: bool) -> PathSequence:
    """The postures of the least cost: of the paths in the order of their numbers, or in any order.

    Any order is exact by dynamic programming over the subsets of paths while these are few [HK62]; else the nearest
    path comes next, and then single paths are moved and parts turned round while that saves something.

    Args:
        given: whether the order is that of the numbers.
    """
    paths = np.unique(choices.path).tolist()
    if given:
        cost, chosen = in_order(choices, paths)
        return PathSequence(tuple(chosen), cost, True)
    if 2.0 ** len(paths) * len(choices.path) ** 2 <= MOST_TRANSITIONS:
        return _over_subsets(choices, paths)
    return _improved(choices, paths)


def least_pool(path: Indices, sheet: Indices) -> tuple[list[int], int]:
    """(those of some postures (k,) on the fewest sheets that serve all paths together, how many sheets these are).

    In any order the sheet changes at least as often as there are sheets, less one, and no more where the paths of a
    sheet follow each other. Of many such sets of sheets those with the lowest numbers are kept, `MOST_POSTURES` in all.
    """
    numbers = np.unique(sheet).tolist()
    every = frozenset(path.tolist())
    serves = {number: frozenset(path[sheet == number].tolist()) for number in numbers}
    # What can be served by 1, 2, ... sheets, with a set of sheets that does it; larger sets take the place of smaller.
    reached: dict[frozenset[int], frozenset[int]] = {frozenset(): frozenset()}
    before = reached
    while every not in reached:
        before, reached = reached, {}
        for done, used in before.items():
            for number in numbers:
                if not serves[number] <= done:
                    reached.setdefault(done | serves[number], used | {number})
        largest = sorted(reached, key=len, reverse=True)[:MOST_SETS]
        reached = {done: reached[done] for done in largest}
    kept = set(reached[every])
    others = [n for n in numbers if n not in kept and any(done | serves[n] == every for done in before)]
    for number in others:
        if np.isin(sheet, [*kept, number]).sum() <= MOST_POSTURES:
            kept.add(number)
    return np.flatnonzero(np.isin(sheet, sorted(kept))).tolist(), len(reached[every])


def _over_subsets(choices: Choices, paths: list[int]) -> PathSequence:
    """Least cost to have gone through a subset of paths and to stand at the end of one of them [HK62]."""
    costs, k = choices.costs, len(choices.path)
    bit = 1 << np.searchsorted(paths, choices.path)
    best = np.full((1 << len(paths), k), np.inf)
    came = np.full(best.shape, -1, dtype=np.int32)
    best[bit, np.arange(k)] = choices.first
    for subset in range(1, len(best)):
        total = best[subset][:, None] + costs
        least = total.min(axis=0)
        new = np.flatnonzero((bit & subset == 0) & np.isfinite(least))
        after = subset | bit[new]
        better = least[new] < best[after, new]
        new, after = new[better], after[better]
        best[after, new], came[after, new] = least[new], total[:, new].argmin(axis=0)
    # Back from the end of the least.
    subset, total = len(best) - 1, best[-1] + choices.last
    at = int(total.argmin())
    cost, chosen = float(total[at]), [at]
    while (before := int(came[subset, at])) >= 0:
        subset, at = subset & ~int(bit[at]), before
        chosen.append(at)
    return PathSequence(tuple(reversed(chosen)), cost, True)


def _improved(choices: Choices, paths: list[int]) -> PathSequence:
    """The nearest path next, then paths moved and parts turned round while the cost falls: it may not be least."""
    costs = choices.costs
    of = {p: np.flatnonzero(choices.path == p) for p in paths}
    near = {(p, r): costs[np.ix_(of[p], of[r])].min() for p in paths for r in paths if p != r}
    order = [min(paths, key=lambda p: choices.first[choices.path == p].min())]
    while rest := [p for p in paths if p not in order]:
        order.append(min(rest, key=lambda p: near[order[-1], p]))
    cost, chosen = in_order(choices, order)
    for _ in range(ROUNDS):
        before = cost
        for a in range(len(order)):
            for b in range(len(order)):
                others = order[:a] + order[a + 1 :]
                moved = [*others[:b], order[a], *others[b:]]
                turned = [*order[:a], *reversed(order[a : b + 1]), *order[b + 1 :]]
                for tried in (moved, turned):
                    if sorted(tried) == sorted(order) and (found := in_order(choices, tried))[0] < cost:
                        (cost, chosen), order = found, tried
        if cost >= before:
            break
    return PathSequence(tuple(chosen), cost, False)
