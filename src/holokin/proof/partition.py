"""Boxes that fill a part of a box, as the tree of cuts that the checker reads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..types import Indices, Matrix


def partition(low: Matrix, high: Matrix, sides: Sequence[tuple[float, float]], leaf: Callable[[int], Any]) -> Any:
    """A tree of boxes low <= u <= high (k, d) within a box: [axis, at, below, above], leaf(i) for box i, None for none.

    The boxes are what is left of a box that was cut across, and its parts again: so a cut that meets none is found.
    """
    return _tree(low, high, np.arange(len(low)), list(sides), leaf)


def _tree(low: Matrix, high: Matrix, those: Indices, sides: list[Any], leaf: Callable[[int], Any]) -> Any:
    if not len(those):
        return None
    a, b = np.array(sides).T
    if len(those) == 1 and (low[those[0]] == a).all() and (high[those[0]] == b).all():
        return leaf(int(those[0]))
    cuts = []
    for axis in range(len(sides)):
        starts, ends = np.sort(low[those, axis]), np.sort(high[those, axis])
        at = np.unique(np.concatenate([starts, ends]))
        at = at[(a[axis] < at) & (at < b[axis])]
        under = np.searchsorted(ends, at, side="right")
        over = len(those) - np.searchsorted(starts, at, side="left")
        clear = under + over == len(those)
        cuts += [
            (abs(int(i - j)), axis, float(c)) for i, j, c in zip(under[clear], over[clear], at[clear], strict=True)
        ]
    _, axis, at = min(cuts)
    is_below = high[those, axis] <= at
    lower, upper = sides.copy(), sides.copy()
    lower[axis], upper[axis] = (sides[axis][0], at), (at, sides[axis][1])
    below = _tree(low, high, those[is_below], lower, leaf)
    return [axis, at, below, _tree(low, high, those[~is_below], upper, leaf)]
