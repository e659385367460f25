"""Arcs of self-motions: the postures of a pose over one held coordinate c, by a closed form.

Where c is held, an arm of a class of closed forms has at most eight postures, numbered by the signs of the slopes s_i
of three steps. So the postures of a pose are at most eight tracks c -> q(c; signs). They are real on arcs, which end
where an s_i is 0, a fold, and go on there as those with that sign turned round.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from ...base.types import Array, Flags, Indices, Matrix, Value, Vector, frozen, kept
from ...robot.closed_form.closed_inverse import SIGNS
from ...strategies.self_motion_curves import least_motion
from ...strategies.tasks.task import Task
from ...symbolic import Function

VALUES = 64
"""Values of the held coordinate at which a pose is looked at: steps of 0.1 rad."""

MEETINGS = 3
"""Times that arcs are looked for which end where others begin, and are hidden between two values."""

WIDEST = 0.3
"""Largest step [joint units] of a joint between neighbours on a curve."""

NEAR_FOLD = 1e-4
"""How real the last posture of an arc is, see `solver`: 0.01 rad from the fold."""

EXACT_FOLD = 1e-14
"""How real, at most, a fold is. Where a share only touches 0, so near, self-motions cross: the pose is singular."""

SAME_FOLD = 1e-4
"""Folds of c [joint units] so near, of the same step and on the same side, are one."""

ORIGIN = 0.123
"""Where c is counted from to compare folds [rad]: no multiple of pi / 2, at which they may be."""

SECTIONS = 11
"""Times that a step which is too wide is cut in five: to 1e-8 of a step of c. Farther in, c is no coordinate."""

INACCURATE = 1e-8
"""Last correction [joint units] from which on an answer is corrected along the self-motion: those before it are its
square root."""

SIGN_ROWS = np.ascontiguousarray(SIGNS)


@dataclass(frozen=True, eq=False)
class Cut(Value):
    """The postures of poses by one held coordinate c, in [low, high]; turning: which comes round, after 2 pi.

    branch: (c (1,), pose (4, 4), signs (3,)) -> posture (n,), squares of the slopes of the three steps (3,), below 0
    where there is none, the share, how real it is, and the size of the last correction.
    """

    task: Task
    branch: Function
    low: float
    high: float
    turning: bool

    def rows(self, poses: Array, c: Vector, track: Indices, out: Matrix | None = None) -> Matrix:
        """The answers (k, n + 5) of `branch` at values c (k,) of tracks (k,): 8 s + signs, of poses (S, 4, 4)."""
        out = np.empty((len(c), self.task.n + 5)) if out is None else out
        kernel = self.branch._native()
        chosen = poses[track // 8] if len(poses) > 1 else poses
        if kernel is not None:
            kernel([c[:, None], chosen, SIGN_ROWS[track % 8]], [out], 1)
        elif len(c):
            self.branch.batch(c[:, None], np.broadcast_to(chosen, (len(c), 4, 4)), SIGN_ROWS[track % 8], out=[out])
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
        alone = np.flatnonzero((partner < 0) & (arcs.step >= 0))
        if not len(alone) or not len((hidden := _hidden(cut, poses, arcs, alone)).c):
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

    def at(self, i: Indices) -> _Answers:
        """Some of them."""
        return _Answers(self.rows[i], self.track[i], self.c[i])


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
        return _Points(rows, track, c, rows[:, -2] > EXACT_FOLD, *_neighbours(track, c))

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


def _neighbours(track: Indices, c: Vector) -> tuple[Indices, Indices, Vector]:
    """`before`, `after` and `ahead` of points."""
    last = np.flatnonzero(np.diff(track, append=-1))
    first = np.append(0, last[:-1] + 1)
    before, after = np.arange(-1, len(c) - 1), np.arange(1, len(c) + 1)
    before[first], after[last] = last, first
    ahead = c[after] - c
    ahead[last] += 2 * np.pi
    return before, after, ahead


@lru_cache(maxsize=64)
def _grid(low: float, high: float, turning: bool, poses: int) -> tuple[Any, ...]:
    """Values of c and signs of the tracks of one pose; tracks, values and neighbours of so many poses."""
    grid = np.linspace(low, high, VALUES, endpoint=not turning)
    track, c = np.repeat(np.arange(8 * poses), VALUES), np.tile(grid, 8 * poses)
    return tuple(map(frozen, (c[: 8 * VALUES], track[: 8 * VALUES], track, c, *_neighbours(track, c))))


def _sampled(cut: Cut, poses: Array) -> _Points:
    """The answers at values of c, and where between two of them the square of a slope may pass 0 and come back."""
    values, signs, track, c, *neighbours = _grid(cut.low, cut.high, cut.turning, len(poses))
    rows = np.empty((len(track), cut.task.n + 5))
    for pose, out in zip(poses, rows.reshape(len(poses), len(signs), -1), strict=True):
        cut.rows(pose[None], values, signs, out)
    points = _Points(rows, track, c, rows[:, -2] > EXACT_FOLD, *neighbours)
    # The squares, with three more on each side, of values round the track.
    squares = rows.reshape(-1, VALUES, rows.shape[1])[:, :, -5:-2].transpose(2, 0, 1)[:, :, _ROUND]
    with np.errstate(all="ignore"):
        found: list[Any] = [np.concatenate(pair) for pair in zip(_lowest(squares), _beside_folds(squares), strict=True)]
    which, line, place, below = found
    if not cut.turning:
        inside = (place > 0) & (place < VALUES - 1)
        which, line, place, below = (x[inside] for x in found)
    if not len(which):
        return points
    # Closer and closer: the lowest points of parabolas through three sizes.
    step = values[1] - values[0]
    c, sign = values[0] + step * place, np.where(below, -1.0, 1.0)
    last, middle = c, rows[:0]
    for _ in range(5):
        step = step / 8
        around = (c[:, None] + step * np.array([-1, 0, 1])).ravel()
        answers = cut.rows(poses, around, np.repeat(line, 3)).reshape(len(c), 3, -1)
        three = sign[:, None] * answers[np.arange(len(c)), :, cut.task.n + which]
        bend = three[:, 0] + three[:, 2] - 2 * three[:, 1]
        near = np.flatnonzero(three[:, 1] < 0.5 * bend)
        if not len(near):
            return points
        chosen: list[Any] = [x[near] for x in (which, line, c, sign, answers, three, bend)]
        which, line, c, sign, answers, three, bend = chosen
        last, middle = c, answers[:, 1]
        with np.errstate(all="ignore"):
            c = c + step * np.clip(np.nan_to_num(0.5 * (three[:, 0] - three[:, 2]) / bend), -1, 1)
    return points.with_others(cut, _Answers(middle, line, last))


PAD = 3
"""Values on each side of those of a track, to find its neighbours."""

_ROUND = np.arange(-PAD, VALUES + PAD) % VALUES


Places = tuple[Indices, Indices, Vector, Flags]
"""Of which step, on which track, at which place [steps of c], and whether below 0."""


def _lowest(squares: Array) -> Places:
    """Where squares (3, tracks, values) are least in size among their neighbours, which have the same sign, and the
    other slopes are real: there a parabola through three of them may come near to 0."""
    size, negative = np.abs(squares[:, :, PAD - 1 : 1 - PAD]), squares[:, :, PAD - 1 : 1 - PAD] < 0
    before, here, after = size[:, :, :-2], size[:, :, 1:-1], size[:, :, 2:]
    sign = negative[:, :, 1:-1]
    lowest = (here <= before) & (here <= after) & (sign == negative[:, :, :-2]) & (sign == negative[:, :, 2:])
    lowest[0] &= ~(sign[1] | sign[2])
    lowest[1] &= ~(sign[0] | sign[2])
    lowest[2] &= ~(sign[0] | sign[1])
    which, line, column = np.nonzero(lowest)
    first, middle, last = (x[which, line, column] for x in (before, here, after))
    bend = 0.5 * (first + last) - middle
    near = middle - (last - first) ** 2 / (16 * bend) < bend
    shift = np.clip(np.nan_to_num(0.25 * (first - last) / bend), -1, 1)
    return which[near], line[near], (column + shift)[near], sign[which, line, column][near]


def _beside_folds(squares: Array) -> Places:
    """Where squares (3, tracks, values) may be above 0 beside the fold of a step before theirs: from there on they are
    like a parabola of the root of the distance."""
    negative = squares < 0
    i, line, left = np.nonzero(negative[:2, :, PAD - 1 : -PAD] != negative[:2, :, PAD : 1 - PAD])
    left += PAD - 1
    a, b = squares[i, line, left], squares[i, line, left + 1]
    fold, way = left + a / (a - b), np.where(a < 0, 1, -1)
    columns = np.where(a < 0, left + 1, left)[:, None] + way[:, None] * np.arange(3)
    u = np.sqrt(np.abs(columns - fold[:, None]))
    # A later step that has no root there; the one between the two has one.
    which = np.concatenate([i + 1, i[i == 0] + 2])
    of_fold = np.concatenate([np.arange(len(i)), np.flatnonzero(i == 0)])
    first = columns[of_fold, 0]
    fits = negative[which, line[of_fold], first] & ((which == 1) | ~negative[1 - i[of_fold], line[of_fold], first])
    which, of_fold = which[fits], of_fold[fits]
    line, columns, u, fold, way = line[of_fold], columns[of_fold], u[of_fold], fold[of_fold], way[of_fold]
    # The highest point of the parabola through three values.
    y = squares[which[:, None], line[:, None], columns]
    rise, more = (y[:, 1] - y[:, 0]) / (u[:, 1] - u[:, 0]), (y[:, 2] - y[:, 1]) / (u[:, 2] - u[:, 1])
    bend = (more - rise) / (u[:, 2] - u[:, 0])
    top = 0.5 * (u[:, 0] + u[:, 1] - rise / bend)
    height = y[:, 0] + (top - u[:, 0]) * (rise + bend * (top - u[:, 1]))
    fits = (y < 0).all(axis=1) & (bend < 0) & (top >= 0) & (top <= u[:, 2]) & (height > 0.25 * y.min(axis=1))
    return which[fits], line[fits], (fold + way * top**2 - PAD)[fits], fits[fits]


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
    inner = np.where(forward, points.before[inside], points.after[inside])
    third = begin - np.where(forward, points.ahead[inner], -points.ahead[inside])
    three = np.column_stack([inner, inside, outside])[i]
    values = np.column_stack([third, begin, fold])[i]
    with np.errstate(all="ignore"):
        fold[i], step[i] = _folds(cut, poses, track[i], values, points.rows[three, -5:-2])
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


NARROWEST = 1e-11
"""Where a fold is looked for [joint units]: nearer to each other folds of two steps are not told apart."""

AROUND = np.array([-0.1, -0.01, 0.01, 0.1])
"""Places around where a fold is expected, as shares of where it may be. Between the middle ones it is expected again,
within 1e-6 of the share."""


def _folds(cut: Cut, poses: Array, track: Indices, c: Matrix, squares: Array) -> tuple[Vector, Indices]:
    """Where (k,) a slope of tracks (k,) becomes 0, and that of which step (k,).

    It is expected by inverse quadratic interpolation of the least square of a slope, among those that are below 0 off
    the arc, and looked for around that place.

    Args:
        c: values (k, 3), two of them on an arc, the last one off it. squares: those of the slopes there (k, 3, 3).
    """
    c, squares, going = c.copy(), squares.copy(), np.arange(len(c))
    for _ in range(60):
        if not len(going):
            break
        values, every, line = c[going], squares[going], np.arange(len(going))[:, None]
        near, width = values[:, 1], values[:, 2] - values[:, 1]
        share = (_expected(values, every)[0] - near) / width
        places = near[:, None] + np.clip(share[:, None] + AROUND, 0, 1) * width[:, None]
        rows = cut.rows(poses, places.ravel(), np.repeat(track[going], len(AROUND))).reshape(*places.shape, -1)
        # Of all values, in their order, the two before the first one that is off the arc, and this.
        off = ~(rows[:, :, -2] > 0)
        j = np.where(off.any(axis=1), off.argmax(axis=1), len(AROUND))
        three = j[:, None] + np.arange(3)
        values = np.concatenate([values[:, :2], places, values[:, 2:]], axis=1)[line, three]
        every = np.concatenate([every[:, :2], rows[:, :, -5:-2], every[:, 2:]], axis=1)[line, three]
        c[going], squares[going] = values, every
        exact = (j == len(AROUND) // 2) & ((every[:, 2] < 0).sum(axis=1) == 1)
        exact |= np.abs(values[:, 2] - values[:, 1]) < NARROWEST
        going = going[~exact]
    return _expected(c, squares)


def _expected(c: Matrix, squares: Array) -> tuple[Vector, Indices]:
    """Where (k,) a slope becomes 0 by its squares (k, 3, 3) at values c (k, 3), and of which step; between the last
    two values."""
    # The step whose square is the first to be 0 on the straight line between these.
    near, far = squares[:, 1], squares[:, 2]
    share = np.where(far <= np.maximum(far.min(axis=1), 0.0)[:, None], near / (near - far), np.inf)
    step = share.argmin(axis=1)
    line = np.arange(len(c))
    h, f, g = squares[line, :, step].T
    straight = c[:, 1] + (c[:, 2] - c[:, 1]) * share[line, step]
    x = (
        c[:, 1] * (g * h / ((f - g) * (f - h)))
        + c[:, 2] * (f * h / ((g - f) * (g - h)))
        + c[:, 0] * (f * g / ((h - f) * (h - g)))
    )
    return np.where((x - c[:, 1]) * (x - c[:, 2]) <= 0, x, straight), step


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
    """Answers of arcs on which ends (k,) of others go on: each behind its fold, as near to it as it takes; and answers
    that are not real behind the other ends of their tracks, from which those arcs are apart."""
    end = np.arange(len(arcs.step))
    near = arcs.c[np.where(end % 2 == 0, arcs.first[end // 2], arcs.first[end // 2 + 1] - 1)] - arcs.fold
    track = arcs.track[ends // 2] ^ (4 >> arcs.step[ends])
    c = (arcs.fold[ends][:, None] + near[ends][:, None] * 0.25 ** np.arange(12)).ravel()
    found = _Answers(cut.rows(poses, c, np.repeat(track, 12)), np.repeat(track, 12), c)
    real = (found.rows[:, -2] > EXACT_FOLD).reshape(-1, 12)
    found = found.at(12 * np.flatnonzero(real.any(axis=1)) + real.argmax(axis=1)[real.any(axis=1)])
    others = np.flatnonzero(np.isin(arcs.track[end // 2], found.track) & (arcs.step >= 0))
    track, c = arcs.track[others // 2], arcs.fold[others] - near[others]
    apart = _Answers(cut.rows(poses, c, track), track, c)
    apart = apart.at(np.flatnonzero(~(apart.rows[:, -2] > EXACT_FOLD)))
    return _Answers(
        np.vstack([found.rows, apart.rows]), np.append(found.track, apart.track), np.append(found.c, apart.c)
    )


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
        q[rough] = onto(cut.task, poses[track[rough] // 8], q[rough])
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

    Between two of an arc they divide c in five; at a fold there are two on each side, closer to it.
    """
    key, left, right, at = np.arange(len(rows), dtype=float), wide, wide + 1, fold[wide]
    parts, closer = np.arange(1, 5) / 5, np.array([1 / 4, 1 / 16])
    for _ in range(SECTIONS):
        if not len(left):
            break
        a, b, folds = c[left], c[right], np.isfinite(at)
        b_at = at + 2 * np.pi * np.round((b - at) / (2 * np.pi))
        between = a[:, None] + (b - a)[:, None] * parts
        at_fold = [at[:, None] + (a - at)[:, None] * closer, b_at[:, None] + (b - b_at)[:, None] * closer[::-1]]
        new_c = np.where(folds[:, None], np.concatenate(at_fold, axis=1), between)
        new_track = np.repeat(np.column_stack([track[left], track[right]]), 2, axis=1)
        answers = cut.rows(poses, new_c.ravel(), new_track.ravel())
        sound = (answers[:, -2] > EXACT_FOLD).reshape(-1, 4).all(axis=1)
        every = np.repeat(sound, 4)
        new = len(c) + np.arange(4 * sound.sum()).reshape(-1, 4)
        left, right, at = left[sound], right[sound], at[sound]
        rows, key = (
            np.vstack([rows, answers[every]]),
            np.append(key, key[left][:, None] + (key[right] - key[left])[:, None] * parts),
        )
        c, track = np.append(c, new_c.ravel()[every]), np.append(track, new_track.ravel()[every])
        ways = np.column_stack([left, new, right])
        folds = np.full((len(left), 5), np.nan)
        folds[:, 2] = at
        left, right, at = ways[:, :-1].ravel(), ways[:, 1:].ravel(), folds.ravel()
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


@kept
def _twin(task: Task) -> Task:
    """The task without the singular angles of its representation."""
    return task._geometric_twin


def onto(task: Task, poses: Array, q: Matrix) -> Matrix:
    """Postures (k, n) that hold the tool at poses (k, 4, 4), by the least joint motion from others."""
    task = _twin(task)
    p, R = poses[:, :3, 3], poses[:, :3, :3]
    for _ in range(8):
        J, e = task.jacobian_batch(q)[0], task._error_function.batch(q, p, R).reshape(len(q), task.m)
        dq = least_motion(J, e[:, :, None])[:, :, 0]
        q = q + dq
        if not np.abs(dq).max(initial=0.0) > 1e-13:
            break
    return q
