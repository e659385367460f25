"""Arcs of self-motions: the postures of a pose over one held coordinate c, by a closed form.

Where c is held, an arm of a class of closed forms has at most eight postures, numbered by the signs of the slopes s_i
of three steps. So the postures of a pose are at most eight tracks c -> q(c; signs). They are real on arcs, which end
where an s_i is 0, a fold, and go on there as those with that sign turned round.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...base.types import Array, Flags, Indices, Matrix, Value, Vector
from ...robot.closed_form.closed_inverse import SIGNS
from ...strategies.radial_strategy import least_motion
from ...strategies.tasks.task import Task
from ...symbolic import Function
from ...symbolic.native import allowed

VALUES = 64
"""Values of the held coordinate at which a pose is looked at: steps of 0.1 rad."""

MEETINGS = 3
"""Times that arcs are looked for which end where others begin, and are hidden between two values."""

WIDEST = 0.3
"""Largest step [joint units] of a joint between neighbours on a curve."""

NEAR_FOLD = 1e-4
"""How real the last posture of an arc is, see `solver`: 0.01 rad from the fold."""

EXACT_FOLD = 1e-11
"""How real, at most, a fold is. Where a share only touches 0, so near, self-motions cross: the pose is singular."""

SAME_FOLD = 1e-5
"""Folds of c [joint units] so near, of the same step and on the same side, are one."""

ORIGIN = 0.123
"""Where c is counted from to compare folds [rad]: no multiple of pi / 2, at which they may be."""

SECTIONS = 16
"""Times that a step which is too wide is cut in three: to 1e-8 of a step of c. Farther in, c is no coordinate."""

INACCURATE = 1e-8
"""Last correction [joint units] from which on an answer is corrected along the self-motion: those before it are its
square root."""

SIGN_ROWS = np.ascontiguousarray(SIGNS)


@dataclass(frozen=True, eq=False)
class Cut(Value):
    """The postures of poses by one held coordinate c, in [low, high]; turning: which comes round, after 2 pi.

    branch: (c (1,), pose (4, 4), signs (3,)) -> posture (n,), shares of the three steps (3,), the least of them, and
    the size of the last correction.
    """

    task: Task
    branch: Function
    low: float
    high: float
    turning: bool

    def rows(self, poses: Array, c: Vector, track: Indices, out: Matrix | None = None) -> Matrix:
        """The answers (k, n + 5) of `branch` at values c (k,) of tracks (k,): 8 s + signs, of poses (S, 4, 4)."""
        chosen = poses[track // 8] if len(poses) > 1 else np.broadcast_to(poses[0], (len(c), 4, 4))
        out = np.empty((len(c), self.task.n + 5)) if out is None else out
        arguments = [c[:, None], chosen, SIGN_ROWS[track % 8]]
        kernel = self.branch._native() if allowed() else None
        if kernel is not None:
            kernel(arguments, [out], 1)
        elif len(c):
            self.branch.batch(*arguments, out=[out])
        return out


class Curves(NamedTuple):
    """Postures q (N, n) of curves, row after row, at the turns that make hinges continuous: of which curve (N,) they
    are; of each curve its pose (C,) and whether it comes back (C,): then the last row is the first, but for turns."""

    q: Matrix
    curve: Indices
    pose: Indices
    closed: Flags


def curves_of(cut: Cut, poses: Array) -> Curves:
    """The self-motions of poses (S, 4, 4), one pose after another."""
    points = _sampled(cut, poses)
    arcs = _arcs(cut, poses, points)
    partner = _partners(arcs)
    for _ in range(MEETINGS):
        hidden = _hidden(cut, poses, arcs, np.flatnonzero((partner < 0) & (arcs.step >= 0)))
        if not len(hidden.c):
            break
        points = points.with_others(cut, hidden)
        arcs = _arcs(cut, poses, points)
        partner = _partners(arcs)
    return _refined(cut, poses, arcs, _chained(arcs, partner))


# --- The tracks at values of c, and the arcs on which they are real.


class _Answers(NamedTuple):
    """Answers (N, n + 5) at values c (N,) of tracks (N,)."""

    rows: Matrix
    track: Indices
    c: Vector


class _Points(NamedTuple):
    """Answers (N, n + 5) at values c (N,) of tracks (N,), in the order of track and c, and which of them are real.

    before, after (N,): the neighbours of each on its track, round it; ahead (N,): how much larger c is at the latter.
    """

    rows: Matrix
    track: Indices
    c: Vector
    real: Flags
    before: Indices
    after: Indices
    ahead: Vector

    @staticmethod
    def of(rows: Matrix, track: Indices, c: Vector) -> _Points:
        """With the neighbours."""
        last = np.flatnonzero(np.diff(track, append=-1))
        first = np.append(0, last[:-1] + 1)
        before, after = np.arange(-1, len(c) - 1), np.arange(1, len(c) + 1)
        before[first], after[last] = last, first
        ahead = c[after] - c
        ahead[last] += 2 * np.pi
        return _Points(rows, track, c, rows[:, -2] > EXACT_FOLD, before, after, ahead)

    @property
    def share(self) -> Vector:
        """How real they are (N,)."""
        return self.rows[:, -2]

    def with_others(self, cut: Cut, others: _Answers) -> _Points:
        """Those and others."""
        c = (others.c - cut.low) % (2 * np.pi) + cut.low if cut.turning else others.c
        track, c = np.append(self.track, others.track), np.append(self.c, c)
        order = np.lexsort((c, track))
        return _Points.of(np.vstack([self.rows, others.rows])[order], track[order], c[order])


def _sampled(cut: Cut, poses: Array) -> _Points:
    """The answers at values of c, and where between two of them a share may pass 0 and come back."""
    grid = np.linspace(cut.low, cut.high, VALUES, endpoint=not cut.turning)
    every = np.empty((len(poses), 8 * VALUES, cut.task.n + 5))
    signs, places = np.divmod(np.arange(8 * VALUES), VALUES)
    for pose, out in zip(poses, every, strict=True):
        cut.rows(pose[None], grid[places], signs, out)
    rows = every.reshape(-1, cut.task.n + 5)
    points = _Points.of(rows, np.arange(len(rows)) // VALUES, np.tile(grid, 8 * len(poses)))
    # Where the share of a step is least in size among its neighbours, which have the same sign, and the other steps are
    # real: there a parabola through three values may come near to 0.
    shares = rows[:, -5:-2]
    size, negative = np.abs(shares), shares < 0
    before, after = size[points.before], size[points.after]
    lowest = (size <= before) & (size <= after) & (negative == negative[points.before])
    lowest &= (negative == negative[points.after]) & ((~negative).sum(axis=1)[:, None] + negative == 3)
    place, which = np.nonzero(lowest & ((points.after > points.before) | cut.turning)[:, None])
    three = np.column_stack([before[place, which], size[place, which], after[place, which]])
    bend = 0.5 * (three[:, 0] + three[:, 2]) - three[:, 1]
    with np.errstate(all="ignore"):
        near = np.flatnonzero(three[:, 1] - (three[:, 2] - three[:, 0]) ** 2 / (16 * bend) < bend)
    if not len(near):
        return points
    # The lowest points of such parabolas, in smaller and smaller steps.
    place, which, three = place[near], which[near], three[near]
    track, c, step = points.track[place], points.c[place], grid[1] - grid[0]
    for _ in range(4):
        bend = three[:, 0] + three[:, 2] - 2 * three[:, 1]
        with np.errstate(all="ignore"):
            shift = np.nan_to_num(0.5 * (three[:, 0] - three[:, 2]) / bend)
        c, step = c + step * np.clip(shift, -1, 1), step / 8
        around = (c[:, None] + step * np.array([-1, 0, 1])).ravel()
        answers = cut.rows(poses, around, np.repeat(track, 3)).reshape(len(c), 3, -1)
        three = answers[np.arange(len(c)), :, cut.task.n + which]
        three = np.where(negative[place, which], -1, 1)[:, None] * three
    return points.with_others(cut, _Answers(answers[:, 1], track, c))


class _Arcs(NamedTuple):
    """Answers (N, n + 5) at values c (N,), arc after arc and along each in the order of c: its first row (A + 1,), its
    track (A,), whether it comes round in c (A,).

    Of its ends, 2 a and 2 a + 1 of arc a, the value of c where it folds (2 A,), and which step has the slope 0 there
    (2 A,): -1 where none has, at an end of the range of c and where the share only touches 0.
    """

    rows: Matrix
    c: Vector
    first: Indices
    track: Indices
    round: Flags
    fold: Vector
    step: Indices


def _arcs(cut: Cut, poses: Array, points: _Points) -> _Arcs:
    """The arcs of points, with answers towards their ends."""
    c, real, every = points.c, points.real, np.arange(len(points.c))
    # Arcs are neighbours that are real; the one that begins where c comes round goes on behind the last one.
    wraps = points.before > every
    start = real & (~real[points.before] | wraps)
    arc = np.cumsum(start) - 1
    arcs = np.arange(int(arc[-1]) + 1)
    follows = np.flatnonzero(wraps & real & real[points.before] & cut.turning)
    follows, leads = arc[follows], arc[points.before[follows]]
    part_of = arcs.copy()
    part_of[follows] = leads
    moved = real & (part_of != arcs)[arc] if len(follows) else np.zeros(len(c), dtype=bool)
    around = np.zeros(len(arcs), dtype=bool)
    around[follows[follows == leads]] = True
    arc, c, key = part_of[arc] if len(arcs) else arc, c + 2 * np.pi * moved, every + float(len(c)) * moved
    # Their ends: between neighbours of which one is real.
    ends = np.flatnonzero((real != real[points.after]) & ((points.after > every) | cut.turning))
    forward = real[ends]
    inside, outside = np.where(forward, ends, points.after[ends]), np.where(forward, points.after[ends], ends)
    begin, way = c[inside], np.where(forward, points.ahead[ends], -points.ahead[ends])
    touches = (np.abs(points.share[outside]) <= EXACT_FOLD) & real[points.before[outside]] & real[points.after[outside]]
    fold, step, track = begin + way, np.full(len(ends), -1), points.track[inside]
    i = np.flatnonzero(~touches)
    shares = (points.rows[j[i], -5:-2] for j in (inside, outside))
    fold[i], step[i] = _folds(cut, poses, track[i], begin[i], fold[i], *shares)
    # Answers towards them, evenly along the arc, which is like a parabola there.
    left = np.sqrt(np.minimum(NEAR_FOLD / points.share[inside], 0.01))
    parts = np.array([1, 2, 3]) / 3
    near_c = (fold[:, None] + (begin - fold)[:, None] * (1 - parts * (1 - left)[:, None]) ** 2).ravel()
    near = cut.rows(poses, near_c, np.repeat(track, 3))
    sound = near[:, -2] > EXACT_FOLD
    near_key = (key[inside][:, None] + 0.5 * np.sign(way)[:, None] * parts).ravel()
    # All of them, in the order of arcs and c.
    arc_of_row = np.concatenate([arc[real], np.repeat(arc[inside], 3)[sound]])
    by_key = arc_of_row * (4.0 * len(c)) + np.concatenate([key[real], near_key[sound]])
    order = np.argsort(by_key, kind="stable")
    kept = part_of == arcs
    first = np.searchsorted(arc_of_row[order], np.flatnonzero(kept))
    end = 2 * (np.cumsum(kept) - 1)[arc[inside]] + forward
    folds, steps = np.full(2 * len(first), np.nan), np.full(2 * len(first), -1)
    folds[end], steps[end] = fold, step
    rows, c = np.concatenate([points.rows[real], near[sound]])[order], np.concatenate([c[real], near_c[sound]])[order]
    return _Arcs(rows, c, np.append(first, len(c)), points.track[start][kept], around[kept], folds, steps)


def _folds(
    cut: Cut, poses: Array, track: Indices, inside: Vector, outside: Vector, shares: Matrix, others: Matrix
) -> tuple[Vector, Indices]:
    """Where (k,) the shares of tracks (k,) become 0 between values of c (k,) inside arcs and outside, and of which step
    it is the share (k,).

    shares, others: those of the three steps (k, 3) inside and outside. By the method of Anderson and Bjoerck, on the
    least share of those that are below 0 outside.
    """
    fold, step, going = outside.copy(), np.full(len(track), -1), np.arange(len(track))
    near, far, near_weight, far_weight = inside, outside, np.ones(len(track)), np.ones(len(track))
    was_real = np.zeros(len(track), dtype=bool)
    for round in range(80):
        if not len(going):
            break
        below = others <= np.maximum(0.0, others.min(axis=1))[:, None]
        f, g = (np.where(below, x, np.inf).min(axis=1) for x in (shares, others))
        x = (near * g * far_weight - far * f * near_weight) / (g * far_weight - f * near_weight)
        rows = cut.rows(poses, x, track[going])
        found = rows[:, -5:-2]
        fold[going], step[going] = x, np.abs(found).argmin(axis=1)
        # An end that stays for a second time is taken for nearer to 0.
        real, value = rows[:, -2] > 0, np.where(below, found, np.inf).min(axis=1)
        less = 1 - value / np.where(real, f, g)
        less = np.where((less > 0) & (less < 1), less, 0.5)
        again = (real == was_real) & (round > 0)
        near_weight = np.where(real, 1.0, np.where(again, less, 1.0) * near_weight)
        far_weight = np.where(real, np.where(again, less, 1.0) * far_weight, 1.0)
        near, far = np.where(real, x, near), np.where(real, far, x)
        shares, others = np.where(real[:, None], found, shares), np.where(real[:, None], others, found)
        left = np.abs(rows[:, -2]) > EXACT_FOLD
        going, near, far, shares, others, was_real, near_weight, far_weight = (
            v[left] for v in (going, near, far, shares, others, real, near_weight, far_weight)
        )
    return fold, step


# --- Curves: arcs joined at their folds.

Chain = list[tuple[int, bool]]
"""The arcs of a curve in their order, and whether it goes along c on each."""


def _partners(arcs: _Arcs) -> Indices:
    """The end (2 A,) at which each end goes on: at the same fold, from the same side, with the sign of its step turned
    round; -1 where there is none."""
    ends = np.flatnonzero(arcs.step >= 0)
    track, step = arcs.track[ends // 2], arcs.step[ends]
    place = (arcs.fold[ends] - ORIGIN) % (2 * np.pi)
    alike = 6 * (track & ~(4 >> step)) + 2 * step + ends % 2
    order = np.lexsort((place, alike))
    i, j = order[:-1], order[1:]
    pairs = (alike[i] == alike[j]) & (track[i] != track[j]) & (np.abs(place[i] - place[j]) < SAME_FOLD)
    partner = np.full(len(arcs.step), -1)
    for one, other in zip(ends[i[pairs]].tolist(), ends[j[pairs]].tolist(), strict=True):
        if partner[one] < 0:
            partner[one], partner[other] = other, one
    return partner


def _hidden(cut: Cut, poses: Array, arcs: _Arcs, ends: Indices) -> _Answers:
    """Answers of arcs on which ends (k,) of others go on: each behind its fold, as near to it as it takes."""
    first = ends % 2 == 0
    last = np.where(first, arcs.first[ends // 2], arcs.first[ends // 2 + 1] - 1)
    track, fold = arcs.track[ends // 2] ^ (4 >> arcs.step[ends]), arcs.fold[ends]
    c = (fold[:, None] + (arcs.c[last] - fold)[:, None] * 0.25 ** np.arange(12)).ravel()
    rows = cut.rows(poses, c, np.repeat(track, 12)).reshape(-1, 12, cut.task.n + 5)
    real = rows[:, :, -2] > EXACT_FOLD
    i, j = np.flatnonzero(real.any(axis=1)), real.argmax(axis=1)
    return _Answers(rows[i, j[i]], track[i], c.reshape(-1, 12)[i, j[i]])


def _chained(arcs: _Arcs, partner: Indices) -> list[tuple[Chain, bool]]:
    """The curves, and whether they come back, in the order of poses."""
    curves: list[tuple[Chain, bool]] = []
    partners, rounds, used = partner.tolist(), arcs.round.tolist(), [False] * len(arcs.track)
    # From ends that go nowhere, else from any.
    for begin in np.argsort(partner >= 0, kind="stable").tolist():
        arc, along, end = begin // 2, begin % 2 == 0, -1
        chain: Chain = []
        while not used[arc]:
            used[arc] = True
            chain.append((arc, along))
            end = partners[2 * arc + along]
            if end < 0:
                break
            arc, along = end // 2, end % 2 == 0
        if chain:
            curves.append((chain, end >= 0 or rounds[chain[0][0]]))
    tracks = arcs.track.tolist()
    curves.sort(key=lambda curve: tracks[curve[0][0][0]] // 8)
    return curves


def _refined(cut: Cut, poses: Array, arcs: _Arcs, curves: list[tuple[Chain, bool]]) -> Curves:
    """The curves with neighbours that are near, and hinges continuous."""
    n, none = cut.task.n, np.zeros(0, dtype=np.intp)
    if not curves:
        return Curves(np.zeros((0, n)), none, none, none.astype(bool))
    # Rows along the curves, and the fold between each and the next one, NaN where there is none.
    first, fold_of = arcs.first.tolist(), arcs.fold
    ways, folds, counts = [], [], []
    for chain, closed in curves:
        parts = [np.arange(first[a], first[a + 1])[:: 1 if along else -1] for a, along in chain]
        for part, (a, along) in zip(parts, chain, strict=True):
            fold = np.full(len(part), np.nan)
            fold[-1] = fold_of[2 * a + along]
            folds.append(fold)
        if closed:
            parts.append(parts[0][:1])
            folds.append(np.full(1, np.nan))
        ways += parts
        counts.append(sum(map(len, parts)))
    row, fold, curve = np.concatenate(ways), np.concatenate(folds), np.repeat(np.arange(len(curves)), counts)
    rows, c, track = arcs.rows[row], arcs.c[row], np.repeat(arcs.track, np.diff(arcs.first))[row]
    last = np.cumsum(counts) - 1
    heads = [chain[0][0] for chain, _ in curves]
    c[last] += 2 * np.pi * arcs.round[heads]
    # Answers between neighbours that are far apart.
    wide = np.flatnonzero((_widths(cut, rows[1:], rows[:-1]) > WIDEST) & (curve[1:] == curve[:-1]))
    if len(wide):
        rows, key, track = _narrowed(cut, poses, rows, c, track, fold, wide)
        order = np.argsort(key, kind="stable")
        rows, track, curve = rows[order], track[order], curve[key[order].astype(np.intp)]
    # Those that are close to a singular posture of the six joints, along the self-motion.
    q, rough = rows[:, :n], np.flatnonzero(~(rows[:, -1] < INACCURATE))
    if len(rough):
        q[rough] = _onto(cut.task, poses[track[rough] // 8], q[rough])
    # Hinges are continuous from the first row of a curve on.
    turns = np.zeros_like(q)
    turns[1:] = (curve[1:] == curve[:-1])[:, None] * np.round(np.diff(q, axis=0) / (2 * np.pi))
    turns = np.cumsum(turns, axis=0)
    turns -= turns[np.searchsorted(curve, np.arange(len(curves)))][curve]
    closed = np.array([closed for _, closed in curves])
    return Curves(q - 2 * np.pi * cut.task.robot.hinges * turns, curve, arcs.track[heads] // 8, closed)


def _widths(cut: Cut, rows: Matrix, others: Matrix) -> Vector:
    """By how much [joint units] postures (k, n + 5) differ from others in their joints, at most."""
    gap = rows[:, : cut.task.n] - others[:, : cut.task.n]
    return np.abs(gap - 2 * np.pi * cut.task.robot.hinges * np.round(gap / (2 * np.pi))).max(axis=1, initial=0.0)


def _narrowed(
    cut: Cut, poses: Array, rows: Matrix, c: Vector, track: Indices, fold: Vector, wide: Indices
) -> tuple[Matrix, Vector, Indices]:
    """(rows, keys that order them, tracks) with answers between rows `wide` and the next ones, until these are near.

    Between two of an arc they divide c in three; at a fold there is one on each side, a quarter as far from it.
    """
    key, left, right, at = np.arange(len(rows), dtype=float), wide, wide + 1, fold[wide]
    thirds = np.array([1, 2]) / 3
    for _ in range(SECTIONS):
        if not len(left):
            break
        a, b, folds = c[left], c[right], np.isfinite(at)
        b_at = at + 2 * np.pi * np.round((b - at) / (2 * np.pi))
        new_c = np.column_stack(
            [np.where(folds, (3 * at + a) / 4, a + (b - a) / 3), np.where(folds, (3 * b_at + b) / 4, b - (b - a) / 3)]
        )
        new_track = np.column_stack([track[left], track[right]])
        answers = cut.rows(poses, new_c.ravel(), new_track.ravel())
        sound = (answers[:, -2] > EXACT_FOLD).reshape(-1, 2).all(axis=1)
        both = np.repeat(sound, 2)
        new = len(c) + np.arange(2 * sound.sum()).reshape(-1, 2)
        left, right, at = left[sound], right[sound], at[sound]
        new_key = key[left][:, None] + (key[right] - key[left])[:, None] * thirds
        rows, key = np.vstack([rows, answers[both]]), np.append(key, new_key)
        c, track = np.append(c, new_c.ravel()[both]), np.append(track, new_track.ravel()[both])
        none = np.full(len(at), np.nan)
        left, right = np.concatenate([left, new[:, 0], new[:, 1]]), np.concatenate([new[:, 0], new[:, 1], right])
        at = np.concatenate([none, at, none])
        far = _widths(cut, rows[right], rows[left]) > WIDEST
        left, right, at = left[far], right[far], at[far]
    # Where c is no coordinate: along the straight line, corrected.
    for i, j in zip(left.tolist(), right.tolist(), strict=True):
        gap = rows[j, : cut.task.n] - rows[i, : cut.task.n]
        gap -= 2 * np.pi * cut.task.robot.hinges * np.round(gap / (2 * np.pi))
        parts = np.arange(1, k := int(np.ceil(np.abs(gap).max() / (WIDEST / 2)))) / k
        between = np.repeat(rows[i][None], len(parts), axis=0)
        between[:, : cut.task.n] += parts[:, None] * gap
        between[:, -1] = np.inf
        rows, track = np.vstack([rows, between]), np.append(track, np.full(len(parts), track[i]))
        key = np.append(key, key[i] + (key[j] - key[i]) * parts)
    return rows, key, track


def _onto(task: Task, poses: Array, q: Matrix) -> Matrix:
    """Postures (k, n) that hold the tool at poses (k, 4, 4), by the least joint motion from others."""
    task = task._geometric_twin
    p, R = poses[:, :3, 3], poses[:, :3, :3]
    for _ in range(8):
        J, e = task.jacobian_batch(q)[0], task._error_function.batch(q, p, R).reshape(len(q), -1)
        dq = least_motion(J, e[:, :, None])[:, :, 0]
        q = q + dq
        if not np.abs(dq).max(initial=0.0) > 1e-13:
            break
    return q
