"""What moves: a strategy along a path, the steps of a controller, the time that a motion takes.

Uses `control_laws`, `path` and `inverse_kinematics`. Read first: `follow_path.py`, `control_step.py`, `retiming.py`.
"""

from .approach_path import approach
from .control_step import Controller, controller
from .drift_and_spread import Drift, Spread, drift, path_spread
from .drift_cause import Cause, Winding, winding
from .follow_path import follow
from .hand_motion import Followed, HandFollower, hand_follower
from .loop_watch import LoopWatch
from .retiming import retime
from .simulation import simulate
from .step_expression import StepStatus, has_leaf
from .step_expression import step_function as step_function
from .timed_trajectory import JointLoad, Limits, Slowdown, TimedTrajectory

__all__ = [
    "Cause",
    "Controller",
    "Drift",
    "Followed",
    "HandFollower",
    "JointLoad",
    "Limits",
    "LoopWatch",
    "Slowdown",
    "Spread",
    "StepStatus",
    "TimedTrajectory",
    "Winding",
    "approach",
    "controller",
    "drift",
    "follow",
    "hand_follower",
    "has_leaf",
    "path_spread",
    "retime",
    "simulate",
    "winding",
]
