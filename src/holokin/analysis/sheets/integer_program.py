"""Linear programs, some of whose unknowns are whole numbers, between 0 and 1: by HiGHS, which SciPy brings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.types import Flags, Value, Vector

NODES = 5000
"""Nodes of the search tree after which the best x is taken: the same one on a slow and on a fast machine."""


@dataclass(frozen=True, eq=False)
class Optimum(Value):
    """x (k,), None where time was too short to find any; bound: no x has less, -inf where nothing is known."""

    x: Vector | None
    bound: float


def least(
    cost: Vector, rows: Any, low: Vector, high: Vector, whole: Flags, seconds: float, gap: float = 1e-4
) -> Optimum:  # fmt: skip
    """min cost x   with   low <= rows x <= high,   0 <= x <= 1,   x whole where it is to be.

    Args:
        rows: a sparse matrix (r, k). seconds: after which the best x that was found is taken. gap: share of the least
            cost by which that of x may be higher.
    """
    from scipy.optimize import Bounds, LinearConstraint, milp

    limits: Any = low, high
    found = milp(
        cost, constraints=LinearConstraint(rows, *limits), integrality=np.asarray(whole, dtype=int),
        bounds=Bounds(0.0, 1.0), options={"time_limit": seconds, "node_limit": NODES, "mip_rel_gap": gap},
    )  # fmt: skip
    known = getattr(found, "mip_dual_bound", None)
    bound = found.fun if known is None and found.status == 0 else known
    return Optimum(found.x, -np.inf if bound is None else float(bound))
