"""Logs of robots: joint motion in CSV, rosbag2 folders and MCAP; LeRobot datasets.

Uses `motion`. Read first: `log_samples.py`, `log_formats.py`, `dataset_folder.py`.
"""

from ....base.time_columns import TIMES as TIMES
from ....motion.recording import GAP as GAP
from ....motion.recording import Recording as Recording
from .dataset_columns import (
    ACTION,
    STATE,
    JointFeature,
    PoseFeature,
    chosen_episodes,
    has_joints,
    joint_feature,
    pose_feature,
)
from .dataset_folder import Dataset, Episode, is_dataset, read_dataset
from .log_formats import read_recording
from .log_runs import read_runs
from .logged_turns import SLACK, joined_turns

__all__ = [
    "ACTION",
    "GAP",
    "SLACK",
    "STATE",
    "TIMES",
    "Dataset",
    "Episode",
    "JointFeature",
    "PoseFeature",
    "Recording",
    "chosen_episodes",
    "has_joints",
    "is_dataset",
    "joined_turns",
    "joint_feature",
    "pose_feature",
    "read_dataset",
    "read_recording",
    "read_runs",
]
