"""How much of the turns of a workspace boxes of Cayley parameters are, by the Haar measure: all orientations alike.

With c = tan(angle / 2) times the axis, a turn leans the tool by a, tan(a / 2) = |b|, b = (c_1, c_2) / sqrt(1 + c_3^2),
and spins it by s = 2 atan(c_3). The Haar measure dc / (1 + |c|^2)^2 is db / (1 + |b|^2)^2 ds / 2: leans are even on the
sphere, spins by the angle. A tilt is a disc of b, a spin a range of c_3.
"""

from __future__ import annotations

import numpy as np

from ..base.types import Matrix, Vector

NODES = 12
"""Of a quadrature over a piece in which the integrand is smooth: right to 1e-9 where the tool leans by 0.5 rad."""


def shares_of_turns(low: Matrix, high: Matrix, tilt: float, spin: float) -> Vector:
    """(k,) what boxes low <= c <= high (k, 3) have of a tilt and a spin, 0 to 1.

    tilt, spin: tan of half of each; 0 where the boxes have no extent in these directions.
    """
    t, weights = np.polynomial.legendre.leggauss(NODES)
    if not tilt:
        return (np.arctan(high[:, 2]) - np.arctan(low[:, 2])) / (2 * np.arctan(spin)) if spin else np.ones(len(low))
    disc = np.pi * tilt**2 / (1 + tilt**2)
    if not spin:
        return _leans(low[:, :2], high[:, :2], tilt) / disc
    # over the spin s by its angle; the leans of a box are wider where c_3 is nearer to 0
    start, end = np.arctan(low[:, 2]), np.arctan(high[:, 2])
    total = np.zeros(len(low))
    for node, weight in zip(t, weights, strict=True):
        shrink = np.cos((start + end) / 2 + (end - start) / 2 * node)[:, None]
        total += weight / 2 * _leans(low[:, :2] * shrink, high[:, :2] * shrink, tilt)
    return total * (end - start) / (2 * np.arctan(spin)) / disc


def _leans(low: Matrix, high: Matrix, radius: float) -> Vector:
    """The integral (k,) of db / (1 + |b|^2)^2 over rectangles low <= b <= high (k, 2), as far as |b| <= radius."""
    t, weights = np.polynomial.legendre.leggauss(NODES)
    # b_1 = radius sin(phi), in pieces between the places where the circle goes through the sides
    ends = np.arcsin(np.clip(np.column_stack([low[:, 0], high[:, 0]]) / radius, -1, 1))
    across = np.arccos(np.clip(np.abs(np.column_stack([low[:, 1], high[:, 1]])) / radius, 0, 1))
    inside = np.tile(np.arcsin(np.minimum(1.0, np.array([0.0, 1.0, -1.0]) / radius).clip(-1)), (len(low), 1))
    places = np.sort(np.clip(np.column_stack([across, -across, inside]), ends[:, :1], ends[:, 1:]), axis=1)
    places = np.column_stack([ends[:, 0], places, ends[:, 1]])
    total = np.zeros(len(low))
    for start, end in zip(places.T[:-1], places.T[1:], strict=True):
        for node, weight in zip(t, weights, strict=True):
            phi = (start + end) / 2 + (end - start) / 2 * node
            x, edge = radius * np.sin(phi), radius * np.cos(phi)
            below, above = (np.clip(side[:, 1], -edge, edge) for side in (low, high))
            total += weight * (end - start) / 2 * edge * (_column(x, above) - _column(x, below))
    return total


def _column(x: Vector, y: Vector) -> Vector:
    """The integral from 0 to y of dy / (1 + x^2 + y^2)^2."""
    a = 1 + x**2
    return y / (2 * a * (a + y**2)) + np.arctan(y / np.sqrt(a)) / (2 * a * np.sqrt(a))
