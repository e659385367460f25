"""The part of a box of tool poses that can be proven, grown from the pose of the start.

A box of the grid, or a part of one, is examined when it shares a face with what is proven: its root is continued from
there. Where it fails, its halves wait. So the budget goes to boxes that can be joined: to those that hold the start,
then to the largest. The order does not depend on the budget: with a larger one the search goes on where it ended.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np

from ..base.types import Flags, Indices, Matrix, Vector, joined, some
from .box_proof import PORTION, PoseRegion
from .cell_search import (
    BATCH,
    FEW,
    GRID,
    Batch,
    Boxes,
    Covered,
    Demands,
    Extent,
    KeptCells,
    halves,
    looked_up,
    one_root,
    reasons_of,
    smaller,
    too_small,
)
from .tube import Cells, Findings

WAITING, PROVEN, JOINED, ENDED, REPLACED = range(5)
"""What a box is: to be examined; proven; proven and joined to the others; not to be proven; replaced by others."""

UNKNOWN, GLUED, TORN = range(3)
"""What a face of two boxes is: where both are proven they have one root there, or two."""


def grown(
    domain: PoseRegion,
    demands: Demands,
    budget: int,
    progress: Callable[[int, int, float], None],
    kept_cells: KeptCells,
) -> Covered:
    """The proven cells that are joined to the one at `domain.u0`, and why no more are.

    Where that one cannot be proven they are those that are joined to the nearest one that is.

    progress: hears how many are joined, how many were examined, and which share of the box they fill, 0 to 1.
    """
    search, spent, freely, lost = _Search(domain), 0, FEW, False
    count, share = 0, 0.0
    while spent < budget and len(chosen := search.next(budget - spent, freely)):
        batch = looked_up(domain, some(search.boxes, chosen), demands, kept_cells, partial(search.guesses, chosen))
        spent += len(chosen)
        search.take(chosen, batch)
        lost = lost or not batch.rooted.all() or (search.state == ENDED).any()
        freely = 0 if lost else min(BATCH, FEW + 8 * int(batch.kept.sum()))
        new = some(search.boxes, search.join(None))
        count, share = count + len(new), share + float(domain.shares(new.low, new.high).sum())
        progress(count, spent, share)
    search.join(search.nearest(PROVEN))
    return search.covered(spent < budget)


class _Search:
    """All boxes of a search, and the faces (f, 2) of those that are not halved."""

    def __init__(self, domain: PoseRegion) -> None:
        counts = [len(cuts) - 1 for cuts in domain.grid]
        self.domain, self.sides = domain, 2.0 / np.array(counts)
        self.lengths = np.where(domain.half > 0, self.sides, np.inf)  # nothing changes where the box is flat
        self.posture = domain.equation.completed(domain.q[None])[0]
        self.boxes, self.faces = domain.first(), _grid_faces(counts)
        self.kind = np.full(len(self.faces), UNKNOWN)
        self.state, self.row, self.level = (np.zeros(0, dtype=int) for _ in range(3))
        self.far, self.holds = np.zeros(0), np.zeros(0, dtype=bool)
        self.reasons: dict[int, Extent] = {}
        self.postures: dict[int, Vector] = {}
        self.done: list[Findings] = []
        n, d, numbers = domain.equation.n, domain.equation.d, domain.equation.family.numbers
        shapes = [(0, n), (0, n, d), (0, n, d * (d + 1) // 2), (0, numbers), (0,)]
        self.cells = Cells(*(np.zeros(shape) for shape in shapes))
        self.r, self.alone = np.zeros(0), np.zeros(0)
        self._add(self.boxes)

    def _add(self, new: Boxes) -> None:
        """Of boxes that are added: the state, the row of the cell, how often a box of the grid was halved, the distance
        from the start, and whether the start is in it."""
        k, u0 = len(new), self.domain.u0
        self.state = np.append(self.state, np.full(k, WAITING))
        self.row = np.append(self.row, np.full(k, -1))
        halved = -np.log2((new.high - new.low) / self.sides).sum(axis=1)
        self.level = np.append(self.level, np.rint(halved).astype(int))
        self.far = np.append(self.far, np.linalg.norm((new.low + new.high) / 2 - u0, axis=1))
        self.holds = np.append(self.holds, ((new.low <= u0) & (u0 <= new.high)).all(axis=1))

    def next(self, most: int, freely: int) -> Indices:
        """The boxes to be examined next: those that hold the start, then those that touch what is joined, the largest
        first. freely: to so many others are added, which may touch nothing yet."""
        waiting = self.state == WAITING
        first = waiting & self.holds
        if (first & (self.level > 0)).any():
            freely = 0
        elif (self.state == JOINED).any():
            for box, neighbour in self._both_ways():
                first[neighbour[self.state[box] == JOINED]] = True
            first &= waiting
        elif not first.any():
            first = waiting
        # The largest boxes first, and of these the nearest to the start.
        rows = np.flatnonzero(first), np.flatnonzero(waiting & ~first)
        chosen, others = (part[np.lexsort((self.far[part], self.level[part]))] for part in rows)
        largest = int((self.level[chosen] == self.level[chosen[:1]]).sum())
        chosen = chosen[: min(BATCH, max(FEW, freely, largest))]
        chosen = np.concatenate([chosen, others[: max(freely - len(chosen), 0)]])
        return chosen[:most]

    def guesses(self, chosen: Indices) -> Matrix:
        """Joints (k, n) near the roots in the middles of boxes, from joined cells beside them, or else the nearest."""
        k, place, boxes = len(chosen), np.full(len(self.state), -1), some(self.boxes, chosen)
        place[chosen] = np.arange(k)
        u, q = np.tile(self.domain.u0, (k, 1)), np.tile(self.posture, (k, 1))
        known = np.flatnonzero(self.state == JOINED)
        known = known if len(known) else np.flatnonzero(self.state == PROVEN)
        if not len(known):
            return self.domain.led(u, q, boxes)
        # From the face of a joined box.
        beside = np.full(k, -1)
        for box, neighbour in self._both_ways():
            faces = (self.state[box] == JOINED) & (place[neighbour] >= 0)
            beside[place[neighbour[faces]][::-1]] = box[faces][::-1]
        near, away = np.flatnonzero(beside >= 0), np.flatnonzero(beside < 0)
        u[near] = self._middles_of_faces(beside[near], chosen[near])
        q[near] = self._predicted(beside[near], u[near])
        # From the middle of the nearest known one.
        if len(away):
            from scipy.spatial import KDTree

            middles = (self.boxes.low + self.boxes.high) / 2
            nearest = known[KDTree(middles[known]).query(middles[chosen[away]])[1]]
            u[away], q[away] = middles[nearest], self.cells.q0[self.row[nearest]]
        return self.domain.led(u, q, boxes)

    def take(self, chosen: Indices, batch: Batch) -> None:
        """What the test of some boxes says: proven, ended, to be tried again, or halved."""
        kept, boxes = batch.kept, some(self.boxes, chosen)
        self.row[chosen[kept]] = len(self.r) + np.arange(int(kept.sum()))
        self.state[chosen[kept]] = PROVEN
        self.cells = joined(self.cells, some(batch.cells, kept))
        self.done.append(batch.findings)
        self.r, self.alone = np.append(self.r, batch.findings.r), np.append(self.alone, batch.findings.alone)
        final = ~kept & batch.rooted & (too_small(boxes, batch.cells) | batch.final)
        final |= ~kept & (np.min(boxes.high - boxes.low, axis=1) < 8 * GRID)
        self._end(chosen[final], reasons_of(batch, final), batch.cells.q0[final])
        tried, again, halved, parts = smaller(boxes, batch, ~kept & ~final, self.lengths)
        self._replace(chosen[tried], again)
        self._replace(chosen[halved], parts)

    def _end(self, rows: Indices, reasons: list[Extent], postures: Matrix) -> None:
        self.state[rows] = ENDED
        self.reasons |= dict(zip(rows.tolist(), reasons, strict=True))
        self.postures |= dict(zip(rows.tolist(), postures, strict=True))

    def _replace(self, rows: Indices, parts: Boxes) -> None:
        """Boxes (k,) are replaced: by others (k), or by lower and then upper halves (2 k), which have their faces."""
        if not len(rows):
            return
        # The rows of the boxes in the place of each.
        k, first = len(rows), len(self.state)
        self.boxes = joined(self.boxes, parts)
        self._add(parts)
        self.state[rows] = REPLACED
        lower, upper = np.arange(len(self.state)), np.full(len(self.state), -1)
        lower[rows] = first + np.arange(k)
        if len(parts) > k:
            upper[rows] = first + k + np.arange(k)
        # Their faces: parts of the old ones, and those between halves.
        cut = (self.state[self.faces] == REPLACED).any(axis=1)
        ends = self.faces[cut]
        new = [np.column_stack([a[ends[:, 0]], b[ends[:, 1]]]) for a, b in product((lower, upper), repeat=2)]
        new = np.concatenate([*new, np.column_stack([lower[rows], upper[rows]])])
        new = new[(new >= 0).all(axis=1)]
        new = new[self._meet(new)]
        self.faces = np.concatenate([self.faces[~cut], new])
        self.kind = np.append(self.kind[~cut], np.full(len(new), UNKNOWN))

    def _meet(self, pairs: Indices) -> Flags:
        """(f,) which pairs of boxes have a part of a face in common."""
        low, high = self.boxes.low, self.boxes.high
        i, j = pairs.T
        common = np.minimum(high[i], high[j]) - np.maximum(low[i], low[j])
        return ((common >= 0).all(axis=1)) & ((common == 0).sum(axis=1) == 1)

    def join(self, seed: int | None) -> Indices:
        """Join proven boxes to the one at the start, or, where none is joined yet, to a `seed`: those that do so now.

        Those that have another root where they meet these are halved.
        """
        self._glue()
        before = self.state == JOINED
        if not before.any():
            self._begin(seed)
            before = np.append(before, np.zeros(len(self.state) - len(before), dtype=bool))
        torn = self.kind == TORN
        while True:
            is_joined = self.state == JOINED
            wanted, unlike = np.zeros(len(self.state), dtype=bool), np.zeros(len(self.state), dtype=bool)
            for box, neighbour in self._both_ways():
                wanted[neighbour[(self.kind == GLUED) & is_joined[box]]] = True
                unlike[neighbour[torn & is_joined[box]]] = True
            wanted &= (self.state == PROVEN) & ~unlike
            i, j = np.sort(self.faces[torn], axis=1).T  # of two that differ the first one counts
            wanted[j[wanted[i] & wanted[j]]] = False
            if not wanted.any():
                break
            self.state[wanted] = JOINED
        new = np.flatnonzero((self.state == JOINED) & ~before)
        self._part(np.flatnonzero(unlike & (self.state == PROVEN)))
        return new

    def _begin(self, seed: int | None) -> None:
        """The first box that is joined: one whose root at `u0` is the start; or a seed, where none waits for that."""
        at_start = np.flatnonzero((self.state == PROVEN) & self.holds)
        if len(at_start):
            off = self._predicted(at_start, np.tile(self.domain.u0, (len(at_start), 1))) - self.posture
            # The pose of the start is known to the grid of the boxes.
            same = np.linalg.norm(off, axis=1) <= np.maximum(self.alone[self.row[at_start]], 1e-6)
            if same.any():
                self.state[at_start[np.argmax(same)]] = JOINED
                return
            self._part(at_start)
        if seed is None and not ((self.state == WAITING) & self.holds).any():
            seed = self.nearest(PROVEN)
        if seed is not None:
            self.state[seed] = JOINED

    def _part(self, rows: Indices) -> None:
        """Halve proven boxes that have another root than their neighbours: it is sought anew in their halves."""
        if not len(rows):
            return
        boxes, cells = some(self.boxes, rows), some(self.cells, self.row[rows])
        final, none = too_small(boxes, cells), np.zeros(len(rows), dtype=bool)
        self._end(rows[final], [Extent.APART] * int(final.sum()), cells.q0[final])
        self._replace(rows[~final], halves(boxes, cells, cells.rho / 2, ~final, none))

    def _glue(self) -> None:
        """Look at the faces of which both boxes are proven."""
        proven = (self.state == PROVEN) | (self.state == JOINED)
        new = np.flatnonzero((self.kind == UNKNOWN) & proven[self.faces].all(axis=1))
        for faces in np.array_split(new, -(-len(new) // PORTION)) if len(new) else []:
            i, j = self.faces[faces].T
            u = self._middles_of_faces(i, j)
            a, b = self.row[i], self.row[j]
            off = np.linalg.norm(self._predicted(i, u) - self._predicted(j, u), axis=1)
            off += some(self.cells, a).slip + some(self.cells, b).slip
            self.kind[faces] = np.where(one_root(off, self.r[a], self.alone[a], self.r[b], self.alone[b]), GLUED, TORN)

    def _middles_of_faces(self, i: Indices, j: Indices) -> Matrix:
        low, high = self.boxes.low, self.boxes.high
        return (np.maximum(low[i], low[j]) + np.minimum(high[i], high[j])) / 2

    def _predicted(self, rows: Indices, u: Matrix) -> Matrix:
        """The predicted joints (k, n) of proven boxes at parameters u (k, d) of the box of poses."""
        return some(self.boxes, rows).predicted(some(self.cells, self.row[rows]), u)

    def _both_ways(self) -> Iterator[tuple[Indices, Indices]]:
        yield self.faces[:, 0], self.faces[:, 1]
        yield self.faces[:, 1], self.faces[:, 0]

    def nearest(self, state: int) -> int | None:
        """Of the boxes of a state the one nearest to the start."""
        rows = np.flatnonzero(self.state == state)
        return int(rows[np.argmin(self.far[rows])]) if len(rows) else None

    def covered(self, exhausted: bool) -> Covered:
        """The joined cells; why there are no more, by the nearest box that cannot be proven, or waits."""
        boxes = np.flatnonzero(self.state == JOINED)
        rows = self.row[boxes]
        proven = Covered(some(self.boxes, boxes), some(self.cells, rows), some(joined(*self.done), rows))
        stop = next((k for k in (self.nearest(s) for s in (ENDED, WAITING, PROVEN)) if k is not None), None)
        if stop is None:
            return proven
        reason = self.reasons.get(stop, Extent.APART if exhausted else Extent.BUDGET)
        return replace(proven, extent=reason, stopped=self.boxes.places()[stop], posture=self.postures.get(stop))


def _grid_faces(counts: list[int]) -> Indices:
    """(f, 2) the boxes of a grid that have a face in common, by their places in it."""
    places = np.arange(int(np.prod(counts))).reshape(counts)
    pairs = []
    for axis, count in enumerate(counts):
        below, above = (np.take(places, range(a, a + count - 1), axis=axis).ravel() for a in (0, 1))
        pairs.append(np.column_stack([below, above]))
    return np.concatenate(pairs)
