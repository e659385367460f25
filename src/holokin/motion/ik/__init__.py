"""Pose in, joints out: on a leaf, on a whole arm, at the edge of reach, and all postures at a pose.

Uses `motion/self_motions`. Read first: `inverse_function.py`, `leaf.py`, `arm_map.py`.
"""

from ..self_motions.pose_curves import (
    ArcEnd,
    EndKind,
    SelfMotion,
    SelfMotionArc,
    self_motion,
)
from .arm_inverse import ArmAnswers, ArmInverse, NearAnswer, SheetPostures
from .arm_map import ArmMap
from .inverse_function import InverseKinematics, Nearest, ik
from .leaf import leaf_value, move_to_leaf
from .postures_of_pose import Postures, all_postures
from .solutions import InverseStatus, Solutions

__all__ = [
    "ArcEnd",
    "ArmAnswers",
    "ArmInverse",
    "ArmMap",
    "EndKind",
    "InverseKinematics",
    "InverseStatus",
    "NearAnswer",
    "Nearest",
    "Postures",
    "SelfMotion",
    "SelfMotionArc",
    "SheetPostures",
    "Solutions",
    "all_postures",
    "ik",
    "leaf_value",
    "move_to_leaf",
    "self_motion",
]
