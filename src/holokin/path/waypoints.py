"""`Waypoints`: points or poses of the tool, as a file has them; and those of arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.poses import PoseLike, pose_cure, pose_from, pose_numbers
from ..base.types import Array, Matrix, Value, Vector, check_rotation, finite, right_last_row
from ..errors import ShapeError
from .path import as_point


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
    return Poses(np.array([as_point(p) for p in given]), None)
