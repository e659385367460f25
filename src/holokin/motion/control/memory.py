"""Mussa-Ivaldi and Hogan's law with the tool force as a state: a control law with memory. [MIH91]"""

from __future__ import annotations

from functools import cache

import numpy as np

from ...base.arguments import made
from ...base.types import ArrayLike, Matrix, Vector, finite, frozen
from ...strategies import check_exact, check_regular, geometric_stiffness, gradient_and_stiffness
from ...strategies.constraints import Cost
from ...strategies.tasks.task import Task
from ...symbolic import SX, Function, factorise, runge_kutta, symbol, vertcat
from ...symbolic.null_space import null_space_expression
from .control_law import ControlLaw, Step


@made
def impedance_with_memory(
    task: Task, potential: Cost, force: ArrayLike | None = None, *, name: str = "impedance with memory"
) -> ControlLaw:
    """dq = W(F) J^T F', F' = (J W(F) J^T)^-1 x', W(F) = (K - Gamma(F))^-1: variant (iii) of theory 2d.

    The force F at the tool is carried along. tau_0 = grad U - J^T F never changes, so the law is the extended Jacobian
    of the potential U - tau_0 . q: it is holonomic from every start, but which leaves it has depends on the start.
    Each step is one Runge-Kutta step of order 4 of (q, F).

    Args:
        potential: U with Hess U = K.
        force: F (m,) at the start of every run; zero by default.

    Raises:
        ArgumentError: a task whose J is not df/dq (a twist). ShapeError: the force has not m entries.
    """
    check_exact(task)
    first = np.zeros(task.m) if force is None else frozen(finite("the force", force, (task.m,)))

    @cache
    def functions() -> tuple[Function, Function]:
        q, F, dx = symbol("q", task.n), symbol("F", task.m), symbol("dx", task.m)
        k = task.kinematics(q)
        J = task.jacobian_expression(k, q)
        stiffness = gradient_and_stiffness(task, k, q, potential)[1] - geometric_stiffness(task, k, q)(q, F)
        extended = factorise(vertcat(J, null_space_expression(J).T @ stiffness))
        dq = extended.solve(vertcat(dx, SX.zeros(task.n - task.m, 1)))
        dF = factorise(J.T).solve(stiffness @ dq)  # J^T F' = (K - Gamma) dq, since tau_0 stays
        outputs = {
            "dq": dq,
            "dF": dF,
            "rcond": extended.rcond(),
            "margin": task.margin_expression(k.rotation),
        }
        R, twist = task.target_symbols()[1], symbol("twist", 6 * task.frames)
        rates = Function("wanted", {"R": R, "twist": twist}, {"dx": task.rates_expression(R, *task.velocities(twist))})
        return Function("impedance", {"q": q, "F": F, "dx": dx}, outputs), rates

    def begin(q0: Vector) -> Step:
        flow, wanted = functions()
        F = first.copy()

        def step(q: Vector, pose: Matrix, twist: Vector, dt: float) -> Vector:
            nonlocal F

            def slope(y: Vector, dx: Vector) -> Vector:  # of y = (the motion since the start of the step, force)
                at = q + y[: task.n]
                dq, dF, rcond, margin = flow(at, y[task.n :], dx)
                check_regular(task, name, at, rcond, margin)
                return np.append(dq, dF)

            dx = np.atleast_1d(wanted(task.target(pose)[1], twist.ravel()))
            y = runge_kutta(slope, np.append(np.zeros(task.n), F), dt, dx, dx, dx)
            F = y[task.n :]
            return y[: task.n] / dt

        return step

    return ControlLaw(name, begin)
