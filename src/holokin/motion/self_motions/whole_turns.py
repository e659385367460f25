"""Whole turns of hinges: which of them keep the tool pose, what they do to g, and the turns nearest to a posture."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from ...base.tolerances import TOLERANCES
from ...base.types import Array, Flags, Matrix, Value, Vector, kept
from ...strategies import HolonomicStrategy

SAME = 1e-8
"""Change of pose and of level, over 1 + its size, that counts as round-off: an answer is right to 1e-10 of a joint, and
a turn that is not kept changes it by far more."""

SAMPLED = 8
"""Postures at which it is looked at what whole turns do to g."""

MOST_TURNS = 2_200
"""Turns of hinges that are tried together: three of seven hinges."""

MOST_LEVELS = 64
"""Levels that whole turns make of one, in the range of g."""


@dataclass(frozen=True, eq=False)
class WholeTurns(Value):
    """What a whole turn of a joint does to g: nothing where it is free (n,), a constant change (n, r), or one that
    varies with the posture (n,). It changes the tool pose where none of these is so. angular (r,): the angles in g."""

    free: Flags
    change: Matrix
    varying: Flags
    angular: Flags

    def levels(self) -> Vector:
        """The changes (k,) of g, r = 1, that whole turns can make, 0 among them."""
        change = np.unique(np.round(np.abs(self.change[self.change != 0]), 12))
        if self.angular.any():
            change = np.unique(np.append(change, 2 * np.pi))
        if not len(change):
            return np.zeros(1)
        count = np.round(change / change[0])
        if np.abs(change / change[0] - count).max() < SAME and change[0] > 1e-3:
            k = np.arange(-MOST_LEVELS, MOST_LEVELS + 1, dtype=float)
            return change[0] * k
        counts = product(range(-2, 3), repeat=len(change))
        sums = [round(float(np.dot(k, change)), 12) for k in counts]
        return np.unique(np.array(sums, dtype=float))

    def nearest(self, q: Matrix, wanted: Matrix, aim: Array, low: Vector, high: Vector) -> tuple[Matrix, Flags]:
        """(postures (k, n) at the whole turns nearest to one, (n,) or (k, n), that change g as wanted (k, r); whether
        they are from low to high (n,), and change it so)."""
        q, aim = np.where(self.free, turned(q, aim, low, high), q), np.broadcast_to(aim, q.shape)
        fits, counted = np.ones(len(q), dtype=bool), np.flatnonzero(self.change.any(axis=1))
        if len(counted) and len(q):
            change, now = self.change[counted], q[:, counted]
            options = turn_options(now, aim[:, counted], low[counted], high[counted])
            # One hinge alone, the one that changes g least, serves where the turns that were tried do not.
            least = int(np.argmin(np.abs(change).sum(axis=1)))
            alone = np.zeros((len(q), len(counted)))
            alone[:, least] = np.round(wanted @ change[least] / (change[least] @ change[least]))
            options = np.unique(np.vstack([options, alone]), axis=0)
            gap = options @ change - wanted[:, None]
            gap = np.where(self.angular, (gap + np.pi) % (2 * np.pi) - np.pi, gap)
            moved = now[:, None] + 2 * np.pi * options
            right = np.all(np.abs(gap) <= SAME * (1 + np.abs(wanted[:, None])), axis=2)
            right &= np.all((moved >= low[counted]) & (moved <= high[counted]), axis=2)
            far = np.where(right, np.square(moved - aim[:, None, counted]).sum(axis=2), np.inf)
            best, every = far.argmin(axis=1), np.arange(len(q))
            q[:, counted], fits = moved[every, best], right[every, best]
        return q, fits & np.all((q >= low) & (q <= high), axis=1)


def turned(q: Matrix, near: Array, low: Vector, high: Vector) -> Matrix:
    """Hinges at the turn that is nearest to `near` within the limits, in [near - pi, near + pi) without any."""
    k = -np.floor((q - near + np.pi) / (2 * np.pi))
    first, last = np.ceil((low - q) / (2 * np.pi)), np.floor((high - q) / (2 * np.pi))
    return q + 2 * np.pi * np.minimum(np.maximum(k, first), last)


def turn_options(q: Matrix, aim: Array, low: Vector, high: Vector) -> Matrix:
    """Numbers of whole turns (k, s) of hinges q (N, s): all within the limits, else the nearest to `aim`."""
    wish = np.round((aim - q) / (2 * np.pi))
    for around in (4, 3, 2, 1):
        first = np.maximum(np.ceil((low - q.max(axis=0)) / (2 * np.pi)), wish.min(axis=0) - around)
        last = np.minimum(np.floor((high - q.min(axis=0)) / (2 * np.pi)), wish.max(axis=0) + around)
        if np.prod(np.maximum(last - first + 1, 0.0)) <= MOST_TURNS:
            break
    ranges = [np.arange(a, b + 1) for a, b in zip(first, last, strict=True)]
    return np.array(list(product(*ranges))).reshape(-1, q.shape[1])


@kept
def _known(strategy: HolonomicStrategy) -> list[WholeTurns]:
    return []


def turns_of(strategy: HolonomicStrategy, Q: Matrix) -> WholeTurns:
    """What whole turns do to g: by postures spread over the joint ranges, else by some of postures (N, n).

    Postures where g has no value say nothing. A locked joint is not free, and neither is one that a sum of angles
    counts, or that drives another joint through a gear.
    """
    known, n = _known(strategy), strategy.task.n
    if not known:
        for sample in (np.random.default_rng(0).uniform(-3, 3, (SAMPLED, n)), Q[:: max(1, len(Q) // SAMPLED)]):
            g, margin = strategy.constraint_value.batch(sample), strategy.gain.batch(sample)[2]
            sound = np.isfinite(g.reshape(len(sample), -1)).all(axis=1)
            sound &= margin.reshape(-1) > TOLERANCES.representation
            if sound.any():
                known.append(_turns_at(strategy, sample[sound]))
                break
        else:
            none, r = np.zeros(n, dtype=bool), strategy.constraint.rows
            return WholeTurns(none, np.zeros((n, r)), none, np.array(strategy.constraint.angular, dtype=bool))
    return known[0]


def _turns_at(strategy: HolonomicStrategy, q: Matrix) -> WholeTurns:
    (k, n), task, r = q.shape, strategy.task, strategy.constraint.rows
    hinges = np.flatnonzero(task.robot.hinges)
    moved = (q[None] + 2 * np.pi * np.eye(n)[hinges][:, None]).reshape(-1, n)
    before = strategy.constraint_value.batch(q).reshape(k, r)
    after = strategy.constraint_value.batch(moved).reshape(len(hinges), k, r)
    change, small = strategy.constraint.nearest(after - before), SAME * (1 + np.abs(before))
    # Whether the tool stays; then how g changes, at all postures.
    stays = np.ones(len(hinges), dtype=bool)
    for here, there in zip(task._poses(q), task._poses(moved), strict=True):
        stays &= np.abs(there.reshape(len(hinges), k, -1) - here.reshape(k, -1)).max(axis=(1, 2)) < SAME
    free = np.all(np.abs(change) <= small, axis=(1, 2)) & stays
    middle = np.median(change, axis=1)
    constant = np.all(np.abs(change - middle[:, None]) <= small, axis=(1, 2)) & stays & ~free
    out = np.zeros(n, dtype=bool), np.zeros((n, r)), np.zeros(n, dtype=bool)
    out[0][hinges], out[1][hinges] = free, np.where(constant[:, None], middle, 0.0)
    out[2][hinges] = stays & ~free & ~constant
    return WholeTurns(*out, np.array(strategy.constraint.angular, dtype=bool))
