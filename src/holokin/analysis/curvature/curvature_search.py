"""Where does curvature stand out of its round-off? Looking at postures, and climbing from the best."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...base.types import Array, Flags, Indices, Matrix, Vector
from .region import Region
from .roundoff import is_shown, measured, noise

JUDGED = 1e-7
"""rcond below which curvature is not judged: a nudge of 1e-11 would be a step towards the singularity."""

HIDDEN = 1e-6
"""Relative round-off [1/rad] above which a posture tells nothing: the weakest defect that matters could hide in it."""

PIECE = 65_536
"""Postures that are evaluated at once, so that memory does not grow with their number."""

AGAIN = 16
"""Of so many postures one is looked at again before climbing, at 16 nudged copies, which doubles the work: a tail of
1e-14 is told from round-off by its mean over them."""

FAINT = 3.0
"""Mean over scatter from which a climb is worth trying: round-off alone made 2.2 at most."""

STARTS = 16
"""Postures from which curvature is maximised."""

ROUNDS = 60
"""Steps of a climb; from a tenth of the region they fall or grow, by 0.4 or 1.5, to where it ends."""

SIDE = 1 / 256
"""Share of the region over which differences of log |F| are taken; exact for a Gaussian of any width."""

Field = Callable[[Matrix], tuple[Array, Vector]]
"""Postures (k, n) -> relative curvature (k, n, p) in p planes, rcond (k,)."""


@dataclass(frozen=True, eq=False)
class Scan:
    """Relative curvature (k, p), sizes only, at postures Q (k, n); `sound` (k,): regular enough to be judged."""

    Q: Matrix
    sizes: Matrix
    rcond: Vector
    sound: Flags


@dataclass(frozen=True, eq=False)
class Extreme:
    """What stands out most, of all postures judged: row of Q and plane, size, and the size that counts as zero there.

    `undecided` (k,): postures whose curvature round-off hides; of those that were looked at twice, if any is shown.
    """

    shown: bool
    row: int
    plane: int
    size: float
    allowed: float
    undecided: Flags


def scan(field: Field, Q: Matrix) -> Scan:
    """The relative curvature at every posture."""
    parts = [field(Q[i : i + PIECE]) for i in range(0, len(Q), PIECE)]
    with np.errstate(all="ignore"):
        sizes = np.concatenate([np.linalg.norm(F, axis=1) for F, _ in parts])
    rcond = np.concatenate([found for _, found in parts])
    return Scan(Q, sizes, rcond, (rcond > JUDGED) & np.isfinite(sizes).all(axis=1))


def merged(a: Scan, b: Scan) -> Scan:
    """Both, one after the other."""
    return Scan(
        np.concatenate([a.Q, b.Q]),
        np.concatenate([a.sizes, b.sizes]),
        np.concatenate([a.rcond, b.rcond]),
        np.concatenate([a.sound, b.sound]),
    )


def examine(field: Field, seen: Scan, tolerance: float) -> Extreme | None:
    """The largest curvature above `tolerance` that is more than round-off, or else the one that comes nearest to it.

    Whatever passes the tolerance is looked at again, the largest first, until one stands out of its round-off.
    None: no posture can be judged.
    """
    sizes, allowed, undecided = seen.sizes.copy(), np.full(seen.sizes.shape, tolerance), np.zeros(len(seen.Q), bool)
    highest = sizes.max(axis=1)
    doubtful = np.flatnonzero(seen.sound & (highest > tolerance))
    doubtful = doubtful[np.argsort(-highest[doubtful])]
    for rows in _batches(doubtful):
        mean, scatter = measured(lambda Q: field(Q)[0], seen.Q[rows])
        with np.errstate(all="ignore"):
            size = np.linalg.norm(mean, axis=1)
        clear = is_shown(size, scatter)
        standing = np.where(clear & (size > tolerance), seen.sizes[rows], 0.0)
        undecided[rows] = (~clear & (noise(scatter) > HIDDEN)).any(axis=1)
        if standing.any():
            k, p = np.unravel_index(int(np.argmax(standing)), standing.shape)
            undecided[rows] &= ~standing.any(axis=1)
            return Extreme(True, int(rows[k]), int(p), float(standing[k, p]), tolerance, undecided)
        sizes[rows], allowed[rows] = size, np.maximum(tolerance, noise(scatter))
    counted = np.flatnonzero(seen.sound & ~undecided)
    if not len(counted):
        return None
    k, p = np.unravel_index(int(np.argmax(sizes[counted] / allowed[counted])), (len(counted), sizes.shape[1]))
    row = int(counted[k])
    return Extreme(False, row, int(p), float(sizes[row, p]), float(allowed[row, p]), undecided)


def maximised(field: Field, region: Region, seen: Scan) -> Matrix:
    """Postures (j, n) of the region to which log |F| rises from those seen where it stands out of round-off most.

    A curvature far below any tolerance counts: its tail leads to where it is large.
    """
    order = np.flatnonzero(seen.sound)
    quiet = seen.sizes[order].max(axis=1) * seen.rcond[order] ** 2  # round-off grows as 1 / rcond^2
    rows = order[np.argsort(-quiet)][: -(-len(seen.Q) // AGAIN)]
    if not len(rows):
        return seen.Q[:0]
    mean, scatter = measured(lambda Q: field(Q)[0], seen.Q[rows])
    size = np.linalg.norm(mean, axis=1)
    signal = np.where(size > FAINT * scatter, size, 0.0).max(axis=1)
    best = np.argsort(-signal)[:STARTS]
    return _climb(field, region, seen.Q[rows[best[signal[best] > 0]]])


def _climb(field: Field, region: Region, Q: Matrix) -> Matrix:
    if not len(Q):
        return Q
    width = region.upper - region.lower
    n, step = region.n, np.full(len(Q), 0.1)
    height = _height(field, Q)
    for _ in range(ROUNDS):
        shift = SIDE * width * np.eye(n)
        beside = np.stack([Q[:, None] + shift, Q[:, None] - shift], axis=1)  # (j, 2, n, n)
        levels = _height(field, np.clip(beside, region.lower, region.upper).reshape(-1, n)).reshape(len(Q), 2, n)
        slope = np.nan_to_num(levels[:, 0] - levels[:, 1], nan=0.0, posinf=0.0, neginf=0.0)
        slope /= np.maximum(np.linalg.norm(slope, axis=1), 1e-300)[:, None]
        trial = np.clip(Q + step[:, None] * slope * width, region.lower, region.upper)
        there = _height(field, trial)
        better = there > height
        Q, height = np.where(better[:, None], trial, Q), np.where(better, there, height)
        step *= np.where(better, 1.5, 0.4)
    return Q


def _height(field: Field, Q: Matrix) -> Vector:
    """log of the largest relative curvature; -inf where it is zero or not judged."""
    seen = scan(field, Q)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(seen.sound, np.log(seen.sizes.max(axis=1)), -np.inf)


def _batches(rows: Indices) -> list[Indices]:
    """A few first, since a real curvature shows at once, then the rest."""
    edges = [0, 8, 128, *range(2176, len(rows) + 2048, 2048)]
    return [rows[a:b] for a, b in pairwise(edges) if a < len(rows)]
