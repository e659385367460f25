"""Curvature of a strategy: how far a small loop of the tool carries the joints. [SY88], theory 1.1

F_ij = vertical part of [G_i, G_j], always in ker J; the drift of one small counter-clockwise loop of area
a in the task plane (i, j) is a F_ij. A strategy is holonomic exactly when F = 0. For a geometric Jacobian
the brackets themselves do not vanish, their vertical part does.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from ..strategy import Expressions, Strategy
from ..symbolic import SX, Function, densify, directional, factorise, horzcat, pairwise_brackets, vertcat
from ..types import Array, ArrayLike

_CACHE: WeakKeyDictionary[Strategy, Function] = WeakKeyDictionary()


def curvature(strategy: Strategy, q: ArrayLike) -> Array:
    """F (n, m, m) at q (n,): F[:, i, j] = F_ij = -F_ji [joint unit / (task unit i * task unit j)].

    Raises:
        SingularityError: the strategy is not defined at q.
    """
    q = strategy.task.robot.checked(q)
    packed, _, conditioning, margin = curvature_function(strategy)(q)
    strategy.check(q, conditioning, margin)
    return _unpacked(np.reshape(packed, (strategy.task.n, -1)), strategy.task.m)


def curvature_function(strategy: Strategy) -> Function:
    """q -> (F_ij for i < j as columns (n, m(m-1)/2), G, conditioning, margin), built once a strategy."""
    if strategy not in _CACHE:
        _CACHE[strategy] = _build(strategy)
    return _CACHE[strategy]


def pairs(m: int) -> list[tuple[int, int]]:
    """The planes (i, j), i < j, in the order of the columns."""
    return [(i, j) for i in range(m) for j in range(i + 1, m)]


def _build(strategy: Strategy) -> Function:
    e, m = strategy.expressions, strategy.task.m
    G, conditioning = e.rate(SX.eye(m))
    columns = _from_rows(e, G, m) if e.form == "kernel" else _from_frame(e, G, m)
    packed = horzcat(*columns) if columns else SX.zeros(strategy.task.n, 1)
    outputs = {"F": packed, "G": G, "conditioning": conditioning, "margin": strategy.margin_expression}
    return Function("curvature", {"q": e.q}, outputs)


def _from_frame(e: Expressions, G: SX, m: int) -> list[SX]:
    """G = B M: [G_i, G_j] = sum_ab M_ai M_bj [B_a, B_b] up to range G, so only B is differentiated."""
    B = e.planes
    M = factorise(e.J @ B).solve(SX.eye(m))
    brackets = pairwise_brackets(B, e.q)
    vertical = {ab: v - G @ (e.J @ v) for ab, v in brackets.items()}
    columns = []
    for i, j in pairs(m):
        total = SX.zeros(B.shape[0], 1)
        for (a, b), v in vertical.items():
            total = total + (M[a, i] * M[b, j] - M[b, i] * M[a, j]) * v
        columns.append(densify(total))
    return columns


def _from_rows(e: Expressions, G: SX, m: int) -> list[SX]:
    """[J; A] F_ij = [0; -(DA[G_i] G_j - DA[G_j] G_i)]: only A is differentiated, no null-space basis (theory 5.1)."""
    A = e.planes
    along = [directional(A, e.q, G[:, i]) @ G for i in range(m)]
    extended = factorise(vertcat(e.J, A))
    zeros = SX.zeros(m, 1)
    return [extended.solve(vertcat(zeros, along[j][:, i] - along[i][:, j])) for i, j in pairs(m)]


def _unpacked(packed: Array, m: int) -> Array:
    F = np.zeros((packed.shape[0], m, m))
    for column, (i, j) in enumerate(pairs(m)):
        F[:, i, j] = packed[:, column]
        F[:, j, i] = -packed[:, column]
    return F
