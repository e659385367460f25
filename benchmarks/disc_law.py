"""A law whose one leaf serves the whole disc of a planar arm, three links of 1 m within +-150 degrees.

    g(q) = sin(a) (x - px) - cos(a) (y - py) - e(q1),     a = k(x, y) q1 + c(x, y)

On the leaf g = 0 the tool (x, y) is on a line near a fixed point p: a is the line's direction, e its distance from p, a
polynomial. Both change with joint 1. While joint 1 turns from limit to limit, the line turns more than once. So the
leaf overlaps itself, and there the cut may lie. The cut ends near p: inside it, round the base at 0.3 m, the leaf comes
home. (With e = 0 for all q1, every q1 would do at p, and next to it the joints would turn as fast as the tool comes
near.) With
z = (x + i y) / 3, k and c are

    sum_m,i |z|^(2 i) (b_mi Re z^m + d_mi Im z^m)  +  two bumps w^32 (polynomial of u, v),     m + 2 i <= 6,

    (u, v) = ((x, y) - CENTRE) / WIDTH,     w = 1 / (1 + (u^2 + v^2) / 64)

The numbers come from linear programs. Where the shortest cut of the grid (`grid_resolution`) is given, each position
has an interval of joint 1 within the limits, and that g has its zero in there is linear in k and c. From this start,
more programs, of the first derivatives, shorten the cut.
"""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np
from scipy.optimize import brentq

import holokin as hk

REACH = 3.0
POINT = (-0.31983, -0.33355)
"""p [m]"""

DISTANCE = (-0.012231382, -0.027161940, 0.029072339, 0.022369100, -0.001111844, -0.000921617)
"""e [m]: coefficients of 1, q1, q1^2, ..."""

CENTRE, WIDTHS = (-0.3, -0.33), (0.15, 0.4)
"""Of the bumps [m]."""

FACTOR = (
    (2.958065, -0.959936, 6.368194, 1.123627),
    (3.490162, 4.084669, -3.314068),
    (-3.276022, 11.680989, -6.441056),
    (5.619402, -5.878808, -9.453551),
    (-7.575054, 23.543329, -11.608485),
    (2.397383, -6.541456),
    (-2.966927, 4.586549),
    (-0.178641, 3.175102),
    (-4.955915, 1.851026),
    (1.542222,),
    (-2.688419,),
    (0.042496,),
    (-0.538764,),
)
"""k: for Re z^0, Re z^1, Im z^1, Re z^2, ..., the coefficients of 1, |z|^2, |z|^4, ..."""

FACTOR_BUMPS = (
    (-3.246555, -1.092290, 0.964957, -0.781027, -0.414659, -1.011214),
    (1.464109, -0.081438, 3.006784, -0.299228, 0.424810, -0.104584),
)
"""k: for each width the coefficients of 1, u, v, u^2 - v^2, u v, u^2 + v^2 - 2."""

OFFSET = (
    (6.987491, -25.650939, 37.758554, -19.771106),
    (9.320771, -23.239020, 11.119398),
    (-5.106159, 14.127607, -29.070639),
    (3.807700, -19.710158, 15.486344),
    (-6.626754, 14.236054, -11.328640),
    (-4.662392, 10.068161),
    (-5.486163, 16.011227),
    (-3.537175, 5.908658),
    (-1.468302, 3.388027),
    (-2.421809,),
    (-2.664083,),
    (-1.239173,),
    (-0.413826,),
)
"""c, likewise [rad]."""

OFFSET_BUMPS = (
    (-6.452501, -1.183463, 0.706630, -1.029345, 1.346769, -2.099230),
    (-1.677721, 3.034784, 2.848822, -0.158238, 2.731786, -1.155752),
)


def disc_law(task: hk.Task) -> hk.HolonomicStrategy:
    """The strategy that keeps the leaf."""

    def g(q: ca.SX) -> ca.SX:
        x = ca.cos(q[0]) + ca.cos(q[0] + q[1]) + ca.cos(q[0] + q[1] + q[2])
        y = ca.sin(q[0]) + ca.sin(q[0] + q[1]) + ca.sin(q[0] + q[1] + q[2])
        a = _sum(FACTOR, FACTOR_BUMPS, x, y) * q[0] + _sum(OFFSET, OFFSET_BUMPS, x, y)
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
        return float(_sum(FACTOR, FACTOR_BUMPS, *tool(a)) * q1 + _sum(OFFSET, OFFSET_BUMPS, *tool(a)) - a)

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


def _sum(numbers, bumps, x, y):
    """k or c at a tool position, numbers or expressions."""
    re, im = x / REACH, y / REACH
    square, power = re * re + im * im, (1.0, 0.0)
    found = _horner(numbers[0], square)
    for even, odd in zip(numbers[1::2], numbers[2::2], strict=True):
        power = (power[0] * re - power[1] * im, power[0] * im + power[1] * re)
        found += _horner(even, square) * power[0] + _horner(odd, square) * power[1]
    for width, (one, a, b, c, d, r) in zip(WIDTHS, bumps, strict=True):
        u, v = (x - CENTRE[0]) / width, (y - CENTRE[1]) / width
        w = 1 / (1 + (u * u + v * v) / 64)
        for _ in range(5):
            w = w * w
        found += w * (one + a * u + b * v + c * (u * u - v * v) + d * u * v + r * (u * u + v * v - 2))
    return found
