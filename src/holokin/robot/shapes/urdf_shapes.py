"""The shapes of links of a URDF, from its <collision> elements; meshes are found, and read later, when needed."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import ArgumentError, HolokinError
from .link_shapes import Box, Capsule, Cylinder, LinkShape, Mesh, Shape, Unread

BROKEN = "its <collision> elements cannot be read"
"""Why nothing is known of a shape of a URDF."""

_ROOTS = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")
"""Variables with folders of packages, or of installations with packages in share/."""

Finder = Callable[[str], Path]
"""From the name of a mesh in a URDF to its file."""


def shapes_of(links: Sequence[Any], source: str, find: Finder) -> Mapping[str, tuple[LinkShape, ...]]:
    """Link name -> its shapes, of the links of a URDF."""
    return {
        link.name: tuple(_placed(link.name, c, source, find) for c in link.collisions)
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


def _placed(link: str, collision: Any, source: str, find: Finder) -> LinkShape:
    T = np.eye(4) if collision is None or collision.origin is None else np.asarray(collision.origin, dtype=float)
    if collision is None or not np.isfinite(T).all():
        return LinkShape(link, -1, np.eye(4), Unread(source, BROKEN))
    try:
        shape = shape_of(collision.geometry, find)
    except HolokinError as problem:
        shape = Unread(source, str(problem).partition(";")[0])
    return LinkShape(link, -1, T, shape)


def shape_of(geometry: Any, find: Finder) -> Shape:
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
