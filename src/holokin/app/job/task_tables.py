"""[task] of a job file: what the tool, or two of them, shall do; and the tasks of it.

A new kind of task is one more value of `kind` here, its keys, each with the kinds that use it, and its case in `tasks`.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from ...base.types import Vector
from ...robot import Robot
from ...strategies.tasks.frame_task import stacked
from ...strategies.tasks.orientation_rows import Orientation
from ...strategies.tasks.task import Task
from ...strategies.tasks.task_kinds import custom_task, line_of_sight, pose, position, relative_pose
from .robot_tables import MOST_PARTS, Three
from .table_values import MOST_JOINTS, Formula, KindTable, column, needed_by, of

Orientations = Annotated[list[Orientation], Field(min_length=1)]
Axis = Literal["x", "y", "z"] | Three
Rows = Field(min_length=1, max_length=MOST_JOINTS)
Parts = Field(min_length=2, max_length=MOST_PARTS)


class TaskTable(KindTable):
    """[task]: position, pose, the pose of one tip in another's frame, a camera's line of sight, formulas, or several.

    A list of orientations runs every strategy once for each.
    """

    kind: Literal["position", "pose", "relative-pose", "line-of-sight", "custom", "stacked"] = "position"
    orientation: Annotated[Orientation | Orientations, of("pose", "relative-pose")] = "twist"
    axis: Annotated[Axis, of("pose", "relative-pose", "line-of-sight")] = "z"
    rows: Annotated[Annotated[list[int], Field(max_length=6)] | None, of("position", "pose", "relative-pose")] = None
    tip: Annotated[str | None, of("position", "pose", "line-of-sight"), needed_by("relative-pose")] = None
    other: Annotated[str | None, needed_by("relative-pose")] = None
    point: Annotated[Three | None, needed_by("line-of-sight")] = None
    expressions: Annotated[Annotated[list[Formula], Rows] | None, needed_by("custom")] = None
    units: Annotated[Annotated[list[str], Rows] | None, needed_by("custom")] = None
    names: Annotated[Annotated[list[str], Rows] | None, of("custom")] = None
    parts: Annotated[Annotated[list[TaskTable], Parts] | None, needed_by("stacked")] = None

    @model_validator(mode="after")
    def _complete(self) -> TaskTable:
        kinds = self.orientation
        if isinstance(kinds, list) and len(set(kinds)) < len(kinds):
            raise ValueError(f"orientation = {kinds} names one twice; name each once")
        if "axis" in self.model_fields_set and self.kind != "line-of-sight" and "axis" not in self._orientations:
            raise ValueError('axis serves orientation = "axis"; leave it out')
        if any(isinstance(part.orientation, list) or part.kind == "stacked" for part in self.parts or []):
            raise ValueError("a part of a stacked task has one orientation, and no parts of its own; choose one")
        return self

    @property
    def _orientations(self) -> list[Orientation]:
        return self.orientation if isinstance(self.orientation, list) else [self.orientation]

    def tasks(self, robot: Robot, q0: Vector) -> list[Task]:
        """One task, or one for each orientation of a list; what counts from a reference does so from the start."""
        if self.kind == "position":
            return [position(robot, self.tip, rows=self.rows)]
        if self.kind == "line-of-sight":
            return [line_of_sight(robot, self.point or (), axis=self.axis, tip=self.tip)]
        if self.kind == "custom":
            formulas = column(self.expressions or [], robot)
            return [custom_task(robot, formulas, units=self.units or (), names=self.names, name="task")]
        if self.kind == "pose":
            at = robot.pose(q0, self.tip)[:3, :3]
            return [
                pose(robot, kind, reference=at, axis=self.axis, tip=self.tip, rows=self.rows)
                for kind in self._orientations
            ]
        if self.kind == "stacked":
            return [stacked(*(part.tasks(robot, q0)[0] for part in self.parts or []))]
        tip, other = self.tip or "", self.other or ""
        at = relative_pose(robot, tip, other).pose(q0)[:3, :3]
        return [
            relative_pose(robot, tip, other, kind, reference=at, axis=self.axis, rows=self.rows)
            for kind in self._orientations
        ]
