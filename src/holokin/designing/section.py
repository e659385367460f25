"""A section of a workspace, sampled: the postures q(x) with phi(q) = zeta(x), zeta a polynomial, and their slopes.

phi (r rows) is a base constraint, u (d,) are the workspace's coordinates. On the leaf g = phi - zeta o f of level 0

    dq/dx P = [J; J_phi - zeta' J]^-1 [P; 0],      dq/dzeta = Z = [J; J_phi]^-1 [0; 1]

and det [J; J_g] = det [J; J_phi]: zeta adds no singularity (theory 7.1). A posture depends on zeta only through its value
at the own pose, so every cost of postures and slopes has its exact derivatives by the coefficients from Z and one
sweep back through the slopes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..motion.leaf import leaf_step
from ..strategies import HolonomicStrategy
from ..symbolic import SX, Function, dot, gradient, horzcat, symbol, vec
from ..tolerances import TOLERANCES
from ..types import Array, Matrix, Value, Vector
from .coordinates import Coordinates, values_and_slopes

NEWTONS = 8
"""Newton steps from a neighbouring posture: quadratic, so that four are enough where the leaf does not end."""

CLOSE = 1e-10
"""Correction [joint units] after which a posture is found."""

LONGEST = 0.5
"""A first correction [joint units] longer than this is not from a neighbour, and might lead to another branch."""


@dataclass(frozen=True)
class Sampled:
    """Postures Q (S, n) of a section, slopes G (S, n, d), Z (S, n, r), rcond (S,), and zeta's slopes A (S, r, d)."""

    Q: Matrix
    G: Array
    Z: Array
    rcond: Vector
    A: Array


@dataclass(frozen=True, eq=False)
class SectionSamples(Value):
    """Where a section is sampled: tool poses p (S, 3), R (S, 3, 3), the base law and the polynomial's terms."""

    base: HolonomicStrategy
    coordinates: Coordinates
    terms: list[tuple[int, ...]]
    p: Matrix
    R: Array
    u: Matrix

    @cached_property
    def basis(self) -> tuple[Matrix, Array]:
        """Monomials (S, t) and their slopes (S, t, d) per metre or radian."""
        values, slopes = values_and_slopes(self.u, self.terms)
        return values, slopes / self.coordinates.scale

    def at(self, coefficients: Matrix, near: Matrix) -> Sampled | None:
        """The section of coefficients (r, t), postures looked for from those nearby (S, n); None where one is lost."""
        values, slopes = self.basis
        t = coefficients.shape[1]
        Q = self.solve(values[:, :t] @ coefficients.T, near)
        if Q is None:
            return None
        A = np.einsum("rt,std->srd", coefficients, slopes[:, :t])
        G, Z, rcond = self._slopes.batch(Q, self._shaped(A))
        S, n, r = len(Q), Q.shape[1], len(coefficients)
        if not (np.isfinite(G).all() and rcond.min() > TOLERANCES.singular):
            return None
        return Sampled(Q, G.reshape(S, n, -1), Z.reshape(S, n, r), rcond, A)

    def solve(self, levels: Matrix, near: Matrix) -> Matrix | None:
        """Postures (S, n) with phi(q) = levels (S, r) at the poses, by Newton's method from those nearby."""
        step, Q = leaf_step(self.base), near
        for k in range(NEWTONS):
            dq = step.batch(Q, self.p, self.R, levels)[0]
            size = float(np.abs(dq).max())
            if not size < LONGEST:
                return None
            Q = Q + dq
            if size < CLOSE:
                return Q
        return None

    def slope(self, at: Sampled, Q: Array, G: Array, rcond: Array, t: int) -> Matrix:
        """Derivative (r, t) by the coefficients of a cost whose derivatives by postures, slopes and rcond are given."""
        by_q, by_A = self._back.batch(at.Q, self._shaped(at.A), self._shaped(G), rcond[:, None])
        values, slopes = self.basis
        by_level = np.einsum("snr,sn->sr", at.Z, Q + by_q.reshape(Q.shape))
        return by_level.T @ values[:, :t] + np.einsum("srd,std->rt", by_A.reshape(at.A.shape), slopes[:, :t])

    def _shaped(self, matrices: Array) -> Array:
        """Matrices (S, a, d) as a `Function` takes them: (S, a) where d = 1."""
        return matrices[:, :, 0] if matrices.shape[2] == 1 else matrices

    @cached_property
    def _expressions(self) -> tuple[dict[str, SX], SX, SX, SX]:
        e, c = self.base.expressions, self.coordinates
        J, P = c.chart.jacobian_expression(e.kinematics, e.q), SX(c.P)
        r, d = e.planes.shape[0], c.d
        A = symbol("A", r, d)
        tilted = replace(e, J=J, planes=e.planes - A @ (P.T @ J))
        wanted, along = horzcat(P, SX.zeros(J.shape[0], r)), horzcat(SX.zeros(r, d), SX.eye(r))
        found = tilted.rate(wanted, along, written_out=True)
        return {"q": e.q, "A": A}, found.X[:, :d], found.X[:, d:], found.rcond

    @cached_property
    def _slopes(self) -> Function:
        inputs, G, Z, rcond = self._expressions
        return Function("section", inputs, {"G": G, "Z": Z, "rcond": rcond})

    @cached_property
    def _back(self) -> Function:
        """(q, A, weights of G, weight of rcond) -> the derivatives of the weighted sum by q and by A."""
        inputs, G, _, rcond = self._expressions
        by_G, by_rcond = symbol("by_G", *G.shape), symbol("by_rcond", 1)
        total = dot(vec(by_G), vec(G)) + by_rcond * rcond
        outputs = {"by_q": gradient(total, inputs["q"]).T, "by_A": gradient(total, inputs["A"]).T}
        return Function("section_back", {**inputs, "by_G": by_G, "by_rcond": by_rcond}, outputs)

