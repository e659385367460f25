"""Curvature of a strategy: how far a small loop of the tool carries the joints. [SY88], theory 1.1

F_ij = vertical part of [G_i, G_j], always in ker J; the drift of one small counter-clockwise loop of area
a in the task plane (i, j) is a F_ij. A strategy is holonomic exactly when F = 0. For a geometric Jacobian
the brackets themselves do not vanish, their vertical part does.
"""

from __future__ import annotations

from typing import Literal
from weakref import WeakKeyDictionary

import numpy as np

from ..arguments import typed
from ..errors import ArgumentError
from ..robot import hessian_expression
from ..strategies import Expressions, Strategy
from ..symbolic import SX, Function, as_expression, directional, dot, factorise, horzcat, pairwise_brackets, vertcat
from ..types import Array, ArrayLike

Method = Literal["auto", "hessian", "ad"]
"""How derivatives are made: by forward-kinematics Hessians, by automatic differentiation, or as the strategy allows."""

MOST_JOINTS = 100
"""Joints of a robot whose laws are judged. Time and memory to write the curvature out grow with the third power of
their number, for a position on one core: 60 joints 2.4 s and 0.1 GB, 100 joints 7.7 s and 0.5 GB, 140 joints 17 s
and 1.3 GB."""

_CACHE: WeakKeyDictionary[Strategy, dict[str, Function]] = WeakKeyDictionary()


@typed
def curvature(strategy: Strategy, q: ArrayLike, *, method: Method = "auto") -> Array:
    """F (n, m, m) at q (n,): F[:, i, j] = F_ij = -F_ji [joint unit / (task unit i * task unit j)].

    Args:
        method: "hessian" takes F from the Hessians of the forward kinematics alone (theory 2a), for a constant weight
            and a position or twist task; "ad" differentiates the planes; "auto" takes the first where it can.

    Raises:
        SingularityError: the strategy is not defined at q. ArgumentError: no Hessian form of this strategy.
    """
    q = strategy.task.robot.checked(q)
    packed, _, conditioning, margin = curvature_function(strategy, method)(q)
    strategy.check(q, conditioning, margin)
    return _unpacked(np.reshape(packed, (strategy.task.n, -1)), strategy.task.m)


def curvature_function(strategy: Strategy, method: Method = "auto") -> Function:
    """q -> (F_ij for i < j as columns (n, m(m-1)/2), G, conditioning, margin), built once a strategy and method."""
    if method not in ("auto", "hessian", "ad"):
        raise ArgumentError("method", method, "use 'auto', 'hessian' or 'ad'")
    allowed = strategy.constant_weight is not None and strategy.task.orientation in (None, "twist")
    if method == "hessian" and not allowed:
        raise ArgumentError("method", method, f"{strategy.name!r} has no constant weight, or its task is not a twist")
    chosen = "hessian" if allowed and method != "ad" else "ad"
    known = _CACHE.setdefault(strategy, {})
    if chosen not in known:
        known[chosen] = _build(strategy, chosen)
    return known[chosen]


def pairs(m: int) -> list[tuple[int, int]]:
    """The planes (i, j), i < j, in the order of the columns."""
    return [(i, j) for i in range(m) for j in range(i + 1, m)]


def _build(strategy: Strategy, method: str) -> Function:
    if strategy.task.n > MOST_JOINTS:
        cure = f"its curvature is written out for at most {MOST_JOINTS}: hold some joints still, or judge a part of it"
        raise ArgumentError(f"the number of joints of {strategy.task.robot.name!r}", strategy.task.n, cure)
    e, m = strategy.expressions, strategy.task.m
    rows = range(strategy.task.n - m)
    found = e.rate(SX.eye(m), written_out=True)
    G, conditioning = found.X, found.conditioning
    if e.form == "kernel":
        A, brackets = e.planes, _brackets_of_rows(e, G, m)
    else:
        B = e.planes
        A = factorise(B).complement().T
        found = _hessian_brackets(strategy, e) if method == "hessian" else pairwise_brackets(B, e.q)
        # G = B M: A [G_i, G_j] = sum_ab M_ai M_bj A [B_a, B_b], so only B is differentiated
        M = factorise(e.J @ B).solve(SX.eye(m))  # Proposition 1
        brackets = [M.T @ _antisymmetric({ab: dot(A[k, :].T, v) for ab, v in found.items()}, m) @ M for k in rows]
    N = factorise(e.J.T).complement()  # (30)
    along = factorise(A @ N)  # F_ij = N (A N)^-1 A [G_i, G_j]: the vertical part
    # (4): what of [G_i, G_j] lies outside range G
    columns = [N @ along.solve(vertcat(*(K[i, j] for K in brackets))) for i, j in pairs(m)]
    packed = horzcat(*columns) if columns and rows else SX.zeros(strategy.task.n, max(1, len(columns)))
    outputs = {"F": packed, "G": G, "conditioning": conditioning, "margin": strategy.margin_expression}
    return Function("curvature", {"q": e.q}, outputs)


def _hessian_brackets(strategy: Strategy, e: Expressions) -> dict[tuple[int, int], SX]:
    """[W J_a^T, W J_b^T] = W (H_b W J_a^T - H_a W J_b^T), with the Hessians in closed form (theory 2a)."""
    task = strategy.task
    every = hessian_expression(task.robot, e.q, task.tip)
    H, W = [every[row] for row in task.rows], as_expression(strategy.constant_weight)
    return {(a, b): W @ (H[b] @ e.planes[:, a] - H[a] @ e.planes[:, b]) for a, b in pairs(task.m)}


def _brackets_of_rows(e: Expressions, G: SX, m: int) -> list[SX]:
    """A_k [G_i, G_j] = -(DA_k[G_i] G_j - DA_k[G_j] G_i) as (m, m), for each row k: only A is differentiated."""
    # (31), (32): DA[G_i] G_j = -A DG_j[G_i], from A G = 0
    along = [directional(e.planes, e.q, G[:, i]) @ G for i in range(m)]
    values = [vertcat(*(turn[k, :] for turn in along)) for k in range(e.planes.shape[0])]
    return [T.T - T for T in values]  # (33), (34), (35)


def _antisymmetric(upper: dict[tuple[int, int], SX], m: int) -> SX:
    """K (m, m) with K_ab = -K_ba given for a < b."""
    K = SX.zeros(m, m)
    for (a, b), value in upper.items():
        K[a, b], K[b, a] = value, -value
    return K


def _unpacked(packed: Array, m: int) -> Array:
    F = np.zeros((packed.shape[0], m, m))
    for column, (i, j) in enumerate(pairs(m)):
        F[:, i, j] = packed[:, column]
        F[:, j, i] = -packed[:, column]
    return F
