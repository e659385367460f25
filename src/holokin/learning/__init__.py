"""holokin inside other libraries: torch and JAX with exact derivatives, datasets and pipelines of LeRobot.

Uses `motion/ik`, `motion/control` and `analysis/audit/logs`. Read first: `joint_map.py`, `retargeting.py`.
"""

from . import jax as jax
from . import torch as torch
from .jax import JaxInverse
from .joint_map import JointTensors
from .lerobot_processor import lerobot_step
from .retargeting import BadFrames, Retargeted, retarget
from .torch import TorchInverse

__all__ = ["BadFrames", "JaxInverse", "JointTensors", "Retargeted", "TorchInverse", "lerobot_step", "retarget"]
