"""Constraints from a cost: the tool's pose given, the joints stand where the cost is stationary. [Bai85], [Cha87]"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.arguments import Made, made
from ...base.errors import ArgumentError, ShapeError
from ...base.types import ArrayLike, Value, Vector, finite, frozen
from ...robot import Kinematics, link_jacobian, potential_expression
from ...symbolic import SX, Formula, directional, factorise, jacobian, log, norm_2, solve, sumsqr, vertcat, written
from ...symbolic.linear import every_minor, minors_expression, null_vector, null_vector_expression
from ..tasks.frame_task import FrameTask
from ..tasks.task import Field, Task, TipFrame
from .constraint import Constraint, Implicit


@dataclass(frozen=True, eq=False)
class Cost(Made, Value):
    """A scalar U of the posture, written down when a task is known: `expression(task, kinematics, q)` -> (1,)."""

    name: str
    expression: Field
    smooth: Field | None = None
    """U(q) where `expression` has kinks, but for a constant: for proofs. [(task, kinematics, q) -> (1,)]"""


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
        RowsError (when bound): r > 1 without `free`, or `free` has not r joints.
        ShapeError (when bound): the cost is not a scalar.
    """
    rows = 1 if free is None else len(free)
    U = cost if isinstance(cost, Cost) else Cost("custom cost", lambda _task, _k, q: written("the cost", cost, q))
    label = name or f"stationary {U.name}"

    # The gradient of the cost, g, its margin with Chang's basis, and the formula in which it may jump.
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

    def formulas(task: Task, k: Kinematics, q: SX) -> list[Formula]:
        slope = jacobian(U.smooth(task, k, q), q).T if U.smooth is not None else gradient(task, k, q)
        return [Formula(slope, q, q, (False,) * task.n)]

    chang = free is not None
    implicit = _null_space_implicit(U, gradient, split, rows, chang)
    flags = (False,) * rows
    return Constraint(label, rows, expression, flags, margin if chang else None, implicit=implicit, formulas=formulas)


def _null_space_implicit(
    cost: Cost, gradient: Field, split: Callable[[Task], tuple[list[int], list[int]]], rows: int, chang: bool
) -> Implicit:
    """g = N^T grad U with unknown N: J N = 0, |N|^2 = 1, or Chang's [N_a; 1], J_a N_a + J_b = 0.

    Of a cost that is a function of J, and r = 1, no unknown is needed: N is along the minors n of a `_short_jacobian`.
    """
    smooth = cost.smooth

    # How many unknowns there are, the equations in them, and their values at a posture.
    def by_minors(task: Task) -> bool:
        return smooth is not None and task.n - task.m == 1

    def size(task: Task) -> int:
        return 0 if by_minors(task) else task.m * rows if chang else task.n

    def equations(task: Task, k: Kinematics, q: SX, N: SX) -> tuple[SX, SX]:
        a, b = split(task)
        if smooth is not None and by_minors(task):
            n = minors_expression(_short_jacobian(task, k, q))
            return directional(smooth(task, k, q), q, n) / (n[b] if chang else norm_2(n)), SX(0, 1)
        J = task.jacobian_expression(k, q)
        slope = gradient(task, k, q) if smooth is None else jacobian(smooth(task, k, q), q).T
        if not chang:
            return N.T @ slope, vertcat(J @ N, (sumsqr(N) - 1) / 2)
        N = N.reshape((task.m, rows))
        return slope[b] + N.T @ slope[a], (J[:, a] @ N + J[:, b]).reshape((-1, 1))

    def unknowns(task: Task, q: Vector) -> Vector:
        if by_minors(task):
            return np.zeros(0)
        J = task.jacobian(q)
        a, b = split(task)
        N = np.linalg.solve(J[:, a], -J[:, b]).T.ravel() if chang else null_vector(J)
        return N.astype(np.float64, copy=False)

    return Implicit(size, equations, unknowns)


def _short_jacobian(task: Task, k: Kinematics, q: SX) -> SX:
    """A(q) J (m, n) with det A = 1, of few operations where J is that of a tool's pose or position: for proofs."""
    geometric = isinstance(task, FrameTask) and isinstance(task.frame, TipFrame) and task._geometric
    if geometric and task.rows in (tuple(range(6)), tuple(range(3))):
        return link_jacobian(task.robot, q, task.tip, turned=task.m == 6)
    return task.jacobian_expression(k, q)


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
        ShapeError, NotFiniteError; when bound, RobotFileError if the description has no masses.
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

    def smooth(task: Task, k: Kinematics, q: SX) -> SX:
        """det J J^T is the sum of the squares of all minors of J."""
        return -log(sumsqr(vertcat(*every_minor(_short_jacobian(task, k, q)).values()))) / 2

    return Cost("manipulability", cost, smooth)
