"""How much of a workspace a leaf covers: where to begin, the laws that fit, many poses reached side by side, slices.

Uses `motion_checking`. Read first: `cover_workspace.py`, `coverage_result.py`, `starts.py`.
"""

from .coordinates import Coordinates as Coordinates
from .coordinates import Polynomial as Polynomial
from .coordinates import chart_of as chart_of
from .cover_workspace import coverage, posture_reach
from .coverage_result import Coverage, PoseStatus, Reach
from .slices import Slice, coverage_slices
from .starts import fitting_task as fitting_task
from .starts import locked_joints as locked_joints
from .starts import regular_starts as regular_starts

__all__ = [
    "Coverage",
    "PoseStatus",
    "Reach",
    "Slice",
    "coverage",
    "coverage_slices",
    "posture_reach",
]
