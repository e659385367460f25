"""`Region`: a box in joint space, sampled evenly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, ShapeError, posture_text
from ...base.types import ArrayLike, Matrix, Value, Vector, finite, whole
from ...path.workspaces import sobol


@dataclass(frozen=True, eq=False)
class Region(Value):
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
        return self.told()

    @typed
    def told(self, names: Sequence[str] = ()) -> str:
        """The middle +- half the sides; with the joints' names, if they are given."""
        half = (self.upper - self.lower) / 2
        sides = [f"{v:.4g}" for v in half]
        about = posture_text(self.center, names)
        return f"{about} +- {sides[0] if len(set(sides)) == 1 else '[' + ', '.join(sides) + ']'}"

    @typed
    def sample(self, count: int, seed: int = 0) -> Matrix:
        """`count` postures (count, n): the centre, then a scrambled Sobol sequence, the same for the same seed.

        Raises:
            ArgumentError unless count is a whole number, at least 1.
        """
        count, seed = whole("samples", count), whole("seed", seed, 0)
        postures = self.lower + sobol(self.n, count, seed) * (self.upper - self.lower)
        return np.vstack([self.center, postures])[:count]


@typed
def box(lower: ArrayLike, upper: ArrayLike) -> Region:
    """The region lower <= q <= upper. Raises: ShapeError, NotFiniteError, ArgumentError if lower > upper."""
    low, high = finite("lower", lower, ("n",)), finite("upper", upper, ("n",))
    if not len(low) or low.shape != high.shape:
        raise ShapeError("the corners of a region", "(n,) twice", (low.shape, high.shape))
    if (low > high).any():
        raise ArgumentError("lower", low.tolist(), f"it must not exceed upper, {high.tolist()}")
    return Region(low, high)


@typed
def around(q: ArrayLike, radius: ArrayLike) -> Region:
    """The box q +- radius, radius a number or (n,) [joint units]."""
    center, half = finite("q", q, ("n",)), finite("radius", radius)
    if half.shape not in ((), center.shape):
        raise ShapeError("radius", center.shape, half.shape, "give one number, or one a joint")
    return box(center - half, center + half)


@dataclass(frozen=True, eq=False)
class Ball(Value):
    """Tool positions within `radius` [m] of the tool at the posture `start` (n,), orientation kept there.

    `along` [joint units]: postures of the self-motion through the start, up to so far each way, belong to it too.
    `turn` [rad]: so do tools that are turned by up to so much, about any axis.
    """

    start: Vector
    radius: float
    along: float = 0.0
    turn: float = 0.0


@typed
def ball(start: ArrayLike, radius: float, *, along: float = 0.0, turn: float = 0.0) -> Ball:
    """The region of tool positions about a posture. Raises: NotFiniteError, ArgumentError for a bad radius."""
    q = finite("the start of a ball", start, ("n",))
    if not (0 < radius < np.inf and 0 <= along < np.inf and 0 <= turn <= np.pi):
        cure = "give a positive radius in metres, and a turn of at most pi"
        raise ArgumentError("the (radius, along, turn) of a ball", (radius, along, turn), cure)
    return Ball(q, float(radius), float(along), float(turn))
