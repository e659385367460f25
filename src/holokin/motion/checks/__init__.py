"""Checks of motions: limits, singularities, self-collision, the floor, obstacles.

Uses `motion`. Read first: `scene.py`, `motion_checks.py`.
"""

from .check_report import CheckReport, Clearance, Finding, FindingKind, LeftOut, Unseen
from .motion_checks import Clear as Clear
from .motion_checks import Clearances, PairDistance, check
from .scene import Scene

__all__ = [
    "CheckReport",
    "Clearance",
    "Clearances",
    "Finding",
    "FindingKind",
    "LeftOut",
    "PairDistance",
    "Scene",
    "Unseen",
    "check",
]
