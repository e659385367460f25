"""The sheets that a cover is chosen from: leaves of strategies that fit the task, through postures all over the
workspace."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np

from ...base.poses import pose_from
from ...base.types import Array, Flags, Indices, Matrix, Vector
from ...motion.checks import Clear
from ...strategies import holonomic
from ...strategies.constraints import linear
from ...strategies.tasks.task import Task
from ..coverage.leaf_lines import along_leaf
from ..coverage.starts import Candidate, postures_at
from .set_cover import ROUND, not_within_another
from .sheet import Sheet, known, spread_out
from .sheet_growth import (
    ROUGH,
    STARTS,
    LevelTable,
    SearchedPoses,
    cost_of,
    fitting_candidates,
    grown,
    level_table,
    lines_served,
    one_function,
    side_by_side,
)

# Of the postures at one pose through which leaves of a strategy are tried on few poses, those that are tried on all.
BEST = 2

# Weight of a pose anywhere, beside one that the widest sheet does not serve, where leaves are tried on few poses.
OTHERS = 0.05

LEVELS = 4  # levels next to that of a sheet, and strategies next to its strategy, that are tried in a round

# How far off the other levels are at first, as a share of the level's spread over postures of the start's pose; and
# the coefficients of the other strategies, as a share of the largest one.
SPREAD, BEND = 0.5, 0.4

CLOSER = 0.6  # both shrink so in each round

# Lines side by side from which on native code runs, and poses from which on building it pays; not for strategies that
# are tried once.
NATIVE, MANY = 16, 300

# Step between the levels of a table, as a share of the level's spread over postures of the start's pose.
LEVEL_STEP = 0.17

VARIED = 4  # sheets of a choice next to which others are looked for in a round, the widest one among them
SAME = 1e-6  # spread of levels [units of g] up to which they are one

# Standard errors of a sampled share by which it is to exceed what is wanted, where no more sheets are needed for it:
# else of other poses about every second choice serves less.
SPARE = 1.0

# What the name of a strategy begins with whose coefficients are near those of another: the coefficients are in its
# keys.
NEAR = "linear, near "

CLOSEST = 4  # neighbours from which a candidate tries to reach a pose; a sheet that is chosen tries all


class Wanted(NamedTuple):
    """Numbers of poses: that are to be served at least, and that are preferred where no more sheets are needed."""

    least: float
    preferred: float

    @staticmethod
    def of(share: float, count: int) -> Wanted:
        """For a share of `count` poses."""
        return Wanted(share * count - ROUND, share * count + SPARE * np.sqrt(share * (1 - share) * count))


@dataclass(eq=False)
class CandidateSheet:
    """A sheet that a cover may have, and what is known of it.

    served: which of the poses that are searched it serves (k,), found by many lines side by side, which may be wrong
    at a few poses, until it was asked. cost: see `cost_of`. once: whether its strategy was made for it alone. parent:
    the sheet from which a search came to it, on the same branch. other: whether it is another posture of a leaf, which
    brings no more of them. table: the levels of its strategy, None where there are none; False where not looked at yet.
    """

    sheet: Sheet
    served: Flags
    cost: float
    once: bool = False
    parent: CandidateSheet | None = None
    asked: bool = False
    other: bool = False
    table: LevelTable | Literal[False] | None = False

    @property
    def candidate(self) -> Candidate:
        """The strategy of the sheet."""
        return Candidate(self.sheet.name, self.sheet.keys, self.sheet.strategy.task, self.sheet.strategy)


@dataclass(eq=False)
class CandidateSheets:
    """Sheets, with the poses that each serves; they grow while a cover is looked for.

    poses: that are searched. candidates: whose leaves are tried. own: whether strategies may be made besides. share: of
    the poses, that is wanted. fits: to which tables and weights polynomials were fitted.
    """

    task: Task
    poses: SearchedPoses
    candidates: Sequence[Candidate]
    clear: Clear | None
    rcond: float
    own: bool
    share: float = 1.0
    found: list[CandidateSheet] = field(default_factory=list)
    tried: int = 0
    fits: set[tuple[int, bytes]] = field(default_factory=set)

    @property
    def T(self) -> Array:
        """The poses (k, 4, 4) that are searched."""
        return self.poses.T

    @property
    def wanted(self) -> Wanted:
        """How many of the poses in question are wanted."""
        return Wanted.of(self.share, len(self.poses.reach))

    @property
    def costs(self) -> Vector:
        """Of each sheet (c,), from 0 for the cheapest one to 1."""
        costs = np.array([sheet.cost for sheet in self.found])
        return np.asarray(1.0 - costs.min(initial=np.inf) / costs)

    @property
    def sets(self) -> Flags:
        """Which sheet serves which pose (c, k)."""
        return np.array([sheet.served for sheet in self.found], dtype=bool).reshape(-1, len(self.T))

    @property
    def _native(self) -> int | None:
        """Lines from which on native code runs; None for as many as is usual."""
        return NATIVE if len(self.T) >= MANY else None

    def grow(self, pose: Matrix, wanted: Indices, end: float, progress: Callable[[str], None]) -> None:
        """Adds leaves of all strategies through postures at a tool pose (4, 4): of each strategy those that serve most.

        Args:
            wanted: poses that are to be served first. end: time of the clock [s] after which no more are looked at.
        """
        starts = postures_at(self.task, pose, STARTS)
        if self.clear is not None and len(starts):
            starts = starts[self.clear(starts)]
        if not len(starts):
            return
        every = np.arange(0, len(self.T), max(1, len(self.T) // ROUGH))
        first = wanted[:: max(1, len(wanted) // ROUGH)]
        some = np.concatenate([first, every])
        weights = np.repeat([1.0, OTHERS], [len(first), len(every)]) * self.poses.weights[some]
        for candidate in self.candidates:
            if time.monotonic() > end and self.found:
                return
            progress(f"{candidate.name}, {self.tried} leaves so far")
            some_served, _ = lines_served(candidate, starts, self.T[some], self.clear, self.rcond, self._native)
            known_already = np.array([(flags <= self.sets[:, some]).all(axis=1).any() for flags in some_served])
            gains: Vector = np.where(known_already, 0.0, some_served.astype(float) @ weights)
            self.tried += len(starts)
            best = [i for i in np.argsort(-gains, kind="stable")[:BEST] if gains[i] > 0]
            self.add(candidate, starts[best])

    def add(
        self,
        candidate: Candidate,
        starts: Matrix,
        once: bool = False,
        parent: CandidateSheet | None = None,
        levels: Vector | None = None,
    ) -> None:
        """The sheets of a strategy through postures (s, n).

        once: the strategy is new, and may not be looked at again. levels: of the parent's strategy at the poses (k,),
        where the strategy is that strategy with a level that depends on the pose.
        """
        if candidate.strategy is None or not len(starts):
            return
        keys = {key: value for key, value in candidate.keys.items() if key != "level"}
        for q0, served, cost in self._grown(candidate, starts, once, parent, levels):
            if served.any():
                self.found.append(
                    CandidateSheet(Sheet(candidate.strategy, q0, self.rcond, keys), served, cost, once, parent)
                )

    def _grown(
        self,
        candidate: Candidate,
        starts: Matrix,
        once: bool,
        parent: CandidateSheet | None = None,
        levels: Vector | None = None,
    ) -> Iterator[tuple[Vector, Flags, float]]:
        """(posture, which poses its leaf serves (k,), cost) for each of some postures (s, n) of a strategy."""
        if (strategy := candidate.strategy) is None:
            return
        by, native, c = candidate, None if once else self._native, None
        if parent is not None and levels is not None:  # the parent's strategy is shorter, and has its native code
            by, native, c = parent.candidate, None if parent.once else self._native, levels[:, None]
        go = side_by_side(by.strategy or strategy, self.T, self.clear, self.rcond, native, c)
        served, straight = lines_served(by, starts, self.T, self.clear, self.rcond, native, c)
        for q0, flags, postures in zip(starts, served, straight, strict=True):
            q, cost = np.full(postures.shape, np.nan), np.inf
            if flags.any():
                q, _ = grown(np.where(flags[:, None], postures, np.nan), self.poses.near[:, :CLOSEST], go)
                cost = cost_of(strategy, q, self.poses)
            yield q0, known(q), cost

    def worth(self, chosen: Indices) -> Indices:
        """Sheets chosen, and those that are not within another one."""
        return np.union1d(not_within_another(self.sets, self.costs), chosen)

    def look_at(self, poses: SearchedPoses, which: Indices) -> None:
        """Searches other poses from now on: what some of the sheets serve of them is found again; the others are left.

        The sheets on whose branches they are stay, too.
        """
        stay = [self.found[i] for i in which]
        parents = [entry.parent for entry in stay if entry.parent is not None]
        before, self.poses, updates = self.poses, poses, []
        try:
            for entry in dict.fromkeys([*stay, *parents]):
                ((_, served, cost),) = self._grown(entry.candidate, entry.sheet.q0[None], entry.once)
                updates.append((entry, served, cost))
        except KeyboardInterrupt:
            self.poses = before
            raise
        for entry, served, cost in updates:
            entry.served, entry.cost, entry.asked, entry.table = served, cost, False, False
        self.found, self.fits = [entry for entry, _, _ in updates], set()

    def add_candidates(self, left: Indices) -> None:
        """The strategies that fit some of the poses best are tried, too."""
        if self.own and len(left):
            T, known_already = self.T[left], {candidate.name for candidate in self.candidates}
            center = T[spread_out(T, np.arange(len(T)), 1, self.poses.length)[0]]
            more = fitting_candidates(self.task, T, center, None, self.clear)
            self.candidates = [
                *self.candidates,
                *(candidate for candidate in more if candidate.name not in known_already),
            ]

    def vary(self, which: Indices, rng: np.random.Generator, round_: int, end: float) -> None:
        """Adds sheets next to some of them: on other levels of their strategies, and of strategies with other
        coefficients, or with a level that is a polynomial of the pose."""
        some = which[1:][rng.permutation(len(which) - 1)[: VARIED - 1]] if len(which) > VARIED else which[1:]
        for i in [*which[:1].tolist(), *some.tolist()]:
            entry = self.found[i]
            if time.monotonic() > end or not len(entry.sheet.level):
                return
            parent = entry.parent or entry
            fitted = self._fitted(parent, self._weights(i, which, rng)) if self.own else []
            for candidate, q0, levels in fitted:
                self.add(candidate, q0[None], True, parent, levels)
            if not fitted:
                self.add(entry.candidate, self._on_other_levels(entry.sheet, rng, round_), parent=parent)
                for candidate in self._bent(entry.sheet, rng, round_) if self.own else []:
                    self.add(candidate, entry.sheet.q0[None], once=True, parent=parent)
            self.tried += LEVELS

    def _fitted(self, parent: CandidateSheet, weights: Vector) -> list[tuple[Candidate, Vector, Vector]]:
        """Strategies whose level is a polynomial of the pose, on the branch of a sheet, each as of `LevelTable.fitted`;
        none where there is no number for a level, or where the same fit was made before."""
        fit = id(parent), weights.tobytes()
        if fit in self.fits or (table := self._table(parent)) is None:
            return []
        self.fits.add(fit)
        return table.fitted(weights)

    def _weights(self, i: int, which: Indices, rng: np.random.Generator) -> Vector:
        """Of the poses (k,) for a sheet that is to serve what the other chosen ones do not, or one of them alone."""
        others = [j for j in which.tolist() if j != i]
        if others:
            del others[rng.integers(len(others))]
        return self.poses.weights * np.where(self.sets[others].any(axis=0), OTHERS, 1.0)

    def _table(self, entry: CandidateSheet) -> LevelTable | None:
        """The levels of a sheet's strategy at the poses, on its branch; None where there is no number for a level."""
        if entry.table is False:
            sheet, table = entry.sheet, None
            designed = sheet.keys.get("kind") == "designed"  # a job has no design over another one
            one_level = self.task.n - self.task.m == 1 and not designed
            if one_level and (spread := self._spread(sheet)) is not None and spread[0] > SAME:
                go = side_by_side(sheet.strategy, self.T, self.clear, self.rcond, self._native)
                step = float(spread[0]) * LEVEL_STEP
                near = self.poses.near[:, :CLOSEST]
                table = level_table(entry.candidate, sheet.strategy, sheet.q0, step, self.T, near, go, self._native)
            entry.table = table
        return entry.table

    def _on_other_levels(self, sheet: Sheet, rng: np.random.Generator, round_: int) -> Matrix:
        """Postures at the pose of a sheet's start, on levels about its own."""
        pose, spread, postures = pose_from(*self.task._poses(sheet.q0[None]))[0], self._spread(sheet), []
        if spread is None:
            return np.zeros((0, self.task.n))
        for _ in range(LEVELS):
            level = sheet.level + SPREAD * CLOSER**round_ * spread * rng.standard_normal(len(sheet.level))
            ends = along_leaf(sheet.strategy, sheet.q0[None], pose[None], level)
            if ends.reached.all() and self.task.robot.within(ends.q[0, 0]):
                postures.append(ends.q[0, 0])
        return np.array(postures).reshape(-1, self.task.n)

    def _spread(self, sheet: Sheet) -> Vector | None:
        """How far the levels (r,) of postures at the pose of a sheet's start are off its own; None where none is."""
        others = postures_at(self.task, pose_from(*self.task._poses(sheet.q0[None]))[0], STARTS)
        if not len(others):
            return None
        levels = sheet.strategy.constraint_value.batch(others).reshape(len(others), -1)
        gap = sheet.strategy.constraint.nearest(levels - sheet.level)
        return np.asarray(np.sqrt(np.mean(gap**2, axis=0)))

    def _bent(self, sheet: Sheet, rng: np.random.Generator, round_: int) -> list[Candidate]:
        """Linear strategies whose coefficients are near those of a sheet's strategy, if that is linear."""
        A = _coefficients(self.task, sheet)
        if A is None:
            return []
        candidates = []
        for _ in range(LEVELS):
            B = A + BEND * CLOSER**round_ * np.abs(A).max() * rng.standard_normal(A.shape)
            B = np.round(B / np.linalg.norm(B, axis=1, keepdims=True), 4)
            name = sheet.name if sheet.name.startswith(NEAR) else NEAR + sheet.name
            keys = {"kind": "linear", "matrix": B.tolist()}
            candidates.append(Candidate(name, keys, self.task, holonomic(self.task, linear(B, name=name), name=name)))
        return candidates

    def exact(self, which: Indices) -> bool:
        """Asks some sheets themselves which poses they serve, as one function; returns whether that changed anything.

        Where a leaf comes to one pose with two postures, the sheet of the other one becomes a candidate.
        """
        changed = False
        for entry in [self.found[i] for i in which]:
            if entry.asked:
                continue
            sheet, clear = entry.sheet, self.clear

            def go(begin: Matrix, which_poses: Indices, sheet: Sheet = sheet) -> tuple[Matrix, Flags]:
                return sheet.reached(begin, self.T[which_poses], clear)

            straight = sheet.reached(np.tile(sheet.q0, (len(self.T), 1)), self.T, clear)[0]
            q, wave = grown(straight, self.poses.near, go)
            q, others = one_function(q, wave, self.poses.pairs, go)
            there = known(q)
            changed |= not np.array_equal(there, entry.served)
            entry.sheet, entry.served = replace(sheet, stations=q[there], places=self.T[there]), there
            entry.asked = True  # not before: Ctrl-C leaves it to be asked again
            if len(others) and not entry.other:
                before = len(self.found)
                self.add(entry.candidate, others[[len(others) // 2]])
                for other in self.found[before:]:
                    other.other = True
                changed = True
        return changed


def _coefficients(task: Task, sheet: Sheet) -> Matrix | None:
    """The matrix (r, n) of a sheet's strategy, if it is linear in the joints; else None."""
    if sheet.keys.get("kind") == "linear":
        return np.atleast_2d(np.asarray(sheet.keys["matrix"], dtype=float))
    if sheet.keys.get("kind") == "lock":
        return np.eye(task.n)[[task.robot.joint_index(joint) for joint in sheet.keys["joints"]]]
    return None
