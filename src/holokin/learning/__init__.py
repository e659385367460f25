"""holokin inside other libraries: torch and JAX with exact derivatives, datasets and pipelines of LeRobot.

Uses `inverse_kinematics`, `control_laws` and `robot_logs`. Read first: `joint_map.py`, `torch.py`, `retargeting.py`.
"""

from . import jax as jax
from . import torch as torch
from .jax import JaxInverse
from .lerobot_processor import lerobot_step
from .pose_tensors import JointTensors
from .retargeting import BadFrames, Retargeted, retarget
from .torch import TorchInverse

__all__ = ["BadFrames", "JaxInverse", "JointTensors", "Retargeted", "TorchInverse", "lerobot_step", "retarget"]
