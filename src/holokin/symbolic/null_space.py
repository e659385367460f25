"""Null spaces of a Jacobian J (m, n) of full rank, r = n - m: numbers and expressions side by side.

A basis N (n, r) is never unique. Which one is right hangs on what is done with it:
- its span alone counts: `null_space`, `null_space_expression`, orthonormal;
- r = 1 and the sign counts: `null_vector`, `null_vector_expression`, of length 1 with det [J; n^T] > 0;
- r = 1 and J may lose rank: `minors`, `minors_expression`, which vanish there;
- of any r all minors: `every_minor`, whose squares sum up to det J J^T.
"""

from __future__ import annotations

from itertools import combinations

import casadi as ca
import numpy as np

from ..base.types import Array, Matrix, Vector
from .linear import factorise


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
    found: dict[tuple[int, ...], ca.SX] = {(j,): J[0, j] for j in range(n)}
    for i in range(1, m):
        smaller, found = found, {}
        for columns in combinations(range(n), i + 1):
            terms = [
                (-1) ** (i + at) * J[i, column] * smaller[columns[:at] + columns[at + 1 :]]
                for at, column in enumerate(columns)
            ]
            found[columns] = ca.SX(sum(terms[1:], terms[0]))
    return found


def minors_expression(J: ca.SX) -> ca.SX:
    """`minors` as an expression: det [J; w^T] = n^T w for every w."""
    n, found = J.shape[1], every_minor(J)
    columns = tuple(range(n))
    return ca.vertcat(*((-1) ** (n - 1 + j) * found[columns[:j] + columns[j + 1 :]] for j in range(n)))
