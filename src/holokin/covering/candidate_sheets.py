"""The sheets that a cover is chosen from: leaves of laws that fit the task, through postures all over the workspace."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ..base.poses import pose_from
from ..base.types import Array, Flags, Indices, Matrix, Vector
from ..checking import Clear
from ..constraints import custom, linear
from ..designing import regular_starts
from ..designing.candidates import Candidate, candidates
from ..designing.line_ends import along_leaf, one_by_one
from ..designing.starts import postures_at
from ..errors import HolokinError
from ..strategies import HolonomicStrategy, holonomic
from ..tasks.task import Task
from .fitted_levels import LevelTable, level_table
from .pose_features import nearby, neighbours, turn_length
from .sheet import Sheet, allowed_postures, known
from .sheet_growth import Go, grown, one_function

LAWS = 6
"""Laws of which leaves are looked at all over the workspace. On a Panda the first three made up the cover."""

ROUGH = 64
"""Poses by which laws are put in order."""

STARTS, BEST = 8, 2
"""Postures at one pose through which leaves of each law are tried on few poses, and those that are tried on all."""

OTHERS = 0.05
"""Weight of a pose anywhere, beside one that the widest sheet does not serve, where leaves are tried on few poses."""

LEVELS = 4
"""Levels next to that of a sheet, and laws next to its law, that are tried in a round."""

SPREAD, BEND = 0.5, 0.4
"""How far off the other levels are at first, as a share of the level's spread over postures of the start's pose; and
the coefficients of the other laws, as a share of the largest one."""

CLOSER = 0.6
"""Both shrink so in each round."""

NATIVE, MANY = 64, 300
"""Lines side by side from which on native code runs, and poses from which on building it pays; not for laws that are
tried once."""

LEVEL_STEP = 0.17
"""Step between the levels of a table, as a share of the level's spread over postures of the start's pose."""

SAME = 1e-6
"""Spread of levels [units of g] up to which they are one."""

CLOSEST = 4
"""Neighbours from which a candidate tries to reach a pose; a sheet that is chosen tries all."""

MARGIN = 0.1
"""Share of a joint's range next to a limit that counts as near it."""


@dataclass(eq=False)
class CandidateSheets:
    """Sheets, with the poses T (k, 4, 4) that each serves; they grow while a cover is looked for.

    laws: whose leaves are tried. own: whether laws may be made besides. served: a row of flags (k,) a sheet, found by
    many lines side by side, which may be wrong at a few poses; `exact` asks the sheet itself. costs: of each, see
    `_cost`. asked: the sheets that were; others: those of other postures of a leaf, which bring no more of them.
    parents: of a sheet that was made next to another one, that one, whose branch it is on; tables: of each, the levels
    of its law; fits: to which tables and weights polynomials were fitted.
    """

    task: Task
    T: Array
    laws: Sequence[Candidate]
    clear: Clear | None
    rcond: float
    own: bool
    sheets: list[Sheet] = field(default_factory=list)
    served: list[Flags] = field(default_factory=list)
    costs: list[float] = field(default_factory=list)
    tried: int = 0
    asked: set[int] = field(default_factory=set)
    others: set[int] = field(default_factory=set)
    parents: dict[int, int] = field(default_factory=dict)
    tables: dict[int, LevelTable | None] = field(default_factory=dict)
    fits: set[tuple[int, bytes]] = field(default_factory=set)

    @property
    def sets(self) -> Flags:
        """Which sheet serves which pose (c, k)."""
        return np.array(self.served, dtype=bool).reshape(-1, len(self.T))

    @property
    def _native(self) -> int | None:
        """Lines from which on native code runs; None for as many as is usual."""
        return NATIVE if len(self.T) >= MANY else None

    @cached_property
    def near(self) -> Indices:
        """Of each pose its neighbours (k, m)."""
        return nearby(self.T, turn_length(self.task))

    @cached_property
    def pairs(self) -> Indices:
        """Pairs (e, 2) of neighbours."""
        return neighbours(self.T, turn_length(self.task))

    def grow(self, at: Matrix, wanted: Indices, end: float, say: Callable[[str], None]) -> None:
        """Adds leaves of all laws through postures at a tool pose (4, 4): of each law those that serve most.

        Args:
            wanted: poses that are to be served first. end: time of the clock [s] after which no more are looked at.
        """
        starts = postures_at(self.task, at, STARTS)
        if self.clear is not None and len(starts):
            starts = starts[self.clear(starts)]
        if not len(starts):
            return
        every = np.arange(0, len(self.T), max(1, len(self.T) // ROUGH))
        first = wanted[:ROUGH]
        some, weights = np.concatenate([first, every]), np.repeat([1.0, OTHERS], [len(first), len(every)])
        for law in self.laws:
            if time.monotonic() > end and self.sheets:
                return
            say(f"{law.name}, {self.tried} leaves so far")
            some_served, _ = _lines_served(law, starts, self.T[some], self.clear, self.rcond, self._native)
            known_already = np.array([(one <= self.sets[:, some]).all(axis=1).any() for one in some_served])
            found: Vector = np.where(known_already, 0.0, some_served.astype(float) @ weights)
            self.tried += len(starts)
            best = [i for i in np.argsort(-found, kind="stable")[:BEST] if found[i] > 0]
            self.add(law, starts[best])

    def add(self, law: Candidate, starts: Matrix, once: bool = False) -> None:
        """The sheets of a law through postures (s, n); once: the law is new, and may not be looked at again."""
        if law.strategy is None or not len(starts):
            return
        native = None if once else self._native
        go = _side_by_side(law.strategy, self.clear, self.rcond, native)
        served, straight = _lines_served(law, starts, self.T, self.clear, self.rcond, native)
        for q0, flags, postures in zip(starts, served, straight, strict=True):
            if flags.any():
                q, _ = grown(np.where(flags[:, None], postures, np.nan), self.near[:, :CLOSEST], self.T, go)
                keys = {key: value for key, value in law.keys.items() if key != "level"}
                cost = _cost(law.strategy, q[known(q)])  # before the three lists: Ctrl-C leaves them of one length
                self.sheets.append(Sheet(law.strategy, q0, self.rcond, keys))
                self.served.append(known(q))
                self.costs.append(cost)

    def vary(self, which: Indices, rng: np.random.Generator, round_: int, end: float) -> None:
        """Adds sheets next to some of them: on other levels of their laws, and of laws with other coefficients, or with
        a level that is a polynomial of the pose."""
        for i in map(int, which):
            sheet, before = self.sheets[i], len(self.sheets)
            if time.monotonic() > end or not len(sheet.level):
                return
            law = Candidate(sheet.name, sheet.keys, self.task, sheet.strategy)
            fitted = self._fitted(i, self._weights(i, which, rng)) if self.own else []
            for one, q0 in fitted:
                self.add(one, q0[None], once=True)
            if not fitted:
                self.add(law, self._on_other_levels(sheet, rng, round_))
                for one in self._bent(sheet, rng, round_) if self.own else []:
                    self.add(one, sheet.q0[None], once=True)
            self.tried += LEVELS
            for child in range(before, len(self.sheets)):
                self.parents[child] = self.parents.get(i, i)

    def _fitted(self, i: int, weights: Vector) -> list[tuple[Candidate, Vector]]:
        """Laws whose level is a polynomial of the pose, on the branch of a sheet, each with a posture (n,); none where
        there is no number for a level, or where the same fit was made before."""
        parent = self.parents.get(i, i)
        fit = parent, weights.tobytes()
        if fit in self.fits or (table := self._table(parent)) is None:
            return []
        self.fits.add(fit)
        return table.fitted(weights)

    def _weights(self, i: int, which: Indices, rng: np.random.Generator) -> Vector:
        """Of the poses (k,) for a sheet that is to serve what the other chosen ones do not, or one of them alone."""
        others = [j for j in which.tolist() if j != i]
        if others:
            del others[rng.integers(len(others))]
        return np.where(self.sets[others].any(axis=0), OTHERS, 1.0)

    def _table(self, i: int) -> LevelTable | None:
        """The levels of a sheet's law at the poses, on its branch; None where there is no number for a level."""
        if i not in self.tables:
            sheet, table = self.sheets[i], None
            designed = sheet.keys.get("kind") == "designed"  # a job has no design over another one
            one_level = self.task.n - self.task.m == 1 and not designed
            if one_level and (spread := self._spread(sheet)) is not None and spread[0] > SAME:
                law = Candidate(sheet.name, sheet.keys, self.task, sheet.strategy)
                go = _side_by_side(sheet.strategy, self.clear, self.rcond, self._native)
                step = float(spread[0]) * LEVEL_STEP
                table = level_table(
                    law, sheet.strategy, sheet.q0, step, self.T, self.near[:, :CLOSEST], go, self._native
                )
            self.tables[i] = table
        return self.tables[i]

    def _on_other_levels(self, sheet: Sheet, rng: np.random.Generator, round_: int) -> Matrix:
        """Postures at the pose of a sheet's start, on levels about its own."""
        at, spread, found = pose_from(*self.task.poses(sheet.q0[None]))[0], self._spread(sheet), []
        if spread is None:
            return np.zeros((0, self.task.n))
        for _ in range(LEVELS):
            level = sheet.level + SPREAD * CLOSER**round_ * spread * rng.standard_normal(len(sheet.level))
            ends = along_leaf(sheet.strategy, sheet.q0[None], at[None], level)
            if ends.reached.all() and self.task.robot.within(ends.q[0, 0]):
                found.append(ends.q[0, 0])
        return np.array(found).reshape(-1, self.task.n)

    def _spread(self, sheet: Sheet) -> Vector | None:
        """How far the levels (r,) of postures at the pose of a sheet's start are off its own; None where none is."""
        others = postures_at(self.task, pose_from(*self.task.poses(sheet.q0[None]))[0], STARTS)
        if not len(others):
            return None
        levels = sheet.strategy.constraint_value.batch(others).reshape(len(others), -1)
        gap = sheet.strategy.constraint.nearest(levels - sheet.level)
        return np.asarray(np.sqrt(np.mean(gap**2, axis=0)))

    def _bent(self, sheet: Sheet, rng: np.random.Generator, round_: int) -> list[Candidate]:
        """Linear laws whose coefficients are near those of a sheet's law, if that is linear."""
        A = _coefficients(self.task, sheet)
        if A is None:
            return []
        found = []
        for _ in range(LEVELS):
            B = A + BEND * CLOSER**round_ * np.abs(A).max() * rng.standard_normal(A.shape)
            B = np.round(B / np.linalg.norm(B, axis=1, keepdims=True), 4)
            rows = " ".join(f"[{', '.join(f'{value:.4g}' for value in row)}]" for row in B)
            name = f"linear {rows}"
            keys = {"kind": "linear", "matrix": B.tolist()}
            found.append(Candidate(name, keys, self.task, holonomic(self.task, linear(B, name=name), name=name)))
        return found

    def exact(self, which: Indices) -> bool:
        """Asks some sheets themselves which poses they serve, as one function; returns whether that changed anything.

        Where a leaf comes to one pose with two postures, the sheet of the other one becomes a candidate.
        """
        changed = False
        for i in which.tolist():
            if i in self.asked:
                continue
            sheet, clear = self.sheets[i], self.clear

            def go(begin: Matrix, poses: Array, sheet: Sheet = sheet) -> tuple[Matrix, Flags]:
                return sheet.reached(begin, poses, clear)

            q, wave = grown(sheet.reached(np.tile(sheet.q0, (len(self.T), 1)), self.T, clear)[0], self.near, self.T, go)
            q, others = one_function(q, wave, self.pairs, self.T, go)
            there = known(q)
            asked, flags = replace(sheet, stations=q[there], places=self.T[there]), self.served[i]
            self.sheets[i], self.served[i] = asked, there
            self.asked.add(i)  # not before: Ctrl-C leaves it to be asked again
            changed |= not np.array_equal(there, flags)
            if len(others) and i not in self.others:
                before, law = len(self.sheets), Candidate(sheet.name, sheet.keys, self.task, sheet.strategy)
                self.add(law, others[[len(others) // 2]])
                self.others.update(range(before, len(self.sheets)))
                changed = True
        return changed


def _coefficients(task: Task, sheet: Sheet) -> Matrix | None:
    """The matrix (r, n) of a sheet's law, if it is linear in the joints; else None."""
    if sheet.keys.get("kind") == "linear":
        return np.atleast_2d(np.asarray(sheet.keys["matrix"], dtype=float))
    if sheet.keys.get("kind") == "lock":
        return np.eye(task.n)[[task.robot.joint_index(joint) for joint in sheet.keys["joints"]]]
    return None


def _cost(strategy: HolonomicStrategy, Q: Matrix) -> float:
    """Of postures (k, n): the mean of |G|, over what it is at the least, and of the share of joints near a limit."""
    G = strategy.gain.batch(Q)[0]
    robot = strategy.task.robot
    span = robot.upper - robot.lower
    room = np.minimum(Q - robot.lower, robot.upper - Q)
    near = float(np.mean(room < MARGIN * np.where(np.isfinite(span), span, 0.0)))
    return float(np.sqrt(np.mean(np.sum(G**2, axis=(1, 2)))) * (1 + near))


def fitting_laws(
    task: Task, T: Array, center: Matrix, strategies: Sequence[HolonomicStrategy] | None, clear: Clear | None
) -> list[Candidate]:
    """The laws whose leaves are tried: those given; else of all that fit, those whose leaves serve most at the centre.

    Where nothing is redundant there is one: its leaves are the branches of the arm.
    """
    if strategies is not None:
        return [Candidate(one.name, {}, task, one) for one in strategies]
    if task.n == task.m:
        only = holonomic(task, custom(lambda _q: [], rows=0), name="branch")
        return [Candidate("branch", {}, task, only)]
    starts = postures_at(task, center, STARTS)
    starts = starts if len(starts) else regular_starts(task)[:STARTS]
    found = [one for one in candidates(task, starts) if one.strategy is not None]
    some = T[:: max(1, len(T) // ROUGH)]
    sizes = [_lines_served(one, starts, some, clear, 0.0)[0] for one in found]
    return [found[i] for i in _best(sizes, len(found))]


def _lines_served(
    law: Candidate, starts: Matrix, T: Array, clear: Clear | None, rcond: float, native: int | None = None
) -> tuple[Flags, Array]:
    """(which poses of T (k, 4, 4) the leaves of a law through postures (s, n) serve (s, k), postures (s, k, n)), along
    the straight path from each."""
    shape = len(starts), len(T)
    if law.strategy is None:
        return np.zeros(shape, dtype=bool), np.zeros((*shape, law.task.n))
    try:
        ends = along_leaf(law.strategy, starts, T, native_from=native)
    except HolokinError:  # it is singular at a start
        return np.zeros(shape, dtype=bool), np.zeros((*shape, law.task.n))
    q = ends.q.reshape(-1, law.task.n)
    within = ends.reached.ravel() & law.task.robot.within(q)
    return allowed_postures(law.strategy, q, within, rcond, clear).reshape(shape), ends.q


def _side_by_side(strategy: HolonomicStrategy, clear: Clear | None, rcond: float, native: int | None) -> Go:
    """The straight paths of a leaf, many side by side."""

    def go(begin: Matrix, poses: Array) -> tuple[Matrix, Flags]:
        q, reached = one_by_one(strategy, begin, poses, native)
        return q, allowed_postures(strategy, q, reached & strategy.task.robot.within(q), rcond, clear)

    return go


def _best(served: list[Flags], count: int) -> Indices:
    """The laws with the widest leaf, and those that add most to what is served: the first LAWS of them."""
    widest = np.array([flags.mean(axis=1).max(initial=0.0) for flags in served])
    together = np.array([flags.any(axis=0).mean() for flags in served])
    order = np.argsort(-(widest + 0.5 * together), kind="stable")
    return np.asarray(order[: min(LAWS, count)], dtype=int)
