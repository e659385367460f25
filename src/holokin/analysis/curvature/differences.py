"""Derivatives of a function that is known by its values alone, with an error for each: differences, extrapolated.

Central differences over steps h, h/2, h/4, ... are extrapolated to 0 [Rid82]. Long steps leave a remainder, short ones
enlarge the noise of the values. Of all extrapolations the one is taken whose remainder, estimated by its neighbours,
and noise are least together. The noise is what a polynomial leaves of values near the posture.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...base.types import Array, Matrix, Vector

LONGEST = 0.1
"""First step [joint units]: about the size of the regions that are judged."""

STEPS = 8
"""Steps, each half the one before, down to 8e-4: with values of 16 digits the fourth or fifth is the best."""

REACH = 4e-3
"""Distance [joint units] of the values from which noise is measured: longer than the digits of single precision, and so
short that a smooth function is a polynomial there: a sine that turns once in 1 rad is one to (4e-3)^6 / 6! = 6e-18."""

DEGREE = 5
"""Of this polynomial."""

AROUND = 16
"""Values from which noise is measured, at uneven distances, so that no periodic noise looks smooth."""

ROUND_OFF = 2.0**-52
"""Least noise, as a share of the largest value: the last digit."""

Values = Callable[[Vector], Array]
"""A function of postures (n,) whose values have any one shape."""


@dataclass(frozen=True, eq=False)
class Slope:
    """A derivative along a direction; `error`, what its columns may be away from the true one, and the `step` used."""

    value: Array
    error: Vector
    step: float


def noise_of(f: Values, q: Vector, direction: Vector) -> float:
    """The standard deviation of the noise of f about q, at least its last digit; infinite where f is not finite."""
    places = _uneven()
    values = np.array([f(q + REACH * place * direction).ravel() for place in places])
    if not np.isfinite(values).all():
        return np.inf
    basis, _ = np.linalg.qr(np.polynomial.chebyshev.chebvander(places, DEGREE))
    left = values - basis @ (basis.T @ values)
    measured = float(np.sqrt((left**2).sum(axis=0).max() / (AROUND - DEGREE - 1)))
    return max(measured, ROUND_OFF * float(np.abs(values).max()))


def _uneven() -> Vector:
    """Places (AROUND,) from -1 to 1."""
    return np.linspace(-1.0, 1.0, AROUND) + np.random.default_rng(0).uniform(-0.4, 0.4, AROUND) * 2 / AROUND


def slope(f: Values, q: Vector, direction: Vector, noise: float) -> Slope:
    """The derivative of f (n, m) at q along a unit direction (n,).

    Steps at which f is not finite are left out. The errors are infinite where too few are left.
    """
    best = Slope(np.full(f(q).shape, np.nan), np.full(f(q).shape[1], np.inf), np.nan)
    row: list[tuple[Array, float]] = []  # (extrapolation, its factor of the noise)
    for h in LONGEST * 0.5 ** np.arange(STEPS):
        central = (f(q + h * direction) - f(q - h * direction)) / (2 * h)
        if not np.isfinite(central).all():
            row = []
            continue
        new = [(central, 1.0 / (np.sqrt(2.0) * h))]
        for k, (before, gain) in enumerate(row):
            better, c = new[-1], 4.0 ** (k + 1)
            new.append(((c * better[0] - before) / (c - 1), (c * better[1] + gain) / (c - 1)))
            remainder = np.maximum(_lengths(new[-1][0] - better[0]), _lengths(new[-1][0] - before))
            error = remainder + new[-1][1] * noise * np.sqrt(len(central))
            if error.max() < best.error.max():
                best = Slope(new[-1][0], error, float(h))
        row = new
    return best


def _lengths(columns: Matrix) -> Vector:
    return np.linalg.norm(columns, axis=0)
