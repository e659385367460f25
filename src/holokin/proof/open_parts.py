"""`OpenParts`: the parts of a box of poses that are not proven, and why: some hold a posture that is too near."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from ..base.types import Array, Indices, Matrix, Value, Vector
from ..motion.ik import InverseKinematics, InverseStatus
from .box_proof import PoseRegion
from .certificate import Certificate
from .clear_cells import ClearCells
from .partition import left_open, partition
from .too_near import TooNear, gap_distances, short_of

CAUSES = ("not proven", "another posture", "beyond a joint limit", "the leaf ends", "too near")
"""What the poses of a workspace are that are not in its region."""

UNPROVEN, ANOTHER, LIMIT, END, NEAR = range(len(CAUSES))

MOST_PARTS, MOST_ASKED, ASKED = 8_000, 24_000, 9
"""Parts that a box is cut into, poses of all of them that are asked about, and of each: about, and at most."""

Elsewhere = Callable[[Matrix, Vector], bool]
"""Whether a posture (n,) at a tool pose (4, 4) is not the one that continues what is proven."""


@dataclass(frozen=True, eq=False)
class Asked(Value):
    """Of tool poses (k, 4, 4): why each is not proven (k,), of `CAUSES`; the postures (k, n) of the leaf there; the gap
    that is short of what is asked by most (k,), its distance [m], and by how much [m]: negative where it is not."""

    poses: Array
    cause: Indices
    q: Matrix
    gap: Indices
    distance: Vector
    short: Vector

    def told(self, clear: ClearCells, i: int) -> TooNear:
        """What is too near at one of them."""
        gaps, g = clear.looked_at, int(self.gap[i])
        return TooNear(self.poses[i], self.q[i], gaps.gaps[g].names, float(self.distance[i]), gaps.limits[g])


def asked_about(clear: ClearCells | None, poses: Array, ik: InverseKinematics) -> Asked:
    """What the posture of the leaf is like at tool poses that are not proven."""
    found, k = ik.batch(poses), len(poses)
    cause = np.select([found.reached, found.status == InverseStatus.LIMIT], [UNPROVEN, LIMIT], END)
    gap, distance, short = np.zeros(k, dtype=int), np.full(k, np.inf), np.full(k, -np.inf)
    here = np.flatnonzero(found.reached)
    if clear is not None and len(here):
        apart = gap_distances(clear, found.q[here])
        lacks = short_of(clear, apart)
        gap[here], rows = lacks.argmax(axis=1), np.arange(len(here))
        distance[here], short[here] = apart[rows, gap[here]], lacks[rows, gap[here]]
        cause[short > 0] = NEAR
    return Asked(poses, cause, found.q, gap, distance, short)


@dataclass(frozen=True, eq=False)
class OpenParts(Value):
    """The parts of a box of tool poses that are not proven, as boxes low <= u <= high (k, d) of its parameters, which
    go from -1 to 1 across it.

    A part is "too near", and so refuted, where a posture of the leaf was found in it at which things are nearer than
    was asked: `found` holds it. Another part is called after the pose in its middle.
    """

    low: Matrix
    high: Matrix
    cause: Indices
    """(k,) of `CAUSES`."""
    found: tuple[TooNear | None, ...]
    volumes: Vector
    """(k,) shares of the workspace: of its positions by volume, of its turns by the Haar measure."""

    def __len__(self) -> int:
        return len(self.low)

    @property
    def shares(self) -> dict[str, float]:
        """Of the box the shares that are not proven, by cause."""
        return {name: float(self.volumes[self.cause == i].sum()) for i, name in enumerate(CAUSES)}

    def cause_at(self, u: Matrix) -> Indices:
        """(k,) the cause of the part that holds a place u (k, d), -1 where none does."""
        out = np.full(len(u), -1)
        near = ((self.low <= u.max(axis=0)) & (self.high >= u.min(axis=0))).all(axis=1) if len(u) else []
        for i in np.flatnonzero(near):
            out[((self.low[i] <= u) & (u <= self.high[i])).all(axis=1)] = self.cause[i]
        return out

    @property
    def worst(self) -> TooNear | None:
        """The posture that is short of what was asked by most; None where none was found."""
        those = [one for one in self.found if one is not None]
        return max(those, key=lambda one: one.wanted - one.distance, default=None)


def open_parts(certificate: Certificate, region: PoseRegion, ik: InverseKinematics, elsewhere: Elsewhere) -> OpenParts:
    """Cut the rest of a box into parts that are no larger than the first cells, and ask what is in each."""
    boxes, d, clear = certificate.proven.boxes, certificate.equation.d, certificate.demands.clear
    tree = partition(boxes.low, boxes.high, [(-1.0, 1.0)] * d, lambda i: i + 1)
    low, high = _cut_up(*left_open(tree, [(-1.0, 1.0)] * d), region.grid)
    k = len(low)
    places = _places(low, high, max(1, min(ASKED, MOST_ASKED // max(k, 1))))
    count = places.shape[1]
    asked = asked_about(clear, region.poses_at(places.reshape(k * count, d)), ik)
    cause = asked.cause[::count].copy()
    found: list[TooNear | None] = [None] * k
    cause[cause == NEAR] = UNPROVEN
    for i in range(k):
        those = np.arange(i * count, (i + 1) * count)
        near = those[asked.cause[those] == NEAR]
        for j in near[np.argsort(-asked.short[near])].tolist():
            if clear is not None and not elsewhere(asked.poses[j], asked.q[j]):
                cause[i], found[i] = NEAR, asked.told(clear, j)
                break
        if cause[i] == UNPROVEN and elsewhere(asked.poses[those[0]], asked.q[those[0]]):
            cause[i] = ANOTHER
    return OpenParts(low, high, cause, tuple(found), region.shares(low, high))


def _places(low: Matrix, high: Matrix, count: int) -> Array:
    """(k, at most count, d) the middle of each box, and corners of it."""
    d = low.shape[1]
    corners = np.array(list(product((-1.0, 1.0), repeat=d)))
    chosen = np.random.default_rng(0).permutation(len(corners))[: count - 1]
    ends = np.vstack([np.zeros((1, d)), corners[np.sort(chosen)]])
    return ((low + high) / 2)[:, None] + ends * ((high - low) / 2)[:, None]


def _cut_up(low: Matrix, high: Matrix, grid: list[Vector]) -> tuple[Matrix, Matrix]:
    """Boxes (k, d), cut where a grid has its cuts; by fewer cuts of it where the parts would be too many."""
    stride = 1
    while np.prod([np.ceil((len(cuts) - 1) / stride) for cuts in grid]) > MOST_PARTS:
        stride += 1
    for axis, cuts in enumerate(grid):
        for at in cuts[1:-1:stride]:
            across = (low[:, axis] < at) & (at < high[:, axis])
            below, above = high[across], low[across]
            below[:, axis] = above[:, axis] = at
            low, high = (
                np.vstack([low[~across], low[across], above]),
                np.vstack([high[~across], below, high[across]]),
            )
    return low, high
