"""Logs of robots: joint motion in CSV, rosbag2 folders and MCAP; LeRobot datasets.

Uses `motion`. Read first: `log_formats.py`, `datasets.py`.
"""

from ....base.tables import TIMES as TIMES
from ....motion.trajectory import GAP as GAP
from ....motion.trajectory import Recording as Recording
from .datasets import (
    ACTION,
    STATE,
    Dataset,
    Episode,
    JointFeature,
    PoseFeature,
    chosen_episodes,
    has_joints,
    is_dataset,
    joint_feature,
    pose_feature,
    read_dataset,
)
from .log_formats import SLACK, joined_turns, read_recording, read_runs

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
