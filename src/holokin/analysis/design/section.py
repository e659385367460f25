"""A section of a workspace, sampled: the postures q(x) with phi(q) = zeta(x), zeta a polynomial, and their slopes.

phi (r rows) is a base constraint, u (d,) are the workspace's coordinates. On the leaf g = phi - zeta o f of level 0

    dq/dx P = [J; J_phi - zeta' J]^-1 [P; 0],      dq/dzeta = Z = [J; J_phi]^-1 [0; 1]

and det [J; J_g] = det [J; J_phi]: zeta adds no singularity (theory 2e). A posture depends on zeta only through its
value at the own pose, so every cost of postures and slopes has its exact derivatives by the coefficients from Z and one
sweep back through J and J_phi.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.errors import SingularityError, SingularityKind
from ...base.types import Array, Flags, Indices, Matrix, Value, Vector
from ...motion.ik.leaf import leaf_step
from ...motion.ik.newton import newton
from ...strategies import HolonomicStrategy
from ...strategies.polynomial import Terms
from ...symbolic import Function, dot, gradient, symbol, vec
from ..coverage.coordinates import Coordinates, values_and_slopes
from .objectives import Slopes

NEWTONS = 8
"""Newton steps from a neighbouring posture: quadratic, so that four are enough where the leaf does not end."""

CLOSE = 1e-6
"""Correction [joint units] after which a posture is found: the next one would be of the order of its square."""

LONGEST = 0.5
"""A correction [joint units] longer than this is not from a neighbour, and might lead to another branch."""


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

    @cached_property
    def rcond(self) -> Vector:
        """min |R_kk| / max |R_kk| (S,) of M = QR, its constraint rows scaled to length 1, as strategies tell it."""
        return self._least / self._greatest

    @property
    def rcond_slope(self) -> Array:
        """Derivative of rcond by M (S, n, n): d log R_kk = q_k^T dM R^-1 e_k, q_k the column of Q."""
        Q, R, size = self._factors
        every, back, out = np.arange(len(R)), np.linalg.inv(R), np.zeros_like(R)
        for k, sign in ((self._diagonal.argmin(axis=1), 1.0), (self._diagonal.argmax(axis=1), -1.0)):
            out += sign * Q[every, :, k][:, :, None] * back[every, :, k][:, None, :]
        r = self.A.shape[1]
        unit = self.M[:, -r:] / size
        out[:, -r:] = (out[:, -r:] - np.sum(out[:, -r:] * unit, axis=2, keepdims=True) * unit) / size
        return self.rcond[:, None, None] * out

    @cached_property
    def _factors(self) -> tuple[Array, Array, Array]:
        r = self.A.shape[1]
        size = np.linalg.norm(self.M[:, -r:], axis=2, keepdims=True)
        Q, R = np.linalg.qr(np.concatenate([self.M[:, :-r], self.M[:, -r:] / size], axis=1))
        return Q, R, size

    @cached_property
    def _diagonal(self) -> Matrix:
        return np.abs(np.diagonal(self._factors[1], axis1=1, axis2=2))

    @property
    def _least(self) -> Vector:
        return self._diagonal.min(axis=1)

    @property
    def _greatest(self) -> Vector:
        return self._diagonal.max(axis=1)


@dataclass(frozen=True, eq=False)
class TiltedLeaves(Value):
    """The leaves of a base law, tilted along the coordinates of a workspace: slopes of sections, and derivatives."""

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
        found = self.slopes(Q, A, levels)
        if found is None:
            self.base.batch(Q)
            raise SingularityError(SingularityKind.REPRESENTATION, Q[0], self.coordinates.chart.name, 0.0)
        return found

    def back(self, at: Sampled, by_G: Array, by_rcond: Vector) -> tuple[Matrix, Array]:
        """Derivatives by Q (S, n) and by A (S, r, d) of a cost whose derivatives by G and rcond are given.

        M G = [P; 0] gives dG = -M^-1 dM G, so the cost's derivative by M is -M^-T by_G G^T, and that by the posture is
        one sweep back through J and J_phi alone.
        """
        P, r, GT = self.coordinates.P, at.A.shape[1], np.swapaxes(at.G, 1, 2)
        by_J, by_rows = (-np.swapaxes(columns, 1, 2) @ by_G @ GT for columns in (at.X, at.Z))
        if by_rcond.any():
            by_M = by_rcond[:, None, None] * at.rcond_slope
            by_J, by_rows = by_J + by_M[:, :-r], by_rows + by_M[:, -r:]
        PJ = P.T @ at.M[:, :-r]
        by_J = by_J - P @ np.swapaxes(at.A, 1, 2) @ by_rows
        by_Q = self._turning.batch(at.Q, by_J, by_rows)
        return by_Q, -by_rows @ np.swapaxes(PJ, 1, 2)

    @cached_property
    def _rows(self) -> Function:
        law = self.base.looped
        e = law.expressions
        J = self.coordinates.chart.jacobian_expression(e.kinematics, e.q)
        return Function("rows", {"q": e.q}, {"J": J, "planes": e.planes}, None, law.transport)

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

    def slope(self, at: Sampled, cost: Slopes, t: int) -> Matrix:
        """Derivative (r, t) of a cost by the coefficients."""
        by_q, by_A = self.leaves.back(at, cost.G, cost.rcond)
        values, slopes = self.basis
        by_level = np.einsum("snr,sn->sr", at.Z, cost.Q + by_q)
        return by_level.T @ values[:, :t] + np.einsum("srd,std->rt", by_A, slopes[:, :t])

    def _solve(self, levels: Matrix, near: Matrix) -> Matrix | None:
        """Postures (S, n) with phi(q) = levels (S, r) at the poses, by Newton's method from those nearby."""
        step = leaf_step(self.leaves.base)

        def correct(q: Matrix, i: Indices) -> tuple[Matrix, Flags]:
            dq = step.batch(q, self.p[i], self.R[i], levels[i])[0]
            return dq, np.abs(dq).max(axis=1) < LONGEST

        Q, arrived = newton(correct, near, steps=NEWTONS, exact=CLOSE)
        return Q if arrived.all() else None
