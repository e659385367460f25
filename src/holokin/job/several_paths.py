"""The paths of a job whose task has several frames: that of [path] for the first one, and `others` for the next."""

from __future__ import annotations

from pathlib import Path as FilePath

from ..errors import ArgumentError
from ..synchronized_paths import AnyPath, synchronized
from ..task import Task
from ..task_kinds import parts_of
from ..types import Vector
from .build import build_path
from .schema import Job


def build_paths(job: Job, task: Task, start: Vector, file: FilePath) -> AnyPath:
    """The path, or those of several frames run through together; a frame that has none stays where it starts.

    Raises:
        JobError, ArgumentError: as `build_path`, or more paths than frames.
    """
    others = job.path.others or []
    if len(others) >= task.frames:
        cure = f"the task has {task.frames}: leave some out"
        raise ArgumentError("the number of frames with a path", len(others) + 1, cure)
    if task.frames == 1:
        return build_path(job, task, start, file)
    found = []
    for f, part in enumerate(parts_of(task)):
        if f > len(others):
            found.append(part.pose(start)[:3, 3])
        else:
            table = job.path if f == 0 else others[f - 1]
            found.append(build_path(job.model_copy(update={"path": table}), part, start, file))
    return synchronized(*found)
