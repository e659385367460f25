"""`design`: the best section of a workspace, as an ordinary strategy with leaves."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, OutOfReachError, PathError
from ...base.types import Array, ArrayLike, Flags, Matrix, NoTruthValue, Result, Value, Vector, not_negative, whole
from ...motion.checks import PairDistance, Scene
from ...motion.checks.check_report import counted
from ...motion.ik import ik
from ...motion.ik.solutions import InverseStatus
from ...path.workspaces import Workspace
from ...proof.kept_apart import clearances_of
from ...robot import start_posture
from ...strategies import HolonomicStrategy, holonomic
from ...strategies.constraints import Constraint, linear, tilted
from ...strategies.right_inverses import monomials_up_to
from ...strategies.tasks.task import Task, of_one_tool
from ...symbolic.linear import null_space
from ..coverage.cover_workspace import posture_reach
from ..coverage.pose_coordinates import Coordinates, Polynomial, chart_of, coordinates_of, task_poses
from .least_costs import Floor, one_redundant
from .nearby_cusps import NearbyCusps, cusps_near
from .objectives import Cost, Costs, Objective, as_objective, costs_of, joint_weights, length_of
from .section import Limits, Sampled, Search, SectionSamples, TiltedLeaves


@dataclass(frozen=True, eq=False)
class SectionMetrics(Result, Value):
    """What a strategy does over a workspace, on one leaf.

    poses: how many tool poses were asked for; reached: how many of them the leaf reaches; within_limits: how many of
    these with all joints within their limits. The rest is of those reached: squared_speed, mean |G|_F^2 [rad^2/m^2];
    worst_speed, the greatest share of a joint's speed limit at 1 m/s of the tool [s/m], NaN where a joint has none;
    joint_limits, the greatest |q - middle| over half a joint's range, 1 at the limit, and worst_joint, whose it is;
    rcond, the least of [J; J_g]; travel, the mean squared distance of the joints between two poses [rad^2]; clearance,
    the least distance of two shapes [m], less what links are padded, infinite where none was looked at, and closest,
    these two, and where that is. See `Objective`.
    """

    poses: int
    reached: int
    within_limits: int
    squared_speed: float
    worst_speed: float
    joint_limits: float
    worst_joint: str
    rcond: float
    travel: float
    clearance: float = np.inf
    closest: PairDistance | None = None

    def __str__(self) -> str:
        more = ""
        if self.closest is not None:
            more = f"; at their nearest, {self.closest}"
        fastest = ""
        if np.isfinite(self.worst_speed):
            fastest = f"; at a tool speed of 1 m/s the fastest joint has {self.worst_speed:.3g} times its speed limit"
        return (
            f"the leaf reaches {self.reached} of {self.poses} poses, {self.within_limits} within the joint limits\n"
            f"  the mean squared joint speed is {self.squared_speed:.5g} rad^2/m^2{fastest}\n"
            f"  nearest to a limit: {self.worst_joint}, at {self.joint_limits:.0%} of the way from the middle of its "
            "range to a limit\n"
            f"  from one pose to another the joints differ by {np.sqrt(self.travel):.3g} rad (rms); rcond is at least "
            f"{self.rcond:.2g}{more}"
        )


def reached(strategy: HolonomicStrategy, q0: Vector, poses: Array) -> tuple[Matrix, Array]:
    """The postures (k, n) of those of the poses (S, 4, 4) that the leaf through a posture reaches, and these poses.

    Raises:
        OutOfReachError: none is.
    """
    solutions = ik(strategy, q0, limits=False).batch(poses)
    if not solutions.reached.any():
        causes = ", ".join(sorted({InverseStatus(s).name.lower().replace("_", " ") for s in solutions.status}))
        fact = f"none of {len(poses)} poses of the workspace is reached by the leaf of {strategy.name!r} ({causes})"
        raise OutOfReachError(fact, "move or shrink the workspace, or give another start or base constraint")
    return solutions.q[solutions.reached], poses[solutions.reached]


# --- The problem that `design` solves: a base strategy, a workspace, an objective and hard limits; and a strategy of
# it, checked.


@dataclass(frozen=True, eq=False)
class Problem(Value):
    """A base strategy with the posture (n,) in the middle of a workspace; sections over it, and their limits.

    poses, others: tool poses (k, 4, 4) at which sections are made, and at which they are checked.
    """

    base: HolonomicStrategy
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
        """Coefficients (r, 1) of the base strategy itself."""
        return self.base.g(self.center)[:, None]

    def posed(
        self, Q: Matrix, there: Array, coefficients: Matrix, weights: dict[str, float] | None = None
    ) -> tuple[Search, Floor]:
        """The search at poses (S, 4, 4), from postures (S, n) of a section of coefficients (r, t), and its floor."""
        c = self.coordinates
        p, R = np.ascontiguousarray(there[:, :3, 3]), np.ascontiguousarray(there[:, :3, :3])
        section = SectionSamples(TiltedLeaves(self.base, c), monomials_up_to(c.d, self.degree), p, R, c.at(Q))
        near = section.through(Q, coefficients)
        weights = weights or self._weights(near)
        floor = Floor(c, self.costs, weights, self.hard.allowed, Q, p, R)
        # Where limits cannot be kept, the search may use 0.02 of half a joint's range beyond the least violation
        over = floor.here.beyond
        allowed = self.hard.allowed + np.where(over > 0, over + 0.02, 0.0)[:, None]
        return Search(section, self.costs, weights, replace(self.hard, allowed=allowed), near), floor

    def checked(self, coefficients: Matrix, best: Sampled) -> Checked:
        """The strategy of coefficients (r, t) at the other poses, reached on its leaf from the middle of the
        workspace."""
        zeta = Polynomial(self.coordinates, coefficients)
        constraint = tilted(self.base.constraint, zeta, chart=self.coordinates.chart)
        strategy = holonomic(self.base.task, constraint, name="designed")
        middle = ik(strategy, best.Q[0], limits=False)(self.workspace.center)
        arrived, _ = reached(strategy, middle, self.others)
        over, nearer = self.over(arrived), self.hard.nearer(arrived)
        fits = np.concatenate([over, nearer], axis=1).max(axis=1, initial=0.0) <= 0
        return Checked(strategy, zeta, middle, arrived, fits, over.max(axis=0), nearer.max(axis=0))

    def broken(self, sampled: Sampled) -> int:
        """At how many samples of a section a hard limit is broken."""
        beyond = (self.over(sampled.Q) > 0).any(axis=1)
        return int(np.sum(beyond | (self.hard.nearer(sampled.Q) > 0).any(axis=1)))

    def over(self, Q: Matrix) -> Matrix:
        """By how much joints at postures (k, n) are beyond the hard limits (k, n)."""
        return np.abs(Q - self.costs.middle) / self.costs.half - self.hard.allowed

    def measured(self, strategy: HolonomicStrategy, Q: Matrix, poses: int) -> SectionMetrics:
        """The metrics of a strategy at postures (k, n) that it reaches, of so many poses."""
        robot, c, costs, apart = strategy.task.robot, self.coordinates, self.costs, self.hard.apart
        sampled = TiltedLeaves(strategy, c).through(Q, np.zeros((len(Q), strategy.constraint.rows, c.d)))
        off = np.abs(Q - costs.middle) / costs.half
        k, joint = np.unravel_index(int(np.argmax(off)), off.shape)
        clearance, closest = np.inf, None
        if apart is not None:
            distances = apart.distances(Q, np.maximum(apart.limits, apart.wanted))
            clearance = float(counted(distances, apart.limits, apart.wanted).min())
            closest = apart.closest(strategy.task, Q, distances)
        shares = np.sqrt(np.sum((sampled.G * costs.columns) ** 2, axis=2)) / robot.max_velocity
        return SectionMetrics(
            poses=poses,
            reached=len(Q),
            within_limits=int(robot.within(Q).sum()),
            squared_speed=costs.squared_speed(Q, sampled.G).value,
            worst_speed=float(shares.max()) if np.isfinite(robot.max_velocity).all() else np.nan,
            joint_limits=float(off[k, joint]),
            worst_joint=robot.joint_names[joint],
            rcond=float(strategy.gain.batch(Q)[1].min()),
            travel=float(2 * np.sum(costs.joints * Q.var(axis=0))),
            clearance=clearance,
            closest=closest,
        )

    def _weights(self, sampled: Sampled) -> dict[str, float]:
        """The weights of the costs, each divided by what it is at a section, where there are several."""
        weights = self.goal.weights
        if len(weights) == 1:
            return dict.fromkeys(weights, 1.0)
        return {name: weight / self.costs.known[name](sampled.Q, sampled.G).value for name, weight in weights.items()}


@dataclass(frozen=True, eq=False)
class Checked(Value):
    """A strategy of a search, its posture in the middle, and its postures (k, n) at other poses: which keep the limits
    (k,), by how much joints are beyond them at most (n,), and by how much pairs of shapes are too near at most (P,).
    """

    strategy: HolonomicStrategy
    zeta: Polynomial
    middle: Vector
    arrived: Matrix
    fits: Flags
    over: Vector
    nearer: Vector


def based(
    task: Task, base: Constraint | None, q0: Vector, middle: Matrix, units: Vector
) -> tuple[HolonomicStrategy, Vector]:
    """The base strategy, and its posture at the middle of the workspace. Raises: OutOfReachError."""
    strategy = holonomic(task, base) if base is not None else _along_self_motion(task, q0, units)
    try:
        center = ik(strategy, q0, limits=False)(middle)
    except PathError as problem:
        fact = f"the base strategy {strategy.name!r} does not lead from the start to the middle of the workspace"
        cure = "give a start there, another base, or another workspace"
        raise OutOfReachError(f"{fact}: {problem.args[0]}", cure) from None
    return (strategy if base is not None else _along_self_motion(task, center, units)), center


def _along_self_motion(task: Task, q: Vector, units: Vector) -> HolonomicStrategy:
    """Z^T D q = const, D = diag(units), Z (n, r) the self-motions at a posture in coordinates D q."""
    Z = null_space(task.jacobian(q) / units)
    return holonomic(task, linear(Z.T * units, name="the combination of joints along the self-motion"))


SERVED, COSTLY = 0.9, 1.5
"""Share of the poses that the arm serves, and cost over its lower bound: a leaf that serves less, or costs more, is
said to be a poor one. In a wide box the design from a good start came to 1.12 of the bound, from a poor one to 2.7."""


@dataclass(frozen=True, eq=False)
class Design(NoTruthValue, Value, ask="`.holds`"):
    """The best section that was found, as a strategy, and what it was chosen by.

    strategy: an ordinary one; its leaf through `start` (n,), the posture at the middle of the workspace, is the
        section phi(q) = polynomial(x).
    objective: what was made less, with the `length` that turns counted as: a design over another base that is given
        this objective has costs and a bound to compare with these.
    costs: the objective with the base strategy as it was, then after the search with each degree from 0 on. With one
        cost it has the cost's unit, with several it is 1 to begin with. Where the search reaches samples that the base
        strategy does not, the last one alone is of all of them.
    broken: at how many samples the base strategy as it was breaks a hard limit: the search, which keeps them, may cost
        more.
    floor: what no strategy can have less of at the samples; see `bound`.
    before, after: the base strategy and the designed one at the samples. checked: the designed one at other poses, four
        times as many; where the workspace is a cloud, at its own.
    kept: at how many of those reached in the check all hard limits hold.
    """

    strategy: HolonomicStrategy
    q0: Vector
    workspace: Workspace
    objective: Objective
    base: HolonomicStrategy
    polynomial: Polynomial
    costs: tuple[float, ...]
    broken: int
    floor: Floor
    before: SectionMetrics
    after: SectionMetrics
    checked: SectionMetrics
    kept: int

    @cached_property
    def bound(self) -> float:
        """The least objective of any strategy within the limits: the mean over the samples of the least cost of all
        postures there, of every branch. Where several joints are redundant they are searched for, and it may be too
        high.
        """
        return self.floor.of(self.floor.anywhere)

    @cached_property
    def bound_here(self) -> float:
        """The same of the strategies on the same self-motions as this one at each sample."""
        return self.floor.of(self.floor.here)

    @property
    def bound_traced(self) -> bool:
        """Whether whole self-motions were looked at for the bounds, and not lines in them."""
        return one_redundant(self.base.task)

    @cached_property
    def impossible(self) -> int:
        """At how many samples no posture found is within the joint limits, whatever the strategy."""
        return int(np.sum(self.floor.anywhere.beyond > 0)) if self.impossible_here else 0

    @property
    def impossible_here(self) -> int:
        """At how many samples no posture on the self-motions of this strategy is within the joint limits; there the
        search asked for the least violation.
        """
        return int(np.sum(self.floor.here.beyond > 0))

    @cached_property
    def cusps(self) -> NearbyCusps:
        """The cusps found on the leaf within the joint limits, and how near to the workspace they are."""
        return cusps_near(self.strategy, self.q0, self.workspace)

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
        return (
            f"all hard limits of the design (joint limits, clearance) are kept at {self.kept} of "
            f"{self.checked.reached} poses{self._cause}\n"
            f"{goal}: {self.costs[0]:.5g} with the base rule {self.base.name!r} alone{self._began}\n"
            f"  with a polynomial of the tool pose added, degree 0 to {self.degree}: {steps}\n"
            f"  {self._least}\n"
            f"checked at {self.checked.poses} poses: {self.checked}\n"
            f"{self.cusps.lines}"
            f"{self.remark and f'{chr(10)}{self.remark}'}"
        )

    @cached_property
    def remark(self) -> str:
        """That another leaf serves more of the workspace, or costs less; empty where the search knows of none."""
        facts, share = [], self.kept / self.checked.poses
        if share < SERVED:
            task, count = self.base.task, self.checked.poses
            within = float(np.mean(posture_reach(task, self.workspace, self.q0, samples=count).within))
            if share < SERVED * within:
                facts.append(f"it serves {share:.0%} of the poses within the limits, and the arm {within:.0%}")
        if self.bound_traced and self.costs[-1] > COSTLY * self.bound > 0:
            facts.append(f"it costs {self.costs[-1] / self.bound:.2g} times as much as the lower bound")
        return f"a poor leaf: {'; '.join(facts)}; begin on another one, as hk.advise finds it" if facts else ""

    @property
    def _began(self) -> str:
        """What the first of the costs has that the others have not."""
        facts = []
        if self.before.reached < self.after.reached:
            facts.append(f"at the {self.before.reached} samples that it reaches, of {self.after.reached}")
        if self.broken:
            facts.append(f"beyond hard limits at {self.broken} of the samples")
        return f" ({' and '.join(facts)})" if facts else ""

    @property
    def _least(self) -> str:
        """What the bounds are."""
        if not self.bound_traced:
            return f"a search over the postures found at these poses came down to {self.bound:.5g}"
        bound = f"lower bound: a strategy that uses only the postures that were found has at least {self.bound:.5g}"
        if self.bound_here <= self.bound * (1 + 1e-3):
            return bound
        return f"{bound}, a strategy on these self-motions at least {self.bound_here:.5g}"

    @property
    def _cause(self) -> str:
        """Why limits cannot hold."""
        none, elsewhere = self.impossible, self.impossible_here - self.impossible
        cause = f"; at {none} of the samples no posture found is within them" if none else ""
        cure = f"; at {elsewhere} of the samples only postures of other self-motions are: take a start on one of these"
        return cause + (cure if elsewhere else "")


@typed
def design(
    task: Task,
    workspace: Workspace,
    q0: ArrayLike,
    *,
    objective: Objective | Cost = "squared_speed",
    base: Constraint | None = None,
    degree: int = 2,
    limits: bool = True,
    margin: float = 0.0,
    scene: Scene | None = None,
    samples: int = 256,
    seed: int = 0,
) -> Design:
    """The best way to give each tool pose of a workspace its joints: phi(q) = zeta(x), zeta a polynomial of the pose.

    The leaf is that of g = phi - zeta o f, with the rows J_phi - zeta' J, so that zeta adds no algorithmic singularity
    to those of phi. The objective is made least over the coefficients, with exact derivatives, from zeta constant.
    Joint limits and the clearance hold at all samples, and are checked at other poses afterwards.

    Args:
        q0: a posture (n,) on the branch that is to be used.
        objective: an `Objective`, or the name of one cost.
        base: phi, r = n - m rows, regular on the workspace. By default the combinations of joints Z^T q along which the
            self-motion runs in the middle of the workspace, Z (n, r) an orthonormal basis of ker J there (sliding
            joints scaled as in `Objective`).
        degree: of zeta, 0 to 4.
        limits: True makes joint limits hard. margin: distance kept from them [joint units].
        scene: let the links keep their clearance from what is in it, and from each other, a hard limit too. The pairs
            are those of `certify`, and meshes count by their convex hulls. How far apart they are between the samples
            `certify` proves.
        samples: tool poses of the workspace that the search looks at. Those that the base strategy does not reach from
            the middle of the workspace are left out, and counted.

    Raises:
        ArgumentError: the robot is not redundant for the task; bad numbers.
        OutOfReachError: the middle of the workspace is not reached from the start.
        JointLimitError: with limits, q0 is beyond them.
    """
    robot, goal = task.robot, as_objective(objective)
    # Check the numbers
    of_one_tool(task, "design")
    q0 = start_posture(robot, q0, limits)
    if task.n == task.m:
        cure = "each tool pose has its joints already: hk.ik(hk.moore_penrose(task), start) finds them"
        raise ArgumentError("the number of redundant joints", 0, cure)
    if whole("the degree", degree, 0) > 4:  # in three coordinates it has 35 terms then, in six 210
        raise ArgumentError("the degree", degree, "give 0 to 4")
    not_negative("the margin", margin)
    whole("seed", seed, 0)
    # Reach the poses with the base strategy; they say in which coordinates polynomials are written
    poses = task_poses(task, workspace, whole("samples", samples), seed)
    others = workspace.poses(4 * samples, seed + 1)
    base_strategy, center = based(task, base, q0, workspace.center, np.sqrt(joint_weights(robot)))
    Q, there = reached(base_strategy, center, poses)
    coordinates = coordinates_of(chart_of(task, workspace.center[:3, :3]), Q)
    # The costs, and the hard limits: none of the joints that have no range
    goal = replace(goal, length=length_of(goal, coordinates.turns, coordinates.spread))
    costs = costs_of(robot, goal, coordinates.turns, coordinates.spread)
    allowed = np.where(np.isfinite(costs.half) & limits, 1 - margin / costs.half, np.inf)
    hard = Limits(allowed, clearances_of(robot, scene))
    # Search
    problem = Problem(base_strategy, center, workspace, coordinates, costs, goal, hard, degree, poses, others)
    return _solved(problem, Q, there)


def _solved(problem: Problem, Q: Matrix, there: Array) -> Design:
    """The best section of a problem, from postures (S, n) of the base strategy at those poses (S, 4, 4) that it
    reaches."""
    poses, degree = problem.poses, problem.degree
    # The first search, from the base strategy; its section is checked at the other poses
    search, floor = problem.posed(Q, there, problem.first)
    near, before = search.near, problem.measured(problem.base, Q, len(poses))
    coefficients, best, costs = search.best(problem.first, degree)
    checked, costs = problem.checked(coefficients, best), (search.cost(near).value, *costs)
    for _ in range(2):
        # Go on where more samples are reached now, or with narrower limits where some are broken between the samples
        Q, there = reached(checked.strategy, checked.middle, poses) if len(best.Q) < len(poses) else (best.Q, poses)
        further = len(Q) > len(best.Q)
        if further:
            search, floor = problem.posed(Q, there, coefficients, search.weights)
        elif checked.fits.all() or floor.here.beyond.any() or (problem.hard.nearer(best.Q) > 0).any():
            break
        else:
            limits = search.limits.narrowed(checked.over, checked.nearer)
            search = replace(search, near=best, limits=limits)
        # Keep what this search finds, if it reaches more samples or keeps the limits at more poses
        new_coefficients, section, lower = search.best(coefficients, degree)
        again = problem.checked(new_coefficients, section)
        if not further and again.fits.sum() <= checked.fits.sum():
            break
        coefficients, best, checked = new_coefficients, section, again
        costs = (*costs[: degree + 2 - len(lower)], *lower)
    return Design(
        strategy=checked.strategy,
        q0=checked.middle,
        workspace=problem.workspace,
        objective=problem.goal,
        base=problem.base,
        polynomial=checked.zeta,
        costs=costs,
        broken=problem.broken(near),
        floor=floor,
        before=before,
        after=problem.measured(checked.strategy, best.Q, len(poses)),
        checked=problem.measured(checked.strategy, checked.arrived, len(problem.others)),
        kept=int(checked.fits.sum()),
    )
