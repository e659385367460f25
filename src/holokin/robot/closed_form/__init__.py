"""Closed-form inverses: which arms have one, and its steps.

Uses the robot's model. Read first: `arm_classes.py`, `six_hinges.py`.
"""

from .arm_classes import ArmClass, NoClass, arm_class
from .closed_inverse import ClosedInverse, Held
from .general_inverse import GeneralInverse, GeneralPostures, general_inverse

__all__ = [
    "ArmClass",
    "ClosedInverse",
    "GeneralInverse",
    "GeneralPostures",
    "Held",
    "NoClass",
    "arm_class",
    "general_inverse",
]
