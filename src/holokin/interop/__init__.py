"""holokin inside other libraries: inverse kinematics with exact derivatives for torch and JAX.

Uses `inverse_kinematics`. Read first: `joint_map.py`, `torch.py`.
"""

from . import jax as jax
from . import torch as torch
