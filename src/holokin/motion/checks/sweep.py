"""Distances along a whole motion: at few instants, and bounded between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...base.types import Indices, Matrix, Value, Vector
from ...robot import Robot
from ...robot.numeric import joint_frames
from .check_report import keeps
from .gaps import Gap

ACCURACY = 1e-3
"""How much less [m] than the least distance found it may be anywhere on the motion: a millimetre."""

FINE = 2e-4
"""Motion [m] below which an interval between two samples is not halved any more: half of it is a tenth of ACCURACY."""

TOUCH = float(np.nextafter(0.0, 1.0))
"""The least distance [m] of two things that do not touch."""

FIRST = 16
"""Intervals into which a motion is cut to begin with."""


@dataclass(frozen=True, eq=False)
class Swept(Value):
    """A gap along a motion.

    s (k,): where it was looked at, as numbers of samples from 0, rising; d (k,): the distances there [m];
    bound: what the distance is at least on the whole motion, joints going straight from sample to sample [m].
    """

    gap: Gap
    s: Vector
    d: Vector
    bound: float

    @property
    def least(self) -> float:
        """The least distance found [m]."""
        return float(self.d.min())

    @property
    def least_at(self) -> float:
        """Where it is, as a number of a sample."""
        return float(self.s[int(np.argmin(self.d))])

    def stretches(self, limit: float) -> list[tuple[float, float, float, float]]:
        """(first s, last s, least distance there, its s) of each stretch on which the distance is below a limit."""
        edges = np.diff(np.concatenate([[0], ~keeps(self.d, limit), [0]]).astype(int))
        found = []
        for a, b in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
            k = a + int(np.argmin(self.d[a:b]))
            found.append((float(self.s[a]), float(self.s[b - 1]), float(self.d[k]), float(self.s[k])))
        return found


def sweep(robot: Robot, gaps: Sequence[Gap], q: Matrix, limits: Sequence[float]) -> list[Swept]:
    """Every gap along the joints q (k, n), which go straight from sample to sample.

    Between two postures whose distances are d and e, and over which points of the two things move by S at most towards
    each other, the distance is at least (d + e - S) / 2. An interval is halved until that is no less than its limit
    [m] and than the least distance less `ACCURACY`, that of the pairs with the largest limit: those with a smaller one
    are not held against the clearance, and do not tell it.
    """
    if not gaps:
        return []
    near = max(*limits, TOUCH)
    judged = [i for i, limit in enumerate(limits) if limit == max(limits)]
    walks = [np.concatenate([[0.0], np.cumsum(np.abs(np.diff(q, axis=0)) @ gap.weights)]) for gap in gaps]
    starts = np.unique(np.linspace(0, len(q) - 1, FIRST + 1).astype(int)).astype(float)
    known = [dict.fromkeys(starts.tolist(), 0.0) for _ in gaps]
    _look(robot, gaps, q, known, [starts for _ in gaps], near)
    bounds = np.full(len(gaps), np.inf)
    waiting = [(starts[:-1], starts[1:]) for _ in gaps]
    if len(q) == 1:
        bounds = np.array([distances[0.0] for distances in known])
    while any(len(a) for a, _ in waiting):
        best = min(min(known[i].values()) for i in judged)
        asked: list[Vector] = []
        for i, (a, b) in enumerate(waiting):
            d, e = (np.array([known[i][s] for s in ends.tolist()]) for ends in (a, b))
            step = _at(walks[i], b) - _at(walks[i], a)
            bound, limit = (d + e - step) / 2, max(limits[i], TOUCH)
            inside = (d < limit) & (e < limit) & ((d + e + step) / 2 < limit)
            own = min(known[i].values()) - ACCURACY
            least = max(limit, best - ACCURACY) if i in judged else limit
            want = np.where(inside, bound < own, bound < least)
            split = want & ((b - a > 1) | ((step > FINE) & ((bound < own) | ((d >= limit) & (e >= limit)))))
            bounds[i] = min(bounds[i], float(bound[~split].min(initial=np.inf)))
            middle = (a[split] + b[split]) / 2
            middle = np.where(b[split] - a[split] > 1, np.floor(middle), middle)
            asked.append(middle)
            waiting[i] = (np.concatenate([a[split], middle]), np.concatenate([middle, b[split]]))
        _look(robot, gaps, q, known, asked, near)
    found = []
    for gap, distances, bound in zip(gaps, known, bounds, strict=True):
        s = np.array(sorted(distances))
        d = np.array([distances[x] for x in s.tolist()])
        found.append(Swept(gap, s, d, min(float(bound), float(d.min()))))
    return found


def postures_at(q: Matrix, s: Vector) -> Matrix:
    """The joints at numbers of samples s (k,), which need not be whole."""
    low = np.minimum(np.floor(s).astype(int), max(len(q) - 2, 0))
    high = np.minimum(low + 1, len(q) - 1)
    share = (s - low)[:, None]
    return (1 - share) * q[low] + share * q[high]


def _look(
    robot: Robot, gaps: Sequence[Gap], q: Matrix, known: list[dict[float, float]], asked: list[Vector],
    near: float,
) -> None:  # fmt: skip
    """Find the distances of each gap at its places, and note them."""
    places = np.unique(np.concatenate(asked))
    if not len(places):
        return
    frames = joint_frames(robot, postures_at(q, places))
    for gap, distances, s in zip(gaps, known, asked, strict=True):
        if len(s):
            rows: Indices = np.searchsorted(places, s)
            distances.update(zip(s.tolist(), gap.distances(frames, rows, near).tolist(), strict=True))


def _at(walk: Vector, s: Vector) -> Vector:
    return np.interp(s, np.arange(len(walk)), walk)
