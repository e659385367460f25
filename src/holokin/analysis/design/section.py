"""A section of a workspace, sampled: the postures q(x) with phi(q) = zeta(x), zeta a polynomial, and their slopes.

phi (r rows) is a base constraint, u (d,) are the workspace's coordinates. On the leaf g = phi - zeta o f of level 0

    dq/dx P = [J; J_phi - zeta' J]^-1 [P; 0],      dq/dzeta = Z = [J; J_phi]^-1 [0; 1]

and det [J; J_g] = det [J; J_phi]: zeta adds no singularity (theory 2e). A posture depends on zeta only through its
value at the own pose, so every cost of postures and slopes has its exact derivatives by the coefficients from Z and one
sweep back through J and J_phi.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.errors import SingularityError, SingularityKind
from ...base.types import Array, Flags, Indices, Matrix, Value, Vector
from ...motion.checks.motion_checks import Clearances
from ...motion.ik.leaf import leaf_step
from ...motion.self_motions.posture_search import newton
from ...strategies import HolonomicStrategy
from ...strategies.right_inverses import Terms, monomials_up_to
from ...symbolic import Function, dot, gradient, symbol, vec
from ..coverage.pose_coordinates import Coordinates, values_and_slopes
from .objectives import Costs, Slopes

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult


@dataclass(frozen=True, eq=False)
class Sampled(Value):
    """Postures Q (S, n) of a section with levels zeta (S, r) and slopes A (S, r, d) of zeta.

    M (S, n, n) is [J; J_phi - A P^T J]; X (S, n, m) and Z (S, n, r) are the columns of its inverse, G = X P (S, n, d).
    """

    Q: Matrix
    levels: Matrix
    A: Array
    M: Array
    X: Array
    Z: Array
    G: Array


@dataclass(frozen=True, eq=False)
class TiltedLeaves(Value):
    """The leaves of a base strategy, tilted along the coordinates of a workspace: slopes of sections, and
    derivatives."""

    base: HolonomicStrategy
    coordinates: Coordinates

    def slopes(self, Q: Matrix, A: Array, levels: Matrix | None = None) -> Sampled | None:
        """The sections through postures (S, n), zeta' = A (S, r, d) [per metre or radian]; None if one is singular."""
        P, (S, r, _) = self.coordinates.P, A.shape
        J, planes = (rows.reshape(S, -1, Q.shape[1]) for rows in self._rows.batch(Q))
        M = np.concatenate([J, planes - A @ (P.T @ J)], axis=1)
        try:
            inverse = np.linalg.inv(M)
        except np.linalg.LinAlgError:
            return None
        if not np.isfinite(inverse).all():
            return None
        X, Z = inverse[:, :, :-r], inverse[:, :, -r:]
        return Sampled(Q, np.zeros((S, r)) if levels is None else levels, A, M, X, Z, X @ P)

    def through(self, Q: Matrix, A: Array, levels: Matrix | None = None) -> Sampled:
        """The same. Raises: SingularityError at a singular posture."""
        sampled = self.slopes(Q, A, levels)
        if sampled is None:
            self.base.batch(Q)
            raise SingularityError(SingularityKind.REPRESENTATION, Q[0], self.coordinates.chart.name, 0.0)
        return sampled

    def back(self, sampled: Sampled, by_G: Array) -> tuple[Matrix, Array]:
        """Derivatives by Q (S, n) and by A (S, r, d) of a cost whose derivatives by G are given.

        M G = [P; 0] gives dG = -M^-1 dM G, so the cost's derivative by M is -M^-T by_G G^T, and that by the posture is
        one sweep back through J and J_phi alone.
        """
        P, r, GT = self.coordinates.P, sampled.A.shape[1], np.swapaxes(sampled.G, 1, 2)
        by_J, by_rows = (-np.swapaxes(columns, 1, 2) @ by_G @ GT for columns in (sampled.X, sampled.Z))
        PJ = P.T @ sampled.M[:, :-r]
        by_J = by_J - P @ np.swapaxes(sampled.A, 1, 2) @ by_rows
        by_Q = self._turning.batch(sampled.Q, by_J, by_rows)
        return by_Q, -by_rows @ np.swapaxes(PJ, 1, 2)

    @cached_property
    def _rows(self) -> Function:
        looped = self.base.looped
        e = looped.expressions
        J = self.coordinates.chart.jacobian_expression(e.kinematics, e.q)
        return Function("rows", {"q": e.q}, {"J": J, "planes": e.planes}, None, looped.transport)

    @cached_property
    def _turning(self) -> Function:
        """(q, weights of J, weights of J_phi) -> the derivative by q of their weighted sum."""
        e = self.base.expressions
        J = self.coordinates.chart.jacobian_expression(e.kinematics, e.q)
        by_J, by_planes = symbol("by_J", *J.shape), symbol("by_planes", *e.planes.shape)
        total = dot(vec(by_J), vec(J)) + dot(vec(by_planes), vec(e.planes))
        inputs = {"q": e.q, "by_J": by_J, "by_planes": by_planes}
        return Function("turning", inputs, {"by_q": gradient(total, e.q).T})


@dataclass(frozen=True, eq=False)
class SectionSamples(Value):
    """The tool poses p (S, 3), R (S, 3, 3) at which a section is sampled, u (S, d) in the workspace's coordinates."""

    leaves: TiltedLeaves
    terms: Terms
    p: Matrix
    R: Array
    u: Matrix

    @cached_property
    def basis(self) -> tuple[Matrix, Array]:
        """Monomials (S, t) and their slopes (S, t, d) per metre or radian."""
        values, slopes = values_and_slopes(self.u, self.terms)
        return values, slopes / self.leaves.coordinates.scale

    def at(self, coefficients: Matrix, near: Sampled) -> Sampled | None:
        """The section of coefficients (r, t), looked for from one nearby; None where a posture is lost."""
        values, slopes = self.basis
        t = coefficients.shape[1]
        levels = values[:, :t] @ coefficients.T
        Q = self._solve(levels, near.Q + np.einsum("snr,sr->sn", near.Z, levels - near.levels))
        if Q is None:
            return None
        return self.leaves.slopes(Q, np.einsum("rt,std->srd", coefficients, slopes[:, :t]), levels)

    def through(self, Q: Matrix, coefficients: Matrix) -> Sampled:
        """The section of coefficients (r, t) at postures (S, n) that are on it. Raises: SingularityError."""
        values, slopes = self.basis
        t = coefficients.shape[1]
        A = np.einsum("rt,std->srd", coefficients, slopes[:, :t])
        return self.leaves.through(Q, A, values[:, :t] @ coefficients.T)

    def slope(self, sampled: Sampled, cost: Slopes, t: int) -> Matrix:
        """Derivative (r, t) of a cost by the coefficients."""
        by_q, by_A = self.leaves.back(sampled, cost.G)
        values, slopes = self.basis
        by_level = np.einsum("snr,sn->sr", sampled.Z, cost.Q + by_q)
        return by_level.T @ values[:, :t] + np.einsum("srd,std->rt", by_A, slopes[:, :t])

    def _solve(self, levels: Matrix, near: Matrix) -> Matrix | None:
        """Postures (S, n) with phi(q) = levels (S, r) at the poses, by Newton's method from those nearby."""
        step = leaf_step(self.leaves.base)

        def correct(q: Matrix, i: Indices) -> tuple[Matrix, Flags]:
            dq = step.batch(q, self.p[i], self.R[i], levels[i])[0]
            return dq, np.abs(dq).max(axis=1) < 0.5  # a longer one is not from a neighbour, and might change the branch

        # Quadratic, so that four steps are enough where the leaf does not end
        Q, arrived = newton(correct, near, steps=8, exact=1e-6)
        return Q if arrived.all() else None


# --- Least cost over a few dozen numbers, of a cost that may end: SciPy's BFGS before a wall. [NW06]
#
# Where a posture is not found the cost says None. There a wall stands: a value that rises away from the last point, so
# that the search along a line turns back.

Cost = Callable[[Vector, Any], "tuple[float, Vector, Any] | None"]
"""(x, state of a point nearby) -> (value, slope, state), or None where it is not defined."""


def descend(cost: Cost, x: Vector, state: Any) -> tuple[Vector, float, Any]:
    """(x, value, state) of a local least cost near x. The cost must be defined at x."""
    from scipy.optimize import minimize

    result = cost(x, state)
    if result is None:
        return x, np.inf, state
    best, (value, slope, state), small, tried = x, result, 0, {x.tobytes(): result}
    # The first step has a length of 0.1 at most
    scale = max(1.0, float(np.linalg.norm(slope)) / 0.1)

    def walled(y: Vector) -> tuple[float, Vector]:
        """The cost, or a wall whose height and slope are ten times the value at the last point."""
        new = cost(y, state)
        if new is not None:
            tried[y.tobytes()] = new
            return new[0] / scale, new[1] / scale
        height, away = 1.0 + 10.0 * abs(value), y - best
        far = float(np.linalg.norm(away)) or 1.0
        return (value + height * (1.0 + far)) / scale, height * away / (far * scale)

    def keep(intermediate_result: OptimizeResult) -> None:
        """Keep a point; two steps one after another that gain less than 1e-9 are the last, and so is one to a wall."""
        nonlocal best, value, state, small
        new = tried.get(intermediate_result.x.tobytes())
        if new is None:
            raise StopIteration
        small = small + 1 if value - new[0] <= 1e-9 * abs(value) else 0
        best, (value, _, state) = intermediate_result.x.copy(), new
        tried.clear()
        if small >= 2:
            raise StopIteration

    # Designs of our tests take 10 to 60 steps
    minimize(walled, x, jac=True, method="BFGS", callback=keep, options={"maxiter": 200, "gtol": 0.0})
    return best, value, state


# --- The search behind `design`: coefficients of the polynomial that make the objective least, within hard limits.

OVER = 1.2
"""What limits are narrowed by, over what was beyond them."""

KEPT = 2e-4
"""Violation [share of half a joint's range] that counts as none; limits are narrowed by as much."""

SHORT = 0.1
"""Distance [m] by which two shapes may be too near that counts as half of a joint's range; pairs that are farther apart
than asked by as much are not looked at."""


@dataclass(frozen=True, eq=False)
class Limits(Value):
    """Hard limits: allowed |q - middle| / half (n,) or (S, n), inf for none.

    apart: P pairs of shapes that keep the distances wanted there, and `more` (P,) [m].
    """

    allowed: Array
    apart: Clearances | None = None
    more: Array = field(default_factory=lambda: np.zeros(0))

    def narrowed(self, over: Vector, nearer: Vector) -> Limits:
        """Narrower by what was beyond them (n,), and by what shapes were too near (P,) [m]."""
        allowed = self.allowed - OVER * np.maximum(over, 0.0)
        return Limits(allowed, self.apart, self.distances + OVER * np.maximum(nearer, 0.0) - self._wanted)

    @property
    def _wanted(self) -> Vector:
        return np.zeros(0) if self.apart is None else self.apart.limits

    @property
    def distances(self) -> Vector:
        """What each pair of shapes keeps (P,) [m]."""
        return self._wanted + self.more if self.more.size else self._wanted

    def nearer(self, Q: Matrix) -> Matrix:
        """By how much pairs of shapes are too near at postures (k, n) -> (k, P) [m]."""
        return np.zeros((len(Q), 0)) if self.apart is None else self.distances - self.apart.distances(Q)

    def nearer_slopes(self, Q: Matrix) -> tuple[Matrix, Array]:
        """The same, -inf where they are `SHORT` farther apart than asked, and the derivatives (k, P, n)."""
        if self.apart is None:
            return np.zeros((len(Q), 0)), np.zeros((len(Q), 0, Q.shape[1]))
        wanted = self.distances
        distances, slopes = self.apart.slopes(Q, float(wanted.max()) + SHORT)
        return wanted - distances, -slopes

    @property
    def none(self) -> bool:
        """True where nothing is limited."""
        return not np.isfinite(self.allowed).any() and self.apart is None


@dataclass(frozen=True, eq=False)
class Search(Value):
    """A section's samples, the weights and scales of its costs, and its limits.

    near: the section with a constant zeta.
    """

    section: SectionSamples
    costs: Costs
    weights: dict[str, float]
    limits: Limits
    near: Sampled

    def cost(self, sampled: Sampled) -> Slopes:
        """The objective at a section, with its derivatives."""
        total = Slopes(0.0, np.zeros_like(sampled.Q), np.zeros_like(sampled.G))
        for name, weight in self.weights.items():
            total = total.plus(self.costs.known[name](sampled.Q, sampled.G), weight)
        return total

    def violations(self, sampled: Sampled) -> tuple[Array, Array, Array]:
        """(S, n + P) numbers that must not be above 0, and the derivatives of the joints' and the pairs' by q."""
        off = (sampled.Q - self.costs.middle) / self.costs.half
        over = np.abs(off) - self.limits.allowed + KEPT
        near, slopes = self.limits.nearer_slopes(sampled.Q)
        violations = np.column_stack([np.maximum(over, -1.0), np.maximum(near / SHORT + KEPT, -1.0)])
        return violations, np.sign(off) / self.costs.half, slopes / SHORT

    def best(self, first: Matrix, degree: int) -> tuple[Matrix, Sampled, tuple[float, ...]]:
        """(coefficients (r, t), their section, the least cost with each degree), from those of a lower degree."""
        no_push = np.zeros((len(self.near.Q), self.near.Q.shape[1] + len(self.limits.distances)))
        # To begin with squares of violated limits, shares of half a joint's range, weigh 500 beside costs of 1
        coefficients, near, values, start = first, self.near, [], (no_push, 500.0)
        for k in range(degree + 1):
            t = len(monomials_up_to(self.section.leaves.coordinates.d, k))
            if t < first.shape[1]:
                continue
            coefficients = np.pad(coefficients, ((0, 0), (0, t - coefficients.shape[1])))
            coefficients, near, start = self._within_limits(coefficients, near, start)
            values.append(self.cost(near).value)
        return coefficients, near, tuple(values)

    def _within_limits(
        self, first: Matrix, near: Sampled, start: tuple[Matrix, float]
    ) -> tuple[Matrix, Sampled, tuple[Matrix, float]]:
        """The best coefficients (r, t) within the limits, their section, and the multipliers and penalty to go on with.

        Where the limits cannot be kept, those that violate them least.
        """
        r, t = first.shape
        white = self._whitening[:t, :t]
        x, (multipliers, penalty), before = (first @ np.linalg.inv(white)).ravel(), start, np.inf
        # At most eight changes of the multipliers: three to six bring violations below `KEPT`
        for _ in range(8):
            x, _, near = descend(self._augmented(r, t, multipliers, penalty), x, near)
            if self.limits.none:
                break
            over, _, _ = self.violations(near)
            worst = float(over.max())
            if worst <= KEPT and float(np.abs(multipliers * over).max()) <= KEPT:
                return x.reshape(r, t) @ white, near, (multipliers, penalty)
            multipliers = np.maximum(0.0, multipliers + penalty * over)
            if worst > 0.99 * before:  # the limits cannot be kept
                break
            penalty *= 8.0 if worst > before / 2 else 1.0
            before = worst
        return x.reshape(r, t) @ white, near, start

    def _augmented(self, r: int, t: int, multipliers: Matrix, penalty: float) -> Cost:
        """The objective and the penalty of violated limits, over whitened coefficients."""
        white, size = self._whitening[:t, :t], self._size

        def cost(x: Vector, near: Sampled) -> tuple[float, Vector, Sampled] | None:
            sampled = self.section.at(x.reshape(r, t) @ white, near)
            if sampled is None:
                return None
            total = self.cost(sampled).plus(self._penalty(sampled, multipliers, penalty), size)
            slope = self.section.slope(sampled, total, t)
            return total.value, (slope @ white.T).ravel(), sampled

        return cost

    @cached_property
    def _size(self) -> float:
        """The objective to begin with; 1 where that is 0."""
        return self.cost(self.near).value or 1.0

    def _penalty(self, sampled: Sampled, multipliers: Matrix, penalty: float) -> Slopes:
        """sum max(0, multiplier + penalty over)^2 / (2 penalty). [NW06, section 17.3]"""
        if self.limits.none:
            return Slopes(0.0)
        over, by_q, by_near = self.violations(sampled)
        push, n = np.maximum(0.0, multipliers + penalty * over), sampled.Q.shape[1]
        value = float(np.sum(push**2) - np.sum(multipliers**2)) / (2 * penalty)
        pushed = push[:, :n] * by_q + np.einsum("sp,spn->sn", push[:, n:], by_near)
        return Slopes(value, Q=pushed)

    @cached_property
    def _whitening(self) -> Matrix:
        """A lower triangle: in x with coefficients = x times it, values and slopes of zeta count alike.

        The first of x touch the first monomials only, so a lower degree has the first of them.
        """
        values, slopes = self.section.basis
        slopes = slopes * self.section.leaves.coordinates.scale
        metric = (values.T @ values + np.einsum("std,sud->tu", slopes, slopes)) / len(values)
        return np.linalg.inv(np.linalg.cholesky(metric + 1e-12 * np.eye(len(metric))))
