"""Self-motions: all postures that hold the tool at a pose, where one joint is redundant, as curves.

Where one joint is held at c, an arm of a class of closed forms has at most eight postures, numbered by the signs of the
slopes s_i of three steps. So the postures of a pose are at most eight arcs c -> q(c; signs), which end where an s_i is
0, and there go on as the arc with that sign turned round. Other arms have curves that are traced.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.poses import pose_from
from ...base.types import Array, Flags, Indices, Matrix, Value, Vector, kept
from ...robot import Robot
from ...robot.closed_form import ArmClass, ClosedInverse, arm_class
from ...robot.closed_form.closed_inverse import SIGNS
from ...strategies.radial_strategy import SelfMotions as CurveTracer
from ...strategies.radial_strategy import away, joint_gap
from ...strategies.tasks.frame_task import FrameTask
from ...strategies.tasks.task import Task, TipFrame
from .posture_search import postures_from, spread

VALUES = 64
"""Values of the held joint at which a pose is looked at: steps of 0.1 rad."""

FINER = 16
"""Values between neighbours where an arc may begin and end, or be cut, between them."""

END = 1e-4
"""How real the last posture of an arc is, see `solver`: 0.02 rad from its neighbour on the arc that goes on there."""


STARTS = 64
"""Starts of Newton's method at each pose of an arm without closed forms."""

STEP = 0.2
"""Arc length [joint units] between the postures of a curve that is traced."""


@dataclass(frozen=True, eq=False)
class SelfMotions(Value):
    """The postures q (N, n) at tool poses p (S, 3), R (S, 3, 3), at that of `pose` (N,), as curves.

    Rows of one curve follow each other in its order, numbered by `curve` (N,); hinges are continuous along it, at some
    whole turn. closed (C,): which curves come back: the last row is the first one, but for whole turns.
    """

    task: Task
    p: Matrix
    R: Array
    q: Matrix
    pose: Indices
    curve: Indices
    closed: Flags

    @cached_property
    def beyond(self) -> Vector:
        """How far (N,) [joint units] the postures are beyond the joint limits, at the turns where they are least so; at
        most 0 within them."""
        robot = self.task.robot
        q = self.q - 2 * np.pi * robot.hinges * np.round((self.q - _middle(robot)) / (2 * np.pi))
        return np.max(np.maximum(robot.lower - q, q - robot.upper), axis=1, initial=-np.inf)

    def of(self, pose: int) -> SelfMotions:
        """Those of one of the poses."""
        first, last = np.searchsorted(self.pose, [pose, pose + 1])
        curves = np.unique(self.curve[first:last])
        which = np.searchsorted(curves, self.curve[first:last])
        at = slice(pose, pose + 1)
        return SelfMotions(self.task, self.p[at], self.R[at], self.q[first:last], which * 0, which, self.closed[curves])


def _middle(robot: Robot) -> Vector:
    with np.errstate(invalid="ignore"):
        return np.where(np.isfinite(robot.lower + robot.upper), 0.5 * (robot.lower + robot.upper), 0.0)


@kept
def cut_class(task: Task) -> ArmClass | None:
    """The class of the arm that is left of a task's robot when one joint is held, of those whose signs tell postures
    apart; None where no joint leaves one."""
    whole_pose = isinstance(task, FrameTask) and isinstance(task.frame, TipFrame) and set(task.rows) == set(range(6))
    if not whole_pose or task.n != 7:
        return None
    ranged = np.isfinite(task.robot.upper - task.robot.lower)
    for k in reversed(range(task.n)):
        found = arm_class(task.robot, (k,), task.tip)
        if isinstance(found, ArmClass) and found.proven and (task.robot.hinges[k] or ranged[k]):
            return found
    return None


@kept
def _inverse(found: ArmClass) -> ClosedInverse:
    return ClosedInverse(found, limits=False)


def self_motions_at(task: Task, p: Matrix, R: Array) -> SelfMotions:
    """All self-motions at tool poses p (S, 3), R (S, 3, 3), whatever the joint limits."""
    found = cut_class(task)
    if found is None:
        return _by_search(task, p, R)
    k, robot = found.held[0], task.robot
    inverse, poses = _inverse(found), pose_from(p, R)
    turning = bool(robot.hinges[k])
    values = (
        np.linspace(-np.pi, np.pi, VALUES, endpoint=False)
        if turning
        else np.linspace(robot.lower[k], robot.upper[k], VALUES)
    )

    def answers(pose: Indices, c: Vector) -> Array:
        return inverse.answers(poses[pose], c[:, None])

    arcs = _arcs(answers, len(p), values, turning)
    q = np.zeros((len(arcs.c), task.n))
    q[:, inverse.others], q[:, k] = arcs.angles, arcs.c
    return _joined(task, p, R, arcs, q)


@dataclass(frozen=True, eq=False)
class _Arcs(Value):
    """Real answers, in the order of track (pose and signs) and c: angles (N, 6), values c (N,), track (N,), arc (N,).

    Of each end of an arc, first and last one (A, 2): where it folds, NaN where it does not; round (A,): arcs that go
    once round the held joint.
    """

    angles: Matrix
    c: Vector
    track: Indices
    arc: Indices
    folds: Matrix
    round: Flags


def _arcs(answers: Callable[[Indices, Vector], Array], poses: int, values: Vector, turning: bool) -> _Arcs:
    """The arcs at so many poses; answers: (pose (k,), c (k,)) -> (k, 8, 12). turning: c comes round after 2 pi."""
    count, signs = len(values), len(SIGNS)
    grid = answers(np.repeat(np.arange(poses), count), np.tile(values, poses)).reshape(poses, count, signs, -1)
    tracks = grid.swapaxes(1, 2).reshape(poses * signs, count, -1)
    step = values[1] - values[0]
    # Arcs that begin and end between two values, and gaps: where a parabola through three shares crosses 0.
    share = tracks[:, :, 9]
    before, after = np.roll(share, 1, axis=1), np.roll(share, -1, axis=1)
    bend = 0.5 * (after + before) - share
    with np.errstate(all="ignore"):
        extreme = share - (after - before) ** 2 / (16 * bend)
    hidden = (share < 0) & (before < 0) & (after < 0) & (share >= before) & (share >= after) & (extreme > bend / 2)
    hidden |= (share > 0) & (before > 0) & (after > 0) & (share <= before) & (share <= after) & (extreme < bend / 2)
    hidden[:, [0, -1]] &= turning
    track, place = np.nonzero(hidden)
    parts = np.setdiff1d(np.arange(1 - FINER, FINER), 0) / FINER * step
    fine_track, fine_c = np.repeat(track, len(parts)), (values[place][:, None] + parts).ravel()
    fine = _of_tracks(answers, fine_track, fine_c)
    # All of them in the order of track and c; one that is not real first where c comes round.
    track = np.concatenate([np.repeat(np.arange(len(tracks)), count), fine_track])
    c = np.concatenate([np.tile(values, len(tracks)), fine_c])
    rows = np.concatenate([tracks.reshape(-1, tracks.shape[2]), fine])
    real = rows[:, 9] > 0
    if turning:
        first_gap = np.full(len(tracks), -np.inf)
        gaps = np.where(real, np.inf, c)
        lowest = np.full(len(tracks), np.inf)
        np.minimum.at(lowest, track, gaps)
        first_gap = np.where(np.isfinite(lowest), lowest, -np.inf)
        c = np.where(c < first_gap[track], c + 2 * np.pi, c)
    order = np.lexsort((c, track))
    track, c, rows, real = track[order], c[order], rows[order], real[order]
    same = np.append(track[1:] == track[:-1], False)
    # Ends: the root of the share between a real answer and one that is not.
    inner = np.flatnonzero(same & (real != np.append(real[1:], False)))
    # Where c comes round, the last answer's neighbour is the first one of the track, which is not real.
    last = np.flatnonzero(~same)
    comes_round = last[real[last] & turning]
    firsts = np.searchsorted(track, track[comes_round])
    comes_round, firsts = comes_round[~real[firsts]], firsts[~real[firsts]]
    inside = np.concatenate([np.where(real[inner], inner, inner + 1), comes_round])
    outside_c = np.concatenate(
        [np.where(real[inner], c[np.minimum(inner + 1, len(c) - 1)], c[inner]), c[firsts] + 2 * np.pi]
    )
    outside_share = np.concatenate(
        [np.where(real[inner], rows[np.minimum(inner + 1, len(c) - 1), 9], rows[inner, 9]), rows[firsts, 9]]
    )
    fold = _root_of_share(answers, track[inside], c[inside], rows[inside, 9], outside_c, outside_share)
    upward = outside_c > c[inside]
    # Answers towards the ends, evenly along the arc, which is like a parabola there.
    least = np.minimum(1.0, np.sqrt(END / np.maximum(rows[inside, 9], END)))
    u = 1 - np.arange(1, 4) / 3 * (1 - least)[:, None]
    end_c = (fold[:, None] - (fold - c[inside])[:, None] * u**2).ravel()
    end_track = np.repeat(track[inside], 3)
    ends = _of_tracks(answers, end_track, end_c)
    kept_ends = ends[:, 9] > 0
    # Only what is real; an arc ends where the track does, or at a fold.
    at_fold = np.full((len(c), 2), np.nan)
    at_fold[inside, upward.astype(int)] = fold
    link_after = same & real & np.append(real[1:], False)
    arc_of = np.cumsum(np.append(True, ~link_after[:-1])) - 1
    first = np.flatnonzero(real & np.append(True, ~link_after[:-1]))
    final = np.flatnonzero(real & ~link_after)
    folds = np.column_stack([at_fold[first, 0], at_fold[final, 1]])
    number = np.full(arc_of.max(initial=-1) + 1, -1)
    number[arc_of[first]] = np.arange(len(first))
    whole = turning & np.isnan(folds).all(axis=1)
    arc = np.concatenate([number[arc_of[real]], number[np.repeat(arc_of[inside], 3)][kept_ends]])
    every_c = np.concatenate([c[real], end_c[kept_ends]])
    every_track = np.concatenate([track[real], end_track[kept_ends]])
    angles = np.concatenate([rows[real, :6], ends[kept_ends, :6]])
    order = np.lexsort((every_c, arc))
    return _Arcs(angles[order], every_c[order], every_track[order], arc[order], folds, whole)


def _of_tracks(answers: Callable[[Indices, Vector], Array], track: Indices, c: Vector) -> Matrix:
    """The answers (k, 12) of tracks (k,) at values c (k,)."""
    if not len(c):
        return np.zeros((0, 12))
    return answers(track // len(SIGNS), c)[np.arange(len(c)), track % len(SIGNS)]


def _root_of_share(
    answers: Callable[[Indices, Vector], Array], track: Indices, a: Vector, fa: Vector, b: Vector, fb: Vector
) -> Vector:
    """Where (k,) the shares of tracks are 0 between real answers at a and others at b (k,): by the Illinois method."""
    a, fa, b, fb = a.copy(), fa.copy(), b.copy(), fb.copy()
    for _ in range(9):
        if not len(a):
            break
        c = (a * fb - b * fa) / (fb - fa)
        fc = _of_tracks(answers, track, c)[:, 9]
        inside = fc > 0
        fb = np.where(inside, np.where(np.sign(fc) == np.sign(fa), 0.5 * fb, fb), fc)
        fa = np.where(inside, fc, 0.5 * fa)
        a, b = np.where(inside, c, a), np.where(inside, b, c)
    return np.where(np.abs(fa) < np.abs(fb), a, b)


def _joined(task: Task, p: Matrix, R: Array, arcs: _Arcs, q: Matrix) -> SelfMotions:
    """The curves that arcs make up, with postures q (N, n)."""
    count = len(arcs.folds)
    if not count:
        return _flat(task, p, R, [], q, arcs)
    first = np.searchsorted(arcs.arc, np.arange(count))
    last = np.append(first[1:], len(q)) - 1
    # The end at which each end goes on: at the same fold, from the same side, with one sign turned round.
    ends = np.stack([first, last], axis=1).ravel()  # end 2 a + 1 is the last one of arc a
    fold = arcs.folds.ravel()
    side = np.tile([0, 1], count)
    track = arcs.track[ends]
    order = np.lexsort((np.mod(fold, 2 * np.pi), side, track // 8))
    pairs, sizes = [], []
    for shift in range(1, 8):
        i, j = order[:-shift], order[shift:]
        flips = (track[i] % 8) ^ (track[j] % 8)
        alike = (track[i] // 8 == track[j] // 8) & (side[i] == side[j]) & np.isin(flips, [1, 2, 4])
        with np.errstate(invalid="ignore"):
            alike &= np.abs(np.remainder(fold[i] - fold[j] + np.pi, 2 * np.pi) - np.pi) < 1e-5
        i, j = i[alike], j[alike]
        pairs.append(np.column_stack([i, j]))
        sizes.append(np.abs(joint_gap(task.robot, q[ends[i]], q[ends[j]])).max(axis=1, initial=0.0))
    pair, size = np.concatenate(pairs), np.concatenate(sizes)
    partner = np.full(len(ends), -1)
    for i, j in pair[np.argsort(size)]:
        if partner[i] < 0 and partner[j] < 0:
            partner[i], partner[j] = j, i
    # From an end that goes nowhere, else from any: arc after arc, there and back.
    curves: list[tuple[list[tuple[int, bool]], bool]] = []
    used = np.zeros(count, dtype=bool)
    beginnings = np.concatenate([np.flatnonzero(partner < 0), np.flatnonzero(partner >= 0)])
    for begin in beginnings:
        arc, forward = int(begin) // 2, int(begin) % 2 == 0
        if used[arc]:
            continue
        parts, closed = [], bool(arcs.round[arc])
        while True:
            used[arc] = True
            parts.append((arc, forward))
            other = partner[2 * arc + int(forward)]
            if other < 0 or closed:
                break
            if used[other // 2]:
                closed = True
                break
            arc, forward = int(other) // 2, int(other) % 2 == 0
        curves.append((parts, closed))
    rows: list[tuple[Indices, bool]] = []
    for parts, closed in curves:
        way = [np.arange(first[a], last[a] + 1)[:: 1 if ahead else -1] for a, ahead in parts]
        rows.append((np.concatenate([*way, way[0][:1]] if closed else way), closed))
    rows.sort(key=lambda row: arcs.track[row[0][0]] // 8)
    return _flat(task, p, R, rows, q, arcs)


def _flat(task: Task, p: Matrix, R: Array, curves: list[tuple[Indices, bool]], q: Matrix, arcs: _Arcs) -> SelfMotions:
    """Curves as rows of postures, hinges continuous along each."""
    rows = np.concatenate([np.zeros(0, dtype=np.intp), *(row for row, _ in curves)])
    curve = np.repeat(np.arange(len(curves)), [len(row) for row, _ in curves])
    pose, q = arcs.track[rows] // len(SIGNS), q[rows]
    turns = np.zeros_like(q)
    turns[1:] = np.where(np.diff(curve) == 0, 1, 0)[:, None] * np.round(np.diff(q, axis=0) / (2 * np.pi))
    total = np.cumsum(turns, axis=0)
    starts = np.searchsorted(curve, np.arange(len(curves)))
    total -= total[starts][curve] if len(curves) else 0.0
    q = q - 2 * np.pi * task.robot.hinges * total
    return SelfMotions(task, p, R, q, pose, curve, np.array([closed for _, closed in curves], dtype=bool))


def _by_search(task: Task, p: Matrix, R: Array) -> SelfMotions:
    """The curves through postures that Newton's method finds from STARTS starts at each pose, each curve once."""
    task = task._geometric_twin  # which has no singular angles on the way
    pose = np.repeat(np.arange(len(p)), STARTS)
    q, arrived = postures_from(task, spread(task.robot, STARTS * len(p)), p[pose], R[pose])
    q, pose = q[arrived], pose[arrived]
    rest, curves = np.arange(len(q)), []
    # Trace the curve of one posture at each pose, and leave out the postures that lie on it, until none is left.
    while len(rest):
        poses, first = np.unique(pose[rest], return_index=True)
        first = rest[first]
        lines = CurveTracer(task, p[poses], R[poses]).traced(q[first], step=STEP, length=20.0, limits=False)
        curves += list(zip(poses.tolist(), lines, strict=True))
        others = [rest[(pose[rest] == k) & (rest != i)] for k, i in zip(poses, first, strict=True)]
        far = [away(task, q[i][:, None], line.q).min(axis=1) > STEP for i, line in zip(others, lines, strict=True)]
        rest = np.concatenate([i[apart] for i, apart in zip(others, far, strict=True)])
    curves.sort(key=lambda curve: curve[0])
    rows = [np.vstack([line.q, line.q[:1]]) if line.closed else line.q for _, line in curves]
    curve = np.repeat(np.arange(len(rows)), [len(row) for row in rows])
    closed = np.array([line.closed for _, line in curves], dtype=bool)
    own = np.array([k for k, _ in curves], dtype=np.intp)[curve]
    return SelfMotions(task, p, R, np.concatenate([np.zeros((0, task.n)), *rows]), own, curve, closed)
