"""The strategies: Moore-Penrose, weighted, null-basis, any given G, holonomic, rows that need not be a gradient."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..base.arguments import made
from ..base.errors import ArgumentError, NotFiniteError, ShapeError
from ..base.types import ArrayLike, finite, frozen
from ..symbolic import SX, Function, solve, symbol, written
from .constraints import Constraint, as_gain
from .strategy_kinds import FrameStrategy, HolonomicStrategy, RowStrategy
from .tasks.task import Task


@made
def moore_penrose(task: Task, *, name: str = "Moore-Penrose") -> FrameStrategy:
    """G = J^T (J J^T)^-1, the pseudo-inverse: least joint speed, and in general not holonomic. [KH83]"""
    frame = lambda task, k, q: task.jacobian_expression(k, q).T  # noqa: E731
    return FrameStrategy(name, task, frame, constant_inverse_weight=np.eye(task.n))


@made
def weighted(task: Task, weight: ArrayLike | Callable[[SX], Any], *, name: str = "weighted") -> FrameStrategy:
    """G = W J^T (J W J^T)^-1 with W = weight^-1: least dq^T weight dq. A joint that weighs more moves less.

    Args:
        weight: symmetric positive definite (n, n), constant, or a function q -> CasADi expression (n, n). It is the
            inverse of the W in [ZR11, (6)].

    Raises:
        ArgumentError: not symmetric positive definite (a function: at one of eight postures within the limits).
        ShapeError, NotFiniteError.
    """
    if callable(weight):
        _check_weight(task, weight)
        # (6): the frame of G_W
        frame = lambda task, k, q: solve(written("the weight", weight, q), task.jacobian_expression(k, q).T)  # noqa: E731
        return FrameStrategy(name, task, frame)
    given = finite("the weight", weight, (task.n, task.n))
    _positive_definite("the weight", given)
    inverse = np.linalg.inv(given)
    W = frozen((inverse + inverse.T) / 2)
    # (6): the frame of G_W
    frame = lambda task, k, q: SX(W) @ task.jacobian_expression(k, q).T  # noqa: E731
    return FrameStrategy(name, task, frame, constant_inverse_weight=W)


def _positive_definite(what: str, W: np.ndarray) -> None:
    if not np.isfinite(W).all():
        raise NotFiniteError(what, W.tolist())
    if not np.allclose(W, W.T, rtol=1e-9, atol=1e-12 * np.abs(W).max()) or np.linalg.eigvalsh(W)[0] <= 0:
        raise ArgumentError(what, W.tolist(), "give a symmetric positive definite matrix")


def _check_weight(task: Task, weight: Callable[[SX], Any]) -> None:
    q = symbol("q", task.n)
    value = written("the weight", weight, q)
    if value.shape != (task.n, task.n):
        raise ShapeError("the weight", (task.n, task.n), value.shape)
    function = Function("weight", {"q": q}, {"weight": value})
    for posture in check_postures(task):
        at = np.array2string(posture, precision=3)
        _positive_definite(f"the weight at q = {at}", np.reshape(function(posture), (task.n, task.n)))


def check_postures(task: Task) -> np.ndarray:
    """Eight random postures within the limits and 1 of the allowed one nearest zero: they show a wrong formula."""
    lower, upper = task.robot.lower, task.robot.upper
    center = np.clip(0.0, lower, upper)
    low, high = np.maximum(center - 1.0, lower), np.minimum(center + 1.0, upper)
    return np.random.default_rng(0).uniform(low, high, (8, task.n))


@made
def null_basis(task: Task, N_G: Callable[[SX], Any], *, name: str = "null-basis") -> FrameStrategy:
    """The paper's general form (7): G = H H^T J^T (J H H^T J^T)^-1 with H = [N_G N], computed as N_G (J N_G)^-1.

    Holonomic exactly when N_G spans an involutive distribution; `involutivity` tells. [ZR11, Theorem III.2]

    Args:
        N_G: q -> CasADi expression (n, m), or nested lists of them.

    Raises:
        ShapeError (when first used): N_G is not (n, m).
    """
    # Theorem III.2: 2 => 1
    # Theorem III.3: N_G does not know how the task writes the orientation
    return FrameStrategy(name, task, lambda _task, _k, q: written(name, N_G, q))


@made
def holonomic(task: Task, g: Constraint, *, name: str | None = None) -> HolonomicStrategy:
    """The extended Jacobian of a constraint: G = [J; J_g]^-1 [1; 0], holonomic by construction. [Bai85]

    Raises:
        ConstraintRowsError: g has not r = n - m rows.
    """
    strategy = HolonomicStrategy(name or g.name, task, g)
    strategy.looped.expressions  # noqa: B018  built now, so that a constraint that does not fit is refused here
    return strategy


@made
def pfaffian(task: Task, A: Callable[[SX], Any], *, name: str = "pfaffian") -> RowStrategy:
    """G = [J; A]^-1 [1; 0] for rows A(q) dq = 0 that need not be integrable; `involutivity` tells whether they are.

    Args:
        A: q -> CasADi expression (r, n), r = n - m.
    """
    return RowStrategy(name, task, lambda _task, _k, q: written(name, A, q))


@made
def right_inverse(task: Task, G: Callable[[SX], Any], *, name: str = "given") -> FrameStrategy:
    """Any right inverse that is given as a matrix: q -> G (n, m) with J G = 1.

    Unlike `null_basis`, which takes any frame of the planes and makes J G = 1 true, this one checks it.

    Raises:
        ShapeError: G is not (n, m). ArgumentError: J G is not 1, with the posture that shows it.
    """
    strategy = null_basis(task, G, name=name)
    for q in check_postures(task):
        off = np.abs(task.jacobian(q) @ strategy.distribution(q) - np.eye(task.m)).max()
        if not off < 1e-6:
            at = np.array2string(q, precision=3)
            raise ArgumentError(f"|J G - 1| of {name!r} at q = {at}", float(off), "give a right inverse, or null_basis")
    return strategy


@made
def coupled_twist(task: Task, gain: ArrayLike, *, name: str = "coupled (geometric)") -> RowStrategy:
    """w + Lambda v = 0: the paper's (28) with the geometric J_o in place of Euler angle rates.

    Not holonomic for Lambda != 0: (J_w + lambda J_p)[G_i, G_j] = -lambda^2 eps_ijk e_k (theory E3).

    Args:
        gain: Lambda in rad/m, a number or (3, 3).
    """
    L = as_gain(gain, (3, 3))
    return RowStrategy(name, task, lambda _t, k, _q: k.jacobian[3:, :] + SX(L) @ k.jacobian[:3, :])
