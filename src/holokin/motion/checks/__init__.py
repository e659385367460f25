"""Checks of motions: limits, singularities, self-collision, the floor, obstacles.

Uses `motion`. Read first: `motion_checks.py`, `clearance.py`.
"""

from .check_report import CheckReport, Clearance, Finding, FindingKind, LeftOut, Unseen
from .motion_checks import Clear as Clear
from .motion_checks import check, clear_postures

__all__ = ["CheckReport", "Clearance", "Finding", "FindingKind", "LeftOut", "Unseen", "check", "clear_postures"]
