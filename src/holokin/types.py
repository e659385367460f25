"""Array aliases. Units are SI and radians; twist rows are linear first, in the base frame.

The shapes stand in the names' docstrings, since NumPy's types do not carry them:
`Vector` is (k,), `Matrix` is (rows, columns), `Array` is any shape. A batch axis comes first.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""A float64 array of any shape."""

Vector = NDArray[np.float64]
"""A float64 array of shape (k,)."""

Matrix = NDArray[np.float64]
"""A float64 array of shape (rows, columns)."""

Indices = NDArray[np.intp]
"""An integer array of any shape."""

ArrayLike = NDArray[Any] | Sequence[Any] | float
"""What a caller may pass where an array is wanted."""
