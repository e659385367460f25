"""Following by leaf: Newton on [f(q) - x; g(q) - c], in steps that keep to one branch.

In a region of tool poses around the start the same pose then has the same joints, whatever happened before. A step is
accepted only where `branch` shows that no fold lies on its path; else it is shortened.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, BranchError, HolokinError, NotFiniteError, ShapeError, posture_text
from ...base.tolerances import TOLERANCES
from ...base.types import Array, ArrayLike, Flags, Indices, Matrix, Vector, finite, kept
from ...path.path import straight
from ...robot import start_posture
from ...robot.joints import WOUND
from ...strategies import HolonomicStrategy, Jump, Strategy, holonomic
from ...strategies.constraints import custom
from ...strategies.strategy import hardest_motion
from ...strategies.tasks.frame_task import completed
from ...strategies.tasks.task import Task
from ...symbolic import Function, symbol
from ...symbolic.native import LeafRules
from ..self_motions.posture_search import EXACT, LONGEST, STEPS, newton
from .branch import SHORTEST, Branch, Fold, branch_code, keeps_turns
from .plan import NativeFollower, Plan

ALMOST = 1e-7
"""A correction after which one more is the last, whether or not round-off lets it be smaller."""

DONE = 1e-9
"""A correction after which none is needed: its square is far below round-off."""

NEWTONS = 12
"""Newton steps: contraction by 1/8 a step gets from 1 to 1e-10 in them; it is quadratic long before."""

TRIES = 20_000
"""Pieces of one interval tried at most: 1e-4 rad beside a singularity it takes ten thousand."""

CREEP = 1e-10
"""Joint motion [joint units] of a piece of an interval below which a walk is at a fold: pieces shrink in proportion to
the joints' distance from it."""


WITHIN = "choose another leaf or pose, widen the limits by hk.with_limits, or ask with limits=False"
"""The cure of an answer beyond the joint limits."""

REGULAR = 1e-3
"""rcond from which a follower that stops is at no fold."""

Pose = tuple[Vector, Matrix]
"""A pose of the tool: position (3,), rotation (3, 3)."""


@dataclass(frozen=True, eq=False)
class LeafPath:
    """How a target moves over an interval: at(share), from 0 to 1, -> position (3,), rotation (3, 3), level c (r,).

    arc [m]: size of the second derivative of the position by the share; turn [rad]: of the tool, over the interval.
    """

    at: Callable[[float], tuple[Vector, Matrix, Vector]]
    arc: float = 0.0
    turn: float = 0.0

    def curve(self, width: float, margin: float) -> float:
        """A bound of |d^2 x / dt^2|, t from 0 to 1 over a piece of a width [m or rad].

        margin: distance of an orientation's angles from their singularity; those of an even turn w have second
        derivatives of at most 2 |w|^2 / margin^2.
        """
        return width * width * (self.arc + 2 * (self.turn / min(1.0, margin)) ** 2)


def with_leaves(strategy: Strategy) -> HolonomicStrategy:
    """The strategy, which must have leaves; where nothing is redundant, n = m, that of the one leaf of all postures.

    Raises:
        ArgumentError: the pose and a leaf do not tell its joints.
    """
    if isinstance(strategy, HolonomicStrategy):
        return strategy
    if strategy.task.n == strategy.task.m:
        return holonomic(strategy.task, custom(lambda _q: [], rows=0), name=strategy.name)
    raise ArgumentError("the strategy", strategy, HolonomicStrategy.cure)


@kept
def leaf_step(strategy: HolonomicStrategy) -> Function:
    """(q, p, R, c) -> (Newton correction, rcond, margin, sign of det [J; J_g]).

    One Newton step on [f(q) - x; g(q) - c] towards the tool pose (p, R) on the leaf c.
    """
    strategy = strategy.looped
    e, task = strategy.expressions, strategy.task
    (p, R), c = task._target_symbols(), symbol("c", task.n - task.m)
    solution = e.rate(task._error_expression(e.kinematics, p, R), strategy.leaf_gap(c))
    outputs = {"dq": solution.X, "rcond": solution.rcond, "margin": strategy._margin_expression}
    outputs["side"] = solution.orientation
    return Function("leaf_step", {"q": e.q, "p": p, "R": R, "c": c}, outputs, solution.system, strategy.transport)


def newton_on_leaf(
    correct: Function, q: Vector, p: Vector, R: Matrix, c: Vector, side: float
) -> tuple[Vector, float] | None:
    """(posture, margin) at the tool pose (p, R) on the leaf c, to which the steps of `leaf_step` contract from q.

    None where they do not, or where something is singular or det [J; J_g] has another sign than `side`.
    """
    memory = correct.memory
    posture, *target = memory.arguments
    target[0][...], target[1][...], target[2][...] = p, R, c
    dq, rcond, margin, side_now = memory.results
    posture[...] = q
    before = np.inf
    for _ in range(NEWTONS):
        memory.trigger()
        size = max(map(abs, dq.tolist()))
        sound = rcond[0] > TOLERANCES.singular and margin[0] > TOLERANCES.representation
        if not (sound and side_now[0] == side):
            return None
        last = before <= ALMOST
        if last and not size <= before:
            return posture.copy(), float(margin[0])
        if not (last or size <= max(TOLERANCES.contraction * before, DONE)):
            return None
        posture += dq
        if last or size <= DONE:
            return posture.copy(), float(margin[0])
        before = size
    return None


def leaf_follower(
    strategy: HolonomicStrategy, q0: Vector, tries: int = TRIES, ray: bool = False
) -> Callable[[Vector, LeafPath], Vector]:
    """(q, path) -> the posture at path.at(1), continued from q, which is at path.at(0); on the branch of q0.

    Args:
        tries: pieces of one path tried at most. ray: see `leaf_walk`.

    Raises:
        SingularityError (when called): [J; J_g] is singular there. BranchError: the leaf ends.
    """
    walk = leaf_walk(strategy, q0, tries, ray)

    def follow(q: Vector, path: LeafPath) -> Vector:
        last, ended = walk(q, path)
        if ended is not PathEnd.REACHED:
            raise leaf_problem(strategy, last, ended, tries)
        return last

    return follow


class PathEnd(Enum):
    """How a path along a leaf ended."""

    REACHED = "it was gone to its end"
    STOPPED = "no further piece of it could be shown to keep to the branch"
    TRIED = "it took too many pieces"
    FOLD = "the leaf ends there"


NATIVE_ENDS, NATIVE_LIMIT = {1: PathEnd.STOPPED, 2: PathEnd.TRIED}, 3
"""What native code says by hk_ends of follow.c."""


def leaf_problem(strategy: HolonomicStrategy, q: Vector, ended: PathEnd, tries: int = TRIES) -> HolokinError:
    """Why a path along a leaf got no farther than q."""
    posture, hard = posture_text(q, strategy.task.robot.joint_names), hardest_motion(strategy, q)
    if ended is PathEnd.TRIED:
        fact = f"{strategy.name!r} did not lead to the end of the path in {tries:,} pieces"
        where = f", and came to {posture}: there {hard}" if hard else ""
        return BranchError(f"{fact}{where}", "go in shorter ways, or keep them away from singular postures")
    try:
        strategy(q)  # raises if it is singular already here
    except HolokinError as problem:
        return problem
    rcond = strategy.gain(q)[1]
    if rcond > REGULAR and ended is not PathEnd.FOLD:
        return BranchError(
            f"from {posture} no step of {strategy.name!r} could be shown to go on without a jump of the joints, though "
            f"the posture is not singular (rcond {rcond:.1e})",
            "take a start nearer by; the pose may be out of reach, or a constraint of yours have kinks and jumps",
        )
    return BranchError(
        f"{strategy.name!r} leads no farther than {posture}: {hard or 'it is singular there'}, and no posture nearby "
        "follows the path",
        "choose another constraint, or another start posture",
    )


def jump_problem(strategy: HolonomicStrategy, jump: Jump, where: str = "", walk: Any = None) -> BranchError:
    """What is said of a leaf that ends where g jumps."""
    posture = posture_text(jump.q, strategy.task.robot.joint_names)
    place = f"at {posture}, where its g jumps by {jump.level:.3g} ({jump.what})"
    fact = f"{where}the leaf of {strategy.name!r} ends {place}"
    cure = "write g without the jump, mark it as an angle if it is one, or keep the path away from there"
    return BranchError(fact, cure, walk, jump.what, jump.q, jump.level)


def leaf_walk(
    strategy: HolonomicStrategy, q0: Vector, tries: int = TRIES, ray: bool = False, folds: bool = False
) -> Callable[[Vector, LeafPath], tuple[Vector, PathEnd]]:
    """(q, path) -> (the posture to which the path was gone, continued from q, on the branch of q0; how it ended).

    ray: the ways are rays of a radial strategy from its center, so that no fold need be looked for. folds: give a path
    up where a fold is seen ahead, as native inverse kinematics does.
    """
    correct, branch, smallest = leaf_step(strategy), Branch(strategy), SHORTEST if ray else TOLERANCES.smallest_step
    rate = np.zeros(len(q0))  # of the last step, to begin the next one's search
    angular, angles = any(strategy.task._angular), strategy.task._by_angles
    side = correct(q0, *strategy.task._place(q0), leaf_value(strategy, q0))[3]

    def walk(q: Vector, path: LeafPath) -> tuple[Vector, PathEnd]:
        nonlocal rate
        path = path if angular else replace(path, turn=0.0)
        share, width, fold = 0.0, 1.0, Fold()

        def solve(begun: Vector, place: float) -> Vector | None:
            solution = newton_on_leaf(correct, begun, *path.at(place), side)
            return None if solution is None else solution[0]

        for _ in range(tries):
            # Newton's method at the end of the next piece, from where the last rate leads.
            goal = min(1.0, share + width)
            begun = q + (goal - share) * rate
            solution, fits = newton_on_leaf(correct, begun, *path.at(goal), side), 0.5
            if solution is not None and ray:
                fits = 2.0 if keeps_turns(q, begun, solution[0]) else 0.5
            elif solution is not None:
                fits = branch.step(q, solution[0], path.curve(goal - share, solution[1] if angles else 1.0))
            # The piece is shown to keep to the branch: go on from its end.
            if solution is not None and fits >= 1.0:
                move = solution[0] - q
                rate = move / (goal - share)
                if goal == 1.0:
                    return solution[0], PathEnd.REACHED
                if not max(map(abs, move.tolist())) > CREEP:
                    return q, PathEnd.STOPPED
                q, share, width, middle = solution[0], goal, fits * (goal - share), (share + goal) / 2
                if folds and not ray:
                    end = fold.ahead(q, share, middle, rate, solve, lambda q, place: correct(q, *path.at(place))[0])
                    if end is not None:
                        return end, PathEnd.FOLD
                continue
            # It is not: try a shorter one.
            width = fits * (goal - share)
            if width < smallest:
                return q, PathEnd.STOPPED
        return q, PathEnd.TRIED

    return walk


def straight_path(task: Task, begin: Pose, end: Pose, levels: tuple[Vector, Vector]) -> LeafPath:
    """The straight path from one pose of the tool to another, without free motion, from one level to another."""
    end = completed(task, end, begin)
    line, (c0, c1) = straight(*begin, *end), levels

    def at(share: float) -> tuple[Vector, Matrix, Vector]:
        if share == 1.0:  # to the last bit, also where the last digits of a rotation are not those of one
            return *end, c1
        return *line.at(share), c0 + share * (c1 - c0)

    return LeafPath(at, turn=float(np.linalg.norm(line.turn)))


def leaf_stepper(
    strategy: HolonomicStrategy, plan: Plan, q0: Vector, tries: int = TRIES
) -> Callable[[Vector, int], Vector]:
    """(q, step) -> q after that step of the plan, on the leaf through q0, in so many pieces at most.

    Raises (when called): as `leaf_follower`.
    """
    walk, c = leaf_follower(strategy, q0, tries), leaf_value(strategy, q0)
    return lambda q, i: walk(q, LeafPath(lambda share: (*plan.target(i, share), c), *plan.bends(i)))


def leaf_rules(side: float, tries: int = TRIES) -> LeafRules:
    """The rules of native code for steps on the branch whose det [J; J_g] has the sign `side`."""
    t = TOLERANCES
    return LeafRules(
        t.singular, t.representation, t.contraction, ALMOST, DONE, t.smallest_step, CREEP, side, NEWTONS, tries
    )


def native_leaf(
    strategy: HolonomicStrategy, plan: Plan, q0: Vector, limits: bool, *, load: bool, build: bool
) -> NativeFollower | None:
    """The same steps as native code, many in one call; None without it, see `Function.follower`."""
    step = leaf_step(strategy)
    kernel = step.follower("leaf", lambda: branch_code(strategy), load=load, build=build)
    if kernel is None:
        return None
    (p, R), c = plan.first, leaf_value(strategy, q0)
    rules = leaf_rules(float(step(q0, p, R, c)[3]), TRIES)
    x = np.concatenate([q0, p, R.ravel(), c, np.zeros(len(q0) + 1)])

    def halted() -> None:
        q = x[: len(q0)].copy()
        if x[-1] == NATIVE_LIMIT:
            strategy.task.robot.check_limits(q)
        elif x[-1] > 0:
            raise leaf_problem(strategy, q, NATIVE_ENDS[int(x[-1])])

    return NativeFollower(kernel, plan, x, rules, limits, halted)


def leaf_postures(
    strategy: HolonomicStrategy, q: Matrix, p: Array, R: Array, c: Vector
) -> tuple[Matrix, Vector, Flags]:
    """(postures (k, n), rcond (k,), whether Newton's method got there (k,)) from starts (k, n), on one leaf c (r,).

    Args:
        p, R: tool positions (k, 3) and rotations (k, 3, 3), or one of each for all.
    """
    step, rcond, own = leaf_step(strategy), np.zeros(len(q)), p.ndim > 1

    def correct(q: Matrix, i: Indices) -> tuple[Matrix, Flags]:
        dq, quality, margin, _ = step.batch(q, p[i] if own else p, R[i] if own else R, c)
        rcond[i] = np.ravel(quality)
        return dq.reshape(q.shape), np.ravel(margin) > TOLERANCES.representation

    q, arrived = newton(correct, q, steps=STEPS, longest=LONGEST, exact=EXACT)
    return q, rcond, arrived


@typed
def leaf_value(strategy: HolonomicStrategy, q: Vector) -> Vector:
    """g(q) (r,); empty when nothing is redundant. Raises: NotFiniteError."""
    if strategy.task.n == strategy.task.m:
        return np.zeros(0)
    value = np.atleast_1d(strategy.constraint_value(q))
    if not np.isfinite(value).all():
        raise NotFiniteError(f"the constraint of {strategy.name!r} at q = {q.tolist()}", value.tolist())
    return value


@typed
def move_to_leaf(strategy: HolonomicStrategy, q0: ArrayLike, level: ArrayLike = 0.0, *, limits: bool = True) -> Vector:
    """The posture (n,) with the tool pose of q0 on another leaf g(q) = c, reached by the self-motion from q0.

    A strategy keeps the leaf of its start posture. To hold a *stationary* cost the start must be on the leaf 0 of
    `stationary(cost)`, to hold a certain arm angle on that angle's leaf: begin from here.

    Args:
        level: c (r,), or one number for all rows; an angle is gone to by its shorter way.
        limits: False does not look whether the start and the posture keep the joint limits.

    Raises:
        SingularityError, BranchError: no such posture before a singular one. ArgumentError: a strategy without leaves;
            a level that must be in degrees. JointLimitError: with limits, the start or the posture is beyond them.
        ShapeError, NotFiniteError.
    """
    task = strategy.task
    start = start_posture(task.robot, q0, limits)
    strategy(start)
    level_now, goal = leaf_value(strategy, start), level_towards(strategy, start, level)
    pose = task._place(start)
    posture = leaf_follower(strategy, start)(start, straight_path(task, pose, pose, (level_now, goal)))
    if limits:
        task.robot.check_limits(posture, WITHIN)
    return posture


def level_towards(strategy: HolonomicStrategy, q0: Vector, level: ArrayLike) -> Vector:
    """A level c (r,) as users give it, or one number for all rows; angles are moved by whole turns next to that of q0.

    Raises: ArgumentError, ShapeError, NotFiniteError.
    """
    level_now, wanted = leaf_value(strategy, q0), finite("the level", level)
    if wanted.shape not in ((), level_now.shape):
        raise ShapeError("the level", level_now.shape, wanted.shape)
    goal = np.broadcast_to(wanted, level_now.shape)
    check_levels(strategy, goal)
    _check_in_reach(strategy, q0, goal - level_now)
    return level_now + strategy.constraint.nearest(goal - level_now)


def _check_in_reach(strategy: HolonomicStrategy, q: Vector, change: Vector) -> None:
    """Raises: ArgumentError: a sum of joints is to change by more than two turns beyond what their limits allow."""
    if np.abs(change).max(initial=0.0) <= 1.0:
        return  # no degrees
    robot, A = strategy.task.robot, np.abs(strategy.rows(q))
    if not np.array_equal(A, np.abs(strategy.rows(q + 0.1))):
        return  # no sum
    room = np.maximum(robot.upper - q, q - robot.lower) + WOUND
    with np.errstate(invalid="ignore"):
        far = np.abs(change) > np.where(A > 0, A * room, 0.0).sum(axis=1)
    if far.any():
        level = float((leaf_value(strategy, q) + change)[far][0])
        cure = "it is more than two turns beyond the joint limits: give angles in rad, as np.radians(...) makes them"
        raise ArgumentError("the level", level, cure)


def check_levels(strategy: HolonomicStrategy, levels: Vector) -> None:
    """Raises: ArgumentError: a level (r,) of a row that is an angle is more than two turns, as degrees are."""
    far = np.array(strategy.constraint.angular, dtype=bool) & (np.abs(levels) > WOUND)
    if far.any():
        level = float(levels[far][0])
        cure = f"an angle in rad is wanted: {level:g} degrees are {np.radians(level):.4g}"
        raise ArgumentError("the level", level, cure)
