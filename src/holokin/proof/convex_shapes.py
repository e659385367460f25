"""Convex shapes as points and a radius: all points within the radius of the hull of a few points.

A capsule, a ball, a box and the hull of points are such shapes. Of others one is taken that holds them. So a plane that
separates two shapes is tested by their points alone, whatever the shapes were.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product

import numpy as np

from ..base.errors import ArgumentError
from ..base.types import Matrix, Value, Vector
from ..robot import Box, Capsule, Cylinder, Ellipsoid, Hull, LinkShape, Mesh, Shape

AROUND = 16
"""Sides of the prism that holds a cylinder: it is 2 % wider at its edges."""

MOST_POINTS = 48
"""Points of a hull or a mesh that are kept; of more, some stand for their neighbours, and the radius grows."""

WIDER = 1 + 1e-9
"""By how much a shape is made larger, for the rounding of its points."""


@dataclass(frozen=True, eq=False)
class Convex(Value):
    """All points within `radius` [m] of the hull of `points` (p, 3) [m], in the frame of joint `joint` (-1: base).

    `holds` (c, 3) are corners of a mesh or hull that it stands for, where it has fewer points than these. `normal` (3,)
    is that of a half space, what is below the plane across it through the point; of all other shapes it is empty.
    """

    link: str
    joint: int
    points: Matrix
    radius: float
    holds: Matrix = field(default_factory=lambda: np.zeros((0, 3)))
    normal: Vector = field(default_factory=lambda: np.zeros(0))

    @property
    def size(self) -> float:
        """How far its farthest point is from the origin of the joint's frame [m]."""
        return float(np.linalg.norm(self.points, axis=1).max()) + self.radius


def convex(shape: LinkShape) -> Convex:
    """A convex shape that holds the shape of a link. Raises: RobotFileError: a mesh that cannot be read."""
    T, corners = shape.placement, _corners_of(shape.shape)
    points, radius = _holding(shape.shape) if corners is None else _fewer(corners)
    held = np.zeros((0, 3)) if corners is None or len(points) == len(corners) else corners
    placed, holds = (those @ T[:3, :3].T + T[:3, 3] for those in (points, held))
    slack = (WIDER - 1) * (1 + np.abs(placed).max())
    return Convex(shape.link, shape.joint, placed, radius * WIDER + slack, holds)


def _corners_of(shape: Shape) -> Matrix | None:
    """The corners of the hull of a mesh or of points; None of other shapes."""
    if isinstance(shape, Mesh):
        return shape.hull.corners
    return shape.corners if isinstance(shape, Hull) else None


def _holding(shape: Shape) -> tuple[Matrix, float]:
    if isinstance(shape, Capsule):
        ends = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]) * shape.length / 2
        return (ends if shape.length else ends[:1]), shape.radius
    if isinstance(shape, Box):
        return _box(shape.sides / 2), 0.0
    if isinstance(shape, Cylinder):
        angles = 2 * np.pi * np.arange(AROUND) / AROUND
        ring = np.column_stack([np.cos(angles), np.sin(angles)]) * shape.radius / np.cos(np.pi / AROUND)
        ends = [np.column_stack([ring, np.full(AROUND, z)]) for z in (shape.length / 2, -shape.length / 2)]
        return np.vstack(ends), 0.0
    if isinstance(shape, Ellipsoid):  # a ball of the least half axis, moved over a box of what the others have more
        least = float(shape.radii.min())
        return _box(shape.radii - least), least
    raise ArgumentError("a shape to prove clear of", type(shape).__name__, "give boxes, capsules, cylinders, or hulls")


def _box(half: Matrix) -> Matrix:
    return np.unique(np.array(list(product(*([-h, h] for h in half)))), axis=0)


def _fewer(corners: Matrix) -> tuple[Matrix, float]:
    """Some of the corners, and the distance from them within which all others are."""
    if len(corners) <= MOST_POINTS:
        return corners, 0.0
    chosen = [int(np.argmax(np.linalg.norm(corners - corners.mean(axis=0), axis=1)))]
    away = np.linalg.norm(corners - corners[chosen[0]], axis=1)
    while len(chosen) < MOST_POINTS:
        chosen.append(int(np.argmax(away)))
        away = np.minimum(away, np.linalg.norm(corners - corners[chosen[-1]], axis=1))
    return corners[chosen], float(away.max())
