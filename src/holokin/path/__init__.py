"""Paths of the tool and sets of its poses: lines, arcs, splines, what is made of them, and what is read from files.

Uses `symbolic`. Read first: `path.py`, `curves.py`.
"""

from .curves import arc, circle, even_curve, figure_eight, line, path_of, polyline, raster, spiral, spline
from .editing import blended, passes, synchronized, through, with_leads
from .files.pose_table import read_waypoints, read_workspace
from .files.svg_outlines import read_svg
from .path import Path, Samples, Segment, Waypoints, arc_segment, as_point, corners_of, frame_pose, join, line_segment
from .path import locate as locate
from .workspaces import Workspace, workspace

__all__ = [
    "Path",
    "Samples",
    "Segment",
    "Waypoints",
    "Workspace",
    "arc",
    "arc_segment",
    "as_point",
    "blended",
    "circle",
    "corners_of",
    "even_curve",
    "figure_eight",
    "frame_pose",
    "join",
    "line",
    "line_segment",
    "passes",
    "path_of",
    "polyline",
    "raster",
    "read_svg",
    "read_waypoints",
    "read_workspace",
    "spiral",
    "spline",
    "synchronized",
    "through",
    "with_leads",
    "workspace",
]
