"""The problem that `design` solves: a base law, a workspace, an objective and hard limits; and a law of it, checked."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...base.errors import ArgumentError, OutOfReachError, PathError
from ...base.types import Array, Flags, Matrix, Value, Vector
from ...motion.checks.keeping_clear import Clearances
from ...motion.ik import inverse
from ...path.workspaces import Workspace
from ...strategies import HolonomicStrategy, holonomic
from ...strategies.constraints import Constraint, linear, tilted
from ...strategies.polynomial import monomials_up_to
from ...strategies.tasks.task import Task
from ...symbolic.null_space import null_space
from ..coverage.coordinates import Coordinates, Polynomial
from .best_section import Limits, Search
from .law_metrics import SectionMetrics, measured, reached
from .lower_bound import Floor
from .objectives import Costs, Objective
from .section import Sampled, SectionSamples, TiltedLeaves

LEEWAY = 0.02
"""Share of half a joint's range, beyond the least violation, that a search may use where the limits cannot be kept."""


@dataclass(frozen=True, eq=False)
class Problem(Value):
    """A base law with the posture (n,) in the middle of a workspace; sections over it, and their limits.

    poses, others: tool poses (k, 4, 4) at which sections are made, and at which they are checked.
    """

    law: HolonomicStrategy
    center: Vector
    workspace: Workspace
    coordinates: Coordinates
    costs: Costs
    goal: Objective
    hard: Limits
    degree: int
    poses: Array
    others: Array

    @property
    def first(self) -> Matrix:
        """Coefficients (r, 1) of the base law itself."""
        return self.law.g(self.center)[:, None]

    def posed(
        self, Q: Matrix, there: Array, coefficients: Matrix, weights: dict[str, float] | None = None
    ) -> tuple[Search, Floor]:
        """The search at poses (S, 4, 4), from postures (S, n) of a section of coefficients (r, t), and its floor."""
        c = self.coordinates
        p, R = np.ascontiguousarray(there[:, :3, 3]), np.ascontiguousarray(there[:, :3, :3])
        leaves = TiltedLeaves(self.law, c)
        section = SectionSamples(leaves, monomials_up_to(c.d, self.degree), p, R, c.at(Q))
        near = section.through(Q, coefficients)
        weights = weights or self._weights(near)
        floor = Floor(c, self.costs, weights, self.hard.allowed, Q, p, R)
        over = floor.here.beyond
        allowed = self.hard.allowed + np.where(over > 0, over + LEEWAY, 0.0)[:, None]
        return Search(section, self.costs, weights, replace(self.hard, allowed=allowed), near), floor

    def checked(self, coefficients: Matrix, best: Sampled) -> Checked:
        """The law of coefficients (r, t) at the other poses, reached on its leaf from the middle of the workspace."""
        zeta = Polynomial(self.coordinates, coefficients)
        constraint = tilted(self.law.constraint, zeta, chart=self.coordinates.chart)
        strategy = holonomic(self.law.task, constraint, name="designed")
        middle = inverse(strategy, best.Q[0], limits=False)(self.workspace.center)
        arrived, _ = reached(strategy, middle, self.others)
        over, rconds, nearer = self.over(arrived), strategy.gain.batch(arrived)[1], self.hard.nearer(arrived)
        fits = (over <= 0).all(axis=1) & (rconds >= self.hard.rcond) & (nearer <= 0).all(axis=1)
        share = self.hard.rcond / float(rconds.min())
        return Checked(strategy, zeta, middle, arrived, fits, over.max(axis=0), share, nearer.max(axis=0))

    def broken(self, at: Sampled) -> int:
        """At how many samples of a section a hard limit is broken."""
        beyond = (self.over(at.Q) > 0).any(axis=1) | (at.rcond < self.hard.rcond)
        return int(np.sum(beyond | (self.hard.nearer(at.Q) > 0).any(axis=1)))

    def over(self, Q: Matrix) -> Matrix:
        """By how much joints at postures (k, n) are beyond the hard limits (k, n)."""
        return np.abs(Q - self.costs.middle) / self.costs.half - self.hard.allowed

    def measured(self, strategy: HolonomicStrategy, Q: Matrix, poses: int) -> SectionMetrics:
        """The metrics of a law at postures (k, n) that it reaches, of so many poses."""
        return measured(strategy, self.coordinates, self.costs, Q, poses, self.hard.apart)

    def _weights(self, at: Sampled) -> dict[str, float]:
        """The weights of the costs, each divided by what it is at a section, where there are several."""
        weights = self.goal.weights
        if len(weights) == 1:
            return dict.fromkeys(weights, 1.0)
        found = {name: self.costs.known[name](at.Q, at.G, at.rcond).value for name in weights}
        if "clearance" in found:  # a share already, and 0 where all is far
            found["clearance"] = 1.0
        for name, value in found.items():
            if not value > 0:
                cure = "beside other costs it must be above 0: add a constant to it, or make it the only one"
                raise ArgumentError(f"the cost {name!r} before the design", value, cure)
        return {name: w / found[name] for name, w in weights.items()}


@dataclass(frozen=True, eq=False)
class Checked(Value):
    """A law of a search, its posture in the middle, and its postures (k, n) at other poses: which keep the limits (k,),
    by how much joints are beyond them at most (n,), by what share rcond falls short, and by how much pairs of shapes
    are too near at most (P,).
    """

    strategy: HolonomicStrategy
    zeta: Polynomial
    middle: Vector
    arrived: Matrix
    fits: Flags
    over: Vector
    short: float
    nearer: Vector


def based(
    task: Task, base: Constraint | None, q0: Vector, middle: Matrix, units: Vector
) -> tuple[HolonomicStrategy, Vector]:
    """The base law, and its posture at the middle of the workspace. Raises: OutOfReachError."""
    law = holonomic(task, base) if base is not None else _along_self_motion(task, q0, units)
    try:
        center = inverse(law, q0, limits=False)(middle)
    except PathError as problem:
        fact = (
            f"the base law {law.name!r} does not lead from the start to the middle of the workspace: {problem.args[0]}"
        )
        raise OutOfReachError(fact, "give a start there, another base, or another workspace") from None
    return (law, center) if base is not None else (_along_self_motion(task, center, units), center)


def _along_self_motion(task: Task, q: Vector, units: Vector) -> HolonomicStrategy:
    """Z^T D q = const, D = diag(units), Z (n, r) the self-motions at a posture in coordinates D q."""
    Z = null_space(task.jacobian(q) / units)
    return holonomic(task, linear(Z.T * units, name="the combination of joints along the self-motion"))


def hard_limits(costs: Costs, margin: float | None, rcond: float, apart: Clearances | None) -> Limits:
    """The hard limits of a search; no joint limits without a margin."""
    allowed = np.full(len(costs.half), np.inf) if margin is None else 1 - margin / costs.half
    return Limits(np.where(np.isfinite(costs.half), allowed, np.inf), rcond, apart)
