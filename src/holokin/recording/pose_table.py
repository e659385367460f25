"""`read_workspace`: tool poses from a CSV file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from ..base.arguments import typed
from ..base.types import ArrayLike, check_rotation, finite
from ..errors import ArgumentError
from ..path.workspaces import TOOL_DOWN, PoseCloud, pose_cloud
from .pose_columns import Units, pose_rows


@typed
def read_workspace(
    path: str | Path,
    *,
    units: Literal["m", "mm"] | None = None,
    angles: Literal["rad", "deg"] | None = None,
    order: Literal["xyzw", "wxyz"] | None = None,
    rotation: ArrayLike | None = None,
    ignore: Sequence[str] = (),
) -> PoseCloud:
    """A workspace of the tool poses in a CSV file, a line each, in the frame of the robot's base.

    The columns are those of `read_waypoints`; without a unit they are in m and rad. With x, y, z alone the tool points
    down everywhere, as in `hk.workspace`, or as `rotation` says; a task of positions looks at the positions alone.

    Args:
        units, angles, order: as of `read_waypoints`, where the header does not say it.
        rotation: of the tool (3, 3), for a file of positions alone.
        ignore: columns to leave out, as of `read_waypoints`. Times are left out, and what `Coverage.save` wrote behind
            the poses.

    Raises:
        RecordingError: as of `read_waypoints`.
        ArgumentError: a rotation that is none, or for a file that has rotations.
    """
    if rotation is not None:
        rotation = finite("the rotation", rotation, (3, 3))
        check_rotation("the rotation", rotation)
    read = pose_rows(Path(path), "pose", Units(units, angles, order, True, tuple(ignore)))
    if rotation is not None and read.rotations is not None:
        raise ArgumentError("rotation", rotation.tolist(), f"leave it out: {path} has a rotation for each pose")
    poses = np.tile(np.eye(4), (len(read.points), 1, 1))
    poses[:, :3, 3] = read.points
    source = str(path)
    if read.rotations is None:
        poses[:, :3, :3] = TOOL_DOWN if rotation is None else rotation
        source += " with the tool down" if rotation is None else " with one rotation"
    else:
        poses[:, :3, :3] = read.rotations
    return pose_cloud(poses, source)
