"""Uses of strategies: following paths, drift and why a path drifts, spread."""

from .control_law import ControlLaw, Step, as_control_law, open_loop
from .control_step import Controller, StepStatus, controller, has_leaf, step_function
from .following import follow
from .inverse_kinematics import InverseKinematics, inverse
from .leaf import leaf_value, move_to_leaf
from .repetition import Drift, Spread, drift, path_spread
from .shrink import Cause, Winding, winding
from .simulation import simulate
from .solutions import InverseStatus, Solutions

__all__ = [
    "Cause",
    "ControlLaw",
    "Controller",
    "Drift",
    "InverseKinematics",
    "InverseStatus",
    "Solutions",
    "Spread",
    "Step",
    "StepStatus",
    "Winding",
    "as_control_law",
    "controller",
    "drift",
    "follow",
    "has_leaf",
    "inverse",
    "leaf_value",
    "move_to_leaf",
    "open_loop",
    "path_spread",
    "simulate",
    "step_function",
    "winding",
]
