"""A law whose one leaf serves nearly the whole disc of a planar arm, three links of 1 m within +-150 degrees.

    g(q) = sin(a) (x - px) - cos(a) (y - py) - e(q1),     a = k(x, y) q1 + c(x, y),     e(q1) = e0 + e1 q1 + e3 q1^3

On the leaf g = 0 the tool (x, y) is on a line that passes a fixed point p at the distance e, in the direction a; both
change with joint 1. While the base turns from limit to limit, the line turns more than once. So the leaf overlaps
itself, and there the cut may lie. At p, the line through the tool has e = 0, which one value of joint 1 has: there the
leaf is one function of the tool's position, all round p, and the cut ends before it. (With e = 0 for all q1, every q1
would do at p, and next to it the joints would turn as fast as the tool comes near.) k and c are polynomials in
z = (x + i y) / 3,

    sum_i a_i |z|^(2 i)  +  sum_m,i |z|^(2 i) (b_mi Re z^m + d_mi Im z^m),     m = 1, 2, 3,   i = 0, 1

The numbers come from a search (CMA-ES) for a leaf that serves the disc, with a short cut, by the closed-form inverse
of the arm with q3 >= 0.
"""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np
from scipy.optimize import brentq

import holokin as hk

REACH = 3.0
POWERS, TURNS = 8, ((1, 0), (1, 1), (2, 0), (2, 1), (3, 0), (3, 1))
"""Coefficients a_i, and the (m, i) of b_mi and d_mi."""

POINT = (-0.17117, -0.25969)
"""p [m]"""

FACTOR = (
    2.34593,
    -0.85209,
    1.40816,
    0.77848,
    -1.19738,
    0.07184,
    -0.15175,
    0.08733,
    1.11736,
    2.71524,
    0.50293,
    -0.86164,
    -0.52411,
    1.01316,
    0.69463,
    0.05330,
    -0.21958,
    -0.84476,
    0.14757,
    1.03943,
)
"""k: a_i, then b_mi and d_mi of each (m, i)."""

OFFSET = (
    3.11419,
    -9.13708,
    5.79848,
    1.38342,
    -0.76760,
    -2.06161,
    0.08975,
    0.22316,
    3.17789,
    -0.40735,
    -3.38020,
    -1.65884,
    2.72322,
    0.05178,
    -1.48067,
    -0.69212,
    -0.09083,
    0.25032,
    0.46394,
    -0.19446,
)
"""c, likewise [rad]."""

DISTANCE = (-0.024216, -0.060670, 0.0059453)
"""e0, e1, e3 [m]."""


def disc_law(task: hk.Task) -> hk.HolonomicStrategy:
    """The strategy that keeps the leaf."""

    def g(q: ca.SX) -> ca.SX:
        x = ca.cos(q[0]) + ca.cos(q[0] + q[1]) + ca.cos(q[0] + q[1] + q[2])
        y = ca.sin(q[0]) + ca.sin(q[0] + q[1]) + ca.sin(q[0] + q[1] + q[2])
        a = _polynomial(FACTOR, x, y) * q[0] + _polynomial(OFFSET, x, y)
        return ca.sin(a) * (x - POINT[0]) - ca.cos(a) * (y - POINT[1]) - _distance(q[0])

    return hk.holonomic(task, hk.custom(g, rows=1), name="disc law")


def disc_starts() -> np.ndarray:
    """Postures (3, 3) of the leaf: joint 1 at -120, 0 and 120 degrees, the tool 2 m along its line."""
    return np.array([_posture(np.radians(turn)) for turn in (-120, 0, 120)])


def _posture(q1: float) -> np.ndarray:
    """That of the leaf with the tool 2 m along its line, q3 > 0, and the least |q2|."""

    def tool(a: float) -> np.ndarray:
        return np.array(POINT) + _rotation(a) @ [2.0, -_distance(q1)]

    def missing(a: float) -> float:
        return float(_polynomial(FACTOR, *tool(a)) * q1 + _polynomial(OFFSET, *tool(a)) - a)

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


def _distance(q1):
    """e at a value of joint 1, a number or an expression."""
    return DISTANCE[0] + DISTANCE[1] * q1 + DISTANCE[2] * q1**3


def _polynomial(numbers, x, y):
    """k or c at a tool position, numbers or expressions."""
    u, v = x / REACH, y / REACH
    square, powers = u * u + v * v, [(1.0, 0.0)]
    for _ in range(3):
        re, im = powers[-1]
        powers.append((re * u - im * v, re * v + im * u))
    found = sum(number * square**i for i, number in enumerate(numbers[:POWERS]))
    for (m, i), (b, d) in zip(TURNS, np.reshape(numbers[POWERS:], (-1, 2)), strict=True):
        found += square**i * (b * powers[m][0] + d * powers[m][1])
    return found
