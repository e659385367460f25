"""Tool poses as users give them to inverse kinematics: a pose, a position alone, one for each frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.errors import ShapeError
from ...base.poses import PoseLike, pose_cure, pose_numbers
from ...base.types import ROTATION, Array, Indices, Matrix, Value, Vector, finite, last_row_gap, rotation_gap, tool_pose
from ...strategies.tasks.task import Task
from .solutions import InverseStatus


@dataclass(frozen=True, eq=False)
class GivenPoses(Value):
    """The readers of poses for a task. Of positions the rest is that of the start, `p` (3F,) and `R` (3F, 3)."""

    task: Task
    p: Vector
    R: Matrix

    def one(self, pose: PoseLike) -> tuple[Vector, Matrix]:
        """(position, rotation) of one pose. Raises: ShapeError, NotFiniteError, ArgumentError."""
        given = finite("a tool pose", pose_numbers("a tool pose", pose))
        wanted = self.shaped("a tool pose", given[None])[0]
        for one in wanted.reshape(-1, 4, 4) if wanted.shape[-2:] == (4, 4) else ():
            tool_pose("a tool pose", one)
        p, R = self.places(wanted[None])
        return p[0], R[0]

    def shaped(self, what: str, given: Array) -> Array:
        """Poses (k, 4, 4) or points (k, 3), (k, 2); of several frames (k, F, 4, 4), (k, F, 3) or (k, point).

        Raises: ShapeError.
        """
        frames, point = self.task.frames, self.task.point
        shapes = ((4, 4), (3,), (2,)) if frames == 1 else ((frames, 4, 4), (frames, 3), (point,))
        if given.shape[1:] not in shapes:
            raise ShapeError(what, " or ".join(map(str, shapes)), given.shape[1:], pose_cure(given))
        return given

    def places(self, wanted: Array) -> tuple[Matrix, Array]:
        """Positions (k, 3F) and rotations (k, 3F, 3); of zeros, which is none, where the last row is no pose's."""
        k, p, R = len(wanted), self.p, self.R
        if wanted.shape[-2:] == (4, 4):
            with np.errstate(invalid="ignore"):
                gap = last_row_gap(wanted)[..., None, None]
                turned = np.where(gap < ROTATION, wanted[..., :3, :3], 0.0 * gap)  # NaN where that row is not finite
            side = len(p)
            return np.ascontiguousarray(wanted[..., :3, 3]).reshape(k, side), turned.reshape(k, side, 3)
        points = wanted.reshape(k, int(np.prod(wanted.shape[1:])))
        missing = np.broadcast_to(p[points.shape[1] :], (k, len(p) - points.shape[1]))
        return np.hstack([points, missing]), np.broadcast_to(R, (k, *R.shape))

    def refused(self, p: Matrix, R: Array) -> Indices:
        """The statuses of bad poses; REACHED for the others."""
        status = np.full(len(p), int(InverseStatus.REACHED), dtype=np.intp)
        turned = rotation_gap(R.reshape(len(p), R.shape[1] // 3, 3, 3)).max(axis=1)
        status[~(turned < ROTATION)] = InverseStatus.NOT_A_ROTATION
        status[~(np.isfinite(p).all(axis=1) & np.isfinite(R).all(axis=(1, 2)))] = InverseStatus.NOT_FINITE
        return status
