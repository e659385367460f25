"""Where a path passes a tool pose twice: the joints are shown to be the same there, or to be others.

All pairs of parts of cells are compared, those of one cell with each other, too. A pair is done where the boxes of its
tool poses are apart, or where the roots of one part, but for whole turns, lie where the other's are the only ones: at a
common pose they are one root. Else both parts are halved, until their tool poses are the same to `SAME`: there the
boxes of the joints are disjoint, or nothing is known.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.types import Flags, Indices, Matrix, Value, Vector, joined, some
from .anchors import distance_at, root_at
from .bounds import UP
from .certificate import Covered, Extent, Revisit
from .partition import overlapping
from .path_proof import Pathway

SAME = 1e-9
"""Tool poses that are as near [m, 1] count as one: as the ends of a closed path do."""

FINE = 2.0**-46
"""Parts [share of a piece] that are not halved any more: a metre is then 1e-14 m long."""

MOST = 30_000
"""Pairs that are compared at a time, at most."""

MANY = 16
"""Pairs for each cell: where more are left, a path may run along itself with other joints, so that all stay."""

FEW = 24
"""Of too many pairs so many are looked at to the end."""

ONCE = 4
"""Halvings of a cell down to which tool poses are enclosed all at once: neighbours are told to have one root there."""


@dataclass(frozen=True, eq=False)
class Parts(Value):
    """Parts low <= u <= high (k,) [share of a piece] of cells (k,)."""

    cell: Indices
    low: Vector
    high: Vector

    def __len__(self) -> int:
        return len(self.cell)

    def half(self, upper: bool) -> Parts:
        """One half of each."""
        middle = (self.low + self.high) / 2
        return Parts(self.cell, middle if upper else self.low, self.high if upper else middle)


@dataclass(frozen=True, eq=False)
class Revisits(Value):
    """The comparison of the cells that cover a path with each other."""

    domain: Pathway
    found: Covered

    def end(self) -> tuple[Extent, Revisit | None]:
        """Why a closed path whose return is not shown is not proven: its joints end elsewhere, if that is shown."""
        zero, last = np.zeros(1), len(self.found) - 1
        moved = self._moved(Parts(np.array([0]), zero, zero), Parts(np.array([last]), zero + 1, zero + 1))
        return (Extent.RETURN, None) if moved is None else (Extent.ELSEWHERE, moved)

    def anywhere(self) -> tuple[Extent, Revisit | None]:
        """WHOLE where the same tool pose has the same joints all along the path, but for whole turns; else why not."""
        boxes, cells = self.found.boxes, np.arange(len(self.found))
        whole = Parts(cells, boxes.low[:, 0], boxes.high[:, 0])
        ones, others = overlapping(*self._levels[0], cells, cells)
        return self._compared(some(whole, ones[ones <= others]), some(whole, others[ones <= others]), MOST, 0)

    def _compared(self, a: Parts, b: Parts, most_pairs: int, level: int) -> tuple[Extent, Revisit | None]:
        """The same of pairs of parts, of so many at a time; where there are more, some of them are dropped.

        The parts are cells halved `level` times.
        """
        lost, many, tries = False, MANY * len(self.found), FEW
        while True:
            left = ~self._one_root(a, b)  # first: it is cheaper than the tool poses, and most pairs are neighbours
            a, b = some(a, left), some(b, left)
            if not len(a):
                return (Extent.RETURN if lost else Extent.WHOLE), None
            below, above = self._poses_at(joined(a, b), level)
            (low, least), (high, most) = np.split(below, 2), np.split(above, 2)
            left = np.all((low <= most) & (least <= high), axis=1)
            apart = np.maximum(high - least, most - low)[left]
            a, b = some(a, left), some(b, left)
            same = np.flatnonzero((apart <= SAME).all(axis=1))  # most often none
            if len(same):
                same = same[self._may_differ(some(a, same), some(b, same))]
            for i in same[:tries].tolist():
                tries -= 1
                moved = self._moved(some(a, slice(i, i + 1)), some(b, slice(i, i + 1)))
                if moved is not None:
                    return Extent.ELSEWHERE, moved
            if len(a) > many and most_pairs > FEW:  # look into some of them first
                extent, moved = self._compared(a, b, FEW, level)
                if moved is not None:
                    return extent, moved
                many = MOST
            wide = np.flatnonzero(np.maximum(a.high - a.low, b.high - b.low) > FINE)
            lost |= len(wide) < len(a) or len(a) > most_pairs
            if not len(wide):
                return (Extent.RETURN if lost else Extent.WHOLE), None
            if lost:
                wide = wide[np.unique(np.linspace(0, len(wide) - 1, FEW).astype(int))]
            a, b, level = some(a, wide), some(b, wide), level + 1
            two = (a.cell != b.cell) | (a.low != b.low)  # of a part with itself one pair of unlike halves is enough
            pairs = [(a.half(i), b.half(i)) for i in (False, True)]
            pairs += [(a.half(False), b.half(True)), (some(a, two).half(True), some(b, two).half(False))]
            a, b = (joined(*(pair[side] for pair in pairs)) for side in (0, 1))

    @cached_property
    def _levels(self) -> list[tuple[Matrix, Matrix]]:
        """Enclosures (cells 2^level, .) of the tool poses of all cells, halved `level` times: hulls of the finest."""
        boxes = self.found.boxes
        parts = Parts(np.arange(len(self.found)), boxes.low[:, 0], boxes.high[:, 0])
        for _ in range(ONCE):
            order = np.arange(2 * len(parts)).reshape(2, -1).T.ravel()  # halves of a part follow each other
            parts = some(joined(parts.half(False), parts.half(True)), order)
        levels = [self._poses(parts)]
        for _ in range(ONCE):
            low, high = levels[0]
            levels.insert(0, (np.minimum(low[::2], low[1::2]), np.maximum(high[::2], high[1::2])))
        return levels

    def _poses_at(self, parts: Parts, level: int) -> tuple[Matrix, Matrix]:
        """`_poses` of cells halved `level` times."""
        if level > ONCE:
            return self._poses(parts)
        low, high = self.found.boxes.low[parts.cell, 0], self.found.boxes.high[parts.cell, 0]
        share = ((parts.low + parts.high) / 2 - low) / (high - low)  # a middle: far from a part's ends
        those = parts.cell * 2**level + np.floor(share * 2**level).astype(int)
        tiny = high - low <= FINE  # halves are rounded there: all of the cell holds them
        (below, above), (least, most) = self._levels[level], self._levels[0]
        those[tiny] = 0
        below, above = below[those], above[those]
        below[tiny], above[tiny] = least[parts.cell[tiny]], most[parts.cell[tiny]]
        return below, above

    def _poses(self, parts: Parts) -> tuple[Matrix, Matrix]:
        """Enclosures (k, .) of the tool poses, wider by what counts as the same."""
        boxes = self.found.boxes
        ends = np.column_stack([(parts.low + parts.high) / 2, (parts.high - parts.low) / 2])
        fixed = np.vstack([self.domain.given(boxes.piece[parts.cell]).T, ends.T])
        one = np.ones((1, len(parts)))
        found = self.domain.equation.reached(np.vstack([-one, fixed]), np.vstack([one, fixed]))
        return found.low.T - SAME / 8, found.high.T + SAME / 8

    def _joints(self, parts: Parts) -> tuple[Matrix, Matrix, Vector]:
        """Predicted unknowns (k, n) in the middles, how far each goes from there at most, the rounding of both (k,)."""
        boxes, cells = self.found.boxes, some(self.found.cells, parts.cell)
        low, high = boxes.low[parts.cell, 0], boxes.high[parts.cell, 0]
        y = (parts.low + parts.high - low - high) / (high - low)
        reach = (np.abs(cells.V[:, :, 0]) + np.abs(cells.Q[:, :, 0])) * ((parts.high - parts.low) / (high - low))[
            :, None
        ]
        return cells.predicted(y[:, None]), reach * UP, cells.slip

    def _turns(self, apart: Matrix) -> Matrix:
        """The whole turns (k, n) in differences of unknowns, where E stays as it is by them."""
        turns = np.where(self.domain.equation.revolute, np.rint(apart / (2 * np.pi)), 0.0)
        for row in np.unique(turns[turns.any(axis=1)], axis=0):
            if not self._periodic(tuple(row.tolist())):
                turns[(turns == row).all(axis=1)] = 0.0
        return turns

    @cached_property
    def _known(self) -> dict[tuple[float, ...], bool]:
        return {}

    def _periodic(self, turns: tuple[float, ...]) -> bool:
        if turns not in self._known:
            self._known[turns] = self.domain.equation.periodic(np.array(turns))
        return self._known[turns]

    def _apart(self, a: Parts, b: Parts) -> tuple[Matrix, Matrix]:
        """By how much the predictors of b are from those of a less whole turns (k, n), and the error of this."""
        (p, of_a, slip), (q, of_b, slips) = self._joints(a), self._joints(b)
        turns = self._turns(q - p)
        error = of_a + of_b + (slip + slips + 1e-14 * np.linalg.norm(turns, axis=1))[:, None]
        return q - p - 2 * np.pi * turns, error

    def _one_root(self, a: Parts, b: Parts) -> Flags:
        """(k,) True where at each common pose both parts have one root."""
        if not len(a):
            return np.zeros(0, dtype=bool)
        findings = self.found.findings
        apart, error = self._apart(a, b)
        off = (np.linalg.norm(apart, axis=1) + np.linalg.norm(error, axis=1)) * UP
        r, alone = findings.r * UP, findings.alone / UP
        return (off + r[b.cell] <= alone[a.cell]) | (off + r[a.cell] <= alone[b.cell])

    def _may_differ(self, a: Parts, b: Parts) -> Flags:
        """(k,) True where the predictors are farther apart than the roots are from them."""
        r = self.found.findings.r
        return np.linalg.norm(self._apart(a, b)[0], axis=1) > r[a.cell] + r[b.cell]

    def _moved(self, a: Parts, b: Parts) -> Revisit | None:
        """How the joints differ in the middles of two parts; None where they are not shown to."""
        places, roots, error, n = [], [], 0.0, self.domain.equation.joints
        for part in (a, b):
            cell, u = int(part.cell[0]), (part.low + part.high) / 2
            roots.append(root_at(self.domain, self.found, cell, u))
            error += distance_at(self.domain, self.found, cell, u, roots[-1])
            places.append((int(self.found.boxes.piece[cell]), float(u[0])))
        if not np.isfinite(error):
            return None
        apart = roots[1] - roots[0]
        turns = self._turns(apart[None])[0]
        error = (error + 1e-15 * float(np.linalg.norm(np.abs(roots).sum(axis=0)))) * UP
        if not (np.abs(apart - 2 * np.pi * turns) > error)[:n].any():
            return None
        return Revisit(places[0], places[1], (apart - error)[:n], (apart + error)[:n])
