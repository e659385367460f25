"""A law whose one leaf serves the whole disc of a planar arm, three links of 1 m within +-150 degrees.

    g(q) = sin(a) (x - px) - cos(a) (y - py) - e(q1),     a = l(x, y) q1^2 + k(x, y) q1 + c(x, y)

On the leaf g = 0 the tool (x, y) is on a line near a fixed point p: a is the line's direction, e its distance from p, a
polynomial. Both change with joint 1. While joint 1 turns from limit to limit, the line turns more than once at three
quarters of the positions. So the leaf overlaps itself, and there the cut may lie. The cut ends near p: inside it, round
the base at 0.3 m, the leaf comes home. (With e = 0 for all q1, every q1 would do at p, and next to it the joints would
turn as fast as the tool comes near.) With
z = (x + i y) / 3, k and c are

    sum_m,i |z|^(2 i) (b_mi Re z^m + d_mi Im z^m)  +  five bumps w^32 (polynomial of u, v),     m + 2 i <= 6,

    (u, v) = ((x, y) - centre) / width,     w = 1 / (1 + (u^2 + v^2) / 64),

and l has the bumps alone.

The numbers come from linear programs. Where a short cut of the grid (`grid_resolution`, with q3 >= 0 alone) is given,
each position has an interval of joint 1 within the limits, and that g has its zero in there is linear in k, c and l; so
is that near the end of the cut joint 1 is that of the grid.

Some fifty such starts were made, with bumps at different places. The one with the fewest pairs that are cut was
improved by further linear programs, of the first derivatives, those with respect to the places of the bumps included.
"""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np
from scipy.optimize import brentq

import holokin as hk

REACH = 3.0
POINT = (-0.31127651, -0.29635175)
"""p [m]"""

DISTANCE = (-0.06547159250, -0.07917267473, 0.00181059045, 0.00682108840, -0.00269486505, -0.00009790206)
"""e [m]: coefficients of 1, q1, q1^2, ..."""

BUMPS = (
    (-0.33647200, -0.31249209, 0.74050597),
    (-0.36678685, -0.30428084, 0.15673980),
    (-0.35867087, -0.35198393, 0.05109218),
    (-0.30623583, -0.38777713, 0.08068199),
    (-0.33230005, -0.31148003, 0.08687731),
)
"""Centre (x, y) and width of each bump [m]."""

FACTOR = (
    (1.92537121, -2.19164405, 4.04104712, -2.16071331),
    (0.40519743, -0.11768697, 0.08111557),
    (-0.06232012, -3.04364611, 2.82771225),
    (1.70288716, -5.29249120, 3.73779181),
    (-2.29297564, 3.49758442, -1.45011015),
    (-1.15746787, 1.38481426),
    (-0.66827749, 0.86411712),
    (-0.11275321, 0.16312082),
    (-0.30162274, 0.43716909),
    (0.13212790,),
    (-0.01755397,),
    (0.07155131,),
    (-0.01643095,),
)
"""k: for Re z^0, Re z^1, Im z^1, Re z^2, ..., the coefficients of 1, |z|^2, |z|^4, ..."""

FACTOR_BUMPS = (
    (-0.70454514, -0.10577952, -0.11566932, 0.00728319, 0.19429095, 0.13421817),
    (-0.73146891, -0.84531465, -1.32057699, 0.28105552, -0.23750150, 0.16176827),
    (-5.24441232, -1.46408343, -0.90815034, -1.65148165, -1.13215633, -1.95541057),
    (-3.58114566, -7.16196963, 2.86360220, 0.41112180, -3.13686622, 1.04789416),
    (7.18323498, 8.12289089, -2.85639338, 0.09741941, -1.81688270, 0.98538740),
)
"""k: for each bump the coefficients of 1, u, v, u^2, u v, v^2."""

OFFSET = (
    (1.73778877, 0.43628269, -6.16037486, 4.08229690),
    (6.72316149, -16.15804622, 9.81342989),
    (-6.72669368, 12.38840033, -6.80289963),
    (-3.63838143, 5.61000459, -2.41117937),
    (-4.10781008, 7.31435287, -2.88995531),
    (0.30220506, -0.55954148),
    (4.63219359, -4.84762992),
    (-0.13201100, 0.36112697),
    (2.82644758, -2.82863634),
    (0.03546796,),
    (0.05979694,),
    (-0.01088028,),
    (-0.13567299,),
)
"""c, likewise [rad]."""

OFFSET_BUMPS = (
    (1.03195719, -2.03325998, 1.90425606, 0.07583712, 1.95779958, -0.58051642),
    (0.20477448, -0.17476959, -1.11746057, -0.75773494, -0.91785321, -0.43647503),
    (-3.96009059, -0.50583303, 1.26068590, -1.04960256, 0.37705074, -0.31748188),
    (-8.53777642, -2.71957891, 1.85016053, -1.66906249, -2.66946190, 0.62536302),
    (7.57907971, 6.19555236, -7.78401806, 1.82613517, -1.93456070, 3.29615446),
)

SQUARE_BUMPS = (
    (-0.16081925, 0.26834156, -0.00377274, 0.03082306, 0.05399478, -0.10684921),
    (0.69215308, 0.12406893, -0.04665808, -0.39938150, 0.02016002, -0.01471107),
    (-2.63961282, -0.51899700, -1.25394454, -0.63922236, -0.84793789, -1.13573930),
    (0.56809192, -2.45094632, -0.05080621, 0.43829092, -0.83602382, 0.05268045),
    (1.84459819, 1.59816692, 0.82729314, -0.40970422, 0.06595825, -1.45432168),
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
