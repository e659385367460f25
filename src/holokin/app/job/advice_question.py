"""What is asked of `holokin advise`: a robot with a box in which it works, or a job, which says all of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...analysis.coverage.starts import task_of_kind
from ...analysis.coverage.tips import Chain, chain_to_tool
from ...base.errors import ArgumentError
from ...base.types import Value, Vector
from ...motion.checks.keeping_clear import Clearances
from ...path.workspaces import Workspace, workspace
from ...robot import LinkShape, Robot
from ...strategies.tasks.task import Task
from .advice_words import numbers_of
from .check_tables import ChecksTable
from .cover_strategies import workspace_of_job
from .job_file import job_table
from .job_parts import build_tasks
from .runner import is_job, open_one_job


@dataclass(frozen=True, eq=False)
class Question(Value):
    """A chain, its task, and where it works among what.

    apart: how far postures keep clear of that, None where nothing is asked; proven: the same as arguments of `certify`.
    chosen: what nobody gave. keys: the tables that say all this in a job; the whole job where there is one, which is
    in `file`.
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

    @property
    def shown(self) -> Robot:
        """The robot for pictures, with the tools that the checks give it."""
        checks = self.keys.get("checks")
        return ChecksTable.model_validate(checks).drawn(self.task.robot) if checks else self.task.robot


def question(
    name: str, *, box: str | None = None, tilt: float | None = None, tip: str | None = None, base: str | None = None,
    task: str | None = None, trust_units: bool = False,
) -> Question:  # fmt: skip
    """What is asked about a robot or a job. Raises: as `load`, `open_job`; ArgumentError.

    Args:
        name: of a robot or a job.
        box: of a robot: "X Y Z HX HY HZ" [m], the centre and half the sides. tilt: of the tool in it [deg].
        tip, base, trust_units: of a robot, as of `load`. task: "pose", "axis" or "position".
    """
    if not is_job(name):
        return _of_robot(name, box, tilt, tip, base, task, trust_units)
    options = {
        "--box": box,
        "--tilt": tilt,
        "--tip": tip,
        "--base": base,
        "--task": task,
        "--trust-units": trust_units or None,
    }
    for option, value in options.items():
        if value is not None:
            raise ArgumentError(f"{option} beside a job", value, f"a job says all of it: write it into {name}")
    return _of_job(name)


def _of_robot(
    name: str, box: str | None, tilt: float | None, tip: str | None, base: str | None, kind: str | None,
    trust_units: bool,
) -> Question:  # fmt: skip
    chain = chain_to_tool(name, tip, base, trust_units)
    keys: dict[str, Any] = (
        {"name": name} | ({"tip": chain.tip} if chain.base else {}) | ({"base": base} if base else {})
    )
    keys |= {"trust_units": True} if trust_units else {}
    task = task_of_kind(chain.robot, None, kind)
    if box is None and tilt is not None:
        raise ArgumentError("--tilt without --box", tilt, "give the box in which the tool leans, too")
    space = None if box is None else _typed_box(box, tilt or 0.0, chain.robot.planar)
    given = {"tip": not chain.chosen, "task": kind, "q0": None, "workspace": space}
    chosen = tuple(word for word, value in given.items() if value is None or value is False)
    return Question(chain, task, space, None, None, {}, (), chosen, {"robot": keys}, None)


def _of_job(name: str) -> Question:
    _, job, file = open_one_job(name)
    robot, start, (task, *_) = build_tasks(job, file)
    if task.n == task.m:
        cure = 'write orientation = "axis" into [task] if the tool may spin about its axis, or kind = "position"'
        raise ArgumentError(f"the number of redundant joints of {robot.name!r} for the job's task", 0, cure)
    space = workspace_of_job(job, task, start, file)
    chain = Chain(robot, None, task.tip or robot.tips[0].name, (), False)
    keys = job_table(file)
    return Question(chain, task, space, start, *_among(job.checks, robot), (), keys, file)


def _typed_box(text: str, tilt: float, planar: bool) -> Workspace:
    """The box of a text, with the tool down, or in a plane as the base. Raises: ArgumentError."""
    numbers = numbers_of(text)
    if numbers is None or len(numbers) not in (4, 6):
        cure = 'write "X Y Z HX HY HZ", its centre and half its sides in metres; in a plane "X Y HX HY"'
        raise ArgumentError("--box", text, cure)
    half = len(numbers) // 2
    rotation = np.eye(3) if planar else None
    return workspace(box=(numbers[:half], numbers[half:]), rotation=rotation, tilt=np.deg2rad(tilt))


def _among(table: ChecksTable | None, robot: Robot) -> tuple[Clearances | None, dict[str, Any], tuple[LinkShape, ...]]:
    """(how far postures keep clear, the same as arguments of `certify`, the obstacles that stand still)."""
    standing = () if table is None else table.standing()
    apart = None if table is None else table.clearances(robot)
    if table is None or apart is None or not apart.names:
        return None, {}, standing
    proven = table.proven(robot)
    del proven["limits"]
    return apart, proven, standing
