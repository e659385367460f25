"""Curvature of a strategy: how far a small loop of the tool carries the joints. [SY88], theory 1.1

F_ij = vertical part of [G_i, G_j], always in ker J; the drift of one small counter-clockwise loop of area
a in the task plane (i, j) is a F_ij. A strategy is holonomic exactly when F = 0. For a geometric Jacobian
the brackets themselves do not vanish, their vertical part does.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from ..base.arguments import typed
from ..base.types import Array, ArrayLike, Matrix, kept
from ..errors import ArgumentError
from ..strategies import Brackets, Expressions, FrameStrategy, NumericStrategy, Strategy, check_solved
from ..symbolic import SX, Function, as_expression, factorise, horzcat, vertcat
from ..symbolic.null_space import null_space_expression
from ..tasks.task import Task
from .numeric_curvature import measured_curvature

Method = Literal["auto", "hessian", "ad"]
"""How derivatives are made: by forward-kinematics Hessians, by automatic differentiation, or as the strategy allows."""

MOST_JOINTS = 100
"""Joints of a robot whose laws are judged. Time and memory to write the curvature out grow with the third power of
their number, for a position on one core: 60 joints 2.4 s and 0.1 GB, 100 joints 7.7 s and 0.5 GB, 140 joints 17 s
and 1.3 GB."""


@typed
def curvature(strategy: Strategy, q: ArrayLike, *, method: Method = "auto") -> Array:
    """F (n, m, m) at q (n,): F[:, i, j] = F_ij = -F_ji [joint unit / (task unit i * task unit j)].

    Args:
        strategy: of a Python function the derivatives are differences; `analysis.measured_curvature` says how accurate.
        method: "hessian" takes F from the Hessians of the forward kinematics alone (theory 2a), for a constant weight
            and a position or twist task; "ad" differentiates the planes; "auto" takes the first where it can.

    Raises:
        SingularityError: the strategy is not defined at q. ArgumentError: no Hessian form of this strategy.
    """
    q = strategy.task.robot.checked(q)
    if isinstance(strategy, NumericStrategy):
        if method != "auto":
            raise ArgumentError(
                "method", method, f"{strategy.name!r} is a Python function without a formula: use 'auto'"
            )
        return measured_curvature(strategy, q).F
    packed, _, rcond, margin = curvature_function(strategy, method)(q)
    check_solved(strategy, q, rcond, margin)
    return _unpacked(np.reshape(packed, (strategy.task.n, -1)), strategy.task.m)


def curvature_function(strategy: Strategy, method: Method = "auto") -> Function:
    """q -> (F_ij for i < j as columns (n, m(m-1)/2), G, rcond, margin), built once a strategy and method."""
    if method not in ("auto", "hessian", "ad"):
        raise ArgumentError("method", method, "use 'auto', 'hessian' or 'ad'")
    weight = _constant_inverse_weight(strategy)
    if method == "hessian" and weight is None:
        raise ArgumentError(
            "method", method, f"{strategy.name!r} needs a constant weight and a position or twist task for it: use 'ad'"
        )
    return _curvature(strategy, weight is not None and method != "ad")


def _constant_inverse_weight(strategy: Strategy) -> Matrix | None:
    """W (n, n) where the planes are spanned by W J^T, W constant, J geometric: the Hessians then give the brackets."""
    if not (isinstance(strategy, FrameStrategy) and strategy.task.geometric and strategy.task.has_hessians):
        return None
    return strategy.constant_inverse_weight


def curvature_unit(strategy: Strategy, i: int, j: int) -> str:
    """The unit of |F_ij|."""
    kinds = {c.unit for c in strategy.task.robot.coordinates}
    joint = kinds.pop() if len(kinds) == 1 else "joint unit"
    a, b = strategy.task.units[i], strategy.task.units[j]
    return f"{joint}/{a}^2" if a == b else f"{joint}/({a} {b})"


def pairs(m: int) -> list[tuple[int, int]]:
    """The planes (i, j), i < j, in the order of the columns."""
    return [(i, j) for i in range(m) for j in range(i + 1, m)]


@kept
def _curvature(strategy: Strategy, by_hessians: bool) -> Function:
    task = strategy.task
    if task.n > MOST_JOINTS:
        cure = f"its curvature is written out for at most {MOST_JOINTS}: lock some joints, or take a part of the arm"
        raise ArgumentError(f"the number of joints of {task.robot.name!r}", task.n, cure)
    e, m = strategy.expressions, task.m
    found = e.rate(SX.eye(m), written_out=True)
    closed = _hessian_brackets(task, e, _constant_inverse_weight(strategy)) if by_hessians else None
    A, brackets = e.brackets(found.X, closed)
    N = null_space_expression(e.J)  # (30)
    along = factorise(A @ N)  # F_ij = N (A N)^-1 A [G_i, G_j]: the vertical part
    # (4): what of [G_i, G_j] lies outside range G
    columns = [N @ along.solve(vertcat(*(K[i, j] for K in brackets))) for i, j in pairs(m)]
    packed = horzcat(*columns) if columns and brackets else SX.zeros(task.n, max(1, len(columns)))
    outputs = {"F": packed, "G": found.X, "rcond": found.rcond, "margin": strategy.margin_expression}
    return Function("curvature", {"q": e.q}, outputs)


def _hessian_brackets(task: Task, e: Expressions, weight: Matrix | None) -> Brackets:
    """[W J_a^T, W J_b^T] = W (H_b W J_a^T - H_a W J_b^T), with the Hessians in closed form (theory 2a)."""
    H, W = task.hessians(e.q), as_expression(weight)
    return {(a, b): W @ (H[b] @ e.planes[:, a] - H[a] @ e.planes[:, b]) for a, b in pairs(task.m)}


def _unpacked(packed: Array, m: int) -> Array:
    F = np.zeros((packed.shape[0], m, m))
    for column, (i, j) in enumerate(pairs(m)):
        F[:, i, j] = packed[:, column]
        F[:, j, i] = -packed[:, column]
    return F
