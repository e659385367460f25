"""Constraints g(q) that complete a task to r + m = n rows.

Uses `tasks/`. Read first: `constraint.py`, `arm.py`. CONTRIBUTING.md says what else a new one touches.
"""

from .arm import Arm, arm_angle, coupled, find_arm, height
from .constraint import Constraint, custom, linear, lock, stack, tilted, total
from .constraint import as_gain as as_gain
from .constraint import formulas_of as formulas_of
from .constraint import nothing_jumps as nothing_jumps
from .costs import Cost, centring_cost, gravity_cost, manipulability_cost, posture_cost, stationary

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
