"""The links of a robot as triangles to look at: its own meshes, or capsules where it has none that can be read."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from ...base.errors import RobotFileError, brief
from ...base.extra_module import extra_module
from ...base.types import Array, Indices, Matrix, Value
from ...robot import Box, Capsule, Cylinder, Ellipsoid, Hull, LinkShape, Mesh, Robot, Shape, Surface, chain_length
from ...robot.numeric import Frames, joint_frames
from ..report.bodies import pieces_of

SOLID = 200_000
"""Triangles of all links together that are drawn of one robot at most."""

GHOST = 20_000
"""The same of each ghost: 60 of them are drawn at once."""

LINK, JOINT = (226, 229, 234), (96, 104, 117)
"""Colours of the rods that stand for links, and of all else that has no mesh: light and dark grey."""

TOOL, THING = (74, 80, 92), (196, 180, 150)
"""Colours of the tools that robots carry, and of what stands around them."""

_SHARP = np.deg2rad(30.0)
"""Edges that are sharper than this are drawn as edges, others as round."""


@dataclass(frozen=True, eq=False)
class Look(Value):
    """All that moves with one joint (joint -1: the base): points (k, 3) in its frame [m], triangles, colours (k, 3)."""

    joint: int
    points: Matrix
    triangles: Indices
    colors: Indices


def trimesh_package() -> Any:
    """The module trimesh. Raises: MissingExtraError."""
    return extra_module("trimesh", "studio")


@lru_cache(maxsize=8)
def looks_of(robot: Robot, most: int = SOLID) -> tuple[tuple[Look, ...], tuple[str, ...]]:
    """What is drawn of a robot, and a sentence for each link whose own mesh could not be read.

    Args:
        most: triangles of all links together, about; finer meshes are made coarser.

    Returns:
        One look for each joint that carries anything, and the sentences.

    Raises:
        MissingExtraError: trimesh is not installed.
    """
    whole, said = _whole(robot)
    count = sum(len(mesh.faces) for mesh in whole.values())
    share = min(1.0, most / count) if count else 1.0
    return tuple(_look(joint, mesh, share) for joint, mesh in whole.items()), said


@lru_cache(maxsize=2)
def _whole(robot: Robot) -> tuple[dict[int, Any], tuple[str, ...]]:
    """Joint -> all that it carries as one mesh, as fine as it is; and what could not be read."""
    parts: dict[int, list[Any]] = {}
    said: list[str] = []
    for visual in robot.visuals:
        try:
            mesh = _mesh(visual.shape, visual.color)
        except RobotFileError as problem:
            said.append(f"{visual.link} is drawn as a capsule: {problem.fact} ({problem.path})")
            continue
        mesh.apply_transform(visual.placement)
        parts.setdefault(visual.joint, []).append(mesh)
    for joint, capsules in _capsules(robot).items():
        parts.setdefault(joint, capsules)
    for part in robot.shapes:
        if part.carried and not part.shape.fault:
            parts.setdefault(part.joint, []).append(shape_mesh(part, TOOL))
    whole = {joint: trimesh_package().util.concatenate(meshes) for joint, meshes in sorted(parts.items())}
    for mesh in whole.values():
        mesh.merge_vertices(merge_norm=True, merge_tex=True)
    return whole, tuple(dict.fromkeys(said))


def frames_of(robot: Robot, Q: Matrix) -> tuple[Matrix, Array]:
    """Positions (j + 1, k, 3) and quaternions w, x, y, z (j + 1, k, 4) of the base and all joints, at Q (k, n)."""
    frames: Frames = [(np.zeros((len(Q), 3)), np.broadcast_to(np.eye(3), (len(Q), 3, 3))), *joint_frames(robot, Q)]
    positions, rotations = (np.stack([frame[i] for frame in frames]) for i in (0, 1))
    return positions, quaternions(rotations)


def quaternions(rotations: Array) -> Array:
    """w, x, y, z (..., 4) of rotations (..., 3, 3)."""
    from scipy.spatial.transform import Rotation

    found = Rotation.from_matrix(rotations.reshape(-1, 3, 3)).as_quat()
    return found[:, [3, 0, 1, 2]].reshape(*rotations.shape[:-2], 4)


def _mesh(shape: Shape | Surface, color: Any = None) -> Any:
    """A shape as a trimesh.Trimesh with a colour for each point. Raises: RobotFileError."""
    tm = trimesh_package()
    if isinstance(shape, Mesh):
        mesh = _file_mesh(shape)
    elif isinstance(shape, Surface):
        mesh = tm.Trimesh(shape.points, shape.triangles, process=True)
    else:
        mesh = _solid(shape)
    if color is not None or not isinstance(shape, Mesh):
        rgb = LINK if color is None else tuple(int(255 * min(max(c, 0.0), 1.0)) for c in color[:3])
        mesh.visual = tm.visual.ColorVisuals(mesh, vertex_colors=np.tile([*rgb, 255], (len(mesh.vertices), 1)))
    return mesh


def _file_mesh(shape: Mesh) -> Any:
    """The mesh of a file with its own colours. Raises: RobotFileError."""
    tm, cure = trimesh_package(), "install the reader of its format, or convert it to .stl, .obj or .glb"
    if not shape.file.is_file():
        raise RobotFileError(shape.file, "there is no such mesh", "put it where the robot's file says")
    try:
        loaded = tm.load(shape.file)
        pieces = loaded.dump() if hasattr(loaded, "dump") else [loaded]
        meshes = []
        for piece in pieces:
            points = np.asarray(piece.vertices, dtype=float) * shape.scale
            colors = _own_colors(piece)
            faces = shape.outward(np.asarray(piece.faces, dtype=np.int64))
            meshes.append(tm.Trimesh(points, faces, vertex_colors=colors, process=False))
        mesh = tm.util.concatenate(meshes)
        if not len(mesh.faces) or not np.isfinite(mesh.vertices).all():
            raise RobotFileError(shape.file, "has no triangles", cure)
        return mesh
    except RobotFileError:
        raise
    except Exception as problem:  # its readers raise what they like, of packages that are missing, too
        raise RobotFileError(shape.file, f"cannot be read ({brief(problem, 100)})", cure) from problem


def _own_colors(piece: Any) -> Any:
    """A colour for each point of a mesh as it was loaded; light grey where the file has none."""
    visual = piece.visual
    if getattr(visual, "defined", False):
        colors = visual.to_color() if hasattr(visual, "to_color") else visual
        found = np.asarray(colors.vertex_colors)
        if found.shape == (len(piece.vertices), 4):
            return found
    return np.tile([*LINK, 255], (len(piece.vertices), 1))


def _solid(shape: Shape) -> Any:
    """Primitives and hulls. Raises: RobotFileError, from shapes that nobody can look at."""
    make, tm = trimesh_package().creation, trimesh_package()
    if isinstance(shape, Box):
        return make.box(extents=shape.sides)
    if isinstance(shape, Cylinder):
        return make.cylinder(radius=shape.radius, height=shape.length, sections=32)
    if isinstance(shape, Capsule):
        mesh = make.capsule(height=shape.length, radius=shape.radius, count=[24, 24])
        mesh.apply_translation(-mesh.bounds.mean(axis=0))
        return mesh
    if isinstance(shape, Ellipsoid):
        mesh = make.icosphere(subdivisions=3)
        mesh.apply_scale(shape.radii)
        return mesh
    if isinstance(shape, Hull):
        return tm.convex.convex_hull(shape.corners)
    raise RobotFileError("the robot", "a shape that is not read", "draw it without")


def _capsules(robot: Robot) -> dict[int, list[Any]]:
    """Joint -> what stands for it, as in pictures; tools that links carry are not among it.

    A slider that goes farther than the arm reaches both ways stands for a base that drives: it has no rail. Under a
    robot with meshes is neither plate nor rail.
    """
    found: dict[int, list[Any]] = {}
    far = max(chain_length(robot), 1.0)
    Q = np.clip([robot.lower, robot.upper], -2 * far, 2 * far)
    tools = tuple(part for part in robot.shapes if part.carried)
    for piece in pieces_of(replace(robot, shapes=tools), Q):
        far_off = piece.part.shape.ball[1] > far
        if piece.role == "tool" or (piece.role in ("base", "rail") and (robot.visuals or far_off)):
            continue
        color = LINK if piece.role == "link" else JOINT
        found.setdefault(piece.joint, []).append(shape_mesh(piece.part, color))
    return found


def shape_mesh(part: LinkShape, color: tuple[int, int, int]) -> Any:
    """A shape as a trimesh.Trimesh in a colour, where it is in the frame of its joint. Raises: RobotFileError."""
    mesh = _mesh(part.shape, np.array(color) / 255)
    mesh.apply_transform(part.placement)
    return mesh


def _look(joint: int, mesh: Any, share: float) -> Look:
    """A mesh with at most a share of its triangles, its sharp edges cut open so that they are drawn as edges."""
    mesh = _coarser(mesh, int(share * len(mesh.faces))) if share < 1.0 else mesh
    tm, faces = trimesh_package(), np.asarray(mesh.faces)
    smooth = mesh.face_adjacency[mesh.face_adjacency_angles < _SHARP]
    patch = tm.graph.connected_component_labels(smooth, node_count=len(faces))
    corners, triangles = np.unique(patch[:, None] * len(mesh.vertices) + faces, return_inverse=True)
    point = corners % len(mesh.vertices)
    colors = np.asarray(mesh.visual.vertex_colors)[point, :3].astype(np.int64)
    return Look(joint, np.asarray(mesh.vertices)[point], triangles.reshape(-1, 3).astype(np.int64), colors)


def _coarser(mesh: Any, most: int) -> Any:
    """About `most` triangles: points in one cell of a grid become one, a grid as fine as the number allows.

    J. Rossignac, P. Borrel, "Multi-resolution 3D approximations for rendering complex scenes", 1993.
    """
    size = float(np.linalg.norm(mesh.extents))
    fine, coarse = size / 400, size / 4
    for _ in range(6):
        cell = float(np.sqrt(fine * coarse))
        fine, coarse = (cell, coarse) if len(_clustered(mesh, cell)[1]) > most else (fine, cell)
    (first, inverse), faces = _clustered(mesh, coarse)
    count = np.bincount(inverse)[:, None]
    middles = np.stack([np.bincount(inverse, mesh.vertices[:, i]) for i in range(3)], axis=1) / count
    colors = np.asarray(mesh.visual.vertex_colors)[first]
    return trimesh_package().Trimesh(middles, faces, vertex_colors=colors, process=False)


def _clustered(mesh: Any, cell: float) -> tuple[tuple[Indices, Indices], Indices]:
    """(a point of each cell, the cell of each point), and the triangles between cells, each once."""
    grid = ((mesh.vertices - mesh.bounds[0]) / cell).astype(np.int64)
    _, first, inverse = np.unique(grid @ [1, 10**6, 10**12], return_index=True, return_inverse=True)
    faces = inverse.reshape(-1)[mesh.faces]
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    low, middle, high = np.sort(faces, axis=1).T
    _, keep = np.unique((low * len(first) + middle) * len(first) + high, return_index=True)
    return (first, inverse.reshape(-1)), faces[np.sort(keep)]
