"""Rules that keep within ranges at as many poses as can be: polynomials of the pose, and directions of an angle."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...base.types import Indices, Matrix, Vector

ROUNDS, FIRST, CLOSER = 10, 1.0, 0.65
"""Rounds of a fit: how far off a value stops to count at first, and how that shrinks in each round."""

INSIDE = 0.95
"""Share of a range in which a value is to lie."""

STEPS, GAIN = 60, 1e-5
"""The most steps of a round, and the share of the loss that a step gains at which it ends."""

SEARCHED = 20
"""The most lengths that are tried for a step."""

SMALL = 1e-7
"""What the square of a coefficient costs against a pose that is missed."""


class Ranges(NamedTuple):
    """Ranges in which a value is allowed: pose (N,), middle and half of each (N,); a pose may have several."""

    pose: Indices
    middle: Vector
    half: Vector


class Values(NamedTuple):
    """Values (k,) of a rule at poses, the gradient (t,) that slopes (k,) by the values give, and a penalty of the rule
    with its gradient (t,)."""

    values: Vector
    gradient: Callable[[Vector], Vector]
    penalty: float = 0.0
    penalty_gradient: Vector | float = 0.0


def fitted(
    rule: Callable[[Matrix, Vector], Values],
    x: Vector,
    f: Matrix,
    ranges: Ranges,
    weights: Vector,
    wrap: Callable[[Vector], Vector],
    inside: float = INSIDE,
) -> Vector:
    """The coefficients x (t,) of a rule whose values lie in a range at most of the poses' weight.

        min   sum  w  z^2 / (z^2 + d^2),     z: how far a value is outside the range that is nearest to it

    with a d that shrinks from round to round, so that what is far outside counts less and less: by L-BFGS.

    Args:
        rule: (features of some poses (k, m), x) -> its values there. x: to begin with. f: features of all poses (k, m).
        weights: of these (k,). wrap: of differences of values, the shorter way.
    """
    for round_ in range(ROUNDS):
        # The range of each pose that is nearest to its value now.
        outside = np.abs(wrap(rule(f, x).values[ranges.pose] - ranges.middle)) - ranges.half
        order = np.lexsort((outside, ranges.pose))
        nearest = order[np.unique(ranges.pose[order], return_index=True)[1]]
        some, middle, half = f[ranges.pose[nearest]], ranges.middle[nearest], inside * ranges.half[nearest]
        w, d = weights[ranges.pose[nearest]] / len(nearest), FIRST * CLOSER**round_

        def loss(x: Vector) -> tuple[float, Vector]:
            at = rule(some, x)
            off = wrap(at.values - middle)
            z = np.sign(off) * np.maximum(np.abs(off) - half, 0)
            bound = z * z + d * d
            gradient = at.gradient(w * 2 * z * d * d / bound**2) + at.penalty_gradient + 2 * SMALL * x
            return float((w * z * z / bound).sum() + at.penalty + SMALL * (x @ x)), gradient

        x = _lowest(loss, x)
    return x


def polynomial(f: Matrix, x: Vector) -> Values:
    """The rule f x (k,), f the monomials of the poses (k, t)."""
    return Values(times(f, x), lambda slopes: onto(f, slopes))


def direction(f: Matrix, x: Vector) -> Values:
    """The rule atan2(f a, f b) (k,), x = (a, b); the vector is to have length 1, which no angle tells."""
    m = f.shape[1]
    sine, cosine = times(f, x[:m]), times(f, x[m:])
    square = sine * sine + cosine * cosine + 1e-12

    def gradient(slopes: Vector) -> Vector:
        slope = slopes / square
        return np.concatenate([onto(f, slope * cosine), onto(f, -slope * sine)])

    length = 4e-3 * (square - 1) / len(f)
    along = np.concatenate([onto(f, length * sine), onto(f, length * cosine)])
    return Values(np.arctan2(sine, cosine), gradient, float(1e-3 * ((square - 1) ** 2).mean()), along)


def best_constant(ranges: Ranges, weights: Vector, values: Vector, wrap: Callable[[Vector], Vector]) -> float:
    """That of some values which lies in a range at most of the poses' weight."""
    hits = [weights[np.unique(ranges.pose[np.abs(wrap(c - ranges.middle)) <= ranges.half])].sum() for c in values]
    return float(values[int(np.argmax(hits))])


# --- On one core, and the same on any number of them: a fit follows the last bit.


def times(f: Matrix, rule: Vector) -> Vector:
    """f rule, in the same order of sums however many cores there are: a fit follows the last bit."""
    return np.einsum("ij,j->i", f, rule)


def onto(f: Matrix, slope: Vector) -> Vector:
    """f^T slope, likewise."""
    return np.einsum("ij,i->j", f, slope)


def _lowest(loss: Callable[[Vector], tuple[float, Vector]], x: Vector) -> Vector:
    """Where a loss is lowest near x, by L-BFGS: as SciPy's, but on one core, and the same on each number of them."""
    value, slope = loss(x)
    pairs: list[tuple[Vector, Vector, float]] = []
    for _ in range(STEPS):
        # The direction, by the last steps and how slopes changed over them.
        direction, shares = -slope, []
        for move, change, product in reversed(pairs):
            shares.append(float(move @ direction) / product)
            direction = direction - shares[-1] * change
        if pairs:
            move, change, product = pairs[-1]
            direction = direction * product / float(change @ change)
        else:
            direction = direction * min(1.0, 1 / max(float(np.abs(slope).sum()), 1e-12))
        for (move, change, product), share in zip(pairs, reversed(shares), strict=True):
            direction = direction + (share - float(change @ direction) / product) * move
        # A step that leads down enough, and over which the slope rises enough.
        descent, low, high, step = float(slope @ direction), 0.0, np.inf, 1.0
        reached, ahead = loss(x + direction)
        for _ in range(SEARCHED):
            if not reached <= value + 1e-4 * step * descent:
                high = step
            elif float(ahead @ direction) < 0.9 * descent:
                low = step
            else:
                break
            step = 0.5 * (low + high) if np.isfinite(high) else 2 * step
            reached, ahead = loss(x + step * direction)
        if not reached < value:
            break
        move, change = step * direction, ahead - slope
        if (product := float(move @ change)) > 0:
            pairs = [*pairs[-9:], (move, change, product)]
        x, slope, gain, value = x + move, ahead, value - reached, reached
        if gain < GAIN * value:
            break
    return x
