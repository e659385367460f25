"""Two postures of one leaf with one tool pose, joined by a regular motion: a leaf is cuspidal. Theory 7.3

Near a cusp the leaf lies over the poses as (s, y) -> (s^3 + y s, y). For y < 0 three postures share a pose; the outer
two lie on one side of the singular sheet det E ~ 3 s^2 + y = 0 and are joined round y > 0. The tool path of that motion
is closed, but the joints do not come back, though the curvature is zero and no posture on it is singular.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, HolokinError
from ...base.poses import pose_from
from ...base.tolerances import TOLERANCES
from ...base.types import Array, ArrayLike, Flags, Indices, Matrix, Value, Vector, kept, whole
from ...motion.follow_path import follow
from ...motion.ik.leaf import leaf_step, leaf_value, with_leaves
from ...motion.ik.newton import newton
from ...motion.ik.posture_search import leaf_postures, spread
from ...motion.trajectory import Status
from ...path import Path
from ...path.splines import spline
from ...robot import start_posture
from ...strategies import HolonomicStrategy, Strategy
from ...strategies.self_motions import joint_gap
from ...strategies.tasks.task import of_one_tool
from ...symbolic import Function
from .cusp_search import CuspPoints

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
    p, R = strategy.task.poses(q)
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
    p, R = strategy.task.poses(first[which])
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
    p, R = strategy.task.poses(flat)
    p, R = p.reshape(k, -1, 3), R.reshape(k, -1, 3, 3)
    length = np.linalg.norm(np.diff(p, axis=1), axis=2).sum(axis=1)
    turn, least = _turned(R) if strategy.task.rotations else np.zeros(k), rcond.reshape(k, -1).min(axis=1)
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
    off = np.abs(leafed.task.error(b, *leafed.task.place(a))).max()
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
    p, R = strategy.task.poses(Q)
    poses = pose_from(p, R)
    poses[-1] = poses[0]
    turns = bool(strategy.task.rotations)
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
