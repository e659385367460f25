"""The job file of an advice: the best law round a circle in the workspace, tried before it is written."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...analysis.design import Advice
from ...analysis.design.compare_laws import advise_chain
from ...base.errors import ArgumentError, HolokinError
from ...path.workspaces import Box, PoseRange, Workspace
from ...strategies.tasks.frame_task import FrameTask
from ...strategies.tasks.task import Task
from .advice_over_job import write_over
from .advice_question import Question
from .runner import run_job
from .schema import LONGEST_TITLE, Job
from .toml_text import check_new, robot_name, table, toml, write_new

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


def advise_command(
    name: str,
    asked: Question,
    out: FilePath | None,
    say: Callable[[str], None],
    announce: Callable[[str], None],
    levels: bool = False,
) -> tuple[Advice, Callable[[], tuple[FilePath, str]]]:
    """What `holokin advise` does: (advice, what writes its job and returns the file and a remark).

    Args:
        name: of a robot or a job. asked: about it. say: hears what is going on. announce: hears, before the work
            begins, what is looked at and how long that takes. levels: as of `advise`.

    Raises:
        JobError, WriteError: the file exists, or cannot be written; said before anything is looked at. As `advise`.
    """
    path = out or FilePath(f"advice-{FilePath(name).stem}.toml")
    check_new(path)
    announce(f"{asked.chain}. This takes {DURATION}.")
    found = advise_chain(
        asked.chain,
        asked.task,
        asked.workspace,
        asked.q0,
        chosen=asked.chosen,
        apart=asked.apart,
        proven=asked.proven,
        say=say,
        levels=levels,
    )

    def write() -> tuple[FilePath, str]:
        if asked.file is not None:
            return path, write_over(path, found, asked.keys, asked.file)
        _write_advice(path, found, asked)
        return path, ""

    return found, write


def proof_command(advice: Advice, asked: Question, job: FilePath) -> str:
    """The command that proves what the advice looked at pose by pose: over its box, or along the path of the job; empty
    where no proof is made of the law.
    """
    if not advice.certify_by:
        return ""
    space = advice.workspace
    box = asked.file is None and isinstance(space, PoseRange) and isinstance(space.solid, Box)
    return f"holokin certify {job}{' --workspace' if box and advice.best.served.all() else ''}"


def _write_advice(path: FilePath, advice: Advice, asked: Question) -> None:
    """Write a job of the best law of an advice, beside the pseudo-inverse, to a new file.

    Both are followed round a circle in the workspace before it is written; what must stay true of the law is expected.

    Raises:
        JobError: the file exists, or is no .toml. ArgumentError: no circle was found. WriteError.
    """
    check_new(path)
    for radius in _radii(advice.workspace):
        text = _text(path, advice, asked, radius)
        if _runs(text, path):
            write_new(path, text)
            return
    raise ArgumentError("the circle of the job", None, "none was found that the law follows: write a path of your own")


def _text(path: FilePath, advice: Advice, asked: Question, radius: float) -> str:
    law, task, space = advice.best, advice.task, advice.workspace
    inward = -radius if task.pose(law.q0)[0, 3] > 0 else radius
    chosen = dict(asked.keys["robot"])
    chosen["name"] = robot_name(chosen["name"], path) if FilePath(chosen["name"]).suffix else chosen["name"]
    parts = [
        f"title = {toml(f'{task.robot.name}: {law.name}'[:LONGEST_TITLE])}\nabout = {toml(' '.join(advice.reasons))}",
        table("robot", chosen),
        table("task", _task_keys(task)),
        "# " + ", ".join(task.robot.joint_names).replace("\n", " ") + "\n" + table("start", {"q": law.q0.tolist()}),
        table("path", {
            "kind": "circle", "center": [inward, 0.0, 0.0], "relative": True, "speed": 0.1, "samples": SAMPLES,
            "cycles": CYCLES,
        }),
        *([table("workspace", _workspace_keys(space))] if isinstance(space, PoseRange) else []),
        table("strategies.advised", dict(law.keys)),
        table("strategies.moore-penrose", {"kind": "moore-penrose"}),
        table("expect.advised", {"holonomic": True, "drift_total": {"below": 1e-6}}),
    ]  # fmt: skip
    return "\n".join(part.rstrip("\n") + "\n" for part in parts)


def _task_keys(task: Task) -> dict[str, Any]:
    """[task] of a task that `task_of_kind` made."""
    if task.orientation is not None:
        axis = {"axis": task.axis.tolist()} if isinstance(task, FrameTask) and task.orientation == "axis" else {}
        return {"kind": "pose", "orientation": task.orientation} | axis
    whole = tuple(range(2 if task.robot.planar else 3))
    return {"kind": "position"} | ({} if task.rows == whole else {"rows": list(task.rows)})


def _workspace_keys(space: PoseRange) -> dict[str, Any]:
    """[workspace] of a workspace."""
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
