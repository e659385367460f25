"""Matrices and norms to the last rounding: products of doubles with intervals, upper bounds of 2-norms."""

from __future__ import annotations

import numpy as np

from ..base.types import Array, Vector
from ..symbolic.intervals import Interval

UNIT = 2.0**-53
"""The relative error of a rounding."""

UP = 1 + 1e-13
"""Carries a bound of positive terms over the roundings that made it, of `UNIT` each: up to 900 one after the other."""


def product(Y: Array | Interval, a: Interval) -> Interval:
    """Y a for matrices Y (k, m, n), exact or intervals, and intervals a (k, n, j).

    With Y = M +- R and a = mid +- rad, |Y a - fl(M mid)| <= |M| rad + R (|mid| + rad) + gamma |M| |mid| with
    gamma = n u / (1 - n u), for sums in any order [Hig02, 3.5]; (n + 2) u is more, and 1e-300 more than what is lost by
    underflow.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        mid, rad = _ball(a)
        M, R = _ball(Y) if isinstance(Y, Interval) else (Y, None)
        found = M @ mid
        bound = np.abs(M) @ (rad + (M.shape[2] + 2) * UNIT * np.abs(mid))
        if R is not None:
            bound = bound + R @ (np.abs(mid) + rad)
        bound = bound * UP + 1e-300
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

    At most n^(1/8) too large. |S|_F <= 1, and so S, S^2 and S^4 are off by at most (j + 2) u, 2 (j + 2) u + n u and
    4 (j + 2) u + 3 n u in that norm [Hig02, 3.5], with squares of u left out: less than the `off` that is added.
    """
    off = 10 * (M.shape[1] + M.shape[2] + 2) * UNIT
    with np.errstate(invalid="ignore", over="ignore"):
        trace = np.square(_frobenius(M)) * UP
        safe = np.where((trace > 1e-290) & np.isfinite(trace), trace, 1.0)
        S = M @ np.swapaxes(M, 1, 2) / safe[:, None, None]
        S = np.where(np.isfinite(S), S, 0.0)
        S = S @ S
        bound = np.sqrt(safe) * np.sqrt(np.sqrt(np.sqrt(_frobenius(S @ S) + off))) * UP
        bound = np.minimum(bound, np.sqrt(trace) * UP)
    return np.where(np.isfinite(trace), bound, np.inf)


def _frobenius(M: Array) -> Vector:
    """The Frobenius norm, an upper bound: a sum of N squares is off by at most N u, however it is ordered."""
    up = UP + M.shape[1] * M.shape[2] * UNIT
    with np.errstate(over="ignore"):
        return np.sqrt(np.sum(np.square(M), axis=(1, 2))) * up + 1e-150


def _ball(a: Interval) -> tuple[Array, Array]:
    """(mid, rad) with a within mid +- rad."""
    mid = a.low / 2 + a.high / 2
    return mid, np.maximum(a.high - mid, mid - a.low) * UP
