"""Which sheet to take on each part of a path: with the fewest divisions, then changes, then the least joint motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.types import Array, Flags, Indices, Value, Vector

Cost = tuple[int, int, float]
"""Divisions, changes, seconds: compared in this order."""

SWITCH = 1e-6
"""Seconds that going over to another sheet of the same posture counts, so that rounding does not decide: where parts of
one leaf overlap, both have the same motion."""


@dataclass(frozen=True, eq=False)
class SheetSequence(Value):
    """A sheet for each step of a path (k - 1,), -1 where none serves.

    divisions: places at which the arm must leave the tool's pose to go on. changes: places at which it changes its
    sheet with the tool still. seconds: of the joints' motion, at their speed limits.
    """

    sheets: Indices
    divisions: int
    changes: int
    seconds: float

    @property
    def turnings(self) -> list[tuple[int, int, int]]:
        """(sample, sheet before, sheet after) of each change and division between two steps that are served."""
        s = self.sheets
        at = np.flatnonzero((s[:-1] != s[1:]) & (s[:-1] >= 0) & (s[1:] >= 0)) + 1
        return [(int(i), int(s[i - 1]), int(s[i])) for i in at]


def fewest_changes(steps: Vector, served: Flags, change: Array, first: int | None = None) -> SheetSequence:
    """The best choice of sheets along a path, by dynamic programming over its samples.

    Of all choices that take a sheet on every step that one serves: the fewest divisions, of these the fewest changes,
    of these the least seconds.

    Args:
        steps: seconds of the joints on each sheet and step (S, k - 1).
        served: which sheet serves which step (S, k - 1).
        change: seconds of a change from a sheet to another at each sample (k, S, S); infinite where there is none, 0
            where both have one posture: then it is no change, and counts a microsecond.
        first: the sheet on which the arm stands at the first sample; None for any.
    """
    k = served.shape[1]
    chosen = np.full(k, -1)
    some = served.any(axis=0)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], some, [False]]).astype(int)))
    runs = edges.reshape(-1, 2).tolist()
    divisions, changes, seconds = max(0, len(runs) - 1), 0, 0.0
    for begin, end in runs:
        stands = first if begin == 0 else None
        labels, cost = _run(steps[:, begin:end], served[:, begin:end], change[begin:end], stands)
        chosen[begin:end] = labels
        divisions, changes, seconds = divisions + cost[0], changes + cost[1], seconds + cost[2]
    return SheetSequence(chosen, divisions, changes, seconds)


def _run(steps: Array, served: Flags, change: Array, first: int | None) -> tuple[Indices, Cost]:
    """The best choice for steps (S, k) each of which some sheet serves, and its cost."""
    S, k = served.shape
    before: list[Cost | None] = [(0, 0, 0.0) if first in (None, s) else None for s in range(S)]
    come = np.full((k, S), -1)
    for i in range(k):
        after: list[Cost | None] = [None] * S
        for s in np.flatnonzero(served[:, i]).tolist():
            ways = [
                (_plus(cost, i, t, s, change, first), t)
                for t, cost in enumerate(before) if cost is not None
            ]  # fmt: skip
            best, t = min(ways)
            after[s], come[i, s] = (best[0], best[1], best[2] + float(steps[s, i])), t
        before = after
    cost, s = min((cost, s) for s, cost in enumerate(before) if cost is not None)
    labels = np.empty(k, dtype=int)
    for i in range(k - 1, -1, -1):
        labels[i] = s
        s = int(come[i, s])
    return labels, cost


def _plus(cost: Cost, i: int, t: int, s: int, change: Array, first: int | None) -> Cost:
    """The cost of going on from sheet t to sheet s at sample i."""
    if t == s or (i == 0 and first is None):
        return cost
    seconds = float(change[i, t, s])
    if seconds == 0:
        return cost[0], cost[1], cost[2] + SWITCH
    return (cost[0], cost[1] + 1, cost[2] + seconds) if np.isfinite(seconds) else (cost[0] + 1, cost[1], cost[2])
