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
from ...base.errors import ArgumentError, HolokinError
from ...base.poses import pose_from
from ...base.progress import progress
from ...base.tolerances import TOLERANCES
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
from ...motion.drift_and_spread import NO_DRIFT
from ...motion.follow_path import follow
from ...motion.ik import InverseKinematics
from ...motion.ik.leaf import leaf_step, leaf_value, with_leaves
from ...motion.ik.posture_search import (
    MOST_STARTS,
    SAMPLED,
    free_hinges,
    leaf_postures,
    nearest_equivalent,
    newton,
    spread,
)  # fmt: skip
from ...motion.trajectory import Status, Trajectory, whole_turns
from ...path import Path
from ...path.curves import spline
from ...robot import start_posture
from ...strategies import HolonomicStrategy, Strategy
from ...strategies.radial_strategy import joint_gap
from ...strategies.tasks.task import Task, of_one_tool
from ...symbolic import Function
from .cusp_search import CuspPoints, distinct, families, seek_cusps

# --- Two postures of one leaf with one tool pose, joined by a regular motion: a leaf is cuspidal. Theory 7.3
#
# Near a cusp the leaf lies over the poses as (s, y) -> (s^3 + y s, y). For y < 0 three postures share a pose; the outer
# two lie on one side of the singular sheet det E ~ 3 s^2 + y = 0 and are joined round y > 0. The tool path of that
# motion is closed, but the joints do not come back, though the curvature is zero and no posture on it is singular.

DEPTHS = np.geomspace(0.02, 0.6, 6)
"""How far [joint units] beyond the cusp the two postures are looked for, along the leaf."""

PARTS = np.geomspace(0.05, 0.8, 7)
"""How far [joint units] apart from the middle they are looked for."""

ROUNDS = np.geomspace(0.03, 0.6, 5)
"""How far before the cusp the motion between them turns."""

APART = 0.02
"""Difference of the joints [joint units] from which two postures are two."""

LEGS = 12
"""Pieces of each half of a motion that is looked at; its tool path goes through the poses at their ends."""

SAMPLES = 300
"""Samples of that path that are followed."""

LEAST = 1e-4
"""rcond of [J; J_g] that a motion must keep: nearer to singular postures no arm goes its path."""

TRIED = 12
"""Motions that are followed in full until one is shown to end at the other posture."""

ENDS = 1e-9
"""How near [joint units] to the other posture a motion must end."""

TURN = 0.1
"""Metres of a tool path that a turn of one radian counts as, where paths are compared."""

SAME = 1e-6
"""Difference of two tool poses [m, rad], or levels, up to which they are one."""

_STEPS, _LONGEST, _EXACT = 30, 0.3, 1e-11


@dataclass(frozen=True, eq=False)
class CuspWitness(Value):
    """Two postures `first`, `second` (n,) of one leaf at one tool pose; `path`: closed, it leads from one to the other.

    apart: the largest joint's difference [joint units], whole turns of hinges left out. length [m], turn [rad]: of the
    path. rcond: the least of [J; J_g] along it. margin: distance to the nearest joint limit [joint units], infinite
    without limits.
    """

    first: Vector
    second: Vector
    path: Path
    apart: float
    length: float
    turn: float
    rcond: float
    margin: float

    @property
    def size(self) -> float:
        """Length of the path [m], a turn of one radian counted as 0.1 m."""
        return self.length + TURN * self.turn


@dataclass(frozen=True, eq=False)
class Motions(Value):
    """Motions from `first` (k, n) by `middle` to `second`, which are on the leaf."""

    first: Matrix
    middle: Matrix
    second: Matrix

    def at(self, which: Indices | Flags) -> Motions:
        """Some of them."""
        return Motions(self.first[which], self.middle[which], self.second[which])

    def lines(self, count: int) -> Matrix:
        """Postures (k, 2 count + 1, n) on the two straight lines of joints."""
        s = np.linspace(0.0, 1.0, count + 1)[:, None]
        there = self.first[:, None] + s * (self.middle - self.first)[:, None]
        back = self.middle[:, None] + s * (self.second - self.middle)[:, None]
        return np.concatenate([there, back[:, 1:]], axis=1)


@kept
def _to_leaf(strategy: HolonomicStrategy) -> Function:
    """q -> (g (r,), J_g (r, n))."""
    s = strategy.looped
    return Function(
        "leaf_rows",
        {"q": s.expressions.q},
        {"g": s.constraint_expression, "Jg": s.expressions.planes},
        None,
        s.transport,
    )


def on_leaf(strategy: HolonomicStrategy, level: Vector, q: Matrix) -> tuple[Matrix, Flags]:
    """(postures (k, n) of the leaf g = level, nearest to others by least-norm steps; which of them arrived (k,))."""
    r = strategy.task.n - strategy.task.m
    if not r:
        return q.copy(), np.ones(len(q), dtype=bool)
    rows = _to_leaf(strategy)

    def correct(q: Matrix, _i: Indices) -> tuple[Matrix, Flags]:
        g, Jg = rows.batch(q)
        gap, Jg = strategy.constraint.nearest(level - g.reshape(len(q), r)), Jg.reshape(len(q), r, -1)
        sound = np.isfinite(gap).all(axis=1) & np.isfinite(Jg).all(axis=(1, 2))
        Jg, gap = np.where(sound[:, None, None], Jg, 0.0), np.where(sound[:, None], gap, 0.0)
        return np.einsum("kij,kj->ki", np.linalg.pinv(Jg), gap), sound

    return newton(correct, q, steps=_STEPS, exact=_EXACT, longest=_LONGEST)


def sides(strategy: HolonomicStrategy, q: Matrix) -> tuple[Vector, Vector]:
    """(sign of det E (k,), rcond of E (k,)) at postures; the sign is 0 where E or a representation is singular."""
    if not len(q):
        return np.zeros(0), np.zeros(0)
    p, R = strategy.task._poses(q)
    step = leaf_step(strategy)
    level = strategy.constraint_value.batch(q).reshape(len(q), -1)
    shapes = step.input_shapes
    _, rcond, margin, side = step.batch(q, p.reshape(len(q), *shapes["p"]), R.reshape(len(q), *shapes["R"]), level)
    rcond, side = np.ravel(rcond), np.ravel(side)
    return np.where((rcond > TOLERANCES.singular) & (np.ravel(margin) > TOLERANCES.representation), side, 0.0), rcond


def candidates(strategy: HolonomicStrategy, level: Vector, found: CuspPoints, limits: bool) -> tuple[Motions, Matrix]:
    """(motions between two postures of one pose about cusps, seen to keep to one side of the singular set at some
    postures, (length, turn, least rcond) of each (k, 3))."""
    a, t = (grid.ravel()[:, None] for grid in np.meshgrid(DEPTHS, PARTS))
    q, down, along = found.q[:, None], found.down[:, None], found.along[:, None]
    n = found.q.shape[1]
    cusp = np.repeat(np.arange(len(found.q)), len(a))
    first, good = on_leaf(strategy, level, (q + a * down + t * along).reshape(-1, n))
    second = (q + a * down - t * along).reshape(-1, n)
    which = np.flatnonzero(good)
    p, R = strategy.task._poses(first[which])
    other, _, arrived = leaf_postures(strategy, second[which], p, R, level)
    apart = _apart(strategy, first[which], other) > APART
    which, other = which[arrived & apart], other[arrived & apart]
    same = sides(strategy, first[which])[0] * sides(strategy, other)[0] > 0
    if limits:
        robot = strategy.task.robot
        same &= robot.within(first[which]) & robot.within(other)
    which, other = which[same], other[same]
    b = np.repeat(ROUNDS, len(which))
    each = np.tile(np.arange(len(which)), len(ROUNDS))
    at = cusp[which][each]
    middle, good = on_leaf(strategy, level, found.q[at] - b[:, None] * found.down[at])
    return _seen(strategy, level, Motions(first[which][each], middle, other[each]).at(good), limits)


def _seen(strategy: HolonomicStrategy, level: Vector, motions: Motions, limits: bool) -> tuple[Motions, Matrix]:
    """Those motions that keep to one side of the singular set and within the limits, at LEGS postures a half; and what
    their tool paths are like."""
    k, n = len(motions.first), motions.first.shape[1]
    if not k:
        return motions, np.zeros((0, 3))
    Q = motions.lines(LEGS)
    flat, good = on_leaf(strategy, level, Q.reshape(-1, n))
    side, rcond = sides(strategy, flat)
    side = side.reshape(k, -1)
    ok = good.reshape(k, -1).all(axis=1) & (side == side[:, :1]).all(axis=1) & (side[:, 0] != 0)
    if limits:
        ok &= strategy.task.robot.within(flat).reshape(k, -1).all(axis=1)
    p, R = strategy.task._poses(flat)
    p, R = p.reshape(k, -1, 3), R.reshape(k, -1, 3, 3)
    length = np.linalg.norm(np.diff(p, axis=1), axis=2).sum(axis=1)
    turn, least = _turned(R) if strategy.task._rotations else np.zeros(k), rcond.reshape(k, -1).min(axis=1)
    ok &= least > LEAST
    return motions.at(ok), np.column_stack([length, turn, least])[ok]


def _apart(strategy: HolonomicStrategy, q: Array, others: Array) -> Array:
    """The largest joint's difference of postures (..., n) from others [joint units] (...), whole turns left out."""
    return np.abs(joint_gap(strategy.task.robot, q, others)).max(axis=-1)


@typed
def witness_between(
    strategy: Strategy, first: ArrayLike, second: ArrayLike, *, via: int = 1000, limits: bool = True
) -> CuspWitness | None:
    """A closed path of the tool that leads from one posture to another one at the same tool pose, or None.

    The joints go on the leaf from the first posture straight to a third, and straight to the second; all on one side of
    the singular postures. The middle between the two is tried as the third, then postures spread over the joint ranges.
    None found is no proof that there is none: more turns of the path may be needed.

    Args:
        first, second: postures (n,) of one leaf with one tool pose, as `all_postures` finds them. Whole turns of hinges
            do not make another posture.
        via: third postures that are tried. limits: within the joint limits.

    Raises:
        ArgumentError: the postures differ in their tool pose or level, or are one.
        JointLimitError: with limits, one is beyond them. ShapeError, NotFiniteError.
    """
    of_one_tool(strategy.task, "a path between two postures")
    leafed, robot = with_leaves(strategy), strategy.task.robot
    a, b = start_posture(robot, first, limits), start_posture(robot, second, limits)
    level = leaf_value(leafed, a)
    off = np.abs(leafed.task.error(b, *leafed.task._place(a))).max()
    gap = np.abs(leafed.constraint.nearest(leaf_value(leafed, b) - level)).max(initial=0.0)
    apart = _apart(leafed, a, b)
    if max(off, gap) > SAME or apart <= APART:
        turned = ", whole turns left out" if apart < np.abs(a - b).max() else ""
        fact = f"{b.tolist()}: tool {off:.2g}, level {gap:.2g}, joints {apart:.2g} from the first{turned}"
        raise ArgumentError("the second posture", fact, "give another posture of the same tool pose and the same leaf")
    middle, good = on_leaf(leafed, level, np.vstack([(a + b) / 2, spread(robot, whole("via", via))]))
    k = int(good.sum())
    motions, measures = _seen(leafed, level, Motions(np.tile(a, (k, 1)), middle[good], np.tile(b, (k, 1))), limits)
    return first_witness(leafed, level, motions, np.argsort(measures[:, 0] + TURN * measures[:, 1]), limits)


def first_witness(
    strategy: HolonomicStrategy, level: Vector, motions: Motions, order: Indices, limits: bool
) -> CuspWitness | None:
    """The first of the motions, in an order, whose tool path `follow` goes from the one posture to the other."""
    for i in order[:TRIED]:
        found = _witness(strategy, level, motions.at(np.array([i])), limits)
        if found is not None:
            return found
    return None


def _witness(strategy: HolonomicStrategy, level: Vector, motion: Motions, limits: bool) -> CuspWitness | None:
    """The witness that a motion gives; None where its tool path, followed on the leaf, ends at no other posture."""
    robot, first, second = strategy.task.robot, motion.first[0], motion.second[0]
    Q, good = on_leaf(strategy, level, motion.lines(LEGS)[0])
    if not good.all():
        return None
    p, R = strategy.task._poses(Q)
    poses = pose_from(p, R)
    poses[-1] = poses[0]
    turns = bool(strategy.task._rotations)
    try:
        path = spline(poses if turns else p)
        walk = follow(strategy, path, first, samples=SAMPLES, limits=limits)
    except HolokinError:
        return None
    if not (walk.status is Status.COMPLETE and np.abs(walk.q[-1] - second).max() < ENDS):
        return None
    turn = _turned(R[None])[0] if turns else 0.0
    room = np.minimum(walk.q - robot.lower, robot.upper - walk.q).min() if limits else np.inf
    apart, rcond = _apart(strategy, first, second), sides(strategy, walk.q)[1].min()
    return CuspWitness(first, second, path, float(apart), path.length, float(turn), float(rcond), float(room))


def _turned(R: Array) -> Vector:
    """Angles [rad] by which rotations (k, s, 3, 3) turn from the first to the last, step by step, (k,)."""
    cosine = (np.einsum("ksij,ksij->ks", R[:, 1:], R[:, :-1]) - 1.0) / 2.0
    return np.arccos(np.clip(cosine, -1.0, 1.0)).sum(axis=1)


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
        ArgumentError: a strategy without leaves; a task of several frames; too many starts; no q0, or one beside an
            inverse kinematics. SingularityError: it is singular at q0. JointLimitError: with limits, q0 is beyond them.
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
    nearest = [nearest_equivalent(strategy, own[None], free, own if near is None else near, limits) for own in q]
    postures = [own if posture is None else posture for own, posture in zip(q, nearest, strict=True)]
    return np.array(postures).reshape(q.shape), np.array([posture is not None for posture in nearest], dtype=bool)


def tool_away(task: Task, T: Array, others: Array) -> Vector:
    """How far tool poses (k, 4, 4) are from the nearest of others [m] (k,), a turn of one radian counted as 0.1 m."""
    from scipy.spatial import KDTree

    def placed(T: Array) -> Matrix:  # |R - R'| is sqrt(2) times the angle, where that is small
        turns = TURN / np.sqrt(2.0) * T[:, :3, :3].reshape(-1, 9) * bool(task._rotations)
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


PLACES = 100
"""Postures of the path from which cusps are looked for, and their distance is taken."""

CLOSE = 0.1
"""Distance [m] from the path, a turn of one radian counted as 0.1 m, from which on a cusp is called near it."""


@typed
def why_elsewhere(strategy: HolonomicStrategy, walk: Trajectory) -> str:
    """A sentence on a closed path whose joints, followed on a regular leaf, do not come back; empty where they do.

    Curvature is zero on a leaf: small loops return. So the path cannot be shrunk to a point on the leaf: it goes round
    a cusp or a hole, or turns the tool once. Cusps are looked for by Newton's method from the path's postures, and the
    nearest one is named.

    Args:
        walk: of `follow`, whose path was closed.
    """
    drift = walk.drift()
    if walk.status is not Status.COMPLETE or not len(drift) or np.abs(drift[0]).max() <= NO_DRIFT:
        return ""
    i = int(np.abs(drift[0]).argmax())
    name, unit, away = walk.joint_names[i], walk.joint_units[i], drift[0][i]
    said = (
        f"after a cycle {name} is {away:.3g} {unit} from its start, though the leaf is regular along the path: it "
        "cannot be shrunk to a point on the leaf"
    )
    rest = drift[0] - 2 * np.pi * whole_turns(drift[0], walk.joint_units)
    if np.abs(rest).max() <= NO_DRIFT:
        return f"{said}, and the joints are whole turns further"
    along = walk.q[np.linspace(0, len(walk.q) - 1, PLACES).astype(int)]
    poses = cusps_from(strategy, leaf_value(strategy, walk.q[0]), along, limits=False)
    far = tool_away(strategy.task, poses, np.array([strategy.task.pose(q) for q in along]))
    if len(far) and far.min() <= CLOSE:
        at = ", ".join(f"{x:.3g}" for x in poses[int(far.argmin()), :3, 3])
        return f"{said}; a cusp of the leaf lies {far.min():.2g} m from the path, at the tool position [{at}] m"
    return f"{said}; no cusp was found near the path, from {PLACES} of its postures"
