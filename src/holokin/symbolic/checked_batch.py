"""`CheckedBatch`: a checked function of one vector at many samples. The one rule of (n,) or (k, n) is here."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from ..base.errors import ShapeError
from ..base.types import Array, ArrayLike, Flags, Matrix, numbers, whole
from .native.evaluator import Doubt
from .native.program import Shapes

PIECE = 100_000
"""Samples that are checked at once, so that only the results grow with their number."""


class CheckedBatch:
    """y (k, *result) of x (k, n): what the single call gives and checks of each row, by `Function.batch`.

    Args:
        batch: `Function.batch` of a function of one vector; its first output is given, its last ones are measures.
        size: n. others: the shapes of the outputs but for the first.
        result: the shape of one result.
        convert: (what is given, how to call it) -> (n,). Raises typed errors.
        doubt, bounds: as of `Function.checked`.
    """

    def __init__(
        self, batch: Callable[..., Any], size: int, others: Shapes, result: tuple[int, ...],
        convert: Callable[..., Array], doubt: Doubt, bounds: Sequence[float],
    ) -> None:  # fmt: skip
        self._batch, self._size, self._others = batch, size, others
        self._result, self._bounds = result, tuple(bounds)
        self._convert, self._doubt = convert, doubt

    def array(self, given: ArrayLike) -> Array:
        """x (n,), checked, or (k, n) as numbers, which are checked by their results. Raises: as `convert`."""
        if hasattr(given, "keys"):  # values by name, of whose order `convert` knows
            return self._convert(given)
        found = numbers("q", given)
        if found.ndim != 2:
            return self._convert(found)
        if found.shape[1] != self._size:
            raise ShapeError("q", f"({self._size},) or (k, {self._size})", found.shape)
        return found

    def __call__(self, Q: Matrix, threads: int | None = None) -> Array:
        """The results at Q (k, n), a row each; see `Function.batch` for threads.

        Raises: what `convert` or `doubt` raises of the first row that is not sound.
        """
        if threads is not None:
            whole("threads", threads)
        found = np.empty((len(Q), *self._result))
        edges = np.linspace(0, len(Q), 1 + max(1, len(Q) // PIECE)).astype(int)
        for first, last in pairwise(edges.tolist()):
            more = [np.empty((last - first, *shape)) for shape in self._others]
            self._batch(Q[first:last], threads=threads, out=[found[first:last], *more])
            measures = [one.reshape(-1) for one in more[len(more) - len(self._bounds) :]]
            for i in np.flatnonzero(~self._sound(found[first:last], measures)).tolist():
                q = self._convert(Q[first + i], f"posture {first + i}")
                found[first + i] = self._doubt(q, found[first + i].copy(), *(float(one[i]) for one in measures))
        return found

    def _sound(self, found: Array, measures: list[Array]) -> Flags:
        """Which rows are finite, with measures above their bounds; a sum beyond all floats counts as not finite."""
        rows = found.reshape(len(found), int(np.prod(self._result)))
        with np.errstate(all="ignore"):
            sound: Any = np.isfinite(rows @ np.ones(rows.shape[1]))
            for one, bound in zip(measures, self._bounds, strict=True):
                sound &= one > bound
        return sound
