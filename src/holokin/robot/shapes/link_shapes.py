"""The shapes of links: boxes, capsules, cylinders, ellipsoids, convex hulls of points and of meshes.

Their kinds are asked again where distances are measured (`motion/checks/clearance.py`) and proven
(`proof/clear_cells.py`), where jobs name them (`app/job/tables.py`), and where they are drawn
(`app/report/robot_view.py`, `app/studio/standalone_page.py`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any, final

import numpy as np

from ...base.errors import ArgumentError, MissingExtraError, RobotFileError, brief
from ...base.extra_module import extra_module
from ...base.types import Array, ArrayLike, Indices, Matrix, Value, Vector, finite, not_negative, positive

ROUGH = 1e-3
"""By how much of its size or area a mesh that is called convex may differ from its convex hull."""

FLAT = 1e-4
"""Thickness [m] that a hull gets at least: one of points in a plane has none, and no hull."""


def coal_package() -> Any:
    """The module coal. Raises: MissingExtraError."""
    return extra_module("coal", "collision")


class Shape(Value, ABC):
    """A solid in a frame of its own. Abstract: the kinds below are final."""

    @property
    @abstractmethod
    def ball(self) -> tuple[Vector, float]:
        """Center (3,) [m] and radius [m] of a ball that holds the shape."""

    def support(self, directions: ArrayLike) -> Vector:
        """The largest d . x over the points x of the shape (k,), for directions d (k, 3) of length 1.

        Raises: ShapeError, NotFiniteError, ArgumentError: no directions. RobotFileError: a mesh that cannot be read.
        """
        given = finite("the directions", directions, ("k", 3))
        return np.einsum("ki,ki->k", given, self._farthest(given))

    @abstractmethod
    def _farthest(self, directions: Matrix) -> Matrix:
        """A point of the shape (k, 3) that is farthest along each of some directions (k, 3) of length 1."""

    @cached_property
    def solid(self) -> Any:
        """The same as a shape of coal. Raises: MissingExtraError; RobotFileError for a mesh that cannot be read."""
        return self._made_by(coal_package())

    @abstractmethod
    def _made_by(self, coal: Any) -> Any:
        """The same as a shape of the module coal."""

    @property
    def surface(self) -> Any:
        """The triangles of a mesh, as a shape of coal, where `solid` is but their hull; None for all other shapes."""
        return None

    @property
    def fault(self) -> str:
        """Why the shape cannot be looked at, such as a mesh whose file is missing; empty where it can."""
        return ""


@final
@dataclass(frozen=True, eq=False)
class Box(Shape):
    """A box about the origin, sides (3,) [m] along its axes."""

    sides: Vector

    def __post_init__(self) -> None:
        object.__setattr__(self, "sides", _positive_three("the side of a box", self.sides))
        super().__post_init__()

    @property
    def ball(self) -> tuple[Vector, float]:
        """About the origin."""
        return np.zeros(3), float(np.linalg.norm(self.sides) / 2)

    def _farthest(self, directions: Matrix) -> Matrix:
        return np.where(directions < 0, -self.sides, self.sides) / 2

    def _made_by(self, coal: Any) -> Any:
        return coal.Box(*map(float, self.sides))


@final
@dataclass(frozen=True, eq=False)
class Capsule(Shape):
    """All points within `radius` [m] of a segment of `length` [m] along z about the origin; a ball with length 0."""

    radius: float
    length: float = 0.0

    def __post_init__(self) -> None:
        positive("the radius of a capsule", self.radius)
        not_negative("the length of a capsule", self.length)

    @property
    def ball(self) -> tuple[Vector, float]:
        """About the origin."""
        return np.zeros(3), self.radius + self.length / 2

    def _farthest(self, directions: Matrix) -> Matrix:
        """The radius from an end of the segment."""
        return self.radius * directions + _along_z(directions, self.length)

    def _made_by(self, coal: Any) -> Any:
        return coal.Capsule(float(self.radius), float(self.length))


@final
@dataclass(frozen=True, eq=False)
class Cylinder(Shape):
    """A cylinder of `radius` and `length` [m], along z about the origin."""

    radius: float
    length: float

    def __post_init__(self) -> None:
        positive("the radius of a cylinder", self.radius)
        positive("the length of a cylinder", self.length)

    @property
    def ball(self) -> tuple[Vector, float]:
        """About the origin."""
        return np.zeros(3), float(np.hypot(self.radius, self.length / 2))

    def _farthest(self, directions: Matrix) -> Matrix:
        """On the rim of an end; in its middle for directions along z."""
        out = directions * [1.0, 1.0, 0.0]
        size = np.linalg.norm(out, axis=1, keepdims=True)
        return self.radius * out / np.where(size > 0, size, 1.0) + _along_z(directions, self.length)

    def _made_by(self, coal: Any) -> Any:
        return coal.Cylinder(float(self.radius), float(self.length))


@final
@dataclass(frozen=True, eq=False)
class Ellipsoid(Shape):
    """An ellipsoid about the origin with half axes `radii` (3,) [m]."""

    radii: Vector

    def __post_init__(self) -> None:
        object.__setattr__(self, "radii", _positive_three("the radius of an ellipsoid", self.radii))
        super().__post_init__()

    @property
    def ball(self) -> tuple[Vector, float]:
        """About the origin."""
        return np.zeros(3), float(self.radii.max())

    def _farthest(self, directions: Matrix) -> Matrix:
        """(radius_i^2 d_i) / |(radius_i d_i)|."""
        return directions * self.radii**2 / np.linalg.norm(directions * self.radii, axis=1, keepdims=True)

    def _made_by(self, coal: Any) -> Any:
        return coal.Ellipsoid(*map(float, self.radii))


@final
@dataclass(frozen=True, eq=False)
class Hull(Shape):
    """The convex hull of points (k, 3) [m]."""

    points: Matrix

    def __post_init__(self) -> None:
        points = finite("the points of a hull", self.points, ("k", 3))
        if not len(points):
            raise ArgumentError("the points of a hull", [], "give at least one")
        object.__setattr__(self, "points", points)
        super().__post_init__()

    @cached_property
    def _outside(self) -> tuple[Matrix, Indices]:
        """Corners (c, 3) and the triangles (f, 3) between them; of points in a plane those of the box round them."""
        from scipy.spatial import ConvexHull, QhullError

        points = self.points
        try:
            hull = ConvexHull(points)
        except QhullError:
            low, high = points.min(axis=0), points.max(axis=0)
            grown = np.maximum(FLAT - (high - low), 0.0) / 2
            points = np.array(list(product(*np.array([low - grown, high + grown]).T)))
            hull = ConvexHull(points)
        place = np.full(len(points), -1)
        place[hull.vertices] = np.arange(len(hull.vertices))
        return points[hull.vertices], place[hull.simplices]

    @property
    def corners(self) -> Matrix:
        """The points that are corners of the hull (c, 3)."""
        return self._outside[0]

    @property
    def ball(self) -> tuple[Vector, float]:
        """About the middle of the box round the points."""
        return self._ball

    @cached_property
    def _ball(self) -> tuple[Vector, float]:
        center = (self.corners.min(axis=0) + self.corners.max(axis=0)) / 2
        return center, float(np.linalg.norm(self.corners - center, axis=1).max())

    def _farthest(self, directions: Matrix) -> Matrix:
        return self.corners[(directions @ self.corners.T).argmax(axis=1)]

    def _made_by(self, coal: Any) -> Any:
        points, faces = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
        for corner in self.corners:
            points.append(corner)
        for face in self._outside[1].tolist():
            faces.append(coal.Triangle(*face))
        return coal.Convex(points, faces)


@final
@dataclass(frozen=True, eq=False)
class Mesh(Shape):
    """A mesh in a file, times `scale` (3,), which is read when it is needed; as a solid it is its convex hull."""

    file: Path
    scale: Vector = field(default_factory=lambda: np.ones(3))

    @cached_property
    def triangles(self) -> tuple[Matrix, Indices]:
        """Points (k, 3) [m] and triangles (f, 3). Raises: RobotFileError: no such file, or one that cannot be read."""
        cure = "put it where the robot's file says, or check without it"
        if not self.file.is_file():
            raise RobotFileError(self.file, f"there is no such mesh{self._similar_name()}", cure)
        try:
            trimesh = extra_module("trimesh", "meshes")
        except MissingExtraError:
            fact = "is a mesh, which is not read without trimesh (pip install 'holokin[meshes]')"
            raise RobotFileError(self.file, fact, "install it, or check without this mesh") from None
        try:
            mesh = trimesh.load(self.file, force="mesh")
            points = finite("the points of a mesh", np.asarray(mesh.vertices) * self.scale)
            faces = self.outward(np.asarray(mesh.faces, dtype=np.int64))
        except Exception as problem:  # its readers raise what they like, of packages that are missing, too
            raise RobotFileError(self.file, f"cannot be read ({brief(problem, 100)})", cure) from problem
        if not len(faces):
            raise RobotFileError(self.file, "has no triangles", cure)
        return points, faces

    def _similar_name(self) -> str:
        """A file beside the missing one whose name differs in capital letters alone."""
        folder, name = self.file.parent, self.file.name.lower()
        alike = [entry.name for entry in folder.iterdir() if entry.name.lower() == name] if folder.is_dir() else []
        return f" (but one named {alike[0]})" if alike else ""

    def outward(self, faces: Indices) -> Indices:
        """Triangles (f, 3) of the file as they go round seen from outside: a mirrored mesh turns them round."""
        return np.ascontiguousarray(faces[:, ::-1]) if np.prod(self.scale) < 0 else faces

    @cached_property
    def hull(self) -> Hull:
        """The convex hull. Raises: RobotFileError."""
        return Hull(self.triangles[0])

    @cached_property
    def convex(self) -> bool:
        """Whether it is closed and fills its convex hull, but for `ROUGH` of its size. Raises: RobotFileError."""
        from scipy.spatial import ConvexHull

        points, faces = self.triangles
        hull = ConvexHull(self.hull.corners)
        samples = np.vstack([points, points[faces].mean(axis=1)])
        depth = [
            (part @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1)
            for part in np.split(samples, range(1024, len(samples), 1024))
        ]
        a, b, c = (points[faces[:, k]] for k in range(3))
        area = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) / 2
        deepest = -min(float(part.min()) for part in depth)
        return deepest <= ROUGH * self.ball[1] and area >= (1 - ROUGH) * float(hull.area)

    @property
    def surface(self) -> Any:
        """A coal.BVHModelOBBRSS."""
        return self._surface

    @cached_property
    def _surface(self) -> Any:
        points, faces = self.triangles
        model = coal_package().BVHModelOBBRSS()
        model.beginModel(len(faces), len(points))
        model.addVertices(points)
        model.addTriangles(faces)
        model.endModel()
        model.computeLocalAABB()
        return model

    @property
    def ball(self) -> tuple[Vector, float]:
        """Of the hull."""
        return self.hull.ball

    def _farthest(self, directions: Matrix) -> Matrix:
        return self.hull._farthest(directions)

    def _made_by(self, coal: Any) -> Any:
        return self.hull._made_by(coal)

    @property
    def fault(self) -> str:
        """What is wrong with the file; empty where it can be read."""
        try:
            _ = self.hull
            return ""
        except RobotFileError as problem:
            return f"{problem.fact}: {problem.path}"


@final
@dataclass(frozen=True, eq=False)
class Unread(Shape):
    """What a file names and nobody can look at: a height field, a broken element, a `plane` z = 0 of its frame."""

    source: str
    reason: str
    plane: bool = False

    @property
    def ball(self) -> tuple[Vector, float]:
        """Raises: RobotFileError."""
        raise self._problem()

    def _farthest(self, directions: Matrix) -> Matrix:
        raise self._problem()

    def _made_by(self, coal: Any) -> Any:
        raise self._problem()

    @property
    def fault(self) -> str:
        """The reason."""
        return self.reason

    def _problem(self) -> RobotFileError:
        return RobotFileError(self.source, self.reason, "check without it")


@dataclass(frozen=True, eq=False)
class LinkShape(Value):
    """A shape of a link, at `placement` (4, 4) on the moving side of a joint (by its index; joint -1: the base).

    `obstacle`: it stands around the robot and is no part of it, so that even the link next to the base may hit it.
    `carried`: it is of a tool that the link carries, beside the link's own shapes.
    `parent`: the nearest link with shapes that its link hangs on in the robot's tree; "" where there is none, None
    where nothing but the joints is known: then it is the link on the nearest joint before that has one, and only one.
    """

    link: str
    joint: int
    placement: Matrix
    shape: Shape
    obstacle: bool = False
    carried: bool = False
    parent: str | None = None


def lowest(shape: Shape, positions: Matrix, rotations: Array) -> Matrix:
    """The lowest point (k, 3) of a shape whose frame is at positions (k, 3), rotations (k, 3, 3)."""
    return positions + np.einsum("kij,kj->ki", rotations, shape._farthest(-rotations[:, 2, :]))


def _positive_three(what: str, sizes: ArrayLike) -> Vector:
    """Sizes (3,) [m]. Raises: ArgumentError, ShapeError, NotFiniteError."""
    given = finite(what, sizes, (3,))
    for size in given:
        positive(what, float(size))
    return given


def _along_z(directions: Matrix, length: float) -> Matrix:
    """The end (k, 3) of a segment of a length along z about the origin that is farther along directions (k, 3)."""
    out = np.zeros_like(directions)
    out[:, 2] = np.where(directions[:, 2] < 0, -length, length) / 2
    return out
