"""A law whose one leaf serves nearly the whole disc of a planar arm, three links of 1 m within +-150 degrees.

    g(q) = sin(a) (x - px) - cos(a) (y - py),     a = k(x, y) q1 + c(x, y)

On the leaf g = 0 the line through the tool (x, y) and a fixed point p has the direction a, which turns with joint 1.
While the base turns from limit to limit, the tool goes more than once round p, because the self-motion leads it further
each way. So the leaf overlaps itself, and there the cut may lie. k and c are polynomials in z = (x + i y) / 3,

    sum_i a_i |z|^(2 i)  +  sum_m,i |z|^(2 i) (b_mi Re z^m + d_mi Im z^m),     m = 1, 2, 3,   i = 0, 1

The numbers come from a search (CMA-ES) for a leaf that serves the disc, with a short cut, by the closed-form inverse
of the arm with q3 >= 0.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

import holokin as hk

REACH = 3.0
POWERS, TURNS = 8, ((1, 0), (1, 1), (2, 0), (2, 1), (3, 0), (3, 1))
"""Coefficients a_i, and the (m, i) of b_mi and d_mi."""

POINT = (-0.16495, -0.27010)
"""p [m]"""

FACTOR = (
    2.40875,
    -1.01111,
    1.25049,
    0.83027,
    -1.17430,
    -0.06171,
    -0.03878,
    0.11406,
    0.90587,
    2.80324,
    0.32941,
    -0.87241,
    -0.66277,
    0.87355,
    0.52159,
    0.21842,
    -0.38520,
    -0.88834,
    0.22663,
    1.09381,
)
"""k: a_i, then b_mi and d_mi of each (m, i)."""

OFFSET = (
    3.12637,
    -9.16081,
    5.85355,
    1.45734,
    -0.84493,
    -2.05121,
    -0.06046,
    0.24705,
    2.99903,
    -0.42075,
    -3.21916,
    -1.59624,
    2.67931,
    -0.00925,
    -1.47229,
    -0.44621,
    -0.07481,
    0.28034,
    0.43213,
    -0.07731,
)
"""c, likewise [rad]."""


def disc_law(task: hk.Task) -> hk.HolonomicStrategy:
    """The strategy that keeps the leaf."""

    def g(q: ca.SX) -> ca.SX:
        x = ca.cos(q[0]) + ca.cos(q[0] + q[1]) + ca.cos(q[0] + q[1] + q[2])
        y = ca.sin(q[0]) + ca.sin(q[0] + q[1]) + ca.sin(q[0] + q[1] + q[2])
        a = _polynomial(FACTOR, x, y) * q[0] + _polynomial(OFFSET, x, y)
        return ca.sin(a) * (x - POINT[0]) - ca.cos(a) * (y - POINT[1])

    return hk.holonomic(task, hk.custom(g, rows=1), name="disc law")


def disc_starts() -> np.ndarray:
    """Postures (3, 3) of the leaf: joint 1 at -120, 0 and 120 degrees, the tool 2 m from p."""
    return np.array([_posture(np.radians(turn)) for turn in (-120, 0, 120)])


def _posture(q1: float) -> np.ndarray:
    """That of the leaf with the tool 2 m from p in the direction a, and q3 > 0: both links of 1 m from the elbow."""
    tool = np.array(POINT)
    for _ in range(100):
        a = _polynomial(FACTOR, *tool) * q1 + _polynomial(OFFSET, *tool)
        tool = np.array(POINT) + 2 * np.array([np.cos(a), np.sin(a)])
    w = tool - [np.cos(q1), np.sin(q1)]
    bend = np.arccos((w @ w - 2) / 2)
    return np.array([q1, (np.arctan2(w[1], w[0]) - bend / 2 - q1 + np.pi) % (2 * np.pi) - np.pi, bend])


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
