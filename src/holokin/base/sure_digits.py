"""Bounds as text: rounded to the side on which they stay true."""

from __future__ import annotations

import numpy as np

DIGITS = 3
"""Significant digits of a bound."""


def at_least(value: float, digits: int = DIGITS) -> str:
    """A lower bound as text, not above it."""
    return _rounded(value, False, digits)


def at_most(value: float, digits: int = DIGITS) -> str:
    """An upper bound as text, not below it."""
    return _rounded(value, True, digits)


def _rounded(value: float, up: bool, digits: int) -> str:
    if value == 0 or not np.isfinite(value):
        return f"{value:g}"
    text = f"{value:.{digits - 1}e}"
    if (float(text) < value) if up else (float(text) > value):
        step = 10.0 ** (int(np.floor(np.log10(abs(value)))) - digits + 1)
        text = f"{float(text) + (step if up else -step):.{digits - 1}e}"
    short = f"{float(text):.{digits}g}"
    return short if float(short) == float(text) else text
