"""Which law: how much of a workspace a leaf covers, the best leaf of a workspace, advice for a robot and its work."""

from .covered import Coverage, PoseStatus, Reach
from .covering import coverage, posture_reach
from .slicing import Slice, coverage_slices

__all__ = ["Coverage", "PoseStatus", "Reach", "Slice", "coverage", "coverage_slices", "posture_reach"]
