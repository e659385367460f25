"""Loops of a survey: what is left to chance is drawn, and each becomes a [path] table as of a job."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.types import Matrix, Vector
from ...symbolic.rotations import frame_about
from .survey_tables import LoopTable

PLANES = {"xy": (0.0, 0.0, 1.0), "yz": (1.0, 0.0, 0.0), "xz": (0.0, -1.0, 0.0)}
"""The normal of a plane."""

LINES = 4
"""Lines of a raster."""

WAVES, POINTS = 3, 12
"""Harmonics of a smooth random curve, and points of the spline through it."""

DIGITS = 12
"""Digits of what is drawn, so that a job file that repeats a case can be read."""


def drawn(table: LoopTable, length: float, planar: bool, rng: np.random.Generator) -> dict[str, Any]:
    """A [path] table of a loop that begins at the tool.

    Args:
        length: of the arm [m], of which `share` is one. planar: the loop lies in the plane of the robot.
    """
    size = _number(table.size, rng) if table.size is not None else _number(table.share, rng) * length
    speed = _number(table.speed, rng)
    normal, turned = _normal(table, planar, rng), rng.uniform(0, 2 * np.pi)
    clockwise = table.direction == "clockwise" or (table.direction == "random" and bool(rng.integers(2)))
    # not by rotations of a library, whose last digits may differ from version to version
    a, b = np.asarray(frame_about(normal))[:, :2].T
    u, v = np.cos(turned) * a + np.sin(turned) * b, np.cos(turned) * b - np.sin(turned) * a
    if clockwise:
        v = -v
    path: dict[str, Any] = {"relative": True, "speed": _short(speed)}
    if table.kind == "circle":
        return path | {
            "kind": "circle", "center": _shorts(size / 2 * u), "normal": _shorts(normal), "clockwise": clockwise,
        }  # fmt: skip
    if table.kind == "smooth":
        return path | {"kind": "spline", "points": _points(_smooth(size, rng), u, v), "closed": True}
    corners = {
        "square": lambda: size / 2**0.5 * np.array([[0, 0], [1, 0], [1, 1], [0, 1]]),
        "raster": lambda: _raster(size),
        "figure-eight": lambda: _eight(size),
    }[table.kind]()
    kind = "spline" if table.kind == "figure-eight" else "polyline"
    return path | {"kind": kind, "points": _points(corners, u, v), "closed": True}


def _number(value: float | tuple[float, float] | None, rng: np.random.Generator) -> float:
    low, high = value if isinstance(value, tuple) else (value or 0.0, value or 0.0)
    return float(rng.uniform(low, high))


def _normal(table: LoopTable, planar: bool, rng: np.random.Generator) -> Vector:
    towards = rng.normal(size=3)
    if planar:
        return np.array(PLANES["xy"])
    if table.plane == "random":
        return towards / np.linalg.norm(towards)
    given = np.array(PLANES[table.plane] if isinstance(table.plane, str) else table.plane)
    return given / np.linalg.norm(given)


def _raster(size: float) -> Matrix:
    """Lines there and back, and a straight path home beside them."""
    side = size / 2**0.5
    rows = []
    for k in range(LINES):
        y = side * k / (LINES - 1)
        ends = [[0.05 * side, y], [side, y]]
        rows += ends if k % 2 == 0 else ends[::-1]
    rows[0] = [0.0, 0.0]
    return np.array([*rows, [0.0, side]])


def _eight(size: float) -> Matrix:
    """Points of a figure of eight that begins at its crossing."""
    t = 2 * np.pi * np.arange(16) / 16
    return size / 2 * np.column_stack([np.sin(t), 0.5 * np.sin(2 * t)])


def _smooth(size: float, rng: np.random.Generator) -> Matrix:
    """Points of a closed curve of a few random harmonics, whose largest extent is about `size`."""
    t = 2 * np.pi * np.arange(POINTS) / POINTS
    curve = np.zeros((POINTS, 2))
    for k in range(1, WAVES + 1):
        a, b = rng.normal(size=(2, 2)) / k**2
        curve += np.outer(np.cos(k * t), a) + np.outer(np.sin(k * t), b)
    apart = np.linalg.norm(curve[:, None] - curve[None], axis=2).max()
    return size / apart * (curve - curve[0])


def _points(flat: Matrix, u: Vector, v: Vector) -> list[list[float]]:
    return [_shorts(x * u + y * v) for x, y in flat - flat[0]]


def _short(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _shorts(values: Vector) -> list[float]:
    return [_short(value) + 0.0 if abs(value) > 1e-12 else 0.0 for value in values]
