"""Slices: what a leaf reaches in the planes through a workspace's centre, at the middle orientation of the tool."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ...base.arguments import typed
from ...base.errors import ShapeError
from ...base.types import Array, ArrayLike, Flags, Indices, Matrix, Value, Vector, numbers, whole
from ...motion.ik import inverse
from ...motion.ik.quiet_answers import leads_to
from ...path.workspaces import PoseRange, pose_cloud
from ...strategies import HolonomicStrategy
from .cover_workspace import coverage
from .coverage_result import Coverage

JUMP = 0.2
"""Difference of joints [joint units] between neighbouring cells from which it is looked whether a path joins them."""

STEPS = 31
"""Cells along the longest side: pixels of two millimetres in a picture on a page."""


@dataclass(frozen=True, eq=False)
class Slice(Value):
    """Coverage on a grid of positions in a plane through a workspace's centre.

    cuts (c, 2): neighbouring cells, by their place among the poses of `coverage`, between which `ik(pose)` jumps: the
    leaf, followed straight from the one's posture to the other's pose, has other joints there, or ends before.

    axes: the two axes, 0, 1, 2 for x, y, z, that span it; at: where it cuts the third [m]; u (columns,), v (rows,): the
    positions along them [m]; inside (rows, columns): which cells belong to the workspace; coverage: of these, by rows.
    """

    axes: tuple[int, int]
    at: float
    u: Vector
    v: Vector
    inside: Flags
    coverage: Coverage
    cuts: Indices

    def grid(self, values: ArrayLike) -> Array:
        """Numbers of the poses (k,) in their cells (rows, columns), NaN outside. Raises: ShapeError, ArgumentError."""
        given, count = numbers("the numbers of the poses", values), int(self.inside.sum())
        if given.shape != (count,):
            raise ShapeError("the numbers of the poses", (count,), given.shape)
        cells = np.full(self.inside.shape, np.nan)
        cells[self.inside] = given
        return cells


@dataclass(frozen=True, eq=False)
class Plane(Value):
    """A grid of positions in a plane through a workspace, as of a `Slice`; points (rows * columns, 3)."""

    axes: tuple[int, int]
    at: float
    u: Vector
    v: Vector
    points: Matrix
    inside: Flags


def grid_planes(workspace: PoseRange, steps: int) -> Iterator[Plane]:
    """The planes x-y, x-z and y-z; of a flat one only its own. steps: cells along the longest side, at least 2."""
    whole("steps", steps, 2)
    for axes in combinations(np.flatnonzero(workspace.solid.half > 0).tolist(), 2):
        yield plane_through(workspace, axes, steps, workspace.solid.center)


def plane_through(workspace: PoseRange, axes: tuple[int, int], steps: int, place: Vector) -> Plane:
    """The plane along two axes through a place (3,) of a workspace."""
    solid, (i, j) = workspace.solid, axes
    half, center = solid.half, solid.center
    counts = np.maximum(2, np.rint(steps * half[[i, j]] / half.max())).astype(int)
    u, v = (center[k] + half[k] * (2 * (np.arange(n) + 0.5) / n - 1) for k, n in zip((i, j), counts, strict=True))
    points = np.tile(place, (len(u) * len(v), 1))
    points[:, i], points[:, j] = np.tile(u, len(v)), np.repeat(v, len(u))
    return Plane((i, j), float(place[3 - i - j]), u, v, points, solid.contains(points).reshape(len(v), len(u)))


@typed
def coverage_slices(
    strategy: HolonomicStrategy, workspace: PoseRange, q0: ArrayLike, *, steps: int = STEPS, limits: bool = True
) -> tuple[Slice, ...]:
    """Coverage of the planes x-y, x-z and y-z through a workspace's centre; of a flat one only of its plane.

    Args:
        steps: cells along the longest side, at least 2; they are squares, or nearly.

    Raises:
        JointLimitError, SingularityError, ArgumentError, ShapeError, NotFiniteError: as `coverage`.
    """
    found: list[Slice] = []
    for plane in grid_planes(workspace, steps):
        cells = pose_cloud(workspace.at(plane.points[plane.inside.ravel()]), f"a slice of {workspace}")
        of = coverage(strategy, cells, q0, limits=limits)
        cuts = _cuts(strategy, plane.inside, of)
        found.append(Slice(plane.axes, plane.at, plane.u, plane.v, plane.inside, of, cuts))
    return tuple(found)


def neighbouring_cells(inside: Flags) -> Indices:
    """Pairs (e, 2) of neighbouring cells of a grid (rows, columns), by their place among those that are inside."""
    place = np.full(inside.shape, -1)
    place[inside] = np.arange(int(inside.sum()))
    sides = [(place[:, :-1], place[:, 1:]), (place[:-1], place[1:])]
    pairs = np.concatenate([np.column_stack([one.ravel(), other.ravel()]) for one, other in sides])
    return pairs[(pairs >= 0).all(axis=1)]


def _cuts(strategy: HolonomicStrategy, inside: Flags, found: Coverage) -> Indices:
    """Pairs (c, 2) of neighbouring cells, both with a posture, that no straight path on the leaf joins."""
    pairs = neighbouring_cells(inside)
    apart = np.abs(found.q[pairs[:, 0]] - found.q[pairs[:, 1]]).max(axis=1)  # NaN where there is no posture
    ik, poses = inverse(strategy, found.q0, limits=False), found.poses
    far = pairs[apart > JUMP]
    return far[[not leads_to(ik, poses[j], found.q[i], found.q[j]) for i, j in far]]
