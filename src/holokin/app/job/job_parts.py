"""From the tables of a job to the nouns: robot, tasks, path, strategies."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path as FilePath
from typing import cast

import numpy as np

from ...analysis.curvature import MOST_JOINTS
from ...base.errors import (
    BranchError,
    HolokinError,
    JobError,
    JointLimitError,
    MissingExtraError,
    PathError,
    SingularityError,
    posture_text,
)
from ...base.types import Vector
from ...motion.ik import move_to_leaf
from ...robot import Robot
from ...strategies import HolonomicStrategy, Strategy
from ...strategies.tasks.task import Task
from .job_file import dotted
from .robot_tables import robot_of_job
from .schema import Job
from .strategy_tables import ConstraintTable, Fitted, StrategyTable


def build_robot(job: Job, file: FilePath) -> Robot:
    """The robot of a job; a path counts from the job file's folder."""
    with naming(file, "robot") if job.robot.parts is not None or job.robot.order is not None else nullcontext():
        robot = robot_of_job(job.robot, file)
    if robot.n > MOST_JOINTS:
        cure = f"laws of at most {MOST_JOINTS} joints are judged: choose tip and base nearer together, or lock some"
        raise JobError(file, "robot", f"moves {robot.n} joints", cure)
    return robot


@contextmanager
def naming(file: FilePath, *key: str) -> Iterator[None]:
    """Errors of what a job asks for name its file and key. Along a path, or without an extra, they keep theirs."""
    try:
        yield
    except (JobError, PathError, MissingExtraError):
        raise
    except HolokinError as problem:
        fact, _, cure = str(problem).rpartition("; ")
        raise JobError(file, dotted(key), fact or cure, cure if fact else "change it") from problem


def _build_start(job: Job, robot: Robot, file: FilePath) -> Vector:
    """The start posture (n,) in rad and m. Raises: JobError, JointLimitError."""
    q = np.array(job.start.q, dtype=float)
    if len(q) != robot.n:
        names = ", ".join(robot.joint_names)
        raise JobError(file, "start.q", f"has {len(q)} numbers", f"give {robot.n}, for {names}")
    scales = np.where(robot.hinges, np.pi / 180, 1.0)
    if job.start.degrees:
        q = scales * q
    try:
        robot.check_limits(q)
    except JointLimitError as problem:
        if job.start.degrees or robot.beyond(scales * q).max() > 0:
            raise
        fact = f"puts joint {problem.joint!r} at {problem.value:.6g} rad, outside its limits"
        limits = f"[{problem.lower:.6g}, {problem.upper:.6g}]"
        cure = "say degrees = true if these are degrees, or choose another start posture"
        raise JobError(file, "start.q", f"{fact} {limits}", cure) from None
    return q


def build_tasks(job: Job, file: FilePath) -> tuple[Robot, Vector, list[Task]]:
    """(robot, start posture (n,), a task, or one for each orientation of a list) of a job.

    Raises:
        JobError, JointLimitError, and what the tasks raise.
    """
    robot = build_robot(job, file)
    start = _build_start(job, robot, file)
    with naming(file, "task"):
        return robot, start, job.task.tasks(robot, start)


def build_strategy(job: Job, label: str, task: Task, q0: Vector, title: str) -> Strategy:
    """A strategy of the job, called `title`; a fitted one is fitted to another one of it. Raises: HolokinError."""
    table = job.strategies[label]
    if isinstance(table, Fitted):
        return table.fit(build_strategy(job, table.of, task, q0, table.of), q0, title)
    return table.build(task, q0, title)


def build_begin(table: StrategyTable, strategy: Strategy, q0: Vector) -> tuple[Vector, str]:
    """Where a strategy begins (n,), and a sentence on it: the start posture, or with `level` the one moved to from it.

    Raises:
        BranchError where moving to the leaf fails; else as `move_to_leaf`.
    """
    if not isinstance(table, ConstraintTable) or table.level is None:
        return q0, ""
    level = ", ".join(f"{value:g}" for value in np.atleast_1d(table.level))
    try:
        begin = move_to_leaf(cast(HolonomicStrategy, strategy), q0, table.level, limits=False)  # it refuses others
    except (SingularityError, PathError) as problem:
        fact, _, cure = str(problem).rpartition("; ")
        fact = f"moving to the leaf failed: from the start posture to level {level}, {fact}"
        raise BranchError(fact, f"{cure}, or another level") from problem
    at = posture_text(begin, strategy.task.robot.joint_names)
    return begin, f"{strategy.name} begins on the leaf of level {level}, moved to from the start posture, at {at}."
