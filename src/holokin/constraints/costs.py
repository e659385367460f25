"""Constraints from a cost: the tool's pose given, the joints stand where the cost is stationary. [Bai85], [Cha87]"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arguments import Made, made
from ..errors import ArgumentError, ShapeError
from ..robot import Kinematics, potential_expression
from ..symbolic import SX, as_expression, factorise, jacobian, log, solve, sumsqr, vertcat
from ..symbolic.null_space import null_vector, null_vector_expression
from ..task import Task
from ..types import ArrayLike, Value, Vector, finite, frozen
from .base import Constraint
from .implicit import Implicit


@dataclass(frozen=True, eq=False)
class Cost(Made, Value):
    """A scalar U of the posture, written down when a task is known: `expression(task, kinematics, q)` -> (1,)."""

    name: str
    expression: Callable[[Task, Kinematics, SX], SX]
    implicit: Implicit | None = None
    """Its gradient (n,) by auxiliary unknowns, where U itself has kinks: for proofs."""


@made
def stationary(
    cost: Cost | Callable[[SX], Any], *, free: tuple[str | int, ...] | None = None, name: str | None = None
) -> Constraint:
    """g(q) = N^T grad U: zero where the cost U is stationary under self-motions, the tool held.

    r = 1: N is the unit null vector with det [J; N^T] > 0, smooth wherever J has full rank; g is the
    self-motion's share of grad U.  `free` given (r joints): Chang's N = [-J_a^-1 J_b; 1] with J_b the columns
    of the free joints; singular (REPRESENTATION) where det J_a = 0. Off the leaf g = 0 the two have different
    leaves, since the leaves depend on the scaling of N.

    Args:
        cost: `posture_cost`, `centring_cost`, `manipulability_cost`, `gravity_cost`, or q -> CasADi expression.
        free: r joints for Chang's basis, by name or by index from 0; needed when r > 1.

    Raises:
        ConstraintRowsError (when bound): r > 1 without `free`, or `free` has not r joints.
        ShapeError (when bound): the cost is not a scalar.
    """
    rows = 1 if free is None else len(free)
    U = cost if isinstance(cost, Cost) else Cost("custom cost", lambda _task, _k, q: as_expression(cost(q)))
    label = name or f"stationary {U.name}"

    def gradient(task: Task, k: Kinematics, q: SX) -> SX:
        value = U.expression(task, k, q)
        if value.shape != (1, 1):
            raise ShapeError(f"the cost of {label!r}", (1, 1), value.shape, "give a scalar")
        return jacobian(value, q).T

    def split(task: Task) -> tuple[list[int], list[int]]:
        b = [task.robot.joint_index(joint) for joint in free or ()]
        return [i for i in range(task.n) if i not in b], b

    def expression(task: Task, k: Kinematics, q: SX) -> SX:
        J, slope = task.jacobian_expression(k, q), gradient(task, k, q)
        if free is None:
            return null_vector_expression(J).T @ slope
        a, b = split(task)
        return slope[b] - solve(J[:, a], J[:, b]).T @ slope[a]

    def margin(task: Task, k: Kinematics, q: SX) -> SX:
        a, _ = split(task)
        return factorise(task.jacobian_expression(k, q)[:, a]).rcond()

    return Constraint(
        label, rows, expression, (False,) * rows, margin if free is not None else None,
        implicit=_null_space_implicit(U, gradient, split, rows, free is not None),
    )  # fmt: skip


def _null_space_implicit(
    cost: Cost, gradient: Callable[[Task, Kinematics, SX], SX], split: Callable[[Task], tuple[list[int], list[int]]],
    rows: int, chang: bool,
) -> Implicit:  # fmt: skip
    """g = N^T grad U with unknown N: J N = 0, |N|^2 = 1, or Chang's [N_a; 1], J_a N_a + J_b = 0; then those of U."""
    inner = cost.implicit

    def null(task: Task) -> int:
        return task.m * rows if chang else task.n

    def size(task: Task) -> tuple[int, int]:
        unknowns, numbers = inner.size(task) if inner else (0, 0)
        return null(task) + unknowns, numbers

    def equations(task: Task, k: Kinematics, q: SX, z: SX, scale: SX) -> tuple[SX, SX]:
        J, N = task.jacobian_expression(k, q), z[: null(task)]
        slope, h = inner.rows(task, k, q, z[null(task) :], scale) if inner else (gradient(task, k, q), SX(0, 1))
        if not chang:
            return N.T @ slope, vertcat(J @ N, (sumsqr(N) - 1) / 2, h)
        a, b = split(task)
        N = N.reshape((task.m, rows))
        return slope[b] + N.T @ slope[a], vertcat((J[:, a] @ N + J[:, b]).reshape((-1, 1)), h)

    def at(task: Task, q: Vector, scale: Vector) -> Vector:
        J = task.jacobian(q)
        a, b = split(task)
        N = np.linalg.solve(J[:, a], -J[:, b]).T.ravel() if chang else null_vector(J)
        found = np.concatenate([N, inner.at(task, q, scale)]) if inner else N
        return found.astype(np.float64, copy=False)

    return Implicit(size, equations, at, inner.scale if inner else lambda _task, _q: np.zeros(0))


@made
def posture_cost(preferred: ArrayLike, stiffness: ArrayLike = 1.0) -> Cost:
    """U = 1/2 sum_i k_i (q_i - preferred_i)^2. Raises: NotFiniteError, ArgumentError; ShapeError (when bound)."""
    target, k = frozen(finite("the preferred posture", preferred)), frozen(finite("the stiffness", stiffness))
    if not (k >= 0).all():
        raise ArgumentError("the stiffness", k.tolist(), "give numbers that are not negative")

    def cost(task: Task, _k: Kinematics, q: SX) -> SX:
        if target.shape != (task.n,) or k.shape not in ((), (task.n,)):
            raise ShapeError("the preferred posture and its stiffness", (task.n,), (target.shape, k.shape))
        return 0.5 * sumsqr(SX(np.sqrt(np.broadcast_to(k, target.shape))) * (q - SX(target)))

    return Cost("posture", cost)


@made
def centring_cost() -> Cost:
    """U = 1/2 sum_i ((q_i - middle_i) / range_i)^2 over the joints with finite limits. [Lie77]

    Joints without limits on both sides, continuous ones for instance, have no middle and are left out.

    Raises:
        ArgumentError when no joint has limits. (when bound)
    """

    def cost(task: Task, _k: Kinematics, q: SX) -> SX:
        lower, upper = task.robot.lower, task.robot.upper
        finite = np.flatnonzero(np.isfinite(lower) & np.isfinite(upper))
        if not len(finite):
            raise ArgumentError("the joints with finite limits", 0, "give limits in the robot description")
        lower, upper = lower[finite], upper[finite]
        middle, span = (lower + upper) / 2, upper - lower
        return 0.5 * sumsqr((q[finite.tolist()] - SX(middle)) / SX(span))

    return Cost("joint centring", cost)


@made
def gravity_cost(gravity: ArrayLike = (0.0, 0.0, -9.81)) -> Cost:
    """U = - sum_b m_b g . c_b [J]: stationary where the self-motion carries no weight. Masses of the URDF's inertials.

    Raises:
        ShapeError, NotFiniteError; when bound, MassError if the description has no masses.
    """
    g = frozen(finite("gravity", gravity, (3,)))
    return Cost("gravity", lambda task, _k, q: potential_expression(task.robot, q, g))


@made
def manipulability_cost() -> Cost:
    """U = -log sqrt(det J J^T): stationary where the manipulability is. [Yos85]"""

    def cost(task: Task, k: Kinematics, q: SX) -> SX:
        R = factorise(task.jacobian_expression(k, q).T).R
        total = SX(0)
        for i in range(task.m):
            total = total - 0.5 * log(R[i, i] ** 2)
        return total

    def rows(task: Task, k: Kinematics, q: SX, z: SX, scale: SX) -> tuple[SX, SX]:
        """By a lower triangular W with W^T T J J^T T^T W = 1: U' = -1/2 d tr(W^T T J J^T T^T W), W held."""
        thin = (_triangle(scale, task.m) @ task.jacobian_expression(k, q)).T @ _triangle(z, task.m)
        gap = (thin.T @ thin - SX.eye(task.m)) / 2
        return -0.5 * jacobian(sumsqr(thin), q).T, vertcat(*(gap[i, : i + 1].T for i in range(task.m)))

    def at(task: Task, q: Vector, scale: Vector) -> Vector:
        lower = np.tril_indices(task.m)
        T = np.zeros((task.m, task.m))
        T[lower] = scale
        J = T @ task.jacobian(q)
        return np.linalg.cholesky(np.linalg.inv(J @ J.T))[lower].astype(np.float64, copy=False)

    def whitening(task: Task, q: Vector) -> Vector:
        """T = L^-1 with J J^T = L L^T there, so that W is near 1."""
        J = task.jacobian(q)
        T = np.linalg.inv(np.linalg.cholesky(J @ J.T))
        return T[np.tril_indices(task.m)].astype(np.float64, copy=False)

    return Cost(
        "manipulability", cost, Implicit(lambda task: (_numbers(task.m), _numbers(task.m)), rows, at, whitening)
    )


def _numbers(m: int) -> int:
    """Of a triangle of m rows."""
    return m * (m + 1) // 2


def _triangle(z: SX, m: int) -> SX:
    """A lower triangular matrix (m, m) from its rows, one after the other."""
    W = SX.zeros(m, m)
    for i in range(m):
        W[i, : i + 1] = z[_numbers(i) : _numbers(i + 1)].T
    return W
