"""A workspace as one types it: a few words, a table of a job file, or a CSV file of poses."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ..base.types import Matrix
from ..errors import ArgumentError, HolokinError
from ..path import read_workspace
from ..path.workspaces import Workspace, workspace
from ..symbolic.rotations import rotation_from_rpy
from .cover_strategies import build_workspace
from .job_file import read_workspace_table

EXAMPLE = (
    'write "box X Y Z HX HY HZ", "cylinder X Y Z RADIUS HALF-HEIGHT" or "sphere X Y Z RADIUS" in metres, and behind '
    'it, as needed, "tilt DEG", "spin DEG", and for the middle orientation "rpy DEG DEG DEG" or "start", that of the '
    "start posture; or give a .toml file with a [workspace] table, or a .csv file of poses"
)
"""What may be typed."""

SIZES = {"box": (6, 4), "cylinder": (5,), "sphere": (4, 3)}
"""Numbers after the name of a solid; fewer in a plane."""

TURNS = {"tilt": 1, "spin": 1, "rpy": 3, "start": 0}
"""Numbers after a word about the tool's orientation [degrees]; "start" is that of the tool at the start."""


def parse_workspace(text: str, *, planar: bool = False, at_start: Matrix | None = None) -> Workspace:
    """The workspace of a text: "box 0.5 0 0.3 0.25 0.4 0.3 tilt 40 spin 90", or of a file with [workspace] or of poses.

    Args:
        planar: the tool of the robot stays in a plane: the middle orientation is that of the base, else tool down.
        at_start: rotation (3, 3) of the tool at the start posture, if that is known.

    Raises:
        ArgumentError: words that say no workspace. JobError, RecordingError: of a file.
    """
    file = FilePath(text)
    if file.suffix.lower() == ".csv":
        return read_workspace(file)
    if file.suffix.lower() == ".toml":
        return build_workspace(read_workspace_table(file), at_start, file)
    found = _phrases(text)
    solids = [name for name in found if name in SIZES]
    if len(solids) != 1 or len(found[solids[0]]) not in SIZES[solids[0]]:
        raise ArgumentError("the workspace", text, EXAMPLE)
    name, angles = solids[0], np.deg2rad(found.get("tilt", [0.0]) + found.get("spin", [0.0]))
    rotation = np.eye(3) if planar else None
    if "start" in found:
        if at_start is None or "rpy" in found:
            raise ArgumentError("the workspace", text, 'for the orientation "start" give a start posture, and no rpy')
        rotation = at_start
    elif "rpy" in found:
        rotation = rotation_from_rpy(np.deg2rad(found["rpy"]).tolist())
    try:
        sizes: Any = {name: _sizes(name, found[name])}
        return workspace(**sizes, rotation=rotation, tilt=angles[0], spin=angles[1])
    except HolokinError as problem:
        raise ArgumentError("the workspace", text, f"{problem}") from None


def _phrases(text: str) -> dict[str, list[float]]:
    """Each word -> the numbers after it. Raises: ArgumentError."""
    found: dict[str, list[float]] = {}
    last: list[float] | None = None
    for token in text.replace(",", " ").lower().split():
        if token in SIZES or token in TURNS:
            if token in found:
                raise ArgumentError("the workspace", text, f"say {token} once")
            last = found[token] = []
            continue
        try:
            number = float(token)
        except ValueError:
            number = np.nan
        if last is None or not np.isfinite(number):
            raise ArgumentError("the workspace", text, f"{token!r} is not understood: {EXAMPLE}")
        last.append(number)
    for word, count in TURNS.items():
        if word in found and len(found[word]) != count:
            cure = f"give {count or 'no'} number{'s' * (count != 1)} after {word}" + ", in degrees" * (count > 0)
            raise ArgumentError("the workspace", text, cure)
        if word in ("tilt", "spin") and word in found and not 0 <= found[word][0] <= 180:
            raise ArgumentError("the workspace", text, f"give 0 to 180 degrees after {word}")
    return found


def _sizes(name: str, numbers: list[float]) -> tuple[object, ...]:
    """The numbers of a solid as `workspace` takes them."""
    if name == "box":
        half = len(numbers) // 2
        return numbers[:half], numbers[half:]
    if name == "sphere":
        return numbers[:-1], numbers[-1]
    return numbers[:3], numbers[3], numbers[4]
