"""Tables of points or poses: `read_workspace`, and the paths of a CSV file, with the units that it declares."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, FileError
from ...base.files import shown
from ...base.poses import pose_from
from ...base.tables import PoseRows, Units, pose_rows
from ...base.types import ArrayLike, Indices, Vector, check_rotation, finite
from ..path import HALF_TURN, SURE, Poses, Waypoints, distinct, rotations_along, turn_between
from ..workspaces import TOOL_DOWN, PoseCloud, pose_cloud

WIDE = np.deg2rad(170)
"""Turns [rad] from one waypoint to the next beyond which the shorter way round may not be the one that was meant."""


def read_table_of_paths(file: Path, text: str, units: Units) -> list[Waypoints]:
    """The paths of a CSV file, a row a waypoint; a column of names says which rows are one.

    Raises:
        FileError: as of `read_paths`.
    """
    read = pose_rows(file, "waypoint", units)
    names = read.names or [""] * len(read.points)
    starts = [0, *(i for i in range(1, len(names)) if names[i] != names[i - 1]), len(names)]
    comments = _comments(text, read.lines.tolist())
    return [_waypoints(file, read, slice(a, b), names[a], () if a else comments) for a, b in pairwise(starts)]


def _comments(text: str, rows: list[int]) -> tuple[str, ...]:
    """The comments of a table, but for one that is its header: the last one before the rows where no other line is."""
    lines = [(number, line.strip()) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    marked = [(number, line) for number, line in lines if line.startswith(("#", "//")) and number not in {*rows}]
    before = [number for number, line in lines if number < rows[0]]
    header = before[-1] if before and before == [number for number, _ in marked if number < rows[0]] else None
    return tuple(f"line {n}: {shown(line.lstrip('#/ '))}" for n, line in marked if n != header and line.strip("#/ "))


def _waypoints(file: Path, read: PoseRows, rows: slice, name: str, comments: tuple[str, ...]) -> Waypoints:
    """Rows of a table as a path. Raises: FileError."""
    lines = read.lines[rows]
    axes = None if read.axes is None else read.axes[rows]
    rotations = None if read.rotations is None else read.rotations[rows]
    notes = [] if rows.start else [*read.notes]
    if axes is not None:
        _note_wide_turns(file, np.arccos(np.clip(np.sum(axes[1:] * axes[:-1], axis=1), -1.0, 1.0)), lines, notes)
        rotations = rotations_along(axes)
    times = None if read.times is None else read.times[rows]
    try:
        poses, index, more = distinct(Poses(read.points[rows], rotations), times)
    except ArgumentError:
        where = f"line {lines[0]} begins path {shown(name)!r}, which has" if name else "has"
        raise FileError(file, f"{where} one waypoint", "give two at least that differ") from None
    if rotations is not None and axes is None:
        turns = np.linalg.norm(turn_between(rotations[index[:-1]], rotations[index[1:]]), axis=1)
        _note_wide_turns(file, turns, lines[index], notes)
    return Waypoints(
        poses.points,
        poses.rotations,
        None if times is None else _from_start(file, times[index], lines[index]),
        str(file),
        (*notes, *more),
        name,
        None if axes is None else axes[index],
        None if read.speeds is None else read.speeds[rows][index[1:]],
        comments=comments,
    )


@typed
def read_workspace(
    path: str | Path,
    *,
    units: Literal["m", "mm", "in"] | None = None,
    angles: Literal["rad", "deg"] | None = None,
    order: Literal["xyzw", "wxyz"] | None = None,
    rotation: ArrayLike | None = None,
    ignore: Sequence[str] = (),
    axis: Literal["into", "out"] | None = None,
) -> PoseCloud:
    """A workspace of the tool poses in a CSV file, a line each, in the frame of the robot's base.

    The columns are those of `read_paths`; without a unit they are in m and rad. With x, y, z alone the tool points down
    everywhere, as in `hk.workspace`, or as `rotation` says; a task of positions looks at the positions alone.
    Directions of the tool, i, j, k or nx, ny, nz, are no whole orientations: they are for a task of the tool's z axis,
    orientation="axis", and for one of positions.

    Args:
        units, angles, order: as of `read_paths`, where the header does not say it.
        rotation: of the tool (3, 3), for a file of positions alone.
        ignore: columns to leave out, as of `read_paths`. Times are left out, and what `Coverage.save` wrote behind
            the poses.
        axis: whether the directions point "into" the work, as the tool's z axis does, or "out" of it. By default
            "into", which the workspace says of itself.

    Raises:
        FileError: as of `read_paths`.
        ArgumentError: a rotation that is none, or for a file that has rotations or directions; an axis for one that
            has none.
    """
    if rotation is not None:
        rotation = finite("the rotation", rotation, (3, 3))
        check_rotation("the rotation", rotation)
    into = None if axis is None else axis == "into"
    read = pose_rows(Path(path), "pose", Units(units, angles, order, True, tuple(ignore), into=into))
    if axis is not None and read.axes is None:
        raise ArgumentError("axis", axis, f"leave it out: {path} has no directions of the tool")
    if rotation is not None and (read.rotations is not None or read.axes is not None):
        raise ArgumentError("rotation", rotation.tolist(), f"leave it out: {path} has a rotation for each pose")
    if read.axes is not None:
        turns = np.concatenate([rotations_along(along[None]) for along in read.axes])
        source = f"{path}, the tool's z axis as it says{'' if axis else ', into the work'}, its turn about it free"
        return replace(pose_cloud(pose_from(read.points, turns), source), directed=True)
    if read.rotations is not None:
        return pose_cloud(pose_from(read.points, read.rotations), str(path))
    source = f"{path} with the tool down" if rotation is None else f"{path} with one rotation"
    return pose_cloud(pose_from(read.points, TOOL_DOWN if rotation is None else rotation), source)


def _note_wide_turns(file: Path, turns: Vector, lines: Indices, notes: list[str]) -> None:
    """Raises: FileError: half a turn [rad], whose direction is by chance."""
    if not turns.max(initial=0.0) > WIDE:
        return
    i = int(np.argmax(turns))
    where = f"from line {lines[i]} to line {lines[i + 1]} the tool turns by"
    if turns[i] > SURE:
        raise FileError(file, f"{where} {np.degrees(turns[i]):.4g} degrees", HALF_TURN)
    way = "by the shorter way: put a waypoint between if it is not meant"
    notes.append(f"{where} {np.degrees(turns[i]):.0f} degrees, {way}")


def _from_start(file: Path, t: Vector, lines: Indices) -> Vector:
    back = np.flatnonzero(np.diff(t) <= 0)
    if back.size:
        i = int(back[0])
        what = "stands still" if t[i + 1] == t[i] else "runs backward"
        fact = f"time {what} from line {lines[i]} ({t[i]:.9g} s) to line {lines[i + 1]} ({t[i + 1]:.9g} s)"
        raise FileError(file, fact, "give rising times in seconds")
    return t - t[0]
