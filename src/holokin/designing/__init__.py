"""Which law: how much of a workspace a leaf covers, the best leaf of a workspace, advice for a robot and its work."""

from .covered import Coverage, PoseStatus, Reach
from .covering import coverage, posture_reach
from .designed_law import Design, design
from .nearest_law import NearestLaw, nearest
from .objectives import Objective
from .section_metrics import SectionMetrics, section_metrics
from .slicing import Slice, coverage_slices

__all__ = [
    "Coverage",
    "Design",
    "NearestLaw",
    "Objective",
    "PoseStatus",
    "Reach",
    "SectionMetrics",
    "Slice",
    "coverage",
    "coverage_slices",
    "design",
    "nearest",
    "posture_reach",
    "section_metrics",
]
