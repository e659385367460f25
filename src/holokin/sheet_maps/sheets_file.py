"""A map of sheets as a file: arrays of numbers, and a text that says what they are of. Nothing in it is code."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..base.arguments import typed
from ..base.files import replacing
from ..base.types import Array, Matrix, Vector
from ..errors import ArgumentError, SheetsFileError
from ..path.workspaces import Box, Cylinder, PoseCloud, PoseRange, Solid, Sphere, Workspace, pose_cloud
from ..strategies import HolonomicStrategy
from ..tasks.task import Task
from .sheet import Sheet, known
from .sheet_map import Sheets
from .surroundings import Surroundings

FORMAT = 2
"""Changed when files of before cannot be read any more."""

MOST_BYTES = 1 << 30
"""Size of a file's arrays, unpacked, from which on they are not read."""

OFF = 1e-6
"""By how much [m, rad, units of g] the postures of a file may be off their poses and leaves."""

SOLIDS: dict[str, tuple[type[Solid], tuple[str, ...]]] = {
    "box": (Box, ("center", "sides")), "cylinder": (Cylinder, ("center", "radius", "height")),
    "sphere": (Sphere, ("center", "radius")),
}  # fmt: skip

Build = Callable[[Mapping[str, Any], Task, Vector, str], HolonomicStrategy]
"""The strategy of the keys of a job, and of its name."""


@typed
def write_sheets(found: Sheets, path: str | Path) -> None:
    """Write a map of sheets, complete or not at all.

    Raises:
        ArgumentError: strategies that were given as values, which no file can hold. WriteError.
    """
    for sheet in found.sheets:
        if not sheet.keys and found.task.n > found.task.m:
            cure = "a file holds strategies that hk.sheets chose itself, or pickle the map: pickle.dump(sheets, file)"
            raise ArgumentError("the strategy of a sheet", sheet.name, cure)
    about = {
        "format": FORMAT, "robot": found.task.robot.name, "joints": found.task.robot.joint_names,
        "task": found.task.name,
        "leaves": [{"name": one.name, "keys": dict(one.keys), "rcond": one.rcond} for one in found.sheets],
        "workspace": _workspace_keys(found.workspace), "length": found.length, "stopped": found.stopped,
        "least": found.least, "least_cuts": found.least_cuts, "candidates": found.candidates,
        "around": None if found.around is None else found.around.digest,
    }  # fmt: skip
    q0 = np.array([one.q0 for one in found.sheets]).reshape(-1, found.task.n)
    with replacing(path) as part, part.open("wb") as stream:
        np.savez_compressed(
            stream, about=np.frombuffer(json.dumps(about).encode(), dtype=np.uint8), q0=q0, poses=found.poses,
            q=found.q, labels=found.labels, rest=found.rest, pairs=found.pairs, cuts=found.cuts, cloud=_cloud(found),
        )  # fmt: skip


def sheets_of_file(path: str | Path, task: Task, around: Surroundings | None, build: Build) -> Sheets:
    """The map of a file, for the task that it was made for.

    Raises:
        SheetsFileError: it cannot be read, or is of another robot, task or surroundings.
    """
    file = Path(path)
    about, arrays = _read(file)
    try:
        wanted = (task.robot.name, list(task.robot.joint_names), task.name)
        given = (about["robot"], about["joints"], about["task"])
        if given != wanted:
            raise SheetsFileError(file, f"it is of {given}", f"give that robot and task, not {wanted}")
        if about["around"] != (None if around is None else around.digest):
            cure = "give clear_of, floor, clearance, self_collision and ignore as they were given to hk.sheets"
            raise SheetsFileError(file, "it is of other surroundings", cure)
        sheets = tuple(
            _sheet(build(one["keys"], task, q0, str(one["name"])), q0, one, q, arrays["poses"])
            for one, q0, q in zip(about["leaves"], arrays["q0"], arrays["q"], strict=True)
        )
        cloud = arrays["cloud"] if len(arrays.get("cloud", ())) else arrays["poses"]
        found = Sheets(
            task, _workspace_of(about["workspace"], cloud), sheets, arrays["poses"], arrays["q"], arrays["labels"],
            arrays["rest"], arrays["pairs"], arrays["cuts"], int(about["least_cuts"]),
            int(about["least"]), int(about["candidates"]), float(about["length"]), around, bool(about["stopped"]),
        )  # fmt: skip
    except (KeyError, TypeError, ValueError) as problem:
        raise SheetsFileError(file, f"it lacks {problem}", "write it again") from None
    _check(file, found)
    return found


def _sheet(strategy: HolonomicStrategy, q0: Vector, about: Mapping[str, Any], q: Matrix, poses: Array) -> Sheet:
    """A sheet whose stations are its postures q (k, n) at the poses (k, 4, 4), NaN where it has none."""
    there = known(q)
    return Sheet(strategy, q0, float(about["rcond"]), about["keys"], q[there], poses[there])


def _read(file: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    try:
        with zipfile.ZipFile(file) as packed:
            if sum(one.file_size for one in packed.infolist()) > MOST_BYTES:
                raise SheetsFileError(file, "it is larger than a gigabyte", "write it again with fewer samples")
        with np.load(file, allow_pickle=False) as loaded:
            arrays = {name: loaded[name] for name in loaded.files}
        about = json.loads(arrays.pop("about").tobytes())
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as problem:
        raise SheetsFileError(file, f"it cannot be read: {problem}", "give a file that a map of sheets saved") from None
    if not isinstance(about, dict) or about.get("format") != FORMAT:
        raise SheetsFileError(file, "it is of another version", "write it again with this one")
    return about, arrays


def _check(file: Path, found: Sheets) -> None:
    """The arrays fit each other, and the postures are on their leaves, at their poses, within the limits."""
    S, k, n, bad = len(found), len(found.poses), found.task.n, None
    shapes = [found.q.shape == (S, k, n), found.labels.shape == (k,), found.rest.shape == (k,)]
    shapes += [bool(np.isfinite(found.poses).all())]
    whole = all(one.dtype.kind == "i" for one in (found.labels, found.rest, found.pairs, found.cuts))
    if (
        not (all(shapes) and whole)
        or found.labels.min(initial=0) < -1
        or found.labels.max(initial=-1) >= S
        or np.abs(found.pairs).max(initial=0) >= max(k, 1)
        or not known(found.q[found.labels, np.arange(k)])[found.served].all()
    ):
        bad = "its arrays do not fit each other"
    else:
        for s, sheet in enumerate(found.sheets):
            at = known(found.q[s])
            q, T = found.q[s][at], found.poses[at]
            error = np.abs(found.task.error(q, T[:, :3, 3], T[:, :3, :3])).max(initial=0.0) if len(q) else 0.0
            if error > OFF or not found.task.robot.within(q).all() or max(map(sheet.off, q[:1]), default=0.0) > OFF:
                bad = f"postures of sheet {s} do not lie at their poses, on their leaf, within the limits"
    if bad is not None:
        raise SheetsFileError(file, bad, "it is of another model of the robot, or was changed: make the map again")


def _cloud(found: Sheets) -> Array:
    """The given poses of the workspace (l, 4, 4), where these are not the sampled ones; else none (0, 4, 4)."""
    space = found.workspace
    if isinstance(space, PoseCloud) and len(space.given) != len(found.poses):
        return space.given
    return found.poses[:0]


def _workspace_keys(space: Workspace) -> dict[str, Any]:
    if not isinstance(space, PoseRange):
        return {"kind": "poses", "source": space.source if isinstance(space, PoseCloud) else str(space)}
    kind = next(word for word, (solid, _) in SOLIDS.items() if type(space.solid) is solid)
    sizes = {name: np.asarray(getattr(space.solid, name)).tolist() for name in SOLIDS[kind][1]}
    return {"kind": kind, "solid": sizes, "rotation": space.rotation.tolist(), "tilt": space.tilt, "spin": space.spin}


def _workspace_of(keys: Mapping[str, Any], poses: Array) -> Workspace:
    if keys["kind"] == "poses":
        return pose_cloud(poses, str(keys["source"]))
    solid, names = SOLIDS[keys["kind"]]
    sizes = [np.array(keys["solid"][name]) if name in ("center", "sides") else keys["solid"][name] for name in names]
    return PoseRange(solid(*sizes), np.array(keys["rotation"]), float(keys["tilt"]), float(keys["spin"]))
