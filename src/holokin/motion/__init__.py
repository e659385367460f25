"""Uses of strategies: following paths, drift, spread."""

from .follow import follow
from .inverse import InverseKinematics, inverse
from .leaf import settle
from .repeat import Drift, Spread, drift, path_spread
from .servo import Servo, StepStatus, controller

__all__ = [
    "Drift",
    "InverseKinematics",
    "Servo",
    "Spread",
    "StepStatus",
    "controller",
    "drift",
    "follow",
    "inverse",
    "path_spread",
    "settle",
]
