"""Matrices and norms to the last rounding: products of doubles with intervals, upper bounds of 2-norms."""

from __future__ import annotations

import numpy as np

from ..symbolic.intervals import Interval
from ..types import Array, Vector

UP = 1 + 1e-13
"""Carries a bound over the roundings of the few hundred operations that made it, each of at most 1.2e-16 of it."""


def product(Y: Array, a: Interval) -> Interval:
    """Y a for exact matrices Y (k, n, n) and intervals a (k, n, j).

    With a = mid +- rad, |Y a - fl(Y mid)| <= |Y| rad + gamma |Y| |mid| with gamma = n u / (1 - n u), for sums in any
    order [Hig02, 3.5]; 1e-14 stands for gamma for n up to 80.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        mid, rad = _ball(a)
        found = Y @ mid
        bound = np.abs(Y) @ (rad + 1e-14 * np.abs(mid)) * UP + 1e-300
        low, high = found - bound, found + bound
    broken = ~(np.isfinite(low) & np.isfinite(high))
    low, high = np.where(broken, -np.inf, low), np.where(broken, np.inf, high)
    return Interval(np.nextafter(low, -np.inf), np.nextafter(high, np.inf))


def norm(a: Interval) -> Vector:
    """An upper bound (k,) of the 2-norm of all matrices (k, n, j) in an interval: |mid| + |rad|_F."""
    with np.errstate(invalid="ignore", over="ignore"):
        mid, rad = _ball(a)
        found = matrix_norm(mid) + _frobenius(rad)
    return np.where(np.isfinite(found), found * UP, np.inf)


def matrix_norm(M: Array) -> Vector:
    """An upper bound (k,) of the 2-norm of matrices (k, n, j): t^(1/2) |S^4|_F^(1/8), S = M M^T / t, t its trace.

    At most n^(1/8) too large. The entries of S and of its powers are at most 1, and 1e-10 is more than what rounding
    does to them, for n up to 80 and j up to 6,400.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        trace = np.square(_frobenius(M)) * UP
        safe = np.where((trace > 1e-300) & np.isfinite(trace), trace, 1.0)
        S = M @ np.swapaxes(M, 1, 2) / safe[:, None, None]
        S = np.where(np.isfinite(S), S, 0.0)
        S = S @ S
        bound = np.sqrt(safe) * (_frobenius(S @ S) + 1e-10) ** 0.125 * UP
    return np.where(np.isfinite(trace), np.minimum(bound, np.sqrt(trace) * UP), np.inf)


def _frobenius(M: Array) -> Vector:
    """The Frobenius norm, an upper bound."""
    with np.errstate(over="ignore"):
        return np.sqrt(np.sum(np.square(M), axis=(1, 2))) * UP + 1e-150


def _ball(a: Interval) -> tuple[Array, Array]:
    """(mid, rad) with a within mid +- rad."""
    mid = a.low / 2 + a.high / 2
    return mid, np.maximum(a.high - mid, mid - a.low) * UP
