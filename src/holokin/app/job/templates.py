"""Job files to start from: a copy of a packaged job, or a job for a robot, tried before it is written."""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...analysis.coverage import fitting_task, locked_joints, regular_starts
from ...base.errors import ArgumentError, HolokinError, JobError, UnknownNameError
from ...base.files import aside, write_text, writing
from ...base.types import Vector
from ...robot import load
from ...strategies.tasks.frame_task import FrameTask
from ...strategies.tasks.task import Task
from .runner import packaged_jobs, run_job
from .schema import LONGEST_TITLE, Job

# --- Writing job files: TOML values, robot files as a job names them, and files that must be new.


def toml(value: Any) -> str:
    """A value as TOML writes it on one line: text, numbers, lists, tables."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, int | np.integer):
        return str(int(value))
    if isinstance(value, float | np.floating):
        return repr(float(value))
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_toml_key(key)} = {toml(entry)}" for key, entry in value.items()) + " }"
    values: Sequence[Any] = value
    return "[" + ", ".join(map(toml, values)) + "]"


def _toml_key(key: str) -> str:
    """A key as TOML writes it: in quotes where it is no plain word."""
    return key if key.replace("-", "").replace("_", "").isalnum() and key.isascii() else toml(key)


def table(name: str, keys: Mapping[str, Any]) -> str:
    """A table of a job file, a key on each line."""
    return "\n".join([f"[{name}]", *(f"{_toml_key(key)} = {toml(value)}" for key, value in keys.items())]) + "\n"


_REMARKS = {
    "robot": "The robot. Where its tip is not the TCP: tool = { xyz = [x, y, z], rpy_deg = [roll, pitch, yaw] }, in m.",
    "task": 'What the tool holds. With orientation = "axis" it may turn about its axis, by default z.',
    "start": "The posture that it begins at, a number for each joint.",
    "frames": "Frames of the work, from the base: xyz in m, rpy_deg in degrees.",
    "every_path": "What all paths have in common: speed in m/s; retract, above their ends, in m.",
    "path": "What the tool goes along: speed in m/s; retract, above its ends, in m.",
    "air": "How the tool goes from one path to the next.",
    "timing": "Limits of all joints in rad/s^2 or m/s^2, the controller's step dt in s; dq limits are the robot's own.",
    "program": "Axes, tool numbers and process lines of the controller.",
    "checks": "What the motion keeps clear of. A fixture is [[checks.obstacles]] with name, kind, sizes and xyz.",
    "workspace": "Where the tool works.",
    "strategies": "The rule for the joints that the task leaves free.",
    "expect": "What must stay true.",
}
"""What stands above the tables of a job that is written, for who edits it."""

_GROUPS = ("frames", "strategies", "expect")
"""Tables of a job that hold one for each name."""


def job_text(keys: Mapping[str, Any]) -> str:
    """The text of a job: its plain keys, then its tables, each below a remark on what it says."""
    parts = ["".join(f"{key} = {toml(value)}\n" for key, value in keys.items() if not _is_table(value))]
    for key, value in keys.items():
        if not _is_table(value):
            continue
        parts.append(f"# {_REMARKS[key]}" if key in _REMARKS else "")
        if key in _GROUPS:
            parts += [table(f"{key}.{_toml_key(name)}", own) for name, own in value.items()]
            continue
        for one in value if isinstance(value, list) else [value]:
            deeper = {name: own for name, own in one.items() if name == "obstacles" and _is_table(own)}
            head = f"[{key}]" if isinstance(value, list) else key
            parts.append(table(head, {name: own for name, own in one.items() if name not in deeper}))
            parts += [table(f"[{key}.{name}]", own) for name, every in deeper.items() for own in every]
    return "\n".join(filter(None, parts))


def _is_table(value: Any) -> bool:
    return isinstance(value, Mapping) or (isinstance(value, list) and bool(value) and isinstance(value[0], Mapping))


def robot_name(robot: str, path: FilePath) -> str:
    """A robot file as a job in another folder names it: relative where it lies near, so that both can be moved."""
    try:
        near = FilePath(os.path.relpath(robot, path.parent))
    except ValueError:  # another drive
        near = FilePath(robot).absolute()
    return (near if near.parts.count("..") < 2 else FilePath(robot).absolute()).as_posix()


def check_new(path: FilePath) -> None:
    """Raises: JobError unless a job file may be written there: it ends in .toml and does not exist. WriteError: its
    folder does not exist, or nothing can be written in it.
    """
    if path.suffix.lower() != ".toml":
        raise JobError(path, "file", "does not end in .toml", "name it like my-job.toml")
    if os.path.lexists(path):
        raise JobError(path, "file", "exists already", "choose another name, or delete it first")
    with writing(path), aside(path.parent):  # a hidden folder there for a moment is the surest test
        pass


def write_new(path: FilePath, text: str) -> None:
    """Write a new file. Raises: JobError: it exists. WriteError."""
    check_new(path)
    write_text(path, text, new=True)


# --- A job of a circle, for a robot and its task.

SAMPLES, CYCLES = 100, 2  # of the circle


def circle_job(
    title: str,
    about: str,
    robot: Mapping[str, Any],
    task: Task,
    q0: Vector,
    radius: float,
    tables: Mapping[str, Mapping[str, Any]],
) -> str:
    """The text of a job: a circle of a radius [m] from the tool at q0 (n,) towards the base.

    Args:
        robot: the keys of [robot]. tables: name -> keys of the tables behind [path], as of the strategies.
    """
    inward = -radius if task.pose(q0)[0, 3] > 0 else radius
    circle = {"kind": "circle", "center": [inward, 0.0, 0.0], "relative": True, "speed": 0.1}
    joints = ", ".join(task.robot.joint_names).replace("\n", " ")
    parts = [
        f"title = {toml(title[:LONGEST_TITLE])}\nabout = {toml(about)}\n",
        table("robot", robot),
        table("task", task_keys(task)),
        f"# {joints}\n{table('start', {'q': q0.tolist()})}",
        table("path", circle | {"samples": SAMPLES, "cycles": CYCLES}),
        *(table(name, keys) for name, keys in tables.items()),
    ]
    return "\n".join(parts)


def task_keys(task: Task) -> dict[str, Any]:
    """[task] of a job, for a task that was chosen for a robot."""
    if task.frames > 1:
        return {"kind": "stacked", "parts": [{"kind": "pose", "tip": tip.name} for tip in task.robot.tips]}
    if task.orientation is not None:
        axis = {"axis": task.axis.tolist()} if isinstance(task, FrameTask) and task.orientation == "axis" else {}
        return {"kind": "pose", "orientation": task.orientation} | axis
    whole = tuple(range(2 if task.robot.planar else 3))
    return {"kind": "position"} | ({} if task.rows == whole else {"rows": list(task.rows)})


def passes(text: str, path: FilePath) -> bool:
    """Whether all strategies of a job follow its path to the end and show what is expected of them."""
    keys = tomllib.loads(text) | {"verdict": {"samples": 1}}  # verdicts and coverage take long, and are not asked for
    keys.pop("workspace", None)
    try:
        return run_job(path.stem, Job.model_validate(keys), path).passed
    except HolokinError:
        return False


# --- `holokin new`.

# What a copied job says above its expectations.
_COPIED = """# What follows holds for the job as copied. For another robot, start, path or strategy measure first
# (delete this part, run, read the table), then write here what must stay true.
"""
_EXPECT = """
# Run it and read the table, then write here what must stay true, for instance:
# [expect.lock]
# holonomic = true
# drift_total = { below = 1e-9 }
"""
_TRIED = 4  # starts that are tried; each with circles of three sizes


def packaged_text(name: str) -> str:
    """The TOML text of a packaged job. Raises: UnknownNameError."""
    if name not in packaged_jobs():
        raise UnknownNameError("job", name, packaged_jobs())
    return files("holokin.app.job").joinpath("packaged", f"{name}.toml").read_text("utf-8")


def new_job(path: FilePath, template: str) -> None:
    """Write a copy of a packaged job to a new file.

    Raises:
        UnknownNameError: of the template. JobError: the file exists. WriteError: the system refuses it.
    """
    write_new(path, packaged_text(template).replace("\n[expect.", f"\n{_COPIED}[expect.", 1))


def new_job_for(
    path: FilePath, robot: str, tip: str | None = None, base: str | None = None, trust_units: bool = False
) -> None:
    """Write a job for a robot to a new file: a small circle from a regular start posture, with three strategies.

    Every strategy is followed round the circle before the file is written. Nothing is expected in it.

    Args:
        robot: a name of the catalogue, a model or a .toml file. tip, base, trust_units: as of `load`.

    Raises:
        JobError: the file exists. RobotFileError, UnknownNameError: of the robot. ArgumentError: a robot without
        redundancy, or one for which no such circle was found. WriteError: the system refuses the file.
    """
    # The robot and its task.
    check_new(path)
    arm = load(robot, tip=tip, base=base, trust_units=trust_units)
    task = fitting_task(arm)
    keys = {"name": robot_name(robot, path) if FilePath(robot).suffix else robot}
    keys |= {key: link for key, link in (("tip", tip), ("base", base)) if link is not None}
    keys |= {"trust_units": True} if trust_units else {}
    if task.orientation is not None:
        held = "with the tool's orientation held"
    elif task.m == (2 if arm.planar else 3):
        held = "with the tool's orientation free"
    else:
        held = f"in {' and '.join('xy'[i] for i in task.rows)} alone"
    # The first circle that all strategies follow, of a few starts and sizes.
    scale = arm.n**-0.5 * sum(np.linalg.norm(joint.step) for joint in arm.joints) + 0.05
    for start in regular_starts(task)[:_TRIED]:
        locked = [arm.joint_names[i] for i in locked_joints(task, start)]
        strategies = {
            "strategies.moore-penrose": {"kind": "moore-penrose"},
            "strategies.lock": {"kind": "lock", "joints": locked},
            "strategies.radial": {"kind": "radial"},
        }
        for share in (0.1, 0.03, 0.01):
            radius = float(f"{min(0.1, share * scale):.1g}")
            title = f"{arm.name}, a circle of {radius:g} m"
            about = (
                f"A circle of {radius:g} m, {CYCLES} times, {held}. The start posture is a regular one, well inside "
                "the joint limits; all strategies below were followed to the end of the path when this file was "
                "written. Collisions were not looked at."
            )
            text = circle_job(title, about, keys, task, start, radius, strategies) + _EXPECT
            if passes(text, path):
                write_new(path, text)
                return
    cure = "none was found that all strategies follow: copy a job with --from"
    raise ArgumentError(f"the circle for {arm.name!r}", None, cure)
