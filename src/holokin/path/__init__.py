"""Paths of the tool and sets of its poses: lines, arcs, splines, what is made of them, and what is read from files.

Uses `symbolic`. Read first: `path.py`, `curves.py`.
"""

from .curves import arc, circle, figure_eight, line, path_of, polyline, raster, spiral, spline
from .curves import even_curve as even_curve
from .editing import blended, passes, synchronized, through, with_leads
from .files.path_file import PathFile, read_paths
from .files.pose_table import read_workspace
from .path import Path, Samples, Segment, Waypoints, join
from .path import arc_segment as arc_segment
from .path import as_point as as_point
from .path import frame_pose as frame_pose
from .path import line_segment as line_segment
from .path import locate as locate
from .workspaces import Workspace, workspace

__all__ = [
    "Path",
    "PathFile",
    "Samples",
    "Segment",
    "Waypoints",
    "Workspace",
    "arc",
    "blended",
    "circle",
    "figure_eight",
    "join",
    "line",
    "passes",
    "path_of",
    "polyline",
    "raster",
    "read_paths",
    "read_workspace",
    "spiral",
    "spline",
    "synchronized",
    "through",
    "with_leads",
    "workspace",
]
