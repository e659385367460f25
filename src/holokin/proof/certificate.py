"""`Certificate`: a theorem about a leaf, the cells that it was computed from, and what can be read off them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from ..types import Array, Indices, Matrix, Value, Vector
from ..symbolic import intervals as iv
from ..symbolic.intervals import Interval
from .tube import Cells, Findings


class Proven(Enum):
    """How far a proof came."""

    WHOLE = "proven for all of it"
    SINGULAR = "not proven: [J; J_g] is singular there, or nearly so"
    LIMIT = "not proven: a joint is at its limit there, or beyond it"
    BUDGET = "not proven: the cells that were allowed are spent"
    END = "not proven: the leaf could not be followed to there"
    APART = "not proven: neighbouring cells could not be shown to share a root"


@dataclass(frozen=True, eq=False)
class Certificate(Value):
    """What was proven of a holonomic strategy on the leaf through a posture, over a path or a box of tool poses.

    `status` says how far the proof came, `where` in words at which place it ended. The cells are all those proven, in
    the order of a path; `low`, `high` (n,) are the hull of the joints over them, `determinant` bounds |det [J; J_g]| from
    below, `limit_distance` (n,) is the least distance to a joint limit [joint unit]. `turns` (n,) are the whole turns of
    the joints round a closed path, `gap` [rad or m] bounds how far the end is from the start besides them.
    """

    title: str
    theorem: str
    status: Proven
    where: str
    cells: Cells
    findings: Findings
    piece: Indices
    c: Vector
    low: Vector
    high: Vector
    limit_distance: Vector
    determinant: float
    turns: Vector
    gap: float
    seconds: float
    operations: tuple[tuple[object, ...], ...] = ()

    def __len__(self) -> int:
        return len(self.cells)

    @property
    def whole(self) -> bool:
        """True where all that was asked is proven."""
        return self.status is Proven.WHOLE

    def __str__(self) -> str:
        return self.theorem if self.whole else f"{self.status.value}, {self.where}. {self.theorem}"


def determinants(A: Array) -> Interval:
    """Enclosures (k,) of |det A| of matrices (k, n, n), by elimination in the order of rows that rounded numbers suggest."""
    from scipy.linalg import lu

    k, n, _ = A.shape
    order = np.array([lu(matrix, p_indices=True)[0] for matrix in A], dtype=int).reshape(k, n).argsort(axis=1)
    M = np.take_along_axis(A, order[:, :, None], axis=1)
    rows = [iv.point(M[:, i, :].T.copy()) for i in range(n)]  # (n, k) each
    total = iv.point(np.ones(k))
    for j in range(n):
        pivot = Interval(rows[j].low[j], rows[j].high[j])
        total = iv.multiply(total, iv.absolute(pivot))
        for i in range(j + 1, n):
            factor = iv.divide(Interval(rows[i].low[j], rows[i].high[j]), pivot)
            rows[i] = iv.subtract(rows[i], iv.multiply(factor, rows[j]))
    return total


def least_determinant(found: Findings) -> float:
    """A lower bound of |det D_q E| at all roots: |det Y A| >= (1 - e - omega r)^n, and so |det A| >= that / |det Y|."""
    shrink = np.maximum(1 - found.e - found.omega * found.r * (1 + 1e-12), 0.0)
    with np.errstate(divide="ignore"):
        each = shrink ** found.low.shape[1] * (1 - 1e-13) / determinants(found.Y).high
    return float(each.min())


def hull_of(findings: Findings) -> tuple[Matrix, Matrix]:
    """(low, high) of the joints over all cells."""
    return findings.low.min(axis=0), findings.high.max(axis=0)
