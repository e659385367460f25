"""The job file of an advice: the best law round a circle in the workspace, tried before it is written."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ..designing import Advice, advise
from ..designing.tips import chain_to_tool
from ..errors import ArgumentError, HolokinError
from ..path.workspaces import PoseRange, Workspace
from ..tasks.task import Task
from .runner import run_job
from .schema import LONGEST_TITLE, Job
from .toml_text import check_new, robot_name, table, toml, write_new
from .workspace_words import parse_workspace

SHARE = 0.5
"""Radius of the circle over the least half side of the workspace, to begin with."""

LARGEST = 0.1
"""Its largest radius [m]."""

SMALLER = 3
"""Times that the circle is made smaller, by half each, until the law and the pseudo-inverse follow it to its end."""

DURATION = "up to a minute, with several redundant joints two"
"""What an advice takes on two cores that do nothing else: 17 to 59 s of processor time on five arms, and compilers."""

SAMPLES, CYCLES = 100, 2
"""Of the circle."""


def _write_advice(
    path: FilePath, advice: Advice, robot: str, *, base: str | None = None, poses: str | None = None
) -> None:  # fmt: skip
    """Write a job of the best law of an advice, beside the pseudo-inverse, to a new file.

    Both are followed round a circle in the workspace before it is written; what must stay true of the law is expected.

    Args:
        robot: a name of the catalogue, or a file. base: as of `load`. poses: the CSV file of the workspace, if it is
            of given poses.

    Raises:
        JobError: the file exists, or is no .toml. ArgumentError: no circle was found. WriteError.
    """
    check_new(path)
    for radius in _radii(advice.workspace):
        text = _text(path, advice, robot, base, poses, radius)
        if _runs(text, path):
            write_new(path, text)
            return
    raise ArgumentError("the circle of the job", None, "none was found that the law follows: write a path of your own")


def advise_command(
    robot: str, workspace: str | None, tip: str | None, base: str | None, task: str | None, start: str | None,
    out: FilePath | None, say: Callable[[str], None], announce: Callable[[str], None],
) -> tuple[Advice, Callable[[], FilePath]]:  # fmt: skip
    """What `holokin advise` does: (advice, what writes its job and returns the file).

    Args:
        say: hears what is going on. announce: hears, before the work begins, what is looked at and how long that takes.

    Raises:
        JobError, WriteError: the file exists, or cannot be written; said before anything is looked at. As `advise`,
        `load` and `parse_workspace`.
    """
    path = out or FilePath(f"advice-{FilePath(robot).stem}.toml")
    check_new(path)
    chain = chain_to_tool(robot, tip, base)
    q0 = None if start is None else chain.robot.checked(_posture(start), "the start posture")
    poses = workspace if workspace is not None and workspace.lower().endswith(".csv") else None
    at_start = None if q0 is None else chain.robot.pose(q0)[:3, :3]
    planar = chain.robot.planar
    space = None if workspace is None else parse_workspace(workspace, planar=planar, at_start=at_start)
    announce(f"{chain}. This takes {DURATION}.")
    found = advise(robot, space, tip=tip, base=base, task=task, q0=q0, say=say)  # type: ignore[arg-type]

    def write() -> FilePath:
        _write_advice(path, found, robot, base=base, poses=poses)
        return path

    return found, write


def _posture(text: str) -> list[float]:
    """Numbers with blanks or commas between them. Raises: ArgumentError."""
    try:
        return [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        raise ArgumentError("the start posture", text, "give numbers with blanks between them, in rad and m") from None


def _text(path: FilePath, advice: Advice, robot: str, base: str | None, poses: str | None, radius: float) -> str:
    law, task = advice.best, advice.task
    inward = -radius if task.pose(law.q0)[0, 3] > 0 else radius
    name = robot if not FilePath(robot).suffix else robot_name(robot, path)
    chosen = (
        {"name": name} | ({"tip": advice.chain.tip} if advice.chain.base else {}) | ({"base": base} if base else {})
    )
    parts = [
        f"title = {toml(f'{task.robot.name}: {law.name}'[:LONGEST_TITLE])}\nabout = {toml(' '.join(advice.reasons))}",
        table("robot", chosen),
        table("task", _task_keys(task)),
        "# " + ", ".join(task.robot.joint_names).replace("\n", " ") + "\n" + table("start", {"q": law.q0.tolist()}),
        table("path", {
            "kind": "circle", "center": [inward, 0.0, 0.0], "relative": True, "speed": 0.1, "samples": SAMPLES,
            "cycles": CYCLES,
        }),
        *([table("workspace", keys)] if (keys := _workspace_keys(advice.workspace, poses, path)) else []),
        table("strategies.advised", dict(law.keys)),
        table("strategies.moore-penrose", {"kind": "moore-penrose"}),
        table("expect.advised", {"holonomic": True, "drift_total": {"below": 1e-6}}),
    ]  # fmt: skip
    return "\n".join(part.rstrip("\n") + "\n" for part in parts)


def _task_keys(task: Task) -> dict[str, Any]:
    """[task] of a task that `fitting_task`, `pose` or `position` made."""
    if task.orientation is not None:
        return {"kind": "pose", "orientation": task.orientation}
    whole = tuple(range(2 if task.robot.planar else 3))
    return {"kind": "position"} | ({} if task.rows == whole else {"rows": list(task.rows)})


def _workspace_keys(space: Workspace, poses: str | None, path: FilePath) -> dict[str, Any]:
    """[workspace] of a workspace; empty for poses that are in no file."""
    if not isinstance(space, PoseRange):
        return {} if poses is None else {"kind": "poses", "file": robot_name(poses, path)}
    names = {"sides": "half", "height": "half_height"}
    sizes = {names.get(f.name, f.name): getattr(space.solid, f.name) for f in fields(space.solid)}
    keys = {key: np.asarray(value).tolist() for key, value in sizes.items()}
    turns = {"tilt_deg": round(float(np.degrees(space.tilt)), 9), "spin_deg": round(float(np.degrees(space.spin)), 9)}
    return {"kind": type(space.solid).__name__.lower(), **keys, "rotation": space.rotation.tolist(), **turns}


def _radii(space: Workspace) -> list[float]:
    """Radii [m] to try, the largest first."""
    half = space.solid.half if isinstance(space, PoseRange) else np.array([LARGEST])
    first = min(LARGEST, SHARE * float(half[half > 0].min()))
    return [float(f"{first / 2**k:.1g}") for k in range(SMALLER)]


def _runs(text: str, path: FilePath) -> bool:
    """Whether the law does what is expected and the pseudo-inverse follows the path, too."""
    keys = tomllib.loads(text) | {"verdict": {"samples": 1}}  # verdicts and coverage take long, and are known
    keys.pop("workspace", None)
    try:
        return run_job(path.stem, Job.model_validate(keys), path).passed
    except HolokinError:
        return False
