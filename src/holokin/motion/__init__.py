"""What moves: a strategy along a path, the steps of a controller, the time that a motion takes.

Uses `strategies` and `path`. Read first: `follow_path.py`, `control_step.py`.
"""

from typing import TYPE_CHECKING

from ..base.extra_module import loads
from .control_step import Controller, LoopWatch, StepStatus, controller, has_leaf
from .control_step import step_function as step_function
from .drift_and_spread import Drift, Spread, drift, path_spread
from .follow_path import approach, follow
from .hand_motion import Followed, HandFollower, hand_follower
from .simulation import simulate
from .timed_trajectory import JointLoad, Limits, Slowdown, TimedTrajectory
from .timing import retime
from .trajectory import Status, Trajectory

if TYPE_CHECKING:
    from . import checks as checks
else:
    __getattr__ = loads(__name__, "checks")

__all__ = [
    "Controller",
    "Drift",
    "Followed",
    "HandFollower",
    "JointLoad",
    "Limits",
    "LoopWatch",
    "Slowdown",
    "Spread",
    "Status",
    "StepStatus",
    "TimedTrajectory",
    "Trajectory",
    "approach",
    "controller",
    "drift",
    "follow",
    "hand_follower",
    "has_leaf",
    "path_spread",
    "retime",
    "simulate",
]
