"""Slices: what a leaf reaches in the planes through a workspace's centre, at the middle orientation of the tool."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ..base.arguments import typed
from ..base.types import Array, ArrayLike, Flags, Value, Vector, numbers, whole
from ..errors import ShapeError
from ..path.workspaces import PoseRange, pose_cloud
from ..strategies import HolonomicStrategy
from .cover_workspace import coverage
from .coverage_result import Coverage

STEPS = 31
"""Cells along the longest side: pixels of two millimetres in a picture on a page."""


@dataclass(frozen=True, eq=False)
class Slice(Value):
    """Coverage on a grid of positions in a plane through a workspace's centre.

    axes: the two axes, 0, 1, 2 for x, y, z, that span it; at: where it cuts the third [m]; u (columns,), v (rows,): the
    positions along them [m]; inside (rows, columns): which cells belong to the workspace; coverage: of these, by rows.
    """

    axes: tuple[int, int]
    at: float
    u: Vector
    v: Vector
    inside: Flags
    coverage: Coverage

    def grid(self, values: ArrayLike) -> Array:
        """Numbers of the poses (k,) in their cells (rows, columns), NaN outside. Raises: ShapeError, ArgumentError."""
        given, count = numbers("the numbers of the poses", values), int(self.inside.sum())
        if given.shape != (count,):
            raise ShapeError("the numbers of the poses", (count,), given.shape)
        cells = np.full(self.inside.shape, np.nan)
        cells[self.inside] = given
        return cells


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
    whole("steps", steps, 2)
    solid = workspace.solid
    half, center = solid.half, solid.center
    found: list[Slice] = []
    for i, j in combinations(np.flatnonzero(half > 0).tolist(), 2):
        counts = np.maximum(2, np.rint(steps * half[[i, j]] / half.max())).astype(int)
        u, v = (center[k] + half[k] * (2 * (np.arange(n) + 0.5) / n - 1) for k, n in zip((i, j), counts, strict=True))
        points = np.tile(center, (len(u) * len(v), 1))
        points[:, i], points[:, j] = np.tile(u, len(v)), np.repeat(v, len(u))
        inside = solid.contains(points)
        across = 3 - i - j
        cells = pose_cloud(workspace.at(points[inside]), f"a slice of {workspace}")
        of = coverage(strategy, cells, q0, limits=limits)
        found.append(Slice((i, j), float(center[across]), u, v, inside.reshape(len(v), len(u)), of))
    return tuple(found)
