"""Which law: how much of a workspace a leaf covers, the best leaf of a workspace, advice for a robot and its work."""

from .covering import Coverage, PoseStatus, Reach, coverage, posture_reach

__all__ = ["Coverage", "PoseStatus", "Reach", "coverage", "posture_reach"]
