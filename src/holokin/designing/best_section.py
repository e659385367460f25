"""The search behind `design`: coefficients of the polynomial that make the objective least, within hard limits."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..types import Array, Matrix, Value, Vector
from .coordinates import monomials_up_to
from .descent import descend
from .objectives import Costs, Slopes
from .section import Sampled, SectionSamples

PENALTY = 10.0
"""Weight of the squares of violated limits, shares of half a joint's range, beside costs of 1, to begin with."""

ROUNDS = 15
"""Changes of the multipliers at most; five or six bring violations below `KEPT`."""

KEPT = 2e-4
"""Violation [share of half a joint's range, or of rcond] that counts as none; limits are narrowed by as much."""


@dataclass(frozen=True, eq=False)
class Limits(Value):
    """Hard limits: allowed |q - middle| / half (n,), inf for a joint without limits, and the least rcond, 0 for none."""

    allowed: Vector
    rcond: float

    @property
    def none(self) -> bool:
        """True where nothing is limited."""
        return not np.isfinite(self.allowed).any() and self.rcond <= 0


@dataclass(frozen=True, eq=False)
class Search(Value):
    """A section's samples, the weights and scales of its costs, and its limits.

    near: postures (S, n) of the section with a constant zeta.
    """

    section: SectionSamples
    costs: Costs
    weights: dict[str, float]
    limits: Limits
    near: Matrix

    def cost(self, at: Sampled) -> Slopes:
        """The objective at a section, with its derivatives."""
        total = Slopes(0.0, np.zeros_like(at.Q), np.zeros_like(at.G), np.zeros(len(at.Q)))
        for name, weight in self.weights.items():
            one = self.costs.known[name](at.Q, at.G, at.rcond)
            total = total.plus(one, weight)
        return total

    def violations(self, at: Sampled) -> tuple[Array, Array]:
        """(S, n + 1) numbers that must not be above 0, and the derivatives of the joints' by q."""
        off = (at.Q - self.costs.middle) / self.costs.half
        over = np.abs(off) - self.limits.allowed + KEPT
        least = np.log(self.limits.rcond / at.rcond) + KEPT if self.limits.rcond > 0 else np.full(len(at.Q), -1.0)
        over[:, ~np.isfinite(self.limits.allowed)] = -1.0
        return np.column_stack([over, least]), np.sign(off) / self.costs.half

    def best(self, first: Matrix, degree: int) -> tuple[Matrix, Sampled, tuple[float, ...]]:
        """(coefficients (r, t), their section, the least cost with each degree up to it), from a constant zeta (r, 1)."""
        found, near, values = first, self.near, []
        multipliers, penalty = None, PENALTY
        for k in range(degree + 1):
            t = len(monomials_up_to(self.section.leaves.coordinates.d, k))
            found = np.pad(found, ((0, 0), (0, t - found.shape[1])))
            found, near, multipliers, penalty = self._within_limits(found, near, multipliers, penalty)
            at = self.section.at(found, near)
            values.append(self.cost(at).value)
        return found, at, tuple(values)

    def _within_limits(self, first: Matrix, near: Matrix, multipliers: Any, penalty: float) -> Any:
        r, t = first.shape
        white = self._whitening[:t, :t]
        x = (first @ np.linalg.inv(white)).ravel()
        if multipliers is None:
            multipliers = np.zeros((len(near), near.shape[1] + 1))
        worst_before = np.inf
        for _ in range(ROUNDS):

            def cost(x: Vector, near: Matrix, multipliers=multipliers, penalty=penalty):
                at = self.section.at(x.reshape(r, t) @ white, near)
                if at is None:
                    return None
                total = self.cost(at).plus(self._penalty(at, multipliers, penalty), 1.0)
                slope = self.section.slope(at, total, t)
                return total.value, (slope @ white.T).ravel(), at.Q

            x, _, near = descend(cost, x, near)
            if self.limits.none:
                break
            at = self.section.at(x.reshape(r, t) @ white, near)
            over, _ = self.violations(at)
            worst = float(over.max())
            if worst <= KEPT and np.abs(multipliers * over).max() <= KEPT:
                break
            multipliers = np.maximum(0.0, multipliers + penalty * over)
            if worst > 0.25 * worst_before:
                penalty *= 4
            worst_before = max(worst, 0.0)
        return x.reshape(r, t) @ white, near, multipliers, penalty

    def _penalty(self, at: Sampled, multipliers: Matrix, penalty: float) -> Slopes:
        """sum max(0, multiplier + penalty over)^2 / (2 penalty), mean over the samples. [NW06, section 17.3]"""
        none = np.zeros_like(at.G)
        if self.limits.none:
            return Slopes(0.0, np.zeros_like(at.Q), none, np.zeros(len(at.Q)))
        over, by_q = self.violations(at)
        push = np.maximum(0.0, multipliers + penalty * over) / len(at.Q)
        value = float(np.sum(push**2) * len(at.Q) - np.sum(multipliers**2) / len(at.Q)) / (2 * penalty)
        return Slopes(value, push[:, :-1] * by_q, none, -push[:, -1] / at.rcond)

    @cached_property
    def _whitening(self) -> Matrix:
        """A lower triangle: in x with coefficients = x times it, values and slopes of zeta count alike.

        The first of x touch the first monomials only, so a lower degree has the first of them.
        """
        values, slopes = self.section.basis
        slopes = slopes * self.section.leaves.coordinates.scale
        metric = (values.T @ values + np.einsum("std,sud->tu", slopes, slopes)) / len(values)
        return np.linalg.inv(np.linalg.cholesky(metric + 1e-12 * np.eye(len(metric))))
