"""Curvature of a strategy: how far a small loop of the tool carries the joints. [SY88], theory 1.1

F_ij = vertical part of [G_i, G_j], always in ker J; the drift of one small counter-clockwise loop of area
a in the task plane (i, j) is a F_ij. A strategy is holonomic exactly when F = 0. For a geometric Jacobian
the brackets themselves do not vanish, their vertical part does.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.tolerances import TOLERANCES
from ...base.types import Array, ArrayLike, Matrix, kept
from ...strategies import Brackets, Expressions, FrameStrategy, NumericStrategy, Strategy
from ...strategies.tasks.task import Task
from ...symbolic import SX, Evaluator, Function, as_expression, densify, factorise, horzcat, vertcat
from ...symbolic.null_space import null_space_expression
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

    At many postures (k, n) it is (k, n, m, m).

    Args:
        strategy: of a Python function the derivatives are differences; `analysis.measured_curvature` says how accurate.
        method: "hessian" takes F from the Hessians of the forward kinematics alone (theory 2a), for a constant weight
            and a position or twist task; "ad" differentiates the planes; "auto" takes the first where it can.

    Raises:
        SingularityError: the strategy is not defined at q, of many at the first such posture. ArgumentError: no
            Hessian form of this strategy. ShapeError, NotFiniteError: q is not n finite numbers.
    """
    if isinstance(strategy, NumericStrategy):
        return _measured(strategy, q, method)
    return _evaluator(strategy, _by_hessians(strategy, method)).call(q)


def _measured(strategy: NumericStrategy, q: ArrayLike, method: Method) -> Array:
    """The same by differences. Raises: as `curvature`."""
    if method != "auto":
        cure = f"{strategy.name!r} is a Python function without a formula: use 'auto'"
        raise ArgumentError("method", method, cure)
    robot = strategy.task.robot
    if np.ndim(q) == 2:
        return np.array([measured_curvature(strategy, robot.checked(one)).F for one in np.asarray(q)])
    return measured_curvature(strategy, robot.checked(q)).F


def curvature_function(strategy: Strategy, method: Method = "auto") -> Function:
    """q -> (F_ij for i < j as columns (n, m(m-1)/2), G, rcond, margin), built once a strategy and method."""
    return _columns(strategy, _by_hessians(strategy, method))


def _by_hessians(strategy: Strategy, method: Method) -> bool:
    """Whether the Hessians of the arm give the curvature. Raises: ArgumentError."""
    if method not in ("auto", "hessian", "ad"):
        raise ArgumentError("method", method, "use 'auto', 'hessian' or 'ad'")
    weight = _constant_inverse_weight(strategy)
    if method == "hessian" and weight is None:
        raise ArgumentError(
            "method", method, f"{strategy.name!r} needs a constant weight and a position or twist task for it: use 'ad'"
        )
    return weight is not None and method != "ad"


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
def _evaluator(strategy: Strategy, by_hessians: bool) -> Evaluator:
    """(n,) -> F (n, m, m), or (k, n) -> (k, n, m, m), where the strategy is regular."""
    (q, outputs), m = _written(strategy, by_hessians), strategy.task.m
    signed = {(i, j): outputs["F"][:, k] for k, (i, j) in enumerate(pairs(m))}
    signed |= {(j, i): -F for (i, j), F in signed.items()} | {(i, i): SX.zeros(strategy.task.n, 1) for i in range(m)}
    full = horzcat(*(signed[i, j] for i in range(m) for j in range(m)))
    measures = {name: outputs[name] for name in ("rcond", "margin")}
    bounds = (TOLERANCES.singular, TOLERANCES.representation)
    function = Function("curvature_tensor", {"q": q}, {"F": densify(full), **measures})
    return function.checked((strategy.task.n, m, m), strategy.task.robot.checked, strategy._doubtful, bounds)


@kept
def _columns(strategy: Strategy, by_hessians: bool) -> Function:
    q, outputs = _written(strategy, by_hessians)
    return Function("curvature", {"q": q}, outputs)


@kept
def _written(strategy: Strategy, by_hessians: bool) -> tuple[SX, dict[str, SX]]:
    """q, and the outputs of `curvature_function` as expressions of it."""
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
    return e.q, {"F": packed, "G": found.X, "rcond": found.rcond, "margin": strategy.margin_expression}


def _hessian_brackets(task: Task, e: Expressions, weight: Matrix | None) -> Brackets:
    """[W J_a^T, W J_b^T] = W (H_b W J_a^T - H_a W J_b^T), with the Hessians in closed form (theory 2a)."""
    H, W = task.hessians(e.q), as_expression(weight)
    return {(a, b): W @ (H[b] @ e.planes[:, a] - H[a] @ e.planes[:, b]) for a, b in pairs(task.m)}
