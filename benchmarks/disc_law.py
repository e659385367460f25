"""A law whose one leaf serves the whole disc of a planar arm, three links of 1 m within +-150 degrees.

    g(q) = sin(a) (x - px) - cos(a) (y - py) - e(q1),     a = l(x, y) q1^2 + k(x, y) q1 + c(x, y)

On the leaf g = 0 the tool (x, y) is on a line near a fixed point p: a is the line's direction, e its distance from p, a
polynomial. Both change with joint 1. While joint 1 turns from limit to limit, the line turns more than once. So the
leaf overlaps itself, and there the cut may lie. The cut ends near p: inside it, round the base at 0.3 m, the leaf comes
home. (With e = 0 for all q1, every q1 would do at p, and next to it the joints would turn as fast as the tool comes
near.) With
z = (x + i y) / 3, k and c are

    sum_m,i |z|^(2 i) (b_mi Re z^m + d_mi Im z^m)  +  three bumps w^32 (polynomial of u, v),     m + 2 i <= 6,

    (u, v) = ((x, y) - CENTRE) / WIDTH,     w = 1 / (1 + (u^2 + v^2) / 64),

and l has the bumps alone.

The numbers come from linear programs. Where a short cut of the grid (`grid_resolution`, with q3 >= 0 alone) is given,
each position has an interval of joint 1 within the limits, and that g has its zero in there is linear in k, c and l; so
is that near the end of the cut joint 1 is that of the grid. From this start, more programs, of the first derivatives,
shorten the cut.
"""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np
from scipy.optimize import brentq

import holokin as hk

REACH = 3.0
POINT = (-0.33262, -0.33300)
"""p [m]"""

DISTANCE = (0.014806501, 0.006331904, 0.000529304, 0.000919845, -0.000238527, 0.000031195)
"""e [m]: coefficients of 1, q1, q1^2, ..."""

CENTRE, WIDTHS = (-0.33, -0.315), (0.15, 0.4, 0.07)
"""Of the bumps [m]."""

FACTOR = (
    (1.467729, 11.800514, -6.564195, -1.665425),
    (3.893592, -4.325466, 4.440755),
    (0.918496, 26.264643, -28.283416),
    (0.895295, -12.641796, 9.704386),
    (-2.666761, 8.663923, -6.001260),
    (11.135050, -14.275772),
    (-4.926485, 6.692421),
    (8.471675, -8.758769),
    (4.076463, -2.009245),
    (1.012295,),
    (1.301304,),
    (0.336802,),
    (0.324232,),
)
"""k: for Re z^0, Re z^1, Im z^1, Re z^2, ..., the coefficients of 1, |z|^2, |z|^4, ..."""

FACTOR_BUMPS = (
    (0.978026, -0.216847, -0.512843, -0.946721, -0.279637, -0.573862),
    (0.863848, -0.396827, -0.198740, -0.135227, -0.144368, -0.340043),
    (0.511341, 0.625749, -0.766637, -0.528199, -0.020012, 0.107623),
)
"""k: for each width the coefficients of 1, u, v, u^2, u v, v^2."""

OFFSET = (
    (4.704271, -17.206068, -2.111140, 15.433429),
    (8.886128, -6.678725, -1.997073),
    (3.766021, -55.288824, 44.676577),
    (13.849144, 11.936294, -27.703856),
    (10.421029, -12.983109, -1.560782),
    (-0.655989, -0.412595),
    (22.983735, -21.251222),
    (-6.615302, 7.064668),
    (0.682265, 2.121817),
    (1.055470,),
    (-0.103256,),
    (0.701765,),
    (-0.648137,),
)
"""c, likewise [rad]."""

OFFSET_BUMPS = (
    (0.492814, -0.483052, 0.474799, -0.162571, -0.018784, 0.367789),
    (-0.929393, -1.251264, -1.497196, -0.921970, -0.849851, -0.572380),
    (1.934156, 1.142771, -0.504128, -0.063886, -0.207413, -0.350028),
)

SQUARE_BUMPS = (
    (0.469789, -0.019351, -0.077727, -0.337799, -0.179939, -0.198804),
    (0.157865, 0.064238, 0.045228, 0.021185, -0.025336, -0.063631),
    (-0.343973, 0.054137, -0.385574, -0.129684, -0.122357, 0.017485),
)
"""l, likewise [1/rad]."""


def disc_law(task: hk.Task) -> hk.HolonomicStrategy:
    """The strategy that keeps the leaf."""

    def g(q: ca.SX) -> ca.SX:
        x = ca.cos(q[0]) + ca.cos(q[0] + q[1]) + ca.cos(q[0] + q[1] + q[2])
        y = ca.sin(q[0]) + ca.sin(q[0] + q[1]) + ca.sin(q[0] + q[1] + q[2])
        a = _direction(q[0], x, y)
        return ca.sin(a) * (x - POINT[0]) - ca.cos(a) * (y - POINT[1]) - _horner(DISTANCE, q[0])

    return hk.holonomic(task, hk.custom(g, rows=1), name="disc law")


def disc_starts() -> np.ndarray:
    """Postures (3, 3) of the leaf: joint 1 at -120, 0 and 120 degrees, the tool 2 m along its line."""
    return np.array([_posture(np.radians(turn)) for turn in (-120, 0, 120)])


def _posture(q1: float) -> np.ndarray:
    """That of the leaf with the tool 2 m along its line, q3 > 0, and the least |q2|."""

    def tool(a: float) -> np.ndarray:
        return np.array(POINT) + _rotation(a) @ [2.0, -_horner(DISTANCE, q1)]

    def missing(a: float) -> float:
        return float(_direction(q1, *tool(a)) - a)

    some, found = np.linspace(-10.0, 10.0, 401), []
    for low, high in pairwise(some.tolist()):
        if missing(low) * missing(high) < 0:
            w = _rotation(-q1) @ (tool(brentq(missing, low, high, xtol=1e-15)) - _rotation(q1)[:, 0])
            bend = np.arccos(np.clip((w @ w - 2) / 2, -1, 1))
            q2 = float(np.arctan2(w[1], w[0]) - bend / 2)
            if w @ w < 4 and max(abs(q2), bend) < np.radians(150):
                found.append(np.array([q1, q2, bend]))
    return min(found, key=lambda q: abs(q[1]))


def _rotation(a: float) -> np.ndarray:
    """Of the plane, by an angle."""
    return np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])


def _horner(numbers, x):
    """A polynomial, of its coefficients from the constant on."""
    found = 0.0
    for number in reversed(numbers):
        found = found * x + number
    return found


def _direction(q1, x, y):
    """That of the line, a: numbers or expressions."""
    bumps = _bumps(x, y)
    square = _weighed(SQUARE_BUMPS, bumps)
    factor = _sum(FACTOR, x, y) + _weighed(FACTOR_BUMPS, bumps)
    offset = _sum(OFFSET, x, y) + _weighed(OFFSET_BUMPS, bumps)
    return (square * q1 + factor) * q1 + offset


def _sum(numbers, x, y):
    """A polynomial of the tool position."""
    re, im = x / REACH, y / REACH
    square, power = re * re + im * im, (1.0, 0.0)
    found = _horner(numbers[0], square)
    for even, odd in zip(numbers[1::2], numbers[2::2], strict=True):
        power = (power[0] * re - power[1] * im, power[0] * im + power[1] * re)
        found += _horner(even, square) * power[0] + _horner(odd, square) * power[1]
    return found


def _bumps(x, y):
    """Of each bump its height and (u, v) at a tool position."""
    found = []
    for width in WIDTHS:
        u, v = (x - CENTRE[0]) / width, (y - CENTRE[1]) / width
        w = 1 / (1 + (u * u + v * v) / 64)
        for _ in range(5):
            w = w * w
        found.append((w, u, v))
    return found


def _weighed(numbers, bumps):
    """The bumps, each times its polynomial."""
    return sum(
        w * (one + u * (a + c * u + d * v) + v * (b + e * v))
        for (one, a, b, c, d, e), (w, u, v) in zip(numbers, bumps, strict=True)
    )
