"""Where the level of a strategy may lie at sampled poses: ranges, on each branch of its leaves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.types import Array, Indices, Matrix, Value, Vector
from ...symbolic import wrapped
from ..coverage.starts import Candidate
from .level_fit import Ranges

CONSTANTS = 96
"""Constant levels of which the best begins a fit."""


@dataclass(frozen=True, eq=False)
class Branch(Value):
    """The levels of a strategy at which poses have a posture that is allowed, on one branch of its leaves.

    A pose and a level have at most one posture of a branch, those levels that are in a range of the pose.

    candidate: the strategy. ranges: of levels. postures: (poses (k,), levels (k,)) -> postures (k, n) there, NaN where
    none is allowed. turning: whether levels that differ by a whole turn are the same postures.
    """

    candidate: Candidate
    ranges: Ranges
    postures: Callable[[Indices, Vector], Matrix]
    turning: bool = False

    def off(self, levels: Array, middle: Array) -> Array:
        """From a middle to a level, the shorter way where a whole turn more is the same posture."""
        gap = levels - middle
        return wrapped(gap) if self.turning else gap

    @cached_property
    def poses(self) -> Indices:
        """Those that have a range."""
        return np.unique(self.ranges.pose)

    @cached_property
    def constants(self) -> Vector:
        """Levels (c,) all over the ranges, evenly."""
        _, middle, half = self.ranges
        return np.linspace((middle - half).min(), (middle + half).max(), CONSTANTS)
