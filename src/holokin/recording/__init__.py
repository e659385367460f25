"""Joint motion that a robot's own controller made, read from CSV, rosbag2 folders and MCAP; tool poses from CSV."""

from .csv_log import TIMES
from .log import GAP, Recording
from .pose_table import read_workspace
from .reading import SLACK, read_recording

__all__ = ["GAP", "SLACK", "TIMES", "Recording", "read_recording", "read_workspace"]
