"""`design`: the best section of a workspace, as an ordinary strategy with leaves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.types import Array, ArrayLike, Matrix, NoTruthValue, Value, Vector, not_negative, whole
from ...path.workspaces import Workspace
from ...proof.kept_apart import CLEARANCE, clearances_of
from ...robot import LinkShape, Robot, check_metres, start_posture
from ...strategies import HolonomicStrategy
from ...strategies.constraints import Constraint
from ...strategies.tasks.task import Task, of_one_tool
from ..coverage.coordinates import Polynomial, chart_of, coordinates_of
from .design_problem import Problem, based, hard_limits
from .law_metrics import SectionMetrics, reached
from .lower_bound import Floor
from .nearby_cusps import MORE_SPEED, DegreeTried, NearbyCusps, cusps_near, said_of_degrees
from .objectives import Cost, Objective, as_objective, costs_of, joint_weights, length_of
from .own_cost import OwnCost

HIGHEST = 4
"""Degree of a polynomial at most: in three coordinates it has 35 terms then, in six 210."""

ROUNDS = 3
"""Searches at most: another one follows where the design reaches samples that the base law did not, and, with limits
narrowed, where poses between the samples are beyond them."""

APART = 1e-3
"""Share by which the least of all postures is below that of the own self-motions where both are told."""

FINER = 4
"""Poses that a design is checked at, for each one that it was searched at."""


@dataclass(frozen=True, eq=False)
class Design(NoTruthValue, Value, ask="`.holds`"):
    """The best section that was found, as a strategy, and what it was chosen by.

    strategy: an ordinary one; its leaf through `start` (n,), the posture at the middle of the workspace, is the
        section phi(q) = polynomial(x).
    objective: what was made less, with the `length` that turns counted as: a design over another base that is given
        this objective has costs and a bound to compare with these.
    costs: the objective with the base law as it was, then after the search with each degree from 0 on. With one cost it
        has the cost's unit, with several it is 1 to begin with. Where the search reaches samples that the base law does
        not, the last one alone is of all of them.
    broken: at how many samples the base law as it was breaks a hard limit: the search, which keeps them, may cost more.
    floor: what no law with the postures found at the samples can have less of; see `bound`.
    before, after: the base law and the designed one at the samples. checked: the designed one at other poses, four
        times as many; where the workspace is a cloud, at its own.
    kept: at how many of those reached in the check all hard limits hold.
    looked_at: of a design that was to avoid cusps, those of the degrees tried, the highest first, of which one is this.
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
    looked_at: tuple[DegreeTried, ...] = ()

    @cached_property
    def bound(self) -> float:
        """The least objective of any law within the limits: the mean over the samples of the least cost of all postures
        that a search finds there, of every branch. Where several joints are redundant it may be too high.
        """
        return self.floor.of(self.floor.anywhere)

    @cached_property
    def bound_here(self) -> float:
        """The same of the laws on the same self-motions as this one at each sample."""
        return self.floor.of(self.floor.here)

    @property
    def bound_traced(self) -> bool:
        """Whether whole self-motions were walked for the bounds, and not lines in them."""
        return self.floor.here.traced

    @cached_property
    def impossible(self) -> int:
        """At how many samples no posture found is within the joint limits, whatever the law."""
        return int(np.sum(self.floor.anywhere.beyond > 0)) if self.impossible_here else 0

    @property
    def impossible_here(self) -> int:
        """At how many samples no posture on the self-motions of this law is within the joint limits; there the search
        asked for the least violation.
        """
        return int(np.sum(self.floor.here.beyond > 0))

    @cached_property
    def cusps(self) -> NearbyCusps:
        """The cusps found on the leaf within the joint limits, and how near to the workspace they are."""
        known = next((one.cusps for one in self.looked_at if one.degree == self.degree), None)
        return cusps_near(self.strategy, self.q0, self.workspace) if known is None else known

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
            f"{goal}: {self.costs[0]:.5g} with the base rule {self.base.name!r} alone{self._began}\n"
            f"  with a polynomial of the tool pose added, degree 0 to {self.degree}: {steps}\n"
            f"  {self._least}\n"
            f"checked at {self.checked.poses} poses: {self.checked}\n"
            f"all hard limits of the design (joint limits, rcond, clearance) are kept at {self.kept} of "
            f"{self.checked.reached} poses{self._cause}\n"
            f"{said_of_degrees(self.degree, self.looked_at, self.cusps)}"
        )

    @property
    def _began(self) -> str:
        """What the first of the costs has that the others have not."""
        broken = f"beyond hard limits at {self.broken} of the samples" if self.broken else ""
        fewer = self.before.reached < self.after.reached
        reached = f"at the {self.before.reached} samples that it reaches, of {self.after.reached}" if fewer else ""
        said = " and ".join(fact for fact in (reached, broken) if fact)
        return f" ({said})" if said else ""

    @property
    def _least(self) -> str:
        """What the bounds are."""
        if not self.bound_traced:
            return f"a search over the postures found at these poses came down to {self.bound:.5g}"
        said = f"lower bound: a law that uses only the postures that were found has at least {self.bound:.5g}"
        apart = self.bound_here > self.bound * (1 + APART)
        return f"{said}, a law on these self-motions at least {self.bound_here:.5g}" if apart else said

    @property
    def _cause(self) -> str:
        """Why limits cannot hold."""
        none, elsewhere = self.impossible, self.impossible_here - self.impossible
        said = f"; at {none} of the samples no posture found is within them" if none else ""
        cure = f"; at {elsewhere} of the samples only postures of other self-motions are: take a start on one of these"
        return said + (cure if elsewhere else "")


@typed
def design(
    task: Task,
    workspace: Workspace,
    q0: ArrayLike,
    *,
    objective: Objective | OwnCost | Cost = "squared_speed",
    base: Constraint | None = None,
    degree: int = 2,
    limits: bool = True,
    margin: float = 0.0,
    rcond: float = 0.0,
    clear_of: Sequence[LinkShape] | None = None,
    floor: float | None = None,
    clearance: float = CLEARANCE,
    self_collision: bool = True,
    ignore: Sequence[tuple[str, str]] = (),
    shapes_of: Robot | None = None,
    samples: int = 256,
    seed: int = 0,
    avoid_cusps: bool = False,
) -> Design:
    """The best way to give each tool pose of a workspace its joints: phi(q) = zeta(x), zeta a polynomial of the pose.

    The leaf is that of g = phi - zeta o f, with the rows J_phi - zeta' J, so that zeta adds no algorithmic singularity
    to those of phi. The objective is made least over the coefficients, with exact derivatives, from zeta constant.
    Joint limits, the least rcond and the clearance hold at all samples, and are checked at other poses afterwards.

    Args:
        q0: a posture (n,) on the branch that is to be used.
        objective: an `Objective`, the name of one cost, or an `OwnCost`.
        base: phi, r = n - m rows, regular on the workspace. By default the combinations of joints Z^T q along which the
            self-motion runs in the middle of the workspace, Z (n, r) an orthonormal basis of ker J there (sliding
            joints scaled as in `Objective`).
        degree: of zeta, 0 to 4.
        limits: True makes joint limits hard. margin: distance kept from them [joint units].
        rcond: the least rcond of [J; J_g], a hard limit too; 0 for none.
        clear_of: let no link come nearer than `clearance` to these obstacles (`hk.obstacle`), to the floor, or to
            another link, a hard limit too; [] for the floor and the links alone. The pairs are those of `certify`, and
            meshes count by their convex hulls. How far apart they are between the samples `certify` proves.
        floor, clearance, self_collision, ignore, shapes_of: as of `certify`.
        samples: tool poses of the workspace that the search looks at. Those that the base law does not reach from the
            middle of the workspace are left out, and counted.
        avoid_cusps: where a cusp of the leaf lies in the workspace or near it, a design of a lower degree without such
            a cusp is taken, if it costs at most a tenth more and serves as much. It takes seconds for each degree.

    Raises:
        ArgumentError: the robot is not redundant for the task; bad numbers.
        OutOfReachError: the middle of the workspace is not reached from the start.
        JointLimitError: with limits, q0 is beyond them.
    """
    robot, goal = task.robot, as_objective(objective)
    of_one_tool(task, "design")
    q0 = start_posture(robot, q0, limits)
    if task.n == task.m:
        cure = "each tool pose has its joints already: hk.inverse(hk.moore_penrose(task), start) finds them"
        raise ArgumentError("the number of redundant joints", 0, cure)
    if whole("the degree", degree, 0) > HIGHEST:
        raise ArgumentError("the degree", degree, f"give 0 to {HIGHEST}")
    not_negative("the margin", margin)
    if not 0 <= rcond < 1:
        raise ArgumentError("the least rcond", rcond, "give a number from 0 to 1")
    whole("seed", seed, 0)

    shapes, pairs = (clear_of, floor), (self_collision, ignore, shapes_of)
    apart = clearances_of(robot, *shapes, clearance, *pairs)
    if goal.clearance and apart is None:
        cure = "give clear_of, too: obstacles, or [] for the floor and the links alone"
        raise ArgumentError("the weight of clearance", goal.clearance, cure)
    poses, others = workspace.poses(whole("samples", samples), seed), workspace.poses(FINER * samples, seed + 1)
    check_metres(robot, poses, task.tip)
    law, center = based(task, base, q0, workspace.center, np.sqrt(joint_weights(robot, goal)))
    Q, there = reached(law, center, poses)
    coordinates = coordinates_of(chart_of(task, workspace.center[:3, :3]), Q)
    goal = replace(goal, length=length_of(goal, coordinates.turns, coordinates.spread))
    near = clearances_of(robot, *shapes, goal.enough_clearance, *pairs) if goal.clearance else None
    costs = costs_of(robot, goal, coordinates.turns, coordinates.spread, near)
    hard = hard_limits(costs, margin if limits else None, rcond, apart)
    problem = Problem(law, center, workspace, coordinates, costs, goal, hard, degree, poses, others)
    best = _solved(problem, Q, there)
    return _away_from_cusps(problem, best, Q, there) if avoid_cusps else best


def _away_from_cusps(problem: Problem, best: Design, Q: Matrix, there: Array) -> Design:
    """The best design of a problem, or, other things equal, that of the highest degree without a cusp nearby."""
    made, most, degree = [best], MORE_SPEED * best.costs[-1], best.degree
    while made[-1].cusps.near and degree:
        degree -= 1
        if best.costs[degree + 1] <= most:
            other = _solved(replace(problem, degree=degree), Q, there)
            if other.costs[-1] <= most and _serves_as_much(other, best):
                made.append(other)
    taken = made[-1] if made[-1].cusps.clear else best
    return replace(taken, looked_at=tuple(DegreeTried(one.degree, one.costs[-1], one.cusps) for one in made))


def _serves_as_much(one: Design, other: Design) -> bool:
    """Whether it reaches as many poses, and as many within the hard limits."""
    fewer = one.after.reached < other.after.reached or one.checked.reached < other.checked.reached
    return one.kept >= other.kept and not fewer


def _solved(problem: Problem, Q: Matrix, there: Array) -> Design:
    """The best section of a problem, from postures (S, n) of the base law at those poses (S, 4, 4) that it reaches."""
    poses, degree = problem.poses, problem.degree
    search, floor = problem.posed(Q, there, problem.first)
    near, before = search.near, problem.measured(problem.law, Q, len(poses))
    found, best, more = search.best(problem.first, degree)
    result, values = problem.checked(found, best), (search.cost(near).value, *more)
    for _ in range(ROUNDS - 1):
        Q, there = reached(result.strategy, result.middle, poses) if len(best.Q) < len(poses) else (best.Q, poses)
        further = len(Q) > len(best.Q)
        if further:
            search, floor = problem.posed(Q, there, found, search.weights)
        elif result.fits.all() or floor.here.beyond.any() or (problem.hard.nearer(best.Q) > 0).any():
            break
        else:
            search = replace(search, near=best, limits=search.limits.narrowed(result.over, result.short, result.nearer))
        again = search.best(found, degree)
        checked = problem.checked(*again[:2])
        if not further and checked.fits.sum() <= result.fits.sum():
            break
        (found, best, more), result = again, checked
        values = (*values[: degree + 2 - len(more)], *more)
    return Design(
        strategy=result.strategy,
        q0=result.middle,
        workspace=problem.workspace,
        objective=problem.goal,
        base=problem.law,
        polynomial=result.zeta,
        costs=values,
        broken=problem.broken(near),
        floor=floor,
        before=before,
        after=problem.measured(result.strategy, best.Q, len(poses)),
        checked=problem.measured(result.strategy, result.arrived, len(problem.others)),
        kept=int(result.fits.sum()),
    )
