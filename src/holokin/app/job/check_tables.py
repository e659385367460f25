"""[checks] of a job file: what is looked at in the motion of every strategy."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any, Literal

from pydantic import Field

from ...motion import TimedTrajectory
from ...motion.checks import CheckReport, check
from ...motion.checks.keeping_clear import Clearances, posture_clearances
from ...motion.trajectory import Trajectory
from ...robot import Box, Capsule, Cylinder, LinkShape, Robot, Shape, obstacle, with_capsules, with_shape
from ...strategies.tasks.task import Task
from .robot_tables import FrameTable
from .table_values import KindTable, Length, Positive, Table, needed_by

MOST_OBSTACLES = 100
"""Shapes round a robot; each is looked at with each link."""

MOST_IGNORED = 1000
"""Pairs of links that may touch."""

NotNegative = Annotated[float, Field(ge=0, le=1e6, allow_inf_nan=False)]
Pair = Annotated[list[str], Field(min_length=2, max_length=2)]


class ObstacleTable(KindTable, FrameTable):
    """[[checks.obstacles]]: a box, ball, capsule or cylinder at xyz, rpy in the frame of the base, or `on` a tip."""

    name: Annotated[str, Field(min_length=1, max_length=100)]
    on: str | None = None
    kind: Literal["box", "sphere", "capsule", "cylinder"]
    sides: Annotated[Annotated[list[Positive], Field(min_length=3, max_length=3)] | None, needed_by("box")] = None
    radius: Annotated[Positive | None, needed_by("sphere", "capsule", "cylinder")] = None
    length: Annotated[Positive | None, needed_by("capsule", "cylinder")] = None

    def standing(self) -> LinkShape:
        """The same as a value, where it stands."""
        return obstacle(self.name, self._solid(), *self.pose())

    def carried(self, robot: Robot) -> Robot:
        """The robot that carries it. Raises: UnknownNameError: no such tip."""
        return with_shape(robot, self.name, self._solid(), *self.pose(), tip=self.on)

    def _solid(self) -> Shape:
        if self.kind == "box":
            return Box(self.sides)  # type: ignore[arg-type]  the shape makes an array of it
        radius, length = self.radius or 0.0, self.length or 0.0
        return Cylinder(radius, length) if self.kind == "cylinder" else Capsule(radius, length)


class ChecksTable(Table):
    """[checks]: what every motion is looked at for, as of `check`."""

    floor: Length | None = None
    clearance: NotNegative = 0.01
    self_collision: bool = True
    limits: bool = True
    margin: NotNegative = 0.0
    rcond: Annotated[float, Field(ge=0, lt=1)] = 0.01
    radius: Positive | dict[str, Positive] | None = None
    ignore: Annotated[list[Pair], Field(max_length=MOST_IGNORED)] = Field(default=[])
    obstacles: Annotated[list[ObstacleTable], Field(max_length=MOST_OBSTACLES)] = Field(default=[])

    def checked(self, motion: Trajectory | TimedTrajectory, robot: Robot, task: Task) -> CheckReport:
        """What is found of a motion. Raises: as `check` and `with_capsules`."""
        shaped = self._shaped(robot)
        own = self.model_dump(exclude={"radius", "ignore", "obstacles"})
        ignore = [(a, b) for a, b in self.ignore]
        return check(motion, shaped, task=task, obstacles=self.standing(), ignore=ignore, **own)

    def clearances(self, robot: Robot) -> Clearances:
        """How far postures keep clear of all this. Raises: as `clear_postures` and `with_capsules`."""
        ignore = [(a, b) for a, b in self.ignore]
        return posture_clearances(
            self._shaped(robot), self.standing(), self.floor, self.clearance, self.self_collision, ignore
        )

    def proven(self, robot: Robot) -> dict[str, Any]:
        """The same as arguments of `certify`. Raises: as `with_capsules`."""
        own = self.model_dump(include={"floor", "clearance", "self_collision", "limits"})
        ignore = [(a, b) for a, b in self.ignore]
        return own | {"clear_of": self.standing(), "ignore": ignore, "shapes_of": self._shaped(robot)}

    def _shaped(self, robot: Robot) -> Robot:
        """The robot with its capsules, and with what it carries."""
        return self._loaded(robot if self.radius is None else with_capsules(robot, self.radius))

    def _loaded(self, robot: Robot) -> Robot:
        for table in self.obstacles:
            robot = robot if table.on is None else table.carried(robot)
        return robot

    def drawn(self, robot: Robot) -> Robot:
        """The robot for pictures: with what it carries, and else as it was. Raises: UnknownNameError: no such tip."""
        count = sum(table.on is not None for table in self.obstacles)
        return replace(robot, shapes=(*robot.shapes, *self._loaded(robot).shapes[-count:])) if count else robot

    def standing(self) -> tuple[LinkShape, ...]:
        """The obstacles that stand still."""
        return tuple(table.standing() for table in self.obstacles if table.on is None)
