"""Checks of motions: limits, singularities, self-collision, the floor, obstacles.

Uses `motion`. Read first: `motion_checks.py`, `gaps.py`.
"""

from .check_report import CheckReport, Clearance, Finding, FindingKind, LeftOut, Unseen
from .keeping_clear import Clear as Clear
from .keeping_clear import clear_postures
from .motion_checks import check

__all__ = ["CheckReport", "Clearance", "Finding", "FindingKind", "LeftOut", "Unseen", "check", "clear_postures"]
