"""All postures at a tool pose on a leaf: by a closed form, or as the roots of g along the self-motions of the pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.arguments import typed
from ...base.errors import ShapeError
from ...base.poses import PoseLike, given_pose
from ...base.tolerances import TOLERANCES
from ...base.types import (
    ROTATION,
    ArrayLike,
    Flags,
    Indices,
    Matrix,
    Result,
    Value,
    Vector,
    finite,
    kept,
    tool_pose,
)
from ...robot import Robot
from ...robot.closed_form import ArmClass, GeneralInverse, Held, general_inverse
from ...strategies import HolonomicStrategy, Strategy
from ...strategies.self_motion_curves import joint_gap
from ...strategies.tasks.task import of_one_tool
from ..self_motions.curve_cuts import curves_through
from ..self_motions.posture_search import spread
from ..self_motions.self_motions import SelfMotions, cut_of, self_motions_at
from ..self_motions.whole_turns import SAME, SAMPLED, turn_options, turned, turns_of
from .closed_leaf import DOUBT, Following, closed_leaf, held_joints, leaf_class
from .leaf import check_levels, leaf_postures, with_leaves
from .level_roots import postures_near, roots_along

STARTS = 1024
"""Of Newton's method where postures are searched for: with several redundant joints, or with none."""


STILL_STARTS = 64
"""Of Newton's method for curves along which a held joint stands still, at poses where there is one."""

STILL = 0.3
"""How far [joint units] a posture is from the rows of curves that it is not on: those are half as far apart."""

CROSSING, BESIDE_CROSSING = 1e-4, 0.6
"""Smallest over largest singular value of J where curves cross, and how far beside that [joint units] others start."""

MEET = 1e-8
"""rcond of six hinges where two postures meet."""


@dataclass(frozen=True, eq=False)
class Postures(Result, Value):
    """The postures q (k, n) at one tool pose (4, 4) on the leaf c (r,), in the order of their joints.

    Each is at the pose and on the leaf; of those that differ by whole turns of hinges it is one, see `near` of
    `all_postures`. rcond (k,): how regular [J; J_g] is there. Where a part of a self-motion is on the leaf, one posture
    stands for it, and family (k,) is the length of that part [joint units]; else it is 0. `singular` postures, where
    [J; J_g] is singular, as where two meet, are not counted. `outside` postures lie outside the joint limits and were
    left out.

    curves: along how many self-motions of the pose g was looked at, in steps of `step` [joint units] at most; searched:
    whether these are not arcs of closed forms, but were traced from cuts at some values of joints, and from starts.
    doubt: places where it stays open whether there is a posture. starts: of how many a search for the postures
    themselves began, else 0; found (k,): from how many of them each was found.
    """

    q: Matrix
    pose: Matrix
    level: Vector
    found: Vector
    rcond: Vector
    family: Vector
    starts: int
    singular: int
    outside: int
    curves: int | None = None
    step: float = 0.0
    doubt: int = 0
    searched: bool = False
    by: str = "a closed form"

    def __len__(self) -> int:
        return len(self.q)

    @property
    def unseen(self) -> float:
        """About how likely one more start is to find a posture that is not yet here: the share of starts whose posture
        no other start found [Goo53]; 0 without starts."""
        return float(np.sum(self.found == 1)) / self.starts if self.starts else 0.0

    @property
    def closed(self) -> bool:
        """Whether an inverse of six hinges gave them, `by` a closed form or eigenvalues: then there are no others."""
        return not self.starts and self.curves is None

    @property
    def sentence(self) -> str:
        """What was found, and how."""
        on_leaf = " on this leaf" if len(self.level) else ""
        at = f"{len(self)} posture{'' if len(self) == 1 else 's'} at this tool pose{on_leaf}"
        left = f"; {self.outside} more outside the joint limits" if self.outside else ""
        meet = "; two postures meet here, at a singular one, and are not counted" if self.singular else ""
        if self.closed:
            return f"{at}, by {self.by}{left}; there are no others{meet}"
        if self.curves is not None:
            return f"{at}, {self._along}{left}{meet}{self._open}"
        least = f", each from {int(self.found.min())} of them at least" if len(self) else ""
        more = f"; one more start would find another with a chance of {self.unseen:.1g}" if self.unseen else ""
        return (
            f"{at} found by Newton's method from {self.starts} starts spread over the "
            f"joint ranges{least}{left}{more}; a search, no proof that there are no others"
        )

    @property
    def _along(self) -> str:
        if not self.curves:
            return "which has no self-motion" + ", as far as cuts and starts find them" * self.searched
        curves = f"{self.curves} curve{'' if self.curves == 1 else 's'}"
        by = "that cuts and starts found" if self.searched else "of its self-motion"
        return f"where g passes the level on the {curves} {by}, in steps of {self.step:.1g} at most"

    @property
    def _open(self) -> str:
        many = int(np.sum(self.family > 0))
        families = (
            f"; {many} of them stand{'s' * (many == 1)} for a part of a curve that is on the leaf" if many else ""
        )
        places = f"{self.doubt} place{'' if self.doubt == 1 else 's'}"
        return families + (f"; at {places} it stays open whether there is another" if self.doubt else "")

    def __str__(self) -> str:
        return self.sentence


@typed
def all_postures(
    strategy: Strategy,
    pose: PoseLike,
    level: ArrayLike = 0.0,
    *,
    limits: bool = True,
    near: ArrayLike | None = None,
) -> Postures:
    """All postures with f(q) = x and g(q) = c, the branches of a leaf.

    Where single joints are held and six hinges are left, they are those of a closed form, or of the eigenvalues of
    their equations. Else, with one redundant joint, they are the roots of g along the self-motions of the pose: all of
    them, unless g turns round twice between two looks at it. With several redundant joints they are those that Newton's
    method finds from 1,024 starts. Hinges whose whole turns change g by amounts that vary with the posture are looked
    at within one turn about `near` where they have no limits.

    A six-axis arm, or one of seven axes with a joint locked, has at most 16, or a curve of them [Pri86]. A rule that
    ties several joints may have more: 26 were found of a Panda with 4 q1 + 3 q3 held. `ik` keeps to the one that
    it began with. Where nothing is redundant, n = m, any strategy will do, as `moore_penrose(task)`: all postures with
    f(q) = x.

    Args:
        pose: of the tool (4, 4).
        level: c (r,), or one number for all rows.
        limits: False keeps postures beyond the joint limits, too.
        near: a posture (n,): of answers that differ by whole turns of hinges, which keep the pose and the level, the
            one nearest to it is given; a search begins there, too. Without it, the one nearest to the middle of the
            ranges with limits, else to 0.

    Raises:
        ArgumentError: a strategy without leaves. ShapeError.
    """
    strategy = with_leaves(strategy)
    task = strategy.task
    of_one_tool(task, "all_postures")
    wanted = given_pose("a tool pose", pose)
    given, r = finite("the leaf", level), strategy.constraint.rows
    if given.shape not in ((), (r,)):
        raise ShapeError("the leaf", (r,), given.shape)
    c = np.broadcast_to(given, (r,))
    check_levels(strategy, c)
    aim = task.robot.checked(near, "near") if near is not None else task.robot.middle * limits
    if (leaf := closed_leaf(strategy, c, limits)) is not None:
        return _of_closed_form(strategy, leaf, wanted, c, aim, limits)
    tool_pose("a tool pose", wanted)
    if (known := _of_six_hinges(strategy, wanted, c, aim, limits)) is not None:
        return known
    if r == 1:
        return _of_curves(strategy, wanted, c, aim, limits)
    return _of_search(strategy, wanted, c, aim, limits, near is not None)


def _of_closed_form(
    strategy: HolonomicStrategy, leaf: Held | Following, pose: Matrix, c: Vector, aim: Vector, limits: bool
) -> Postures:
    answers = leaf.one(pose)
    if not answers[0, 11] < ROTATION:
        tool_pose("a tool pose", pose)
    real, doubtful = answers[:, 9] > DOUBT, np.abs(answers[:, 9]) <= DOUBT
    q, meet = leaf.postures(answers[real]), int(doubtful.any())
    return _at_turns(strategy, pose, c, q, leaf.inverse.others, aim, limits, meet, "a closed form")


def _at_turns(
    strategy: HolonomicStrategy, pose: Matrix, c: Vector, q: Matrix, turning: list[int], aim: Vector, limits: bool,
    singular: int, by: str,
) -> Postures:  # fmt: skip
    """Postures (k, n) of an inverse of six hinges, `turning`, at the whole turns nearest to a posture aim (n,)."""
    robot = strategy.task.robot
    low, high = _bounds(robot, limits)
    q[:, turning] = turned(q[:, turning], aim[turning], low[turning], high[turning])
    inside = np.all(robot.beyond(q) <= (TOLERANCES.limit if limits else np.inf), axis=1)
    q = q[inside]
    rcond = np.array([strategy.gain(posture)[1] for posture in q])  # one by one: so few cost less than a batch
    order, outside = _order(q), int(np.sum(~inside))
    found, none = np.ones(len(q)), np.zeros(len(q))
    return Postures(q[order], pose, c.copy(), found, rcond[order], none, 0, singular, outside, by=by)


@kept
def _general(strategy: HolonomicStrategy) -> GeneralInverse | None:
    """The inverse of the six hinges that held joints leave; None where there is none."""
    held = held_joints(strategy)
    if isinstance(held, str) or held.follows is not None or isinstance(leaf_class(strategy), ArmClass):
        return None
    inverse = general_inverse(strategy.task.robot, held.joints, strategy.task.tip)
    return inverse if isinstance(inverse, GeneralInverse) else None


def _of_six_hinges(strategy: HolonomicStrategy, pose: Matrix, c: Vector, aim: Vector, limits: bool) -> Postures | None:
    """Those of the general inverse of six hinges; None where there is none, or where it leaves one in doubt."""
    inverse, held = _general(strategy), held_joints(strategy)
    if inverse is None or isinstance(held, str):
        return None
    found = inverse.postures(pose[None], held.at(c, 0.0))
    if found.doubtful[0] or found.curve[0]:
        return None
    # Two postures that meet in a singular one are not counted, as with closed forms.
    regular = found.rcond > MEET
    q, meet = found.q[regular], int(np.sum(~regular))
    return _at_turns(strategy, pose, c, q, inverse.others, aim, limits, meet, "the eigenvalues of its equations")


def _of_curves(strategy: HolonomicStrategy, pose: Matrix, c: Vector, aim: Vector, limits: bool) -> Postures:
    task = strategy.task
    motions = self_motions_at(task, pose[None, :3, 3], pose[None, :3, :3])
    if cut_of(task) is not None:
        motions = _with_still_curves(strategy, motions, aim)
    curves = len(motions.closed)
    if not curves:
        # At the edge of the reach all postures are singular: there Newton's method halves the way with each step.
        none, starts = np.zeros(0), np.vstack([aim, spread(task.robot, SAMPLED)])
        edge = postures_near(strategy, starts, motions.p[0], motions.R[0], steps=40, exact=SAME)
        return Postures(np.zeros((0, task.n)), pose, c.copy(), none, none, none, 0, int(len(edge) > 0), 0, 0)
    low, high = _bounds(task.robot, limits)
    turns = turns_of(strategy, motions.q)
    if turns.varying.any():
        motions = _copied(motions, turns.varying, aim, low, high)
    roots = roots_along(strategy, motions, float(c[0]), turns.levels())
    q, inside = turns.nearest(roots.q, -roots.shift[:, None], aim, low, high)
    order = np.flatnonzero(inside)[_order(q[inside])]
    found, outside = np.ones(len(order)), int(np.sum(~inside))
    return Postures(
        q[order], pose, c.copy(), found, roots.rcond[order], roots.family[order], 0, roots.singular, outside,
        curves, roots.step, roots.doubt, cut_of(task) is None,
    )  # fmt: skip


def _with_still_curves(strategy: HolonomicStrategy, motions: SelfMotions, aim: Vector) -> SelfMotions:
    """With those curves along which the coordinate of `cut_of` stands still, as where two axes are one line.

    They are there at special poses only. They cross others, which are then open, or pass near the posture aim (n,).
    """
    task, p, R = motions.task, motions.p, motions.R
    seeds, found = [aim[None], *_beside_crossings(motions)], np.zeros((0, task.n))
    steps = 20 if len(seeds) > 1 else 4
    for starts in (np.vstack(seeds), spread(task.robot, STILL_STARTS)):  # more, once there is one
        q = postures_near(strategy, starts, p[0], R[0], steps)
        far = [np.abs(joint_gap(task.robot, motions.q, one)).max(axis=1).min(initial=np.inf) for one in q]
        found, steps = np.vstack([found, q[np.array(far, dtype=float) > STILL]]), 20
        if not len(found):
            return motions
    q = found
    more, pose, curve, closed = curves_through(task, p, R, q, np.zeros(len(q), dtype=np.intp))
    every, curve = np.vstack([motions.q, more]), np.append(motions.curve, curve + len(motions.closed))
    return SelfMotions(task, p, R, every, np.append(motions.pose, pose), curve, np.append(motions.closed, closed))


def _beside_crossings(motions: SelfMotions) -> list[Matrix]:
    """Postures around ends of open curves, where J has two null vectors: on a circle between these."""
    if motions.closed.all():
        return []
    ends = np.flatnonzero(np.diff(motions.curve, prepend=-1, append=len(motions.closed)))
    ends = np.concatenate([ends[:-1][~motions.closed], ends[1:][~motions.closed] - 1])
    q = motions.q[ends]
    _, size, Vt = np.linalg.svd(motions.task.jacobian_batch(q)[0])
    crossing = size[:, -1] < CROSSING * size[:, 0]
    q, Vt = q[crossing], Vt[crossing]
    each = ~np.tril(np.abs(joint_gap(motions.task.robot, q[:, None], q[None])).max(axis=2) < STILL, -1).any(axis=1)
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)[:, None]
    return [
        posture + BESIDE_CROSSING * (np.cos(turn) * N[0] + np.sin(turn) * N[1])
        for posture, N in zip(q[each], Vt[each, -2:], strict=True)
    ]


def _of_search(
    strategy: HolonomicStrategy, pose: Matrix, c: Vector, aim: Vector, limits: bool, from_aim: bool
) -> Postures:
    """Newton's method from starts over the joint ranges, a low-discrepancy sequence, the same at every call."""
    task, (low, high) = strategy.task, _bounds(strategy.task.robot, limits)
    turns = turns_of(strategy, spread(task.robot, SAMPLED))
    begun = spread(task.robot, STARTS, ~turns.free & task.robot.hinges)
    begun = np.vstack([aim, begun[1:]]) if from_aim else begun
    q, rcond, arrived = leaf_postures(strategy, begun, pose[:3, 3], pose[:3, :3], c)
    regular = arrived & (rcond > TOLERANCES.singular)
    singular = int(np.sum(arrived & ~regular))
    classes = _distinct(task.robot, q[regular])
    # Of each class of postures that differ by whole turns the one nearest to what is wanted.
    nearest, inside = np.zeros((len(classes), task.n)), np.zeros(len(classes), dtype=bool)
    for i, members in enumerate(classes):
        at_turns, fits = turns.nearest(members, np.zeros((len(members), len(c))), aim, low, high)
        best = np.where(fits, np.square(at_turns - aim).sum(axis=1), np.inf).argmin()
        nearest[i], inside[i] = at_turns[best], fits[best]
    postures, counts = nearest[inside], np.array([len(members) for members in classes], dtype=float)[inside]
    order = _order(postures)
    rcond = np.array([strategy.gain(posture)[1] for posture in postures[order]])
    found, outside = counts[order], int(np.sum(~inside))
    return Postures(postures[order], pose, c.copy(), found, rcond, 0 * rcond, STARTS, singular, outside)


def _order(q: Matrix) -> Indices:
    """Postures (k, n) in the order of their joints."""
    return np.lexsort(np.round(q, 6).T[::-1])


def _bounds(robot: Robot, limits: bool) -> tuple[Vector, Vector]:
    if not limits:
        return np.full(robot.n, -np.inf), np.full(robot.n, np.inf)
    return robot.lower - TOLERANCES.limit, robot.upper + TOLERANCES.limit


def _distinct(robot: Robot, q: Matrix) -> list[Matrix]:
    """Postures (k, n), those that differ by whole turns of hinges together, as they were found."""
    classes: list[list[Vector]] = []
    for posture in q:
        known = np.array([members[0] for members in classes]).reshape(-1, robot.n)
        # One posture: well over `EXACT`, well under what tells branches apart.
        same = np.abs(joint_gap(robot, known, posture)).max(axis=1) < 1e-6
        if same.any():
            classes[int(np.argmax(same))].append(posture)
        else:
            classes.append([posture])
    return [np.array(members) for members in classes]


# --- Curves at whole turns of hinges.

BESIDE = 0.3
"""How far [joint units] beyond the limits a curve is still looked at."""


def _copied(motions: SelfMotions, varying: Flags, aim: Vector, low: Vector, high: Vector) -> SelfMotions:
    """The parts of the curves within the limits, at all whole turns of hinges (n,); without limits, of one turn about
    a posture `aim` (n,)."""
    around = np.where(varying & ~(np.isfinite(low) & np.isfinite(high)), np.pi, np.inf)
    low, high = np.maximum(low, aim - around), np.minimum(high, aim + around)
    which = np.flatnonzero(varying)
    options = turn_options(motions.q[:, which], aim[which], low[which], high[which])
    linked = np.append(motions.curve[1:] == motions.curve[:-1], False)
    middle = motions.task.robot.middle
    nearest = np.where(
        motions.task.robot.hinges, middle + (motions.q - middle + np.pi) % (2 * np.pi) - np.pi, motions.q
    )
    q, curve, last = [], [], 0
    for option in options:
        moved = motions.q.copy()
        moved[:, which] += 2 * np.pi * option
        tested = np.where(varying, moved, nearest)
        inside = np.all((tested >= low - BESIDE) & (tested <= high + BESIDE), axis=1)
        # With their neighbours, since a stretch may be within the limits in part; each run is a curve of its own.
        near = inside | np.append(False, (inside & linked)[:-1]) | (np.append(inside[1:], False) & linked)
        rows = np.flatnonzero(near)
        ends = np.append(False, (np.diff(rows) > 1) | ~linked[rows[:-1]]) if len(rows) else near[:0]
        curve.append(last + np.cumsum(ends))
        last = curve[-1][-1] + 1 if len(rows) else last
        q.append(moved[rows])
    parts, of_part = np.concatenate(q), np.concatenate(curve)
    pose = np.zeros(len(parts), dtype=np.intp)
    return SelfMotions(motions.task, motions.p, motions.R, parts, pose, of_part, np.zeros(last, dtype=bool))
