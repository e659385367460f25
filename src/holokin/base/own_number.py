"""A number from a function of the user's own: whatever goes wrong in it is said with its name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .errors import OwnFunctionError


def own_number(what: str, function: Callable[..., Any], *given: Any) -> float | None:
    """What the function gives, as a float; None where it says None.

    Raises:
        OwnFunctionError: it raises, or gives no single finite number.
    """
    try:
        found = function(*given)
    except Exception as problem:  # a function of the user's may raise anything
        kind = type(problem).__name__
        raise OwnFunctionError(what, f"raises {kind}: {problem}", "see to it, or leave it out") from problem
    if found is None:
        return None
    try:
        numbers = np.asarray(found, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise OwnFunctionError(what, f"gives {found!r}", "give one number, or None for none") from None
    if numbers.size != 1:
        raise OwnFunctionError(what, f"gives an array of shape {numbers.shape}", "give one number, or None for none")
    if not np.isfinite(numbers).all():
        raise OwnFunctionError(what, f"gives {float(numbers.ravel()[0])}", "give a finite number, or None for none")
    return float(numbers.ravel()[0])
