"""The sheets that a cover is chosen from: leaves of laws that fit the task, through postures all over the workspace."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..base.types import Array, Flags, Indices, Matrix, Vector
from ..checking import Clear
from ..constraints import custom
from ..designing import regular_starts
from ..designing.candidates import Candidate, candidates
from ..designing.line_ends import along_leaf
from ..designing.starts import postures_at
from ..errors import HolokinError
from ..strategies import HolonomicStrategy, holonomic
from ..tasks.task import Task
from .sheet import Sheet

LAWS = 6
"""Laws of which leaves are looked at all over the workspace. On a Panda the first three made up the cover."""

ROUGH = 64
"""Poses by which laws are put in order."""

STARTS, BEST = 8, 3
"""Postures at one pose through which leaves of each law are tried on few poses, and those that are tried on all."""

OTHERS = 0.05
"""Weight of a pose anywhere, beside one that the widest sheet does not serve, where leaves are tried on few poses."""

CENTRES = 4
"""Other postures of a sheet from which it is tried again."""

MARGIN = 0.1
"""Share of a joint's range next to a limit that counts as near it."""


@dataclass(eq=False)
class CandidateSheets:
    """Sheets, with the poses T (k, 4, 4) that each serves; they grow while a cover is looked for.

    laws: whose leaves are tried. served: a row of flags (k,) a sheet, found by many lines side by side, which may be
    wrong at a few poses; `exact` asks the sheet itself. costs: of each, see `_cost`.
    """

    task: Task
    T: Array
    laws: Sequence[Candidate]
    clear: Clear | None
    rcond: float
    sheets: list[Sheet] = field(default_factory=list)
    served: list[Flags] = field(default_factory=list)
    costs: list[float] = field(default_factory=list)
    tried: int = 0
    asked: set[int] = field(default_factory=set)

    @property
    def sets(self) -> Flags:
        """Which sheet serves which pose (c, k)."""
        return np.array(self.served, dtype=bool).reshape(-1, len(self.T))

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
            found: Vector = _lines_served(law, starts, self.T[some], self.clear, self.rcond)[0].astype(float) @ weights
            self.tried += len(starts)
            best = [i for i in np.argsort(-found, kind="stable")[:BEST] if found[i] > 0]
            self.add(law, starts[best])

    def add(self, law: Candidate, starts: Matrix) -> None:
        """The sheets of a law through postures (s, n)."""
        if law.strategy is None or not len(starts):
            return
        served, q = _lines_served(law, starts, self.T, self.clear, self.rcond)
        for q0, flags, postures in zip(starts, served, q, strict=True):
            if flags.any():
                keys = {key: value for key, value in law.keys.items() if key != "level"}
                self.sheets.append(Sheet(law.strategy, q0, self.rcond, keys))
                self.served.append(flags)
                self.costs.append(_cost(law.strategy, postures[flags]))

    def recentre(self, which: Indices, rng: np.random.Generator, end: float) -> None:
        """Adds the leaves of some sheets from other postures of them: straight paths from there serve other poses."""
        for i in which.tolist():
            served = np.flatnonzero(self.served[i])
            some = rng.choice(served, min(CENTRES, len(served)), replace=False)
            if time.monotonic() < end:
                law = Candidate(self.sheets[i].name, self.sheets[i].keys, self.task, self.sheets[i].strategy)
                q = _lines_served(law, self.sheets[i].q0[None], self.T[some], self.clear, self.rcond)[1][0]
                self.tried += len(some)
                self.add(law, q[self.task.robot.within(q)])

    def exact(self, which: Indices) -> bool:
        """Asks some sheets themselves which poses they serve; returns whether that changed anything."""
        changed = False
        for i in which.tolist():
            if i not in self.asked:
                served = self.sheets[i].postures(self.T, self.clear)[1]
                changed |= not np.array_equal(served, self.served[i])
                self.served[i] = served
                self.asked.add(i)
        return changed


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


def _lines_served(law: Candidate, starts: Matrix, T: Array, clear: Clear | None, rcond: float) -> tuple[Flags, Array]:
    """(which poses of T (k, 4, 4) the leaves of a law through postures (s, n) serve (s, k), postures (s, k, n))."""
    robot, strategy = law.task.robot, law.strategy
    served, q = np.zeros((len(starts), len(T)), dtype=bool), np.zeros((len(starts), len(T), robot.n))
    if strategy is None:
        return served, q
    try:
        ends = along_leaf(strategy, starts, T)
    except HolokinError:  # it is singular at a start
        return served, q
    served = ends.reached & robot.within(ends.q.reshape(-1, robot.n)).reshape(served.shape)
    if rcond and served.any():
        served[served] = strategy.gain.batch(ends.q[served])[1].ravel() >= rcond
    if clear is not None and served.any():
        served[served] = clear(ends.q[served])
    return served, ends.q


def _best(served: list[Flags], count: int) -> Indices:
    """The laws with the widest leaf, and those that add most to what is served: the first LAWS of them."""
    widest = np.array([flags.mean(axis=1).max(initial=0.0) for flags in served])
    together = np.array([flags.any(axis=0).mean() for flags in served])
    order = np.argsort(-(widest + 0.5 * together), kind="stable")
    return np.asarray(order[: min(LAWS, count)], dtype=int)


def spread_out(T: Array, which: Indices, count: int, length: float) -> Indices:
    """Of some poses of T (k, 4, 4), up to `count` that are far from each other; a turn of 1 rad counts `length` m."""
    if not len(which):
        return which
    X = features(T[which], length)
    chosen = [int(np.argmin(np.linalg.norm(X - X.mean(axis=0), axis=1)))]
    away = np.full(len(X), np.inf)
    while len(chosen) < min(count, len(X)):
        away = np.minimum(away, np.linalg.norm(X - X[chosen[-1]], axis=1))
        chosen.append(int(np.argmax(away)))
    return which[chosen]


def features(T: Array, length: float) -> Matrix:
    """Poses (k, 4, 4) as points (k, 12): their distances are those of the positions, and length times the turn's chord
    2 sin(angle / 2)."""
    return np.hstack([T[:, :3, 3], (length / np.sqrt(2)) * T[:, :3, :3].reshape(-1, 9)])
