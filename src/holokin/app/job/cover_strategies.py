"""[workspace]: how many of its poses each strategy with leaves reaches."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path as FilePath

import numpy as np

from ...analysis.coverage import Reach, coverage, coverage_slices, posture_reach
from ...base.errors import ArgumentError
from ...base.types import Matrix, Value, Vector
from ...path import Path, read_workspace
from ...path.workspaces import PoseRange, Workspace, pose_cloud, workspace
from ...strategies import HolonomicStrategy
from ...strategies.tasks.task import Task
from ..report.job_result import StrategyResult
from .job_parts import naming
from .schema import Job, WorkspaceTable
from .several_paths import build_paths

PLACES = 256
"""Poses of a path that stand for a workspace."""


@dataclass(frozen=True, eq=False)
class Covering(Value):
    """The workspace of a job, as its table asks for it."""

    workspace: Workspace
    table: WorkspaceTable
    task: Task
    q0: Vector

    @cached_property
    def reach(self) -> Reach:
        """Which poses the arm reaches by any posture: the same for all strategies."""
        asked = self.table
        return posture_reach(self.task, self.workspace, self.q0, samples=asked.samples, seed=asked.seed)

    def added(self, result: StrategyResult, strategy: HolonomicStrategy, q0: Vector) -> StrategyResult:
        """A result with the coverage of the leaf on which the strategy begins, and slices where there are planes."""
        asked, space = self.table, self.workspace
        covers = coverage(
            strategy, space, q0, samples=asked.samples, seed=asked.seed, limits=asked.limits, reach=self.reach
        )
        slices = ()
        if isinstance(space, PoseRange) and asked.slices:
            slices = coverage_slices(strategy, space, q0, steps=max(2, asked.slices), limits=asked.limits)
        return replace(result, coverage=covers, slices=slices)


def build_covering(job: Job, task: Task, q0: Vector, file: FilePath) -> Covering | None:
    """The workspace of a job with what is asked of it; None for a job without. Raises: JobError, RecordingError."""
    if job.workspace is None:
        return None
    at_start = task.robot.pose(q0)[:3, :3]
    return Covering(build_workspace(job.workspace, at_start, file), job.workspace, task, q0)


def build_workspace(table: WorkspaceTable, at_start: Matrix, file: FilePath) -> Workspace:
    """The workspace of a table; a file of poses counts from the job file's folder.

    Args:
        at_start: rotation (3, 3) of the tool at the start.

    Raises:
        JobError, RecordingError.
    """
    if table.kind == "poses":
        return read_workspace(file.parent / str(table.file), ignore=table.ignore)
    solid = {
        "box": table.box_sides,
        "cylinder": (table.center, table.radius, table.half_height),
        "sphere": (table.center, table.radius),
    }[table.kind]
    rotations = {"down": None, "start": at_start}
    rotation = rotations[table.rotation] if isinstance(table.rotation, str) else table.rotation
    angles = {"tilt": np.deg2rad(table.tilt_deg), "spin": np.deg2rad(table.spin_deg)}
    with naming(file, "workspace"):
        return workspace(**{table.kind: solid}, rotation=rotation, **angles)  # type: ignore[arg-type]


def workspace_of_job(job: Job, task: Task, start: Vector, file: FilePath) -> Workspace:
    """[workspace] of a job; without one the poses along its path. Raises: as `build_workspace`; ArgumentError."""
    tool = task.robot.pose(start, task.tip)[:3, :3]
    if job.workspace is not None:
        return build_workspace(job.workspace, tool, file)
    path = build_paths(job.path, task, start, file)
    if not isinstance(path, Path):
        raise ArgumentError("the paths of several tools", len(path.paths), "this is for one tool: add a [workspace]")
    shares = np.linspace(0.0, 1.0, PLACES, endpoint=not path.closed)
    places = path.at(shares * path.duration)
    T = np.tile(np.eye(4), (PLACES, 1, 1))
    T[:, :3, 3] = places.position
    T[:, :3, :3] = places.rotation @ (tool if path.rotation is None else path.rotation)
    return pose_cloud(T, f"the path of {file.name}")
