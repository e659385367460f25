"""Boxes that fill a part of a box, as the tree of cuts that the checker reads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..base.types import Indices, Matrix, Vector

COMPARED = 4096
"""Pairs of boxes that are compared without a further cut."""


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
        ends = np.sort(high[those, axis])
        at = clear_cuts(low[those, axis], ends)
        at = at[(a[axis] < at) & (at < b[axis])]
        under = np.searchsorted(ends, at, side="right")
        cuts += [(abs(2 * int(i) - len(those)), axis, float(c)) for i, c in zip(under, at, strict=True)]
    _, axis, at = min(cuts)
    is_below = high[those, axis] <= at
    lower, upper = sides.copy(), sides.copy()
    lower[axis], upper[axis] = (sides[axis][0], at), (at, sides[axis][1])
    below = _tree(low, high, those[is_below], lower, leaf)
    return [axis, at, below, _tree(low, high, those[~is_below], upper, leaf)]


def clear_cuts(low: Vector, high: Vector) -> Vector:
    """Where stretches low <= u <= high (k,) begin or end, and none is cut."""
    at = np.unique(np.concatenate([low, high]))
    under, over = np.searchsorted(np.sort(high), at, side="right"), np.searchsorted(np.sort(low), at, side="left")
    return at[under >= over]


def left_open(tree: Any, sides: Sequence[tuple[float, float]]) -> tuple[Matrix, Matrix]:
    """(low, high) (k, d) of the parts of a tree of `partition` in which no box is."""
    found, waiting = [], [(tree, list(sides))]
    while waiting:
        part, box = waiting.pop()
        if isinstance(part, list):
            axis, at, below, above = part
            lower, upper = box.copy(), box.copy()
            lower[axis], upper[axis] = (box[axis][0], at), (at, box[axis][1])
            waiting += [(above, upper), (below, lower)]
        elif part is None:
            found.append(box)
    ends = np.array(found).reshape(-1, len(sides), 2)
    return ends[:, :, 0], ends[:, :, 1]


def overlapping(low: Matrix, high: Matrix, ones: Indices, others: Indices) -> tuple[Indices, Indices]:
    """All pairs (one, other) whose boxes low <= u <= high (k, d) have an inside in common, cut until few are left."""
    found, waiting = [np.zeros((0, 2), dtype=int)], [(ones, others)]
    while waiting:
        ones, others = waiting.pop()
        parts = _cut(low, high, ones, others) if len(ones) * len(others) > COMPARED else None
        if parts is not None:
            waiting += parts
        elif len(ones) and len(others):
            for some in np.array_split(ones, -(-len(ones) * len(others) // (16 * COMPARED))):
                start, end = np.maximum(low[some][:, None], low[others]), np.minimum(high[some][:, None], high[others])
                i, j = np.nonzero((start < end).all(axis=2))
                found.append(np.column_stack([some[i], others[j]]))
    pairs = np.unique(np.concatenate(found), axis=0)  # a pair that a cut goes through was found on both sides
    return pairs[:, 0], pairs[:, 1]


def _cut(low: Matrix, high: Matrix, ones: Indices, others: Indices) -> list[tuple[Indices, Indices]] | None:
    """The boxes below and above the cut that leaves the fewest pairs; None where none leaves much fewer."""
    best, parts = 0.75 * len(ones) * len(others), None
    for axis in range(low.shape[1]):
        for cut in (np.median(low[ones, axis]), np.median(high[ones, axis])):
            below = ones[low[ones, axis] < cut], others[low[others, axis] < cut]
            above = ones[high[ones, axis] > cut], others[high[others, axis] > cut]
            pairs = len(below[0]) * len(below[1]) + len(above[0]) * len(above[1])
            if pairs < best:
                best, parts = pairs, [below, above]
    return parts
