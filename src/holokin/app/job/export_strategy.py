"""A strategy of a job as C for a controller."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import Any

from ...base.errors import ArgumentError, UnknownNameError
from ...base.types import Vector
from ...export import c_name
from ...strategies import Strategy
from .job_parts import build_begin, build_strategy, build_tasks, naming
from .schema import Job


def job_strategy(
    job: Job, file: FilePath, label: str | None = None, orientation: str | None = None
) -> tuple[str, Strategy, Vector]:
    """(label, strategy, the posture it begins at) of a job.

    Args:
        label: the strategy's name in the job; may be left out where there is only one.
        orientation: one of the job's representations of orientation; by default its first.

    Raises:
        UnknownNameError: no such strategy or orientation, or none named among several.
    """
    _, start, tasks = build_tasks(job, file)
    if label is None and len(job.strategies) == 1:
        label = next(iter(job.strategies))
    if label is None:
        cure = f"say which one with --strategy: {', '.join(job.strategies)}"
        raise ArgumentError("the number of strategies of the job", len(job.strategies), cure)
    if label not in job.strategies:
        raise UnknownNameError(f"strategy of {file.name}", label, tuple(job.strategies))
    known = tuple(str(task.orientation) for task in tasks)
    if orientation is not None and orientation not in known:
        raise UnknownNameError(f"orientation of {file.name}", orientation, known)
    task = tasks[0 if orientation is None else known.index(orientation)]
    table = job.strategies[label]
    with naming(file, "strategies", label):
        strategy = build_strategy(job, label, task, start, label)
        return label, strategy, build_begin(table, strategy, start)[0]


def exported_strategy(
    name: str, job: Job, file: FilePath, label: str | None = None, *, orientation: str | None = None,
    prefix: str | None = None,
) -> tuple[Strategy, dict[str, Any]]:  # fmt: skip
    """A strategy of a job, and what all exports are told of it: its start, its C name, where it comes from.

    Raises:
        as `job_strategy`.
    """
    label, strategy, start = job_strategy(job, file, label, orientation)
    short = c_name(f"{strategy.task.robot.name}_{label}") if prefix is None else prefix
    return strategy, {"q0": start, "name": short, "origin": f"the job {name}, strategy {label}"}
