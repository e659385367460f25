"""Which law: how much of a workspace a leaf covers, the best leaf of a workspace, advice for a robot and its work."""

from .covered import Coverage, PoseStatus, Reach
from .covering import coverage, posture_reach
from .designed_law import Design, design
from .objectives import Objective
from .section_metrics import SectionMetrics, section_metrics
from .slicing import Slice, coverage_slices

__all__ = [
    "Coverage",
    "Design",
    "Objective",
    "PoseStatus",
    "Reach",
    "SectionMetrics",
    "Slice",
    "coverage",
    "coverage_slices",
    "design",
    "posture_reach",
    "section_metrics",
]
