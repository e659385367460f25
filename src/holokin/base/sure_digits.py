"""Bounds as text: rounded to the side on which they stay true."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

DIGITS = 3
"""Significant digits of a bound."""


def at_least(value: float, digits: int = DIGITS) -> str:
    """A lower bound as text, not above it."""
    return _rounded(value, False, digits)


def at_most(value: float, digits: int = DIGITS) -> str:
    """An upper bound as text, not below it."""
    return _rounded(value, True, digits)


def share_text(share: float) -> str:
    """A share that is proven, 0 to 1, in percent, rounded down."""
    return percentages([share, 1 - share])[0]


def percentages(shares: Sequence[float]) -> list[str]:
    """Shares, 0 to 1, that add up to 1, in percent: the first one rounded down, and all together 100 %.

    Tenths go to those that lack most. What is there, and has none, is "under 0.1 %"; so is all that is not, "over".
    """
    tenths = np.clip(np.asarray(shares, dtype=float), 0.0, 1.0) * 1000
    counts = np.floor(tenths + 1e-9).astype(int)
    for i in 1 + np.argsort(counts[1:] - tenths[1:], kind="stable")[: max(1000 - int(counts.sum()), 0)]:
        counts[i] += 1
    return [_percent(int(k), share > 0, len(counts) > 1 and share < 1) for k, share in zip(counts, shares, strict=True)]


def _percent(tenths: int, some: bool, others: bool) -> str:
    if tenths == 0 and some:
        return "under 0.1 %"
    if tenths == 1000 and others:
        return "over 99.9 %"
    return f"{tenths / 10:g} %"


def _rounded(value: float, up: bool, digits: int) -> str:
    if value == 0 or not np.isfinite(value):
        return f"{value:g}"
    text = f"{value:.{digits - 1}e}"
    if (float(text) < value) if up else (float(text) > value):
        step = 10.0 ** (int(np.floor(np.log10(abs(value)))) - digits + 1)
        text = f"{float(text) + (step if up else -step):.{digits - 1}e}"
    short = f"{float(text):.{digits}g}"
    return short if float(short) == float(text) else text
