"""`open_session`: a session of a job, or of a robot with laws and a loop to begin with."""

from __future__ import annotations

import tomllib
from pathlib import Path as FilePath

import numpy as np

from ..designing import fitting_task, regular_starts
from ..errors import ArgumentError, HolokinError
from ..job import open_one_job, packaged_jobs
from ..job.build import build_begin, build_strategy, build_tasks, naming
from ..job.schema import Job
from ..job.several_paths import build_paths
from ..motion import follow
from ..robot import Robot, load
from ..strategies import HolonomicStrategy
from ..task import Task
from ..types import ArrayLike, Vector
from .laws import Law, default_laws, redundant
from .loops import Loop, circle_loop
from .session import Session

TRIED = 4
"""Start postures that are tried for a robot, each with loops of three sizes."""

SIZES = (0.1, 0.05, 0.02, 0.01)
"""Radii of the loop that is tried [m]."""


def open_session(name: str, *, tip: str | None = None, base: str | None = None) -> Session:
    """A session of a job (packaged, or a file), or of a robot (of the catalogue, or a file).

    A job gives its robot, task, start, path and strategies. A robot gets the task that leaves joints free, a start in
    the middle of its joint limits, `default_laws`, and a circle that all of them follow to the end.

    Args:
        name: as of `holokin run` or of `hk.load`. tip, base: of a robot, as of `hk.load`.

    Raises:
        ArgumentError: no joint is to spare. HolokinError: what reading jobs and robots raises.
    """
    if name in packaged_jobs() or _is_job(name):
        short, job, file = open_one_job(name)
        return session_of_job(short, job, file)
    return session_of_robot(load(name, tip=tip, base=base), source=name)


def _is_job(name: str) -> bool:
    """Whether a TOML file holds a job; others are tables of a robot. What cannot be read is left to who reads jobs."""
    if not name.lower().endswith(".toml") or not FilePath(name).is_file():
        return False
    try:
        table = tomllib.loads(FilePath(name).read_text("utf-8"))
    except (OSError, ValueError):
        return True
    return bool({"strategies", "path", "task", "start"} & table.keys())


def session_of_job(name: str, job: Job, file: FilePath) -> Session:
    """A session of a job that was read.

    Raises:
        ArgumentError: no joint is to spare. HolokinError: as `run_job`; of a strategy that cannot begin, its reason.
    """
    robot, start, tasks = build_tasks(job, file)
    redundant(tasks[0])
    with naming(file, "path"):
        path, _ = build_paths(job, tasks[0], start, file)
    laws: list[Law] = []
    first: HolokinError | None = None
    for label, table in job.strategies.items():
        for task in tasks:
            title = label if len(tasks) == 1 else f"{label} ({task.orientation})"
            try:
                with naming(file, "strategies", label):
                    strategy = build_strategy(job, label, task, start, title)
                    begin, _ = build_begin(table, strategy, start)
                    strategy(begin)
            except HolokinError as problem:
                first = first or problem
                continue
            level = None
            keys = table.model_dump(exclude_unset=True)
            if keys.get("leaf") is not None and isinstance(strategy, HolonomicStrategy):
                level = np.atleast_1d(np.array(keys["leaf"], dtype=float))
            laws.append(Law(title, len(laws), strategy, task, level, keys))
    if not laws and first is not None:
        raise first
    keys = job.path.model_dump(exclude_unset=True, exclude={"samples", "cycles"})
    loop = Loop(job.path.kind, path, keys, job.path.samples, bool(job.path.clockwise))
    return Session(laws, start, loop, title=job.title, source=name, cycles=job.path.cycles)


def session_of_robot(
    robot: Robot, task: Task | None = None, start: ArrayLike | None = None, *, source: str = ""
) -> Session:
    """A session of a robot, with laws and a loop to begin with.

    Args:
        task: by default the pose, or else the position, or less, so that a joint is to spare.
        start: by default a regular posture in the middle of the joint limits.

    Raises:
        ArgumentError: no joint is to spare. HolokinError: no law is defined at the start.
    """
    chosen = fitting_task(robot) if task is None else task
    redundant(chosen)
    starts = regular_starts(chosen)[:TRIED] if start is None else robot.checked(start, "the start posture")[None]
    if not len(starts):
        raise ArgumentError(f"the start of {robot.name!r}", None, "no posture within its limits was found: give one")
    best: tuple[int, Vector, tuple[Law, ...], Loop | None] = (-1, starts[0], (), None)
    for q in starts:
        laws = default_laws(chosen, q)
        for radius in SIZES:
            tool = chosen.pose(q)[..., :3, 3].reshape(-1, 3)[0]
            inward = np.array([-radius if tool[0] > 0 else radius, 0.0, 0.0])
            loop = circle_loop(tool + inward, radius, near=tool)
            count = sum(_follows(law, loop, q) for law in laws)
            if count > best[0]:
                best = count, q, laws, loop
            if count == len(laws):
                return Session(laws, q, loop, title=robot.name, source=source)
    _, q, laws, loop = best
    return Session(laws, q, loop, title=robot.name, source=source)


def _follows(law: Law, loop: Loop, q: Vector) -> bool:
    """Whether a law follows a loop to its end."""
    if law.strategy is None:
        return True
    try:
        follow(law.strategy, loop.path, q, samples=100)
    except HolokinError:
        return False
    return True
