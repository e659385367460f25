"""Which strategy: the best leaf of a workspace, advice for a robot and its work.

Uses `analysis/coverage` and `analysis/curvature`. Read first: `designed_strategy.py`, `advice_case.py`.
"""

from .advice_case import advise
from .closest_strategy import ClosestHolonomic, closest_holonomic
from .designed_strategy import Design, SectionMetrics, design
from .nearby_cusps import DegreeTried, LevelRange, NearbyCusps, level_range
from .objectives import Objective, OwnCost
from .trials import Advice, Part, RatedStrategy

__all__ = [
    "Advice",
    "ClosestHolonomic",
    "DegreeTried",
    "Design",
    "LevelRange",
    "NearbyCusps",
    "Objective",
    "OwnCost",
    "Part",
    "RatedStrategy",
    "SectionMetrics",
    "advise",
    "closest_holonomic",
    "design",
    "level_range",
]
