"""The tables of a job that say how its motion is timed, and what becomes of it in a controller."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from ..export import Wiring
from ..motion import TimedTrajectory, retime
from ..motion.joint_curve import joint_curve
from ..motion.trajectory import Trajectory
from ..robot import Robot
from .table_values import Few, Length, Positive, Table

Limit = Positive | Annotated[list[Positive], Few]
"""One for all joints, or one a joint."""


class TimingTable(Table):
    """[timing]: limits, profile and step, as of `retime`; every strategy is timed."""

    acceleration: Limit | None = None
    jerk: Limit | None = None
    velocity: Limit | None = None
    profile: Literal["time-optimal", "trapezoidal", "quintic"] = "time-optimal"
    speed: Positive | Literal["fastest"] = 1.0
    endless: bool = False
    dt: Annotated[float, Field(ge=1e-6, le=1.0)] = 1e-3

    @model_validator(mode="after")
    def _complete(self) -> TimingTable:
        if self.acceleration is None and self.profile != "quintic":
            raise ValueError(f"profile = {self.profile!r} needs acceleration; add it")
        return self

    def timed(self, trajectory: Trajectory, robot: Robot) -> TimedTrajectory:
        """A trajectory, timed as the table says; one that does not repeat is never endless. Raises: as `retime`."""
        speed = None if self.speed == "fastest" else self.speed
        endless = self.endless and joint_curve(trajectory).repeats
        return retime(trajectory, robot, **self.model_dump() | {"speed": speed, "endless": endless})


class ProgramTable(Table):
    """[program]: which axes of the controller the joints move, and how exact a robot program is."""

    axes: Annotated[list[str | Length], Few] | None = None
    external: Annotated[list[str | Length], Few] = Field(default=[])
    signs: dict[str, Literal[1, -1]] = Field(default={})
    offsets: dict[str, Length] = Field(default={})
    coupled: bool = False
    tolerance: Positive = 2e-3

    @property
    def wiring(self) -> Wiring:
        """The same as a value."""
        axes = None if self.axes is None else tuple(self.axes)
        return Wiring(axes, tuple(self.external), dict(self.signs), dict(self.offsets))
