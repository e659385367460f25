"""What files hold: joint motion in CSV, rosbag2 folders and MCAP; poses and waypoints in CSV; outlines in SVG.

Uses `path` and `robot`. Read first: `log.py`, `joint_files.py`.
"""

from .joint_columns import TIMES
from .joint_files import SLACK, read_recording
from .log import GAP, Recording
from .log_runs import read_runs
from .pose_table import read_waypoints, read_workspace
from .svg_outlines import read_svg

__all__ = [
    "GAP",
    "SLACK",
    "TIMES",
    "Recording",
    "read_recording",
    "read_runs",
    "read_svg",
    "read_waypoints",
    "read_workspace",
]
