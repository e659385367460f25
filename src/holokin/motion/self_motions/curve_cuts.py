"""All curves of postures that hold the tool at a pose, where one joint is redundant: from cuts through them.

A cut holds one coordinate at a value: a joint, or the spin of the tool about an axis that the task leaves free. What
is left is an arm of six hinges, whose inverse gives every posture of the cut. Curves are traced through these, each
once. On a curve that no cut meets every coordinate that is cut stays between two neighbouring values: such short curves
are looked for by Newton's method, from starts spread over the joint ranges, and so are those of arms without cuts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.poses import pose_from
from ...base.types import Array, Flags, Indices, Matrix, Value, Vector, frozen, kept
from ...robot import Robot
from ...robot.closed_form import ArmClass, ClosedInverse, GeneralInverse, arm_class, general_inverse
from ...strategies.self_motion_curves import CurveEnd, CurveTracer, joint_gap, null_vectors
from ...strategies.tasks.frame_task import FrameTask
from ...strategies.tasks.task import Task, TipFrame
from ...symbolic import Function, fmax, fmin, least_norm, norm_2, symbol
from .posture_search import spread

STEP = 0.2
"""Arc length [joint units] between the postures of a curve."""

SHORT, FINER = 24, 8
"""Closed curves of so few postures are traced again in steps so many times as short: one that bends within a step may
have been followed for several rounds."""

LONGEST = 500.0
"""Arc length [joint units] up to which a curve is traced each way: most close after 10 to 30, a Sawyer's after 90."""

SAME = 1e-6
"""Distance [joint units] between a posture and where tracing leads beside it, up to which they are one."""

STARTS = 128
"""Starts of Newton's method at each pose: of 688 curves at 200 poses of a Sawyer each draws at least 6 % of them."""

ROUNDS, LONGEST_STEP, EXACT = 4, 0.5, 1e-10
"""Of Newton's method: eight steps each; the joint motion [joint units] of one at most, and of the last one."""

SEEDS = 16
"""Postures of a pose whose curves are traced at once."""

BESIDE, NEAR = 0.7, 3 * SEEDS
"""How far off, over STEP, a posture of a curve is from those that are traced, and how many of these are tried there."""

PIECE = 256
"""Poses at once."""

VALUES = 12
"""Values at which a coordinate is cut; of two, half as many each."""


@dataclass(frozen=True, eq=False)
class Cuts(Value):
    """The postures of poses at values (k,) of a coordinate, all of them.

    axis: about which (3,) the pose turns by the value, in the tool's frame, or with `of_base` in the base's; None where
    a joint is held at it.
    """

    inverse: ClosedInverse | GeneralInverse
    values: Vector
    axis: Vector | None = None
    of_base: bool = False

    def postures(self, p: Matrix, R: Array) -> tuple[Matrix, Indices]:
        """(postures (N, n), at which pose each is (N,)) at positions (S, 3), rotations (S, 3, 3)."""
        row, value = np.repeat(np.arange(len(p)), len(self.values)), np.tile(self.values, len(p))
        p, R = p[row], R[row]
        if self.axis is not None:
            turn = _turns_about(self.axis, value)
            R = turn @ R if self.of_base else R @ turn
        held = value[:, None] if self.axis is None else np.zeros((len(p), 0))
        if isinstance(self.inverse, GeneralInverse):
            found = self.inverse.postures(pose_from(p, R), held)
            return found.q, row[found.row]
        answers = self.inverse.answers(pose_from(p, R), held)
        sample, signs = np.nonzero(answers[:, :, 9] > 0)
        q = np.zeros((len(sample), self.inverse.arm.robot.n))
        q[:, self.inverse.others], q[:, list(self.inverse.arm.held)] = answers[sample, signs, :6], held[sample]
        return q, row[sample]


def _turns_about(axis: Vector, angle: Vector) -> Array:
    """Rotations (k, 3, 3) about a unit axis (3,)."""
    K = np.cross(axis, np.eye(3)).T
    return np.eye(3) + np.sin(angle)[:, None, None] * K + (1 - np.cos(angle))[:, None, None] * (K @ K)


@kept
def cuts_of(task: Task) -> tuple[Cuts, ...]:
    """The cuts of a task; none where no coordinate leaves six hinges with an inverse."""
    if not (isinstance(task, FrameTask) and isinstance(task.frame, TipFrame) and {0, 1, 2} <= set(task.rows)):
        return ()
    robot, angular = task.robot, tuple(row - 3 for row in sorted(task.rows)[3:])
    if len(angular) < 3:
        turn, inverse = task.representation.directions.get(angular), _inverse(robot, (), task.tip)
        if turn is None or inverse is None:
            return ()
        return (Cuts(inverse, _values(VALUES), frozen(np.array(turn[0], dtype=float)), turn[1]),)
    # A slide is held where there is one. Else two joints: of those that move the most in self-motions.
    slides = np.flatnonzero(~robot.hinges).tolist()
    if slides:
        inverse = _inverse(robot, (slides[0],), task.tip)
        low, high = robot.lower[slides[0]], robot.upper[slides[0]]
        return (Cuts(inverse, np.linspace(low, high, VALUES)),) if inverse and np.isfinite(high - low) else ()
    cuts = []
    for k in _moving_most(task):
        inverse = _inverse(robot, (k,), task.tip)
        cuts += [] if inverse is None else [Cuts(inverse, _values(VALUES // 2))]
        if len(cuts) == 2:
            break
    return tuple(cuts)


def _inverse(robot: Robot, held: tuple[int, ...], tip: str | None) -> ClosedInverse | GeneralInverse | None:
    """The inverse of the arm that is left when some coordinates are held."""
    found = arm_class(robot, held, tip)
    if isinstance(found, ArmClass):
        return ClosedInverse(found, limits=False)
    inverse = general_inverse(robot, held, tip)
    return inverse if isinstance(inverse, GeneralInverse) else None


def _values(count: int) -> Vector:
    """Angles of a cut: no special ones, at which axes may meet or be parallel."""
    return frozen((np.arange(count) + 0.37) * (2 * np.pi / count) - np.pi)


def _moving_most(task: Task) -> list[int]:
    """The joints in the order of how much they move in self-motions, on the whole."""
    Q = np.random.default_rng(0).uniform(-np.pi, np.pi, (256, task.n))
    v = np.abs(null_vectors(task, Q))
    return np.argsort(-v.mean(axis=0)).tolist()


def curves_by_cuts(task: Task, p: Matrix, R: Array) -> tuple[Matrix, Indices, Indices, Flags]:
    """All curves of postures at tool poses p (S, 3), R (S, 3, 3) of a task that leaves one joint, whatever the limits.

    Returns: postures (N, n), pose (N,), curve (N,), and which curves close (C,). Those of one curve follow each other
    in order, at arc lengths of about STEP, hinges continuous along it; the last one of a closed curve is its first one,
    but for whole turns. Curves are in the order of their poses. Slides keep their limits: there curves end.
    """
    cuts, parts, curves = cuts_of(task), [], 0
    task = task._geometric_twin  # which has no singular angles on the way
    for first in range(0, max(len(p), 1), PIECE):
        some = p[first : first + PIECE], R[first : first + PIECE]
        found = [cut.postures(*some) for cut in cuts] + [_from_starts(task, *some)]
        q, pose = (np.concatenate(arrays) for arrays in zip(*found, strict=True))
        q, pose, curve, closed = curves_through(task, *some, q, pose)
        parts.append((q, pose + first, curve + curves, closed))
        curves += len(closed)
    q, pose, curve, closed = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return q, pose, curve, closed


def _from_starts(task: Task, p: Matrix, R: Array) -> tuple[Matrix, Indices]:
    """(postures (N, n), at which pose each is (N,)) to which Newton's method leads from STARTS starts at each pose."""
    starts, slides, step = spread(task.robot, STARTS), ~task.robot.hinges, _newton_step(task)
    going, q = np.repeat(np.arange(len(p)), STARTS), np.tile(starts, (len(p), 1))
    found, poses = [q[:0]], [going[:0]]
    for _ in range(ROUNDS):
        ways, sizes = step.repeated(8, 1, q, p[going], R[going])
        q, size = ways[:, -1], sizes[:, -1, 0]
        there = size < EXACT
        found.append(q[there])
        poses.append(going[there])
        left = np.isfinite(size) & ~there
        q, going = q[left], going[left]
    q, pose = np.concatenate(found), np.concatenate(poses)
    within = (task.robot.beyond(q)[:, slides] <= 0).all(axis=1)
    return q[within], pose[within]


@kept
def _newton_step(task: Task) -> Function:
    """(q, p, R) -> (a posture nearer to the pose (p, R), the size of the correction [joint units])."""
    q, (p, R) = symbol("q", task.n), task._target_symbols()
    kinematics = task.kinematics(q)
    move = least_norm(task.jacobian_expression(kinematics, q), task._error_expression(kinematics, p, R)).X
    size = norm_2(move)
    outputs = {"q_next": q + move * fmin(1, LONGEST_STEP / fmax(size, 1e-300)), "size": size}
    return Function("newton_step", {"q": q, "p": p, "R": R}, outputs)


def curves_through(task: Task, p: Matrix, R: Array, q: Matrix, pose: Indices) -> tuple[Matrix, Indices, Indices, Flags]:
    """The curves through postures q (k, n) at the poses `pose` (k,) of p (S, 3), R (S, 3, 3), each once.

    Returns: as `curves_by_cuts`.
    """
    tracer, order = CurveTracer(task, p, R), np.argsort(pose, kind="stable")
    q, pose, curves = q[order], pose[order], _Curves(q[:0], pose[:0], pose[:0], np.zeros((0, 2), dtype=object), q[:0])
    while len(q):
        # Of each pose some postures are traced at once: many curves side by side take little longer than one.
        begun = np.arange(len(pose)) - np.searchsorted(pose, pose) < SEEDS
        traced = _traced(tracer, q[begun], pose[begun])
        # Each once: not those that pass the seed of an earlier one, or whose seed an earlier one passes.
        every, known = curves.and_also(traced), len(curves.pose)
        seed, passing = _passes(tracer, traced, every.seed, every.pose)
        again = np.zeros(len(every.pose), dtype=bool)
        again[np.maximum(seed, passing + known)[seed != passing + known]] = True
        curves, traced = every.chosen(~again), traced.chosen(~again[known:])
        # The postures that they pass are done with.
        q, pose = q[~begun], pose[~begun]
        left = np.ones(len(q), dtype=bool)
        left[_passes(tracer, traced, q, pose)[0]] = False
        q, pose = q[left], pose[left]
    return _in_rows(tracer, curves.chosen(np.argsort(curves.pose, kind="stable")))


def curve_of_each(task: Task, p: Matrix, R: Array, q: Matrix) -> tuple[Matrix, Indices, Flags]:
    """The curve through each of postures q (k, n) with the tool at p (k, 3), R (k, 3, 3).

    Returns: postures (N, n), of which curve each is (N,), and which close (k,), as `curves_by_cuts`.
    """
    tracer = CurveTracer(task, p, R)
    postures, _, curve, closed = _in_rows(tracer, _traced(tracer, q, np.arange(len(q))))
    return postures, curve, closed


@dataclass(frozen=True, eq=False)
class _Curves(Value):
    """Curves at poses pose (C,): their postures q (N, n) one after another, size (C,) of them each, ends (C, 2).

    seed (C, n): the posture from which each was traced.
    """

    q: Matrix
    size: Indices
    pose: Indices
    ends: Array
    seed: Matrix

    def chosen(self, which: Indices | Flags) -> _Curves:
        """Some of them."""
        which = np.arange(len(self.size))[which]
        first, size = np.cumsum(self.size) - self.size, self.size[which]
        rows = np.repeat(first[which] - np.cumsum(size) + size, size) + np.arange(size.sum())
        return _Curves(self.q[rows], size, self.pose[which], self.ends[which], self.seed[which])

    def and_also(self, others: _Curves) -> _Curves:
        """These and others."""
        names = ("q", "size", "pose", "ends", "seed")
        return _Curves(*(np.concatenate([getattr(x, name) for x in (self, others)]) for name in names))


def _traced(tracer: CurveTracer, q: Matrix, pose: Indices) -> _Curves:
    """The curves through postures (k, n) at the poses (k,); those that end at the limit of a slide reach it."""
    task, every = tracer.task, np.arange(len(q))
    own = CurveTracer(task, tracer.p[pose], tracer.R[pose])
    slides = ~task.robot.hinges
    postures, size, _, endings = own.postures(q, null_vectors(task, q), step=STEP, length=LONGEST, limits=slides)
    ends, curve = np.array(endings, dtype=object).reshape(-1, 2), np.repeat(every, size)
    short = np.flatnonzero((ends[:, 1] == CurveEnd.CLOSED) & (size <= SHORT))
    if len(short):
        beside, v = CurveTracer(task, own.p[short], own.R[short]), null_vectors(task, q[short])
        finer = beside.postures(q[short], v, step=STEP / FINER, length=LONGEST, limits=slides)
        size[short], ends[short] = finer[1], np.array(finer[3], dtype=object).reshape(-1, 2)
        others = ~np.isin(curve, short)
        which = np.append(curve[others], np.repeat(short, finer[1]))
        order = np.argsort(which, kind="stable")
        postures, curve = np.concatenate([postures[others], finer[0]])[order], which[order]
    # What is before its first posture, its postures, what is behind its last one.
    last = np.cumsum(size) - 1
    first = last + 1 - size
    parts = [(postures, curve)]
    for side, (at, inside) in enumerate([(first, np.minimum(first + 1, last)), (last, np.maximum(last - 1, first))]):
        some = (ends[:, side] == CurveEnd.LIMIT) & (size > 1)
        end, inner = postures[at[some]], postures[inside[some]]
        parts.insert(2 * side, _limits_ahead(own, end, end - inner, every[some]))
    rows, curve = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    order = np.argsort(curve, kind="stable")
    return _Curves(rows[order], np.bincount(curve, minlength=len(q)), pose, ends, q)


def _limits_ahead(tracer: CurveTracer, q: Matrix, way: Matrix, pose: Indices) -> tuple[Matrix, Indices]:
    """(postures (j, n) at a slide's limit that is less than a step ahead of some (k, n); the poses of them (j,))."""
    robot, rows = tracer.task.robot, np.arange(len(q))
    if not len(q):
        return q, pose
    limit = np.where(robot.hinges, np.inf, np.where(way > 0, robot.upper, robot.lower))
    with np.errstate(all="ignore"):  # of the slides the one that is there first
        slide = np.argmin(np.where(robot.hinges, np.inf, np.abs((limit - q) / way)), axis=1)
    there, v, limit = q, way / np.linalg.norm(way, axis=1, keepdims=True), limit[rows, slide]
    for _ in range(6):
        with np.errstate(all="ignore"):
            length = np.nan_to_num((limit - there[rows, slide]) / v[rows, slide])
        there, v, _ = tracer.step(there, v, pose, np.clip(length, -STEP, STEP))
    moved = np.linalg.norm(there - q, axis=1)
    good = (np.abs(limit - there[rows, slide]) < SAME) & (moved > SAME) & (moved < 2 * STEP)
    return there[good], pose[good]


def _passes(tracer: CurveTracer, curves: _Curves, q: Matrix, pose: Indices) -> tuple[Indices, Indices]:
    """Which of postures q (k, n) at the poses `pose` (k,) lie on which curves (in the order of their poses)."""
    from scipy.spatial import KDTree

    # Postures of curves of the pose beside these, on either side of a sharp turn; chords of hinges count for angles.
    robot, own = tracer.task.robot, np.repeat(np.arange(len(curves.size)), curves.size)
    if not len(own):
        return pose[:0], own
    tree = KDTree(_embedded(robot, curves.q, curves.pose[own]))
    gap, near = tree.query(_embedded(robot, q, pose), k=NEAR, distance_upper_bound=BESIDE * STEP)
    i, rank = np.nonzero(np.isfinite(gap))
    j = np.asarray(near)[i, rank]
    # Steps along the curve to beside the posture, each of the length that is left, lead to it or do not.
    posture, gap = curves.q[j], joint_gap(robot, q[i], curves.q[j])
    way = gap / np.maximum(np.linalg.norm(gap, axis=1), SAME**2)[:, None]
    way = tracer.step(posture, way, pose[i], np.zeros(len(i)))[1]
    for _ in range(4):
        length = np.einsum("kn,kn->k", joint_gap(robot, q[i], posture), way)
        left = np.abs(length) > SAME / 10
        if not left.any():
            break
        posture[left], way[left], _ = tracer.step(posture[left], way[left], pose[i[left]], length[left])
    on = np.linalg.norm(joint_gap(robot, q[i], posture), axis=1) < SAME
    return i[on], own[j[on]]


def _embedded(robot: Robot, q: Matrix, pose: Indices) -> Matrix:
    """Points of postures (k, n), with hinges on their circles, those of different poses far apart."""
    hinges = robot.hinges
    points = [q[:, ~hinges], np.cos(q[:, hinges]), np.sin(q[:, hinges]), 10.0 * pose[:, None]]
    return np.concatenate(points, axis=1, dtype=float)


def _in_rows(tracer: CurveTracer, curves: _Curves) -> tuple[Matrix, Indices, Indices, Flags]:
    """Curves as postures (N, n), pose (N,), curve (N,), closed (C,), with the last postures of those that close."""
    every, last = np.arange(len(curves.size)), np.cumsum(curves.size) - 1
    closed = curves.ends[:, 1] == CurveEnd.CLOSED
    # The first posture again, at the turns of the last one, which goes where it is beyond that, or just before.
    begin, end = curves.q[last + 1 - curves.size], curves.q[last]
    again = np.where(tracer.task.robot.hinges, begin + 2 * np.pi * np.round((end - begin) / (2 * np.pi)), begin)
    ahead = np.einsum("cn,cn->c", again - end, end - curves.q[np.maximum(last - 1, 0)])
    kept = np.ones(len(curves.q), dtype=bool)
    kept[last[closed & (ahead < 0.25 * STEP**2)]] = False
    q = np.concatenate([curves.q[kept], again[closed]])
    curve = np.concatenate([np.repeat(every, curves.size)[kept], every[closed]])
    order = np.argsort(curve, kind="stable")
    return q[order], curves.pose[curve[order]], curve[order], closed
