"""Meshes in convex pieces, so that pockets stay open where shapes must be convex."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, RobotFileError
from ...base.extra_module import extra_module
from ...base.types import Matrix, positive
from .link_shapes import Hull, Mesh

UNCOVERED = 1e-3
"""Share of a mesh's size by which its surface may stick out of the pieces: what cutting it up moves."""


@typed
def convex_pieces(mesh: Mesh, threshold: float = 0.05) -> tuple[Hull, ...]:
    """Convex hulls that together hold a mesh, by CoACD [WLLS22]; its pockets stay open, but for the threshold.

    A mesh alone is compared by its surface in checks, and not at all in proofs; hulls are solid in both.

    Args:
        mesh: of the file.
        threshold: how deep hollows may be that the pieces fill, as a share of the mesh's size: from 0.01 to 1.

    Returns:
        The pieces, in metres, the same at every call.

    Raises:
        MissingExtraError: coacd is not installed. RobotFileError: the mesh cannot be read, or its pieces do not cover
        it. ArgumentError: another threshold.
    """
    if not 0.01 <= positive("threshold", threshold) <= 1.0:
        raise ArgumentError("threshold", threshold, "give a share of the mesh's size, from 0.01 to 1")
    return _pieces(str(mesh.file), tuple(mesh.scale.tolist()), float(threshold))


@lru_cache(maxsize=32)
def _pieces(file: str, scale: tuple[float, ...], threshold: float) -> tuple[Hull, ...]:
    mesh = Mesh(Path(file), np.array(scale))
    points, faces = mesh.triangles
    coacd: Any = extra_module("coacd", "pieces")
    coacd.set_log_level("off")
    parts = coacd.run_coacd(coacd.Mesh(points, faces), threshold=threshold, seed=0)
    pieces = tuple(Hull(np.asarray(corners)) for corners, _ in parts)
    # All of the surface must be in them: corners, middles of edges and of triangles.
    a, b, c = (points[faces[:, k]] for k in range(3))
    seen = np.vstack([points, (a + b) / 2, (b + c) / 2, (c + a) / 2, (a + b + c) / 3])
    out = np.min([_outside(piece, seen) for piece in pieces], axis=0)
    if out.max() > UNCOVERED * 2 * mesh.ball[1]:
        fact = f"sticks out of its convex pieces by {out.max():.3g} m"
        raise RobotFileError(
            file, fact, "repair the mesh so that it is closed, or give its pieces in files of their own"
        )
    return pieces


def _outside(piece: Hull, points: Matrix) -> Matrix:
    """How far points (k, 3) are beyond the faces of a hull (k,) [m]; negative inside."""
    from scipy.spatial import ConvexHull

    planes = ConvexHull(piece.corners).equations
    return (points @ planes[:, :3].T + planes[:, 3]).max(axis=1)
