"""Interval arithmetic over arrays: enclosures [low, high] that hold to the last rounding. [Moo66] [Tuc11]

IEEE 754 rounds +, -, *, / and the square root to the nearest double, so the true result of an operation on doubles lies
between the neighbours of the computed one. Each bound is therefore moved outwards by one double or two, and nothing
else is trusted: no rounding mode, no accuracy of a library's sine. Sines, arc tangents, exponentials and logarithms are
Taylor polynomials that this arithmetic itself evaluates, with the remainder added to them.

An interval is a pair of arrays of one shape. It may be unbounded, (-inf, inf): what is divided by an interval around 0,
or the root of one that reaches below 0, is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ..base.types import Array, Flags

_NEXT, _LEAST, _LARGEST = np.array(2.0**-52), np.array(2.0**-1022), np.finfo(float).max
"""Of a number, at least the distance to its next double; the same of those too small for this; the largest double."""


class Interval(NamedTuple):
    """All numbers from low to high, element by element."""

    low: Array
    high: Array

    @property
    def magnitude(self) -> Array:
        """The largest absolute value."""
        return np.maximum(np.abs(self.low), np.abs(self.high))

    @property
    def middle(self) -> Array:
        """A number inside, near the middle; none, NaN, where it is unbounded on both sides."""
        with np.errstate(invalid="ignore"):
            return np.clip(self.low / 2 + self.high / 2, self.low, self.high)


def point(value: Array) -> Interval:
    """The interval that holds one number."""
    return Interval(value, value)


def outward(low: Array, high: Array) -> Interval:
    """One double or two further on each side; what is not a number becomes unbounded.

    |x| 2^-52 is at least the distance to the next double, which is itself a double: rounding does not come below it.
    The next one exactly (`nextafter`) takes five times as long.
    """
    below, above = np.abs(low, np.empty(low.shape)), np.abs(high, np.empty(high.shape))
    np.multiply(below, _NEXT, below)  # in place: most of the time would go into new arrays
    np.multiply(above, _NEXT, above)
    np.subtract(low, np.add(below, _LEAST, below), below)
    np.add(high, np.add(above, _LEAST, above), above)
    if not np.logical_and.reduce(below <= above, None):  # one is not a number, as inf - inf is, or it overflowed
        lost = np.isnan(low) | np.isnan(high)
        below, above = np.where(low == np.inf, _LARGEST, below), np.where(high == -np.inf, -_LARGEST, above)
        below, above = np.where(lost, -np.inf, below), np.where(lost, np.inf, above)
    return Interval(below, above)


def hull(a: Interval, b: Interval) -> Interval:
    """The least interval around both."""
    return Interval(np.minimum(a.low, b.low), np.maximum(a.high, b.high))


def within(a: Interval, low: float, high: float) -> Interval:
    """What of a can be true where the result is known to lie in [low, high]."""
    return Interval(np.clip(a.low, low, high), np.clip(a.high, low, high))


def add(a: Interval, b: Interval) -> Interval:
    """a + b."""
    return outward(a.low + b.low, a.high + b.high)


def subtract(a: Interval, b: Interval) -> Interval:
    """a - b."""
    return outward(a.low - b.high, a.high - b.low)


def negate(a: Interval) -> Interval:
    """-a, exactly."""
    return Interval(-a.high, -a.low)


def multiply(a: Interval, b: Interval) -> Interval:
    """a b: from the four products of the ends."""
    with np.errstate(invalid="ignore", over="ignore"):
        p, q, r, s = a.low * b.low, a.low * b.high, a.high * b.low, a.high * b.high
        return outward(np.minimum(np.minimum(p, q), np.minimum(r, s)), np.maximum(np.maximum(p, q), np.maximum(r, s)))


def square(a: Interval) -> Interval:
    """a^2, which is not below 0."""
    with np.errstate(over="ignore"):
        low, high = np.square(a.low), np.square(a.high)
        across = (a.low <= 0) & (a.high >= 0)
        product = outward(np.where(across, 0.0, np.minimum(low, high)), np.maximum(low, high))
    return Interval(np.maximum(product.low, 0.0), product.high)


def invert(a: Interval) -> Interval:
    """1 / a: unbounded where a holds 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = outward(1.0 / a.high, 1.0 / a.low)
    across = (a.low <= 0) & (a.high >= 0)
    return Interval(np.where(across, -np.inf, inverse.low), np.where(across, np.inf, inverse.high))


def divide(a: Interval, b: Interval) -> Interval:
    """a / b: unbounded where b holds 0."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        p, q, r, s = a.low / b.low, a.low / b.high, a.high / b.low, a.high / b.high
        quotient = outward(
            np.minimum(np.minimum(p, q), np.minimum(r, s)), np.maximum(np.maximum(p, q), np.maximum(r, s))
        )
    across = (b.low <= 0) & (b.high >= 0)
    return Interval(np.where(across, -np.inf, quotient.low), np.where(across, np.inf, quotient.high))


def hypotenuse(a: Interval, b: Interval) -> Interval:
    """sqrt(a^2 + b^2)."""
    size = add(square(a), square(b))
    return root(Interval(np.maximum(size.low, 0.0), size.high))


def root(a: Interval) -> Interval:
    """The square root: unbounded where a reaches below 0."""
    with np.errstate(invalid="ignore"):
        roots = outward(np.sqrt(a.low), np.sqrt(a.high))
    return Interval(np.where(roots.low > -np.inf, np.maximum(roots.low, 0.0), roots.low), roots.high)


def absolute(a: Interval) -> Interval:
    """|a|, exactly."""
    across = (a.low <= 0) & (a.high >= 0)
    low, high = np.abs(a.low), np.abs(a.high)
    return Interval(np.where(across, 0.0, np.minimum(low, high)), np.maximum(low, high))


def smaller(a: Interval, b: Interval) -> Interval:
    """min(a, b), exactly."""
    return Interval(np.minimum(a.low, b.low), np.minimum(a.high, b.high))


def larger(a: Interval, b: Interval) -> Interval:
    """max(a, b), exactly."""
    return Interval(np.maximum(a.low, b.low), np.maximum(a.high, b.high))


def _constant(digits: str) -> tuple[float, float]:
    """The doubles on either side of a decimal number."""
    nearest = float(digits)
    return math.nextafter(nearest, -math.inf), math.nextafter(nearest, math.inf)


PI = _constant("3.14159265358979323846264338327950288")
LN2 = _constant("0.69314718055994530941723212145817657")


def _around(value: tuple[float, float]) -> Interval:
    return Interval(np.array(value[0]), np.array(value[1]))


_QUARTER = _around((PI[0] / 2, PI[1] / 2))
"""A quarter of a turn, pi / 2."""


def _quotients(terms: Sequence[tuple[int, int]]) -> list[Interval]:
    """Enclosures of p / q, both of them doubles."""
    return [outward(np.array(p / q), np.array(p / q)) for p, q in terms]


def _series(x: Interval, coefficients: Sequence[Interval], remainder: Interval) -> Interval:
    """sum_k c_k x^k by Horner's rule, and the remainder."""
    total = coefficients[-1]
    for c in reversed(coefficients[:-1]):
        total = add(multiply(total, x), c)
    return add(total, remainder)


def _ball(size: Interval) -> Interval:
    return Interval(-size.high, size.high)


_SINE = 9
"""Terms of sine and cosine: up to y^17 and y^16."""

_SINE_OFF, _COSINE_OFF = 40 * 2.0**-53, 56 * 2.0**-53
"""By how much their polynomials in doubles are off, of |y| and of 1, for |y| <= 1.

Horner's rule gives the term of y^(2k) or y^(2k + 1) at most 3k + 4 <= 28 factors 1 + d, |d| <= u = 2^-53: k products by
z, k roundings of z = y y, k + 1 sums, its coefficient and a last product. So the error is at most 29 u sinh |y| or
29 u cosh y [Hig02, 5.1], sinh 1 < 1.18, cosh 1 < 1.55. What follows the last term, |y|^19 / 19! or y^18 / 18!, is less
than 2 u. Underflow, for |y| < 1e-150, loses no more than 1e-300 of y^3.
"""


def _polynomials(y: Array) -> tuple[Array, Array]:
    """(sine, cosine) of doubles |y| <= 1, in doubles."""
    z = y * y
    sine, cosine = (np.full_like(z, (-1) ** (_SINE - 1) / math.factorial(2 * _SINE - i)) for i in (1, 2))
    for k in range(_SINE - 2, -1, -1):
        sine = sine * z + (-1) ** k / math.factorial(2 * k + 1)
        cosine = cosine * z + (-1) ** k / math.factorial(2 * k)
    return sine * y, cosine


def _sine_at(x: Array, shift: int) -> Interval:
    """sin(x + shift pi / 2) at doubles x: x = k pi / 2 + y with |y| < 1, and the quadrant k tells which of the two.

    y is known to an interval; both functions change by its half width at most from what they are at a double in it.
    """
    k = np.rint(x * (2 / math.pi))
    y = subtract(point(x), multiply(point(k), _QUARTER))
    c = y.middle
    far = ~(np.maximum(np.abs(y.low), np.abs(y.high)) < 1.0)  # so large that pi is not known well enough
    c = np.where(far, 0.0, c)
    sine, cosine = _polynomials(c)
    width = np.nextafter(np.maximum(y.high - c, c - y.low), np.inf) * (1 + 1e-15)
    quadrant = (k + shift) % 4
    odd = (quadrant % 2) == 1
    values = np.where(odd, cosine, sine) * np.where(quadrant >= 2, -1.0, 1.0)
    off = np.nextafter(width + np.where(odd, _COSINE_OFF, _SINE_OFF * np.abs(c)) * (1 + 1e-15), np.inf)
    low, high = np.nextafter(values - off, -np.inf), np.nextafter(values + off, np.inf)
    return Interval(np.where(far, -1.0, np.maximum(low, -1.0)), np.where(far, 1.0, np.minimum(high, 1.0)))


def _wave(a: Interval, shift: int) -> Interval:
    """sin(a + shift pi / 2): at the ends, and +-1 where an extreme may lie between them."""
    wide = ~((a.high - a.low < 6.0) & (np.maximum(np.abs(a.low), np.abs(a.high)) < 1e6))
    low, high = np.where(wide, 0.0, a.low), np.where(wide, 0.0, a.high)
    ends = low[None] if np.array_equal(low, high) else np.stack((low, high))
    values = _sine_at(ends, shift)
    values = hull(Interval(values.low[0], values.high[0]), Interval(values.low[-1], values.high[-1]))
    turns = divide(point(ends), _QUARTER)
    first, last = turns.low[0], turns.high[-1]
    top = _holds(first + shift, last + shift, 1)  # x = pi/2 + 2 pi j: x / (pi/2) = 1 mod 4; adding a small whole
    bottom = _holds(first + shift, last + shift, 3)  # number may round, so a bit more than the interval is looked at
    return Interval(np.where(wide | bottom, -1.0, values.low), np.where(wide | top, 1.0, values.high))


def _holds(first: Array, last: Array, phase: int) -> Flags:
    """Whether phase + 4 j, j whole, may lie in [first, last] widened by 1e-9."""
    return np.floor((last - phase + 1e-9) / 4) >= np.ceil((first - phase - 1e-9) / 4)


def sine(a: Interval) -> Interval:
    """sin a."""
    return _wave(a, 0)


def cosine(a: Interval) -> Interval:
    """cos a."""
    return _wave(a, 1)


def tangent(a: Interval) -> Interval:
    """tan a: unbounded where the cosine may vanish."""
    return divide(sine(a), cosine(a))


def _rising(f: Callable[[Array], Interval]) -> Callable[[Interval], Interval]:
    """A function that rises, from enclosures of it at doubles."""
    return lambda a: Interval(f(a.low).low, f(a.high).high)


_ARCTAN = 14
_ARCTAN_TERMS = _quotients([((-1) ** k, 2 * k + 1) for k in range(_ARCTAN)])


def _arctan_at(x: Array) -> Interval:
    """atan x = 4 atan(t), t by halving the angle twice, t = u / (1 + sqrt(1 + u^2)): |t| <= tan(pi / 8) < 0.42."""
    big = ~(np.abs(x) < 1e150)
    y = point(np.where(big, 0.0, x))
    one = point(np.ones_like(x))
    for _ in range(2):
        y = divide(y, add(one, root(add(one, square(y)))))
    z = square(y)
    power = z
    for _ in range(_ARCTAN - 1):
        power = multiply(power, z)
    left = divide(power, point(np.full_like(x, 2.0 * _ARCTAN + 1)))  # the series alternates and falls
    series = _series(z, _ARCTAN_TERMS, _ball(left))
    angle = multiply(point(np.full_like(x, 4.0)), multiply(series, y))
    edge = PI[1] / 2
    far = Interval(np.where(x > 0, PI[0] / 2 - 1e-149, -edge), np.where(x > 0, edge, -PI[0] / 2 + 1e-149))
    low, high = np.where(big, far.low, angle.low), np.where(big, far.high, angle.high)
    return Interval(np.maximum(low, -edge), np.minimum(high, edge))


arctan = _rising(_arctan_at)
"""atan a."""


def arctan2(y: Interval, x: Interval) -> Interval:
    """atan2(y, x): within atan(y / x) and atan(x / y), where the divisor keeps its sign; [-pi, pi] across the cut."""
    pi, quarter = _around(PI), _QUARTER
    right, over = arctan(divide(y, x)), arctan(divide(x, y))
    candidates = [right, subtract(quarter, over), subtract(negate(quarter), over), add(right, pi)]
    cases = [x.low > 0, y.low > 0, y.high < 0, (x.high < 0) & (y.low >= 0)]
    low, high = np.full_like(right.low, -PI[1]), np.full_like(right.high, PI[1])
    for case, one in zip(cases, candidates, strict=True):  # each holds the angle: far from its axis atan is less exact
        low = np.where(case, np.maximum(low, one.low), low)
        high = np.where(case, np.minimum(high, one.high), high)
    return Interval(low, high)


_EXP = 18
_EXP_TERMS = _quotients([(1, math.factorial(j)) for j in range(_EXP)])


def _exp_at(x: Array) -> Interval:
    """exp x = 2^k exp(y), |y| < 0.4: what the series leaves out is below twice its first term left out."""
    k = np.rint(np.clip(x, -700, 700) / math.log(2))
    y = subtract(point(np.clip(x, -700, 700)), multiply(point(k), _around(LN2)))
    power = absolute(y)
    for _ in range(_EXP - 1):
        power = multiply(power, absolute(y))
    left = divide(power, point(np.full_like(x, float(math.factorial(_EXP) // 2))))
    exponential = _series(y, _EXP_TERMS, _ball(left))
    low, high = np.ldexp(exponential.low, k.astype(int)), np.ldexp(exponential.high, k.astype(int))
    return Interval(np.where(x < -700, 0.0, np.maximum(low, 0.0)), np.where(x > 700, np.inf, high))


exponential = _rising(_exp_at)
"""exp a."""


_LOG = 18
_LOG_TERMS = _quotients([(1, 2 * j + 1) for j in range(_LOG)])


def _log_at(x: Array) -> Interval:
    """log x = k log 2 + 2 artanh(t), t = (m - 1) / (m + 1), m in [0.7, 1.42]: |t| < 0.18, its series is of one sign."""
    with np.errstate(invalid="ignore", divide="ignore"):
        good = (x > 0) & (x < np.inf)
        m, k = np.frexp(np.where(good, x, 1.0))
    low = m < 0.70710678
    m, k = np.where(low, 2 * m, m), np.where(low, k - 1, k)
    one = point(np.ones_like(x))
    t = divide(subtract(point(m), one), add(point(m), one))
    z = square(t)
    power = z
    for _ in range(_LOG - 1):
        power = multiply(power, z)
    left = multiply(power, point(np.full_like(x, 1.1 / (2 * _LOG + 1))))  # 1 / (1 - t^2) < 1.04
    series = _series(z, _LOG_TERMS, Interval(np.zeros_like(x), left.high))
    bounds = add(
        multiply(point(k.astype(float)), _around(LN2)), multiply(point(np.full_like(x, 2.0)), multiply(series, t))
    )
    return Interval(np.where(good, bounds.low, -np.inf), np.where(x < np.inf, bounds.high, np.inf))


def logarithm(a: Interval) -> Interval:
    """log a: unbounded where a reaches to 0 or below."""
    bounds = _rising(_log_at)(a)
    lost = ~(a.low > 0)
    return Interval(np.where(lost, -np.inf, bounds.low), np.where(lost, np.inf, bounds.high))
