"""Planar arms of many joints, and a constraint that gives them a leaf, for the tests."""

from __future__ import annotations

import holokin as hk


def chain(n: int) -> hk.Robot:
    """A planar arm of n equal links, 1 m long in all."""
    return hk.from_dh([{"a": 1.0 / n} for _ in range(n)], name=f"planar-{n}r")


def shared_bend(n: int) -> hk.Constraint:
    """g_i = q_(i+1) - 2 q_i + q_(i-1), one for each inner joint, a little bent: the arm stays a smooth curve."""
    return hk.custom(lambda q: [q[i + 1] - 2 * q[i] + q[i - 1] + 0.1 * q[i] ** 2 for i in range(1, n - 1)], rows=n - 2)
