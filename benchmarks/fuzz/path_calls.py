"""Bad calls of paths, and of maps of sheets: shapes, splines, what is made of paths, and how to get to them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import holokin as hk

from .nouns import kit


def path_calls() -> dict[str, tuple[Callable[..., Any], tuple[Any, ...], dict[str, Any]]]:
    """Name -> (function, arguments, named arguments), all good."""
    k = kit()
    start, line, held, q = k["start"], k["line"], k["held"], k["q"]
    points = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.02]]
    square, patch = hk.polyline(points, closed=True), ([0.4, 0, 0.2], [0.1, 0, 0], [0, 0.1, 0], 0.05)
    return {
        "spline": (hk.spline, (points,), {"times": None, "closed": False, "speed": 0.1, "angular_speed": 0.5}),
        "spline of poses": (hk.spline, (np.tile(k["pose"], (2, 1, 1)),), {"times": [0.0, 1.0]}),
        "path_of": (hk.path.path_of, (lambda t: [0.1 * t, t * t, 0.0], [0.0, 1.0]), {
            "closed": None, "tolerance": 1e-4}),
        "path_of poses": (hk.path.path_of, (points, [0.0, 1.0, 3.0]), {"closed": False}),
        "Waypoints": (hk.path.Waypoints, (points, None, None, "s", ()), {}),
        "figure_eight": (hk.path.figure_eight, ([0.4, 0, 0.2], 0.2, 0.1, [0, 0, 1]), {
            "along": [1, 0, 0], "speed": 0.1}),
        "raster": (hk.path.raster, patch, {
            "surface": lambda u, v: 0.1 * u * v, "tool": "normal", "speed": 0.1, "angular_speed": 0.5}),
        "spiral": (hk.path.spiral, ([0.4, 0, 0.2], 0.05, 0.05, [0, 0, 1]), {
            "inward": False, "clockwise": True, "along": [1, 0, 0], "surface": None, "tool": "start", "speed": 0.1,
            "angular_speed": 0.5}),
        "blended": (hk.path.blended, (square, 0.01), {"keep_start": True}),
        "with_leads": (hk.path.with_leads, (square, 0.01, 0.02), {
            "along": [0, 0, 1], "retract": 0.1, "axis": [0, 0, 1]}),
        "passes": (hk.path.passes, (square, 2), {
            "offset": [0, 0, 0.01], "back_and_forth": True, "lift": [0, 0, 0.1]}),
        "approach": (hk.motion.approach, (held, line.starting_at(start), q + 0.01), {
            "by": "joints", "level": None, "samples": 3, "speed": 0.5}),
        "read_waypoints": (hk.path.read_waypoints, ("no.csv",), {"units": "mm", "angles": "deg", "order": "xyzw"}),
        "read_svg": (hk.path.read_svg, ("no.svg",), {"pixel": 0.001, "tolerance": 1e-5, "speed": 0.1}),
        "Path.in_frame": (square.in_frame, (k["pose"],), {}),
        "sheets": (hk.sheets, (held.task, k["space"]), {
            "strategies": [held], "samples": 8, "seconds": 5.0, "share": 0.5, "q0": [q], "search": False}),
        "read_sheets": (hk.read_sheets, ("no.npz", held.task), {}),
        "write_sheets": (hk.analysis.sheets.write_sheets, (k["sheets"], "sheets.npz"), {}),
    }  # fmt: skip
