"""Which law: how much of a workspace a leaf covers, the best leaf of a workspace, advice for a robot and its work.

Uses `motion_analysis`. Read first: `cover_workspace.py`, `designed_law.py`, `compare_laws.py`.
"""

from .advice import Advice, Law, Part
from .closest_strategy import ClosestHolonomic, closest_holonomic
from .compare_laws import advise
from .coordinates import Coordinates as Coordinates
from .coordinates import Polynomial as Polynomial
from .coordinates import chart_of as chart_of
from .cover_workspace import coverage, posture_reach
from .coverage_result import Coverage, PoseStatus, Reach
from .designed_law import Design, design
from .law_metrics import SectionMetrics, section_metrics
from .nearby_cusps import DegreeTried, NearbyCusps
from .objectives import Objective
from .own_cost import OwnCost
from .serving_levels import LevelRange, level_range
from .slices import Slice, coverage_slices
from .starts import fitting_task as fitting_task
from .starts import locked_joints as locked_joints
from .starts import regular_starts as regular_starts
from .tips import choose_tip

__all__ = [
    "Advice",
    "ClosestHolonomic",
    "Coverage",
    "DegreeTried",
    "Design",
    "Law",
    "LevelRange",
    "NearbyCusps",
    "Objective",
    "OwnCost",
    "Part",
    "PoseStatus",
    "Reach",
    "SectionMetrics",
    "Slice",
    "advise",
    "choose_tip",
    "closest_holonomic",
    "coverage",
    "coverage_slices",
    "design",
    "level_range",
    "posture_reach",
    "section_metrics",
]
