"""`TooNear`: a posture on a leaf at which two shapes are nearer than a proof was to show: there none can succeed.

The distances are those of `check`, at postures that are found in doubles: of meshes their own, not of their hulls.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.types import Matrix, Value, Vector
from ..motion import follow
from ..path import Path
from ..robot.numeric import joint_frames
from .certificate import Certificate
from .clear_cells import ClearCells

SURE = 1e-9
"""Distances [m] are less than asked by more than this, where something is said to be too near: they are rounded."""

ALONG = 1000
"""Samples of a path at which a posture is sought that is too near."""


@dataclass(frozen=True, eq=False)
class TooNear(Value):
    """A tool pose (4, 4), the posture q (n,) of the leaf there, and the two things that are `distance` [m] apart at it,
    negative for how deep the one is in the other, where `wanted` [m] was asked."""

    pose: Matrix
    q: Vector
    names: tuple[str, str]
    distance: float
    wanted: float

    def __str__(self) -> str:
        at = ", ".join(f"{x:.4g}" for x in self.pose[:3, 3])
        asked = f", where {self.wanted:.3g} m was asked" if self.wanted else ""
        return f"with the tool at [{at}] m {apart_words(self.names, self.distance)}{asked}"


def apart_words(names: tuple[str, str], distance: float) -> str:
    """How far apart two things are, or how deep the one is in the other."""
    both = " and ".join(names)
    if distance > 0:
        return f"{both} are {distance:.3g} m apart"
    return f"{both} overlap by {-distance:.3g} m" if distance else f"{both} touch"


def gap_distances(clear: ClearCells, Q: Matrix) -> Matrix:
    """(k, gaps) how far apart things are at postures Q (k, n), as `check` has it: `clear.looked_at.gaps`."""
    gaps, limits = clear.looked_at.gaps, clear.looked_at.limits
    if not (len(Q) and gaps):
        return np.zeros((len(Q), len(gaps)))
    frames, every = joint_frames(clear.robot, Q), np.arange(len(Q))
    found = [gap.distances(frames, every, limit + SURE) for gap, limit in zip(gaps, limits, strict=True)]
    return np.column_stack(found)


def short_of(clear: ClearCells, distances: Matrix) -> Matrix:
    """(k, gaps) by how much distances [m] are less than is asked: positive where something is too near."""
    return np.array(clear.looked_at.limits) - SURE - distances


def too_near_at(clear: ClearCells, pose: Matrix, q: Vector) -> TooNear | None:
    """What is too near at a posture (n,), the worst of it; None where nothing is."""
    apart = gap_distances(clear, q[None])[0]
    short = short_of(clear, apart)
    worst = int(np.argmax(short))
    if not short[worst] > 0:
        return None
    looked_at = clear.looked_at
    return TooNear(pose, q, looked_at.gaps[worst].names, float(apart[worst]), looked_at.limits[worst])


def too_near_along(certificate: Certificate) -> TooNear | None:
    """A posture along the path of a certificate at which something is too near; None where samples show none."""
    clear, path = certificate.demands.clear, certificate.asked
    if clear is None or not isinstance(path, Path):
        return None
    strategy = certificate.equation.strategy
    q0 = certificate.anchors.q[0][: strategy.task.n]
    walk = follow(strategy, path, q0, samples=ALONG, limits=certificate.limits is not None)
    Q = walk.q[np.isfinite(walk.q).all(axis=1)]
    worst = Q[int(np.argmax(short_of(clear, gap_distances(clear, Q)).max(axis=1)))]
    return too_near_at(clear, strategy.task.pose(worst), worst)
