"""How far a sheet reaches: poses to search from, growth from neighbour to neighbour, levels that fit."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...base.errors import ArgumentError, HolokinError
from ...base.poses import pose_from
from ...base.types import Array, Flags, Indices, Matrix, Value, Vector
from ...motion.checks import Clear
from ...motion.ik.inverse_function import AGREE
from ...strategies import HolonomicStrategy, holonomic
from ...strategies.constraints import custom, tilted
from ...strategies.right_inverses import monomials_up_to
from ...strategies.tasks.task import Task
from ..coverage import regular_starts
from ..coverage.leaf_lines import along_leaf, one_by_one
from ..coverage.pose_coordinates import Coordinates, Polynomial, chart_of, coordinates_of, values_and_slopes
from ..coverage.starts import Candidate, candidates, postures_at
from .sheet import allowed_postures, known, nearby, neighbours

SOME, MOST = 400, 400  # poses that are searched of those that are served, and of those that were left out


@dataclass(frozen=True, eq=False)
class SearchedPoses(Value):
    """Of the poses in reach (K, 4, 4) a random part, in which those that were left out so far are more frequent.

    Most poses are easy: nearly any leaf serves them. So a few of these stand for all, and the search looks closely at
    the others. What a leaf serves is estimated without bias: each pose has the weight of those that it stands for.

    every: all poses (E, 4, 4), of which the first K are in question so far. order: a random order of these (K,).
    left_out: by a choice of sheets so far (K,). length: what a turn of 1 rad counts where poses are compared [m]. some,
    most: how many are searched of those served, and of those left out.
    """

    every: Array
    order: Indices
    left_out: Flags
    length: float
    some: int = SOME
    most: int = MOST

    @staticmethod
    def of(every: Array, length: float, first: int | None = None) -> SearchedPoses:
        """A random part of some poses (E, 4, 4), or of the `first` of them; the same for the same poses."""
        count = len(every) if first is None else min(first, len(every))
        order = np.random.default_rng(0).permutation(count)
        return SearchedPoses(every, order, np.zeros(count, dtype=bool), length)

    @property
    def reach(self) -> Array:
        """The poses (K, 4, 4) that are in question."""
        return self.every[: len(self.order)]

    def more(self) -> SearchedPoses:
        """The same with all poses in question; itself where they are."""
        if len(self.order) == len(self.every):
            return self
        left_out = np.zeros(len(self.every), dtype=bool)
        left_out[: len(self.left_out)] = self.left_out
        return replace(SearchedPoses.of(self.every, self.length), left_out=left_out)

    def without(self, served: Flags) -> SearchedPoses:
        """The same, with the poses that a choice does not serve (K,) among those left out."""
        return replace(self, left_out=self.left_out | ~served)

    @property
    def all(self) -> SearchedPoses:
        """All the poses."""
        wider = self.more()
        return replace(wider, some=len(self.every), most=len(self.every))

    @property
    def complete(self) -> bool:
        """Whether all the poses in question are searched."""
        return len(self.which) == len(self.reach)

    @cached_property
    def which(self) -> Indices:
        """Their indices (k,) among the poses in reach."""
        return np.sort(np.concatenate(self._parts))

    @cached_property
    def weights(self) -> Vector:
        """How many poses each stands for (k,)."""
        each = np.zeros(len(self.reach))
        for part, count in zip(self._parts, ((~self.left_out).sum(), self.left_out.sum()), strict=True):
            each[part] = count / max(1, len(part))
        return np.asarray(each[self.which])

    @cached_property
    def T(self) -> Array:
        """The poses (k, 4, 4)."""
        return self.reach[self.which]

    @cached_property
    def near(self) -> Indices:
        """Of each pose its neighbours (k, m)."""
        return nearby(self.T, self.length)

    @cached_property
    def pairs(self) -> Indices:
        """Pairs (e, 2) of neighbours."""
        return neighbours(self.T, self.length)

    @cached_property
    def _parts(self) -> tuple[Indices, Indices]:
        left = self.left_out[self.order]
        return self.order[~left][: self.some], self.order[left][: self.most]


# Share of its neighbours that need not lead to a pose that is grown: at a hollow edge of a sheet a straight path to a
# neighbour leaves it. Where a leaf ends between two sides of a sheet, half of them do not lead across.
FAILING = 0.25

# (postures (k, n) to begin from, numbers of poses (k,)) -> (postures there (k, n), which is served (k,)).
Go = Callable[[Matrix, Indices], tuple[Matrix, Flags]]


def grown(q: Matrix, near: Indices, go: Go) -> tuple[Matrix, Indices]:
    """A sheet's postures at k poses, grown from those it has.

    Wave after wave the poses next to it are reached straight from a neighbour. So poses behind a hole or a corner of
    the leaf are reached, too, which no straight path from its start does. A pose is taken only if no neighbour
    that the sheet serves leads to another posture, and three quarters of them to the same: else the leaf overlaps
    itself, or ends between them.

    Args:
        q: the postures (k, n) that it has, NaN for none. near: of each pose its neighbours (k, m), nearest first.

    Returns:
        (postures (k, n), NaN where it does not serve; the wave in which each was reached (k,), -1 for never).
    """
    q = q.copy()
    wave, tried, count = np.where(known(q), 0, -1), np.zeros(near.shape, dtype=bool), 0
    while True:
        count += 1
        can = (wave >= 0)[near] & ~tried & (wave < 0)[:, None]
        front = np.flatnonzero(can.any(axis=1))
        if not len(front):
            return q, wave
        column = np.argmax(can[front], axis=1)
        tried[front, column] = True
        postures, served = go(q[near[front, column]], front)
        ask, other = np.nonzero(
            served[:, None] & (wave >= 0)[near[front]] & (column[:, None] != np.arange(near.shape[1]))
        )
        asked, failed = 1 + np.bincount(ask, minlength=len(front)), np.zeros(len(front))
        if len(ask):
            there, reached = go(q[near[front[ask], other]], front[ask])
            differs = reached & ~(np.abs(there - postures[ask]).max(axis=1) <= AGREE)
            failed = np.bincount(ask, ~reached, len(front))
            served[ask[differs]] = False
        served &= failed <= FAILING * asked
        tried[front[~served & (asked > 1)]] = True
        q[front[served]], wave[front[served]] = postures[served], count


def one_function(q: Matrix, wave: Indices, pairs: Indices, go: Go) -> tuple[Matrix, Matrix]:
    """A sheet's postures without those that contradict their neighbours, so that it is one function of the pose.

    Where a leaf overlaps itself, as after a turn round the base, it comes to one pose with two postures. Of two
    neighbours of which one leads to another posture of the other, that which was reached later is left out. So is a
    posture that was grown, if more than a quarter of its neighbours do not lead to it at all. Postures that were
    reached straight from the start are kept: the straight paths between them and the start are on the leaf.

    Returns:
        (postures (k, n), NaN where it does not serve; the other postures (l, n) of the leaf, at poses left out).
    """
    q = q.copy()
    both = pairs[known(q[pairs]).all(axis=1)]
    if not len(both):
        return q, q[:0]
    postures, served = go(q[both[:, 0]], both[:, 1])
    differs = ~(np.abs(postures - q[both[:, 1]]).max(axis=1) <= AGREE)
    clash, apart = both[served & differs], both[~served]
    consistent, out = known(q), []
    count = np.bincount(clash.ravel(), minlength=len(q))
    for i in np.lexsort((-count, -wave)).tolist():  # the latest first
        near, failing = _others(both, i), _others(apart, i)
        split = wave[i] > 0 and consistent[failing].sum() > FAILING * consistent[near].sum()
        if split or consistent[_others(clash, i)].any():
            consistent[i] = False
            out.append(i)
    others = []
    for i in out:
        begin = [j for j in _others(clash, i) if consistent[j]][:1]
        there, reached = go(q[begin], np.full(len(begin), i))
        others += list(there[reached])
    q[out] = np.nan
    return q, np.array(others).reshape(-1, q.shape[1])


def _others(pairs: Indices, i: int) -> Indices:
    """What is beside i in some pairs (e, 2)."""
    rows = pairs[(pairs == i).any(axis=1)].ravel()
    return rows[rows != i]


# --- What a leaf serves, and what it costs: estimates, by many straight lines side by side.

MOST_STRATEGIES = 6  # whose leaves are tried all over the workspace. On a Panda the first three made up the cover.

# Share of a straight line below which a step is given up: what lies behind is reached from pose to pose.
SHORTEST = 1 / 64

# Difference of joints [rad or m] that counts as a jump between neighbours, and what the share of these pairs costs.
JUMP, JUMPS = 0.5, 10.0

MARGIN = 0.1  # share of a joint's range next to a limit that counts as near it
ROUGH = 64  # poses by which strategies are put in order
STARTS = 8  # postures at one pose through which leaves of each strategy are tried


def cost_of(strategy: HolonomicStrategy, q: Matrix, poses: SearchedPoses) -> float:
    """Of postures (k, n) at the poses, NaN for none: the mean of |G|, over what it is at the least, of the share of
    joints near a limit, and of neighbours between which the joints jump: they are off by more than JUMP from
    (G_i e_ij - G_j e_ji) / 2, e_ij the task error from one pose to the other."""
    robot, there = strategy.task.robot, known(q)
    Q, G = q[there], strategy.gain.batch(q[there])[0]
    span = robot.upper - robot.lower
    room = np.minimum(Q - robot.lower, robot.upper - Q)
    near = float(np.mean(room < MARGIN * np.where(np.isfinite(span), span, 0.0)))
    place = np.cumsum(there) - 1
    pairs = poses.pairs[there[poses.pairs].all(axis=1)]
    (i, j), T = place[pairs].T, poses.T[there]
    error = [strategy.task.error(Q[a], T[b, :3, 3], T[b, :3, :3]) for a, b in ((i, j), (j, i))]
    moved = (np.einsum("kij,kj->ki", G[i], error[0]) - np.einsum("kij,kj->ki", G[j], error[1])) / 2
    jumps = float(np.mean(np.abs(Q[j] - Q[i] - moved).max(axis=1) > JUMP)) if len(pairs) else 0.0
    return float(np.sqrt(np.mean(np.sum(G**2, axis=(1, 2)))) * (1 + near + JUMPS * jumps))


def fitting_candidates(
    task: Task, T: Array, center: Matrix, strategies: Sequence[HolonomicStrategy] | None, clear: Clear | None
) -> list[Candidate]:
    """The strategies whose leaves are tried: those given; else of all that fit, those whose leaves serve most at the
    centre.

    Where nothing is redundant there is one: its leaves are the branches of the arm.
    """
    if strategies is not None:
        return [Candidate(strategy.name, {}, task, strategy) for strategy in strategies]
    if task.n == task.m:
        only = holonomic(task, custom(lambda _q: [], rows=0), name="branch")
        return [Candidate("branch", {}, task, only)]
    starts = postures_at(task, center, STARTS)
    starts = starts if len(starts) else regular_starts(task)[:STARTS]
    fitting = [candidate for candidate in candidates(task, starts) if candidate.strategy is not None]
    some = T[:: max(1, len(T) // ROUGH)]
    served = [lines_served(candidate, starts, some, clear, 0.0)[0] for candidate in fitting]
    # Those with the widest leaf, and those that add most to what is served.
    worth = [flags.mean(axis=1).max(initial=0.0) + 0.5 * flags.any(axis=0).mean() for flags in served]
    return [fitting[i] for i in np.argsort(-np.array(worth), kind="stable")[:MOST_STRATEGIES]]


def lines_served(
    candidate: Candidate,
    starts: Matrix,
    T: Array,
    clear: Clear | None,
    rcond: float,
    native: int | None = None,
    levels: Matrix | None = None,
) -> tuple[Flags, Array]:
    """(which poses of T (k, 4, 4) the leaves of a strategy through postures (s, n) serve (s, k), postures (s, k, n)),
    along the straight path from each; levels: of the poses (k, r) for a start, by default that of the start."""
    shape = len(starts), len(T)
    if candidate.strategy is None:
        return np.zeros(shape, dtype=bool), np.zeros((*shape, candidate.task.n))
    try:
        ends = along_leaf(candidate.strategy, starts, T, levels, native, SHORTEST)
    except HolokinError:  # it is singular at a start
        return np.zeros(shape, dtype=bool), np.zeros((*shape, candidate.task.n))
    q = ends.q.reshape(-1, candidate.task.n)
    within = ends.reached.ravel() & candidate.task.robot.within(q)
    return allowed_postures(candidate.strategy, q, within, rcond, clear).reshape(shape), ends.q


def side_by_side(
    strategy: HolonomicStrategy,
    T: Array,
    clear: Clear | None,
    rcond: float,
    native: int | None,
    levels: Matrix | None = None,
) -> Go:
    """The straight paths of a leaf to poses T (k, 4, 4), many side by side; levels: of the poses (k, r), by default
    that of the posture from which a path begins."""

    def go(begin: Matrix, which: Indices) -> tuple[Matrix, Flags]:
        q, reached = one_by_one(strategy, begin, T[which], native, None if levels is None else levels[which])
        return q, allowed_postures(strategy, q, reached & strategy.task.robot.within(q), rcond, clear)

    return go


# --- Strategies whose level is a polynomial of the tool pose, fitted so that one leaf serves more poses.
#
#     g(q) = c(q) - zeta(x)
#
# At a pose x the self-motion leads through many levels of a constraint c(q), and the limits allow some of them. A
# polynomial zeta that is an allowed level at each pose gives a strategy that serves them all on one leaf, g = 0. The
# levels that are allowed are looked at once for each sheet that a search began with; each polynomial then is a linear
# program.

STEPS = 16  # levels on each side of that of the start at most
DEGREES = (1, 2, 3)  # of the polynomials that are tried
POSES_A_TERM = 2  # poses for each coefficient of a polynomial at least: fewer would be served by chance

# Steps of the levels by which a polynomial is to keep within the levels that are allowed, where there is room.
INSIDE = 2.5

# Linear programs, each with weights 1 / (excess + NEAR steps) of the one before: so few poses are missed, rather than
# all by little.
ROUNDS, NEAR = 5, 0.25

SMALL = 0.03  # what a coefficient of one step costs against a pose that is missed by one step


@dataclass(frozen=True, eq=False)
class LevelTable(Value):
    """Which levels (l,) of a strategy the poses T (k, 4, 4) have on one branch: postures q (l, k, n), NaN for none."""

    candidate: Candidate
    T: Array
    levels: Vector
    step: float
    q: Array

    @cached_property
    def coordinates(self) -> Coordinates | None:
        """Those of the polynomials; None where the poses are all alike, or full orientations turn too far."""
        R = self.T[:, :3, :3]
        middle = int(np.argmax(np.einsum("aij,bij->ab", R, R).min(axis=1).round(9)))  # least turn to the farthest
        if not self.allowed.any():
            return None
        try:
            return coordinates_of(chart_of(self.candidate.task, self.T[middle, :3, :3]), self._some[self.allowed])
        except ArgumentError:
            return None

    @cached_property
    def allowed(self) -> Flags:
        """The poses (k,) that have a level."""
        return np.asarray(known(self.q).any(axis=0))

    @cached_property
    def _some(self) -> Matrix:
        """A posture (k, n) at each pose, NaN where there is none."""
        return self.q[np.argmax(known(self.q), axis=0), np.arange(len(self.T))]

    @cached_property
    def ranges(self) -> tuple[Vector, Vector]:
        """The least and the largest level (k,) of the longest row of levels that are allowed; NaN where none is."""
        there, best = known(self.q), np.zeros(len(self.T), dtype=int)
        long, last = np.zeros(len(self.T), dtype=int), np.zeros(len(self.T), dtype=int)
        for i, row in enumerate(there):
            long = np.where(row, long + 1, 0)
            last, best = np.where(long > best, i, last), np.maximum(best, long)
        low, high = self.levels[last - np.maximum(best - 1, 0)], self.levels[last]
        return np.where(best > 0, low, np.nan), np.where(best > 0, high, np.nan)

    def fitted(self, weights: Vector) -> list[tuple[Candidate, Vector, Vector]]:
        """Strategies fitted to the poses, by their weights (k,); of each a posture (n,), and the levels of this
        strategy that it wants at the poses (k,), NaN where none is known."""
        c, strategies = self.coordinates, []
        if c is None:
            return []
        rows = np.flatnonzero(self.allowed)
        u, (low, high) = c.at(self._some[rows]), (bound[rows] for bound in self.ranges)
        for degree in DEGREES:
            terms = monomials_up_to(c.d, degree)
            if POSES_A_TERM * len(terms) > len(rows):
                break
            A, _ = values_and_slopes(u, terms)
            x = _least_excess(A, low, high, self.step, weights[rows])
            if x is None:
                continue
            wanted, room = np.full(len(self.T), np.nan), np.full(len(self.T), -np.inf)
            x = np.round(x, 6 - math.floor(math.log10(self.step)))  # numbers that a job can be read with
            wanted[rows] = A @ x
            room[rows] = np.minimum(wanted[rows] - low, high - wanted[rows])
            if (candidate := self._tilted_candidate(c, x, degree, room, wanted)) is not None:
                strategies.append((*candidate, wanted))
        return strategies

    def _tilted_candidate(
        self, c: Coordinates, x: Vector, degree: int, room: Vector, wanted: Vector
    ) -> tuple[Candidate, Vector] | None:
        """The strategy of a polynomial's coefficients (t,), and its posture at the pose with most room (k,) on both
        sides of the level that it wants there."""
        task, base = self.candidate.task, self.candidate.strategy
        if base is None:
            return None
        pose = int(np.argmax(room))
        level = int(np.argmin(np.where(known(self.q[:, pose]), np.abs(self.levels - wanted[pose]), np.inf)))
        name = f"{self.candidate.name}, level of degree {degree}"
        zeta = Polynomial(c, x[None])
        strategy = holonomic(task, tilted(base.constraint, zeta, chart=c.chart, name=name), name=name)
        q, reached = one_by_one(strategy, self.q[level, pose][None], self.T[pose][None], levels=np.zeros(1))
        if not reached[0] or not task.robot.within(q[0]):
            return None
        return Candidate(name, zeta.keys_over(self.candidate.keys), task, strategy, 0.0), q[0]


def level_table(
    candidate: Candidate,
    strategy: HolonomicStrategy,
    q0: Vector,
    step: float,
    T: Array,
    near: Indices,
    go: Go,
    native: int | None,
) -> LevelTable:
    """The levels of a strategy at poses T (k, 4, 4), on the branch of a posture q0 (n,) of the strategy's own.

    From q0 the self-motion leads to other levels. On each of them the leaf is followed to all poses, first straight,
    then from neighbour to neighbour, and at each pose from level to level, as long as that adds any.

    Args:
        step: between levels [units of c]. near: of each pose its neighbours (k, m). go: straight along the leaf, to
            what is allowed.
    """
    start_pose = pose_from(*candidate.task._poses(q0[None]))
    levels, starts = _along_self_motion(strategy, q0, start_pose, step)
    count, k = len(levels), len(T)
    q = along_leaf(strategy, starts, T, native_from=native)
    rows, poses = np.where(q.reached[..., None], q.q, np.nan).reshape(count * k, -1), np.tile(T, (count, 1, 1))
    rows = _allowed(go, rows, np.arange(count * k) % k)
    beside = (np.tile(near, (count, 1)) + k * np.repeat(np.arange(count), k)[:, None]).astype(int)
    before = -1
    while (now := int(known(rows).sum())) > before:
        before = now
        rows = grown(rows, beside, lambda begin, start_pose: go(begin, start_pose % k))[0]
        for shift in (k, -k):
            start_pose = np.arange(count * k)[:-k] + (k if shift > 0 else 0)
            start_pose = start_pose[known(rows[start_pose - shift]) & ~known(rows[start_pose])]
            if not len(start_pose):
                continue
            there, reached = one_by_one(
                strategy, rows[start_pose - shift], poses[start_pose], native, levels[start_pose // k, None]
            )
            there[~reached] = np.nan
            rows[start_pose] = _allowed(go, there, start_pose % k)
    return LevelTable(candidate, T, levels, step, rows.reshape(count, k, -1))


def _along_self_motion(strategy: HolonomicStrategy, q0: Vector, pose: Array, step: float) -> tuple[Vector, Matrix]:
    """Levels (l,) in order, and the postures (l, n) of them to which the self-motion leads from q0."""
    level = float(strategy.constraint_value.batch(q0[None]).ravel()[0])
    levels = [(level, q0)]
    for sign in (1, -1):
        q = q0[None]
        for i in range(1, STEPS + 1):
            q, reached = one_by_one(strategy, q, pose, levels=np.array([level + sign * i * step]))
            if not reached[0] or not strategy.task.robot.within(q[0]):
                break
            levels.append((level + sign * i * step, q[0]))
    levels.sort(key=lambda level_and_q: level_and_q[0])
    return np.array([level_and_q[0] for level_and_q in levels]), np.array([level_and_q[1] for level_and_q in levels])


def _allowed(go: Go, q: Matrix, poses: Indices) -> Matrix:
    """Postures (k, n) at their poses, by their numbers (k,); NaN where they are not there, or not allowed."""
    rows = np.flatnonzero(known(q))
    if not len(rows):
        return q
    there, served = go(q[rows], poses[rows])
    q[rows] = np.where(served[:, None], there, np.nan)
    return q


def _least_excess(A: Matrix, low: Vector, high: Vector, step: float, weights: Vector) -> Vector | None:
    """Coefficients x (t,) with low <= A x <= high at as many rows as can be, by linear programs; None if they fail."""
    from scipy.optimize import linprog
    from scipy.sparse import csr_array, eye_array, hstack, vstack

    inside = np.minimum(INSIDE * step, (high - low) / 2)
    low, high = (low + inside) / step, (high - inside) / step
    (k, t), weigh, x = A.shape, weights, None
    rows = csr_array(A)
    out = vstack([hstack([rows, -rows, -eye_array(k)]), hstack([-rows, rows, -eye_array(k)])])
    for _ in range(ROUNDS):
        cost = np.concatenate([np.full(2 * t, SMALL), weigh])
        program = linprog(cost, A_ub=out, b_ub=np.concatenate([high, -low]), method="highs")
        if program.x is None:
            break
        x = step * (program.x[:t] - program.x[t : 2 * t])
        weigh = weights / (program.x[2 * t :] + NEAR)
    return x
