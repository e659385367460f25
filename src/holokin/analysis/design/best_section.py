"""The search behind `design`: coefficients of the polynomial that make the objective least, within hard limits."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ...base.types import Array, Matrix, Value, Vector
from ...motion.checks.keeping_clear import Clearances
from ...strategies.polynomial import monomials_up_to
from .bfgs import Cost, descend
from .objectives import Costs, Slopes
from .section import Sampled, SectionSamples

PENALTY = 500.0
"""Weight of the squares of violated limits, shares of half a joint's range, beside costs of 1, to begin with."""

HARDER = 8.0
"""Growth of that weight where a round has not halved the worst violation."""

STUCK = 0.99
"""Worst violation after a round, as a share of that before, from which on the limits cannot be kept."""

ROUNDS = 8
"""Changes of the multipliers at most; three to six bring violations below `KEPT`."""

OVER = 1.2
"""What limits are narrowed by, over what was beyond them."""

KEPT = 2e-4
"""Violation [share of half a joint's range, or of rcond] that counts as none; limits are narrowed by as much."""


SHORT = 0.1
"""Distance [m] by which two shapes may be too near that counts as half of a joint's range; pairs that are farther apart
than asked by as much are not looked at."""


@dataclass(frozen=True, eq=False)
class Limits(Value):
    """Hard limits: allowed |q - middle| / half (n,) or (S, n), inf for none, and the least rcond, 0 for none.

    apart: P pairs of shapes that keep the distances wanted there, and `more` (P,) [m].
    """

    allowed: Array
    rcond: float
    apart: Clearances | None = None
    more: Array = field(default_factory=lambda: np.zeros(0))

    def narrowed(self, over: Vector, share: float, nearer: Vector) -> Limits:
        """Narrower by what was beyond them (n,), by the share that rcond fell short of, and by what shapes were too
        near (P,) [m].
        """
        allowed, rcond = self.allowed - OVER * np.maximum(over, 0.0), self.rcond * max(1.0, share) ** OVER
        return Limits(allowed, rcond, self.apart, self.distances + OVER * np.maximum(nearer, 0.0) - self._wanted)

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
        apart = self.distances
        found, slopes = self.apart.slopes(Q, float(apart.max()) + SHORT)
        return apart - found, -slopes

    @property
    def none(self) -> bool:
        """True where nothing is limited."""
        return not np.isfinite(self.allowed).any() and self.rcond <= 0 and self.apart is None


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

    def cost(self, at: Sampled) -> Slopes:
        """The objective at a section, with its derivatives."""
        total = Slopes(0.0, np.zeros_like(at.Q), np.zeros_like(at.G), np.zeros(len(at.Q)))
        for name, weight in self.weights.items():
            one = self.costs.known[name](at.Q, at.G, at.rcond)
            total = total.plus(one, weight)
        return total

    def violations(self, at: Sampled) -> tuple[Array, Array, Array]:
        """(S, n + 1 + P) numbers that must not be above 0, and the derivatives of the joints' and the pairs' by q."""
        off = (at.Q - self.costs.middle) / self.costs.half
        over = np.abs(off) - self.limits.allowed + KEPT
        least = np.log(self.limits.rcond / at.rcond) + KEPT if self.limits.rcond > 0 else np.full(len(at.Q), -1.0)
        near, slopes = self.limits.nearer_slopes(at.Q)
        found = np.column_stack([np.maximum(over, -1.0), least, np.maximum(near / SHORT + KEPT, -1.0)])
        return found, np.sign(off) / self.costs.half, slopes / SHORT

    def best(self, first: Matrix, degree: int) -> tuple[Matrix, Sampled, tuple[float, ...]]:
        """(coefficients (r, t), their section, the least cost with each degree), from those of a lower degree."""
        found, near, values, start = first, self.near, [], (self._no_push, PENALTY)
        for k in range(degree + 1):
            t = len(monomials_up_to(self.section.leaves.coordinates.d, k))
            if t < first.shape[1]:
                continue
            found = np.pad(found, ((0, 0), (0, t - found.shape[1])))
            found, near, start = self._within_limits(found, near, start)
            values.append(self.cost(near).value)
        return found, near, tuple(values)

    def _within_limits(
        self, first: Matrix, near: Sampled, start: tuple[Matrix, float]
    ) -> tuple[Matrix, Sampled, tuple[Matrix, float]]:
        """The best coefficients (r, t) within the limits, their section, and the multipliers and penalty to go on with.

        Where the limits cannot be kept, those that violate them least.
        """
        r, t = first.shape
        white = self._whitening[:t, :t]
        x, (multipliers, penalty) = (first @ np.linalg.inv(white)).ravel(), start
        before = np.inf
        for _ in range(ROUNDS):
            cost = self._augmented(r, t, multipliers, penalty)
            x, _, near = descend(cost, x, near)
            if self.limits.none:
                break
            over, _, _ = self.violations(near)
            worst = float(over.max())
            if worst <= KEPT and float(np.abs(multipliers * over).max()) <= KEPT:
                return x.reshape(r, t) @ white, near, (multipliers, penalty)
            multipliers = np.maximum(0.0, multipliers + penalty * over)
            if worst > STUCK * before:
                break
            penalty *= HARDER if worst > before / 2 else 1.0
            before = worst
        return x.reshape(r, t) @ white, near, start

    def _augmented(self, r: int, t: int, multipliers: Matrix, penalty: float) -> Cost:
        """The objective and the penalty of violated limits, over whitened coefficients."""
        white = self._whitening[:t, :t]

        def cost(x: Vector, near: Sampled) -> tuple[float, Vector, Sampled] | None:
            at = self.section.at(x.reshape(r, t) @ white, near)
            if at is None:
                return None
            total = self.cost(at).plus(self._penalty(at, multipliers, penalty), self._size)
            slope = self.section.slope(at, total, t)
            return total.value, (slope @ white.T).ravel(), at

        return cost

    @cached_property
    def _size(self) -> float:
        """The objective to begin with; 1 where that is 0."""
        return self.cost(self.near).value or 1.0

    @property
    def _no_push(self) -> Matrix:
        return np.zeros((len(self.near.Q), self.near.Q.shape[1] + 1 + len(self.limits.distances)))

    def _penalty(self, at: Sampled, multipliers: Matrix, penalty: float) -> Slopes:
        """sum max(0, multiplier + penalty over)^2 / (2 penalty). [NW06, section 17.3]"""
        none = np.zeros_like(at.G)
        if self.limits.none:
            return Slopes(0.0, np.zeros_like(at.Q), none, np.zeros(len(at.Q)))
        over, by_q, by_near = self.violations(at)
        push, n = np.maximum(0.0, multipliers + penalty * over), at.Q.shape[1]
        value = float(np.sum(push**2) - np.sum(multipliers**2)) / (2 * penalty)
        pushed = push[:, :n] * by_q + np.einsum("sp,spn->sn", push[:, n + 1 :], by_near)
        return Slopes(value, pushed, none, -push[:, n] / at.rcond)

    @cached_property
    def _whitening(self) -> Matrix:
        """A lower triangle: in x with coefficients = x times it, values and slopes of zeta count alike.

        The first of x touch the first monomials only, so a lower degree has the first of them.
        """
        values, slopes = self.section.basis
        slopes = slopes * self.section.leaves.coordinates.scale
        metric = (values.T @ values + np.einsum("std,sud->tu", slopes, slopes)) / len(values)
        return np.linalg.inv(np.linalg.cholesky(metric + 1e-12 * np.eye(len(metric))))
