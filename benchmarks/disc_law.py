"""A law whose one leaf serves the whole disc of a planar arm, three links of 1 m within +-150 degrees.

    g(q) = sin(a) (x - px) - cos(a) (y - py) - e(q1),     a = l(x, y) q1^2 + k(x, y) q1 + c(x, y)

On the leaf g = 0 the tool (x, y) is on a line near a fixed point p: a is the line's direction, e its distance from p, a
polynomial. Both change with joint 1. While joint 1 turns from limit to limit, the line turns more than once at most
positions. So the leaf overlaps itself, and there the cut may lie. The cut ends near p: inside it, round the base at
0.3 m, the leaf comes home. (With e = 0 for all q1, every q1 would do at p, and next to it the joints would turn as fast
as the tool comes near.) With
z = (x + i y) / 3, k and c are

    sum_m,i |z|^(2 i) (b_mi Re z^m + d_mi Im z^m)  +  five bumps w^32 (polynomial of u, v),     m + 2 i <= 6,

    (u, v) = ((x, y) - centre) / width,     w = 1 / (1 + (u^2 + v^2) / 64),

and l has the bumps alone.

The numbers come from linear programs. Where a short cut of the grid (`grid_resolution`, with q3 >= 0 alone) is given,
each position has an interval of joint 1 within the limits, and that g has its zero in there is linear in k, c and l; so
is that near the end of the cut joint 1 is that of the grid. Of some fifty such starts, with bumps elsewhere, the one
with the fewest pairs that are cut went on: more programs, of the first derivatives, also with respect to the bumps'
places, shorten the cut.
"""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np
from scipy.optimize import brentq

import holokin as hk

REACH = 3.0
POINT = (-0.31164, -0.29131)
"""p [m]"""

DISTANCE = (-0.059831170, -0.076720095, 0.002595048, 0.006256723, -0.002194871, -0.000203872)
"""e [m]: coefficients of 1, q1, q1^2, ..."""

BUMPS = (
    (-0.333338, -0.310922, 0.736519),
    (-0.366227, -0.304468, 0.156685),
    (-0.358547, -0.351838, 0.051080),
    (-0.305923, -0.387713, 0.080855),
    (-0.332336, -0.311909, 0.086873),
)
"""Centre (x, y) and width of each bump [m]."""

FACTOR = (
    (1.977107, -2.271272, 4.679613, -2.701860),
    (0.501427, 0.202216, -0.298068),
    (0.211499, -4.083101, 3.738945),
    (1.917040, -6.123465, 4.427129),
    (-2.330990, 3.406184, -1.263504),
    (-1.371403, 1.658565),
    (-0.813070, 1.045091),
    (0.015107, -0.016242),
    (-0.272260, 0.416102),
    (0.157233,),
    (-0.006300,),
    (0.100693,),
    (-0.005931,),
)
"""k: for Re z^0, Re z^1, Im z^1, Re z^2, ..., the coefficients of 1, |z|^2, |z|^4, ..."""

FACTOR_BUMPS = (
    (-0.706907, -0.134032, -0.120940, -0.031928, 0.255306, 0.163510),
    (-0.741699, -0.857941, -1.486577, 0.315948, -0.179359, 0.192031),
    (-5.064357, -1.533088, -0.906203, -1.898970, -1.149830, -1.989094),
    (-3.059564, -6.956829, 2.832756, 0.205738, -3.191752, 0.911371),
    (7.137942, 8.262083, -2.878724, 0.225548, -1.856994, 0.974820),
)
"""k: for each width the coefficients of 1, u, v, u^2, u v, v^2."""

OFFSET = (
    (1.760501, 0.834725, -6.869707, 4.248799),
    (7.172061, -17.330503, 10.537578),
    (-6.890353, 11.782590, -6.134880),
    (-3.548460, 5.355956, -2.181797),
    (-4.450570, 7.540986, -2.662065),
    (0.290642, -0.538786),
    (5.343911, -5.699058),
    (-0.305558, 0.565573),
    (3.216317, -3.230923),
    (0.005826,),
    (0.124025,),
    (-0.007724,),
    (-0.179843,),
)
"""c, likewise [rad]."""

OFFSET_BUMPS = (
    (1.004770, -2.152241, 2.110573, 0.087999, 2.151016, -0.700743),
    (0.441916, -0.078151, -1.149627, -0.792951, -0.920934, -0.472418),
    (-3.914456, -0.637127, 1.331770, -0.936417, 0.757598, -0.294698),
    (-8.573937, -2.568196, 1.955778, -1.768892, -2.758811, 0.799117),
    (7.556106, 6.416277, -8.088056, 1.975691, -2.122426, 3.112190),
)

SQUARE_BUMPS = (
    (-0.126111, 0.258606, -0.010784, 0.008270, 0.054094, -0.118056),
    (0.727722, 0.128472, -0.066489, -0.413786, 0.011793, 0.006128),
    (-2.558046, -0.471269, -1.320299, -0.645690, -0.880228, -1.161768),
    (0.661990, -2.413988, -0.043446, 0.437148, -0.829194, -0.032805),
    (1.710062, 1.535749, 0.735486, -0.411077, 0.013513, -1.356432),
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
    for at_x, at_y, width in BUMPS:
        u, v = (x - at_x) / width, (y - at_y) / width
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
