"""The shapes of the bodies of an MjModel: of those geoms that may touch anything."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...base.poses import pose_from
from ...base.types import Matrix, Vector
from .link_shapes import Box, Capsule, Cylinder, Ellipsoid, Hull, LinkShape, Shape, Unread


def shapes_of(
    model: Any, enums: Any, source: str, bodies: Sequence[str], geoms: Sequence[str]
) -> dict[str, tuple[LinkShape, ...]]:
    """Body -> its shapes. Geoms whose contype and conaffinity are both 0, which touch nothing, are left out.

    Those of the world are obstacles, with names of their own.
    """
    found: dict[str, tuple[LinkShape, ...]] = {}
    for geom in range(model.ngeom):
        if model.geom_contype[geom] or model.geom_conaffinity[geom]:
            body = int(model.geom_bodyid[geom])
            name = bodies[body] if body else geoms[geom]
            T, shape = transform(model.geom_pos[geom], model.geom_quat[geom]), shape_of(model, geom, enums, source)
            found[bodies[body]] = (*found.get(bodies[body], ()), LinkShape(name, -1, T, shape, obstacle=body == 0))
    return found


def shape_of(model: Any, geom: int, enums: Any, source: str = "") -> Shape:
    """The solid of a geom; of a mesh its hull."""
    kind = enums.mjtGeom(model.geom_type[geom]).name.removeprefix("mjGEOM_").lower()
    size = np.array(model.geom_size[geom], dtype=float)
    if kind == "mesh":
        mesh = int(model.geom_dataid[geom])
        first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        return Hull(np.array(model.mesh_vert[first : first + count], dtype=float))
    makers = {
        "box": lambda: Box(2 * size), "sphere": lambda: Capsule(float(size[0])), "ellipsoid": lambda: Ellipsoid(size),
        "capsule": lambda: Capsule(float(size[0]), float(2 * size[1])),
        "cylinder": lambda: Cylinder(float(size[0]), float(2 * size[1])),
    }  # fmt: skip
    if kind not in makers:
        cure = ", give its height as floor" if kind == "plane" else ""
        return Unread(source, f"shapes of type {kind!r} are not read{cure}", plane=kind == "plane")
    return makers[kind]()


def transform(position: Vector, quaternion: Vector) -> Matrix:
    """(w, x, y, z) and a position as a pose (4, 4)."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    rotation = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return pose_from(position, rotation)
