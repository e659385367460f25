"""What is asked of `holokin advise`: a robot with what is typed beside it, or a job with what is typed over it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

from ..base.types import Value, Vector
from ..errors import ArgumentError
from ..motion_checking.keeping_clear import Clearances
from ..path.workspaces import Workspace
from ..robot import LinkShape, Robot
from ..tasks.task import Task
from ..workspace_coverage.starts import task_of_kind
from ..workspace_coverage.tips import Chain, chain_to_tool
from .advice_words import axis_of, frame_words, limits_of, obstacle_words, posture_of
from .check_tables import ChecksTable
from .cover_strategies import workspace_of_job
from .job_file import job_of, job_table
from .job_parts import build_tasks
from .robot_tables import RobotTable, robot_of_job
from .runner import is_job, open_one_job
from .table_values import filled
from .workspace_words import parse_workspace


@dataclass(frozen=True)
class Typed:
    """What may be typed beside a robot or a job, as text; None, or empty, where it is not."""

    workspace: str | None = None
    tip: str | None = None
    base: str | None = None
    task: str | None = None
    axis: str | None = None
    q0: str | None = None
    degrees: bool = False
    tool: str | None = None
    base_pose: str | None = None
    limits: Sequence[str] = ()
    floor: float | None = None
    obstacles: Sequence[str] = ()
    clearance: float | None = None


@dataclass(frozen=True, eq=False)
class Question(Value):
    """A chain, its task, and where it works among what.

    apart: how far postures keep clear of that, None where nothing is asked; proven: the same as arguments of `certify`.
    chosen: what nobody gave. keys: the tables that say all this in a job; the whole job where there is one, which is
    in `file`. poses: the CSV file of the workspace, if it is of given poses.
    """

    chain: Chain
    task: Task
    workspace: Workspace | None
    q0: Vector | None
    apart: Clearances | None
    proven: Mapping[str, Any]
    obstacles: tuple[LinkShape, ...]
    chosen: tuple[str, ...]
    keys: Mapping[str, Any]
    file: FilePath | None
    poses: str | None

    @property
    def shown(self) -> Robot:
        """The robot for pictures, with the tools that the checks give it."""
        checks = self.keys.get("checks")
        return ChecksTable.model_validate(checks).drawn(self.task.robot) if checks else self.task.robot


def question(name: str, typed: Typed) -> Question:
    """What is asked about a robot or a job. Raises: as `load`, `open_job`, `parse_workspace`; ArgumentError."""
    if typed.axis is not None and typed.task not in (None, "axis"):
        raise ArgumentError("the axis", typed.axis, f"only the task axis has one: leave it out for {typed.task}")
    return _of_job(name, typed) if is_job(name) else _of_robot(name, typed)


def _of_robot(name: str, typed: Typed) -> Question:
    chain = chain_to_tool(name, typed.tip, typed.base)
    given = {"name": name} | ({"tip": chain.tip} if chain.base else {})
    given |= {"base": typed.base} if typed.base else {}
    keys = {"robot": given | _robot_words(chain.robot, typed)}
    robot = robot_of_job(filled(RobotTable, "robot", keys["robot"]), FilePath("advice.toml"))
    axis = "z" if typed.axis is None else axis_of(typed.axis)
    kind = "axis" if typed.axis is not None else typed.task
    task = task_of_kind(robot, None, kind, axis)
    q0 = None if typed.q0 is None else robot.checked(posture_of(typed.q0, robot, typed.degrees), "the start posture")
    checks = _checks_words(typed)
    keys |= {"checks": checks} if checks else {}
    space, poses = _typed_workspace(typed, task, q0)
    table = filled(ChecksTable, "checks", checks) if checks else None
    words = {"tip": not chain.chosen, "task": kind, "q0": q0, "workspace": space}
    chosen = tuple(word for word, value in words.items() if value is None or value is False)
    chain = Chain(robot, chain.base, chain.tip, chain.others, chain.chosen)
    return Question(chain, task, space, q0, *_among(table, robot), chosen, keys, None, poses)


def _of_job(name: str, typed: Typed) -> Question:
    _, job, file = open_one_job(name)
    keys = job_table(file)
    robot, _, _ = build_tasks(job, file)
    keys["robot"] |= {"tip": typed.tip} if typed.tip else {}
    keys["robot"] |= {"base": typed.base} if typed.base else {}
    keys["robot"] |= _robot_words(robot, typed)
    if typed.q0 is not None:
        keys["start"] = {"q": posture_of(typed.q0, robot, typed.degrees)}
    if typed.task is not None or typed.axis is not None:
        keys["task"] = _task_words(typed)
    if words := _checks_words(typed):
        more = [*keys.get("checks", {}).get("obstacles", []), *words.pop("obstacles", [])]
        keys["checks"] = keys.get("checks", {}) | words | ({"obstacles": more} if more else {})
    job = job_of(file, keys)
    robot, start, tasks = build_tasks(job, file)
    task = tasks[0]
    if task.n == task.m:
        cure = "say --task axis if the tool may spin about its axis, or --task position"
        raise ArgumentError(f"the number of redundant joints of {robot.name!r} for the job's task", 0, cure)
    space, poses = _typed_workspace(typed, task, start)
    space = space or workspace_of_job(job, task, start, file)
    chain = Chain(robot, None, task.tip or robot.tips[0].name, (), False)
    return Question(chain, task, space, start, *_among(job.checks, robot), (), keys, file, poses)


def _robot_words(robot: Robot, typed: Typed) -> dict[str, Any]:
    """[robot] keys of what is typed."""
    found: dict[str, Any] = {}
    found |= {"tool": frame_words("--tool", typed.tool)} if typed.tool is not None else {}
    found |= {"base_pose": frame_words("--base-pose", typed.base_pose)} if typed.base_pose is not None else {}
    return found | limits_of(typed.limits, robot, typed.degrees)


def _task_words(typed: Typed) -> dict[str, Any]:
    """[task] of what is typed."""
    if typed.task in ("pose", "position"):
        return {"kind": typed.task}
    axis = {} if typed.axis is None else {"axis": axis_of(typed.axis)}
    return {"kind": "pose", "orientation": "axis"} | axis


def _checks_words(typed: Typed) -> dict[str, Any]:
    """[checks] of what is typed; empty where nothing stands round the robot."""
    found: dict[str, Any] = {} if typed.floor is None else {"floor": float(typed.floor)}
    found |= {} if typed.clearance is None else {"clearance": float(typed.clearance)}
    return found | ({"obstacles": [obstacle_words(text) for text in typed.obstacles]} if typed.obstacles else {})


def _typed_workspace(typed: Typed, task: Task, q0: Vector | None) -> tuple[Workspace | None, str | None]:
    """(the workspace that is typed, its CSV file if it is one)."""
    if typed.workspace is None:
        return None, None
    at_start = None if q0 is None else task.robot.pose(q0, task.tip)[:3, :3]
    space = parse_workspace(typed.workspace, planar=task.robot.planar, at_start=at_start)
    return space, typed.workspace if typed.workspace.lower().endswith(".csv") else None


def _among(table: ChecksTable | None, robot: Robot) -> tuple[Clearances | None, dict[str, Any], tuple[LinkShape, ...]]:
    """(how far postures keep clear, the same as arguments of `certify`, the obstacles that stand still)."""
    standing = () if table is None else table.standing()
    apart = None if table is None else table.clearances(robot)
    if table is None or apart is None or not apart.names:
        return None, {}, standing
    proven = table.proven(robot)
    del proven["limits"]
    return apart, proven, standing
