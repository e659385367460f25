"""Uses of strategies: following paths, drift, spread."""

from .follow import follow
from .inverse import InverseKinematics, inverse
from .leaf import leaf_value, settle
from .repeat import Drift, Spread, drift, path_spread
from .servo import Servo, StepStatus, controller, step_function

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
    "leaf_value",
    "path_spread",
    "settle",
    "step_function",
]
