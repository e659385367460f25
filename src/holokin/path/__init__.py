"""Paths of the tool: lines, arcs, splines and what is made of them."""

from .path import Path, Samples, as_point, frame_pose, join
from .segments import Segment
from .shapes import arc, circle, line, polyline

__all__ = ["Path", "Samples", "Segment", "arc", "as_point", "circle", "frame_pose", "join", "line", "polyline"]
