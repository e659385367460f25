"""`Region`: a box in joint space, sampled evenly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import ArgumentError, NotFiniteError, ShapeError
from ..types import ArrayLike, Matrix, Vector, whole


@dataclass(frozen=True, eq=False)
class Region:
    """All q with lower <= q <= upper, (n,) each."""

    lower: Vector
    upper: Vector

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.lower)

    @property
    def center(self) -> Vector:
        """Middle of the box (n,)."""
        return (self.lower + self.upper) / 2

    def __str__(self) -> str:
        half = (self.upper - self.lower) / 2
        sides = [f"{v:.4g}" for v in half]
        about = ", ".join(f"{v:.4g}" for v in self.center)
        return f"[{about}] +- {sides[0] if len(set(sides)) == 1 else '[' + ', '.join(sides) + ']'}"

    def sample(self, count: int, seed: int = 0) -> Matrix:
        """`count` postures (count, n): the centre, then a scrambled Sobol sequence, the same for the same seed.

        Raises: ArgumentError unless count is a whole number, at least 1.
        """
        count = whole("samples", count)
        from scipy.stats import qmc

        power = int(np.ceil(np.log2(max(count, 2))))
        points = qmc.Sobol(self.n, scramble=True, rng=np.random.default_rng(seed)).random_base2(power)
        postures = self.lower + points * (self.upper - self.lower)
        return np.vstack([self.center, postures])[:count]


def box(lower: ArrayLike, upper: ArrayLike) -> Region:
    """The region lower <= q <= upper. Raises: ShapeError, NotFiniteError, ArgumentError if lower > upper."""
    low, high = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
    if low.ndim != 1 or low.shape != high.shape:
        raise ShapeError("the corners of a region", "(n,) twice", (low.shape, high.shape))
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        raise NotFiniteError("the corners of a region", (low.tolist(), high.tolist()))
    if (low > high).any():
        raise ArgumentError("lower", low.tolist(), f"it must not exceed upper, {high.tolist()}")
    return Region(low, high)


def around(q: ArrayLike, radius: ArrayLike) -> Region:
    """The box q +- radius, radius a number or (n,) [joint units]."""
    center = np.asarray(q, dtype=float)
    return box(center - radius, center + radius)


@dataclass(frozen=True, eq=False)
class Ball:
    """Tool positions within `radius` [m] of the tool at the posture `start` (n,), orientation kept there.

    `along` [joint units]: postures of the self-motion through the start, up to so far each way, belong to it too.
    """

    start: Vector
    radius: float
    along: float = 0.0


def ball(start: ArrayLike, radius: float, *, along: float = 0.0) -> Ball:
    """The region of tool positions about a posture. Raises: NotFiniteError, ArgumentError for a bad radius."""
    q = np.asarray(start, dtype=float)
    if not np.isfinite(q).all():
        raise NotFiniteError("the start of a ball", q.tolist())
    if not (np.isfinite(radius) and radius > 0 and np.isfinite(along) and along >= 0):
        raise ArgumentError("the (radius, along) of a ball", (radius, along), "give a positive radius in metres")
    return Ball(q, float(radius), float(along))
