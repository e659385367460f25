"""Paths of the tool: lines, arcs, splines and what is made of them."""

from .path import Path, Samples, as_point, frame_pose, join
from .segments import Segment
from .shapes import arc, circle, line, polyline
from .splines import path_of, spline
from .waypoints import Waypoints

__all__ = [
    "Path",
    "Samples",
    "Segment",
    "Waypoints",
    "arc",
    "as_point",
    "circle",
    "frame_pose",
    "join",
    "line",
    "path_of",
    "polyline",
    "spline",
]
