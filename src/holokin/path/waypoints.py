"""`Waypoints`: points or poses of the tool, as a file has them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..types import Array, Matrix, Value, Vector


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
        if self.rotations is None:
            return self.points
        poses = np.tile(np.eye(4), (len(self), 1, 1))
        poses[:, :3, 3], poses[:, :3, :3] = self.points, self.rotations
        return poses
