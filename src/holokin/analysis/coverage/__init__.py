"""How much of a workspace a leaf covers: where to begin, the strategies that fit, many poses reached side by side,
slices.

Uses `motion/checks`. Read first: `cover_workspace.py`, `starts.py`.
"""

from .cover_workspace import Coverage, PoseStatus, Reach, Slice, coverage, coverage_slices, posture_reach
from .pose_coordinates import Coordinates as Coordinates
from .pose_coordinates import Polynomial as Polynomial
from .pose_coordinates import chart_of as chart_of
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
