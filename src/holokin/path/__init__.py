"""Paths of the tool and sets of its poses: lines, arcs, splines, what is made of them, and what is read from files.

Uses `symbolic`. Read first: `path.py`, `segments.py`.
"""

from .curves import even_curve
from .editing import blended, passes, with_leads
from .files.pose_table import read_waypoints, read_workspace
from .files.svg_outlines import read_svg
from .lines_and_arcs import arc, circle, line, polyline
from .path import Path, Samples, as_point, corners_of, frame_pose, join
from .path import locate as locate
from .segments import Segment, arc_segment, line_segment
from .splines import path_of, spline
from .surfaces import figure_eight, raster, spiral
from .waypoints import Waypoints

__all__ = [
    "Path",
    "Samples",
    "Segment",
    "Waypoints",
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
    "with_leads",
]
