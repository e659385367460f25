"""Shapes of links as URDF and MJCF write them: those that collide, and those that are drawn."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import ArgumentError, HolokinError
from ...base.poses import pose_from
from ...base.types import Indices, Matrix, Value, Vector
from .link_shapes import Box, Capsule, Cylinder, Ellipsoid, Hull, LinkShape, Mesh, Shape, Unread

# --- The shapes of the bodies of an MjModel: of those geoms that may touch anything.


def geom_shapes(
    model: Any, enums: Any, source: str, bodies: Sequence[str], geoms: Sequence[str]
) -> dict[str, tuple[LinkShape, ...]]:
    """Body -> its shapes. Geoms whose contype and conaffinity are both 0, which touch nothing, are left out.

    Those of the world are obstacles, with names of their own.
    """
    shapes: dict[str, tuple[LinkShape, ...]] = {}
    for geom in range(model.ngeom):
        if model.geom_contype[geom] or model.geom_conaffinity[geom]:
            body = int(model.geom_bodyid[geom])
            name = bodies[body] if body else geoms[geom]
            T, shape = transform(model.geom_pos[geom], model.geom_quat[geom]), _geom_shape(model, geom, enums, source)
            shapes[bodies[body]] = (*shapes.get(bodies[body], ()), LinkShape(name, -1, T, shape, obstacle=body == 0))
    return shapes


def _geom_shape(model: Any, geom: int, enums: Any, source: str = "") -> Shape:
    """The solid of a geom; of a mesh its hull."""
    kind = enums.mjtGeom(model.geom_type[geom]).name.removeprefix("mjGEOM_").lower()
    size = np.array(model.geom_size[geom], dtype=float)
    if kind == "mesh":
        mesh = int(model.geom_dataid[geom])
        first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        return Hull(np.array(model.mesh_vert[first : first + count], dtype=float))
    makers = {
        "box": lambda: Box(2 * size),
        "sphere": lambda: Capsule(float(size[0])),
        "ellipsoid": lambda: Ellipsoid(size),
        "capsule": lambda: Capsule(float(size[0]), float(2 * size[1])),
        "cylinder": lambda: Cylinder(float(size[0]), float(2 * size[1])),
    }
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


# --- The shapes of links of a URDF, from its <collision> elements; meshes are found, and read later, when needed.

BROKEN = "its <collision> elements cannot be read"
"""Why nothing is known of a shape of a URDF."""

_ROOTS = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")
"""Variables with folders of packages, or of installations with packages in share/."""

Finder = Callable[[str], Path]
"""From the name of a mesh in a URDF to its file."""


def collision_shapes(links: Sequence[Any], source: str, find: Finder) -> Mapping[str, tuple[LinkShape, ...]]:
    """Link name -> its shapes, of the links of a URDF."""
    return {
        link.name: tuple(_link_shape(link.name, c, source, find) for c in link.collisions)
        for link in links
        if link.collisions
    }


def mesh_finder(file: str | Path) -> Finder:
    """How meshes are found that a file names: package://NAME/... in the folders above it, or where ROS has packages."""

    def find(name: str) -> Path:
        scheme, _, rest = slashed(name).rpartition("://")
        if scheme == "file":
            return Path(rest)
        if scheme != "package":
            return Path(file).parent / rest
        return next((path for path in _packaged(Path(rest), Path(file)) if path.is_file()), Path(rest))

    return find


def slashed(name: str) -> str:
    r"""The name of a file as all systems read it: `nib\meshes\x.stl`, as Windows writes it, is `nib/meshes/x.stl`."""
    return name.replace("\\", "/")


def _packaged(name: Path, file: Path) -> Iterator[Path]:
    """Where NAME/... of a package may be."""
    for folder in file.absolute().parents:
        yield folder / name
        if folder.name == name.parts[0]:
            yield folder.joinpath(*name.parts[1:])
    for root in filter(None, (part for key in _ROOTS for part in os.environ.get(key, "").split(os.pathsep))):
        yield from (Path(root) / name, Path(root) / "share" / name)


def _link_shape(link: str, collision: Any, source: str, find: Finder) -> LinkShape:
    T = np.eye(4) if collision is None or collision.origin is None else np.asarray(collision.origin, dtype=float)
    if collision is None or not np.isfinite(T).all():
        return LinkShape(link, -1, np.eye(4), Unread(source, BROKEN))
    try:
        shape = _geometry_shape(collision.geometry, find)
    except HolokinError as problem:
        shape = Unread(source, str(problem).partition(";")[0])
    return LinkShape(link, -1, T, shape)


def _geometry_shape(geometry: Any, find: Finder) -> Shape:
    """The solid of a <geometry>. Raises: HolokinError."""
    if geometry is None or all(part is None for part in vars(geometry).values()):
        raise ArgumentError("its <geometry>", None, "write a box, a cylinder, a sphere or a mesh")
    if geometry.box is not None:
        return Box(geometry.box.size)
    if geometry.sphere is not None:
        return Capsule(float(geometry.sphere.radius))
    if geometry.cylinder is not None:
        return Cylinder(float(geometry.cylinder.radius), float(geometry.cylinder.length))
    given = geometry.mesh.scale
    scale = np.broadcast_to(1.0 if given is None else np.asarray(given, dtype=float), (3,))
    if not (np.isfinite(scale).all() and scale.all()):
        cure = "write three numbers that are not 0, as 0.001 0.001 0.001 for a mesh in mm"
        raise ArgumentError(f"the scale of the mesh {geometry.mesh.filename!r}", scale.tolist(), cure)
    return Mesh(find(geometry.mesh.filename or ""), scale)


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
    visuals = {}
    for link in model.links:
        seen = [_urdf_visual(link.name, visual, shared, find) for visual in link.visuals if visual is not None]
        visuals[link.name] = tuple(visual for visual in seen if visual is not None)
    return visuals


def _urdf_visual(link: str, visual: Any, shared: dict[str, Any], find: Finder) -> Visual | None:
    T = np.eye(4) if visual.origin is None else np.asarray(visual.origin, dtype=float)
    try:
        shape = _geometry_shape(visual.geometry, find)
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
    visuals: dict[str, tuple[Visual, ...]] = {}
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        # That of its material, where it has one.
        material = int(model.geom_matid[geom])
        color = np.array(model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom], dtype=float)
        if not body or model.geom_group[geom] >= _DRAWN or color[3] == 0:
            continue
        shape = _mjcf_shape(model, geom, enums)
        if shape is not None:
            T = transform(model.geom_pos[geom], model.geom_quat[geom])
            visuals[bodies[body]] = (*visuals.get(bodies[body], ()), Visual(bodies[body], -1, T, shape, color))
    return visuals


def _mjcf_shape(model: Any, geom: int, enums: Any) -> Shape | Surface | None:
    if enums.mjtGeom(model.geom_type[geom]) != enums.mjtGeom.mjGEOM_MESH:
        shape = _geom_shape(model, geom, enums)
        return None if shape.fault else shape
    mesh = int(model.geom_dataid[geom])
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    face, number = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    points = np.array(model.mesh_vert[first : first + count], dtype=float)
    return Surface(points, np.array(model.mesh_face[face : face + number], dtype=np.int64))
