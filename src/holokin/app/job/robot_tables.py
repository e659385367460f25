"""[robot] of a job file: a robot by name, its tool and mounting, or parts put together; and the robot of it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from ...base.types import Matrix
from ...path import frame_pose
from ...robot import Robot, assembled, beside, coordinates, load, with_limits
from .table_values import Length, Number, Numbers, Table

MOST_PARTS = 32
"""Robots of which one is put together."""

Three = Annotated[list[Length], Field(min_length=3, max_length=3)]
Names = Annotated[list[str], Field(max_length=1000)]
Tips = Annotated[list[str], Field(min_length=1, max_length=MOST_PARTS)]
Limit = Number | Numbers | Annotated[dict[str, Number], Field(max_length=1000)]
"""Of all joints, of each, or of some by name."""


class FrameTable(Table):
    """A frame: xyz in m; rpy in rad, or rpy_deg. R = Rz(yaw) Ry(pitch) Rx(roll)."""

    xyz: Three = Field(default=[0.0, 0.0, 0.0])
    rpy: Three | None = None
    rpy_deg: Three | None = None

    @model_validator(mode="after")
    def _one_of_them(self) -> FrameTable:
        if self.rpy is not None and self.rpy_deg is not None:
            raise ValueError("rpy and rpy_deg both say how it is turned; leave out one")
        return self

    def pose(self) -> tuple[list[float], list[float]]:
        """(xyz [m], rpy [rad])."""
        turned = np.deg2rad(self.rpy_deg).tolist() if self.rpy_deg is not None else self.rpy
        return self.xyz, turned or [0.0, 0.0, 0.0]

    @property
    def matrix(self) -> Matrix:
        """The pose (4, 4)."""
        xyz, rpy = self.pose()
        return frame_pose("a frame", [*xyz, *rpy])


class ModelTable(Table):
    """What a robot and a part of one have in common: which chain is taken of a model, and its tool."""

    tip: str | Tips | None = None
    base: str | None = None
    locked: dict[str, Number] = Field(default={})
    args: dict[str, str | Number | bool] = Field(default={})
    trust_units: bool = False
    tool: FrameTable | None = None
    tools: Annotated[dict[str, FrameTable], Field(min_length=1, max_length=MOST_PARTS)] | None = None


class PartTable(ModelTable, FrameTable):
    """[[robot.parts]]: a robot, mounted at xyz, rpy on a tip of a part before it, or on the "base"."""

    name: str
    on: str | None = None
    prefix: str = ""


class CoordinatesTable(Table):
    """[robot.coordinates]: coordinates u with limits and no links, for a custom task."""

    names: Names
    lower: Number | Numbers | None = None
    upper: Number | Numbers | None = None
    max_velocity: Number | Numbers | None = None
    units: str | Names = "1"


class RobotTable(ModelTable):
    """[robot]: a catalogue name, or a path (a model or .toml) relative to the job file; or parts, one on the other.

    Or coordinates without links.
    """

    name: str | None = None
    base_pose: FrameTable | None = None
    parts: Annotated[list[PartTable], Field(min_length=1, max_length=MOST_PARTS)] | None = None
    order: Names | None = None
    lower: Limit | None = None
    upper: Limit | None = None
    max_velocity: Limit | None = None
    coordinates: CoordinatesTable | None = None

    @model_validator(mode="after")
    def _something(self) -> RobotTable:
        if self.coordinates is not None:
            if more := sorted(self.model_fields_set - {"name", "coordinates"}):
                raise ValueError(f"{more[0]} stands beside coordinates; they have no links: leave it out")
            return self
        if self.name is None and self.parts is None:
            raise ValueError("it names no robot; give name, or parts")
        chosen = sorted(self.model_fields_set & {"tip", "base", "locked", "args"})
        if self.parts is not None and chosen:
            raise ValueError(f"{chosen[0]} stands beside parts; give it to one of them")
        return self


def robot_of_job(table: RobotTable, file: Path) -> Robot:
    """The robot of a job; a path counts from the job file's folder. Raises: as `load` and `compose`."""

    if table.coordinates is not None:
        return coordinates(**table.coordinates.model_dump(exclude_none=True), name=table.name or "coordinates")

    def loaded(given: Mapping[str, Any]) -> Robot:
        return load(beside(given["name"], file.parent), **{key: v for key, v in given.items() if key != "name"})

    given = table.model_dump(exclude_none=True, exclude_defaults=True)
    limits = {key: given.pop(key) for key in ("lower", "upper", "max_velocity") if key in given}
    robot = assembled(file, given, loaded)
    return with_limits(robot, **limits, trust_units=table.trust_units) if limits else robot
