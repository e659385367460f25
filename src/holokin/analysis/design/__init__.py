"""Which strategy: the best leaf of a workspace, advice for a robot and its work.

Uses `analysis/coverage` and `analysis/curvature`. Read first: `designed_strategy.py`, `advice_case.py`.
"""

from .advice_case import advise
from .designed_strategy import Design, SectionMetrics, design
from .nearby_cusps import LevelRange, NearbyCusps, level_range
from .objectives import Objective
from .trials import Advice, Part, RatedStrategy

__all__ = [
    "Advice",
    "Design",
    "LevelRange",
    "NearbyCusps",
    "Objective",
    "Part",
    "RatedStrategy",
    "SectionMetrics",
    "advise",
    "design",
    "level_range",
]
