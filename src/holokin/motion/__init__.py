"""What moves: a strategy along a path, the steps of a controller, the time that a motion takes.

Uses `strategies` and `path`. Read first: `follow_path.py`, `control_step.py`.
"""

from .control_step import Controller, LoopWatch, StepStatus, controller, has_leaf
from .control_step import step_function as step_function
from .drift_and_spread import Cause, Drift, Spread, Winding, drift, path_spread, winding
from .follow_path import approach, follow
from .hand_motion import Followed, HandFollower, hand_follower
from .simulation import simulate
from .timed_trajectory import JointLoad, Limits, Slowdown, TimedTrajectory
from .timing import retime

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
