"""Which law: how much of a workspace a leaf covers, the best leaf of a workspace, advice for a robot and its work."""

from .covering import Coverage, PoseStatus, Reach, coverage, posture_reach
from .designed_law import Design, design
from .objectives import Objective
from .section_metrics import SectionMetrics, section_metrics

__all__ = [
    "Coverage",
    "Design",
    "Objective",
    "PoseStatus",
    "Reach",
    "SectionMetrics",
    "coverage",
    "design",
    "posture_reach",
    "section_metrics",
]
