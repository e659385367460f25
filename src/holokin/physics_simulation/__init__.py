"""Robots on physics, by MuJoCo: servos, weight, noise, pushes. Extra `mujoco`.

Uses `motion`. Read first: `plant.py`, `mujoco_loop.py`.
"""

from .mujoco_loop import Push, cycle_time, play
from .physical_run import PhysicalRun
from .plant import Plant, make_plant

__all__ = ["PhysicalRun", "Plant", "Push", "cycle_time", "make_plant", "play"]
