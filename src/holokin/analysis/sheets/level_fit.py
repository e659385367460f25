"""Rules that keep within ranges at as many poses as can be: polynomials of the pose, and directions of an angle."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...base.lbfgs import minimizer
from ...base.types import Array, Flags, Indices, Matrix, Vector

ROUNDS, FIRST, CLOSER = 7, 1.0, 0.6
"""Rounds of a fit: how far off [rad or m] a value stops to count at first, and how that shrinks in each round."""

INSIDE = 0.95
"""Share of a range in which a value is to lie."""

SMALL = 1e-7
"""What the square of a coefficient costs against a pose that is missed."""

Off = Callable[[Array, Array], Array]
"""(values, middles) -> from a middle to a value, of an angle the shorter way."""


class Ranges(NamedTuple):
    """Ranges in which a value is allowed: pose (N,), middle and half of each (N,); a pose may have several."""

    pose: Indices
    middle: Vector
    half: Vector


def ranges_of(flags: Flags, values: Vector, turning: bool) -> Ranges:
    """The ranges of values (C,), evenly spaced, that are allowed at poses (k, C); turning: they go all round a turn."""
    # A turn begins behind a value that is not allowed.
    k, count = flags.shape
    begin = flags.argmin(axis=1) if turning else np.zeros(k, dtype=int)
    flags = np.take_along_axis(flags, (begin[:, None] + np.arange(count)) % count, axis=1)
    edge, step = np.zeros((k, 1), dtype=bool), values[1] - values[0]
    change = np.diff(np.hstack([edge, flags, edge]).astype(int), axis=1)
    (pose, first), (_, after) = np.nonzero(change == 1), np.nonzero(change == -1)
    middle = values[0] + step * (begin[pose] + 0.5 * (first + after - 1))
    return Ranges(pose, middle, 0.5 * step * (after - 1 - first) + 0.2 * step)


class Values(NamedTuple):
    """Values (k,) of a rule at poses, a penalty of the rule, and what slopes (k,) by the values become: the gradient
    (t,) by the coefficients, with that of the penalty."""

    values: Vector
    gradient: Callable[[Vector], Vector]
    penalty: float = 0.0


Rule = Callable[[Matrix, Vector, Vector], Values]
"""(features of poses (k, m), their shares of the weight (k,), coefficients (t,)) -> the rule's values there."""


def fitted(
    rule: Rule,
    x: Vector,
    f: Matrix,
    ranges: Ranges,
    weights: Vector,
    off: Off,
    limits: tuple[float, float] | None = None,
    small: float = SMALL,
) -> Vector:
    """The coefficients x (t,) of a rule whose values lie in a range at most of the poses' weight.

        min   sum  w  z^2 / (z^2 + d^2),     z: how far a value is outside the range that is nearest to it

    with a d that shrinks from round to round, so that what is far outside counts less and less: by L-BFGS.

    Args:
        x: to begin with. f: features of all poses (k, m). weights: of these (k,). limits: to which values are clipped,
            so that they may go on beyond these where a range reaches them. small: what the square of a coefficient
            costs against a pose that is missed.
    """
    low, high = (-np.inf, np.inf) if limits is None else limits
    for round_ in range(ROUNDS):
        # The range of each pose that is nearest to its value now.
        value = np.clip(rule(f, weights, x).values, low, high)
        outside = np.abs(off(value[ranges.pose], ranges.middle)) - ranges.half
        order = np.lexsort((outside, ranges.pose))
        nearest = order[np.unique(ranges.pose[order], return_index=True)[1]]
        some, middle, half = f[ranges.pose[nearest]], ranges.middle[nearest], INSIDE * ranges.half[nearest]
        w, d = weights[ranges.pose[nearest]] / len(nearest), FIRST * CLOSER**round_
        share = w / w.sum()
        ends = [np.abs(end - middle) <= ranges.half[nearest] for end in (low, high)]

        def loss(x: Vector) -> tuple[float, Vector]:
            at = rule(some, share, x)
            gap = off(at.values, middle)
            z = np.sign(gap) * np.maximum(np.abs(gap) - half, 0)
            z[(ends[0] & (gap < 0)) | (ends[1] & (gap > 0))] = 0.0
            bound = z * z + d * d
            value = (w * z * z / bound).sum() + at.penalty + small * (x @ x)
            return float(value), at.gradient(w * 2 * z * d * d / bound**2) + 2 * small * x

        x = minimizer(loss, x)
    return x


def polynomial(f: Matrix, _share: Vector, x: Vector) -> Values:
    """The rule f x (k,), f the monomials of the poses (k, t)."""
    return Values(times(f, x), lambda slopes: _onto(f, slopes))


def direction(f: Matrix, share: Vector, x: Vector) -> Values:
    """The rule atan2(f a, f b) (k,), x = (a, b); the vector is to have length 1, which no angle tells."""
    m = f.shape[1]
    sine, cosine = times(f, x[:m]), times(f, x[m:])
    square = sine * sine + cosine * cosine + 1e-12

    length = 4e-3 * share * (square - 1)

    def gradient(slopes: Vector) -> Vector:
        by_sine = slopes * cosine / square + length * sine
        by_cosine = -slopes * sine / square + length * cosine
        return np.concatenate([_onto(f, by_sine), _onto(f, by_cosine)])

    return Values(np.arctan2(sine, cosine), gradient, 1e-3 * float(share @ (square - 1) ** 2))


def served_weight(values: Vector, ranges: Ranges, weights: Vector, off: Off) -> float:
    """The weight of the poses whose ranges hold values (N,), one for each range."""
    inside = np.abs(off(values, ranges.middle)) <= ranges.half
    return float(weights[np.unique(ranges.pose[inside])].sum())


def times(f: Matrix, rule: Vector) -> Vector:
    """f rule, in the same order of sums however many cores there are: a fit follows the last bit."""
    return np.einsum("ij,j->i", f, rule)


def _onto(f: Matrix, slope: Vector) -> Vector:
    """f^T slope, likewise."""
    return np.einsum("ij,i->j", f, slope)
