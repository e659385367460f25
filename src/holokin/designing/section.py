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
from .coordinates import Coordinates, Terms, values_and_slopes
from .objectives import Slopes

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
class TiltedLeaves(Value):
    """The leaves of a base law, tilted along the coordinates of a workspace: slopes of sections, and derivatives."""

    base: HolonomicStrategy
    coordinates: Coordinates

    def slopes(self, Q: Matrix, A: Array) -> Sampled:
        """The sections through postures (S, n) with zeta' = A (S, r, d) [per metre or radian], unchecked."""
        G, Z, rcond = self._slopes.batch(Q, _given(A))
        return Sampled(Q, G.reshape(*Q.shape, A.shape[2]), Z.reshape(*Q.shape, A.shape[1]), rcond, A)

    def back(self, at: Sampled, by_G: Array, by_rcond: Vector) -> tuple[Matrix, Array]:
        """Derivatives by Q (S, n) and by A (S, r, d) of a cost whose derivatives by G and rcond are given."""
        by_q, by_A = self._back.batch(at.Q, _given(at.A), _given(by_G), by_rcond[:, None])
        return by_q, by_A.reshape(at.A.shape)

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
        inputs, G, _, rcond = self._expressions
        by_G, by_rcond = symbol("by_G", *G.shape), symbol("by_rcond", 1)
        total = dot(vec(by_G), vec(G)) + by_rcond * rcond
        outputs = {"by_q": gradient(total, inputs["q"]).T, "by_A": gradient(total, inputs["A"]).T}
        return Function("section_back", {**inputs, "by_G": by_G, "by_rcond": by_rcond}, outputs)


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

    def at(self, coefficients: Matrix, near: Matrix) -> Sampled | None:
        """The section of coefficients (r, t), postures looked for from those nearby (S, n); None where one is lost."""
        values, slopes = self.basis
        t = coefficients.shape[1]
        Q = self._solve(values[:, :t] @ coefficients.T, near)
        if Q is None:
            return None
        found = self.leaves.slopes(Q, np.einsum("rt,std->srd", coefficients, slopes[:, :t]))
        sound = np.isfinite(found.G).all() and found.rcond.min() > TOLERANCES.singular
        return found if sound else None

    def slope(self, at: Sampled, cost: Slopes, t: int) -> Matrix:
        """Derivative (r, t) of a cost by the coefficients."""
        by_q, by_A = self.leaves.back(at, cost.G, cost.rcond)
        values, slopes = self.basis
        by_level = np.einsum("snr,sn->sr", at.Z, cost.Q + by_q)
        return by_level.T @ values[:, :t] + np.einsum("srd,std->rt", by_A, slopes[:, :t])

    def _solve(self, levels: Matrix, near: Matrix) -> Matrix | None:
        """Postures (S, n) with phi(q) = levels (S, r) at the poses, by Newton's method from those nearby."""
        step, Q = leaf_step(self.leaves.base), near
        for _ in range(NEWTONS):
            dq = step.batch(Q, self.p, self.R, levels)[0]
            size = float(np.abs(dq).max())
            if not size < LONGEST:
                return None
            Q = Q + dq
            if size < CLOSE:
                return Q
        return None


def _given(matrices: Array) -> Array:
    """Matrices (S, a, d) as a `Function` takes them: (S, a) where d = 1."""
    return matrices[:, :, 0] if matrices.shape[2] == 1 else matrices
