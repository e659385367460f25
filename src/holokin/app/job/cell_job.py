"""The job of a cell, of a robot and a file of paths: what nobody said is chosen here, and said in words."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path as FilePath
from typing import Any, Literal

import numpy as np

from ...analysis.coverage.starts import postures_at, reached
from ...analysis.coverage.tool_chain import chain_to_tool
from ...base.errors import ArgumentError, JobError, OutOfReachError, PathError, SingularityError
from ...base.files import write_text
from ...base.poses import pose_from
from ...base.types import Array, Matrix, Value, Vector
from ...motion import follow
from ...motion.checks import Clearances
from ...motion.checks.check_report import keeps
from ...motion.self_motions.posture_search import postures_from
from ...motion.trajectory import Status
from ...path import PathFile, read_paths
from ...robot import Robot, reach
from ...strategies.tasks.task import Task
from .advice_job import ADVISED, moved_job, numbers_of
from .job_parts import build_path, build_robot, build_strategy, naming
from .runner import is_job, open_one_job, robot_of_file
from .schema import Job, job_of, job_table
from .tables import FrameTable
from .templates import job_text, robot_keys

FRAME = "part"
"""The frame of the job in which the paths of the file stand."""

SCENE = ("frames", "robot", "task", "air", "timing", "program", "checks")
"""Tables of a job that may stand in the file of a scene."""

OF_THE_COMMAND = ("name", "tip", "base", "parts", "coordinates")
"""Keys of [robot] that the command says."""

RETRACTS = (0.05, 0.02, 0.0)
"""Ways [m] above the ends of the paths, of which the first is taken where the tool can be."""

ACCELERATIONS, JERKS = (5.0, 1.0), (200.0, 40.0)
"""Of a hinge [rad/s^2, rad/s^3] and of a slider [m/s^2, m/s^3]: moderate ones, as descriptions of robots state none."""

DT = 0.004
"""The controller's step [s]: languages that send a step of their own say so."""

STARTS = 16
"""Postures among which that is looked for in which the job begins."""

LOOKED_AT = 48
"""Points of all paths at which it is looked whether the tool can be there."""

PLACES = tuple(product((0.35, 0.5, 0.65), (0.0,), (0.0, 0.25, 0.5)))
"""Places of the middle of the paths, in shares of the arm's reach, that are tried where they are out of reach."""

ONLY = "inverse"
"""What the rule of an arm without a joint to spare is called in the job."""


@dataclass(frozen=True, eq=False)
class CellJob(Value):
    """A job that was written for a cell: its file, the robot, what the tool holds, and the file of the paths.

    retract: how far above their ends the tool comes and goes [m]. assumed: sentences on what nobody said. beyond: how
    many points are out of reach, and where they would not be; "" where all are in reach.
    """

    file: FilePath
    robot: Robot
    task: Task
    read: PathFile
    retract: float
    assumed: tuple[str, ...]
    beyond: str = ""

    @property
    def ruled(self) -> bool:
        """Whether the job has its rule: it needs none where no joint is to spare."""
        return self.task.n == self.task.m


def write_cell(
    name: str, paths: FilePath, out: FilePath, *, scene: FilePath | None = None, tip: str | None = None,
    base: str | None = None, trust_units: bool = False, at: str | None = None, speed: float | None = None,
    units: Literal["m", "mm", "in"] | None = None, columns: Sequence[str] | None = None,
) -> CellJob:  # fmt: skip
    """Write the job of a robot that goes along the paths of a file.

    It is `out/draft.toml` and lacks its rule; `out/cell.toml` where the arm has no joint to spare.

    Args:
        name: of a robot, its file, or a job, whose robot it is. paths: as of `read_paths`, with units and columns.
        scene: an SRDF, or a TOML file with tables of a job: SCENE.
        tip, base, trust_units: as of `load`.
        at: "X Y Z" [m] or "X Y Z ROLL PITCH YAW" [m, degrees]: where the frame of the file stands in that of the base.
        speed: of the tool [m/s], in place of those of the file.

    Raises:
        HolokinError: bad input. OutOfReachError: no path can be begun where it is placed.
    """
    if os.path.lexists(taken := out / "cell.toml"):
        cure = f"it is yours: go on with `holokin run {taken}`, choose another --out, or delete it"
        raise ArgumentError("a job that exists already", str(taken), cure)
    # What the command, the file and the scene say, and what is assumed besides.
    tables, origin = _scene(scene, out / "draft.toml")
    arm, arm_keys = _arm(name, tip, base, trust_units, origin)
    read = read_paths(paths, units=units, columns=columns)
    assumed: list[str] = []
    keys: dict[str, Any] = {
        "title": f"{arm.name}: {paths.name}",
        "about": f"Written by `holokin cell` for {FilePath(name).name} and {paths.name}.",
        "units": ["degrees", "mm"],
        "robot": arm_keys | tables.get("robot", {}),
        "task": tables.get("task") or _task(arm, read, assumed),
        "start": {"q": [0.0] * arm.n},
        "frames": _frames(tables.get("frames", {}), at, assumed),
        **_paths(read, paths, speed, {"units": units, "columns": columns}, assumed),
    }
    if len(read) > 1:
        keys["air"] = {"order": "given", "height": 0.1, "home": True} | tables.get("air", {})
    keys["timing"] = {"acceleration": ACCELERATIONS[0]} | tables.get("timing", {})
    keys |= {key: tables[key] for key in ("program",) if key in tables}
    keys["checks"] = tables.get("checks", {})
    if scene is None:
        assumed.append("nothing stands round the arm (--scene says what does)")
    keys["strategies"] = {ADVISED: {"kind": "moore-penrose"}}
    job = job_of(origin, keys)
    # The robot and its task; and where it may begin.
    robot = build_robot(job, origin)
    if job.timing is not None:
        with naming(origin, "timing", "velocity"):
            job.timing.check(robot)
    keys["timing"] = _timing(robot, tables.get("timing", {}), assumed)
    shaped = robot if job.checks is None else job.checks.shaped(robot)
    places = _places(job, read)
    with naming(origin, "task"):
        (task, *_) = job.task.tasks(shaped, np.mean(robot.ranges(1.0), axis=0), places[0][0, :3, :3])
    cell = CellJob(out / "draft.toml", robot, task, read, 0.0, tuple(assumed))
    if cell.ruled:
        cell = replace(cell, file=out / "cell.toml")
        keys["strategies"] = {ONLY: {"kind": "custom", "g": []}}
    retract, starts = _starts(cell, job, places)
    if retract:
        keys["path" if len(read) == 1 else "every_path"]["retract"] = retract
    q = starts[0]
    if cell.ruled:
        q = next(_followed(job_of(origin, keys), origin, task, starts), q)
    keys["start"] = _start(robot, q)
    # The file.
    out.mkdir(parents=True, exist_ok=True)
    write_text(cell.file, job_text(moved_job(keys, origin, cell.file)), new=cell.ruled)
    return replace(cell, retract=retract, beyond=_beyond(cell, job, places))


# --- The tables of the job.


def _arm(
    name: str, tip: str | None, base: str | None, trust_units: bool, origin: FilePath
) -> tuple[Robot, dict[str, Any]]:
    """A robot, or that of a job, and [robot] of it for a job in the file `origin`. Raises: as `load`, `open_job`."""
    if is_job(name):
        arm, file = robot_of_file(name, tip, base, trust_units), open_one_job(name)[2]
        return arm, robot_keys(job_table(file)["robot"], file, origin)
    chain = chain_to_tool(name, tip, base, trust_units)
    file = FilePath(name).absolute().as_posix() if os.path.isfile(name) else name
    keys = {"name": file, "tip": chain.tip if chain.base else tip, "base": base, "trust_units": trust_units}
    return chain.robot, {key: value for key, value in keys.items() if value}


def _scene(scene: FilePath | None, draft: FilePath) -> tuple[dict[str, Any], FilePath]:
    """The tables of the file of a scene, and the file from whose folder the names in them count. Raises: JobError."""
    if scene is None:
        return {}, draft
    if scene.suffix.lower() == ".srdf":
        return {"checks": {"srdf": scene.absolute().as_posix()}}, draft
    if scene.suffix.lower() != ".toml":
        raise ArgumentError("--scene", str(scene), "give an .srdf, or a .toml file with the table [checks] of a job")
    tables = job_table(scene)
    for key in tables:
        if key not in SCENE:
            cure = f"a scene may have {', '.join(f'[{known}]' for known in SCENE)}: leave it out"
            raise JobError(scene, key, "is not of a scene", cure)
    for key in OF_THE_COMMAND:
        if key in tables.get("robot", {}):
            raise JobError(scene, f"robot.{key}", "is said by the command", "leave it out")
    return tables, scene


def _task(robot: Robot, read: PathFile, assumed: list[str]) -> dict[str, Any]:
    """The pose where the file says how the tool is turned, else its point and the direction of its z axis."""
    if all(path.rotations is not None and path.axes is None for path in read.paths):
        return {"kind": "pose"}
    if all(path.rotations is None for path in read.paths):
        assumed.append("the file has no directions of the tool: its z axis points down, against z of the part")
    assumed.append("the tool may turn about its z axis")
    return {"kind": "pose", "orientation": "axis"}


def _frames(frames: Mapping[str, Any], at: str | None, assumed: list[str]) -> dict[str, Any]:
    """[frames] with that of the part. Raises: ArgumentError."""
    if FRAME in frames:
        if at is not None:
            raise ArgumentError("--at", at, f"the scene has a frame {FRAME!r} already: leave one of them out")
        return dict(frames)
    numbers = [0.0] * 3 if at is None else numbers_of(at)
    if numbers is None or len(numbers) not in (3, 6):
        cure = 'write "X Y Z" in metres, or "X Y Z ROLL PITCH YAW" with degrees: where the part stands from the base'
        raise ArgumentError("--at", at, cure)
    if at is None:
        assumed.append("its coordinates count from the base of the robot (--at places the part)")
    turned = {"rpy_deg": numbers[3:]} if len(numbers) == 6 else {}
    return dict(frames) | {FRAME: {"xyz": numbers[:3]} | turned}


def _paths(
    read: PathFile, file: FilePath, speed: float | None, given: Mapping[str, Any], assumed: list[str]
) -> dict[str, Any]:
    """[path] of a file with one path, or [every_path] and a [[path]] for each."""
    words = {key: list(value) if isinstance(value, Sequence) and not isinstance(value, str) else value
             for key, value in given.items() if value is not None}  # fmt: skip
    if speed is None and all(path.speeds is None and path.times is None for path in read.paths):
        speed = 0.1
        assumed.append("the file states no speed: 100 mm/s is taken (--speed says another)")
    words |= {} if speed is None else {"speed": speed}
    table = {"kind": "file", "file": file.absolute().as_posix(), "frame": FRAME} | words
    if len(read) == 1:
        return {"path": table}
    return {"every_path": table, "path": [{"name": path.name, "only": path.name} for path in read.paths]}


def _timing(robot: Robot, given: Mapping[str, Any], assumed: list[str]) -> dict[str, Any]:
    """[timing], with moderate accelerations where the scene gives none."""
    own = {}
    for key, (hinge, slider) in (("acceleration", ACCELERATIONS), ("jerk", JERKS)):
        own[key] = hinge if robot.hinges.all() else np.where(robot.hinges, hinge, slider).tolist()
    if "acceleration" not in given:
        assumed.append(f"its joints accelerate by {ACCELERATIONS[0]:g} rad/s^2 at most, which no description states")
    return own | {"dt": DT} | dict(given)


def _start(robot: Robot, q: Vector) -> dict[str, Any]:
    """[start] in degrees."""
    return {"q": (q * np.where(robot.hinges, 180 / np.pi, 1.0)).tolist(), "degrees": True}


# --- Where the robot may begin.


def _places(job: Job, read: PathFile) -> list[Array]:
    """The poses (k, 4, 4) of the tool at the points of each path, in the frame of the base."""
    frame, down = job.frames.get(FRAME, FrameTable()).matrix, np.diag([1.0, -1.0, -1.0])
    poses = []
    for path in read.paths:
        rotations = np.tile(down, (len(path), 1, 1)) if path.rotations is None else path.rotations
        poses.append(frame @ np.array([pose_from(p, R) for p, R in zip(path.points, rotations, strict=True)]))
    return poses


def _starts(cell: CellJob, job: Job, places: Sequence[Array]) -> tuple[float, Matrix]:
    """How far above its ends the first path that is in reach can be come to [m], and postures (k, n) to begin at.

    Where the end of none is in reach, it is the first one that can be begun.

    Raises: OutOfReachError: none can be begun. ArgumentError: none is clear.
    """
    up = job.frames.get(FRAME, FrameTable()).matrix[:3, 2]
    apart = Clearances.of(cell.task.robot, job.scene) if job.scene is not None and cell.robot.tips else None
    touching: Matrix | None = None
    begun: tuple[float, Matrix] | None = None
    for poses, retract in product(places, RETRACTS):
        above = poses[[0, -1]]
        above[:, :3, 3] += retract * up
        Q = _postures(cell.task, above[0])
        clear = Q if apart is None or not len(Q) else Q[apart.clear(Q)]
        if len(clear) and reached(cell.task, above, clear[0]).within.all():
            return retract, clear
        begun = (retract, clear) if begun is None and len(clear) else begun
        touching = Q if len(Q) and not len(clear) else touching
    if begun is not None:
        return begun
    if touching is None or apart is None:
        raise _out_of_reach(cell, job, places)
    # The pairs that are too near in every posture, else that of the most comfortable one.
    kept = keeps(apart.distances(touching), apart.limits)
    pairs = [apart.names[k] for k in np.flatnonzero(~np.any(kept, axis=0))]
    words = ", ".join(" and ".join(pair) for pair in pairs) or apart.touching(touching[:1])[0]
    allowed = ", ".join(f'["{a}", "{b}"]' for a, b in pairs) or '["...", "..."]'
    cure = f"move the part (--at); or, where shapes are coarse there, give a scene with [checks] allowed = [{allowed}]"
    raise ArgumentError(f"the clearance of {words} in all {len(touching)} postures to begin in", "too small", cure)


def _postures(task: Task, T: Matrix) -> Matrix:
    """Postures (k, n) within the limits with the tool at a pose (4, 4), as exact as a start is to be."""
    Q = postures_at(task, T, STARTS)
    Q, arrived = postures_from(task, Q, *(np.repeat(part[None], len(Q), axis=0) for part in (T[:3, 3], T[:3, :3])))
    return Q[arrived & task.robot.within(Q)]


def _followed(job: Job, file: FilePath, task: Task, starts: Matrix) -> Iterator[Vector]:
    """Those of some postures (k, n) from which the first path is followed to its end, of an arm with no joint free."""
    table = job.paths[0] if job.paths else job.only_path
    for q in starts:
        path = build_path(table.model_copy(update={"entry": "joints"}), task, q, file)
        try:
            walk = follow(build_strategy(job, ONLY, task, q, ONLY), path, q, samples=LOOKED_AT)
        except (PathError, SingularityError):
            continue
        if walk.status is Status.COMPLETE:
            yield q


def _beyond(cell: CellJob, job: Job, places: Sequence[Array]) -> str:
    """How many points of the paths are out of reach, and which step of the part would cure it; "" where none is."""
    some = _some(places)
    within = reached(cell.task, some, None).within
    return (
        "" if within.all() else f"{(~within).sum()} of {len(some)} points are out of reach: {_better(cell, job, some)}"
    )


def _some(places: Sequence[Array]) -> Array:
    every = np.concatenate(places)
    return every[np.unique(np.linspace(0, len(every) - 1, LOOKED_AT).astype(int))]


def _better(cell: CellJob, job: Job, some: Array) -> str:
    """By which step of the part poses (k, 4, 4) come within reach, of a few in front of the arm."""
    arm = reach(cell.task.robot, cell.task.tip)
    middle = (some[:, :3, 3].min(axis=0) + some[:, :3, 3].max(axis=0)) / 2
    for place in PLACES if np.isfinite(arm) else ():
        moved = some.copy()
        moved[:, :3, 3] += (step := arm * np.array(place) - middle)
        if reached(cell.task, moved, None).within.all():
            frame = job.frames.get(FRAME, FrameTable())
            turned = [] if frame.rpy_deg is None else frame.rpy_deg
            there = " ".join(f"{value:.3g}" for value in [*(frame.matrix[:3, 3] + step).round(3), *turned])
            return f'place the part at --at "{there}", where all points are in reach'
    return "move the part nearer, or turn it (--at), or give another --tip"


def _out_of_reach(cell: CellJob, job: Job, places: Sequence[Array]) -> OutOfReachError:
    """How far off the paths are, and where they would be in reach."""
    some = _some(places)
    far, arm = np.linalg.norm(some[:, :3, 3], axis=1), reach(cell.task.robot, cell.task.tip)
    fact = (
        f"{cell.robot.name!r} cannot begin any path as placed: they are {far.min():.3g} to {far.max():.3g} m from its "
        f"base, and with its tool it reaches {arm:.3g} m"
    )
    return OutOfReachError(fact, _better(cell, job, some))
