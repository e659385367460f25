"""A map of sheets as a file: arrays of numbers, and a text that says what they are of. Nothing in it is code."""

from __future__ import annotations

import json
import math
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, HolokinError, SheetsFileError, brief
from ...base.files import replacing
from ...base.poses import tool_poses
from ...base.types import Array, Matrix, Vector
from ...path.workspaces import Box, Cylinder, PoseCloud, PoseRange, Solid, Sphere, Workspace, pose_cloud, workspace
from ...proof.checker_file import need, numbers, parsed
from ...strategies import HolonomicStrategy
from ...strategies.tasks.task import Task
from .pose_rest import PoseRest
from .sheet import Sheet, known
from .sheet_map import Sheets
from .surroundings import Surroundings

FORMAT = 2
"""Changed when files of before cannot be read any more."""

MOST_BYTES = 1 << 28
"""Size of a file's arrays, unpacked, from which on they are not read: 400,000 poses of ten sheets of seven joints."""

ARRAYS = {
    "about": ("u", ("bytes",)), "q0": ("f", ("sheets", "joints")), "poses": ("f", ("poses", 4, 4)),
    "q": ("f", ("sheets", "poses", "joints")), "labels": ("i", ("poses",)), "rest": ("i", ("poses",)),
    "pairs": ("i", ("pairs", 2)), "cuts": ("i", ("cuts", 2)), "cloud": ("f", ("cloud", 4, 4)),
}  # fmt: skip
"""The arrays of a file: whole numbers without and with a sign, or others, and the shape; equal names, equal lengths."""

CHANGED = "it is of another model of the robot, or was changed: make the map again"
"""The cure where a file is read, and says what cannot be."""

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
    try:
        arrays = _arrays(file)
        about = parsed(arrays.pop("about").tobytes().decode())
        if not isinstance(about, dict) or about.get("format") != FORMAT:
            raise SheetsFileError(file, "it is of another version", "write it again with this one")
        _check_about(about)
    except SheetsFileError:
        raise
    except Exception as problem:  # noqa: BLE001  ZIP, its packers, NumPy and JSON have errors of their own
        fact = f"it cannot be read: {brief(problem) or type(problem).__name__}"
        raise SheetsFileError(file, fact, "give a file that a map of sheets saved") from None
    wanted = (task.robot.name, list(task.robot.joint_names), task.name)
    given = (about["robot"], about["joints"], about["task"])
    if given != wanted:
        raise SheetsFileError(file, f"it is of {given}", f"give that robot and task, not {wanted}")
    if about["around"] != (None if around is None else around.digest):
        cure = "give clear_of, floor, clearance, self_collision and ignore as they were given to hk.sheets"
        raise SheetsFileError(file, "it is of other surroundings", cure)
    try:
        sheets = tuple(
            _sheet(build(one["keys"], task, q0, one["name"]), q0, one, q, arrays["poses"])
            for one, q0, q in zip(about["leaves"], arrays["q0"], arrays["q"], strict=True)
        )
        cloud = arrays["cloud"] if len(arrays["cloud"]) else arrays["poses"]
        found = Sheets(
            task, _workspace_of(about["workspace"], cloud), sheets, tool_poses("of the map", arrays["poses"]),
            arrays["q"], arrays["labels"], arrays["rest"], arrays["pairs"], arrays["cuts"], about["least_cuts"],
            about["least"], about["candidates"], float(about["length"]), around, about["stopped"],
        )  # fmt: skip
        bad = _fault(found)
    except (HolokinError, LookupError, TypeError, ValueError) as problem:
        raise SheetsFileError(file, brief(problem), CHANGED) from None
    if bad:
        raise SheetsFileError(file, bad, CHANGED)
    return found


def _sheet(strategy: HolonomicStrategy, q0: Vector, about: Mapping[str, Any], q: Matrix, poses: Array) -> Sheet:
    """A sheet whose stations are its postures q (k, n) at the poses (k, 4, 4), NaN where it has none."""
    there = known(q)
    return Sheet(strategy, q0, float(about["rcond"]), about["keys"], q[there], poses[there])


def _arrays(file: Path) -> dict[str, Any]:
    """The arrays of a file, each of its kind and shape: what a header says is looked at before memory is taken.

    Raises: RejectedError, and what ZIP files, NumPy and the system raise.
    """
    if file.exists():
        need(file.is_file() and file.stat().st_size <= MOST_BYTES, f"it is no file of at most {MOST_BYTES:,} bytes")
    arrays, lengths, total = {}, dict[str, int](), 0
    with zipfile.ZipFile(file) as packed:
        for name, (kind, shape) in ARRAYS.items():
            member = packed.getinfo(f"{name}.npy")
            plain = member.compress_type in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) and not member.flag_bits & 1
            need(plain, "it is packed in another way than holokin packs it")
            with packed.open(member) as stream:
                need(np.lib.format.read_magic(stream) == (1, 0), f"{name} is no array of NumPy")
                given, by_columns, dtype = np.lib.format.read_array_header_1_0(stream)
                need(dtype.kind == kind and len(given) == len(shape), f"{name} is of another kind")
                for length, word in zip(given, shape, strict=True):
                    wanted = lengths.setdefault(word, length) if isinstance(word, str) else word
                    need(length == wanted, "its arrays do not fit each other")
                size = math.prod(given) * dtype.itemsize
                total += size
                need(total <= MOST_BYTES, f"its arrays take more than {MOST_BYTES:,} bytes: make it with fewer samples")
                data = np.frombuffer(stream.read(size), dtype).reshape(given, order="F" if by_columns else "C")
                need(not stream.read(1), f"{name} is longer than it says")  # at the end ZIP looks at the check sum
                arrays[name] = data.astype({"u": "u1", "f": "f8", "i": "i8"}[kind])
    return arrays


def _check_about(about: Mapping[str, Any]) -> None:
    """That what a file says of its arrays has the types it should. Raises: RejectedError, LookupError, TypeError."""
    leaves, counts = about["leaves"], (about["least"], about["least_cuts"], about["candidates"])
    need(isinstance(leaves, list) and isinstance(about["workspace"], dict), "its sheets or its workspace are none")
    names = [about["robot"], about["task"], *about["joints"], *(leaf["name"] for leaf in leaves)]
    need(all(isinstance(name, str) for name in names), "a name in it is none")
    need(all(isinstance(leaf["keys"], dict) for leaf in leaves), "a sheet has no strategy")
    need(all(numbers(leaf["rcond"]) and leaf["rcond"] >= 0 for leaf in leaves), "the rcond of a sheet is none")
    need(all(type(count) is int and 0 <= count < 2**31 for count in counts), "a count in it is none")
    need(numbers(about["length"]) and about["length"] >= 0, "its length of a turn is none")
    need(isinstance(about["stopped"], bool), "stopped is neither true nor false")
    need(about["around"] is None or isinstance(about["around"], str), "its surroundings are none")


def _fault(found: Sheets) -> str:
    """What is wrong with a map: arrays that do not fit, postures off their leaves, poses or limits; "" for nothing."""
    S, k, task = len(found), len(found.poses), found.task
    there = known(found.q)
    indices = (found.labels, -1, S), (found.rest, 0, len(PoseRest)), (found.pairs, 0, k), (found.cuts, 0, k)
    fits = all(((low <= one) & (one < high)).all() for one, low, high in indices)
    if not (fits and (there | np.isnan(found.q).all(axis=-1)).all()):
        return "its arrays do not fit each other"
    if not there[found.labels[found.served], np.flatnonzero(found.served)].all():
        return "a pose is served by a sheet without a posture there"
    for s, sheet in enumerate(found.sheets):
        T, q = sheet.places, sheet.stations
        off = task.error(q, T[:, :3, 3], T[:, :3, :3]).ravel() if len(q) else np.zeros(0)
        if task.n > task.m:
            levels = sheet.strategy.constraint_value.batch(sheet.begin).reshape(len(sheet.begin), -1)
            off = np.concatenate([off, sheet.strategy.constraint.nearest(levels - sheet.level).ravel()])
        if not (np.abs(off) <= OFF).all() or not task.robot.within(sheet.begin).all():
            return f"postures of sheet {s} do not lie at their poses, on their leaf, within the limits"
    return ""


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
    """Raises: LookupError, TypeError and what `workspace` and `pose_cloud` raise: the keys are of none."""
    kind = keys["kind"]
    if kind == "poses":
        return pose_cloud(poses, str(keys["source"]))
    sizes = {kind: [keys["solid"][name] for name in SOLIDS[kind][1]]}
    return workspace(**sizes, rotation=keys["rotation"], tilt=keys["tilt"], spin=keys["spin"])
