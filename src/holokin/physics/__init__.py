"""Robots on physics, by MuJoCo: servos, weight, noise, pushes. Extra `mujoco`."""

from .plant import Plant, make_plant
from .playing import Push, cycle_time, play
from .run import PhysicalRun

__all__ = ["PhysicalRun", "Plant", "Push", "cycle_time", "make_plant", "play"]
