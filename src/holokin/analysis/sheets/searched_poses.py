"""`SearchedPoses`: of many poses in reach those that a search for sheets looks at."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...base.types import Array, Flags, Indices, Value, Vector
from .pose_features import nearby, neighbours

SOME, MOST = 400, 400
"""Poses that are searched of those that are served, and of those that were left out."""


@dataclass(frozen=True, eq=False)
class SearchedPoses(Value):
    """Of the poses in reach (K, 4, 4) a random part, in which those that were left out so far are more frequent.

    Most poses are easy: nearly any leaf serves them. So a few of these stand for all, and the search looks closely at
    the others. What a leaf serves is estimated without bias: each pose has the weight of those that it stands for.

    every: all poses (E, 4, 4), of which the first K are in question so far. order: a random order of these (K,).
    left_out: by a choice of sheets so far (K,). length: what a turn of 1 rad counts where poses are compared [m]. some,
    most: how many are searched of those served, and of those left out.
    """

    every: Array
    order: Indices
    left_out: Flags
    length: float
    some: int = SOME
    most: int = MOST

    @staticmethod
    def of(every: Array, length: float, first: int | None = None) -> SearchedPoses:
        """A random part of some poses (E, 4, 4), or of the `first` of them; the same for the same poses."""
        count = len(every) if first is None else min(first, len(every))
        order = np.random.default_rng(0).permutation(count)
        return SearchedPoses(every, order, np.zeros(count, dtype=bool), length)

    @property
    def reach(self) -> Array:
        """The poses (K, 4, 4) that are in question."""
        return self.every[: len(self.order)]

    def more(self) -> SearchedPoses:
        """The same with all poses in question; itself where they are."""
        if len(self.order) == len(self.every):
            return self
        left_out = np.zeros(len(self.every), dtype=bool)
        left_out[: len(self.left_out)] = self.left_out
        return replace(SearchedPoses.of(self.every, self.length), left_out=left_out)

    def without(self, served: Flags) -> SearchedPoses:
        """The same, with the poses that a choice does not serve (K,) among those left out."""
        return replace(self, left_out=self.left_out | ~served)

    @property
    def all(self) -> SearchedPoses:
        """All the poses."""
        wider = self.more()
        return replace(wider, some=len(self.every), most=len(self.every))

    @property
    def complete(self) -> bool:
        """Whether all the poses in question are searched."""
        return len(self.which) == len(self.reach)

    @cached_property
    def which(self) -> Indices:
        """Their indices (k,) among the poses in reach."""
        return np.sort(np.concatenate(self._parts))

    @cached_property
    def weights(self) -> Vector:
        """How many poses each stands for (k,)."""
        each = np.zeros(len(self.reach))
        for part, count in zip(self._parts, ((~self.left_out).sum(), self.left_out.sum()), strict=True):
            each[part] = count / max(1, len(part))
        return np.asarray(each[self.which])

    @cached_property
    def T(self) -> Array:
        """The poses (k, 4, 4)."""
        return self.reach[self.which]

    @cached_property
    def near(self) -> Indices:
        """Of each pose its neighbours (k, m)."""
        return nearby(self.T, self.length)

    @cached_property
    def pairs(self) -> Indices:
        """Pairs (e, 2) of neighbours."""
        return neighbours(self.T, self.length)

    @cached_property
    def _parts(self) -> tuple[Indices, Indices]:
        left = self.left_out[self.order]
        return self.order[~left][: self.some], self.order[left][: self.most]
