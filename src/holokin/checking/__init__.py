"""Checks of motions: limits, singularities, self-collision, the floor, obstacles.

Uses `motion` and `recording`. Read first: `motion_checks.py`, `gaps.py`.
"""

from .check_report import CheckReport, Clearance, Finding, FindingKind, LeftOut, Unseen
from .motion_checks import check

__all__ = ["CheckReport", "Clearance", "Finding", "FindingKind", "LeftOut", "Unseen", "check"]
