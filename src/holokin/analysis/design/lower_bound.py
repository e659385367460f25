"""The least cost at each tool pose, over all postures that a search finds there and over all slopes.

A section has at the pose x some posture and some right inverse; at best the cheapest of both. No integrability is
asked, so the mean of these least costs is a lower bound of every law with these postures, repeatable or not.
They are looked for from many starts (`pose_postures`), so that those of all branches are among them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from ...base.tolerances import TOLERANCES
from ...base.types import Array, Matrix, Value, Vector
from ...strategies.self_motions import least_motion
from ...symbolic import wrapped
from ..coverage.coordinates import Coordinates
from ..coverage.pose_postures import STARTS, Cost, PosePostures, postures_at_poses
from .objectives import POWER, Costs
from .own_cost import OwnCost

LAWSON = 12
"""Changes of the joints' weights that balance their greatest speeds: every one gives a lower bound, the last ones agree
to a per cent."""


@dataclass(frozen=True, eq=False)
class LeastCosts(Value):
    """The least costs (S,) at each tool pose over postures found there, those between them included.

    allowed: |q - middle| over half the range (n,) up to which postures count, full turns of hinges taken off; inf for
        all. Costs are inf where no posture found is within.
    """

    postures: PosePostures
    coordinates: Coordinates
    costs: Costs
    allowed: Vector

    @property
    def traced(self) -> bool:
        """True where whole self-motions were walked."""
        return self.postures.traced

    @cached_property
    def squared_speed(self) -> Vector:
        """The least |G|^2, as in `Costs`."""

        def cost(q: Matrix) -> Vector:
            G = least_slopes(self._J(q), self.coordinates.P, self.costs.joints)
            return np.sum(G**2 * self.costs.joints[:, None] * self.costs.columns**2, axis=(1, 2))

        return self._least(cost)

    @cached_property
    def worst_speed(self) -> Vector:
        """The least greatest share of a joint's speed limit."""
        return self._least(lambda q: _least_worst(self._J(q), self.coordinates.P, self.costs))

    @cached_property
    def joint_limits(self) -> Vector:
        """The least distance of the farthest joint from its middle, over half its range."""
        return self._least(lambda q: self._off(q).max(axis=1))

    def own(self, cost: OwnCost) -> float:
        """The mean of the least of a cost of the user's own."""
        return float(np.mean(self._least(cost.values)))

    @cached_property
    def beyond(self) -> Vector:
        """How far a posture is beyond the allowed limits at least, 0 where one is within."""
        if np.isinf(self.allowed).all():
            return np.zeros(len(self.postures.p))
        return np.maximum(self.postures.least(self._over, self._over), 0.0)

    def _least(self, cost: Cost) -> Vector:
        """The least of a cost over the postures that count."""

        def counted(q: Matrix) -> Vector:
            found, known = np.full(len(q), np.inf), self._over(q) <= TOLERANCES.limit
            found[known] = cost(q[known])
            return np.where(np.isfinite(found), found, np.inf)

        return self.postures.least(counted, self._over)

    def _J(self, q: Matrix) -> Array:
        return self.coordinates.chart.jacobian_batch(q)[0]

    def _off(self, q: Matrix) -> Matrix:
        gap, turning = q - self.costs.middle, self.coordinates.chart.robot.hinges & np.isfinite(self.costs.half)
        return np.abs(np.where(turning, wrapped(gap), gap)) / self.costs.half

    def _over(self, q: Matrix) -> Vector:
        return (self._off(q) - self.allowed).max(axis=1)


@dataclass(frozen=True, eq=False)
class Floor(Value):
    """What no law at tool poses p (S, 3), R (S, 3, 3) can have less of, as far as postures are found there.

    Q: a law's postures (S, n). weights: of the costs, by name. allowed: as in `LeastCosts`.
    """

    coordinates: Coordinates
    costs: Costs
    weights: dict[str, float]
    allowed: Vector
    Q: Matrix
    p: Matrix
    R: Array

    @cached_property
    def here(self) -> LeastCosts:
        """The least costs over the self-motions of the law's postures."""
        return self._over(0)

    @cached_property
    def anywhere(self) -> LeastCosts:
        """The least costs over all postures found."""
        return self._over(STARTS)

    def _over(self, starts: int) -> LeastCosts:
        found = postures_at_poses(self.coordinates.chart, self.Q, self.p, self.R, starts=starts)
        return LeastCosts(found, self.coordinates, self.costs, self.allowed)

    def of(self, least: LeastCosts) -> float:
        """The weighted costs of these least ones: no law has less, since each of the costs is at its least there.

        Where the law's own self-motions leave the allowed limits, limits do not count.
        """
        if self.here.beyond.any():
            least = replace(least, allowed=np.full_like(self.allowed, np.inf))
        known = {
            "squared_speed": lambda: float(np.mean(least.squared_speed)),
            "worst_speed": lambda: float(np.mean(least.worst_speed**POWER) ** (1 / POWER)),
            "joint_limits": lambda: float(np.mean(least.joint_limits**POWER) ** (1 / POWER)),
            "rcond": lambda: 1.0,
            "travel": lambda: 0.0,
            "clearance": lambda: 0.0,
        }
        known |= {cost.name: partial(least.own, cost) for cost in self.costs.own}
        return sum(w * known[name]() for name, w in self.weights.items())


def least_costs(coordinates: Coordinates, costs: Costs, Q: Matrix, p: Matrix, R: Array, allowed: Vector) -> LeastCosts:
    """The least costs over all postures found at tool poses p (S, 3), R (S, 3, 3), those of Q (S, n) among them."""
    return Floor(coordinates, costs, {}, allowed, Q, p, R).anywhere


def least_slopes(J: Array, P: Matrix, weights: Array) -> Array:
    """G P (S, n, d) of the right inverse with the least weighted squared joint speed: W^-1 J^T (J W^-1 J^T)^-1 P.

    weights: (n,), or one for each sample (S, n).
    """
    return least_motion(J, np.broadcast_to(P, (len(J), *P.shape)), weights)


def _least_worst(J: Array, P: Matrix, costs: Costs) -> Vector:
    """Lower bounds (S,) of max_i |G_i| / max_velocity_i over all right inverses: max >= the mean with any weights."""
    known = costs.speeds > 0
    share, best = np.full((len(J), len(known)), 1.0 / known.sum()) * known, np.zeros(len(J))
    for _ in range(LAWSON):
        weights = share * costs.speeds**2 + 1e-12  # joints without a speed limit are free
        G = least_slopes(J, P, weights)
        used = np.sum((G * costs.columns) ** 2, axis=2) * costs.speeds**2
        total = np.sum(share * used, axis=1)
        best = np.fmax(best, total)
        share = share * np.sqrt(used) / np.sum(share * np.sqrt(used), axis=1, keepdims=True)
    return np.sqrt(best)
