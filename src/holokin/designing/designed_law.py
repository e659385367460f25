"""`design`: the best section of a workspace, as an ordinary strategy with leaves (theory 7.1)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..arguments import typed
from ..constraints import Constraint, linear, tilted
from ..errors import ArgumentError, OutOfReachError, PathError
from ..motion import inverse
from ..robot import check_metres, start_posture
from ..strategies import HolonomicStrategy, holonomic
from ..symbolic.null_space import null_space
from ..task import Task
from ..types import Array, ArrayLike, Flags, Matrix, Value, Vector, not_negative, whole
from ..workspaces import Workspace
from .best_section import Limits, Search
from .coordinates import Coordinates, Polynomial, chart_of, coordinates_of, monomials_up_to
from .law_metrics import SectionMetrics, measured, reached
from .lower_bound import LeastCosts, least_costs
from .objectives import POWER, Costs, Objective, as_objective, costs_of, joint_weights
from .section import Sampled, SectionSamples, TiltedLeaves

HIGHEST = 4
"""Degree of a polynomial at most: in three coordinates it has 35 terms then, in six 210."""

ROUNDS = 3
"""Searches at most: another one follows where the design reaches samples that the base law did not, and, with limits
narrowed, where poses between the samples are beyond them."""

LEEWAY = 0.02
"""Share of half a joint's range, beyond the least violation, that a search may use where the limits cannot be kept."""

FINER = 4
"""Poses that a design is checked at, for each one that it was searched at."""


@dataclass(frozen=True, eq=False)
class Design(Value):
    """The best section that was found, as a strategy, and what it was chosen by.

    strategy: an ordinary one; its leaf through `start` (n,), the posture at the middle of the workspace, is the
        section phi(q) = polynomial(x).
    costs: the objective with the base law as it was, then after the search with each degree from 0 on. With one cost it
        has the cost's unit, with several it is 1 to begin with.
    bound: the least objective of all laws whose postures at these samples lie on the self-motions of the designed one.
        Postures on other branches are not looked at, and may cost less; where joint limits bind, it may be some percent
        too high. With several redundant joints (`bound_traced` False) it is the least that a search along lines found.
    before, after: the base law and the designed one at the samples. checked: the designed one at other poses, four
        times as many; where the workspace is a cloud, at its own.
    kept: at how many of those reached in the check all hard limits hold. impossible: at how many samples no posture at
        all was found within the joint limits; there the search asked for the least violation.
    """

    strategy: HolonomicStrategy
    start: Vector
    objective: Objective
    base: HolonomicStrategy
    polynomial: Polynomial
    costs: tuple[float, ...]
    bound: float
    bound_traced: bool
    before: SectionMetrics
    after: SectionMetrics
    checked: SectionMetrics
    kept: int
    impossible: int

    @property
    def degree(self) -> int:
        """Degree of the polynomial."""
        return len(self.costs) - 2

    @property
    def holds(self) -> bool:
        """True when no hard limit is violated at any pose that was checked and that the leaf reaches."""
        return self.kept == self.checked.reached

    def __str__(self) -> str:
        goal = " + ".join(name.replace("_", " ") for name in self.objective.weights)
        steps = ", ".join(f"{v:.5g}" for v in self.costs[1:])
        kind = (
            "no law on these self-motions can have less than"
            if self.bound_traced
            else "a search over the self-motions came down to"
        )
        cause = f"; at {self.impossible} of the samples no posture is within them" if self.impossible else ""
        return (
            f"{goal}: {self.costs[0]:.5g} to begin with, {steps} with polynomials of degree 0 to {self.degree} over "
            f"{self.base.name!r}; {kind} {self.bound:.5g}. Checked at {self.checked.poses} poses: {self.checked}; "
            f"the hard limits hold at {self.kept} of those reached{cause}."
        )


@typed
def design(
    task: Task,
    workspace: Workspace,
    start: ArrayLike,
    *,
    objective: Objective | str = "squared_speed",
    base: Constraint | None = None,
    degree: int = 2,
    limits: bool = True,
    margin: float = 0.0,
    rcond: float = 0.0,
    samples: int = 256,
    seed: int = 0,
) -> Design:
    """The best way to give each tool pose of a workspace its joints: phi(q) = zeta(x), zeta a polynomial of the pose.

    The leaf is that of g = phi - zeta o f, with the rows J_phi - zeta' J, so that zeta adds no algorithmic singularity
    to those of phi. The objective is made least over the coefficients, with exact derivatives, from zeta constant.
    Joint limits and the least rcond hold at all samples, and are checked at other poses afterwards. (theory 7.1)

    Args:
        start: a posture (n,) on the branch that is to be used.
        objective: an `Objective`, or the name of one cost.
        base: phi, r = n - m rows, regular on the workspace. By default the combinations of joints Z^T q along which the
            self-motion runs in the middle of the workspace, Z (n, r) an orthonormal basis of ker J there (sliding
            joints scaled as in `Objective`).
        degree: of zeta, 0 to 4.
        limits: True makes joint limits hard. margin: distance kept from them [joint units].
        rcond: the least rcond of [J; J_g], a hard limit too; 0 for none.
        samples: tool poses of the workspace that the search looks at. Those that the base law does not reach from the
            middle of the workspace are left out, and counted.

    Raises:
        ArgumentError: the robot is not redundant for the task; bad numbers.
        OutOfReachError: the middle of the workspace is not reached from the start.
    """
    robot, goal = task.robot, as_objective(objective)
    q0 = start_posture(robot, start)
    if task.n == task.m:
        cure = "each tool pose has its joints already: hk.inverse finds them, on the branch of its start"
        raise ArgumentError("the number of redundant joints", 0, cure)
    if whole("the degree", degree, 0) > HIGHEST:
        raise ArgumentError("the degree", degree, f"give 0 to {HIGHEST}")
    not_negative("the margin", margin)
    if not 0 <= rcond < 1:
        raise ArgumentError("the least rcond", rcond, "give a number from 0 to 1")
    whole("seed", seed, 0)

    poses = workspace.poses(whole("samples", samples), seed)
    check_metres(robot, poses, task.tip)
    other = workspace.poses(FINER * samples, seed + 1)
    law, center = _base(task, base, q0, workspace.center, np.sqrt(joint_weights(robot, goal)))
    Q, there = reached(law, center, poses)
    coordinates = coordinates_of(chart_of(task, workspace.center[:3, :3]), Q)
    leaves, found = TiltedLeaves(law, coordinates), law.g(center)[:, None]
    costs = costs_of(robot, goal, coordinates.turns, coordinates.spread)
    hard = _limits(costs, margin if limits else None, rcond)
    search, least = _posed(leaves, costs, goal, hard, degree, Q, there, found)
    before, values = measured(law, coordinates, costs, Q, len(poses)), (search.cost(search.near).value,)
    found, best, more = search.best(found, degree)
    result, values = _checked(law, coordinates, costs, hard, found, best, workspace.center, other), (*values, *more)
    for _ in range(ROUNDS - 1):
        Q, there = reached(result.strategy, result.middle, poses) if len(best.Q) < len(poses) else (best.Q, poses)
        if len(Q) > len(best.Q):
            search, least = _posed(leaves, costs, goal, hard, degree, Q, there, found, search.weights)
        elif result.fits.all() or least.beyond.any():
            break
        else:
            search = replace(search, near=best, limits=search.limits.narrowed(result.over, result.short))
        found, best, more = search.best(found, degree)
        result = _checked(law, coordinates, costs, hard, found, best, workspace.center, other)
        values = (*values[: degree + 2 - len(more)], *more)
    return Design(
        strategy=result.strategy,
        start=result.middle,
        objective=goal,
        base=law,
        polynomial=result.zeta,
        costs=values,
        impossible=int(np.sum(least.beyond > 0)),
        bound=_bound(least, search.weights),
        bound_traced=least.traced,
        before=before,
        after=measured(result.strategy, coordinates, costs, best.Q, len(poses)),
        checked=measured(result.strategy, coordinates, costs, result.arrived, len(other)),
        kept=int(result.fits.sum()),
    )


@dataclass(frozen=True, eq=False)
class _Checked(Value):
    """A law of a search, its posture in the middle, and its postures (k, n) at other poses: which keep the limits (k,),
    by how much joints are beyond them at most (n,), and by what share rcond falls short.
    """

    strategy: HolonomicStrategy
    zeta: Polynomial
    middle: Vector
    arrived: Matrix
    fits: Flags
    over: Vector
    short: float


def _checked(
    law: HolonomicStrategy, coordinates: Coordinates, costs: Costs, hard: Limits,
    coefficients: Matrix, best: Sampled, center: Matrix, poses: Array,
) -> _Checked:  # fmt: skip
    """The law of coefficients (r, t) at other poses (k, 4, 4), reached on its leaf from the middle of the workspace."""
    zeta = Polynomial(coordinates, coefficients)
    strategy = holonomic(law.task, tilted(law.constraint, zeta, chart=coordinates.chart), name="designed")
    middle = inverse(strategy, best.Q[0])(center)
    arrived, _ = reached(strategy, middle, poses)
    over = np.abs(arrived - costs.middle) / costs.half - hard.allowed
    rconds = strategy.gain.batch(arrived)[1]
    fits = (over <= 0).all(axis=1) & (rconds >= hard.rcond)
    return _Checked(strategy, zeta, middle, arrived, fits, over.max(axis=0), hard.rcond / float(rconds.min()))


def _base(
    task: Task, base: Constraint | None, q0: Vector, middle: Matrix, units: Vector
) -> tuple[HolonomicStrategy, Vector]:
    """The base law, and its posture at the middle of the workspace. Raises: OutOfReachError."""
    law = holonomic(task, base) if base is not None else _along_self_motion(task, q0, units)
    try:
        center = inverse(law, q0)(middle)
    except PathError as problem:
        fact = (
            f"the base law {law.name!r} does not lead from the start to the middle of the workspace: {problem.args[0]}"
        )
        raise OutOfReachError(fact, "give a start there, another base, or another workspace") from problem
    return (law, center) if base is not None else (_along_self_motion(task, center, units), center)


def _along_self_motion(task: Task, q: Vector, units: Vector) -> HolonomicStrategy:
    """Z^T D q = const, D = diag(units), Z (n, r) the self-motions at a posture in coordinates D q."""
    Z = null_space(task.jacobian(q) / units)
    return holonomic(task, linear(Z.T * units, name="the joints' way along the self-motion"))


def _posed(
    leaves: TiltedLeaves, costs: Costs, goal: Objective, hard: Limits, degree: int,
    Q: Matrix, there: Array, coefficients: Matrix, weights: dict[str, float] | None = None,
) -> tuple[Search, LeastCosts]:  # fmt: skip
    """The search at poses (S, 4, 4), from postures (S, n) of a section of coefficients (r, t), and the least costs."""
    c = leaves.coordinates
    p, R = np.ascontiguousarray(there[:, :3, 3]), np.ascontiguousarray(there[:, :3, :3])
    section = SectionSamples(leaves, monomials_up_to(c.d, degree), p, R, c.at(Q))
    near = section.through(Q, coefficients)
    weights = weights or _weights(goal, costs, near)
    least = least_costs(c, costs, Q, p, R, hard.allowed, speeds="worst_speed" in weights)
    over = least.beyond
    if over.any():  # no law keeps the limits: then the bound is that of those which do not
        free = np.full(Q.shape[1], np.inf)
        least = replace(least_costs(c, costs, Q, p, R, free, speeds="worst_speed" in weights), beyond=over)
    allowed = hard.allowed + np.where(over > 0, over + LEEWAY, 0.0)[:, None]
    return Search(section, costs, weights, replace(hard, allowed=allowed), near), least


def _limits(costs: Costs, margin: float | None, rcond: float) -> Limits:
    """The hard limits of a search; no joint limits without a margin."""
    allowed = np.full(len(costs.half), np.inf) if margin is None else 1 - margin / costs.half
    return Limits(np.where(np.isfinite(costs.half), allowed, np.inf), rcond)


def _weights(goal: Objective, costs: Costs, at: Sampled) -> dict[str, float]:
    """The weights of the costs, each divided by what it is at a section, where there are several."""
    if len(goal.weights) == 1:
        return dict.fromkeys(goal.weights, 1.0)
    return {name: w / costs.known[name](at.Q, at.G, at.rcond).value for name, w in goal.weights.items()}


def _bound(least: LeastCosts, weights: dict[str, float]) -> float:
    """The least that the weighted costs can be: the sum of the least of each."""
    known = {
        "squared_speed": float(np.mean(least.squared_speed)),
        "worst_speed": float(np.mean(least.worst_speed**POWER) ** (1 / POWER)),
        "joint_limits": float(np.mean(least.joint_limits**POWER) ** (1 / POWER)),
        "rcond": 1.0,
        "travel": 0.0,
    }
    return sum(w * known[name] for name, w in weights.items())
