"""[physics] of a job file: how `holokin simulate` runs it."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from ..path import Path
from ..physics_simulation import Push, cycle_time
from ..robot import DENSITY, Robot, weighed
from .table_values import Length, Positive, Table, filled

MOST_CYCLES = 1000
"""Cycles on physics: a minute of computing each hundred."""


class PhysicsTable(Table):
    """[physics]: how `holokin simulate` runs the job, as of `play`."""

    servo: Literal["position", "velocity", "torque"] = "position"
    frequency: Positive = 25.0
    compensated: bool | None = None
    feedback: Literal["commanded", "measured"] | None = None
    cycles: Annotated[int, Field(ge=1, le=MOST_CYCLES)] = 20
    noise: Annotated[float, Field(ge=0, le=1.0)] = 5e-5
    push: Annotated[list[Length], Field(min_length=3, max_length=3)] | None = None
    push_at: Annotated[float, Field(ge=0, le=MOST_CYCLES)] | None = None
    push_duration: Positive = 0.2
    push_joint: str | None = None
    gain: Positive = 10.0
    density: Positive = DENSITY
    dt: Annotated[float, Field(ge=1e-5, le=0.02)] = 1e-3

    def force(self, robot: Robot, path: Path, cycles: int) -> Push | None:
        """The push; by default in the middle cycle, as strong as the arm's weight. Raises: ArgumentError."""
        weight = 9.81 * sum(body.mass for body in weighed(robot, self.density).bodies if body.joint >= 0)
        force = [0.0, weight, 0.0] if self.push is None else self.push
        if not any(force):
            return None
        at = cycles // 2 + 0.4 if self.push_at is None else self.push_at
        return Push(force, at * cycle_time(path), self.push_duration, self.push_joint)  # type: ignore[arg-type]

    def changed(self, changes: dict[str, Any]) -> PhysicsTable:
        """With other values of some keys. Raises: ArgumentError: one makes no sense."""
        return filled(PhysicsTable, "physics", self.model_dump(exclude_unset=True) | changes)
