"""Which law: the best leaf of a workspace, advice for a robot and its work.

Uses `analysis/coverage` and `analysis/curvature`. Read first: `designed_law.py`, `advice_case.py`.
"""

from .advice_case import advise
from .closest_strategy import ClosestHolonomic, closest_holonomic
from .designed_law import Design, SectionMetrics, design
from .nearby_cusps import DegreeTried, LevelRange, NearbyCusps, level_range
from .objectives import Objective, OwnCost
from .trials import Advice, Law, Part

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
