"""The tables of a job that say how its motion is timed, and what becomes of it in a controller."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from ...export import ProcessLines, ToolTolerance, Wiring
from ...motion import TimedTrajectory, retime
from ...motion.joint_curve import joint_curve
from ...motion.retiming import GIVE_VELOCITY
from ...motion.trajectory import Trajectory
from ...robot import Robot, speed_limits
from ...strategies.tasks.task import Task
from .table_values import Few, Length, Positive, Table

Limit = Positive | Annotated[list[Positive], Few]
"""One for all joints, or one a joint."""

Speed = Annotated[float, Field(gt=0)]
"""A positive number, or `inf` for no limit."""

Lines = Annotated[list[str], Field(max_length=100)]
"""Lines of a robot program."""

OF_SOME = ("tool", "base", "payload", "zone", "coupled", "pulses", "letters")
"""Keys of [program] that some languages take, each in its own kind."""

HELD_IN = {
    "wiring": ("axes", "external", "signs", "offsets", "offsets_deg"),
    "lines": ("before", "on", "off", "after"),
    "tolerance": ("tolerance", "tool_tolerance", "linear"),
}
"""Arguments of writers that hold several keys of [program]."""

ALL_JOINTS = 2e-3
"""Tolerance of the joints [rad or m] for tasks of several tools."""


class TimingTable(Table):
    """[timing]: limits, profile and step, as of `retime`; every strategy is timed."""

    acceleration: Limit | None = None
    jerk: Limit | None = None
    velocity: Speed | Annotated[list[Speed], Few] | None = None
    profile: Literal["time-optimal", "trapezoidal", "quintic"] = "time-optimal"
    speed: Positive | Literal["fastest"] = 1.0
    endless: bool = False
    dt: Annotated[float, Field(ge=1e-6, le=1.0)] = 1e-3

    @model_validator(mode="after")
    def _complete(self) -> TimingTable:
        if self.acceleration is None and self.profile != "quintic":
            raise ValueError(f"profile = {self.profile!r} needs acceleration; add it")
        return self

    def check(self, robot: Robot) -> None:
        """Raises: ArgumentError: a joint of the robot has no speed limit, and the table gives none."""
        if self.velocity is None:
            speed_limits(robot, GIVE_VELOCITY)

    def timed(self, trajectory: Trajectory, robot: Robot) -> TimedTrajectory:
        """A trajectory, timed as the table says; one that does not repeat is never endless. Raises: as `retime`."""
        speed = None if self.speed == "fastest" else self.speed
        endless = self.endless and joint_curve(trajectory).repeats
        return retime(trajectory, robot, **self.model_dump() | {"speed": speed, "endless": endless})


class ToolToleranceTable(Table):
    """[program.tool_tolerance]: how near the tool stays to the timed motion, as of `ToolTolerance`."""

    mm: Positive = 0.5
    degrees: Positive = 0.5
    percent: Annotated[float, Field(gt=0, lt=100)] = 5.0
    joints: Positive = 0.02


class ProgramTable(Table):
    """[program]: the axes of the controller, how exact a robot program is, and what it does besides moving."""

    axes: Annotated[list[str | Length], Few] | None = None
    external: Annotated[list[str | Length], Few] = Field(default=[])
    signs: dict[str, Literal[1, -1]] = Field(default={})
    offsets: dict[str, Length] = Field(default={})
    offsets_deg: dict[str, Length] = Field(default={})
    coupled: bool = False
    tolerance: Positive | None = None
    tool_tolerance: ToolToleranceTable | None = None
    linear: bool = False
    tool: str | int | Annotated[list[Length], Few] | None = None
    base: str | int | None = None
    payload: str | int | float | None = None
    zone: str | int | float | None = None
    pulses: Annotated[list[Length], Few] | None = None
    letters: Annotated[list[str], Few] | None = None
    before: Lines = Field(default=[])
    on: Lines = Field(default=[])
    off: Lines = Field(default=[])
    after: Lines = Field(default=[])

    @model_validator(mode="after")
    def _one_tolerance(self) -> ProgramTable:
        if self.tolerance is not None and self.tool_tolerance is not None:
            raise ValueError("tolerance and tool_tolerance both say how exact the program is; leave out one")
        if self.tolerance is not None and self.linear:
            raise ValueError("linear moves need a tolerance of the tool; give tool_tolerance in place of tolerance")
        return self

    @property
    def wiring(self) -> Wiring:
        """The axes as a value."""
        axes = None if self.axes is None else tuple(self.axes)
        turned = {joint: float(np.deg2rad(value)) for joint, value in self.offsets_deg.items()}
        return Wiring(axes, tuple(self.external), dict(self.signs), dict(self.offsets) | turned)

    @property
    def given_keys(self) -> tuple[str, ...]:
        """The keys that the job gives."""
        return tuple(key for key in type(self).model_fields if key in self.model_fields_set)

    def lines(self, window: tuple[float, float] | None) -> ProcessLines:
        """The process lines as a value. Raises: ArgumentError: a line that no program can hold."""
        return ProcessLines(tuple(self.before), tuple(self.on), tuple(self.off), tuple(self.after), window)

    def given(self, task: Task, streams: bool) -> dict[str, Any]:
        """Arguments of a writer for a task; `streams`: unless told otherwise it sends every sample."""
        own = {key: getattr(self, key) for key in OF_SOME if getattr(self, key) is not None}
        return own | {"wiring": self.wiring, "tolerance": self._kept(task, streams)}

    def _kept(self, task: Task, streams: bool) -> float | ToolTolerance | None:
        """Of the tool, unless the job gives one of the joints or the task has several tools."""
        kept = self.tool_tolerance
        if self.tolerance is not None or (kept is None and not self.linear and (streams or task.frames > 1)):
            return self.tolerance or (None if streams else ALL_JOINTS)
        kept = kept or ToolToleranceTable()
        rotation = float(np.deg2rad(kept.degrees))
        return ToolTolerance(task, kept.mm / 1e3, rotation, kept.percent / 100, kept.joints, self.linear)
