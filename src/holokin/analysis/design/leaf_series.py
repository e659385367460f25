"""Leaves g = phi + a series of the tool pose and phi over a joint region, and their distance from a given law.

The law of such leaves moves phi by -g_phi^-1 g_x dx, the given one by A dx; with Z = dq/dphi at a held tool the squared
distance is D = mean |Z (g_phi^-1 g_x + A)|_F^2 (see `closest_strategy`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.arguments import made
from ...base.errors import ArgumentError, posture_text
from ...base.types import Array, Matrix, Value, Vector
from ...robot import Kinematics
from ...strategies import HolonomicStrategy, Strategy, holonomic
from ...strategies.constraints import Constraint, formulas_of
from ...strategies.polynomial import monomials, monomials_up_to
from ...strategies.tasks.task import Task
from ...symbolic import SX, Function, cos, jacobian, sin, symbol, vertcat
from ..coverage.coordinates import Coordinates
from ..curvature import Deviation
from .bfgs import Cost, descend
from .section import TiltedLeaves

BARRIER = 1e-4
"""Weight of the mean of -log det g_phi, as a share of the least squares' distance: it moves the optimum by less."""

FOLDS = 1e-4
"""rcond of [J; J_phi] below which a base constraint folds in the region, and is no coordinate of it."""

FLAT = 1e-9
"""Singular values of the least squares' matrix, as a share of the greatest, below which terms are not told apart."""


@dataclass(frozen=True, eq=False)
class Series(Value):
    """g(x, phi) = phi + C b(u, w) (r,): terms b that vanish at u = 0.

    Without a period, monomials of u and w = (phi - middle) / scale; with one (r = 1), monomials of u times 1, cos(k w),
    sin(k w), w = 2 pi phi / period.
    """

    coordinates: Coordinates
    degree: int
    middle: Vector
    scale: Vector
    period: float | None
    coefficients: Matrix

    def basis(self, u: SX, phi: SX) -> SX:
        """b (t,) as an expression."""
        d = self.coordinates.d
        if self.period is None:
            terms = monomials_up_to(d + len(self.middle), self.degree)
            w = (phi - SX(self.middle)) / SX(self.scale)
            every = monomials(vertcat(u, w), terms)
            return every[[i for i, term in enumerate(terms) if any(v < d for v in term)]]
        w = 2 * np.pi / self.period * phi
        waves = [SX(1), *(f(k * w) for k in range(1, self.degree // 2 + 1) for f in (cos, sin))]
        powers = monomials(u, monomials_up_to(d, self.degree)[1:])
        return vertcat(*(powers * wave for wave in waves))

    def __call__(self, x: SX, phi: SX) -> SX:
        """g (r,) as an expression of the tool pose in the chart and the base constraint."""
        return phi + SX(self.coefficients) @ self.basis(self.coordinates.of(x), phi)


def series_over(
    law: HolonomicStrategy, coordinates: Coordinates, Q: Matrix, degree: int, period: float | None
) -> Series:
    """The series over postures (k, n) and the base law's phi, without coefficients yet."""
    phi = law.constraint_value.batch(Q).reshape(len(Q), law.constraint.rows)
    middle, scale = (phi.max(axis=0) + phi.min(axis=0)) / 2, np.ptp(phi, axis=0) / 2
    return Series(coordinates, degree, middle, scale, period, np.zeros((law.constraint.rows, 0)))


@made
def along_leaves(task: Task, base: Constraint, series: Series, *, name: str = "nearest") -> HolonomicStrategy:
    """The strategy with the leaves g(x, phi(q)) = const of a series."""

    def expression(bound: Task, k: Kinematics, q: SX) -> SX:
        return series(series.coordinates.chart.value_expression(k), base.expand(bound, k, q))

    constraint = Constraint(name, base.rows, expression, base.angular, base.margin, formulas=formulas_of([base]))
    return holonomic(task, constraint, name=name)


@dataclass(frozen=True, eq=False)
class SampledSeries(Value):
    """Postures of a region, in its coordinates: all that D needs, since they stay while the leaves change.

    J (S, m, n) of the task; X (S, n, d) and G (S, n, d), dq/dx along phi = const and along the given law; Z (S, n, r);
    A (S, r, d) = dphi/dx along the given law; by_u (S, t, d), by_phi (S, t, r): slopes of the terms; weights (d,).
    """

    Q: Matrix
    J: Array
    X: Array
    G: Array
    Z: Array
    A: Array
    by_u: Array
    by_phi: Array
    weights: Vector

    @classmethod
    def of(
        cls, strategy: Strategy, law: HolonomicStrategy, series: Series, weights: Vector, Q: Matrix
    ) -> SampledSeries:
        """Of a given law and a base law, at postures (S, n). Raises: SingularityError; ArgumentError: phi folds."""
        c, r, S = series.coordinates, law.constraint.rows, len(Q)
        at = TiltedLeaves(law, c).slopes(Q, np.zeros((S, r, c.d)))
        if at is None or not at.rcond.min() > FOLDS:
            rcond = law.gain.batch(Q)[1]
            what = f"rcond of the base constraint at q = {posture_text(Q[int(np.argmin(rcond))])}"
            raise ArgumentError(what, float(rcond.min()), "give another base, or a smaller region")
        J = strategy.task.jacobian_batch(Q)[0]
        G = strategy.batch(Q) @ (J @ at.G)
        ZT = np.swapaxes(at.Z, 1, 2)
        A = np.asarray(np.linalg.solve(ZT @ at.Z, ZT @ (G - at.G)), dtype=float)
        u, phi = symbol("u", c.d), symbol("phi", r)
        b = series.basis(u, phi)
        slopes = Function("series", {"u": u, "phi": phi}, {"by_u": jacobian(b, u), "by_phi": jacobian(b, phi)})
        by_u, by_phi = slopes.batch(c.at(Q), law.constraint_value.batch(Q).reshape(S, r))
        t = b.shape[0]
        return cls(Q, J, at.G, G, at.Z, A, by_u.reshape(S, t, c.d) / c.scale, by_phi.reshape(S, t, r), weights)

    def of_law(self, law: Strategy) -> Array:
        """dq/dx (S, n, d) of another law. Raises: SingularityError."""
        return law.batch(self.Q) @ (self.J @ self.X)

    def off(self, C: Matrix) -> tuple[Array, Vector]:
        """(what the law of a series adds to the given one (S, n, d), det g_phi (S,))."""
        M, slopes = self._leaves(C)
        return self.Z @ (slopes - self.A), np.linalg.det(M)

    def deviation(self, off: Array) -> Deviation:
        """The deviation of a law that adds so much."""
        away, size = (np.sum((a * self.weights) ** 2, axis=(1, 2)) for a in (off, self.G))
        speed = np.sum(((self.G + off) * self.weights) ** 2)
        return Deviation(
            float(np.sqrt(away.sum() / size.sum())), float(np.sqrt((away / size).max())), float(speed / size.sum() - 1)
        )

    def _leaves(self, C: Matrix) -> tuple[Array, Array]:
        """(g_phi (S, r, r), dphi/dx along the leaves (S, r, d))."""
        M = np.eye(len(C)) + np.einsum("rt,stk->srk", C, self.by_phi)
        with np.errstate(all="ignore"):
            return M, -np.linalg.solve(M, np.einsum("rt,std->srd", C, self.by_u))

    @cached_property
    def _metric(self) -> Array:
        """Z^T Z (S, r, r): what a difference of dphi/dx counts in joint motion."""
        return np.swapaxes(self.Z, 1, 2) @ self.Z

    @cached_property
    def _linear(self) -> tuple[Matrix, Vector]:
        """(white (r t, k), x (k,)): coefficients white x make |Z (g_x + g_phi A)| least, whose matrix white makes 1."""
        S, r, d = self.A.shape
        root = np.swapaxes(np.linalg.cholesky(self._metric), 1, 2)
        terms = (self.by_u + self.by_phi @ self.A) * self.weights
        rows = np.einsum("sak,std->sadkt", root, terms).reshape(S * r * d, -1) / np.sqrt(S)
        wanted = -(root @ (self.A * self.weights)).ravel() / np.sqrt(S)
        left, sizes, right = np.linalg.svd(rows, full_matrices=False)
        kept = sizes > FLAT * sizes[0]
        return right[kept].T / sizes[kept], left.T[kept] @ wanted

    @property
    def white(self) -> Matrix:
        """Coefficients (r t, k) by the numbers x (k,) that the search is over."""
        return self._linear[0]

    def coefficients(self, x: Vector) -> Matrix:
        """(r, t) of the numbers of the search."""
        return (self.white @ x).reshape(self.A.shape[1], -1)

    def cost(self, barrier: float) -> Cost:
        """D - barrier mean log det g_phi over the numbers of the search; None where g_phi turns."""
        S = len(self.A)

        def cost(x: Vector, _near: None) -> tuple[float, Vector, None] | None:
            M, slopes = self._leaves(self.coefficients(x))
            sign, size = np.linalg.slogdet(M)
            if not (sign > 0).all():
                return None
            off = slopes - self.A
            weighted = self._metric @ off * self.weights**2
            back = np.linalg.solve(np.swapaxes(M, 1, 2), 2 * weighted)
            by_M = -back @ np.swapaxes(slopes, 1, 2) - barrier * np.swapaxes(np.linalg.inv(M), 1, 2)
            by_C = np.einsum("srk,stk->rt", by_M, self.by_phi) - np.einsum("srd,std->rt", back, self.by_u)
            value = float(np.sum(off * weighted) - barrier * size.sum()) / S
            return value, by_C.ravel() @ self.white / S, None

        return cost

    def best(self) -> tuple[Matrix, tuple[float, float]]:
        """(coefficients (r, t) of the least D, rms deviations after the least squares and in the end)."""
        x = self._linear[1]
        while self.cost(0.0)(x, None) is None:
            x = x / 2
        first = self.deviation(self.off(self.coefficients(x))[0]).rms
        barrier = BARRIER * float(np.sum((first * self.G * self.weights) ** 2) / len(self.G))
        C = self.coefficients(descend(self.cost(barrier), x, None)[0])
        return C, (first, self.deviation(self.off(C)[0]).rms)
