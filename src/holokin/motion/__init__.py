"""Uses of strategies: following paths, drift and why a path drifts, spread."""

from .follow import follow
from .inverse import InverseKinematics, inverse
from .leaf import leaf_value, settle
from .repeat import Drift, Spread, drift, path_spread
from .servo import Servo, StepStatus, controller, step_function
from .shrink import Cause, Winding, winding

__all__ = [
    "Cause",
    "Drift",
    "InverseKinematics",
    "Servo",
    "Spread",
    "StepStatus",
    "Winding",
    "controller",
    "drift",
    "follow",
    "inverse",
    "leaf_value",
    "path_spread",
    "settle",
    "step_function",
    "winding",
]
