"""In what units the page shows joints and places. Sessions, jobs and files have radians and metres throughout."""

from __future__ import annotations

import numpy as np

from ...base.printed_units import SI, PrintedUnits
from ...base.types import Array, ArrayLike, Vector
from ...robot import Robot

UNITS = {f"{units.angle}, {units.length}": units for units in (SI, PrintedUnits("deg", "mm"))}
"""By the names by which they are chosen."""

SLOWEST, USUAL, FASTEST = 0.25, 2.0, 8.0
"""Speed of a loop in a page, times its own."""


def joint_factors(units: PrintedUnits, robot: Robot) -> Vector:
    """By what each joint is multiplied (n,)."""
    return units.factors([c.unit for c in robot.coordinates])


def joint_unit(units: PrintedUnits, robot: Robot) -> str:
    """The unit of what is said of any joint of a robot, that of angles first."""
    kinds = sorted({c.unit for c in robot.coordinates}, key=lambda unit: unit != "rad")
    return " or ".join(map(units.name, kinds))


def largest(units: PrintedUnits, robot: Robot, differences: ArrayLike) -> Array:
    """The largest of joint differences (..., n), each in its unit."""
    return np.abs(np.asarray(differences) * joint_factors(units, robot)).max(axis=-1, initial=0.0)
