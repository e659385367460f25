"""Uses of strategies: following paths, drift and why a path drifts, spread."""

from ..analysis.obstructions import Directions, Obstruction, Witness, obstruction
from ..inverse_kinematics.inverse_function import InverseKinematics, inverse
from ..inverse_kinematics.leaf import leaf_value, move_to_leaf
from ..inverse_kinematics.nearest_pose import Nearest
from ..inverse_kinematics.posture_search import Postures, all_postures
from ..inverse_kinematics.solutions import InverseStatus, Solutions
from .approach_path import approach
from .control_law import ControlLaw, Step, as_control_law, open_loop
from .control_step import Controller, StepStatus, controller
from .drift_cause import Cause, Winding, winding
from .follow_path import follow
from .hand_motion import Followed, HandFollower, hand_follower
from .loop_watch import LoopWatch
from .repetition import Drift, Spread, drift, path_spread
from .retiming import retime
from .simulation import simulate
from .step_expression import has_leaf
from .step_expression import step_function as step_function
from .timed_trajectory import JointLoad, Limits, Slowdown, TimedTrajectory

__all__ = [
    "Cause",
    "ControlLaw",
    "Controller",
    "Directions",
    "Drift",
    "Followed",
    "HandFollower",
    "InverseKinematics",
    "InverseStatus",
    "JointLoad",
    "Limits",
    "LoopWatch",
    "Nearest",
    "Obstruction",
    "Postures",
    "Slowdown",
    "Solutions",
    "Spread",
    "Step",
    "StepStatus",
    "TimedTrajectory",
    "Winding",
    "Witness",
    "all_postures",
    "approach",
    "as_control_law",
    "controller",
    "drift",
    "follow",
    "hand_follower",
    "has_leaf",
    "inverse",
    "leaf_value",
    "move_to_leaf",
    "obstruction",
    "open_loop",
    "path_spread",
    "retime",
    "simulate",
    "winding",
]
