"""`cusps`: whether a leaf is one function of the tool pose beyond its folds. [Wen07], theory 7.3

Without curvature joints return from small loops. A leaf may have two postures of one tool pose all the same, joined by
a regular motion on it: then a closed loop of the tool does not bring the joints back. Round a cusp there are such
loops, however small. A loop round a hole of the workspace needs no cusp, and is not looked for.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

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
    Result,
    Value,
    Vector,
    joined,
    kept,
    plain_data,
    some,
    whole,
)
from ...motion.drift_and_spread import NO_DRIFT
from ...motion.follow_path import follow
from ...motion.ik import InverseKinematics
from ...motion.ik.closed_leaf import leaf_class
from ...motion.ik.leaf import leaf_postures, leaf_step, leaf_value, with_leaves
from ...motion.self_motions.posture_search import (
    MOST_STARTS,
    newton,
    spread,
)
from ...motion.self_motions.whole_turns import SAMPLED, turns_of
from ...motion.trajectory import Status, Trajectory, whole_turns
from ...path import Path
from ...path.curves import spline
from ...robot import start_posture
from ...robot.closed_form import NoClass
from ...strategies import HolonomicStrategy, Strategy
from ...strategies.self_motion_curves import joint_gap
from ...strategies.tasks.task import Task, of_one_tool
from ...symbolic import Function
from .cusp_search import CuspPoints, distinct, families, seek_cusps

# --- Two postures of one leaf with one tool pose, joined by a regular motion: a leaf is cuspidal. Theory 7.3
#
# Near a cusp the leaf lies over the poses as (s, y) -> (s^3 + y s, y). For y < 0 three postures share a pose; the outer
# two lie on one side of the singular sheet det E ~ 3 s^2 + y = 0 and are joined round y > 0. The tool path of that
# motion is closed, but the joints do not come back, though the curvature is zero and no posture on it is singular.

APART = 0.02
"""Difference of the joints [joint units] from which two postures are two."""

LEGS = 12
"""Pieces of each half of a motion that is looked at; its tool path goes through the poses at their ends."""

TURN = 0.1
"""Metres of a tool path that a turn of one radian counts as, where paths are compared."""


@dataclass(frozen=True, eq=False)
class CuspWitness(Result, Value):
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

    def __str__(self) -> str:
        return (
            f"round a closed tool path of {self.length:.2g} m that turns by {self.turn:.2g} rad the joints do not come "
            f"back: they end {self.apart:.3g} apart, with no singular posture on it (rcond {self.rcond:.1g} at least)"
        )


@dataclass(frozen=True, eq=False)
class Motions(Value):
    """Motions from `first` (k, n) by `middle` to `second`, which are on the leaf."""

    first: Matrix
    middle: Matrix
    second: Matrix

    def lines(self) -> Matrix:
        """Postures (k, 2 LEGS + 1, n) on the two straight lines of joints."""
        s = np.linspace(0.0, 1.0, LEGS + 1)[:, None]
        there = self.first[:, None] + s * (self.middle - self.first)[:, None]
        back = self.middle[:, None] + s * (self.second - self.middle)[:, None]
        return np.concatenate([there, back[:, 1:]], axis=1)


@kept
def _to_leaf(strategy: HolonomicStrategy) -> Function:
    """q -> (g (r,), J_g (r, n))."""
    s = strategy.looped
    rows = {"g": s.constraint_expression, "Jg": s.expressions.planes}
    return Function("leaf_rows", {"q": s.expressions.q}, rows, None, s.transport)


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

    return newton(correct, q, steps=30, exact=1e-11, longest=0.3)


def sides(strategy: HolonomicStrategy, q: Matrix) -> tuple[Vector, Vector]:
    """(sign of det E (k,), rcond of E (k,)) at postures; the sign is 0 where E or a representation is singular."""
    k = len(q)
    if not k:
        return np.zeros(0), np.zeros(0)
    step, (p, R) = leaf_step(strategy), strategy.task._poses(q)
    shapes, level = step.input_shapes, strategy.constraint_value.batch(q).reshape(k, -1)
    outputs = step.batch(q, p.reshape(k, *shapes["p"]), R.reshape(k, *shapes["R"]), level)
    rcond, margin, side = (np.ravel(output) for output in outputs[1:])
    return np.where((rcond > TOLERANCES.singular) & (margin > TOLERANCES.representation), side, 0.0), rcond


def candidates(strategy: HolonomicStrategy, level: Vector, cusps: CuspPoints, limits: bool) -> tuple[Motions, Matrix]:
    """(motions between two postures of one pose about cusps, seen to keep to one side of the singular set at some
    postures, (length, turn, least rcond) of each (k, 3))."""
    # Pairs of postures on both sides of each cusp: so far down the leaf and so far apart from the middle [joint units]
    depths, parts = np.geomspace(0.02, 0.6, 6), np.geomspace(0.05, 0.8, 7)
    depth, part = (grid.ravel()[:, None] for grid in np.meshgrid(depths, parts))
    q, down, along = cusps.q[:, None], cusps.down[:, None], cusps.along[:, None]
    n = cusps.q.shape[1]
    cusp = np.repeat(np.arange(len(cusps.q)), len(depth))
    first, arrived = on_leaf(strategy, level, (q + depth * down + part * along).reshape(-1, n))
    second = (q + depth * down - part * along).reshape(-1, n)

    # Those that are two postures of one pose, on one side of the singular set and within the limits
    which = np.flatnonzero(arrived)
    p, R = strategy.task._poses(first[which])
    other, _, arrived = leaf_postures(strategy, second[which], p, R, level)
    pairs = arrived & (_apart(strategy, first[which], other) > APART)
    which, other = which[pairs], other[pairs]
    same = sides(strategy, first[which])[0] * sides(strategy, other)[0] > 0
    if limits:
        robot = strategy.task.robot
        same &= robot.within(first[which]) & robot.within(other)
    which, other = which[same], other[same]

    # The motions between them turn so far before the cusp [joint units]
    rounds = np.geomspace(0.03, 0.6, 5)
    each, back = np.tile(np.arange(len(which)), len(rounds)), np.repeat(rounds, len(which))[:, None]
    of = cusp[which][each]
    middle, arrived = on_leaf(strategy, level, cusps.q[of] - back * cusps.down[of])
    return _seen(strategy, level, some(Motions(first[which][each], middle, other[each]), arrived), limits)


def _seen(strategy: HolonomicStrategy, level: Vector, motions: Motions, limits: bool) -> tuple[Motions, Matrix]:
    """Those motions that keep to one side of the singular set and within the limits, at LEGS postures a half; and what
    their tool paths are like."""
    k, n = motions.first.shape
    if not k:
        return motions, np.zeros((0, 3))
    Q, arrived = on_leaf(strategy, level, motions.lines().reshape(-1, n))
    side, rcond = (values.reshape(k, -1) for values in sides(strategy, Q))
    sound = arrived.reshape(k, -1).all(axis=1) & (side == side[:, :1]).all(axis=1) & (side[:, 0] != 0)
    if limits:
        sound &= strategy.task.robot.within(Q).reshape(k, -1).all(axis=1)
    p, R = strategy.task._poses(Q)
    length = np.linalg.norm(np.diff(p.reshape(k, -1, 3), axis=1), axis=2).sum(axis=1)
    turn = _turned(R.reshape(k, -1, 3, 3)) if strategy.task._rotations else np.zeros(k)
    least = rcond.min(axis=1)
    sound &= least > 1e-4  # nearer to singular postures no arm goes its path
    return some(motions, sound), np.column_stack([length, turn, least])[sound]


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
    # Two postures of one leaf with one tool pose
    a, b = start_posture(robot, first, limits), start_posture(robot, second, limits)
    level = leaf_value(leafed, a)
    off = np.abs(leafed.task.error(b, *leafed.task._place(a))).max()
    gap = np.abs(leafed.constraint.nearest(leaf_value(leafed, b) - level)).max(initial=0.0)
    apart = _apart(leafed, a, b)
    if max(off, gap) > 1e-6 or apart <= APART:
        turned = ", whole turns left out" if apart < np.abs(a - b).max() else ""
        fact = f"{b.tolist()}: tool {off:.2g}, level {gap:.2g}, joints {apart:.2g} from the first{turned}"
        raise ArgumentError("the second posture", fact, "give another posture of the same tool pose and the same leaf")
    # Motions by third postures, the one with the shortest tool path first
    middle, arrived = on_leaf(leafed, level, np.vstack([(a + b) / 2, spread(robot, whole("via", via))]))
    k = int(arrived.sum())
    motions, measures = _seen(leafed, level, Motions(np.tile(a, (k, 1)), middle[arrived], np.tile(b, (k, 1))), limits)
    return first_witness(leafed, level, motions, np.argsort(measures[:, 0] + TURN * measures[:, 1]), limits)


def first_witness(
    strategy: HolonomicStrategy, level: Vector, motions: Motions, order: Indices, limits: bool
) -> CuspWitness | None:
    """The first of at most 12 motions, in an order, whose tool path `follow` goes from the one posture to the other."""
    witnesses = (_witness(strategy, level, some(motions, [i]), limits) for i in order[:12])
    return next((witness for witness in witnesses if witness is not None), None)


def _witness(strategy: HolonomicStrategy, level: Vector, motion: Motions, limits: bool) -> CuspWitness | None:
    """The witness that a motion gives; None where its tool path, followed on the leaf, ends at no other posture."""
    robot, first, second = strategy.task.robot, motion.first[0], motion.second[0]
    # The closed tool path, through the poses of the motion
    Q, arrived = on_leaf(strategy, level, motion.lines()[0])
    if not arrived.all():
        return None
    p, R = strategy.task._poses(Q)
    poses = pose_from(p, R)
    poses[-1] = poses[0]
    turns = bool(strategy.task._rotations)
    # It must lead to the other posture when it is followed
    try:
        path = spline(poses if turns else p)
        walk = follow(strategy, path, first, samples=300, limits=limits)
    except HolokinError:
        return None
    if not (walk.status is Status.COMPLETE and np.abs(walk.q[-1] - second).max() < 1e-9):
        return None
    turn = _turned(R[None])[0] if turns else 0.0
    margin = np.minimum(walk.q - robot.lower, robot.upper - walk.q).min() if limits else np.inf
    apart, rcond = _apart(strategy, first, second), sides(strategy, walk.q)[1].min()
    return CuspWitness(first, second, path, float(apart), path.length, float(turn), float(rcond), float(margin))


def _turned(R: Array) -> Vector:
    """Angles [rad] by which rotations (k, s, 3, 3) turn from the first to the last, step by step, (k,)."""
    cosine = (np.einsum("ksij,ksij->ks", R[:, 1:], R[:, :-1]) - 1.0) / 2.0
    return np.arccos(np.clip(cosine, -1.0, 1.0)).sum(axis=1)


CHUNK = 256
"""Starts between two looks at the keyboard."""


@dataclass(frozen=True, eq=False)
class Cusps(NoTruthValue, Value, ask="`.cuspidal`"):
    """The cusps found on the leaf through q0 (n,), the nearest first, and tool loops that do not bring the joints back.

    points: their postures q (k, n), each once: there g(q) = c, [J; J_g] has corank 1 and kappa is zero, to 1e-8, and
    what tells a cusp from other such postures was tested. level: c (r,) of the leaf. limits: only cusps and loops
    within the joint limits count; `outside` others were left out. starts: postures that Newton's method began from.
    double: those that came to where singular sheets cross, which is no cusp; corank: those that came to where more than
    one direction is lost, or nearly. stopped: Ctrl-C ended the search.
    """

    strategy: HolonomicStrategy
    q0: Vector
    points: CuspPoints
    level: Vector
    limits: bool
    starts: int
    outside: int
    double: int
    corank: int
    stopped: bool = False

    def __len__(self) -> int:
        return len(self.q)

    @property
    def q(self) -> Matrix:
        """Postures (k, n) of the cusps."""
        return self.points.q

    @cached_property
    def witnesses(self) -> tuple[CuspWitness, ...]:
        """Of the loops about the 60 nearest cusps that lead from one posture to another one at the same tool pose when
        they are followed, the smallest, and the one that keeps farthest from singular postures."""
        if not len(self.q):
            return ()
        motions, measures = candidates(self.strategy, self.level, some(self.points, slice(60)), self.limits)
        orders = np.argsort(measures[:, 0] + TURN * measures[:, 1]), np.argsort(-measures[:, 2])
        found = [first_witness(self.strategy, self.level, motions, order, self.limits) for order in orders]
        return tuple(witness for witness in found if witness is not None)

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready facts."""
        return super().to_dict() | plain_data({"q": self.q, "witnesses": self.witnesses})

    @property
    def cuspidal(self) -> bool:
        """True where a loop was followed that does not bring the joints back; False alone is no proof of none."""
        return bool(self.witnesses)

    @property
    def witness(self) -> CuspWitness | None:
        """That with the smallest tool path; None where there is none."""
        return min(self.witnesses, key=lambda witness: witness.size, default=None)

    @property
    def most_regular(self) -> CuspWitness | None:
        """That whose least rcond is the greatest; None where there is none."""
        return max(self.witnesses, key=lambda witness: witness.rcond, default=None)

    @cached_property
    def families(self) -> tuple[Indices, ...] | None:
        """Of each family the numbers of its cusps in `q`; None where families are surfaces, which are only sampled.

        Cusps of a task of m rows lie on sets of dimension m - 2: they are alone for m = 2. Joints whose motion alone
        leads from cusps to cusps are left out; curves that remain are followed.
        """
        family = families(self.strategy, self.level, self.q)
        return None if family is None else tuple(np.flatnonzero(family == k) for k in range(family.max(initial=-1) + 1))

    @property
    def excluded(self) -> str:
        """Why the leaf has no cusp, so that none was looked for; empty where it may have some."""
        return _excluded(self.strategy)

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
        count, m = len(self), self.strategy.task.m
        ranged = np.isfinite(self.strategy.task.robot.lower).any()
        within = " within the joint limits" if self.limits and ranged else ""
        ended = ", where Ctrl-C ended the search" if self.stopped else ""
        search = f"found{within} from {self.starts:,} starts spread over the joint ranges{ended}"
        if not count:
            crossings = f"; {self.double:,} starts came to crossings of singular sheets, which are none"
            return f"no cusp {search}{crossings if self.double else ''}: {_unproven(self.strategy)}"
        families = ""
        if m > 2 and self.families is None:
            families = f", samples of surfaces of dimension {m - 2}"
        elif m > 2 and self.families is not None:
            families = f", of {len(self.families)} famil{'y' if len(self.families) == 1 else 'ies'}"
        cusps = f"{count:,} cusp{'' if count == 1 else 's'} {search}{families}"
        near = f"the nearest is {self.joints_away[0]:.2g} (largest joint) and {self.tool_away[0]:.2g} m (tool) from q0"
        if self.witness is None:
            return f"{cusps}; {near}; no loop of the tool round one of them was found that keeps to the leaf"
        witness = str(self.witness)
        return f"cuspidal: {cusps}; {near}. {witness[:1].upper()}{witness[1:]}"

    def __str__(self) -> str:
        return self.sentence


def _excluded(strategy: HolonomicStrategy) -> str:
    """Why a leaf has no cusp; empty where it may have some."""
    if strategy.task.m < 2:
        return "the task has one row, so the leaf is a curve, which has no cusp"
    found = leaf_class(strategy)
    if isinstance(found, NoClass) or not (found.proven and found.exact):
        return ""
    return "proven on the whole arm, whatever the level; `hk.certify(strategy)` makes a certificate of it"


def _unproven(strategy: HolonomicStrategy) -> str:
    """What is known where a search found no cusp."""
    found = leaf_class(strategy)
    if isinstance(found, NoClass) or not found.proven:
        return "a search, no proof that there is none"
    apart = f"{found.angle:.1e} rad and {found.distance:.1e} m"
    return f"a search; on the whole arm it is proven of an exact model, whose frames differ by at most {apart}"


@typed
def cusps(
    strategy: Strategy | InverseKinematics, q0: ArrayLike | None = None, *, starts: int = 1000, limits: bool = True
) -> Cusps:
    """Look for cusps of the leaf through q0, and for loops of the tool about them by which the joints do not come back.

    Newton's method on g(q) = c, det [J; J_g] = 0 and its cusp condition begins at `starts` postures spread over the
    joint ranges, hinges without a range over one turn; exact slopes come from the formulas. Loops about the cusps
    nearest to q0 are followed by `follow` when `witnesses` or `cuspidal` is first asked for: only where one ends at
    another posture is the leaf called cuspidal. The leaf may have several sheets, and the cusps may lie on others than
    that of q0. Where it is proven that there are none, on the whole arm, none is looked for: `excluded` says so.

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
    if not isinstance(strategy, InverseKinematics):
        if q0 is None:
            raise ArgumentError("q0", None, "give the posture whose leaf is meant")
        return _cusps(strategy, q0, starts, limits)
    # Of an inverse kinematics what was found is kept, unless Ctrl-C ended the search: then another call searches again
    if q0 is not None:
        raise ArgumentError("q0", q0, "leave it out: an inverse kinematics has its own")
    known = _kept_cusps(strategy)
    if (starts, limits) in known:
        return known[starts, limits]
    result = _cusps(strategy.strategy, strategy.q0, starts, limits)
    if not result.stopped:
        known[starts, limits] = result
    return result


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
    # Newton's method from the starts, a part after the other, until Ctrl-C; from none where there can be no cusp
    starts = 0 if _excluded(leafed) else starts
    postures, done, parts = spread(robot, starts), 0, []
    with progress("cusps", starts) as report, suppress(KeyboardInterrupt):  # what was found is kept
        while done < starts:
            parts.append(seek_cusps(leafed, level, postures[done : done + CHUNK]))
            done = min(done + CHUNK, starts)
            report(done)
    none = np.zeros((0, robot.n))
    points = joined(CuspPoints(none, none, none), *(points for points, _, _ in parts))
    double, corank = (sum(part[k] for part in parts) for k in (1, 2))
    # Each once, at those of its whole turns that are nearest to the start, and the nearest first
    q, inside = _at_turns(leafed, points.q, start, limits)
    each = distinct(leafed, q)
    points, inside = some(replace(points, q=q), each), inside[each]
    outside, points = int(np.sum(~inside)), some(points, inside)
    points = some(points, np.argsort(np.abs(points.q - start).max(axis=1, initial=0.0), kind="stable"))
    return Cusps(leafed, start, points, level, limits, done, outside, double, corank, stopped=done < starts)


def cusps_from(strategy: HolonomicStrategy, level: Vector, starts: Matrix, limits: bool) -> Array:
    """Tool poses (k, 4, 4) of the cusps of a leaf g = level that Newton's method finds from postures (s, n)."""
    q = seek_cusps(strategy, level, starts)[0].q if len(starts) else starts
    if limits:
        q, inside = _at_turns(strategy, q, None, limits)
        q = q[inside]
    return np.array([strategy.task.pose(posture) for posture in q]).reshape(-1, 4, 4)


def _at_turns(strategy: HolonomicStrategy, q: Matrix, near: Vector | None, limits: bool) -> tuple[Matrix, Flags]:
    """(postures (k, n) at those of their whole turns that are nearest to one, or to where they are; which of them are
    within the limits, if these count (k,))."""
    robot, slack = strategy.task.robot, TOLERANCES.limit if limits else np.inf
    turns, none = turns_of(strategy, spread(robot, SAMPLED)), np.zeros((len(q), strategy.constraint.rows))
    postures, inside = turns.nearest(q, none, q if near is None else near, robot.lower - slack, robot.upper + slack)
    return np.where(inside[:, None], postures, q), inside


def tool_away(task: Task, T: Array, others: Array) -> Vector:
    """How far tool poses (k, 4, 4) are from the nearest of others [m] (k,), a turn of one radian counted as 0.1 m."""
    from scipy.spatial import KDTree

    def placed(T: Array) -> Matrix:  # |R - R'| is sqrt(2) times the angle, where that is small
        turns = TURN / np.sqrt(2.0) * T[:, :3, :3].reshape(-1, 9) * bool(task._rotations)
        return np.hstack([T[:, :3, 3], turns])

    return KDTree(placed(others)).query(placed(T))[0] if len(T) else np.zeros(0)


@typed
def why_elsewhere(strategy: HolonomicStrategy, walk: Trajectory) -> str:
    """A sentence on a closed path whose joints, followed on a regular leaf, do not come back; empty where they do.

    Curvature is zero on a leaf: small loops return. So the path cannot be shrunk to a point on the leaf: it goes round
    a cusp or a hole, or turns the tool once. Cusps are looked for by Newton's method from the path's postures, and the
    nearest one is named.

    Args:
        walk: of `follow`, whose path was closed.
    """
    drifts = walk.drift()
    if walk.status is not Status.COMPLETE or not len(drifts) or np.abs(drifts[0]).max() <= NO_DRIFT:
        return ""
    drift, count = drifts[0], 100
    i = int(np.abs(drift).argmax())
    fact = (
        f"after a cycle {walk.joint_names[i]} is {drift[i]:.3g} {walk.joint_units[i]} from its start, though the leaf "
        "is regular along the path: it cannot be shrunk to a point on the leaf"
    )
    if np.abs(drift - 2 * np.pi * whole_turns(drift, walk.joint_units)).max() <= NO_DRIFT:
        return f"{fact}, and the joints are whole turns further"
    # Cusps within 0.1 m of the path, a turn of one radian counted as 0.1 m, are called near it
    postures = walk.q[np.linspace(0, len(walk.q) - 1, count).astype(int)]
    poses = cusps_from(strategy, leaf_value(strategy, walk.q[0]), postures, limits=False)
    away = tool_away(strategy.task, poses, np.array([strategy.task.pose(q) for q in postures]))
    if len(away) and away.min() <= 0.1:
        place = ", ".join(f"{x:.3g}" for x in poses[int(away.argmin()), :3, 3])
        return f"{fact}; a cusp of the leaf lies {away.min():.2g} m from the path, at the tool position [{place}] m"
    return f"{fact}; no cusp was found near the path, from {count} of its postures"
