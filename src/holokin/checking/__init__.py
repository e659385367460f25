"""Checks of motions: limits, singularities, self-collision, the floor, obstacles."""

from .checker import check
from .report import CheckReport, Clearance, Finding, FindingKind, LeftOut, Unseen

__all__ = ["CheckReport", "Clearance", "Finding", "FindingKind", "LeftOut", "Unseen", "check"]
