"""`Units`: in what the page shows joints and places. Sessions, jobs and files have radians and metres throughout."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.types import Array, ArrayLike, Value, Vector
from ..robot import Robot


@dataclass(frozen=True)
class Units(Value):
    """Names of the unit of angles and of lengths, and how many of each are in 1 rad and in 1 m."""

    angle: str
    length: str
    per_radian: float
    per_metre: float

    @property
    def name(self) -> str:
        """As it is chosen."""
        return f"{self.angle}, {self.length}"

    def of(self, unit: str) -> tuple[float, str]:
        """(factor, name) with which numbers in a unit are shown; those of neither rad nor m as they are."""
        return {"rad": (self.per_radian, self.angle), "m": (self.per_metre, self.length)}.get(unit, (1.0, unit))

    def scales(self, robot: Robot) -> Vector:
        """The factor (n,) of each joint."""
        return np.array([self.of(c.unit)[0] for c in robot.coordinates])

    def joints(self, robot: Robot) -> str:
        """The unit of what is said of any joint of a robot."""
        return " or ".join(dict.fromkeys(self.of(c.unit)[1] for c in sorted(robot.coordinates, key=_angles_first)))

    def largest(self, robot: Robot, differences: ArrayLike) -> Array:
        """The largest of joint differences (..., n), each in its unit."""
        return np.abs(np.asarray(differences) * self.scales(robot)).max(axis=-1, initial=0.0)


def _angles_first(coordinate: object) -> bool:
    return getattr(coordinate, "unit", "") != "rad"


SI = Units("rad", "m", 1.0, 1.0)

UNITS = {units.name: units for units in (SI, Units("deg", "mm", 180 / np.pi, 1000.0))}
"""By the names by which they are chosen."""

SLOWEST, USUAL, FASTEST = 0.25, 2.0, 8.0
"""Speed of a loop in a page, times its own."""
