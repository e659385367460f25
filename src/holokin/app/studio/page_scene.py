"""What stands in the page: the robot, a translucent ghost for each strategy, lines, traces, floor and camera."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from ...base.errors import RobotFileError
from ...base.extra_module import extra_module
from ...base.poses import pose_from
from ...base.types import Array, ArrayLike, Indices, Matrix, Value, Vector
from ...robot import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    Hull,
    LinkShape,
    Mesh,
    Robot,
    Shape,
    Surface,
    Tip,
    chain_length,
    reach,
)
from ...robot.tree import Frames, joint_frames
from ..report.plots import LOOP, START, rgb
from ..report.robot_view import pieces_of

# --- The links of a robot as triangles to look at: its own meshes, or capsules where it has none that can be read.

SOLID = 200_000  # triangles of all links together that are drawn of one robot at most
GHOST = 20_000  # the same of each ghost: 60 of them are drawn at once
# colours of the rods that stand for links, and of all else that has no mesh: light and dark grey
LINK, JOINT = (226, 229, 234), (96, 104, 117)
TOOL, THING = (74, 80, 92), (196, 180, 150)  # colours of the tools that robots carry, and of what stands around them
_SHARP = np.deg2rad(30.0)  # edges that are sharper than this are drawn as edges, others as round


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
    merged, sentences = _meshes_by_joint(robot)
    count = sum(len(mesh.faces) for mesh in merged.values())
    share = min(1.0, most / count) if count else 1.0
    return tuple(_look(joint, mesh, share) for joint, mesh in merged.items()), sentences


@lru_cache(maxsize=2)
def _meshes_by_joint(robot: Robot) -> tuple[dict[int, Any], tuple[str, ...]]:
    """Joint -> all that it carries as one mesh, as fine as it is; and what could not be read."""
    parts: dict[int, list[Any]] = {}
    sentences: list[str] = []
    for visual in robot.visuals:
        try:
            mesh = _mesh(visual.shape, visual.color)
        except RobotFileError as problem:
            sentences.append(f"{visual.link} is drawn as a capsule: {problem.fact} ({problem.path})")
            continue
        mesh.apply_transform(visual.placement)
        parts.setdefault(visual.joint, []).append(mesh)
    for joint, capsules in _capsules(robot).items():
        parts.setdefault(joint, capsules)
    for part in robot.shapes:
        if part.carried and not part.shape.fault:
            parts.setdefault(part.joint, []).append(_shape_mesh(part, TOOL))
    merged = {joint: trimesh_package().util.concatenate(meshes) for joint, meshes in sorted(parts.items())}
    for mesh in merged.values():
        mesh.merge_vertices(merge_norm=True, merge_tex=True)
    return merged, tuple(dict.fromkeys(sentences))


def frames_of(robot: Robot, Q: Matrix) -> tuple[Matrix, Array]:
    """Positions (j + 1, k, 3) and quaternions w, x, y, z (j + 1, k, 4) of the base and all joints, at Q (k, n)."""
    frames: Frames = [(np.zeros((len(Q), 3)), np.broadcast_to(np.eye(3), (len(Q), 3, 3))), *joint_frames(robot, Q)]
    positions, rotations = (np.stack([frame[i] for frame in frames]) for i in (0, 1))
    return positions, quaternions(rotations)


def quaternions(rotations: Array) -> Array:
    """w, x, y, z (..., 4) of rotations (..., 3, 3)."""
    from scipy.spatial.transform import Rotation

    turns = Rotation.from_matrix(rotations.reshape(-1, 3, 3)).as_quat(scalar_first=True)
    return turns.reshape(*rotations.shape[:-2], 4)


def _mesh(shape: Shape | Surface, color: Any = None) -> Any:
    """A shape as a trimesh.Trimesh with a colour for each point. Raises: RobotFileError, also of what is not read."""
    tm = trimesh_package()
    match shape:
        case Mesh():
            mesh = tm.Trimesh(*shape.triangles, process=True)
        case Surface():
            mesh = tm.Trimesh(shape.points, shape.triangles, process=True)
        case Box():
            mesh = tm.creation.box(extents=shape.sides)
        case Cylinder():
            mesh = tm.creation.cylinder(radius=shape.radius, height=shape.length, sections=32)
        case Capsule():
            mesh = tm.creation.capsule(height=shape.length, radius=shape.radius, count=[24, 24])
            mesh.apply_translation(-mesh.bounds.mean(axis=0))
        case Ellipsoid():
            mesh = tm.creation.icosphere(subdivisions=3)
            mesh.apply_scale(shape.radii)
        case Hull():
            mesh = tm.convex.convex_hull(shape.corners)
        case _:
            raise RobotFileError("the robot", "a shape that is not read", "draw it without")
    tint = LINK if color is None else tuple(int(255 * min(max(c, 0.0), 1.0)) for c in color[:3])
    mesh.visual = tm.visual.ColorVisuals(mesh, vertex_colors=np.tile([*tint, 255], (len(mesh.vertices), 1)))
    return mesh


def _capsules(robot: Robot) -> dict[int, list[Any]]:
    """Joint -> what stands for it, as in pictures; tools that links carry are not among it.

    A slider that goes farther than the arm reaches both ways stands for a base that drives: it has no rail. Under a
    robot with meshes is neither plate nor rail.
    """
    meshes: dict[int, list[Any]] = {}
    far = max(chain_length(robot), 1.0)
    Q = np.clip([robot.lower, robot.upper], -2 * far, 2 * far)
    tools = tuple(part for part in robot.shapes if part.carried)
    for piece in pieces_of(replace(robot, shapes=tools), Q):
        far_off = piece.part.shape.ball[1] > far
        if piece.role == "tool" or (piece.role in ("base", "rail") and (robot.visuals or far_off)):
            continue
        color = LINK if piece.role == "link" else JOINT
        meshes.setdefault(piece.joint, []).append(_shape_mesh(piece.part, color))
    return meshes


def _shape_mesh(part: LinkShape, color: tuple[int, int, int]) -> Any:
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


TINT = 0.75  # share of the strategy's colour in the solid robot; the rest is its own, which tells its parts apart
# of a ghost that stands well away from the robot: less, and the colours of both mix to one that is in no legend
OPACITY = 0.9
APART = 0.03  # distance [rad or m] to the robot at which a ghost has its name; a link this far away [m] is fully seen
# distance [m] to the robot's own link below which a ghost's link is not drawn: two surfaces in one place flicker
TOUCHING = 0.003
# distance [m] below which of two ghosts' links only the first is drawn; up to TOUCHING the other comes in softly
SAME = 0.001
FOV = np.deg2rad(40.0)  # of the camera, upright: as of a 50 mm lens

_PLAIN_ADDRESS = (
    'const at = new URL(location.href); at.searchParams.delete("websocket"); history.replaceState(null, "", at.href);'
)

_NO_SHADOW = {"cast_shadow": False, "receive_shadow": False}
# colours of the floor, its lines, and what is behind all: darker than a white robot
_FLOOR = (214, 221, 230)
_CELL, _SECTION = (196, 205, 216), (170, 181, 195)
_SKY = (198, 208, 219)


def viser_package() -> Any:
    """The module viser. Raises: MissingExtraError."""
    return extra_module("viser", "studio")


@contextmanager
def silent_viser() -> Iterator[None]:
    """viser prints by the console that rich shares; while this lasts, that says nothing. Other prints are heard."""
    import rich

    console = rich.get_console()
    before, console.quiet = console.quiet, True
    try:
        yield
    finally:
        console.quiet = before


def name_tab(server: Any, title: str) -> None:
    """The title of the tab of all browsers, and its address without what viser adds.

    viser has no call for it; without its message the title is viser's.
    """
    try:
        from viser._messages import RunJavascriptMessage

        server.gui._websock_interface.queue_message(
            RunJavascriptMessage(source=f"document.title = {json.dumps(title)};{_PLAIN_ADDRESS}")
        )
    except (ImportError, AttributeError):
        return


class Scene:
    """The three-dimensional part of the page, of one robot. All it is told are joints and poses.

    Args:
        server: a viser.ViserServer; whatever is drawn is shared by all its browsers.
        robot: what is drawn, with its own meshes, or capsules where it has none.
        q: the posture to begin with (n,) [rad or m].
        triangles: of the robot's links together at most, about.

    Raises:
        MissingExtraError: trimesh is not installed.
    """

    def __init__(self, server: Any, robot: Robot, q: ArrayLike, triangles: int = SOLID):
        self.server, self.robot = server, robot
        self.looks, self.remarks = looks_of(robot, triangles)
        self.q0 = np.asarray(q, dtype=float)
        self.lead = 0
        self.colors: tuple[str, ...] = ()
        self.names: tuple[str, ...] = ()
        self._solid: list[Any] = []
        self._ghosts: list[Any] = []
        self._start: list[Any] = []
        self._labels: list[Any] = []
        self._lines: dict[str, tuple[Any, str]] = {}
        self._joints: Indices = np.array([look.joint + 1 for look in self.looks])
        self._scales = np.zeros(0)
        self._sizes = [float(np.linalg.norm(look.points, axis=1).max()) for look in self.looks]
        self._elbow = elbow_joint(robot, self.q0)
        self._floor()

    def set_strategies(self, names: Sequence[str], colors: Sequence[str], lead: int = 0) -> None:
        """A robot for each strategy in its colour (#RRGGBB): that of the `lead` solid, the others as ghosts."""
        self.names, self.colors = tuple(names), tuple(colors)
        for handle in [*self._ghosts, *self._labels, *(line for line, _ in self._lines.values())]:
            handle.remove()
        self._ghosts, self._labels, self._lines = [], [], {}
        tints = linear([rgb(color) for color in self.colors])
        count = len(tints)
        for look in looks_of(self.robot, GHOST)[0] if count else ():
            ghost = self.server.scene.add_batched_meshes_simple(
                f"/ghosts/{look.joint + 1}", look.points, look.triangles, np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
                np.zeros((count, 3)), batched_colors=tints, batched_opacities=np.zeros(count),
                batched_scales=np.zeros(count), opacity=1.0, lod="off", **_NO_SHADOW,
            )  # fmt: skip
            self._ghosts.append(ghost)
        for index, name in enumerate(self.names if count <= _LABELLED and any(self.names) else ()):
            label = self.server.scene.add_label(f"/names/{index}", name, anchor="bottom-center", visible=False)
            self._labels.append(label)
        self._scales = 0.996 - 0.002 * (np.arange(count) % 6)  # within one another, where two stand in one place
        self.set_lead(lead)
        self.show(np.tile(self.q0, (count, 1)))

    def set_lead(self, index: int) -> None:
        """Draw the robot of another strategy solid; where it stands is told by `show`."""
        self.lead = index
        self._solid = [self._solid_part(look, rgb(self.colors[index])) for look in self.looks]

    def show(self, Q: ArrayLike) -> None:
        """The robots of all strategies at their postures Q (k, n) [rad or m]."""
        lead = self.lead
        positions, turns = frames_of(self.robot, np.asarray(Q, dtype=float))
        elbows = positions[self._elbow + 1]
        with self.server.atomic():
            for handle, frame in zip(self._solid, self._joints, strict=True):
                handle.position, handle.wxyz = positions[frame, lead], turns[frame, lead]
            for handle, frame, size in zip(self._ghosts, self._joints, self._sizes, strict=True):
                opacity = seen(positions[frame], turns[frame], lead, size)
                handle.batched_positions, handle.batched_wxyzs = positions[frame], turns[frame]
                handle.batched_opacities = opacity.astype(np.float32)
                handle.batched_scales = ((opacity > 0) * self._scales).astype(np.float32)
            for index, label in enumerate(self._labels):
                label.visible = bool(np.linalg.norm(elbows[index] - elbows[lead]) > APART)
                label.position = elbows[index] + [0.0, 0.0, _ABOVE]

    def show_start(self, q: ArrayLike | None) -> None:
        """A pale pink ghost at the posture from which the strategies started (n,), or none."""
        for handle in self._start:
            handle.remove()
        self._start = []
        if q is None:
            return
        positions, turns = frames_of(self.robot, np.asarray(q, dtype=float)[None])
        tint: dict[str, Any] = {"color": rgb(START), "opacity": 0.25, **_NO_SHADOW}
        for look in looks_of(self.robot, GHOST)[0]:
            frame = {"position": positions[look.joint + 1, 0], "wxyz": turns[look.joint + 1, 0]}
            name = f"/start/{look.joint + 1}"
            self._start.append(self.server.scene.add_mesh_simple(name, look.points, look.triangles, **tint, **frame))

    def stand(self, things: Sequence[LinkShape]) -> Matrix:
        """Draw what stands around the robot, and return points (k, 3) [m] round it: corners of boxes.

        Raises: RobotFileError, from a mesh that cannot be read.
        """
        corners = [np.zeros((0, 3))]
        for index, thing in enumerate(things):
            mesh = _shape_mesh(thing, THING)
            self.server.scene.add_mesh_simple(
                f"/things/{index}", mesh.vertices, mesh.faces, color=THING, flat_shading=True
            )
            corners.append(_corners(np.asarray(mesh.vertices)))
        return np.concatenate(corners)

    def path(self, points: ArrayLike, name: str = "loop", color: str = LOOP) -> None:
        """The line that the tool shall follow, through points (k, 3) [m]; fewer than two take it away."""
        self._line(f"/paths/{name}", np.asarray(points, dtype=float).reshape(-1, 3), color, 0.008)

    def trace(self, strategy: int, points: ArrayLike, part: str = "tool") -> None:
        """The line that a part of a strategy's robot went, through points (k, 3) [m]."""
        self._line(f"/traces/{part}/{strategy}", np.asarray(points, dtype=float), self.colors[strategy], 0.004)

    def points_of(self, Q: ArrayLike, tip: Tip | None = None) -> tuple[Matrix, Matrix]:
        """Where a tool (k, 3) and the elbow (k, 3) are at postures Q (k, n); the elbow moves most while tools stand."""
        positions, turns = frames_of(self.robot, np.asarray(Q, dtype=float))
        tip = self.robot._find_tip() if tip is None else tip
        rotations = rotations_of(turns[tip.joint + 1])
        return positions[tip.joint + 1] + rotations @ tip.placement[:3, 3], positions[self._elbow + 1]

    def ball(self, point: ArrayLike | None, color: str, name: str, radius: float = 0.015) -> None:
        """A small ball at a point (3,) [m], or None to take it away."""
        if point is None:
            self.server.scene.remove_by_name(f"/balls/{name}")
            return
        where = np.asarray(point, dtype=float)
        self.server.scene.add_icosphere(f"/balls/{name}", radius, color=rgb(color), position=where, cast_shadow=False)

    def cloud(self, points: ArrayLike, colors: ArrayLike, size: float = 0.008) -> None:
        """Points (k, 3) [m] with colours (k, 3), 0 to 255; none takes them away."""
        places = np.asarray(points, dtype=np.float32).reshape(-1, 3)
        if not len(places):
            self.server.scene.remove_by_name("/cloud")
            return
        tints = np.asarray(colors, dtype=np.uint8).reshape(-1, 3)
        self.server.scene.add_point_cloud("/cloud", places, tints, point_size=size, point_shape="circle")

    def drawn(self, q: ArrayLike | None = None) -> Matrix:
        """Points (k, 3) [m] round what is drawn of the robot at a posture, by default the first: corners of boxes."""
        posture = self.q0 if q is None else np.asarray(q, dtype=float)
        positions, turns = frames_of(self.robot, posture[None])
        rotations = rotations_of(turns[:, 0])
        ends = [
            positions[look.joint + 1, 0] + _corners(look.points) @ rotations[look.joint + 1].T for look in self.looks
        ]
        return np.concatenate(ends) if ends else np.zeros((1, 3))

    def look_at_all(self, more: ArrayLike = ()) -> None:
        """The camera sees the whole arm from the side, and more points (k, 3) [m]."""
        arm = self.drawn()
        low, high = arm.min(axis=0), arm.max(axis=0)
        points = np.vstack([arm, np.asarray(more, dtype=float).reshape(-1, 3)])
        tool = self.robot.pose(self.q0)[:3, 3] if self.robot.tips else (low + high) / 2
        ahead = float(np.arctan2(tool[1], tool[0])) if np.linalg.norm(tool[:2] - low[:2]) > 1e-6 else 0.0
        elevation = np.deg2rad(72.0 if self.robot.planar else 20.0)
        away = camera_axes(ahead - np.deg2rad(62.0), elevation)[2]
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        radius = float(np.linalg.norm(points - middle, axis=1).max())
        self.look_from(middle + radius / np.sin(FOV / 2) * away, middle)

    def look_from(self, place: Vector, look_at: Vector) -> None:
        """Where the cameras of all browsers are now, begin, and return to on "reset view"."""
        for camera in (self.server.initial_camera, *(client.camera for client in self.server.get_clients().values())):
            camera.position, camera.look_at, camera.fov, camera.near = place, look_at, FOV, 0.02

    def _floor(self) -> None:
        """Light from above and the sides, and a floor that is larger than the arm reaches."""
        scene, robot = self.server.scene, self.robot
        away = max(float(np.linalg.norm(joint.start)) for joint in robot.joints) if robot.tips else 0.0
        size = 2.0 * float(np.ceil(min(away + reach(robot), 20.0))) if robot.tips else 2.0
        height = min(0.0, float(self.drawn()[:, 2].min())) if robot.planar else 0.0
        scene.set_up_direction("+z")
        scene.configure_default_lights(False)
        scene.configure_environment_map(None)
        ground = (205, 210, 220)
        scene.add_light_hemisphere("/lights/sky", sky_color=(255, 255, 255), ground_color=ground, intensity=2.1)
        scene.add_light_directional("/lights/key", intensity=1.7, cast_shadow=True, position=(1.5, -2.0, 4.0))
        scene.add_light_directional("/lights/fill", intensity=0.5, position=(-2.0, 3.0, 2.0))
        lines = {"cell_size": 0.1, "cell_color": _CELL, "section_size": 0.5, "section_color": _SECTION}
        plane = {"plane_color": _FLOOR, "plane_opacity": 1.0, "shadow_opacity": 0.2, "fade_distance": 6.0 * size}
        scene.set_background_image(np.full((2, 2, 3), _SKY, dtype=np.uint8), format="png")
        scene.add_grid("/floor", size, size, position=(0.0, 0.0, height), **lines, **plane)

    def _solid_part(self, look: Look, color: tuple[int, int, int]) -> Any:
        """What a joint of the solid robot carries, in a colour that is mixed with its own; it is dull."""
        tm = trimesh_package()
        material = tm.visual.material.PBRMaterial(metallicFactor=0.0, roughnessFactor=0.7)
        visual = tm.visual.TextureVisuals(material=material)
        mixed = linear(TINT * np.array(color) + (1 - TINT) * look.colors)
        visual.vertex_attributes["color"] = np.column_stack([mixed, np.full(len(mixed), 255, dtype=np.uint8)])
        mesh = tm.Trimesh(look.points, look.triangles, visual=visual, process=False)
        _ = mesh.vertex_normals  # written only where they are known already; without them all is drawn flat
        return self.server.scene.add_mesh_trimesh(f"/robot/{look.joint + 1}", mesh, receive_shadow=False)

    def _line(self, name: str, points: Matrix, color: str, thickness: float) -> None:
        handle = self._lines.get(name)
        segments = np.stack([points[:-1], points[1:]], axis=1).astype(np.float32) if len(points) > 1 else None
        if segments is None:
            self.server.scene.remove_by_name(name)
            self._lines.pop(name, None)
        elif handle is None or handle[1] != color:
            line = self.server.scene.add_line_segments(name, segments, rgb(color), thickness=thickness)
            self._lines[name] = line, color
        else:
            handle[0].points = segments


_LABELLED = 6  # strategies at most that have their names beside their elbows: more names hide the robots
_ABOVE = 0.09  # how far a name stands above its elbow [m]


def camera_axes(azimuth: float, elevation: float) -> Matrix:
    """The axes (3, 3) of a camera, in rows: to the right, upwards, and away from what it looks at."""
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    away = np.array([*(np.cos(elevation) * np.array([np.cos(azimuth), np.sin(azimuth)])), np.sin(elevation)])
    return np.stack([right, np.cross(away, right), away])


def elbow_joint(robot: Robot, q: Vector) -> int:
    """The joint whose frame moves most while the tools stand still; -1 for a robot that cannot move so."""
    if not robot.tips:
        return len(robot.joints) - 1
    J = np.vstack([robot.jacobian(q, tip=tip.name) for tip in robot.tips])
    _, s, Vt = np.linalg.svd(J)
    rest = Vt[int((s > 1e-6 * s[0]).sum()) :]
    if not len(rest):
        return max(len(robot.joints) // 2 - 1, -1)
    step = 1e-4
    moved = np.concatenate([frames_of(robot, np.array([q + step * v, q - step * v]))[0] for v in rest], axis=1)
    lengths = np.linalg.norm(moved[:, ::2] - moved[:, 1::2], axis=2).max(axis=1)
    return int(np.argmax(lengths)) - 1


def seen(positions: Matrix, turns: Matrix, lead: int, size: float) -> Vector:
    """The opacity (k,) of a link of each ghost, of their frames (k, 3), (k, 4).

    None where it is within the robot's own, or where a ghost before it is.

    Args:
        size: distance [m] from the frame to the farthest point of the link.
    """
    turned = 2 * np.sqrt(np.clip(1 - (turns @ turns.T) ** 2, 0.0, 1.0))
    away = np.linalg.norm(positions[:, None] - positions, axis=2) + size * turned
    opacity = OPACITY * np.clip((away[lead] - TOUCHING) / (APART - TOUCHING), 0.0, 1.0) ** 0.5
    before = np.tri(len(away), k=-1, dtype=bool)  # of two ghosts in one place the first is drawn
    before[:, lead] = False
    nearest = np.where(before, away, np.inf).min(axis=1)
    return opacity * np.clip((nearest - SAME) / (TOUCHING - SAME), 0.0, 1.0)


def linear(colors: ArrayLike) -> Any:
    """Colours (..., 3), 0 to 255, as the page takes those of points and ghosts: by light."""
    share = np.asarray(colors, dtype=float).reshape(-1, 3) / 255
    light = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return np.round(255 * light).astype(np.uint8).reshape(np.shape(colors)[:-1] + (3,))


def rotations_of(turns: Matrix) -> Matrix:
    """Rotations (k, 3, 3) of quaternions w, x, y, z (k, 4)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(turns, scalar_first=True).as_matrix()


def pose_of(position: ArrayLike, wxyz: ArrayLike) -> Matrix:
    """The pose (4, 4) of a handle: where it is (3,) [m] and its quaternion w, x, y, z (4,)."""
    return pose_from(position, rotations_of(np.asarray(wxyz, dtype=float)[None])[0])


def wxyz_of(pose: Matrix) -> Vector:
    """The quaternion w, x, y, z (4,) of a pose (4, 4)."""
    return quaternions(pose[None, :3, :3])[0]


def _corners(points: Matrix) -> Matrix:
    low, high = points.min(axis=0), points.max(axis=0)
    return np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
