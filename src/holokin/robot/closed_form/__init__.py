"""Inverses of six hinges: which arms have a closed form, its steps, and the eigenvalues that serve all others.

Uses the robot's model. Read first: `arm_classes.py`, `six_hinges.py`, `loop_roots.py`.
"""

from .arm_classes import ArmClass, NoClass, arm_class
from .closed_inverse import ClosedInverse, Held
from .general_inverses import GeneralInverse, GeneralPostures, general_inverse

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
