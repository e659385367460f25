"""Which law: how much of a workspace a leaf covers, the best leaf of a workspace, advice for a robot and its work."""

from .advice import Advice, Law, Part
from .advising import advise
from .coordinates import Coordinates, Polynomial, chart_of
from .covered import Coverage, PoseStatus, Reach
from .covering import coverage, posture_reach
from .designed_law import Design, design
from .law_metrics import SectionMetrics, section_metrics
from .nearest_law import NearestLaw, nearest
from .objectives import Objective
from .slicing import Slice, coverage_slices
from .starts import fitting_task, locked_joints, regular_starts
from .tips import choose_tip

__all__ = [
    "Advice",
    "Coordinates",
    "Coverage",
    "Design",
    "Law",
    "NearestLaw",
    "Objective",
    "Part",
    "Polynomial",
    "PoseStatus",
    "Reach",
    "SectionMetrics",
    "Slice",
    "advise",
    "chart_of",
    "choose_tip",
    "coverage",
    "coverage_slices",
    "design",
    "fitting_task",
    "locked_joints",
    "nearest",
    "posture_reach",
    "regular_starts",
    "section_metrics",
]
