"""Pose in, joints out: on a leaf, at the edge of reach, and all postures at a pose.

Uses `strategies` and `path`. Read first: `inverse_function.py`, `leaf.py`.
"""

from .inverse_function import InverseKinematics, Nearest, ik
from .leaf import leaf_value, move_to_leaf
from .postures_of_pose import Postures, all_postures
from .solutions import InverseStatus, Solutions

__all__ = [
    "InverseKinematics",
    "InverseStatus",
    "Nearest",
    "Postures",
    "Solutions",
    "all_postures",
    "ik",
    "leaf_value",
    "move_to_leaf",
]
