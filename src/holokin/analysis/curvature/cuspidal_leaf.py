"""`cusps`: whether a leaf is one function of the tool pose beyond its folds. [Wen07], theory 7.3

Without curvature joints return from small loops. A leaf may have two postures of one tool pose all the same, joined by
a regular motion on it: then a closed loop of the tool does not bring the joints back. Round a cusp there are such
loops, however small. A loop round a hole of the workspace needs no cusp, and is not looked for.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.progress import progress
from ...base.types import (
    Array,
    ArrayLike,
    Flags,
    Indices,
    Matrix,
    NoTruthValue,
    Value,
    Vector,
    joined,
    kept,
    some,
    whole,
)
from ...motion.ik import InverseKinematics
from ...motion.ik.leaf import leaf_value, with_leaves
from ...motion.ik.posture_search import MOST_STARTS, SAMPLED, spread
from ...motion.ik.whole_turns import free_hinges, turned
from ...robot import start_posture
from ...strategies import HolonomicStrategy, Strategy
from ...strategies.tasks.task import Task, of_one_tool
from .cusp_families import distinct, families
from .cusp_search import CuspPoints, seek_cusps
from .cusp_witness import TURN, CuspWitness, candidates, first_witness

CHUNK = 256
"""Starts between two looks at the keyboard."""

NEAREST = 60
"""Cusps about which loops are looked for: those nearest to the posture that is asked about."""


@dataclass(frozen=True, eq=False)
class Cusps(NoTruthValue, Value, ask="`.cuspidal`"):
    """The cusps found on the leaf through q0 (n,), the nearest first, and tool loops that do not bring the joints back.

    q: their postures (k, n), each once: there g(q) = c, [J; J_g] has corank 1 and kappa is zero, to 1e-8, and what
    tells a cusp from other such postures was tested. level: c (r,) of the leaf. limits: only cusps and loops within the
    joint limits count; `outside` others were left out. starts: postures that Newton's method began from. double: those
    that came to where singular sheets cross, which is no cusp; corank: those that came to where more than one direction
    is lost, or nearly.
    witnesses: of the loops that were followed from one posture to another one at the same tool pose, the smallest, and
    the one that keeps farthest from singular postures. stopped: Ctrl-C ended the search.
    """

    strategy: HolonomicStrategy
    q0: Vector
    q: Matrix
    level: Vector
    limits: bool
    starts: int
    outside: int
    double: int
    corank: int
    witnesses: tuple[CuspWitness, ...]
    stopped: bool = False

    def __len__(self) -> int:
        return len(self.q)

    @property
    def cuspidal(self) -> bool:
        """True where a loop was followed that does not bring the joints back; False is no proof that there is none."""
        return bool(self.witnesses)

    @property
    def witness(self) -> CuspWitness | None:
        """That with the smallest tool path; None where there is none."""
        return min(self.witnesses, key=lambda one: one.size, default=None)

    @property
    def most_regular(self) -> CuspWitness | None:
        """That whose least rcond is the greatest; None where there is none."""
        return max(self.witnesses, key=lambda one: one.rcond, default=None)

    @cached_property
    def families(self) -> tuple[Indices, ...] | None:
        """Of each family the numbers of its cusps in `q`; None where families are surfaces, which are only sampled.

        Cusps of a task of m rows lie on sets of dimension m - 2: they are alone for m = 2. Joints whose motion alone
        leads from cusps to cusps are left out; curves that remain are followed.
        """
        of = families(self.strategy, self.level, self.q)
        return None if of is None else tuple(np.flatnonzero(of == k) for k in range(int(of.max(initial=-1)) + 1))

    @property
    def excluded(self) -> str:
        """Why no leaf of the task has a cusp, so that none was looked for; empty where some may."""
        return "" if self.strategy.task.m >= 2 else "the task has one row, so the leaf is a curve, which has no cusp"

    @cached_property
    def poses(self) -> Array:
        """Tool poses of the cusps (k, 4, 4)."""
        return np.array([self.strategy.task.pose(q) for q in self.q]).reshape(-1, 4, 4)

    @property
    def joints_away(self) -> Vector:
        """The largest joint's difference [joint units] of each cusp from q0 (k,)."""
        return np.abs(self.q - self.q0).max(axis=1) if len(self.q) else np.zeros(0)

    @property
    def tool_away(self) -> Vector:
        """How far the tool is at each cusp from where it is at q0 [m], (k,)."""
        return np.linalg.norm(self.poses[:, :3, 3] - self.strategy.task.pose(self.q0)[:3, 3], axis=1)

    @property
    def sentence(self) -> str:
        """What was found, by which search, and what that says."""
        if self.excluded:
            return f"no cusp: {self.excluded}"
        ranged = np.isfinite(self.strategy.task.robot.lower).any()
        within = " within the joint limits" if self.limits and ranged else ""
        ended = ", where Ctrl-C ended the search" if self.stopped else ""
        searched = f"{self.starts:,} starts spread over the joint ranges{ended}"
        if not len(self):
            crossed = (
                f"; {self.double:,} starts came to crossings of singular sheets, which are none" if self.double else ""
            )
            return f"no cusp found{within} from {searched}{crossed}: a search, no proof that there is none"
        many = f"{len(self):,} cusp{'' if len(self) == 1 else 's'} found{within} from {searched}{self._of_families}"
        near = f"the nearest is {self.joints_away[0]:.2g} (largest joint) and {self.tool_away[0]:.2g} m (tool) from q0"
        least = self.witness
        if least is None:
            return f"{many}; {near}; no loop of the tool round one of them was found that keeps to the leaf"
        return (
            f"cuspidal: {many}; {near}. Round a closed tool path of {least.length:.2g} m that turns by "
            f"{least.turn:.2g} rad the joints do not come back: they end {least.apart:.3g} apart, "
            f"with no singular posture on it (rcond {least.rcond:.1g} at least)"
        )

    @property
    def _of_families(self) -> str:
        """How many families the cusps are of, where they are not alone."""
        if self.strategy.task.m == 2:
            return ""
        if self.families is None:
            return f", samples of surfaces of dimension {self.strategy.task.m - 2}"
        return f", of {len(self.families)} famil{'y' if len(self.families) == 1 else 'ies'}"

    def __str__(self) -> str:
        return self.sentence


@typed
def cusps(
    strategy: Strategy | InverseKinematics, q0: ArrayLike | None = None, *, starts: int = 1000, limits: bool = True
) -> Cusps:
    """Look for cusps of the leaf through q0, and for loops of the tool about them by which the joints do not come back.

    Newton's method on g(q) = c, det [J; J_g] = 0 and its cusp condition begins at `starts` postures spread over the
    joint ranges, hinges without a range over one turn; exact slopes come from the formulas. Loops about the cusps
    nearest to q0 are followed by `follow`: only where one ends at another posture is the leaf called cuspidal. The leaf
    may have several sheets, and the cusps may lie on others than that of q0.

    Args:
        strategy: with leaves; any one where nothing is redundant, n = m. Or an inverse kinematics, for its leaf: what
            was found is kept with it, and a second call with the same numbers has it at once.
        q0: posture (n,) on the leaf; of an inverse kinematics that is its own.
        starts: more find rarer cusps.
        limits: cusps and loops beyond the joint limits do not count.

    Raises:
        ArgumentError: a law without leaves; a task of several frames; too many starts; no q0, or one beside an inverse
            kinematics. SingularityError: it is singular at q0. JointLimitError: with limits, q0 is beyond them.
        ShapeError.
    """
    if isinstance(strategy, InverseKinematics):
        if q0 is not None:
            raise ArgumentError("q0", q0, "leave it out: an inverse kinematics has its own")
        known = _kept_cusps(strategy)
        if (starts, limits) not in known:
            found = _cusps(strategy.strategy, strategy.q0, starts, limits)
            if found.stopped:  # another call shall search again
                return found
            known[starts, limits] = found
        return known[starts, limits]
    if q0 is None:
        raise ArgumentError("q0", None, "give the posture whose leaf is meant")
    return _cusps(strategy, q0, starts, limits)


@kept
def _kept_cusps(_ik: InverseKinematics) -> dict[tuple[int, bool], Cusps]:
    """Those that were found on the leaf of an inverse kinematics, by starts and limits."""
    return {}


def _cusps(strategy: Strategy, q0: ArrayLike, starts: int, limits: bool) -> Cusps:
    """The same of a strategy and a posture."""
    of_one_tool(strategy.task, "cusps")
    leafed, robot = with_leaves(strategy), strategy.task.robot
    if whole("starts", starts) > MOST_STARTS:
        raise ArgumentError("starts", starts, f"give at most {MOST_STARTS:,}")
    start = start_posture(robot, q0, limits)
    leafed(start)
    level = leaf_value(leafed, start)
    search = _searched(leafed, level, start, starts, limits)
    near = some(search.points, slice(NEAREST))
    motions, measures = candidates(leafed, level, near, limits) if len(near.q) else (None, np.zeros((0, 3)))
    found = [] if motions is None else [first_witness(leafed, level, motions, i, limits) for i in _orders(measures)]
    return Cusps(
        leafed, start, search.points.q, level, limits, search.starts, search.outside, search.double, search.corank,
        tuple(one for one in found if one is not None), search.stopped,
    )  # fmt: skip


def cusps_from(strategy: HolonomicStrategy, level: Vector, starts: Matrix, limits: bool) -> Array:
    """Tool poses (k, 4, 4) of the cusps of a leaf g = level that Newton's method finds from postures (s, n)."""
    q = seek_cusps(strategy, level, starts)[0].q if len(starts) else starts
    if limits:
        q, inside = _at_turns(strategy, q, None, limits)
        q = q[inside]
    return np.array([strategy.task.pose(one) for one in q]).reshape(-1, 4, 4)


def _at_turns(strategy: HolonomicStrategy, q: Matrix, near: Vector | None, limits: bool) -> tuple[Matrix, Flags]:
    """(postures (k, n) at those of their whole turns that are nearest to one, or to where they are; which of them are
    within the limits, if these count (k,))."""
    free = free_hinges(strategy, spread(strategy.task.robot, SAMPLED))
    placed = [turned(strategy, one[None], free, one if near is None else near, limits) for one in q]
    return np.array([one for one, _ in placed]).reshape(q.shape), np.array([inside for _, inside in placed], dtype=bool)


def tool_away(task: Task, T: Array, others: Array) -> Vector:
    """How far tool poses (k, 4, 4) are from the nearest of others [m] (k,), a turn of one radian counted as 0.1 m."""
    from scipy.spatial import KDTree

    def placed(T: Array) -> Matrix:  # |R - R'| is sqrt(2) times the angle, where that is small
        turns = TURN / np.sqrt(2.0) * T[:, :3, :3].reshape(-1, 9) * bool(task.rotations)
        return np.hstack([T[:, :3, 3], turns])

    return KDTree(placed(others)).query(placed(T))[0] if len(T) else np.zeros(0)


@dataclass(frozen=True)
class _Search:
    """What came of the starts: the points, the nearest to q0 first, and counts as of `Cusps`."""

    points: CuspPoints
    starts: int
    stopped: bool
    outside: int
    double: int
    corank: int


def _searched(strategy: HolonomicStrategy, level: Vector, q0: Vector, starts: int, limits: bool) -> _Search:
    """Newton's method from the starts, a part after the other, until Ctrl-C; from none where there can be no cusp."""
    starts = starts if strategy.task.m >= 2 else 0
    begun, done, parts = spread(strategy.task.robot, starts), 0, []
    with progress("cusps", starts) as report, suppress(KeyboardInterrupt):  # what was found is kept
        while done < starts:
            parts.append(seek_cusps(strategy, level, begun[done : done + CHUNK]))
            done = min(done + CHUNK, starts)
            report(done)
    none = np.zeros((0, len(q0)))
    points = joined(CuspPoints(none, none, none), *(found for found, _, _ in parts))
    q, inside = _at_turns(strategy, points.q, q0, limits)
    each = distinct(strategy, q)
    points, inside = some(replace(points, q=q), each), inside[each]
    outside, points = int(np.sum(~inside)), some(points, inside)
    points = some(points, np.argsort(np.abs(points.q - q0).max(axis=1), kind="stable") if len(points.q) else slice(0))
    double, corank = (sum(part[k] for part in parts) for k in (1, 2))
    return _Search(points, done, done < starts, outside, double, corank)


def _orders(measures: Matrix) -> tuple[Indices, Indices]:
    """Motions (length, turn, rcond) (k, 3) by the size of their tool paths, and by how regular they are."""
    return np.argsort(measures[:, 0] + TURN * measures[:, 1]), np.argsort(-measures[:, 2])
