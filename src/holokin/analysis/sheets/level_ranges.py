"""Which levels of a strategy serve poses, on each of its branches: intervals along the self-motions of the poses.

Along a self-motion the level c(q) rises or falls between singular postures, where [J; J_g] is singular. So a stretch of
it between two of these, within the limits and clear of obstacles, is an interval of levels, each with one posture. From
pose to neighbouring pose stretches are linked by the leaf of a level that they have in common.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...base.tolerances import TOLERANCES
from ...base.types import Array, Flags, Indices, Matrix, Value, Vector
from ...motion.checks import Clear
from ...motion.ik.leaf import leaf_step
from ...motion.self_motions.pose_reach import at_best_turns
from ...motion.self_motions.posture_search import EXACT, newton
from ...motion.self_motions.self_motions import SelfMotions
from ...motion.self_motions.stretches import onto
from ...strategies import HolonomicStrategy
from ...symbolic import wrapped
from ..coverage.leaf_lines import native_from, one_by_one
from ..coverage.starts import Candidate
from .level_fit import Ranges

ENDS, TRIES = 0.95, 3
"""Share of the way to a limit or a singular posture, by the line through two postures, to which a stretch is led on;
where it is not allowed there, half of that, and half again."""

PLACES = (0.5, 0.25, 0.75)
"""Of an interval of levels: where the leaf is followed to neighbouring poses, until it arrives."""

SAME = 0.3
"""Distance [joint units] of a posture from the chord of a stretch up to which it is on it: chords are 0.2 long."""

SMALL = 1e-6
"""Share of the way to the posture beside for which a stretch is not led on."""

LEAST = 0.02
"""Share of the poses below which a branch is left out."""

SAMPLED = 64
"""Postures by which it is seen what whole turns of a hinge do to a level."""


class _Stretches(NamedTuple):
    """Postures q (M, n) of stretches of self-motions and their levels c (M,), which rise; stretch s has the rows
    first[s] ... last[s], (P,), and is of pose (P,)."""

    q: Matrix
    c: Vector
    first: Indices
    last: Indices
    pose: Indices

    @property
    def low(self) -> Vector:
        """The least level of each (P,)."""
        return self.c[self.first]

    @property
    def high(self) -> Vector:
        """The largest one (P,)."""
        return self.c[self.last]

    def near(self, which: Indices, levels: Vector) -> tuple[Matrix, Indices]:
        """(postures (k, n) on the chords of stretches (k,) at levels within their intervals (k,), the rows before)."""
        # Levels as numbers that rise over all rows: the interval of stretch s is from 2 s to 2 s + 1.
        span = np.maximum(self.high - self.low, 1e-300)
        count = self.last - self.first + 1
        key = 2.0 * np.repeat(np.arange(len(span)), count) + np.repeat(1 / span, count) * (
            self.c - np.repeat(self.low, count)
        )
        rows = np.searchsorted(key, 2.0 * which + (levels - self.low[which]) / span[which], side="right") - 1
        rows = np.clip(rows, self.first[which], np.maximum(self.last[which] - 1, self.first[which]))
        after = np.minimum(rows + 1, self.last[which])
        t = (levels - self.c[rows]) / np.maximum(self.c[after] - self.c[rows], 1e-300)
        return self.q[rows] + np.clip(t, 0, 1)[:, None] * (self.q[after] - self.q[rows]), rows


@dataclass(frozen=True, eq=False)
class LinkedBranch(Value):
    """The levels of a strategy from low to high (N,) that serve poses, by their numbers (N,) among T (k, 4, 4), on one
    branch: a pose has one interval, and each level of it one posture.

    Levels of an angle count on over whole turns, so that the same posture has the same level on the way from pose to
    pose. stretches: of self-motions, of which `of` (N,) are these; turns (N,): levels less those of the stretch.
    """

    strategy: HolonomicStrategy
    T: Array
    pose: Indices
    low: Vector
    high: Vector
    stretches: _Stretches
    of: Indices
    turns: Vector

    @property
    def ranges(self) -> Ranges:
        """The intervals."""
        return Ranges(self.pose, (self.low + self.high) / 2, (self.high - self.low) / 2)

    @cached_property
    def _place(self) -> Indices:
        place = np.full(len(self.T), -1)
        place[self.pose] = np.arange(len(self.pose))
        return place

    def postures(self, poses: Indices, levels: Vector) -> Matrix:
        """The postures (k, n) at poses (k,) of these levels (k,); NaN where the branch has none."""
        q, place = np.full((len(poses), self.strategy.task.n), np.nan), self._place[poses]
        there = np.flatnonzero((place >= 0) & (levels >= self.low[place]) & (levels <= self.high[place]))
        place, T, level = place[there], self.T[poses[there]], levels[there]
        begin, rows = self.stretches.near(self.of[place], level - self.turns[place])
        # The turns of a hinge without limits that the level counts.
        counted = np.flatnonzero(_counted_turns(self.strategy, self.stretches.q))
        if len(counted) and not self.strategy.constraint.angular[0]:
            begin[:, counted[0]] += self.turns[place] * _counted_turns(self.strategy, self.stretches.q)[counted[0]]
        step = leaf_step(self.strategy)
        p, R, c = T[:, :3, 3], T[:, :3, :3], level[:, None]
        side = step.batch(self.stretches.q[rows], p, R, c)[3]

        def correct(q: Matrix, i: Indices) -> tuple[Matrix, Flags]:
            dq, rcond, margin, now = step.batch(q, p[i], R[i], c[i])
            return dq, (rcond > TOLERANCES.singular) & (margin > TOLERANCES.representation) & (now == side[i])

        found, good = newton(correct, begin, steps=8, exact=EXACT, contraction=0.5)
        q[there[good]] = found[good]
        return q


def _counted_turns(strategy: HolonomicStrategy, q: Matrix) -> Vector:
    """How many turns of 2 pi a level gains by a whole turn of each hinge without limits (n,), if that is whole at all
    postures (k, n); NaN where it is not, 0 for other joints."""
    robot, turns = strategy.task.robot, np.zeros(q.shape[1])
    some = q[:: max(1, len(q) // SAMPLED)]
    before = strategy.constraint_value.batch(some).reshape(-1)
    for j in np.flatnonzero(robot.hinges & ~np.isfinite(robot.upper - robot.lower)):
        more = some.copy()
        more[:, j] += 2 * np.pi
        gain = (strategy.constraint_value.batch(more).reshape(-1) - before) / (2 * np.pi)
        whole = np.round(np.median(gain))
        turns[j] = whole if np.abs(gain - whole).max() < 1e-6 else np.nan
    return turns


def branches_by_curves(
    candidate: Candidate, T: Array, near: Indices, clear: Clear | None, curves: SelfMotions, least: float = LEAST
) -> list[LinkedBranch]:
    """The branches of a strategy with one redundant joint, those of most poses first.

    A branch grows from the widest stretch over links to neighbours, at most one stretch a pose. Stretches that are left
    grow into others.

    Args:
        T: poses (k, 4, 4). near: of each its neighbours (k, m). clear: which postures keep clear; None for all.
        curves: the self-motions of all the poses. least: share of the poses below which a branch is left out.
    """
    strategy = candidate.strategy
    if strategy is None or not len(curves.q):
        return []
    stretches = _stretches(strategy, curves, clear)
    if not len(stretches.pose):
        return []
    links, turns = _links(strategy, T, near, stretches)
    return [
        LinkedBranch(
            strategy, T, stretches.pose[of], stretches.low[of] + by, stretches.high[of] + by, stretches, of, by
        )
        for of, by in _grown(stretches, links, turns, len(T), least)
    ]


def widest(strategy: HolonomicStrategy, curves: SelfMotions) -> Vector:
    """The length of the longest interval of levels of each pose (k,); 0 where there is none."""
    stretches, lengths = _stretches(strategy, curves, None), np.zeros(len(curves.p))
    np.maximum.at(lengths, stretches.pose, stretches.high - stretches.low)
    return lengths


# --- Stretches of self-motions along which a level rises.


def _stretches(strategy: HolonomicStrategy, curves: SelfMotions, clear: Clear | None) -> _Stretches:
    robot = strategy.task.robot
    counted = _counted_turns(strategy, curves.q)
    unbounded = robot.hinges & ~np.isfinite(robot.upper - robot.lower) & np.isfinite(counted)
    look = _Look(strategy, curves, clear, robot.hinges & ~unbounded)
    seen = look(curves.q, curves.pose)
    # The rows of each curve in order, its hinges without limits continuous, its levels too where these count them.
    rows, own = _begun_at_gaps(curves, look.linked(seen, curves.curve))
    curve, seen = curves.curve[rows], seen.at(rows)
    q, c = seen.q, seen.c
    for j in np.flatnonzero(unbounded):
        on = q[0, j] + np.append(0.0, np.cumsum(wrapped(np.diff(q[:, j]))))
        on -= on[np.searchsorted(curve, curve)]  # from the first row of the curve on
        turns = 2 * np.pi * np.round((on + wrapped(q[np.searchsorted(curve, curve), j]) - q[:, j]) / (2 * np.pi))
        q[:, j], c = q[:, j] + turns, c + counted[j] * turns
    seen = seen._replace(q=q, c=c, allowed=seen.allowed & own)
    # Rows that follow each other on a stretch: the level goes on in one direction.
    rise = _nearest(strategy, np.diff(seen.c))
    same = np.append(True, np.sign(rise[1:]) == np.sign(rise[:-1]))
    link = look.linked(seen, curve) & (rise != 0)
    link &= same | ~np.append(False, link[:-1])
    if not link.any():
        none = np.zeros(0, dtype=int)
        return _Stretches(q[none], c[none], none, none, none)
    first, last = (np.flatnonzero(seen.allowed & ~x) for x in (np.append(False, link), np.append(link, False)))
    number, some = np.cumsum(seen.allowed & ~np.append(False, link)) - 1, np.flatnonzero(seen.allowed)
    c = np.append(0.0, np.cumsum(np.where(link, rise, 0.0)))
    c[some] += (seen.c[first] - c[first])[number[some]]
    # What leads a stretch on to a limit or a singular posture.
    ends = [look.led_on(seen, curves.pose[rows], curve, at, way) for at, way in ((first, -1), (last, 1))]
    parts = [(some, seen.q[some], c[some], 0.0)]
    for at, (has, postures, levels), way in zip((first, last), ends, (-0.5, 0.5), strict=True):
        at = at[has]
        parts.append((at, postures, c[at] + _nearest(strategy, levels - seen.c[at]), way))
    where = np.concatenate([at + way for at, _, _, way in parts])
    of = np.concatenate([number[at] for at, *_ in parts])
    every, levels = np.concatenate([part[1] for part in parts]), np.concatenate([part[2] for part in parts])
    # From the least level on. A stretch that does not rise throughout, as where round-off decides, is left out.
    order = np.lexsort((where, of))
    every, levels, of, index = every[order], levels[order], of[order], np.arange(len(of))
    edge = np.flatnonzero(np.diff(of, prepend=-1))
    stop = np.append(edge[1:], len(of)) - 1
    turned = np.where((levels[stop] < levels[edge])[of], edge[of] + stop[of] - index, index)
    every, levels = every[turned], levels[turned]
    falls = np.append((np.diff(of) == 0) & ~(np.diff(levels) > 0), False)
    lasting = (stop > edge) & (np.bincount(of, falls, len(edge)) == 0)
    left, last = lasting[of], np.cumsum((stop - edge + 1)[lasting]) - 1
    return _Stretches(every[left], levels[left], last - (stop - edge)[lasting], last, curves.pose[rows][first][lasting])


def _nearest(strategy: HolonomicStrategy, gap: Vector) -> Vector:
    return strategy.constraint.nearest(gap[:, None])[:, 0]


class _Seen(NamedTuple):
    """Postures (k, n), their levels, signs of det [J; J_g], rcond, and which are allowed, all (k,).

    Beyond the limits signs are 0, levels and rcond NaN.
    """

    q: Matrix
    c: Vector
    side: Vector
    rcond: Vector
    allowed: Flags

    def at(self, rows: Indices) -> _Seen:
        """Some of them (k,)."""
        return _Seen(self.q[rows], self.c[rows], self.side[rows], self.rcond[rows], self.allowed[rows])


class _Look:
    """What is asked of postures of self-motions; bounded hinges (n,) are at the turn next to the middle of theirs."""

    def __init__(self, strategy: HolonomicStrategy, curves: SelfMotions, clear: Clear | None, bounded: Flags) -> None:
        self.strategy, self.curves, self.clear, self.bounded = strategy, curves, clear, bounded
        robot, self.native = strategy.task.robot, native_from(len(curves.p))
        turning = bounded & ~np.isfinite(robot.upper - robot.lower)
        self.low, self.high = np.where(turning, -np.pi, robot.lower), np.where(turning, np.pi, robot.upper)

    def __call__(self, q: Matrix, pose: Indices) -> _Seen:
        q = np.where(self.bounded, at_best_turns(self.strategy.task.robot, q), q)
        allowed = np.asarray(((q >= self.low) & (q <= self.high)).all(axis=1))
        c, side, rcond = np.full(len(q), np.nan), np.zeros(len(q)), np.full(len(q), np.nan)
        some = np.flatnonzero(allowed)
        inside = q[some], self.curves.p[pose[some]], self.curves.R[pose[some]], np.zeros((len(some), 1))
        c[some] = self.strategy.constraint_value.batch(inside[0], native_from=self.native).reshape(-1)
        _, rcond[some], margin, side[some] = leaf_step(self.strategy).batch(*inside, native_from=self.native)
        sound = np.isfinite(c[some]) & (rcond[some] > TOLERANCES.singular) & (margin > TOLERANCES.representation)
        if self.clear is not None and sound.any():
            sound[sound] = self.clear(inside[0][sound])
        allowed[some] = sound
        return _Seen(q, c, side, rcond, allowed)

    def linked(self, seen: _Seen, curve: Indices) -> Flags:
        """Which rows (N - 1,) are followed by one of the same stretch."""
        both = seen.allowed[1:] & seen.allowed[:-1] & (curve[1:] == curve[:-1]) & (seen.side[1:] == seen.side[:-1])
        return both & ~(np.abs(np.diff(seen.q[:, self.bounded], axis=0)) > np.pi).any(axis=1)

    def led_on(self, seen: _Seen, pose: Indices, curve: Indices, at: Indices, way: int) -> tuple[Flags, Matrix, Vector]:
        """(which of some rows (k,) are led on, to an allowed posture on the way to the row beside; the postures (m, n)
        of these, and their levels (m,))."""
        robot, beside = self.strategy.task.robot, np.clip(at + way, 0, len(seen.q) - 1)
        step = seen.q[beside] - seen.q[at]
        step = np.where(robot.hinges, wrapped(step), step)
        # By the line between them: to the first joint's limit, or to where [J; J_g] is singular.
        with np.errstate(divide="ignore", invalid="ignore"):
            rest = np.where(step > 0, self.high - seen.q[at], self.low - seen.q[at]) / step
            share = np.where(step != 0, rest, np.inf).min(axis=1)
            fold = seen.rcond[at] / (seen.rcond[at] + seen.rcond[beside])
            other = seen.side[beside] * seen.side[at] < 0
        share = ENDS * np.clip(np.where(other, np.fmin(share, fold), share), 0, 1)
        has, found, levels = np.zeros(len(at), dtype=bool), seen.q[at], np.zeros(len(at))
        left = np.flatnonzero((curve[beside] == curve[at]) & (beside != at) & (share > SMALL))
        for _ in range(TRIES):
            if not len(left):
                break
            row = at[left]
            p, R = self.curves.p[pose[row]], self.curves.R[pose[row]]
            now = self(onto(self.strategy.task, p, R, seen.q[row] + share[left, None] * step[left]), pose[row])
            good = now.allowed & (now.side == seen.side[row]) & (np.abs(now.q - seen.q[row]).max(axis=1) < SAME)
            has[left[good]], found[left[good]], levels[left[good]] = True, now.q[good], now.c[good]
            left = left[~good]
            share[left] *= 0.5
        return has, found[has], levels[has]


def _begun_at_gaps(curves: SelfMotions, link: Flags) -> tuple[Indices, Flags]:
    """The rows of the curves in order, those of a closed one from a gap between stretches on; which are its own.

    Before and after a curve that begins so there is the row beside.
    """
    edge = np.flatnonzero(np.diff(curves.curve, prepend=-1))
    count = np.diff(np.append(edge, len(curves.q)))
    gaps = np.flatnonzero(~link & (curves.curve[1:] == curves.curve[:-1]))
    begin = np.full(len(edge), -1)
    begin[curves.curve[gaps[::-1]]] = gaps[::-1] - edge[curves.curve[gaps[::-1]]]
    moved = curves.closed & (begin >= 0) & (count > 2)
    # The last row of a closed curve is its first one.
    total = count + moved
    curve = np.repeat(np.arange(len(edge)), total)
    i = np.arange(len(curve)) - np.repeat(np.cumsum(total) - total, total)
    rows = edge[curve] + np.where(moved[curve], (begin[curve] + i) % np.maximum(count - 1, 1)[curve], i)
    return rows, ~moved[curve] | ((i > 0) & (i < total[curve] - 1))


# --- Links to neighbouring poses, and what grows over them.


def _links(strategy: HolonomicStrategy, T: Array, near: Indices, stretches: _Stretches) -> tuple[Indices, Vector]:
    """Pairs (e, 2) of stretches that a leaf links, and the level of the first less that of the second (e,)."""
    count, m = len(stretches.pose), near.shape[1]
    begin, goal = np.repeat(np.arange(count), m), near[stretches.pose].ravel()
    pairs, turns, native = [], [], native_from(len(T))
    for place in PLACES:
        level = stretches.low[begin] + place * (stretches.high - stretches.low)[begin]
        each, index = np.unique(begin, return_inverse=True)
        middle = stretches.low[each] + place * (stretches.high - stretches.low)[each]
        start = _exact(strategy, T[stretches.pose[each]], stretches.near(each, middle)[0], middle, native)
        able = np.isfinite(start[index]).all(axis=1)
        q = np.full((len(begin), strategy.task.n), np.nan)
        q[able], reached = one_by_one(strategy, start[index[able]], T[goal[able]], native)
        of, by = _stretch_of(strategy, stretches, q, level, goal, np.flatnonzero(able)[reached])
        found = of >= 0
        pairs.append(np.column_stack([begin[found], of[found]]))
        turns.append(by[found])
        begin, goal = begin[~found], goal[~found]
    return np.concatenate(pairs), np.concatenate(turns)


def _exact(strategy: HolonomicStrategy, T: Array, q: Matrix, level: Vector, native: int | None) -> Matrix:
    """Postures (k, n) near others at poses and levels; NaN where there are none."""
    step, p, R = leaf_step(strategy), T[:, :3, 3], T[:, :3, :3]

    def correct(q: Matrix, i: Indices) -> tuple[Matrix, Flags]:
        dq, rcond, margin, _ = step.batch(q, p[i], R[i], level[i, None], native_from=native)
        return dq, (rcond > TOLERANCES.singular) & (margin > TOLERANCES.representation)

    found, good = newton(correct, q, steps=8, exact=EXACT, contraction=0.5)
    return np.where(good[:, None], found, np.nan)


def _stretch_of(
    strategy: HolonomicStrategy, stretches: _Stretches, q: Matrix, level: Vector, goal: Indices, rows: Indices
) -> tuple[Indices, Vector]:
    """(the stretch of pose goal (k,) on which a posture (k, n) of a level lies, -1 for none; level less its own)."""
    robot, of, by = strategy.task.robot, np.full(len(q), -1), np.zeros(len(q))
    order = np.argsort(stretches.pose, kind="stable")
    first, last = (np.searchsorted(stretches.pose[order], goal[rows], side=s) for s in ("left", "right"))
    counted = _counted_turns(strategy, stretches.q)
    turn = 2 * np.pi if strategy.constraint.angular[0] or np.nan_to_num(counted).any() else 0.0
    best = np.full(len(rows), SAME)
    for k in range(int((last - first).max(initial=0))):
        some = np.flatnonzero(first + k < last)
        which = order[first[some] + k]
        c, low, high = level[rows[some]], stretches.low[which], stretches.high[which]
        off = turn * np.ceil((low - c) / turn) if turn else np.zeros(len(c))
        has = (c + off >= low) & (c + off <= high)
        some, which, off = some[has], which[has], off[has]
        postures, _ = stretches.near(which, level[rows[some]] + off)
        gap = q[rows[some]] - postures
        free = robot.hinges & ~np.isfinite(robot.upper - robot.lower)
        away = np.abs(np.where(free, wrapped(gap), gap)).max(axis=1, initial=0.0)
        closer = away < best[some]
        some, which = some[closer], which[closer]
        best[some], of[rows[some]], by[rows[some]] = away[closer], which, -off[closer]
    return of, by


def _grown(
    stretches: _Stretches, links: Indices, turns: Vector, count: int, least: float
) -> list[tuple[Indices, Vector]]:
    """The branches: their stretches (N,), and what their levels differ from these by (N,)."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    width, pose = stretches.high - stretches.low, stretches.pose
    left, branches = np.ones(len(pose), dtype=bool), []
    a, b = np.concatenate([links[:, 0], links[:, 1]]), np.concatenate([links[:, 1], links[:, 0]])
    by = np.concatenate([turns, -turns])
    order = np.argsort(a, kind="stable")
    a, b, by = a[order], b[order], by[order]
    at = np.searchsorted(a, np.arange(len(pose) + 1)).tolist()
    while True:
        # Only what is linked with enough others can be a branch.
        whole = left[a] & left[b]
        graph = csr_array((whole[whole], (a[whole], b[whole])), shape=(len(pose), len(pose)))
        part = connected_components(graph, directed=False)[1]
        left &= np.bincount(part)[part] >= least * count
        if not left.any():
            break
        seed = np.flatnonzero(left)[width[left].argmax()]
        shift, taken = np.full(len(pose), np.nan), np.zeros(count, dtype=bool)
        wave, members = np.array([seed]), [np.array([seed])]
        shift[seed], taken[pose[seed]] = 0.0, True
        while len(wave):
            edges = np.concatenate([np.arange(at[s], at[s + 1]) for s in wave.tolist()])
            edges = edges[left[b[edges]] & ~taken[pose[b[edges]]]]
            # Of the stretches of a pose the one with the most links, and the widest of equals.
            which, index, votes = np.unique(b[edges], return_index=True, return_counts=True)
            best = np.lexsort((-width[which], -votes, pose[which]))
            best = best[np.unique(pose[which][best], return_index=True)[1]] if len(best) else best
            wave, edges = which[best], edges[index[best]] if len(best) else edges[:0]
            shift[wave], taken[pose[wave]] = shift[a[edges]] + by[edges], True
            members.append(wave)
        every = np.concatenate(members)
        left[every] = False
        if len(every) >= least * count:
            branches.append((every, shift[every]))
    return sorted(branches, key=lambda branch: -len(branch[0]))
