"""holokin inside other libraries: inverse kinematics with exact derivatives for torch and JAX.

Uses `inverse_kinematics` and `laws`. Read first: `joint_map.py`, `torch.py`.
"""

from . import jax as jax
from . import torch as torch
from .jax import JaxInverse
from .pose_tensors import JointTensors
from .torch import TorchInverse

__all__ = ["JaxInverse", "JointTensors", "TorchInverse"]
