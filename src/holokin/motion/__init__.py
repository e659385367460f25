"""What moves: a strategy along a path, the steps of a controller, the time that a motion takes.

Uses strategies, paths and inverse kinematics. Read first: `follow_path.py`, `control_step.py`, `retiming.py`.
"""

from .approach_path import approach
from .control_law import ControlLaw, Step, as_control_law, open_loop
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
    "ControlLaw",
    "Controller",
    "Drift",
    "Followed",
    "HandFollower",
    "JointLoad",
    "Limits",
    "LoopWatch",
    "Slowdown",
    "Spread",
    "Step",
    "StepStatus",
    "TimedTrajectory",
    "Winding",
    "approach",
    "as_control_law",
    "controller",
    "drift",
    "follow",
    "hand_follower",
    "has_leaf",
    "open_loop",
    "path_spread",
    "retime",
    "simulate",
    "winding",
]
