"""Pose in, joints out: on a leaf, on a whole arm, at the edge of reach, and all postures at a pose.

Uses `strategies` and `path`. Read first: `inverse_function.py`, `leaf.py`, `arm_map.py`.
"""

from .arm_inverse import ArmAnswers, ArmInverse, NearAnswer
from .arm_map import ArmMap
from .inverse_function import InverseKinematics, Nearest, ik
from .leaf import leaf_value, move_to_leaf
from .posture_search import Postures, all_postures
from .solutions import InverseStatus, Solutions

__all__ = [
    "ArmAnswers",
    "ArmInverse",
    "ArmMap",
    "InverseKinematics",
    "InverseStatus",
    "NearAnswer",
    "Nearest",
    "Postures",
    "Solutions",
    "all_postures",
    "ik",
    "leaf_value",
    "move_to_leaf",
]
