"""`Workspace`: a set of tool poses: a solid of positions times tool directions times turns, or given poses."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError, ShapeError
from ..base.poses import PoseLike, pose_from, tool_poses
from ..base.types import (
    Array,
    ArrayLike,
    Flags,
    Matrix,
    Value,
    Vector,
    check_rotation,
    finite,
    frozen,
    not_negative,
    numbers,
    positive,
    whole,
)
from .path import as_point

TOOL_DOWN = frozen(np.diag([1.0, -1.0, -1.0]))
"""The rotation of a tool whose z axis is -z of the base and whose x axis is x of the base."""


METRES = "give a positive radius in metres"


SIZES = {
    "box": ("the center (3,)", "the half sides (3,)"),
    "cylinder": ("the center (3,)", "the radius", "half the height"),
    "sphere": ("the center (3,)", "the radius"),
}
"""What a solid is given by."""

EXAMPLES = {
    "box": "([0.5, 0, 0.3], [0.2, 0.2, 0.1])",
    "cylinder": "([0.5, 0, 0.3], 0.2, 0.1)",
    "sphere": "([0.5, 0, 0.3], 0.2)",
}
"""One of each, as it is typed."""


BITS = 30
"""Binary digits of the points of a Sobol sequence."""

DIRECTIONS = (
    (1,), (1,), (1, 3), (1, 3, 1), (1, 1, 1), (1, 1, 3, 3), (1, 3, 5, 13), (1, 1, 5, 5, 17), (1, 1, 5, 5, 5),
    (1, 1, 7, 11, 19),
)  # fmt: skip
POLYNOMIALS = 1, 3, 7, 11, 13, 19, 25, 37, 41, 47
"""First direction numbers of each dimension, and the binary digits of its primitive polynomial. [JK08]"""


def sobol(dimension: int, count: int, seed: int) -> Matrix:
    """`count` points (count, dimension) of [0, 1)^dimension, a scrambled Sobol sequence, the same for the same seed.

    More points of one seed begin with the fewer ones. They are those of SciPy's `qmc.Sobol`, which takes half a second
    to import.
    """
    if dimension > len(DIRECTIONS):
        from scipy.stats import qmc

        power = int(np.ceil(np.log2(max(count, 2))))
        return qmc.Sobol(dimension, scramble=True, rng=np.random.default_rng(seed)).random_base2(power)[:count]
    rng, digits = np.random.default_rng(seed).spawn(1)[0], 2 ** np.arange(BITS, dtype=np.uint32)
    # A shift, and lower triangles by which the digits of the direction numbers are mixed, most significant first
    shift = rng.integers(2, size=(dimension, BITS), dtype=np.uint32) @ digits
    mix = np.tril(rng.integers(2, size=(dimension, BITS, BITS), dtype=np.uint32), -1) + np.eye(BITS, dtype=np.uint32)
    numbers = np.array([_direction_numbers(d) for d in range(dimension)], dtype=np.uint32)
    bits = (numbers[:, None, :] >> np.arange(BITS - 1, -1, -1, dtype=np.uint32)[:, None]) & 1
    numbers = np.einsum("dpj,p->dj", mix @ bits % 2, digits[::-1]).astype(np.uint32)
    # Each point from those digits of its number's Gray code that are 1
    gray = np.arange(count) ^ (np.arange(count) >> 1)
    points = np.tile(shift.astype(np.uint32), (count, 1))
    for j in range(int(count).bit_length()):
        points[gray >> j & 1 == 1] ^= numbers[:, j]
    return np.asarray(points * 2.0**-BITS, dtype=float)


def _direction_numbers(dimension: int) -> list[int]:
    """The direction numbers (BITS,) of a dimension, as whole numbers of BITS digits."""
    numbers, polynomial = list(DIRECTIONS[dimension]), POLYNOMIALS[dimension]
    m = len(numbers) if dimension else 0
    for j in range(len(numbers), BITS):
        number = numbers[j - m] if m else 1
        for k in range(m):
            if polynomial >> (m - 1 - k) & 1:
                number ^= numbers[j - k - 1] << (k + 1)
        numbers.append(number)
    return [number << (BITS - 1 - j) for j, number in enumerate(numbers)]


@dataclass(frozen=True, eq=False)
class Solid(Value, ABC):
    """A set of tool positions about a centre (3,) [m], in the base frame."""

    center: Vector

    @property
    @abstractmethod
    def half(self) -> Vector:
        """Half sides (3,) of the box round it [m]."""

    def points(self, u: ArrayLike) -> Matrix:
        """Positions (k, 3) of points u (k, 3) of the unit cube; even points give even positions.

        Raises: ShapeError, NotFiniteError, ArgumentError: they are not points of the cube.
        """
        inside = finite("points of the unit cube", u, ("k", 3))
        if inside.size and not (inside.min() >= 0 and inside.max() <= 1):
            raise ArgumentError("points of the unit cube", inside.tolist(), "give numbers from 0 to 1")
        return self._points(inside)

    def contains(self, points: ArrayLike) -> Flags:
        """Which of the positions (k, 3) belong to it. Raises: ShapeError, NotFiniteError, ArgumentError."""
        return self._contains(finite("the positions", points, ("k", 3)))

    @abstractmethod
    def _points(self, u: Matrix) -> Matrix:
        """As `points`, unchecked."""

    @abstractmethod
    def _contains(self, points: Matrix) -> Flags:
        """As `contains`, unchecked."""


@dataclass(frozen=True, eq=False)
class Box(Solid):
    """center +- sides, along the axes of the base."""

    sides: Vector

    @property
    def half(self) -> Vector:
        """Half sides (3,) [m]."""
        return self.sides

    def _points(self, u: Matrix) -> Matrix:
        return self.center + (2 * u - 1) * self.sides

    def _contains(self, points: Matrix) -> Flags:
        return np.all(np.abs(points - self.center) <= self.sides * (1 + 1e-12), axis=1)

    def __str__(self) -> str:
        return f"box {_three(self.center)} +- {_three(self.sides)} m"


@dataclass(frozen=True, eq=False)
class Cylinder(Solid):
    """Positions up to `radius` from the vertical axis through the centre, and up to `height` above and below it."""

    radius: float
    height: float

    @property
    def half(self) -> Vector:
        """Half sides (3,) of the box round it [m]."""
        return np.array([self.radius, self.radius, self.height])

    def _points(self, u: Matrix) -> Matrix:
        # The area grows as the radius squared.
        r, angle = self.radius * np.sqrt(u[:, 0]), 2 * np.pi * u[:, 1]
        return self.center + np.column_stack([r * np.cos(angle), r * np.sin(angle), (2 * u[:, 2] - 1) * self.height])

    def _contains(self, points: Matrix) -> Flags:
        away = points - self.center
        near = np.hypot(away[:, 0], away[:, 1]) <= self.radius * (1 + 1e-12)
        return near & (np.abs(away[:, 2]) <= self.height * (1 + 1e-12))

    def __str__(self) -> str:
        return f"cylinder about {_three(self.center)} m, radius {self.radius:g} m, half height {self.height:g} m"


@dataclass(frozen=True, eq=False)
class Sphere(Solid):
    """Positions up to `radius` from the centre."""

    radius: float

    @property
    def half(self) -> Vector:
        """Half sides (3,) of the box round it [m]."""
        return np.full(3, self.radius)

    def _points(self, u: Matrix) -> Matrix:
        # The volume grows as the radius cubed.
        return self.center + self.radius * np.cbrt(u[:, :1]) * _directions(1 - 2 * u[:, 1], 2 * np.pi * u[:, 2])

    def _contains(self, points: Matrix) -> Flags:
        return np.linalg.norm(points - self.center, axis=1) <= self.radius * (1 + 1e-12)

    def __str__(self) -> str:
        return f"sphere about {_three(self.center)} m, radius {self.radius:g} m"


@dataclass(frozen=True, eq=False)
class Workspace(Value, ABC):
    """A set of tool poses (4, 4) in the base frame: make one with `workspace` or `read_workspace`."""

    @property
    @abstractmethod
    def center(self) -> Matrix:
        """The pose (4, 4) in its middle."""

    @property
    def size(self) -> int | None:
        """Number of its poses; None where there is no end of them."""
        return None

    @abstractmethod
    def poses(self, count: int, seed: int = 0) -> Array:
        """Some of its poses (count, 4, 4), the same for the same seed."""


@dataclass(frozen=True, eq=False)
class PoseRange(Workspace):
    """Positions of a solid, times tool directions within `tilt` of a middle one, times turns of +-`spin` [rad].

    The rotations are R = rotation Rot(u, a) Rot(z, s): the tool leans by a, 0 <= a <= tilt, about an axis u
    perpendicular to its own z axis, then turns by s, |s| <= spin, about that z axis. Directions are even on the
    sphere (cos a is even from cos tilt to 1, as solid angle asks), turns and positions are even, too.
    """

    solid: Solid
    rotation: Matrix
    tilt: float
    spin: float

    @property
    def center(self) -> Matrix:
        """The centre of the solid with the middle rotation (4, 4)."""
        return self.at(self.solid.center[None])[0]

    @typed
    def poses(self, count: int, seed: int = 0) -> Array:
        """`count` poses (count, 4, 4): a scrambled Sobol sequence in six dimensions, the same for the same seed.

        Raises:
            ArgumentError unless count is a whole number, at least 1, and the seed one that is not negative.
        """
        from scipy.spatial.transform import Rotation

        u = sobol(6, whole("samples", count), whole("seed", seed, 0))
        cosine = 1 - u[:, 3] * (1 - np.cos(self.tilt))
        lean, around, turn = np.arccos(np.clip(cosine, -1, 1)), 2 * np.pi * u[:, 4], (2 * u[:, 5] - 1) * self.spin
        axis = np.column_stack([-np.sin(around), np.cos(around), np.zeros(count)])
        leaning = Rotation.from_rotvec(lean[:, None] * axis)
        turning = Rotation.from_rotvec(turn[:, None] * np.array([0.0, 0.0, 1.0]))
        poses = self.at(self.solid.points(u[:, :3]))
        poses[:, :3, :3] = self.rotation @ (leaning * turning).as_matrix()
        return poses

    def at(self, positions: ArrayLike) -> Array:
        """Poses (k, 4, 4) at positions (k, 3), all with the middle rotation. Raises: ShapeError, NotFiniteError."""
        return pose_from(finite("the positions", positions, ("k", 3)), self.rotation)

    def __str__(self) -> str:
        words = [str(self.solid)]
        down = np.array_equal(self.rotation, TOOL_DOWN)
        z = _three(np.round(self.rotation[:, 2], 4))
        words.append("tool down" if down else f"tool z along {z}")
        words += [f"tilt to {np.degrees(self.tilt):.3g} deg"] if self.tilt else []
        words += [f"spin +-{np.degrees(self.spin):.3g} deg"] if self.spin else []
        return ", ".join(words)


@dataclass(frozen=True, eq=False)
class PoseCloud(Workspace):
    """Given poses (k, 4, 4), as many as there are; `source` says where they are from.

    directed: the tool's z axes are given, and its turns about them are not: for tasks of positions and of this axis.
    """

    given: Array
    source: str = "given poses"
    directed: bool = False

    @property
    def size(self) -> int:
        """Number of its poses."""
        return len(self.given)

    @property
    def center(self) -> Matrix:
        """The one of the poses that is nearest to the mean of their positions (4, 4)."""
        p = self.given[:, :3, 3]
        return self.given[int(np.argmin(np.linalg.norm(p - p.mean(axis=0), axis=1)))]

    @typed
    def poses(self, count: int, seed: int = 0) -> Array:
        """All its poses (k, 4, 4), in order; where these are more than `count`, so many of them drawn by chance.

        Raises:
            ArgumentError unless count is a whole number, at least 1, and the seed one that is not negative.
        """
        count, seed = whole("samples", count), whole("seed", seed, 0)
        if count >= len(self.given):
            return self.given
        chosen = np.random.default_rng(seed).choice(len(self.given), count, replace=False)
        return self.given[np.sort(chosen)]

    def __str__(self) -> str:
        return f"{len(self.given)} poses of {self.source}"


@typed
def workspace(
    *,
    box: Sequence[Any] | None = None,
    cylinder: Sequence[Any] | None = None,
    sphere: Sequence[Any] | None = None,
    rotation: ArrayLike | None = None,
    tilt: float = 0.0,
    spin: float = 0.0,
) -> PoseRange:
    """A solid of tool positions, times a cone of tool directions, times a range of turns of the tool about its z axis.

    A task of positions looks at the positions alone, whatever the rotations are. For a pose task of a planar robot
    give rotation=np.eye(3), since its tool turns in the plane, and no tilt.

    Args:
        box: (center (3,), half sides (3,)) [m], along the axes of the base; of a plane (2,) each.
        cylinder: (center (3,), radius, half height) [m], its axis along z of the base.
        sphere: (center (3,), radius) [m].
        rotation: middle rotation (3, 3) of the tool; by default tool down: z of the tool is -z of the base, x is x.
        tilt: half angle [rad] of the cone of the tool's z axes about the middle one, at most pi.
        spin: the tool turns by up to so much [rad] each way about its own z axis, at most pi.

    Raises:
        ArgumentError: none or several of box, cylinder and sphere; a negative side, or none that is positive; a tilt
            or spin below 0 or above pi; no rotation matrix. ShapeError, NotFiniteError.
    """
    given = {name: v for name, v in {"box": box, "cylinder": cylinder, "sphere": sphere}.items() if v is not None}
    if len(given) != 1:
        raise ArgumentError("the solid of a workspace", list(given) or None, "give one of box=, cylinder= and sphere=")
    solids = {"box": _box, "cylinder": _cylinder, "sphere": _sphere}
    for name, sizes in given.items():
        if len(sizes) != len(SIZES[name]):
            cure = f"give {', '.join(SIZES[name])} [m], as in {name}={EXAMPLES[name]}"
            raise ArgumentError(f"the {name} of a workspace", list(sizes), cure)
    (solid,) = (solids[name](*sizes) for name, sizes in given.items())
    R = TOOL_DOWN if rotation is None else finite("the rotation of a workspace", rotation, (3, 3))
    check_rotation("the rotation of a workspace", R)
    return PoseRange(solid, R, _angle("tilt", tilt), _angle("spin", spin))


def pose_cloud(poses: PoseLike, source: str = "given poses") -> PoseCloud:
    """A workspace of given tool poses (k, 4, 4).

    Raises:
        ArgumentError: no poses, or one whose rotation is none. ShapeError, NotFiniteError.
    """
    given = tool_poses("of a workspace", poses)
    if not len(given):
        raise ArgumentError("the number of poses of a workspace", 0, "give at least one")
    return PoseCloud(given, source)


def _box(center: Any, sides: Any) -> Box:
    half = numbers("the half sides of a box", sides)
    if half.shape not in ((2,), (3,)):
        raise ShapeError("the half sides of a box", "(3,) or (2,)", half.shape)
    half = as_point(half)
    if (half < 0).any() or not half.any():
        cure = "give half sides that are not negative [m], and not all zero: center and half sides, not two corners"
        raise ArgumentError("the half sides of a box", half.tolist(), cure)
    return Box(as_point(center), half)


def _cylinder(center: Any, radius: Any, height: Any) -> Cylinder:
    radius = positive("the radius of a cylinder", radius, METRES)
    return Cylinder(as_point(center), radius, not_negative("the half height of a cylinder", height))


def _sphere(center: Any, radius: Any) -> Sphere:
    return Sphere(as_point(center), positive("the radius of a sphere", radius, METRES))


def _angle(what: str, value: float) -> float:
    angle = not_negative(f"the {what} of a workspace", value)
    if angle > np.pi * (1 + 1e-12):
        raise ArgumentError(f"the {what} of a workspace", angle, "give at most pi: angles are in rad")
    return min(angle, np.pi)


def _directions(cosine: Vector, around: Vector) -> Matrix:
    """Unit vectors (k, 3) at angles acos(cosine) from z, and `around` it."""
    sine = np.sqrt(np.maximum(0.0, 1 - cosine**2))
    return np.column_stack([sine * np.cos(around), sine * np.sin(around), cosine])


def _three(v: Vector) -> str:
    return f"[{', '.join(f'{x:.4g}' for x in v + 0.0)}]"
