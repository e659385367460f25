"""Straight paths to tool poses on one leaf of a strategy: from the start of `ik`, or from another posture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from ...base.errors import BranchError, OutOfReachError, posture_text
from ...base.poses import pose_from
from ...base.tolerances import TOLERANCES
from ...base.types import Array, Flags, Indices, Matrix, Value, Vector, frozen
from ...robot.chains import longest_span
from ...strategies import HolonomicStrategy, Jump, first_jump, jump_near, may_jump
from ...strategies.jumps import states
from ...strategies.tasks.frame_task import FrameTask
from ...strategies.tasks.task import Task, TipFrame
from ...symbolic.native import InverseKernel
from .arm_reach import reach_code, some_posture
from .branch import on_ray
from .closed_leaf import ClosedBranch, closed_branch, closed_leaf, turn_before_jump
from .continuation import continuation_code
from .edge import inverse_code, stretch_code
from .leaf import (
    REGULAR,
    WITHIN,
    LeafPath,
    PathEnd,
    jump_problem,
    leaf_problem,
    leaf_step,
    leaf_value,
    leaf_walk,
    straight_path,
)
from .plan import Plan, doubtful_target
from .solutions import InverseStatus, beyond_limits, in_rows

# --- Can the tool get there at all? Asked only after following has failed.

RESTARTS = 64
"""Random postures tried besides the last one before a target is called out of reach. At eleven poses far out on a
Panda's circle of 0.35 m, one start in three got there; with 8 starts one of them was missed."""

ROUND = 16
"""Random postures that are tried side by side before a target that none of them reached gets more."""

ALIKE = 1.01
"""Where half of a round's searches end within this factor of the least error that was found, no more are made: beyond
the reach of an arm all of them lead to the same stretched posture."""

STATIONARY = 1e-3
"""Largest cosine between the error that is left and what a joint does to it at which a search has got to its end."""

REACHED = TOLERANCES.tracking / 10
"""Error [m or rad] at which a target counts as reached."""

FAR = TOLERANCES.tracking
"""Error [m or rad] from which a search that gains no more has got to its end: nearer by it may yet arrive."""


@dataclass(frozen=True, eq=False)
class NearestPostures(Value):
    """For each of k targets the posture found nearest to it, and the error that is left [m or rad].

    ended (k,): True where the search had got to its end there, so that more looks would find no more.
    """

    q: Matrix
    missing: Vector
    ended: Flags

    @property
    def reached(self) -> Flags:
        """True where a posture reaches the target (k,)."""
        return self.missing <= REACHED


class Beyond(NamedTuple):
    """The first target of a path that no search reaches: at which share of the path, by how much the tool misses it [m
    or rad], where it is (3,) [m], and what is in the way, in words."""

    share: float
    missing: float
    position: Vector
    why: str

    @property
    def fact(self) -> str:
        """All of it in words."""
        place = posture_text(np.round(self.position, 9))
        where = f"{100 * self.share:.3g} % along it, at the point {place} m"
        off = f"no search came closer to the tool pose than {self.missing:.3g} (m or rad)"
        return f"the path is out of reach: {where}, {off}{self.why}"


def out_of_reach(plan: Plan, q: Vector, step: int, limits: bool) -> Beyond | None:
    """The first target of a path from a step on that no search reaches; else None.

    Least squares within the joint limits from the last posture, then from random ones. None also where the searches
    did not come to an end, since nothing is known then.
    """
    for i in np.unique(np.linspace(step, plan.steps - 1, 24).astype(int)):
        position, rotation = plan.target(int(i), 1.0)
        nearest = nearest_postures(plan.task, position[None], rotation[None], q[None], limits=limits)
        if not nearest.reached[0]:
            if not nearest.ended[0]:
                return None
            why = _in_the_way(plan.task, position, rotation, q, limits)
            return Beyond((i + 1) / plan.steps, float(nearest.missing[0]), position, why)
        q = nearest.q[0]
    return None


def _in_the_way(task: Task, position: Vector, rotation: Matrix, q: Vector, limits: bool) -> str:
    """By which joint's limit a target is missed, or that no posture at all was found."""
    robot = task.robot
    if not limits:
        return ", without joint limits"
    free = nearest_postures(task, position[None], rotation[None], q[None], limits=False)
    if not free.reached[0]:
        return ", even without joint limits"
    past = robot.beyond(free.q[0])
    k = int(np.argmax(past))
    name, unit = robot.joint_names[k], robot.coordinates[k].unit
    lower, upper = robot.lower[k], robot.upper[k]
    limit = f"its limits [{lower:.6g}, {upper:.6g}]"
    return f" within the joint limits: a posture that reaches it has {name!r} {past[k]:.3g} {unit} outside {limit}"


def surely_beyond(task: Task, position: Matrix, rotation: Array) -> Flags:
    """Which targets (k, 3), (k, 3, 3) no posture reaches, since they are further away than the links are long.

    A bound, at once; of the others only a search can tell. It needs all three positions of a tip.
    """
    if not (isinstance(task, FrameTask) and isinstance(task.frame, TipFrame) and set(task.rows) >= {0, 1, 2}):
        return np.zeros(len(position), dtype=bool)
    return longest_span(task.robot, task.tip, turned=bool(task._rotations)).beyond(position, rotation)


def nearest_postures(task: Task, position: Matrix, rotation: Array, near: Matrix, *, limits: bool) -> NearestPostures:
    """Postures that bring the tool to targets (k, 3), (k, 3, 3), or as near as was found.

    Least squares, within the joint limits or without, from a posture `near` each target (k, n), and from RESTARTS
    random ones for those that it does not reach. A count and not a clock ends it, so the answer is the same on every
    machine; and each target's is the same whatever the others are.
    """
    robot = task.robot
    lower, upper = (robot.lower, robot.upper) if limits else (np.full(robot.n, -np.inf), np.full(robot.n, np.inf))
    # From the posture near each target, then from random ones, some at a time, for those that it does not reach.
    best = _search(task, position, rotation, near, lower, upper)
    q, missing, ended = best.q.copy(), best.missing.copy(), best.ended.copy()
    low = np.where(np.isfinite(robot.lower), robot.lower, near - np.pi)
    high = np.where(np.isfinite(robot.upper), robot.upper, near + np.pi)
    shares = np.random.default_rng(0).uniform(size=(RESTARTS, robot.n))
    sure = np.zeros(len(q), dtype=bool)
    for first in range(0, RESTARTS, ROUND):
        left = np.flatnonzero((missing > REACHED) & ~sure)
        if not left.size:
            break
        some = shares[first : first + ROUND]
        begin = low[left, None] + some * (high - low)[left, None]
        rows = np.repeat(left, len(some))
        nearest = _search(task, position[rows], rotation[rows], begin.reshape(-1, robot.n), lower, upper)
        each = nearest.missing.reshape(len(left), -1)
        chosen = np.argmin(each, axis=1) + len(some) * np.arange(len(left))
        better = nearest.missing[chosen] < missing[left]
        to, of = left[better], chosen[better]
        q[to], missing[to], ended[to] = nearest.q[of], nearest.missing[of], nearest.ended[of]
        alike = (each <= ALIKE * missing[left, None]).sum(axis=1)
        sure[left] = ended[left] & (alike >= ROUND / 2)
    return NearestPostures(q, missing, ended)


def _search(task: Task, position: Matrix, rotation: Array, q: Matrix, lower: Vector, upper: Vector) -> NearestPostures:
    """Damped least squares, many at once; a joint at its limit stays there while the error pushes it out.

    [GVL13, section 6.1]
    """
    k, m, n = len(q), task.m, task.n
    q = np.clip(q, lower, upper)

    def look(postures: Matrix, rows: Indices) -> tuple[Matrix, Array]:
        error, slope = task._error_and_slope.batch(postures, position[rows], rotation[rows])
        return error.reshape(-1, m), slope.reshape(-1, m, n)

    error, D = look(q, np.arange(k))
    damping, before, ended = np.full(k, 1e-6), np.full(k, np.inf), np.zeros(k, dtype=bool)
    rows = np.flatnonzero(np.isfinite(error).all(axis=1) & np.isfinite(D).all(axis=(1, 2)))
    for looks in range(1, 200):  # some six for a target that is reached
        e, S, postures = error[rows], D[rows], q[rows]
        # A joint at its limit is not free while the error pushes it out; a posture with no free slope left is
        # stationary.
        size = np.linalg.norm(e, axis=1)
        slope = np.einsum("kmn,km->kn", S, e)
        free = ~(((postures <= lower) & (slope >= 0)) | ((postures >= upper) & (slope <= 0)))
        still = np.abs(slope) > STATIONARY * np.linalg.norm(S, axis=1) * size[:, None]
        # One that gains less than 1 % within 20 looks is close to a stretched arm: other postures need the looks.
        stalled = np.zeros(len(rows), dtype=bool)
        if looks % 20 == 0:
            stalled, before[rows] = size > 0.99 * before[rows], size
        ended[rows] = ~(free & still).any(axis=1) | (stalled & (size > FAR))
        # Only postures that are not there, may still get nearer, and are not damped for ever go on.
        go = ~ended[rows] & ~stalled & (np.abs(e).max(axis=1) > REACHED / 10) & (damping[rows] <= 1e12)
        rows, e, A, postures = rows[go], e[go], S[go] * free[go, None], postures[go]
        if not rows.size:
            break
        # Levenberg-Marquardt: (A A^T + damping) y = e, a motion by A^T y within the limits.
        normal = A @ np.swapaxes(A, 1, 2)
        scale = np.maximum(np.trace(normal, axis1=1, axis2=2), 1e-300)
        normal += (damping[rows] * scale)[:, None, None] * np.eye(m)
        moved = postures - np.einsum("kmn,km->kn", A, np.linalg.solve(normal, e[..., None])[..., 0])
        moved = np.clip(moved, lower, upper)
        left, derivative = look(moved, rows)
        sound = np.isfinite(left).all(axis=1) & np.isfinite(derivative).all(axis=(1, 2))
        with np.errstate(invalid="ignore", over="ignore"):
            better = sound & (np.sum(left**2, axis=1) < np.sum(e**2, axis=1))
        # Keep motions that lessen the error, and trust the slopes more after them, less after others.
        to = rows[better]
        q[to], error[to], D[to] = moved[better], left[better], derivative[better]
        damping[rows] = np.where(better, np.maximum(damping[rows] / 10, 1e-12), damping[rows] * 10)
    with np.errstate(invalid="ignore"):
        missing = np.where(np.isfinite(error).all(axis=1), np.abs(error).max(axis=1), np.inf)
    return NearestPostures(q, missing, ended)


FAILED = (InverseStatus.LEAF_ENDS, InverseStatus.SINGULAR, InverseStatus.NOT_CONVERGED)
"""What becomes of a pose that is out of reach for any posture, too."""


@dataclass(frozen=True, eq=False)
class PosePaths(Value):
    """Paths from a start q0 (n,) to tool poses on the leaf g(q) = level (r,), on the branch of q0.

    The level of q0 may be another one: then a path leads straight from level to level, as it does from pose to pose.
    """

    strategy: HolonomicStrategy
    q0: Vector
    level: Vector
    limits: bool

    def at(self, level: Vector) -> PosePaths:
        """The same to another level; what does not depend on it is shared."""
        first, n = len(self.q0) + 12 * self.strategy.task.frames, len(level)
        context = self.context.copy()
        context[first : first + n] = level
        other = replace(self, level=frozen(level))
        vars(other).update(kernel=self.kernel, context=frozen(context), _side=self._side, _first=self._first or self)
        return other

    def reach(self, p: Vector, R: Matrix, begin: Vector, search: bool = False) -> Vector:
        """The posture (n,) at a tool pose, by the path from `begin`; else raises what says why there is none.

        search: look for any posture of the arm there, which takes up to a second, before it is said that none was
        reached.
        """
        strategy, (q, status) = self.strategy, self.go(p, R, begin)
        if status is InverseStatus.LEAF_ENDS and begin is self.q0 and self.closed is not None and q is begin:
            raise self.closed.problem(p, R)
        if np.isnan(q).any():
            raise self.out_of_reach(p)
        if (jump := self.jump(p, R, begin, q, status)) is not None:
            raise jump_problem(strategy, jump)
        if search and status in FAILED and self.closed is None:  # a closed form has told that there is a posture
            self._look_for_any(p, R, q)
        if status is InverseStatus.LIMIT:
            strategy.task.robot.check_limits(q, WITHIN)
        if status is InverseStatus.OTHER_BRANCH:
            fact = f"the posture to begin from lies on another branch of {strategy.name!r} than the start"
            raise BranchError(fact, "give a posture of this branch, such as the last answer, or leave it out")
        if status is not InverseStatus.REACHED:
            raise leaf_problem(strategy, q, PathEnd.FOLD if status is InverseStatus.LEAF_ENDS else PathEnd.STOPPED)
        return q

    def _look_for_any(self, p: Vector, R: Matrix, q: Vector) -> None:
        """Raises: OutOfReachError: no posture of the arm has a pose; its closed inverse tells, or a search from q."""
        some = some_posture(self.strategy, p, R, self.limits)
        if some is False:
            raise self.out_of_reach(p)
        if some is None:
            nearest = nearest_postures(self.strategy.task, p[None], R[None], q[None], limits=self.limits)
            if nearest.ended[0] and not nearest.reached[0]:
                raise self.out_of_reach(p, f"no search came closer than {nearest.missing[0]:.3g} (m or rad)")

    def out_of_reach(self, p: Vector, why: str = "no posture has it") -> OutOfReachError:
        """What is said of a pose at p (3,) that no posture of the arm has."""
        cure = doubtful_target(self.strategy.task, p) or "give a pose nearer to the base"
        return OutOfReachError(f"the pose is out of reach of {self.strategy.task.robot.name!r}: {why}", cure)

    def go(self, p: Vector, R: Matrix, begin: Vector) -> tuple[Vector, InverseStatus]:
        """(posture to which the path from a posture was gone, what became of it); a closed form goes none."""
        if begin is self.q0 and self.closed is not None:
            if self.closed.single and (q := self.closed.one(pose_from(p, R))) is not None:
                return q, InverseStatus.REACHED
            postures, statuses, known = self.closed.reach(p[None], R[None], 1)
            if known[0]:
                status = InverseStatus(int(statuses[0]))
                return (begin if status is InverseStatus.LEAF_ENDS else postures[0]), status
        if self.kernel is None:
            return self._walk(p, R, begin)
        q = begin[None].copy()
        status = self.kernel(in_rows(p[None], R[None]), self.context, q, not self._cold(begin), 1)
        return q[0], InverseStatus(int(status[0]))

    def go_all(self, p: Matrix, R: Array, threads: int | None) -> tuple[Matrix, Indices]:
        """The same from the start to many poses (k, 3F), (k, 3F, 3), none of which is bad."""
        if self.closed is not None:
            q, status, known = self.closed.reach(p, R, threads)
            if not known.all():
                q[~known], status[~known] = self.go_paths(p[~known], R[~known], threads)
            return q, status
        return self.go_paths(p, R, threads)

    def go_paths(self, p: Matrix, R: Array, threads: int | None, shown: bool = False) -> tuple[Matrix, Indices]:
        """The same by paths, also where there is a closed form. shown: only in pieces shown to keep to the branch."""
        if self.kernel is None:
            return self._walk_each(p, R, [self.q0] * len(p))
        q = np.tile(self.q0, (len(p), 1))
        return q, self.kernel(in_rows(p, R), self.context, q, not self._cold(self.q0), threads, shown)

    def go_each(self, p: Matrix, R: Array, begin: Matrix, threads: int | None) -> tuple[Matrix, Flags]:
        """(postures (k, n), which are reached (k,)) of many poses, each by the path from its own posture (k, n)."""
        if self.kernel is None:
            q, status = self._walk_each(p, R, begin)
        else:
            q = np.ascontiguousarray(begin).copy()
            status = np.asarray(self.kernel(in_rows(p, R), self.context, q, True, threads))
        return q, status == InverseStatus.REACHED

    def _walk_each(self, p: Matrix, R: Array, begin: Sequence[Vector] | Matrix) -> tuple[Matrix, Indices]:
        walks = [self._walk(*walk) for walk in zip(p, R, begin, strict=True)]
        q = np.array([posture for posture, _ in walks]).reshape(-1, len(self.q0))
        return q, np.array([status for _, status in walks], dtype=np.intp)

    def jump(self, p: Vector, R: Matrix, begin: Vector, q: Vector, status: InverseStatus) -> Jump | None:
        """A jump of g on the path that was gone to q."""
        s = self.strategy
        return _jump_on(s, begin, self._path(p, R, begin)[0], q, status in FAILED) if may_jump(s) else None

    @cached_property
    def closed(self) -> ClosedBranch | None:
        """The closed form of the leaf's postures, of the start's branch; None where there is none."""
        first = self._first
        if first is None:
            return closed_branch(self.strategy, self.q0, self.level, self.limits)
        leaf = None if first.closed is None else closed_leaf(self.strategy, self.level, self.limits)
        return None if first.closed is None else first.closed.on(leaf)

    @cached_property
    def _first(self) -> PosePaths | None:
        """Those to the level of the start; None where these are they."""
        return None

    @cached_property
    def kernel(self) -> InverseKernel | None:
        """Native code, built or loaded if it is not yet there; None without a compiler."""
        s = self.strategy
        return leaf_step(s).inverse(
            lambda: inverse_code(s) + continuation_code(s) + reach_code(s), lambda: stretch_code(s)
        )

    @cached_property
    def nowhere(self) -> Callable[[Any], float | None]:
        """(pose) -> 1.0 of a tool pose (4, 4) that no posture of the arm has, if native code tells; else None."""
        call = None if self.kernel is None else self.kernel.nowhere(self.context)
        return (lambda _pose: None) if call is None else call

    @cached_property
    def context(self) -> Vector:
        """What the kernel reads besides: poses.c."""
        robot, slack = self.strategy.task.robot, TOLERANCES.limit
        beyond = np.full(robot.n, np.inf)
        low, high = (robot.lower - slack, robot.upper + slack) if self.limits else (-beyond, beyond)
        p, R = self.strategy.task._place(self.q0)
        turn = turn_before_jump(self.strategy, self.q0)
        return frozen(np.concatenate([self.q0, p, R.ravel(), self.level, low, high, [self._side, turn]]))

    def _cold(self, begin: Vector) -> bool:
        """Whether a path from there begins at the start, and on the leaf."""
        return begin is self.q0 and self._on_leaf

    @cached_property
    def _on_leaf(self) -> bool:
        return np.array_equal(self.level, leaf_value(self.strategy, self.q0))

    @cached_property
    def _side(self) -> float:
        q0 = self.q0
        return float(leaf_step(self.strategy)(q0, *self.strategy.task._place(q0), leaf_value(self.strategy, q0))[3])

    def _path(self, p: Vector, R: Matrix, begin: Vector) -> tuple[LeafPath, bool]:
        """(the straight path to a pose and to the leaf, whether it stays on the leaf)."""
        s = self.strategy
        level = self.level if self._cold(begin) else leaf_value(s, begin)
        goal = level + s.constraint.nearest(self.level - level) if len(level) else level
        return straight_path(s.task, s.task._place(begin), (p, R), (level, goal)), np.array_equal(level, goal)

    def _walk(self, p: Vector, R: Matrix, begin: Vector) -> tuple[Vector, InverseStatus]:
        """The same as `go` on the virtual machine."""
        s = self.strategy
        if not self._cold(begin):
            _, rcond, margin, side = leaf_step(s)(begin, p, R, self.level)
            if not (rcond > TOLERANCES.singular and margin > TOLERANCES.representation):
                return begin, InverseStatus.SINGULAR
            if side != self._side:
                return begin, InverseStatus.OTHER_BRANCH
        path, level = self._path(p, R, begin)
        last, ended = leaf_walk(s, begin, ray=level and on_ray(s, begin), folds=True)(begin, path)
        if ended is PathEnd.FOLD:
            return last, InverseStatus.LEAF_ENDS
        if ended is PathEnd.REACHED:
            beyond = self.limits and beyond_limits(s.task.robot, last)
            return last, InverseStatus.LIMIT if beyond else InverseStatus.REACHED
        _, rcond, margin = s.gain(last)
        if ended is PathEnd.TRIED or rcond > REGULAR:
            return last, InverseStatus.NOT_CONVERGED
        sound = rcond > TOLERANCES.singular and margin > TOLERANCES.representation
        return last, InverseStatus.LEAF_ENDS if sound else InverseStatus.SINGULAR


def _jump_on(strategy: HolonomicStrategy, q0: Vector, path: LeafPath, q: Vector, stopped: bool) -> Jump | None:
    """A jump of g on a path from q0 that was gone to q; it is gone again in pieces only where a switch turned over.

    stopped: the path leads on, but no walk got farther than q: then a jump next to q counts, too.
    """
    if np.array_equal(*states(strategy, np.array([q0, q]))):
        return jump_near(strategy, q) if stopped else None
    walk, rows, pieces = leaf_walk(strategy, q0), [q0], 32
    for first, last in pairwise(np.linspace(0.0, 1.0, pieces + 1).tolist()):
        piece = replace(path, at=lambda s, a=first, b=last: path.at(a + s * (b - a)), arc=path.arc / pieces**2)
        posture, ended = walk(rows[-1], piece)
        rows.append(posture)
        stopped = stopped or ended is not PathEnd.REACHED
        if ended is not PathEnd.REACHED:
            break
    met = first_jump(strategy, np.array(rows))
    return met[1] if met is not None else jump_near(strategy, rows[-1]) if stopped else None
