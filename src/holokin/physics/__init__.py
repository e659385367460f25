"""Robots on physics, by MuJoCo: servos, weight, noise, pushes. Extra `mujoco`."""

from .plant import Plant, make_plant
from .playing import Push, play
from .run import PhysicalRun

__all__ = ["PhysicalRun", "Plant", "Push", "make_plant", "play"]
