"""Strategies with a physical reading: least kinetic energy, and an arm on springs.

Both are weighted pseudo-inverses G = W J^T (J W J^T)^-1. They are written by the rows that annul range G,
N^T W^-1 dq = 0, so W itself, the inverse of what is given, is never formed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from ..base.arguments import made, typed
from ..base.errors import ArgumentError, ShapeError, UnknownNameError
from ..robot import Kinematics, mass_matrix_expression
from ..symbolic import SX, as_map, factorise, hessian, jacobian, symbol
from ..symbolic.null_space import null_space_expression
from .constraints import Cost
from .strategy_kinds import RowStrategy
from .tasks.task import Task

Force = Literal["pseudo-inverse", "stiffness"]
"""How the force at the tool is found from the joint torques: by J^+, or by the inverse that the stiffness weights."""


@made
def inertia_weighted(task: Task, *, name: str = "inertia-weighted") -> RowStrategy:
    """G = M^-1 J^T (J M^-1 J^T)^-1: least kinetic energy, the dynamically consistent inverse. [Kha87]

    M(q) is the mass matrix of the URDF's inertials. In general not holonomic.

    Raises:
        MassError: the robot's description has no masses.
    """
    robot = task.robot
    mass_matrix_expression(robot, symbol("q", robot.n))  # so that missing masses are told here

    def rows(task: Task, k: Kinematics, q: SX) -> SX:
        return null_space_expression(task.jacobian_expression(k, q)).T @ mass_matrix_expression(task.robot, q)

    return RowStrategy(name, task, rows)


@made
def impedance(task: Task, potential: Cost, *, force: Force = "pseudo-inverse", name: str = "impedance") -> RowStrategy:
    """G = W J^T (J W J^T)^-1 with W = (K - Gamma)^-1: the arm on springs, pulled along at its tool. [MIH91]

    K = Hess U is the joint stiffness of the potential U, Gamma = sum_k F_k Hess f_k what the force F at the tool
    adds to it. F balances the springs as well as it can: F = (J^+)^T grad U ("pseudo-inverse"), or weighted by
    the stiffness, F = (J K^-1 J^T)^-1 J K^-1 grad U ("stiffness").

    Three variants stand in the literature under one name (theory 2d), and differ off equilibrium:
    (i) held at equilibrium, N^T grad U = 0, it is `holonomic(task, stationary(U))`;
    (ii) this one, with F from q: the same on that leaf; with one redundant joint it is holonomic everywhere, with
    g = n^T grad U / |n| (by "stiffness", K constant: / sqrt(n^T K n)), with more joints it is not;
    (iii) with F as a state: `impedance_with_memory`.

    Singular (ALGORITHMIC) where N^T (K - Gamma) N is: the arm buckles.

    Raises:
        ArgumentError: a task whose J is not df/dq (a twist). UnknownNameError: another `force`.
        ShapeError: U is not a scalar.
    """
    if force not in ("pseudo-inverse", "stiffness"):
        raise UnknownNameError("force of an impedance", force, ("pseudo-inverse", "stiffness"))
    check_exact(task)

    def rows(task: Task, k: Kinematics, q: SX) -> SX:
        slope, K = gradient_and_stiffness(task, k, q, potential)
        J = task.jacobian_expression(k, q)
        if force == "pseudo-inverse":
            F = factorise(J.T).solve(slope)  # least squares: (J^+)^T grad U
        else:
            compliance = factorise(K)
            F = factorise(J @ compliance.solve(J.T)).solve(J @ compliance.solve(slope))
        return null_space_expression(J).T @ (K - geometric_stiffness(task, k, q)(q, F))

    return RowStrategy(name, task, rows)


@typed
def gradient_and_stiffness(task: Task, k: Kinematics, q: SX, potential: Cost) -> tuple[SX, SX]:
    """grad U (n,) and K = Hess U (n, n). Raises: ShapeError."""
    U = potential.expression(task, k, q)
    if U.shape != (1, 1):
        raise ShapeError(f"the potential {potential.name!r}", (1, 1), U.shape, "give a scalar")
    return jacobian(U, q).T, hessian(U, q)


@typed
def geometric_stiffness(task: Task, k: Kinematics, q: SX) -> Callable[..., SX]:
    """The map (q, F) -> Gamma = sum_k F_k Hess f_k (n, n), the change of J^T F with F held."""
    F = symbol("F", task.m)
    return as_map([q, F], jacobian(task.jacobian_expression(k, q).T @ F, q))


def check_exact(task: Task) -> None:
    """Raises: ArgumentError: J of the task is not df/dq."""
    if not task.exact:
        raise ArgumentError(
            "the task of an impedance",
            task.name,
            "it needs coordinates: a position, 'rpy', 'zyz', 'rotation-vector'",
        )
