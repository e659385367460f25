"""`fitted`: a holonomic strategy's leaves as polynomials, for use in a fast loop.

A radial strategy integrates a ray at every call. Near a start its constraint is a smooth function of the tool pose x
and one linear coordinate phi = Z^T q per redundant joint, so a polynomial in (x, phi) of low degree stands for
it. Whatever the fit, the result is the gradient of a function: it is exactly holonomic, and only as near to the
given strategy as the fit is good.
"""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np

from ..base.arguments import made
from ..base.errors import ArgumentError
from ..base.types import ArrayLike, Matrix, finite, frozen, whole
from ..robot import Kinematics
from ..symbolic import SX, Function, as_expression, jacobian, symbol, vertcat
from ..symbolic.null_space import null_space
from .constraints import Constraint, nothing_jumps
from .right_inverses import holonomic
from .strategy import Field
from .strategy_kinds import HolonomicStrategy
from .tasks.task import Task

Terms = tuple[tuple[int, ...], ...]
"""For each monomial the variables that it multiplies; () is the constant."""


@made
def fitted(
    strategy: HolonomicStrategy,
    Q: ArrayLike,
    *,
    degree: int = 4,
    rows: tuple[int, ...] | None = None,
    name: str | None = None,
) -> HolonomicStrategy:
    """The holonomic strategy whose constraint is the polynomial in (x, phi) nearest to the given one's over Q.

    g_fit(q) = phi(q) + sum_a c_a u^a, u = (x - mean, phi - mean) / spread; the c_a are fitted by least squares to
    the values and the gradients of g at the postures, both at once. phi = Z^T (q - q_0), Z (n, r) the self-motions at
    the middle posture. Use it only where Q was.

    Args:
        strategy: one with leaves, for instance a `radial` strategy.
        Q: postures (k, n) of the region of use; a few hundred.
        degree: total degree of the polynomial; 4 has 70 terms in 4 variables, 330 in 7.
        rows: task rows it depends on, all by default; for constant orientation the position rows alone.

    Raises:
        ArgumentError: a strategy without leaves, a degree < 1, or too few postures to determine the terms. ShapeError.
    """
    task = strategy.task
    postures = frozen(finite("the postures", Q, ("k", task.n)))
    whole("degree", degree)
    chosen = list(range(task.m) if rows is None else rows)
    if not chosen or len(set(chosen)) != len(chosen) or not set(chosen) <= set(range(task.m)):
        raise ArgumentError("rows", rows, f"name some of the {task.m} task rows, from 0, each once")
    if not len(postures):
        raise ArgumentError("the number of postures", 0, "give a few hundred")
    q0 = postures[np.argmin(np.linalg.norm(postures - postures.mean(axis=0), axis=1))]
    Z = null_space(task.jacobian(q0))
    chart = task.counted_from(task.place(q0)[1])  # rotation vectors jump half a turn from their reference
    x = chart.value_batch(postures)[:, chosen]
    u = np.hstack([x, (postures - q0) @ Z])
    middle, spread = u.mean(axis=0), np.maximum(np.abs(u - u.mean(axis=0)).max(axis=0), 1e-6)
    exponents = monomials_up_to(u.shape[1], degree)[1:]  # without the constant, of which a leaf knows nothing
    if len(exponents) > len(postures) * (1 + len(chosen)):
        cure = f"give at least {len(exponents) // (1 + len(chosen)) + 1} postures, or a lower degree"
        raise ArgumentError(f"the number of postures for {len(exponents)} terms", len(postures), cure)

    def variables(_task: Task, k: Kinematics, q: SX) -> SX:
        phi = SX(Z.T) @ (q - SX(q0))
        return (vertcat(chart.value_expression(k)[chosen], phi) - SX(middle)) / SX(spread)

    others = [i for i in range(task.m) if i not in chosen]
    coefficients = _least_squares(strategy, postures, Z, q0, variables, exponents, others)

    def expression(task: Task, k: Kinematics, q: SX) -> SX:
        terms = monomials(variables(task, k, q), exponents)
        return SX(Z.T) @ (q - SX(q0)) + SX(coefficients.T) @ terms

    constraint = Constraint(
        name or f"fitted {strategy.name}",
        task.n - task.m,
        expression,
        (False,) * (task.n - task.m),
        formulas=nothing_jumps,
    )
    return holonomic(task, constraint)


def monomials_up_to(variables: int, degree: int) -> Terms:
    """All monomials of so many variables up to a degree, by increasing degree; the first is the constant."""
    return tuple(c for d in range(degree + 1) for c in combinations_with_replacement(range(variables), d))


def monomials(u: SX, terms: Terms) -> SX:
    """Monomials (t,) of u, each one product more than one of lower degree."""
    known: dict[tuple[int, ...], SX] = {(): SX(1)}
    for factors in terms:
        if factors:
            known[factors] = known[factors[:-1]] * u[factors[-1]]
    return vertcat(*(known[factors] for factors in terms))


def _least_squares(
    strategy: HolonomicStrategy,
    Q: Matrix,
    Z: Matrix,
    q0: Matrix,
    variables: Field,
    exponents: Terms,
    others: list[int],
) -> Matrix:
    """Coefficients (terms, r) from the values of g - phi, measured from their mean, and from its gradients.

    Gradients count in the directions that leave the task rows `others` alone, which the polynomial cannot follow.
    """
    task = strategy.task
    r = task.n - task.m
    q = symbol("q", task.n)
    terms = monomials(variables(task, task.kinematics(q), q), exponents)
    basis = Function("monomials", {"q": q}, {"terms": terms, "slopes": as_expression(jacobian(terms, q))})
    T, S = basis.batch(Q)
    g = strategy.constraint_value.batch(Q).reshape(len(Q), r)
    g = strategy.constraint.nearest(g - np.atleast_1d(strategy.constraint_value(q0)))  # angles count from the middle
    g = g - (Q - q0) @ Z
    slopes = np.stack([strategy.rows(one) for one in Q]) - Z.T
    span = float(np.abs(Q - q0).max()) or 1.0  # gradients count as the changes they make across the region
    J = task.jacobian_batch(Q)[0][:, others]
    free = span * np.swapaxes(null_space(J), 1, 2) if others else span * np.tile(np.eye(task.n), (len(Q), 1, 1))
    S = np.einsum("kdi,kti->kdt", free, S.reshape(len(Q), len(exponents), task.n))
    A = np.vstack([T - T.mean(axis=0), S.reshape(-1, len(exponents))])
    b = np.vstack([g - g.mean(axis=0), np.einsum("kdi,kri->kdr", free, slopes).reshape(-1, r)])
    return np.asarray(np.linalg.lstsq(A, b, rcond=1e-12)[0], dtype=float)
