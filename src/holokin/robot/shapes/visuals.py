"""What the links of a robot look like: the <visual> elements of a URDF, the drawn geoms of MJCF. For pictures only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.errors import HolokinError
from ...base.types import Indices, Matrix, Value, Vector
from .link_shapes import Shape
from .mjcf_shapes import shape_of as solid_of
from .mjcf_shapes import transform
from .urdf_shapes import Finder, shape_of

_DRAWN = 3
"""Geoms of MJCF in groups below this one are drawn, as MuJoCo's own viewer does at its start."""


@dataclass(frozen=True, eq=False)
class Surface(Value):
    """Triangles (f, 3) between points (k, 3) [m]."""

    points: Matrix
    triangles: Indices


@dataclass(frozen=True, eq=False)
class Visual(Value):
    """What is drawn of a link, at `placement` (4, 4) on the moving side of a joint (by its index; joint -1: the base).

    color: red, green, blue and opacity (4,), 0 to 1; None where the mesh has colours of its own, or nothing is said.
    """

    link: str
    joint: int
    placement: Matrix
    shape: Shape | Surface
    color: Vector | None = None


def urdf_visuals(model: Any, find: Finder) -> dict[str, tuple[Visual, ...]]:
    """Link -> what is drawn of it, of a URDF. What cannot be understood is left out."""
    shared = {material.name: material for material in getattr(model, "materials", None) or ()}
    found = {}
    for link in model.links:
        seen = [_urdf_visual(link.name, visual, shared, find) for visual in link.visuals if visual is not None]
        found[link.name] = tuple(visual for visual in seen if visual is not None)
    return found


def _urdf_visual(link: str, visual: Any, shared: dict[str, Any], find: Finder) -> Visual | None:
    T = np.eye(4) if visual.origin is None else np.asarray(visual.origin, dtype=float)
    try:
        shape = shape_of(visual.geometry, find)
        if not np.isfinite(T).all():
            return None
        return Visual(link, -1, T, shape, _urdf_color(visual.material, shared))
    except (HolokinError, AttributeError, TypeError, ValueError):
        return None


def _urdf_color(material: Any, shared: dict[str, Any]) -> Vector | None:
    if material is None:
        return None
    known = material if material.color is not None else shared.get(material.name)
    rgba = getattr(getattr(known, "color", None), "rgba", None)
    values = None if rgba is None else np.asarray(rgba, dtype=float)
    return values if values is not None and values.shape == (4,) and np.isfinite(values).all() else None


def mjcf_visuals(model: Any, enums: Any, bodies: Sequence[str]) -> dict[str, tuple[Visual, ...]]:
    """Body -> what is drawn of it, of an MjModel: its geoms in the groups 0, 1 and 2, those of the world left out."""
    found: dict[str, tuple[Visual, ...]] = {}
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        color = _mjcf_color(model, geom)
        if not body or model.geom_group[geom] >= _DRAWN or color[3] == 0:
            continue
        shape = _mjcf_shape(model, geom, enums)
        if shape is not None:
            T = transform(model.geom_pos[geom], model.geom_quat[geom])
            found[bodies[body]] = (*found.get(bodies[body], ()), Visual(bodies[body], -1, T, shape, color))
    return found


def _mjcf_shape(model: Any, geom: int, enums: Any) -> Shape | Surface | None:
    if enums.mjtGeom(model.geom_type[geom]) != enums.mjtGeom.mjGEOM_MESH:
        shape = solid_of(model, geom, enums)
        return None if shape.fault else shape
    mesh = int(model.geom_dataid[geom])
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    face, number = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    points = np.array(model.mesh_vert[first : first + count], dtype=float)
    return Surface(points, np.array(model.mesh_face[face : face + number], dtype=np.int64))


def _mjcf_color(model: Any, geom: int) -> Vector:
    """That of its material, where it has one."""
    material = int(model.geom_matid[geom])
    return np.array(model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom], dtype=float)
