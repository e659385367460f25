"""A law whose one leaf serves nearly the whole disc of a planar arm, three links of 1 m within +-150 degrees.

    g(q) = q2 - sum c_ij u^i v^j,     u = q1 / L,  v = q3 / L,  L = 150 deg

On the leaf g = 0 the second joint is a polynomial of the other two. As the base turns from limit to limit, the
self-motion leads the tool by some 30 degrees each way, so that the leaf goes once round the base and overlaps itself:
there the cut may lie. The coefficients come from a random search for the leaf whose cut is short and that covers most
of the disc.
"""

from __future__ import annotations

import numpy as np

import holokin as hk

LIMIT = np.radians(150)

COEFFICIENTS = {
    (0, 0): -0.1491,
    (0, 1): 3.0809,
    (0, 2): 1.2151,
    (0, 3): -0.2755,
    (0, 4): -0.1019,
    (0, 5): -0.3290,
    (0, 6): -1.2311,
    (1, 0): 0.8773,
    (1, 1): -0.1986,
    (1, 2): -0.0747,
    (1, 3): 0.0445,
    (1, 4): 0.3109,
    (1, 5): 0.5239,
    (2, 0): 0.3113,
    (2, 1): -0.1088,
    (2, 2): 0.0090,
    (2, 3): -0.0170,
    (2, 4): -0.1720,
    (3, 0): -0.0122,
    (3, 1): -1.2679,
    (3, 2): 0.2639,
    (3, 3): 0.0219,
    (4, 0): 0.0934,
    (4, 1): -0.6910,
    (4, 2): 0.1779,
}
"""Powers (i, j) of u and v, and the coefficient [rad]."""


def disc_law(task: hk.Task) -> hk.HolonomicStrategy:
    """The strategy that keeps the leaf."""
    return hk.holonomic(task, hk.custom(lambda q: q[1] - _second(q[0], q[2]), rows=1), name="disc law")


def disc_start() -> np.ndarray:
    """A posture (3,) of the leaf g = 0 in the middle of the disc's sheet."""
    return np.array([0.0, _second(0.0, -1.0), -1.0])


def _second(q1, q3):
    """Joint 2 on the leaf g = 0, of joints 1 and 3."""
    return sum(c * (q1 / LIMIT) ** i * (q3 / LIMIT) ** j for (i, j), c in COEFFICIENTS.items())
