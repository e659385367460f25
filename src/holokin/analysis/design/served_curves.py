"""What strategies serve of tool poses whose postures are all known, as curves: levels, margins, designs.

The postures of a pose are self-motions. A constraint g of one row is monotone on pieces of them, between its singular
postures, and a leaf g = c has one posture on each piece whose interval of g holds c. So which level serves most poses,
and which polynomial of the pose, is read off these intervals: no path is followed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...base.lbfgs import minimizer
from ...base.types import Array, Flags, Indices, Matrix, Value, Vector
from ...motion.self_motions.pose_reach import at_best_turns
from ...motion.self_motions.self_motions import SelfMotions
from ...strategies import HolonomicStrategy
from ...strategies.right_inverses import monomials_up_to
from ...strategies.tasks.task import Task
from ...symbolic import Function, symbol, vertcat
from ..coverage.pose_coordinates import Coordinates, Polynomial, values_and_slopes
from ..coverage.starts import Candidate
from .least_costs import least_slopes
from .objectives import Costs

EQUAL = 0.02
"""Difference of coverage up to which two strategies cover alike: five of 256 poses, which other poses would decide
otherwise."""

EASY = 0.05
"""Difference of the share that is served away from limits and singular postures up to which it counts as alike."""

ROOM = 0.02
"""Share of a joint's range to its limit from which on a posture keeps away from limits: 6 degrees of 300."""

LEVELS = 192
"""Levels that are compared, of each strategy."""

NEIGHBOURS = 4
"""Nearest poses of each pose by which pieces of self-motions are told to be of one branch."""

ALIKE = 0.25, 0.35
"""Joint distance [joint units] of two postures of neighbouring poses on one branch, beside the shortest motion from
the one pose to the other: at most so much, and such a share of that motion. Branches are 0.7 apart and more."""

ALONG = 0.3
"""What a difference along the self-motion counts in that: there a strategy moves as it likes."""

ROWS = 12_000
"""Postures of all poses that are looked at, about: those of a Panda are then 0.2 apart."""

TABLE = 33
"""Levels of a piece at which a design looks its cost up."""

WALLS = 1.0, 20.0
"""Cost of a level that is beyond a piece by the mean length of pieces, at first and in the end, beside
log(1 + squared joint speed / least)."""

LAST_GAIN = 1e-7
"""Share of that cost below which what a step of a search gains ends it."""

EDGE = 0.05
"""Share of a piece at its ends that a design keeps off: it is singular there, or a limit or a shape is near."""

SMOOTH = 0.01
"""Share of the mean length of pieces within which that cost is rounded off."""

UNSURE = 10.0
"""Squared joint speed, in medians of a leaf, that counts as so much and not more."""

FASTEST = 1e6
"""Greatest |dq/dg|^2 that is told: where it is infinite the strategy is singular."""

STILL = 1e-12
"""Change of a level [its unit] between two postures that is round-off: there the level stands still, as that of a held
joint does where the self-motion does not move it."""

CLOSER = 5
"""Steps by which the row next to a level is looked for, as by Newton's method."""

BRANCHES, CLOSELY = 6, 7
"""Branches of a strategy, and levels of each, that are looked at closely."""


class Within(NamedTuple):
    """Postures q (N, n) of poses (N,) within the joint limits, and whether the next one follows on its curve (N,)."""

    q: Matrix
    pose: Indices
    linked: Flags


def within_limits(motions: SelfMotions) -> Within:
    """The postures of self-motions within the joint limits, and those where a limit cuts a curve.

    Each hinge is at the turn that is farthest within its limits: a curve is cut where that changes. Where there are
    many, some are left out.
    """
    robot = motions.task.robot
    q = at_best_turns(robot, motions.q)
    beyond = robot.beyond(q).max(axis=1)
    follows = (np.diff(motions.curve) == 0) & (np.abs(np.diff(q, axis=0)).max(axis=1) < np.pi)
    # Between one within and one beyond: where the line between them leaves the limits
    inside = beyond <= 0
    cut = np.flatnonzero(follows & (inside[1:] != inside[:-1]))
    a, b = robot.beyond(q[cut]), robot.beyond(q[cut + 1])
    with np.errstate(invalid="ignore", divide="ignore"):
        zeros = np.where((a > 0) != (b > 0), a / (a - b), np.where(inside[cut], 1.0, 0.0)[:, None])
    share = np.where(inside[cut], zeros.min(axis=1), zeros.max(axis=1))
    share = np.clip(share, 1e-6, 1 - 1e-6)
    own = np.flatnonzero(inside)
    place = np.concatenate([own.astype(float), cut + share])
    order = np.argsort(place, kind="stable")
    place = place[order]
    postures = np.concatenate([q[own], q[cut] + share[:, None] * (q[cut + 1] - q[cut])])[order]
    first = np.floor(place).astype(int)
    linked = np.zeros(len(place), dtype=bool)
    linked[:-1] = (place[1:] <= first[:-1] + 1) & follows[np.minimum(first[:-1], len(follows) - 1)]
    # Where there are many, some of each run of those that follow each other, and its ends
    ends = ~linked | ~np.concatenate([[False], linked[:-1]])
    rows = np.flatnonzero(ends | (np.arange(len(place)) % (1 + len(place) // ROWS) == 0))
    return Within(postures[rows], motions.pose[first[rows]], linked[rows])


@dataclass(frozen=True, eq=False)
class ServedCurves(Value):
    """The postures q (N, n) of S poses, at those of `pose` (N,), that serve them: within the joint limits, and clear.

    linked (N,): the next posture follows on the same self-motion, and all between serve. sign (N,): of
    det [J; dq], dq the way to the next one, which is the same all along a self-motion. along (N, n): unit vectors of
    the self-motions. slopes (N, n, m): J^+ with the
    weights of the costs; speed (N,): the squared joint speed with these, the least there. u (S, d): the poses in
    coordinates, NaN where none serves. pairs (e, 2): poses next to each other, and the tool's motion (e, m) between.
    """

    task: Task
    costs: Costs
    coordinates: Coordinates
    twists: Array
    q: Matrix
    pose: Indices
    linked: Flags
    sign: Vector
    along: Matrix
    slopes: Array
    speed: Vector
    u: Matrix
    pairs: Indices
    moves: Matrix

    @cached_property
    def served(self) -> Flags:
        """Which poses some posture serves (S,)."""
        return np.asarray(np.isfinite(self.u).all(axis=1))

    @cached_property
    def floor(self) -> Vector:
        """The least squared joint speed (S,) of the postures that serve each pose; NaN where none does."""
        floor = np.full(len(self.u), np.inf)
        np.minimum.at(floor, self.pose, self.speed)
        return np.where(np.isfinite(floor), floor, np.nan)

    @cached_property
    def away(self) -> Flags:
        """Which postures keep away from the joint limits (N,)."""
        robot = self.task.robot
        spans = np.where(np.isfinite(robot.upper - robot.lower), robot.upper - robot.lower, 0.0)
        return np.asarray((np.minimum(self.q - robot.lower, robot.upper - self.q) >= ROOM * spans).all(axis=1))

    def levels(self, candidates: Sequence[Candidate]) -> Matrix:
        """The levels g (N, c) of candidates with a constraint of one row."""
        q = symbol("q", self.task.n)
        kinematics = self.task.kinematics(q)
        rules = [_strategy(c).constraint.expand(self.task, kinematics, q) for c in candidates]
        return Function("levels", {"q": q}, {"g": vertcat(*rules)}).batch(self.q).reshape(len(self.q), -1)

    def terms(self, candidate: Candidate, which: Indices) -> tuple[Vector, Vector, Matrix]:
        """At some postures (k,) the least squared joint speed (k,), |dq/dg|^2 along the self-motion (k,), and
        J_g J^+ P (k, d): a strategy g = h(x) has as squared joint speed the first and the second times
        |D_P h - J_g J^+ P|^2.
        """
        J_g = _strategy(candidate).rows(self.q[which])[:, 0]
        along = self.along[which]
        with np.errstate(divide="ignore"):
            metric = np.sum(self.costs.joints * along**2, axis=1) / np.sum(J_g * along, axis=1) ** 2
        wanted = np.einsum("kn,knm,kmd->kd", J_g, self.slopes[which], self.twists[self.pose[which]], optimize=True)
        return self.speed[which], np.minimum(metric, FASTEST), wanted


def _strategy(candidate: Candidate) -> HolonomicStrategy:
    """That of a candidate which has one. Raises: ValueError."""
    if candidate.strategy is None:
        raise ValueError(candidate.name)
    return candidate.strategy


def served_curves(
    within: Within, clear: Flags, task: Task, T: Array, twists: Array, costs: Costs, coordinates: Coordinates
) -> ServedCurves:
    """Those of the postures within the limits that are clear (N,), at tool poses T (S, 4, 4).

    Args:
        twists: as of `Poses`.
    """
    chosen = np.flatnonzero(clear)
    q, pose = within.q[chosen], within.pose[chosen]
    linked = np.zeros(len(q), dtype=bool)
    linked[:-1] = within.linked[chosen[:-1]] & (np.diff(chosen) == 1)
    J = task.jacobian_batch(q)[0]
    slopes = least_slopes(J, np.eye(task.m), costs.joints)
    speed = np.sum(costs.joints[:, None] * (slopes @ twists[pose]) ** 2, axis=(1, 2))
    way = np.zeros_like(q)
    way[:-1] = np.diff(q, axis=0)
    along = np.where(linked[:, None], way, np.roll(way, 1, axis=0))
    along -= np.einsum("knm,kml,kl->kn", slopes, J, along, optimize=True)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    sign = np.where(linked, np.sign(np.linalg.det(np.concatenate([J, way[:, None]], axis=1))), 0.0)
    # Pairs of poses next to each other, and the motion of the tool from the one to the other
    known, first = np.unique(pose, return_index=True)
    u = np.full((len(T), coordinates.d), np.nan)
    u[known] = coordinates.at(q[first])
    pairs = _neighbours(known, u[known] * coordinates.scale / costs.columns)
    at = first[np.searchsorted(known, pairs[:, 0])]
    p, R = (np.ascontiguousarray(part) for part in (T[pairs[:, 1], :3, 3], T[pairs[:, 1], :3, :3]))
    moves = task.error(q[at], p, R) if len(pairs) else np.zeros((0, task.m))
    return ServedCurves(task, costs, coordinates, twists, q, pose, linked, sign, along, slopes, speed, u, pairs, moves)


def _neighbours(known: Indices, places: Matrix) -> Indices:
    """Pairs (e, 2) of poses, by numbers, each with its nearest ones, of places (k, d)."""
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    nearest = np.argsort(apart, axis=1, kind="stable")[:, 1 : NEIGHBOURS + 1]
    pairs = np.column_stack([np.repeat(known, nearest.shape[1]), known[nearest.ravel()]])
    return np.unique(np.sort(pairs, axis=1), axis=0)


# --- Pieces of self-motions on which a constraint is monotone, and which of them are of one branch.


@dataclass(frozen=True, eq=False)
class Pieces(Value):
    """Pieces of self-motions on which levels g rise or fall: rows `first` to `last` (k,) of `ServedCurves`.

    start, end (k,): their levels there, of angles counted on from the first row; travel (N,): how far g has come, from
    row to row. branch (k,): numbers of the branches that they are of: two poses next to each other have pieces of one
    branch where a short motion leads from the one to the other.
    """

    candidate: Candidate
    first: Indices
    last: Indices
    start: Vector
    end: Vector
    pose: Indices
    branch: Indices
    angular: bool
    travel: Vector

    def levels(self, piece: int) -> tuple[Indices, Vector]:
        """The rows (j,) of a piece, and their levels (j,), which rise."""
        rows = np.arange(self.first[piece], self.last[piece] + 1)
        g = self.start[piece] + self.travel[rows] - self.travel[rows[0]]
        return (rows, g) if g[-1] > g[0] else (rows[::-1], g[::-1])

    @property
    def low(self) -> Vector:
        """The least level (k,)."""
        return np.minimum(self.start, self.end)

    @property
    def high(self) -> Vector:
        """The greatest (k,)."""
        return np.maximum(self.start, self.end)

    def row_at(self, which: Indices, level: Vector) -> Indices:
        """The rows (j,) of some pieces next to levels (j,)."""
        first, last, start = self.first[which], self.last[which], self.start[which] - self.travel[self.first[which]]
        place = first + 0.5 * (last - first)
        for _ in range(CLOSER):
            i = np.clip(place.astype(int), first, last - 1)
            step = self.travel[i + 1] - self.travel[i]
            place = np.clip(i + (level - start - self.travel[i]) / step, first, last)
        return np.rint(place).astype(int)


def pieces_of(curves: ServedCurves, candidate: Candidate, g: Vector) -> Pieces:
    """The pieces of a candidate with levels g (N,)."""
    angular = _strategy(candidate).constraint.angular[0]
    step = np.zeros(len(g))
    step[:-1] = np.diff(g)
    if angular:
        step = (step + np.pi) % (2 * np.pi) - np.pi
    side = np.where(curves.linked & (np.abs(step) > STILL), np.sign(step) * curves.sign, 0.0)
    # Runs of rows that are linked to the next one, with one side
    begins = np.flatnonzero((side != 0) & np.concatenate([[True], (side[1:] != side[:-1]) | ~curves.linked[:-1]]))
    ends = np.flatnonzero((side != 0) & np.concatenate([(side[1:] != side[:-1]) | ~curves.linked[1:], [True]])) + 1
    total = np.concatenate([[0.0], np.cumsum(np.where(side != 0, step, 0.0))])
    start = g[begins]
    end = start + total[ends] - total[begins]
    pose, side = curves.pose[begins], side[begins]
    pieces = Pieces(candidate, begins, ends, start, end, pose, np.arange(len(begins)), angular, total)
    return replace(pieces, branch=_branches(curves, pieces, side))


def _branches(curves: ServedCurves, pieces: Pieces, side: Vector) -> Indices:
    """Numbers (k,) of branches: pieces of neighbouring poses are of one where each is the other's nearest."""
    # Every piece of the one pose with every one of the other, on the same side of singular postures
    order = np.argsort(pieces.pose, kind="stable")
    first, last = (np.searchsorted(pieces.pose[order], curves.pairs, side=s) for s in ("left", "right"))
    count = last - first
    pair = np.repeat(np.arange(len(curves.pairs)), count[:, 0] * count[:, 1])
    place = np.arange(len(pair)) - np.repeat(
        np.cumsum(count[:, 0] * count[:, 1]) - count[:, 0] * count[:, 1], count[:, 0] * count[:, 1]
    )
    a = order[first[pair, 0] + place // count[pair, 1]]
    b = order[first[pair, 1] + place % count[pair, 1]]
    # The level in the middle of those that both have, and the postures there
    turn = np.zeros(len(a))
    if pieces.angular:
        middles = (pieces.start + pieces.end) / 2
        turn = 2 * np.pi * np.rint((middles[a] - middles[b]) / (2 * np.pi))
    low = np.maximum(pieces.low[a], pieces.low[b] + turn)
    high = np.minimum(pieces.high[a], pieces.high[b] + turn)
    both = (side[a] == side[b]) & (low < high)
    a, b, pair, turn, level = a[both], b[both], pair[both], turn[both], ((low + high) / 2)[both]
    i, j = pieces.row_at(a, level), pieces.row_at(b, level - turn)
    # How far they are apart, the shortest motion of the joints from the one pose to the other aside
    motion = np.einsum("knm,km->kn", curves.slopes[i], curves.moves[pair])
    rest, along = curves.q[j] - curves.q[i] - motion, curves.along[i]
    part = np.sum(rest * along, axis=1)
    across = np.linalg.norm(rest - part[:, None] * along, axis=1)
    near = across < ALIKE[0] + ALIKE[1] * np.linalg.norm(motion, axis=1)
    apart = np.where(near, across + ALONG * np.abs(part), np.inf)
    best = np.ones(len(a), dtype=bool)
    for one, other in ((a, pieces.pose[b]), (b, pieces.pose[a])):
        group = one * (len(curves.u) + 1) + other
        least = np.full(int(group.max(initial=-1)) + 1, np.inf)
        np.minimum.at(least, group, apart)
        best &= apart <= least[group]
    best &= near
    return _connected(len(side), a[best], b[best])


def _connected(count: int, a: Indices, b: Indices) -> Indices:
    """The least number (k,) among those that pairs a, b connect with each of `count` numbers."""
    label = np.arange(count)
    while True:
        before = label.copy()
        least = np.minimum(label[a], label[b])
        np.minimum.at(label, a, least)
        np.minimum.at(label, b, least)
        label = label[label]
        if np.array_equal(label, before):
            return np.unique(label, return_inverse=True)[1]


# --- The leaf of a strategy that serves most, on one branch.


@dataclass(frozen=True, eq=False)
class Leaf(Value):
    """A leaf of a candidate: its level, and the rows of `ServedCurves` (k,) next to its postures at the poses (k,).

    q (n,): the posture at the pose nearest to the middle of the workspace. coverage, easy: shares of the poses that are
    served, and of those away from limits. squared_speed: the mean. pieces, branch: those that the leaf goes through.
    """

    pieces: Pieces
    branch: int
    level: float
    q: Vector
    coverage: float
    easy: float
    squared_speed: float
    clear: float = 1.0

    @property
    def candidate(self) -> Candidate:
        """The strategy, told to begin on this level."""
        return replace(self.pieces.candidate, level=self.level)


def best_leaf(curves: ServedCurves, pieces: Pieces) -> Leaf | None:
    """The leaf that serves most poses; of those that serve nearly as many one away from limits and with the least joint
    speed; None where there is none."""
    if not len(pieces.first):
        return None
    low, high, level = float(pieces.low.min()), float(pieces.high.max()), pieces.candidate.level
    if pieces.angular and high - low > 2 * np.pi:
        low, high = -np.pi, np.pi
    levels = np.linspace(low, high, LEVELS + 2)[1:-1] if level is None else np.array([level])
    # How many poses have a posture at a level, for each branch
    group, of_group = np.unique(pieces.branch * len(curves.u) + pieces.pose, return_inverse=True)
    has = np.zeros((len(group), len(levels)), dtype=bool)
    order = np.argsort(of_group, kind="stable")
    for turn in (-2 * np.pi, 0.0, 2 * np.pi) if pieces.angular else (0.0,):
        holds = (levels + turn >= pieces.low[order, None]) & (levels + turn <= pieces.high[order, None])
        has |= np.logical_or.reduceat(holds, np.searchsorted(of_group[order], np.arange(len(group))))
    counts = np.zeros((int(pieces.branch.max()) + 1, len(levels)))
    np.add.at(counts, group // len(curves.u), has)
    # Of the leaves that serve nearly as many as the best, some of each branch, looked at closely
    enough = counts.max() - EQUAL * len(curves.u)
    options: list[tuple[int, float]] = []
    for branch in np.argsort(-counts.max(axis=1), kind="stable")[:BRANCHES].tolist():
        near = np.flatnonzero(counts[branch] >= max(enough, 1))
        if len(near):
            some = near[np.unique(np.linspace(0, len(near) - 1, CLOSELY).astype(int))]
            options += [(branch, c) for c in levels[some].tolist()]
    leaves = _leaves(curves, pieces, options)
    easy = max((leaf.easy for leaf in leaves), default=0.0) - EASY
    return min((leaf for leaf in leaves if leaf.easy >= easy), key=lambda leaf: leaf.squared_speed, default=None)


def best_branch(curves: ServedCurves, pieces: Pieces) -> Leaf | None:
    """The branch that has pieces at most poses, on whatever levels; of those at nearly as many the one with the least
    joint speed: its leaf on the level in the middle of those that are best. None where there is none."""
    if not len(pieces.first):
        return None
    ends = np.column_stack([pieces.first, pieces.last + 1]).ravel()
    least = np.minimum.reduceat(np.append(curves.speed, np.inf), ends)[::2]
    best = np.full((int(pieces.branch.max()) + 1, len(curves.u)), np.inf)
    np.minimum.at(best, (pieces.branch, pieces.pose), least)
    counts = np.isfinite(best).sum(axis=1)
    enough = np.flatnonzero(counts >= max(1.0, counts.max() - EQUAL * len(curves.u)))
    speeds = [best[i][np.isfinite(best[i])].mean() for i in enough]
    branch = int(enough[int(np.argmin(speeds))])
    levels = []
    for piece in np.flatnonzero((pieces.branch == branch) & (least <= best[pieces.branch, pieces.pose])):
        rows, g = pieces.levels(int(piece))
        levels.append(g[int(np.argmin(curves.speed[rows]))])
    if pieces.angular:
        levels = np.unwrap(np.sort(np.mod(levels, 2 * np.pi)))
    found = _leaves(curves, pieces, [(branch, float(np.median(levels)))])
    return found[0] if found else None


def leaf_through(curves: ServedCurves, pieces: Pieces, q0: Vector) -> Leaf | None:
    """The leaf through a posture (n,), on the branch that leads to the poses nearest to the tool there; None where it
    leads to none."""
    strategy, c = _strategy(pieces.candidate), pieces.candidate.level
    if not len(pieces.first):
        return None
    level = float(np.ravel(strategy.constraint_value(q0))[0]) if c is None else c
    which, rows = _on(pieces, np.arange(len(pieces.first)), level)
    if not len(which):
        return None
    # Its pieces at the poses next to the tool, by how far their postures are from q0
    u = curves.coordinates.at(q0[None])[0]
    poses = np.argsort(np.linalg.norm(curves.u[pieces.pose[which]] - u, axis=1), kind="stable")[: 4 * NEIGHBOURS]
    best = poses[int(np.argmin(np.linalg.norm(curves.q[rows[poses]] - q0, axis=1)))]
    return replace(_leaves(curves, pieces, [(int(pieces.branch[which[best]]), level)])[0], q=q0)


def _leaves(curves: ServedCurves, pieces: Pieces, options: Sequence[tuple[int, float]]) -> list[Leaf]:
    """The leaves of some branches on some levels."""
    count, found = len(curves.u), []
    for branch, level in options:
        which, rows = _on(pieces, np.flatnonzero(pieces.branch == branch), level)
        pose, first = np.unique(pieces.pose[which], return_index=True)
        found.append((pose, rows[first]))
    if not found:
        return []
    every = np.concatenate([rows for _, rows in found])
    floor, metric, wanted = curves.terms(pieces.candidate, every)
    speed = floor + metric * np.sum(wanted**2, axis=1)
    away, leaves, last = curves.away[every], [], 0
    for (branch, level), (pose, rows) in zip(options, found, strict=True):
        own, last = slice(last, last + len(rows)), last + len(rows)
        q = curves.q[rows[int(np.argmin(np.linalg.norm(curves.u[pose], axis=1)))]]
        # Rows lie beside the postures of the leaf: where these are nearly singular, the speed there is not known
        size = float(np.minimum(speed[own], UNSURE * np.median(speed[own])).mean())
        leaves.append(Leaf(pieces, branch, level, q, len(pose) / count, float(away[own].sum()) / count, size))
    return leaves


def _on(pieces: Pieces, own: Indices, level: float) -> tuple[Indices, Indices]:
    """Those of some pieces that have a level (k,), and the rows next to it (k,)."""
    turn = np.zeros(len(own))
    if pieces.angular:
        turn = 2 * np.pi * np.rint(((pieces.start + pieces.end)[own] / 2 - level) / (2 * np.pi))
    c = level + turn
    holds = (c >= pieces.low[own]) & (c <= pieces.high[own])
    return own[holds], pieces.row_at(own[holds], c[holds])


# --- A polynomial of the pose as the level: the section of least joint speed on a branch.
#
# With W the weights of squared joint speeds, z = dq/dg along the self-motion and J^+ the right inverse of least speed,
# the strategy that keeps g = h(x) has G = J^+ + z (Dh - J_g J^+), and the two parts are orthogonal in W:
#
#     |G P|^2 = |J^+ P|^2 + |z|^2 |D_P h - J_g J^+ P|^2.
#
# Along a piece all but h is a function of g alone, which is looked up in a table.


class _Tables(NamedTuple):
    """Of each pose (k,) the levels low to high of its piece, and at TABLE levels between them the least squared joint
    speed (k, t), |z|^2 (k, t) and J_g J^+ P (k, t, d).

    inner_low, inner_high (k,): the levels between which the joints keep away from their limits, if there are any.
    """

    pose: Indices
    low: Vector
    high: Vector
    inner_low: Vector
    inner_high: Vector
    floor: Matrix
    metric: Matrix
    wanted: Array

    def at(self, h: Vector, slopes: Matrix) -> tuple[Vector, Vector, Matrix]:
        """The squared joint speed (k,) of sections with levels h (k,) and slopes (k, d), with derivatives by both."""
        width, rows = (self.high - self.low) / (TABLE - 1), np.arange(len(h))
        place = np.clip((h - self.low) / width, 0.0, TABLE - 1.0)
        i = np.minimum(place.astype(int), TABLE - 2)
        share = place - i
        (floor, by_floor), (metric, by_metric) = (
            ((1 - share) * t[rows, i] + share * t[rows, i + 1], (t[rows, i + 1] - t[rows, i]) / width)
            for t in (self.floor, self.metric)
        )
        a, b = self.wanted[rows, i], self.wanted[rows, i + 1]
        off = slopes - (1 - share)[:, None] * a - share[:, None] * b
        square = np.sum(off**2, axis=1)
        by_h = by_floor + by_metric * square - 2 * metric * np.sum(off * (b - a), axis=1) / width
        beyond = (h < self.low) | (h > self.high)
        return floor + metric * square, np.where(beyond, 0.0, by_h), 2 * metric[:, None] * off


def designed_on(curves: ServedCurves, leaf: Leaf, degree: int) -> tuple[Polynomial, float] | None:
    """The polynomial h(x) for which g = h(x), on the branch of a leaf, serves most poses with the least joint speed;
    and its cost. None where there are too few poses."""
    tables = _tables(curves, leaf)
    coordinates, terms = curves.coordinates, monomials_up_to(curves.coordinates.d, degree)
    values, slopes = values_and_slopes(curves.u[tables.pose], terms)
    slopes = np.ascontiguousarray(np.swapaxes(slopes * (curves.costs.columns / coordinates.scale), 1, 2))
    if len(tables.pose) < len(terms):
        return None
    least, scale = tables.floor.min(axis=1).mean(), float(np.mean(tables.high - tables.low))

    def cost(x: Vector, wall: float) -> tuple[float, Vector]:
        h, Dh = values @ x, slopes @ x
        speed, by_h, by_slopes = tables.at(h, Dh)
        # The logarithm: a pose at which a joint must be fast does not outweigh the others
        inner = 1 / (least + speed)
        past = np.minimum(h - tables.inner_low, 0.0) + np.maximum(h - tables.inner_high, 0.0)
        root = np.sqrt((past / scale) ** 2 + SMOOTH**2)
        value = np.log(speed / least + 1) + wall * (root - SMOOTH)
        gradient = values.T @ (by_h * inner + wall * past / root / scale**2)
        gradient += np.tensordot(by_slopes * inner[:, None], slopes, axes=2)
        return float(np.mean(value)), gradient / len(h)

    x = np.linalg.lstsq(values, np.clip(leaf.level, tables.inner_low, tables.inner_high), rcond=None)[0]
    scaled = 1 / np.sqrt(np.mean(values**2, axis=0) + np.mean(np.sum(slopes**2, axis=1), axis=0))
    for wall in WALLS:

        def scaled_cost(y: Vector, wall: float = wall) -> tuple[float, Vector]:
            value, gradient = cost(scaled * y, wall)
            return value, scaled * gradient

        x = scaled * minimizer(scaled_cost, x / scaled, LAST_GAIN)
    unserved = len(curves.u) - len(tables.pose)
    return Polynomial(coordinates, x[None]), cost(x, WALLS[-1])[0] + WALLS[-1] * unserved / len(curves.u)


def _tables(curves: ServedCurves, leaf: Leaf) -> _Tables:
    """Those of the branch of a leaf: of each pose the piece that holds the level, or the nearest to it."""
    pieces, own = leaf.pieces, np.flatnonzero(leaf.pieces.branch == leaf.branch)
    turn = np.zeros(len(own))
    if pieces.angular:
        turn = 2 * np.pi * np.rint((leaf.level - (pieces.start + pieces.end)[own] / 2) / (2 * np.pi))
    start, end = pieces.start[own] + turn, pieces.end[own] + turn
    low, high = np.minimum(start, end), np.maximum(start, end)
    off = np.maximum(0.0, np.maximum(low - leaf.level, leaf.level - high)) - 1e-6 * (high - low)
    order = np.lexsort((off, pieces.pose[own]))
    pose, first = np.unique(pieces.pose[own][order], return_index=True)
    chosen = order[first]
    table, inner = np.empty((len(chosen), TABLE, 2 + curves.coordinates.d)), np.empty((len(chosen), 2))
    # The rows of all these pieces, then each piece at even levels
    rows, levels = zip(*(pieces.levels(piece) for piece in own[chosen]), strict=True)
    parts = curves.terms(pieces.candidate, np.concatenate(rows))
    columns = np.column_stack([part.reshape(sum(map(len, rows)), -1) for part in parts])
    ends = np.cumsum([len(own_rows) for own_rows in rows])[:-1]
    for k, (i, g, part) in enumerate(zip(rows, levels, np.split(columns, ends), strict=True)):
        g, away = g + turn[chosen[k]], curves.away[i]
        even = np.linspace(g[0], g[-1], TABLE)
        table[k] = np.column_stack([np.interp(even, g, column) for column in part.T])
        inside = g[away] if away.any() else g
        edge = EDGE * (g[-1] - g[0])
        inner[k] = np.sort([min(inside[0] + edge, g[-1]), max(inside[-1] - edge, g[0])])
    inner_low, inner_high = inner.T
    return _Tables(pose, low[chosen], high[chosen], inner_low, inner_high, table[..., 0], table[..., 1], table[..., 2:])
