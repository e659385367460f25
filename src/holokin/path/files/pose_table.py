"""`read_waypoints` and `read_workspace`: points or poses of the tool from a CSV file, with the units it declares."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, FileError
from ...base.poses import pose_from
from ...base.tables import Units, pose_rows
from ...base.types import Array, ArrayLike, Indices, Vector, check_rotation, finite
from ..path import HALF_TURN, SURE, Poses, Waypoints, distinct, turn_between
from ..workspaces import TOOL_DOWN, PoseCloud, pose_cloud

WIDE = np.deg2rad(170)
"""Turns [rad] from one waypoint to the next beyond which the shorter way round may not be the one that was meant."""


@typed
def read_waypoints(
    path: str | Path,
    *,
    units: Literal["m", "mm"] | None = None,
    angles: Literal["rad", "deg"] | None = None,
    order: Literal["xyzw", "wxyz"] | None = None,
    ignore: Sequence[str] = (),
) -> Waypoints:
    """Waypoints of the tool from a CSV file, a line each; `hk.spline` and `hk.polyline` lead a path through them.

    The header names the columns, in any order: x, y, z; for the orientation, if there is one, qx, qy, qz, qw, or q1 to
    q4 or q0 to q3 with their `order`, or roll, pitch, yaw (about the axes x, y, z of the frame, in this order), or rx,
    ry, rz, a rotation vector, or a, b, c, KUKA's angles, R = Rz(a) Ry(b) Rx(c) [KSS]; for the time, if there is one, t,
    time, stamp, timestamp, sec or seconds, or sec and nanosec; or T00, T01, ..., T23, the first three rows of the
    pose's matrix. A unit may stand at the end of a name: x_mm, roll_deg, t_ms, "x [mm]"; Unix time in ms, us or ns is
    told by its size. Columns named name, label, comment, remark, note, id, index, number, point,
    line or row are passed over; any other is refused.

    Args:
        units: of x, y, z where the header names none. Nobody guesses: one of the two must say it.
        angles: of roll, pitch, yaw and of rotation vectors, likewise.
        order: of the numbers of a quaternion in columns q1 to q4 or q0 to q3.
        ignore: columns to leave out, by their names in the header, or patterns with *, as in ["speed", "tool_*"].

    Returns:
        Waypoints whose `notes` say what was repaired, and what looks odd.

    Raises:
        FileError: no such file, unreadable; missing columns, columns that are not understood,
            no unit; text or NaN in a cell, with line and column;
            values that look like another unit; quaternions that are not of unit length; times that do not rise; half a
            turn from a line to the next.
    """
    file = Path(path)
    read = pose_rows(file, "waypoint", Units(units, angles, order, False, tuple(ignore)))
    try:
        poses, distinct_rows, notes = distinct(Poses(read.points, read.rotations), read.times)
    except ArgumentError:
        raise FileError(file, "has one waypoint", "give two at least that differ") from None
    if poses.rotations is not None:
        _note_wide_turns(file, poses.rotations, read.lines[distinct_rows], read.notes)
    times = None if read.times is None else _from_start(file, read.times[distinct_rows], read.lines[distinct_rows])
    return Waypoints(poses.points, poses.rotations, times, str(file), (*read.notes, *notes))


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
        FileError: as of `read_waypoints`.
        ArgumentError: a rotation that is none, or for a file that has rotations.
    """
    if rotation is not None:
        rotation = finite("the rotation", rotation, (3, 3))
        check_rotation("the rotation", rotation)
    read = pose_rows(Path(path), "pose", Units(units, angles, order, True, tuple(ignore)))
    if rotation is not None and read.rotations is not None:
        raise ArgumentError("rotation", rotation.tolist(), f"leave it out: {path} has a rotation for each pose")
    if read.rotations is not None:
        return pose_cloud(pose_from(read.points, read.rotations), str(path))
    source = f"{path} with the tool down" if rotation is None else f"{path} with one rotation"
    return pose_cloud(pose_from(read.points, TOOL_DOWN if rotation is None else rotation), source)


def _note_wide_turns(file: Path, rotations: Array, lines: Indices, notes: list[str]) -> None:
    """Raises: FileError: half a turn, whose direction is by chance."""
    turns = np.linalg.norm(turn_between(rotations[:-1], rotations[1:]), axis=1)
    i = int(np.argmax(turns))
    if turns[i] > SURE:
        fact = f"from line {lines[i]} to line {lines[i + 1]} the tool turns by {np.degrees(turns[i]):.4g} degrees"
        raise FileError(file, fact, HALF_TURN)
    if turns[i] > WIDE:
        notes.append(
            f"from line {lines[i]} to line {lines[i + 1]} the tool turns by {np.degrees(turns[i]):.0f} degrees, by the "
            "shorter way: put a waypoint between if it is not meant"
        )


def _from_start(file: Path, t: Vector, lines: Indices) -> Vector:
    back = np.flatnonzero(np.diff(t) <= 0)
    if back.size:
        i = int(back[0])
        what = "stands still" if t[i + 1] == t[i] else "runs backward"
        fact = f"time {what} from line {lines[i]} ({t[i]:.9g} s) to line {lines[i + 1]} ({t[i + 1]:.9g} s)"
        raise FileError(file, fact, "give rising times in seconds")
    return t - t[0]
