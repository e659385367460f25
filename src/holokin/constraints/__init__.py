"""Constraints g(q) that complete a task to r + m = n rows."""

from .arm import arm_angle, height
from .arm_geometry import Arm, find_arm
from .base import Constraint, custom, linear, lock, stack, tilted, total
from .base import as_gain as as_gain
from .base import formulas_of as formulas_of
from .base import nothing_jumps as nothing_jumps
from .costs import Cost, centring_cost, gravity_cost, manipulability_cost, posture_cost, stationary
from .coupled_orientation import coupled

__all__ = [
    "Arm",
    "Constraint",
    "Cost",
    "arm_angle",
    "centring_cost",
    "coupled",
    "custom",
    "find_arm",
    "gravity_cost",
    "height",
    "linear",
    "lock",
    "manipulability_cost",
    "posture_cost",
    "stack",
    "stationary",
    "tilted",
    "total",
]
