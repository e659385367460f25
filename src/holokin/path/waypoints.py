"""`Waypoints`: points or poses of the tool, as a file has them; and those of arrays."""

from __future__ import annotations

from dataclasses import dataclass
from math import dist, hypot, sqrt

import numpy as np

from ..base.poses import PoseLike, pose_cure, pose_from, pose_numbers
from ..base.types import Array, Indices, Matrix, Value, Vector, check_rotation, finite, right_last_row
from ..errors import ArgumentError, ShapeError
from .path import SAME


@dataclass(frozen=True, eq=False)
class Waypoints(Value):
    """Points (k, 3) [m] of the tool, with rotations (k, 3, 3) and times (k,) [s] where they are given.

    `notes` says what was changed in reading, and what looks odd.
    """

    points: Matrix
    rotations: Array | None = None
    times: Vector | None = None
    source: str = ""
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.points)

    @property
    def targets(self) -> Array:
        """Poses (k, 4, 4); points (k, 3) where there are no rotations."""
        return self.points if self.rotations is None else pose_from(self.points, self.rotations)


@dataclass(frozen=True, eq=False)
class Poses(Value):
    """Points (k, 3) [m] and, where the tool turns, rotations (k, 3, 3)."""

    points: Matrix
    rotations: Array | None

    def __len__(self) -> int:
        return len(self.points)

    def at(self, index: object) -> Poses:
        """Some of them."""
        return Poses(self.points[index], None if self.rotations is None else self.rotations[index])  # type: ignore[index]


def distinct(poses: Poses, more: Vector | None = None) -> tuple[Poses, Indices, tuple[str, ...]]:
    """The poses that are not the one before, their indices, and a note on the others.

    Of poses within `SAME` of each other the first one is kept. A last pose within it of the first one becomes that.

    Args:
        more: times (k,) [s] or angles turned [rad], by which a rest or a turn on the spot is told from a repeat.

    Raises:
        ArgumentError: not even two are left.
    """
    rows = poses.points
    if more is not None:
        rows = np.column_stack([rows, more])
    if poses.rotations is not None:  # divided so that the distance of two is their angle
        rows = np.hstack([rows, poses.rotations.reshape(-1, 9) / sqrt(2)])
    rows = rows.tolist()
    kept: list[int] = []
    for i, row in enumerate(rows):
        if not kept or dist(row, rows[kept[-1]]) > SAME:
            kept.append(i)
    if len(kept) < 2:
        raise ArgumentError("the number of points that differ", len(kept), f"give at least two, {SAME:g} m apart")
    index = np.array(kept)
    repeats = len(rows) - len(kept)
    what = "point" if repeats == 1 else "points"
    notes = (f"{repeats} repeated {what} left out, within {SAME:g} m of the one before",) * (repeats > 0)
    return returned(poses.at(index) if notes else poses), index, notes


def meets(poses: Poses) -> bool:
    """Whether the last pose is the first one."""
    off = dist(poses.points[0].tolist(), poses.points[-1].tolist())
    if poses.rotations is None:
        return off <= SAME
    turned = dist(poses.rotations[0].ravel().tolist(), poses.rotations[-1].ravel().tolist()) / sqrt(2)
    return hypot(off, turned) <= SAME


def returned(poses: Poses) -> Poses:
    """The poses, where the last one is the first one, so to the last bit."""
    return poses.at(np.append(np.arange(len(poses) - 1), 0)) if meets(poses) else poses


def as_poses(points: PoseLike | Waypoints) -> Poses:
    """Points (k, 3), (k, 2), poses (k, 4, 4) or waypoints. Raises: ShapeError, NotFiniteError, ArgumentError."""
    if isinstance(points, Waypoints):
        return Poses(points.points, points.rotations)
    given = pose_numbers("the waypoints", points)
    if given.ndim == 3:
        poses = finite("the waypoints", given, ("k", 4, 4))
        for i, pose in enumerate(poses):
            right_last_row(f"waypoint {i}", pose)
            check_rotation(f"the rotation of waypoint {i}", pose[:3, :3])
        return Poses(poses[:, :3, 3], poses[:, :3, :3])
    if given.ndim != 2 or pose_cure(given):
        cure = pose_cure(given) or "give points or poses, one a row"
        raise ShapeError("the waypoints", "(k, 3) or (k, 4, 4)", given.shape, cure)
    if given.shape[1] == 2:
        given = np.column_stack([given, np.zeros(len(given))])
    return Poses(finite("the waypoints", given, ("k", 3)), None)
