"""Closed-form inverses: which arms have one, and its steps.

Uses the robot's model. Read first: `arm_classes.py`, `six_hinges.py`.
"""

from .arm_classes import ArmClass, NoClass, arm_class
from .closed_inverse import ClosedInverse, Held

__all__ = ["ArmClass", "ClosedInverse", "Held", "NoClass", "arm_class"]
