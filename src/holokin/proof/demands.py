"""What is asked of a cell besides its one root: joints within their limits, shapes apart."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..base.types import Flags, Indices, Value, some
from ..symbolic.intervals import Interval
from .clear_cells import ClearCells
from .tube import Cells, Findings

FINEST = 1e-3
"""Motion [m] of a cell below which it is not halved for a distance: where this decides, nobody should drive."""


AT = 1e-12
"""Motion [joint units] that is round-off, and distance from a limit: no bound of a root comes below it."""


@dataclass(frozen=True, eq=False)
class Judged(Value):
    """Of k cells: the findings with distances; which are as asked; which cannot be if halved; why not, by row."""

    findings: Findings
    good: Flags
    final: Flags
    near: Flags


@dataclass(frozen=True, eq=False)
class Demands(Value):
    """The limits of the joints, and shapes that are to keep apart; None where they are not asked about."""

    limits: Interval | None
    clear: ClearCells | None = None

    def judged(self, cells: Cells, found: Findings, good: Flags) -> Judged:
        """Cells with a root of their own (`good`), held against what is asked."""
        inside, none = good.copy(), np.zeros(len(good), dtype=bool)
        beyond = none
        if self.limits is not None:
            inside &= ((found.low >= self.limits.low) & (found.high <= self.limits.high)).all(axis=1)
            beyond = good & _beyond(self.limits, cells, found)
        if self.clear is None:
            return Judged(found, inside, beyond, none)
        here: Indices = np.flatnonzero(inside)
        apart = self.clear.over(some(cells, here), found.r[here])
        k, P = len(good), len(self.clear.pairs)
        least, planes = np.full((k, P), -np.inf), np.zeros((k, P, 3))
        least[here], planes[here] = apart.least, apart.planes
        short = ~(apart.least >= self.clear.wanted)
        near, final = none.copy(), beyond.copy()
        near[here] = short.any(axis=1)
        final[here] |= (short & ((apart.motion < FINEST) | (apart.middle < self.clear.wanted))).any(axis=1)
        return Judged(replace(found, apart=least, planes=planes), inside & ~near, final, near)


def _beyond(limits: Interval, cells: Cells, found: Findings) -> Flags:
    """Cells (k,) over all of which a joint is beyond its limit; or is held at it, so that no part of them keeps off."""
    q, moves = (part[:, : found.low.shape[1]] for part in (cells.q0, cells.reach))
    held = (moves <= AT) & ((q >= limits.high - AT) | (q <= limits.low + AT))
    return np.asarray((held | (found.low > limits.high) | (found.high < limits.low)).any(axis=1))
