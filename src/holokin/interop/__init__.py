"""Doors to libraries of robot learning: datasets of LeRobot on one leaf, a step of its pipelines.

Uses `inverse_kinematics` and `recording`. Read first: `retargeting.py`, `lerobot_processor.py`.
"""

from .lerobot_processor import lerobot_step
from .retargeting import BadFrames, Retargeted, retarget

__all__ = ["BadFrames", "Retargeted", "lerobot_step", "retarget"]
