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
from ...robot import nearer_or_other
from ...strategies import HolonomicStrategy, Jump, first_jump, jump_near, may_jump
from ...strategies.jumps import states
from ...symbolic.native import InverseKernel
from ..self_motions.pose_reach import obstacle_at
from .arm_reach import reach_code
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
from .plan import Plan
from .solutions import InverseStatus, beyond_limits, in_rows

# --- Can the tool get there at all? Asked only after following has failed.


class Beyond(NamedTuple):
    """The first target of a path that no posture reaches: at which share of the path, where it is (3,) [m], and what is
    in the way, in words."""

    share: float
    position: Vector
    why: str

    @property
    def fact(self) -> str:
        """All of it in words."""
        place = posture_text(np.round(self.position, 9))
        return f"the path is out of reach: {100 * self.share:.3g} % along it, at the point {place} m, {self.why}"


def out_of_reach(plan: Plan, q: Vector, step: int, limits: bool) -> Beyond | None:
    """The first target of a path from a step on that no posture reaches; else None."""
    for i in np.unique(np.linspace(step, plan.steps - 1, 24).astype(int)):
        position, rotation = plan.target(int(i), 1.0)
        obstacle, q = obstacle_at(plan.task, position, rotation, q, limits)
        if obstacle is not None:
            return Beyond((i + 1) / plan.steps, position, obstacle)
    return None


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
            problem = self.closed.problem(p, R)
            if search and isinstance(problem, OutOfReachError) and obstacle_at(strategy.task, p, R, q, False)[0]:
                raise self.out_of_reach(p)  # whatever joints are held
            raise problem
        if np.isnan(q).any():
            raise self.out_of_reach(p)
        if (jump := self.jump(p, R, begin, q, status)) is not None:
            raise jump_problem(strategy, jump)
        if search and status in FAILED and self.closed is None:  # a closed form has told that there is a posture
            obstacle, _ = obstacle_at(strategy.task, p, R, q, self.limits)
            if obstacle is not None:
                raise self.out_of_reach(p, obstacle)
        if status is InverseStatus.LIMIT:
            strategy.task.robot.check_limits(q, WITHIN)
        if status is InverseStatus.OTHER_BRANCH:
            fact = f"the posture to begin from lies on another branch of {strategy.name!r} than the start"
            raise BranchError(fact, "give a posture of this branch, such as the last answer, or leave it out")
        if status is not InverseStatus.REACHED:
            raise leaf_problem(strategy, q, PathEnd.FOLD if status is InverseStatus.LEAF_ENDS else PathEnd.STOPPED)
        return q

    def out_of_reach(self, p: Vector, why: str = "no posture has the pose") -> OutOfReachError:
        """What is said of a pose at p (3,) that no posture of the arm has."""
        task = self.strategy.task
        cure = nearer_or_other(task.robot, p[:3], task.tip)
        return OutOfReachError(f"the pose is out of reach of {task.robot.name!r}: {why}", cure)

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
        return self.kernel_with()

    def kernel_with(self, *drivers: str, constants: str = "") -> InverseKernel | None:
        """The same with other files of C, which need these constants."""
        s = self.strategy
        return leaf_step(s).inverse(
            lambda: constants + inverse_code(s) + continuation_code(s) + reach_code(s), lambda: stretch_code(s), drivers
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
