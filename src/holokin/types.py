"""Array aliases. Units are SI and radians; twist rows are linear first, in the base frame.

The shapes stand in the names' docstrings, since NumPy's types do not carry them:
`Vector` is (k,), `Matrix` is (rows, columns), `Array` is any shape. A batch axis comes first.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import ArgumentError

Array = NDArray[np.float64]
"""A float64 array of any shape."""

Vector = NDArray[np.float64]
"""A float64 array of shape (k,)."""

Matrix = NDArray[np.float64]
"""A float64 array of shape (rows, columns)."""

Indices = NDArray[np.intp]
"""An integer array of any shape."""

Flags = NDArray[np.bool_]
"""An array of yes and no, of any shape."""

ArrayLike = NDArray[Any] | Sequence[Any] | float
"""What a caller may pass where an array is wanted."""


def whole(what: str, value: Any) -> int:
    """A whole number of at least 1. Raises: ArgumentError for anything else, True and 2.0 included."""
    if isinstance(value, bool) or not (isinstance(value, int | np.integer) and value >= 1):
        raise ArgumentError(what, value, "give a whole number, at least 1")
    return int(value)


def number(what: str, value: Any) -> float:
    """A number as a float. Raises: ArgumentError for anything else, True included."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.number):
        raise ArgumentError(what, value, "give a number")
    try:
        return float(value)
    except OverflowError:  # a whole number beyond all floats
        raise ArgumentError(what, value, "give a number below 1e308") from None


def numbers(what: str, value: Any) -> Array:
    """An array of floats. Raises: ArgumentError for what is no array of numbers, ragged lists included."""
    try:
        return np.asarray(value, dtype=float)
    except (TypeError, ValueError, OverflowError, RecursionError):
        raise ArgumentError(what, value, "give numbers, in rows of one length") from None
