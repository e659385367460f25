"""Which law: the best leaf of a workspace, advice for a robot and its work.

Uses `workspace_coverage` and `motion_analysis`. Read first: `designed_law.py`, `compare_laws.py`.
"""

from .advice import Advice, Law, Part
from .closest_strategy import ClosestHolonomic, closest_holonomic
from .compare_laws import advise
from .designed_law import Design, design
from .law_metrics import SectionMetrics
from .nearby_cusps import DegreeTried, NearbyCusps
from .objectives import Objective
from .own_cost import OwnCost
from .serving_levels import LevelRange, level_range

__all__ = [
    "Advice",
    "ClosestHolonomic",
    "DegreeTried",
    "Design",
    "Law",
    "LevelRange",
    "NearbyCusps",
    "Objective",
    "OwnCost",
    "Part",
    "SectionMetrics",
    "advise",
    "closest_holonomic",
    "design",
    "level_range",
]
