"""`design`: the best section of a workspace, as an ordinary strategy with leaves (theory 7.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arguments import made, typed
from ..constraints import Constraint, linear
from ..errors import ArgumentError, HolokinError
from ..motion import inverse
from ..robot import Kinematics
from ..strategies import HolonomicStrategy, holonomic
from ..symbolic import SX
from ..symbolic.null_space import null_space
from ..task import Task
from ..types import Array, ArrayLike, Matrix, Value, Vector, frozen, whole
from .coordinates import Coordinates, chart_of, coordinates_of, exponents, monomials
from .descent import descend
from .objectives import Costs, Objective, as_objective, costs_of
from .section import Sampled, SectionSamples


@made
def tilted_by(
    task: Task, base: Constraint, coordinates: Coordinates, coefficients: ArrayLike, *, name: str = "designed"
) -> HolonomicStrategy:
    """The strategy with the leaves g(q) = phi(q) - zeta(u(f(q))), zeta a polynomial of the tool pose.

    Args:
        base: phi, r rows. coefficients: (r, t) of the monomials of u by increasing degree, the constant first.
    """
    C = frozen(np.asarray(coefficients, dtype=float))
    degree = 0
    while len(exponents(coordinates.d, degree)) < C.shape[1]:
        degree += 1
    terms = exponents(coordinates.d, degree)

    def expression(bound: Task, k: Kinematics, q: SX) -> SX:
        return base.expand(bound, k, q) - SX(C) @ monomials(coordinates.expression(k), terms)

    return holonomic(task, Constraint(name, base.rows, expression, base.angular, base.margin))


@dataclass(frozen=True, eq=False)
class Design(Value):
    """The best section found."""

    strategy: HolonomicStrategy
    start: Vector
    coefficients: Matrix
    values: tuple[float, ...]
    before: float
    samples: int
    reached: int


@typed
def design(
    task: Task,
    workspace: object,
    start: ArrayLike,
    *,
    objective: Objective | str = "squared_speed",
    base: Constraint | None = None,
    degree: int = 2,
    samples: int = 256,
    seed: int = 0,
) -> Design:
    """The best section."""
    q0 = task.robot.checked(start, "the start posture")
    goal = as_objective(objective)
    phi = base or linear(null_space(task.jacobian(q0)).T, name="self-motion")
    law = holonomic(task, phi)
    middle = workspace.center
    center = inverse(law, q0)(middle)
    poses = workspace.poses(samples, seed)
    ik = inverse(law, center)
    Q, kept = [], []
    for i, pose in enumerate(poses):
        try:
            Q.append(ik(pose))
            kept.append(i)
        except HolokinError:
            continue
    Q = np.array(Q)
    chart = chart_of(task, middle[:3, :3])
    coordinates = coordinates_of(chart, Q)
    terms = exponents(coordinates.d, degree)
    section = SectionSamples(law, coordinates, terms, poses[kept][:, :3, 3], poses[kept][:, :3, :3], coordinates.at(Q))
    costs = costs_of(task.robot, goal, coordinates.turns, coordinates.spread)
    first = np.zeros((phi.rows, len(terms)))
    first[:, 0] = law.g(center)
    at = section.at(first, Q)
    scale = {name: costs.known[name](at.Q, at.G, at.rcond).value for name in goal.weights}
    values, slopes = section.basis
    s = slopes * coordinates.scale
    metric = (values.T @ values + np.einsum("std,sud->tu", s, s)) / len(Q)
    white = np.linalg.inv(np.linalg.cholesky(metric))  # coefficients = x @ white, rows of white triangular

    def cost(x, near):
        X = x.reshape(phi.rows, -1)
        t = X.shape[1]
        at = section.at(X @ white[:t, :t], near)
        if at is None:
            return None
        total = 0.0
        by = [np.zeros_like(at.Q), np.zeros_like(at.G), np.zeros(len(at.Q))]
        for name, w in goal.weights.items():
            one = costs.known[name](at.Q, at.G, at.rcond)
            total += w * one.value
            by = [b + w * v for b, v in zip(by, (one.Q, one.G, one.rcond))]
        return total, (section.slope(at, *by, t) @ white[:t, :t].T).ravel(), at.Q

    C, found, values_ = first[:, :1], [], []
    near = Q
    for k in range(degree + 1):
        t = len(exponents(coordinates.d, k))
        C = np.pad(C, ((0, 0), (0, t - C.shape[1])))
        x = C @ np.linalg.inv(white[:t, :t])
        x, value, near = descend(cost, x.ravel(), near)
        C = x.reshape(phi.rows, t) @ white[:t, :t]
        values_.append(value)
    strategy = tilted_by(task, phi, coordinates, C)
    return Design(strategy, inverse(strategy, near[0])(middle), C, tuple(values_), scale, samples, len(Q))
