"""Derivatives of expressions: Jacobian, gradient, Hessian, Lie bracket."""

from __future__ import annotations

import casadi as ca


def jacobian(expression: ca.SX, q: ca.SX) -> ca.SX:
    """d expression / d q; (k,), (n,) -> (k, n). A matrix is taken column by column."""
    return ca.densify(ca.jacobian(ca.vec(expression), q))


def gradient(expression: ca.SX, q: ca.SX) -> ca.SX:
    """d expression / d q of a scalar, (n,) -> (1, n), by one sweep back that shares what the expression computes."""
    return ca.densify(ca.gradient(expression, q)).T


def hessian(expression: ca.SX, q: ca.SX) -> ca.SX:
    """d^2 expression / d q^2 of a scalar; (n,) -> (n, n)."""
    return ca.densify(ca.hessian(expression, q)[0])


def directional(expression: ca.SX, q: ca.SX, v: ca.SX) -> ca.SX:
    """(d expression / d q) v, of the shape of the expression; no Jacobian is formed."""
    return ca.reshape(ca.jtimes(ca.vec(expression), q, v), *expression.shape)


def lie_bracket(A: ca.SX, B: ca.SX, q: ca.SX) -> ca.SX:
    """[A, B] = (dB/dq) A - (dA/dq) B of two vector fields; (n,), (n,), (n,) -> (n,). [ZR11, (5)]"""
    return directional(B, q, A) - directional(A, q, B)  # (5)


def pairwise_brackets(fields: ca.SX, q: ca.SX) -> dict[tuple[int, int], ca.SX]:
    """[B_a, B_b] for all columns a < b of a matrix of vector fields (n, k)."""
    k = fields.shape[1]
    along = [directional(fields, q, fields[:, a]) for a in range(k)]  # along[a][:, b] = (dB_b) B_a
    # (36): the brackets [N_i, N_j] in it, of any fields: of a null-space basis N, J [N_a, N_b] = 0
    return {(a, b): along[a][:, b] - along[b][:, a] for a in range(k) for b in range(a + 1, k)}
