"""`SearchedPoses`: of many poses in reach those that a search for sheets looks at."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..base.types import Array, Flags, Indices, Value, Vector
from .pose_features import nearby, neighbours

SOME, MOST = 400, 400
"""Poses that are searched of those that are served, and of those that were left out."""


@dataclass(frozen=True, eq=False)
class SearchedPoses(Value):
    """Of the poses in reach (K, 4, 4) a random part, in which those that were left out so far are more frequent.

    Most poses are easy: nearly any leaf serves them. So a few of these stand for all, and the search looks closely at
    the others. What a leaf serves is estimated without bias: each pose has the weight of those that it stands for.

    order: a random order of the poses (K,). left_out: by a choice of sheets so far (K,). length: what a turn of 1 rad
    counts where poses are compared [m]. some, most: how many are searched of those served, and of those left out.
    """

    reach: Array
    order: Indices
    left_out: Flags
    length: float
    some: int = SOME
    most: int = MOST

    @staticmethod
    def of(reach: Array, length: float) -> SearchedPoses:
        """A random part of some poses (K, 4, 4), the same for the same poses."""
        order = np.random.default_rng(0).permutation(len(reach))
        return SearchedPoses(reach, order, np.zeros(len(reach), dtype=bool), length)

    def without(self, served: Flags) -> SearchedPoses:
        """The same, with the poses that a choice does not serve (K,) among those left out."""
        return replace(self, left_out=self.left_out | ~served)

    @property
    def all(self) -> SearchedPoses:
        """All the poses."""
        return replace(self, some=len(self.reach), most=len(self.reach))

    @property
    def complete(self) -> bool:
        """Whether all the poses are searched."""
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
