"""A small quadratic programme, solved by CasADi's own active-set method qrqp."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ..base.types import Matrix, Vector


@dataclass(frozen=True)
class NearestPoint:
    """min 1/2 |x - wish|^2 subject to A x = b, lower <= x <= upper; n unknowns, m equations."""

    n: int
    m: int

    def __call__(self, wish: Vector, A: Matrix, b: Vector, lower: Vector, upper: Vector) -> Vector | None:
        """x (n,), or None when no point fulfils the conditions."""
        found = self._solver(h=np.eye(self.n), g=-wish, a=A, lba=b, uba=b, lbx=lower, ubx=upper)
        x = np.asarray(found["x"], dtype=float).ravel()
        met = self._solver.stats()["success"] and np.abs(A @ x - b).max() < 1e-8 * max(1.0, float(np.abs(b).max()))
        return x if met else None

    @cached_property
    def _solver(self) -> ca.Function:
        quiet = {"print_iter": False, "print_header": False, "print_info": False, "error_on_fail": False}
        shapes = {"h": ca.Sparsity.dense(self.n, self.n), "a": ca.Sparsity.dense(self.m, self.n)}
        return ca.conic("nearest", "qrqp", shapes, quiet)
