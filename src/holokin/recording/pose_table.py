"""`read_workspace`: tool poses from a CSV file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..arguments import typed
from ..errors import ArgumentError, RecordingError
from ..types import ROTATION, Array, ArrayLike, Indices, Matrix, check_rotation, finite, rotation_cure, rotation_gap
from ..workspaces import TOOL_DOWN, PoseCloud, pose_cloud
from .csv_log import csv_pieces
from .log import listed
from .reading import is_folder

POSITION = ("x", "y", "z")
QUATERNION = ("qx", "qy", "qz", "qw")
ANGLES = ("roll", "pitch", "yaw")
MATRIX = tuple(f"T{row}{column}" for row in range(3) for column in range(4))
"""Columns of a pose as the first three rows of its matrix, counted from 0; a last row may stand there too."""

KINDS = ((*POSITION, *QUATERNION), (*POSITION, *ANGLES), MATRIX, POSITION)

LENGTH = 1e-3
"""How far a quaternion's length may be from 1: four written digits leave 1e-4."""

TURN = 2 * np.pi
"""Largest angle [rad] that is believed when nobody says that the file has degrees."""


@typed
def read_workspace(path: str | Path, *, degrees: bool | None = None, rotation: ArrayLike | None = None) -> PoseCloud:
    """A workspace of the tool poses in a CSV file, a line each, in the frame of the robot's base.

    The header names the columns, in any order, others are left out: x, y, z [m] with qx, qy, qz, qw (scalar last) or
    with roll, pitch, yaw (about the base's axes x, y, z, in this order [rad]); or T00, T01, ..., T23, the first three
    rows of the pose's matrix. With x, y, z alone the tool points down everywhere, as in `hk.workspace`, or as
    `rotation` says; a task of positions looks at the positions alone.

    Args:
        degrees: True when roll, pitch and yaw are in degrees; None refuses values that only fit as degrees.
        rotation: of the tool (3, 3), for a file of positions alone.

    Raises:
        RecordingError: no such file, unreadable, columns missing, no lines, text or NaN in a cell, a quaternion that is
            not of unit length, a matrix that is no rotation (with the line, and how far off it is), degrees=True of a
            file without these angles, two columns of one name.
        ArgumentError: a rotation that is none, or for a file that has rotations.
    """
    if rotation is not None:
        rotation = finite("the rotation", rotation, (3, 3))
        check_rotation("the rotation", rotation)
    file = Path(path)
    if is_folder(file):
        raise RecordingError(file, "is a folder", "give a CSV file of poses")
    kind: tuple[str, ...] = ()

    def wanted(header: Sequence[str]) -> list[int]:
        nonlocal kind
        names = [name.lower() for name in header]
        for kind in KINDS:
            if all(name.lower() in names for name in kind):
                if kind is POSITION and (part := [n for n in (*QUATERNION, *ANGLES, *MATRIX) if n.lower() in names]):
                    fact = f"its rotations are incomplete: of them there is only {listed(part)}"
                    raise RecordingError(file, fact, "give all of qx, qy, qz, qw, or of roll, pitch, yaw, or none")
                return [names.index(name.lower()) for name in kind]
        cure = "name x, y, z alone or with qx, qy, qz, qw or roll, pitch, yaw; or T00, T01, ..., T23"
        raise RecordingError(file, f"its columns {listed(header)} are no pose", cure)

    found = [(table, places) for table, _, places in csv_pieces(file, wanted, "give a pose a line", "x, y, z, qx, ...")]
    if not found:
        raise RecordingError(file, "has a header but no poses", "give a pose a line")
    table = np.vstack([rows for rows, _ in found])
    lines = np.concatenate([places for _, places in found])
    if degrees and ANGLES[0] not in kind:
        what = {MATRIX: "a matrix", POSITION: "left open"}.get(kind, "a quaternion")
        raise RecordingError(file, f"has no angles: its rotation is {what}", "leave out degrees=True")
    if rotation is not None and kind is not POSITION:
        raise ArgumentError("rotation", rotation.tolist(), f"leave it out: {file} has a rotation for each pose")
    poses = np.tile(np.eye(4), (len(table), 1, 1))
    source = str(file)
    if kind is POSITION:
        poses[:, :3, 3], poses[:, :3, :3] = table, TOOL_DOWN if rotation is None else rotation
        source += " with the tool down" if rotation is None else " with one rotation"
    elif kind is MATRIX:
        poses[:, :3] = table.reshape(-1, 3, 4)
        _check_rotations(file, poses, lines)
    else:
        poses[:, :3, 3] = table[:, :3]
        turned = table[:, 3:], lines
        angles = ANGLES[0] in kind
        poses[:, :3, :3] = _of_angles(file, *turned, degrees) if angles else quaternion_rotations(file, *turned)
    return pose_cloud(poses, source)


def _check_rotations(file: Path, poses: Array, lines: Indices) -> None:
    for line, pose in zip(lines, poses, strict=True):
        if not rotation_gap(pose[:3, :3]) < ROTATION:
            raise RecordingError(file, f"line {line} has no rotation", rotation_cure(pose[:3, :3]))


def quaternion_rotations(file: Path, values: Matrix, lines: Indices) -> Array:
    """Rotations (k, 3, 3) of quaternions (k, 4), qw last. Raises: RecordingError: one is not of unit length."""
    from scipy.spatial.transform import Rotation

    off = np.abs(np.linalg.norm(values, axis=1) - 1)
    if (off > LENGTH).any():
        i = int(np.argmax(off > LENGTH))
        fact = f"line {lines[i]} has a quaternion of length {np.linalg.norm(values[i]):.6g}"
        more = f", and {int((off > LENGTH).sum()) - 1} lines after it" if (off > LENGTH).sum() > 1 else ""
        raise RecordingError(file, f"{fact}, {off[i]:.2g} away from 1{more}", "give unit quaternions, qw the scalar")
    return Rotation.from_quat(values).as_matrix()


def _of_angles(file: Path, values: Matrix, lines: Indices, degrees: bool | None) -> Array:
    from scipy.spatial.transform import Rotation

    far = (np.abs(values) > TURN).any(axis=1)
    if degrees is None and far.any():
        i = int(np.argmax(far))
        fact = f"line {lines[i]} has an angle of {np.abs(values[i]).max():g}, over a turn in rad"
        raise RecordingError(file, fact, "say degrees=True if the angles are in degrees, degrees=False if in rad")
    return Rotation.from_euler("xyz", values, degrees=bool(degrees)).as_matrix()
