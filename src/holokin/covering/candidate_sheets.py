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

STARTS = 8
"""Postures at one pose that leaves go through."""

APART = 1e-3
"""Difference of levels and postures [joint unit] below which two sheets through one pose are one."""

MARGIN = 0.1
"""Share of a joint's range next to a limit that counts as near it."""


@dataclass(eq=False)
class CandidateSheets:
    """Sheets, with the poses T (k, 4, 4) that each serves; they grow while a cover is looked for.

    laws: whose leaves are tried. served: a row of flags (k,) a sheet; costs: of each, squared joint speed and nearness
    to limits, see `_cost`.
    """

    task: Task
    T: Array
    laws: Sequence[Candidate]
    clear: Clear | None
    rcond: float
    sheets: list[Sheet] = field(default_factory=list)
    served: list[Flags] = field(default_factory=list)
    costs: list[float] = field(default_factory=list)

    @property
    def sets(self) -> Flags:
        """Which sheet serves which pose (c, k)."""
        return np.array(self.served, dtype=bool).reshape(-1, len(self.T))

    def grow(self, at: Matrix, end: float, say: Callable[[str], None]) -> None:
        """Adds the leaves of all laws through postures at a tool pose (4, 4), until a time of the clock `end` [s]."""
        starts = postures_at(self.task, at, STARTS)
        if self.clear is not None and len(starts):
            starts = starts[self.clear(starts)]
        for law in self.laws:
            say(f"{law.name}, {len(self.sheets)} leaves so far")
            for q0 in starts:
                if time.monotonic() < end or not self.sheets:
                    self.add(law, q0)

    def add(self, law: Candidate, q0: Vector) -> None:
        """The sheet of a law through a posture, if it is one, and not there yet."""
        strategy = law.strategy
        if strategy is None:
            return
        sheet = Sheet(strategy, q0, self.rcond, {k: v for k, v in law.keys.items() if k != "level"})
        try:
            strategy(q0)
            q, served = sheet.postures(self.T, self.clear)
        except HolokinError:  # it is singular at this posture
            return
        if served.any():
            self.sheets.append(sheet)
            self.served.append(served)
            self.costs.append(_cost(strategy, q[served]))


def _cost(strategy: HolonomicStrategy, Q: Matrix) -> float:
    """Of postures (k, n): the mean of |G|, over what it is at the least, and of the share of joints near a limit."""
    G = strategy.gain.batch(Q)[0]
    robot = strategy.task.robot
    span = np.where(np.isfinite(robot.upper - robot.lower), robot.upper - robot.lower, np.inf)
    room = np.minimum(Q - robot.lower, robot.upper - Q)
    near = (room < MARGIN * np.where(np.isfinite(span), span, 0.0)).mean()
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
    sizes = [_rough(one, starts, some, clear) for one in found]
    return [found[i] for i in _best(sizes, len(found))]


def _rough(law: Candidate, starts: Matrix, T: Array, clear: Clear | None) -> Flags:
    """Which poses (s, k) the leaves of a law through some postures (s, n) serve, quickly."""
    robot, strategy = law.task.robot, law.strategy
    none = np.zeros((len(starts), len(T)), dtype=bool)
    if strategy is None:
        return none
    try:
        ends = along_leaf(strategy, starts, T)
    except HolokinError:
        return none
    served = ends.reached & robot.within(ends.q.reshape(-1, robot.n)).reshape(ends.share.shape)
    if clear is not None and served.any():
        served[served] = clear(ends.q[served])
    return served


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
