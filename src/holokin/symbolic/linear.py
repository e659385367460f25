"""Linear algebra inside expressions: solves by Householder reflections, null spaces, quadratic programs.

Solves are by Householder reflections, never by elimination without pivoting,
since a zero first entry is an ordinary robot posture. [GVL13, section 5.2]

The reflections are written with s = copysign(1, x_0) instead of |x_0|, so that derivatives taken
through a solve stay right when a pivot entry is exactly zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import casadi as ca
import numpy as np

from ..base.types import Array, Matrix, Vector
from .native.emit import System

DENSE_FROM = 10
"""Order from which a square system is left to numbers. Measured (docs/measured.md): as C both take the same time from
order 9 to 12, and the dense one is built in a third of it."""


class Solution(NamedTuple):
    """X = A^-1 B, 1 / cond A as `Factorisation.rcond` estimates it, and the sign of det A; expressions.

    Where `system` is given they are its symbols, and a `Function` of them must be told of it.
    """

    X: ca.SX
    rcond: ca.SX
    orientation: ca.SX = ca.SX(1)
    system: System | None = None


@dataclass(frozen=True)
class Factorisation:
    """A = Q R with Q orthogonal (rows x rows, kept as reflections) and R upper triangular (columns x columns)."""

    reflections: tuple[tuple[int, ca.SX, ca.SX], ...]
    R: ca.SX
    rows: int

    def solve(self, B: ca.SX) -> ca.SX:
        """X = A^-1 B for a square A; shapes (n, n), (n, k) -> (n, k). Least squares for a tall A."""
        return back_substitute(self.R, self.transpose_times(B)[: self.R.shape[0], :])

    def solve_transposed(self, B: ca.SX) -> ca.SX:
        """X = A^-T B for a square A. Of a tall A the least X with A^T X = B."""
        return self.times(_forward_substitute(self.R, B))

    def times(self, Y: ca.SX) -> ca.SX:
        """Q Y, (columns, k) -> (rows, k), of the first columns of Q: less work than to write these down."""
        return self._q(ca.vertcat(ca.SX(Y), ca.SX(self.rows - Y.shape[0], Y.shape[1])))

    def complement_times(self, Y: ca.SX) -> ca.SX:
        """The same of the other columns of Q, (rows - columns, k) -> (rows, k)."""
        return self._q(ca.vertcat(ca.SX(self.rows - Y.shape[0], Y.shape[1]), ca.SX(Y)))

    def thin_q(self) -> ca.SX:
        """The first columns of Q: an orthonormal basis (rows, columns) of range A."""
        return self._q(ca.SX.eye(self.rows)[:, : self.R.shape[1]])

    def complement(self) -> ca.SX:
        """The other columns of Q: an orthonormal basis (rows, rows - columns) of what is normal to range A."""
        return self._q(ca.SX.eye(self.rows)[:, self.R.shape[1] :])

    def _q(self, Q: ca.SX) -> ca.SX:
        Q = ca.densify(Q)
        for k, v, beta in reversed(self.reflections):
            Q[k:, :] = Q[k:, :] - (beta * v) @ (v.T @ Q[k:, :])
        return ca.densify(Q)

    def orientation(self) -> ca.SX:
        """The sign of det A of a square A, 1 or -1: a determinant itself would leave the range of numbers."""
        sign = ca.SX(-1 if len(self.reflections) % 2 else 1)  # each reflection turns it once
        for k in range(self.R.shape[0]):
            sign = sign * ca.copysign(1, self.R[k, k])
        return sign

    def rcond(self) -> ca.SX:
        """min |R_kk| / max |R_kk|, in [0, 1]: a cheap estimate of 1 / cond A; 0 for a singular A."""
        if self.R.shape[0] == 0:
            return ca.SX(1)
        smallest = largest = ca.fabs(self.R[0, 0])
        for k in range(1, self.R.shape[0]):
            smallest = ca.fmin(smallest, ca.fabs(self.R[k, k]))
            largest = ca.fmax(largest, ca.fabs(self.R[k, k]))
        return smallest / largest

    def transpose_times(self, B: ca.SX) -> ca.SX:
        """Q^T B with all of Q, (rows, k) -> (rows, k)."""
        B = ca.densify(ca.SX(B))
        for k, v, beta in self.reflections:
            B[k:, :] = B[k:, :] - (beta * v) @ (v.T @ B[k:, :])
        return B


def factorise(A: ca.SX) -> Factorisation:
    """A = Q R of a square or tall matrix (rows >= columns)."""
    A = ca.densify(ca.SX(A))
    rows, columns = A.shape
    reflections: list[tuple[int, ca.SX, ca.SX]] = []
    for k in range(min(columns, rows - 1)):
        x = A[k:, k]
        if all(x[i].is_zero() for i in range(1, rows - k)):
            continue
        s = ca.copysign(1, x[0])
        norm = ca.norm_2(x)
        v = ca.vertcat(x[0] + s * norm, x[1:])
        beta = 1 / (norm * (norm + s * x[0]))
        A[k:, k + 1 :] = A[k:, k + 1 :] - (beta * v) @ (v.T @ A[k:, k + 1 :])
        A[k, k] = -s * norm
        A[k + 1 :, k] = 0
        reflections.append((k, v, beta))
    return Factorisation(tuple(reflections), A[:columns, :], rows)


def back_substitute(R: ca.SX, B: ca.SX) -> ca.SX:
    """X = R^-1 B for an upper triangular R."""
    n = R.shape[0]
    X = ca.SX(n, B.shape[1])
    for i in reversed(range(n)):
        total = B[i, :]
        for j in range(i + 1, n):
            total = total - R[i, j] * X[j, :]
        X[i, :] = total / R[i, i]
    return ca.densify(X)


def _forward_substitute(R: ca.SX, B: ca.SX) -> ca.SX:
    """X = R^-T B for an upper triangular R."""
    B = ca.SX(B)
    X = ca.SX(*B.shape)
    for i in range(R.shape[0]):
        total = B[i, :]
        for j in range(i):
            total = total - R[j, i] * X[j, :]
        X[i, :] = total / R[i, i]
    return ca.densify(X)


def least_norm(J: ca.SX, B: ca.SX) -> Solution:
    """X = J^+ B of a wide J (m, n) of full rank, the least solution of J X = B: J^T = Q R gives X = Q R^-T B."""
    tall = factorise(J.T)
    return Solution(tall.solve_transposed(B), tall.rcond())


def same(a: ca.SX, b: ca.SX) -> bool:
    """True where two matrices are of the same nodes; False says nothing."""
    return a.shape == b.shape and bool(ca.is_equal(ca.densify(a), ca.densify(b), 1))


def solve(A: ca.SX, B: ca.SX) -> ca.SX:
    """X = A^-1 B; shapes (n, n), (n, k) -> (n, k)."""
    return factorise(A).solve(B)


def solution(A: ca.SX, B: ca.SX, *, written_out: bool = False) -> Solution:
    """X = A^-1 B: written out for a small A, or when asked to, else a system for numbers, from order DENSE_FROM on."""
    n, k = B.shape
    if n < DENSE_FROM or written_out:
        extended = factorise(A)
        return Solution(extended.solve(B), extended.rcond(), extended.orientation())
    X, measures = ca.SX.sym("X", n, k), ca.SX.sym("measures", 2)
    return Solution(X, measures[0], measures[1], System(ca.SX(A), ca.SX(B), X, measures))


# --- Null spaces of a Jacobian J (m, n) of full rank, r = n - m: numbers and expressions side by side.
#
# A basis N (n, r) is never unique. Which one is right hangs on what is done with it:
# - its span alone counts: `null_space`, `null_space_expression`, orthonormal;
# - r = 1 and the sign counts: `null_vector`, `null_vector_expression`, of length 1 with det [J; n^T] > 0;
# - r = 1 and J may lose rank: `minors`, `minors_expression`, which vanish there;
# - of any r all minors: `every_minor`, whose squares sum up to det J J^T.


def null_space(J: Array) -> Array:
    """Orthonormal N, (..., m, n) -> (..., n, r), by singular values: right to round-off for every J, singular ones too.

    It may jump between postures, so use it at one posture, or where the span alone counts.
    """
    return np.swapaxes(np.linalg.svd(J)[2][..., J.shape[-2] :, :], -1, -2)  # (30)


def null_space_expression(J: ca.SX) -> ca.SX:
    """Orthonormal N (n, r) by Householder reflections: smooth in q but for changes of sign, where J has full rank.

    Use it where these do not matter, as in rows N^T A dq = 0.
    """
    return factorise(J.T).complement()


def null_vector(J: Matrix, like: Vector | None = None) -> Vector:
    """The unit n (n,) with J n = 0 of a J (n - 1, n), on the side of another one, or else with det [J; n^T] > 0.

    Continuous wherever J has full rank: for what walks along a self-motion.
    """
    n = null_space(J)[:, 0]
    side = np.linalg.det(np.vstack([J, n])) if like is None else n @ like
    return n if side >= 0 else -n


def null_vector_expression(J: ca.SX) -> ca.SX:
    """The n with det [J; n^T] > 0 as an expression: smooth wherever J has full rank, so it may be differentiated."""
    n = null_space_expression(J)
    return n * factorise(ca.vertcat(J, n.T)).orientation()


def minors(J: Matrix) -> Vector:
    """The signed minors (n,) of a J (n - 1, n): `null_vector` of length sqrt(det J J^T), smooth in q everywhere."""
    return null_vector(J) * np.sqrt(max(np.linalg.det(J @ J.T), 0.0))  # (19): the signed minors


def every_minor(J: ca.SX) -> dict[tuple[int, ...], ca.SX]:
    """The determinants of all square matrices of m columns of a J (m, n), by their columns: polynomials of J.

    sum minor^2 = det J J^T. Row by row, each minor from smaller ones, so that zeros of J leave nothing behind.
    """
    m, n = J.shape
    determinants: dict[tuple[int, ...], ca.SX] = {(j,): J[0, j] for j in range(n)}
    for i in range(1, m):
        smaller, determinants = determinants, {}
        for columns in combinations(range(n), i + 1):
            terms = [
                (-1) ** (i + place) * J[i, column] * smaller[columns[:place] + columns[place + 1 :]]
                for place, column in enumerate(columns)
            ]
            determinants[columns] = ca.SX(sum(terms[1:], terms[0]))
    return determinants


def minors_expression(J: ca.SX) -> ca.SX:
    """`minors` as an expression: det [J; w^T] = n^T w for every w."""
    n, determinants = J.shape[1], every_minor(J)
    columns = tuple(range(n))
    return ca.vertcat(*((-1) ** (n - 1 + j) * determinants[columns[:j] + columns[j + 1 :]] for j in range(n)))


@dataclass(frozen=True)
class NearestPoint:
    """min 1/2 |x - wish|^2 subject to A x = b, lower <= x <= upper; n unknowns, m equations."""

    n: int
    m: int

    def __call__(self, wish: Vector, A: Matrix, b: Vector, lower: Vector, upper: Vector) -> Vector | None:
        """x (n,), or None when no point fulfils the conditions."""
        solution = self._solver(h=np.eye(self.n), g=-wish, a=A, lba=b, uba=b, lbx=lower, ubx=upper)
        x = np.asarray(solution["x"], dtype=float).ravel()
        met = self._solver.stats()["success"] and np.abs(A @ x - b).max() < 1e-8 * max(1.0, float(np.abs(b).max()))
        return x if met else None

    @cached_property
    def _solver(self) -> ca.Function:
        quiet = {"print_iter": False, "print_header": False, "print_info": False, "error_on_fail": False}
        shapes = {"h": ca.Sparsity.dense(self.n, self.n), "a": ca.Sparsity.dense(self.m, self.n)}
        return ca.conic("nearest", "qrqp", shapes, quiet)
