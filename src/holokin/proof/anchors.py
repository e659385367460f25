"""Postures that the roots of a proof are shown to be near to: the start, and where pieces of a path meet."""

from __future__ import annotations

import numpy as np

from ..base.types import Vector, some
from .box_proof import PoseRegion
from .cell_search import Domain
from .certificate import Anchors, Covered
from .path_proof import Pathway
from .tube import Cells, centred, examined

NEAR = 1e-6
"""Of the places of a box where its start may be, the first one is taken whose posture is as near to the root."""

ROOM = 4.0
"""Of a distance that is not round-off: for the checker, whose bounds are those of a whole cell."""

NEWTONS = 3
"""Steps to a root from its predictor."""


def anchored(domain: Domain, found: Covered, q0: Vector, closed: bool) -> Anchors:
    """Of some cells, joined to each other, in the order of a path. `closed`: its end is to be its beginning."""
    d, posture = domain.equation.d, q0
    q0 = domain.equation.completed(posture[None])[0]
    if not len(found):
        return Anchors(np.zeros((1, d)), q0[None], np.inf, np.inf, None)
    places = [(np.zeros(1), q0)] if d == 1 else []
    if isinstance(domain, PoseRegion):
        middle = domain.equation.completed(domain.q[None])[0]
        places = [(domain.place_of(posture), q0), (domain.u0, middle)]
        places.append(((found.boxes.low[0] + found.boxes.high[0]) / 2, found.cells.q0[0]))
    u, q, within = np.zeros(d), q0, np.inf
    for u, q in places:
        within = distance_at(domain, found, _holding(found, 0, u), u, q)
        if within < NEAR:
            break
    if not isinstance(domain, Pathway):
        return Anchors(u[None], q[None], within, 0.0, None)
    pieces, end, begin = int(found.boxes.piece.max()) + 1, np.ones(1), np.zeros(1)
    postures, gap, turns = [q], 0.0, None
    for piece in range(1, pieces):
        one, other = _holding(found, piece - 1, end), _holding(found, piece, begin)
        postures.append(root_at(domain, found, other, begin))
        gap = max(gap, sum(distance_at(domain, found, i, at, postures[-1]) for i, at in ((one, end), (other, begin))))
    if closed:
        first, last = _holding(found, 0, begin), _holding(found, pieces - 1, end)
        b, a = root_at(domain, found, first, begin), root_at(domain, found, last, end)
        whole = np.where(domain.equation.revolute, np.rint((a - b) / (2 * np.pi)), 0.0) + 0.0  # no -0
        size = 2 * np.pi * whole
        apart = distance_at(domain, found, first, begin, b) + distance_at(domain, found, last, end, b + size)
        apart += 1e-15 * float(np.linalg.norm(np.abs(size) + np.abs(b)))
        if np.isfinite(apart) and domain.equation.periodic(whole):
            gap, turns = max(gap, apart), whole
    return Anchors(np.zeros((pieces, 1)), np.array(postures), within, gap, turns)


def at_start(domain: Domain, anchors: Anchors, q0: Vector) -> bool:
    """Whether the roots are q0's: over a box at its pose, if the box holds that, else where it leads to the middle."""
    if not isinstance(domain, PoseRegion):
        return True
    inside = bool((np.abs(domain.place_of(q0)) <= 1).all())
    first = q0 if inside else domain.q
    return anchors.within < NEAR and np.array_equal(anchors.q[0, : len(q0)], first[: len(q0)])


def _holding(found: Covered, piece: int, u: Vector) -> int | None:
    """A cell that holds u."""
    b = found.boxes
    holding = np.flatnonzero((b.piece == piece) & (b.low <= u).all(axis=1) & (u <= b.high).all(axis=1))
    return int(holding[0]) if len(holding) else None


def _still(domain: Domain, found: Covered, i: int, u: Vector, q: Vector) -> Cells:
    """A cell of the one pose at u."""
    n, d = domain.equation.n, domain.equation.d
    numbers = np.concatenate([domain.given(found.boxes.piece[i : i + 1])[0], u, np.zeros(d)])
    Q = np.zeros((1, n, d * (d + 1) // 2))
    return Cells(q[None], np.zeros((1, n, d)), Q, numbers[None], found.cells.rho[i : i + 1] / 4)


def _local(found: Covered, i: int, u: Vector) -> Vector:
    low, high = found.boxes.low[i], found.boxes.high[i]
    predicted = some(found.cells, slice(i, i + 1)).predicted(((2 * u - low - high) / (high - low))[None])
    return predicted[0]


def root_at(domain: Domain, found: Covered, i: int | None, u: Vector) -> Vector:
    """The root at u of a cell, by Newton's method."""
    if i is None:
        return np.full(domain.equation.n, np.nan)
    guess = _still(domain, found, i, u, _local(found, i, u))
    return centred(domain.equation, guess.q0, guess.numbers, domain.c, guess.rho, newtons=NEWTONS).q0[0]


def distance_at(domain: Domain, found: Covered, i: int | None, u: Vector, q: Vector) -> float:
    """A bound of the distance of the root of a cell at u from q; infinite where that is not shown.

    The cell of the one pose at u has a root within r of q; if it lies where the other cell's is alone, it is that one.
    """
    if i is None or not np.isfinite(q).all():
        return np.inf
    here = examined(domain.equation, _still(domain, found, i, u, q), domain.c)
    off = float(np.linalg.norm(q - _local(found, i, u)) + here.r[0] + found.cells.slip[i])
    if not off < 0.5 * found.findings.alone[i]:
        return np.inf
    return float(here.r[0] + ROOM * np.linalg.norm(q - root_at(domain, found, i, u)))
