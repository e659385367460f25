"""The paths of a job whose task has several frames: that of [path] for the first one, and `others` for the next."""

from __future__ import annotations

from pathlib import Path as FilePath

from ...base.errors import ArgumentError, JobError
from ...base.types import Vector
from ...path.synchronized_paths import AnyPath, synchronized
from ...strategies.tasks.frame_task import parts_of
from ...strategies.tasks.task import Task
from .path_building import build_path
from .path_tables import PathTable


def build_paths(table: PathTable, task: Task, q0: Vector, file: FilePath) -> AnyPath:
    """The path, or paths of several frames run through together; one without stays where it is.

    Raises:
        JobError, ArgumentError: as `build_path`; more paths than frames; an entry, which serves one tool.
    """
    others = table.others or []
    if len(others) >= task.frames:
        cure = f"the task has {task.frames}: leave some out"
        raise ArgumentError("the number of frames with a path", len(others) + 1, cure)
    if task.frames == 1:
        return build_path(table, task, q0, file)
    if table.entry is not None:
        raise JobError(file, "path.entry", "leads one tool to its path, the task has several", "leave it out")
    found = []
    for f, part in enumerate(parts_of(task)):
        if f > len(others):
            found.append(part.pose(q0)[:3, 3])
        else:
            its = table if f == 0 else others[f - 1].model_copy(update={"cycles": table.cycles})
            found.append(build_path(its, part, q0, file))
    return synchronized(*found)
