"""Pictures of robots: the side from which they are seen best, and everything in one picture as large as it can be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from ...base.poses import pose_from
from ...base.types import Matrix, Vector
from ...robot import Box, Capsule, Cylinder, Hull, LinkShape, Mesh, Robot, Shape, chain_length
from ...robot.links import Line, between, link_lines
from ...robot.tree import Frames, joint_frames, placed
from .plots import AXES, GREY, INK, rgb

# --- Solids seen without perspective: rods with round ends and convex blocks, shaded, the nearer before the farther.

Pixels = NDArray[Any]
"""What is known of each pixel: 32 bits are enough."""

LIGHT = np.array([-0.45, 0.62, 0.64]) / np.linalg.norm([-0.45, 0.62, 0.64])
"""Where the light comes from, in the axes of the eye: from the left, above and behind it."""

AMBIENT, DIFFUSE, GLOSS = 0.50, 0.50, 0.22
"""Shares of the light from everywhere, from the lamp, and of what shines."""

_SHADES = 512
"""Steps of brightness."""

_TILT = np.linspace(-1, 1, _SHADES)[:, None]
_LIGHT = AMBIENT + DIFFUSE * _TILT.clip(0) + 0.12 * _TILT.clip(-1, 0)
_SHINE = GLOSS * _TILT.clip(0) ** 12

_END_ON = 1e-6
"""Share of a rod's length that is seen, below which it is seen as a ball."""


@final
@dataclass(frozen=True, eq=False)
class Rod:
    """All points within `radius` of the segment from a (3,) to b (3,) [m]; a ball where they are one."""

    a: Vector
    b: Vector
    radius: float
    color: Vector

    def moved(self, p: Vector, R: Matrix) -> Rod:
        """The same in another frame."""
        return Rod(p + R @ self.a, p + R @ self.b, self.radius, self.color)

    def box(self) -> Matrix:
        """The least and the greatest (2, 3) of its points along each axis."""
        ends = np.array([self.a, self.b])
        return np.array([ends.min(axis=0) - self.radius, ends.max(axis=0) + self.radius])

    def depth(self, x: Pixels, y: Pixels) -> tuple[Pixels, Pixels, Pixels]:
        """(depth, brightness, cover 0 to 1) at pixels x, y; see `Block.depth`.

        The nearest point of all balls along the segment: that of the ball at s, where the surface is highest.
        """
        step = self.b - self.a
        length = float(np.linalg.norm(step))
        r = np.float32(self.radius)
        wx, wy = x - np.float32(self.a[0]), y - np.float32(self.a[1])
        seen = float(np.hypot(step[0], step[1])) / length if length > 0 else 0.0
        if seen < _END_ON:
            s = np.zeros_like(wx) if step[2] <= 0 else np.full_like(wx, length)
            ux, uy, k, near = 0.0, 0.0, np.sign(step[2]) if length > 0 else 0.0, wx * wx + wy * wy
        else:
            ux, uy, k = (float(v) for v in step / length)
            ex, ey = ux / seen, uy / seen
            along, across = wx * np.float32(ex) + wy * np.float32(ey), wy * np.float32(ex) - wx * np.float32(ey)
            h = np.sqrt(np.maximum(r * r - across * across, 0))
            s = np.clip((along + np.float32(k) * h) / np.float32(seen), 0, np.float32(length))
            off = along - np.clip(along, 0, np.float32(length * seen))
            near = across * across + off * off
        dx, dy = wx - s * np.float32(ux), wy - s * np.float32(uy)
        dz = np.sqrt(np.maximum(r * r - dx * dx - dy * dy, 0))
        depth = np.float32(self.a[2]) + s * np.float32(k) + dz
        tilt = (dx * np.float32(LIGHT[0]) + dy * np.float32(LIGHT[1]) + dz * np.float32(LIGHT[2])) / r
        return depth, tilt, r - np.sqrt(near)


@final
@dataclass(frozen=True, eq=False)
class Block:
    """A convex solid: all points x with normals (f, 3) @ x <= offsets (f,) [m], within a ball."""

    normals: Matrix
    offsets: Vector
    center: Vector
    reach: float
    color: Vector
    corners: Matrix = field(default_factory=lambda: np.zeros((0, 3)))

    def moved(self, p: Vector, R: Matrix) -> Block:
        """The same in another frame."""
        normals = self.normals @ R.T
        corners = p + self.corners @ R.T if len(self.corners) else self.corners
        return Block(normals, self.offsets + normals @ p, p + R @ self.center, self.reach, self.color, corners)

    def box(self) -> Matrix:
        """The least and the greatest (2, 3) of its points along each axis."""
        if len(self.corners):
            return np.array([self.corners.min(axis=0), self.corners.max(axis=0)])
        return np.array([self.center - self.reach, self.center + self.reach])

    def depth(self, x: Pixels, y: Pixels) -> tuple[Pixels, Pixels, Pixels]:
        """(depth, brightness, cover): towards the eye [m], cosine to the light, and how far inside the outline [m]."""
        n, h = self.normals.astype(np.float32), self.offsets.astype(np.float32)
        side = np.abs(n[:, 2]) <= 1e-5
        front, back = (n[:, 2] > 0) & ~side, (n[:, 2] < 0) & ~side
        flat = np.stack([x.ravel(), y.ravel(), np.ones(x.size, np.float32)])
        planes = np.column_stack([-n[:, :2], h])
        tops = (planes[front] / n[front, 2:]) @ flat
        which = tops.argmin(axis=0)
        top = np.take_along_axis(tops, which[None], axis=0)[0]
        bottom = ((planes[back] / n[back, 2:]) @ flat).max(axis=0)
        cover = top - bottom
        if side.any():
            cover = np.minimum(cover, (planes[side] @ flat).min(axis=0))
        tilt = (n[front] @ LIGHT.astype(np.float32))[which]
        return top.reshape(x.shape), tilt.reshape(x.shape), cover.reshape(x.shape)


Solid = Rod | Block


def _tint(color: str, white: float = 0.0, ink: float = 0.0) -> Vector:
    """A colour (3,), 0 to 1, mixed with shares of white and of black."""
    mixed = np.array(rgb(color)) / 255
    return mixed * (1 - white - ink) + white


@dataclass(frozen=True, eq=False)
class Window:
    """What is seen: from left, right, bottom, top [m] in the axes of the eye, in pixels (rows, columns)."""

    left: float
    right: float
    bottom: float
    top: float
    rows: int
    columns: int

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """As matplotlib takes it."""
        return self.left, self.right, self.bottom, self.top

    @property
    def pixel(self) -> float:
        """Size of a pixel [m]."""
        return (self.right - self.left) / self.columns


@dataclass(frozen=True, eq=False)
class Layer:
    """Solids drawn: colours (rows, columns, 3), cover (rows, columns), both 0 to 1, and depth [m], -inf for none.

    `extent`: the rows and columns beyond which nothing is covered.
    """

    color: Pixels
    cover: Pixels
    depth: Pixels
    extent: Any = np.s_[:, :]


def drawn(solids: Sequence[Solid], window: Window) -> Layer:
    """Solids in the axes of the eye, right, up, towards it; row 0 of the layer is at the top."""
    # Nothing, and the places of the pixels.
    shape, pixel = (window.rows, window.columns), window.pixel
    color = np.zeros((*shape, 3), np.float32)
    cover, depth = np.zeros(shape, np.float32), np.full(shape, -np.inf, np.float32)
    xs = (window.left + pixel * (np.arange(window.columns) + 0.5)).astype(np.float32)
    ys = (window.top - pixel * (np.arange(window.rows) + 0.5)).astype(np.float32)
    # Each solid over those behind it, box by box of those that hold it.
    for solid in sorted(solids, key=lambda solid: solid.box()[1, 2]):
        for low, high in _pieces(solid):
            i0 = max(int((window.top - high[1]) / pixel) - 1, 0)
            i1 = min(int((window.top - low[1]) / pixel) + 2, window.rows)
            j0 = max(int((low[0] - window.left) / pixel) - 1, 0)
            j1 = min(int((high[0] - window.left) / pixel) + 2, window.columns)
            if i0 >= i1 or j0 >= j1:
                continue
            pixels = np.s_[i0:i1, j0:j1]
            x, y = np.broadcast_arrays(xs[None, j0:j1], ys[i0:i1, None])
            z, tilt, inside = solid.depth(x, y)
            share = np.clip(inside * np.float32(1 / pixel) + np.float32(0.5), 0, 1)
            share *= z >= depth[pixels]
            known = cover[pixels]
            total = share + known * (1 - share)
            weight = share / np.maximum(total, np.float32(1e-6))
            # Colours (..., 3) of a surface by the cosine of its normal to the light.
            shade = ((tilt + np.float32(1)) * np.float32(_SHADES / 2)).astype(np.intp)
            paint = (_LIGHT * solid.color * (1 - _SHINE) + _SHINE).astype(np.float32).take(shade, axis=0, mode="clip")
            paint -= color[pixels]
            paint *= weight[..., None]
            color[pixels] += paint
            cover[pixels] = np.maximum(known, total)
            np.copyto(depth[pixels], z, where=share > 0.5)
    return Layer(color, cover, depth, _part(solids, window))


def _part(solids: Sequence[Solid], window: Window) -> Any:
    """The rows and columns of a picture that solids can be in."""
    if not len(solids):
        return np.s_[0:0, 0:0]
    boxes = np.array([solid.box()[:, :2] for solid in solids])
    low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    top, bottom = (int((window.top - y) / window.pixel) for y in (high[1], low[1]))
    left, right = (int((x - window.left) / window.pixel) for x in (low[0], high[0]))
    return np.s_[max(top - 2, 0) : max(bottom + 3, 0), max(left - 2, 0) : max(right + 3, 0)]


def _pieces(solid: Solid) -> list[tuple[Vector, Vector]]:
    """Boxes (low, high) that hold a solid: several for a long slanted rod, whose one box is mostly empty.

    They do not overlap: each is cut off where the next begins.
    """
    low, high = solid.box()
    if isinstance(solid, Block):
        return [(low, high)]
    step = np.abs(solid.b - solid.a)[:2]
    count = int(min(8, step.min() // (1.5 * solid.radius) + 1))
    if count < 2:
        return [(low, high)]
    axis = int(np.argmax(step))
    cuts = np.linspace(low[axis], high[axis], count + 1)
    direction = (solid.b - solid.a)[:2]
    slope = direction[1 - axis] / direction[axis]
    reach = solid.radius * float(np.hypot(1, slope))
    pieces = []
    for start, stop in pairwise(cuts):
        beside = solid.a[1 - axis] + slope * (np.array([start, stop]) - solid.a[axis])
        piece = np.array([low, high])
        piece[:, axis] = start, stop
        piece[0, 1 - axis] = max(low[1 - axis], beside.min() - reach)
        piece[1, 1 - axis] = min(high[1 - axis], beside.max() + reach)
        pieces.append((piece[0], piece[1]))
    return pieces


def over(below: Any, layer: Layer, alpha: float = 1.0, where: Any = None) -> Pixels:
    """Pictures (rows, columns, 4), 0 to 1, with a layer laid over them; `where`: the pixels that take it, and how."""
    picture, window = below.copy(), layer.extent
    share = layer.cover[window] * np.float32(alpha)
    if where is not None:
        share = share * where[window]
    part = picture[window]
    total = share + part[..., 3] * (1 - share)
    weight = share / np.maximum(total, np.float32(1e-6))
    part[..., :3] += weight[..., None] * (layer.color[window] - part[..., :3])
    part[..., 3] = total
    return picture


def onto(ground: Pixels, layer: Layer, alpha: float = 1.0, where: Any = None) -> None:
    """The same on a picture (rows, columns, 3) without holes, in its place."""
    share = layer.cover[layer.extent] * np.float32(alpha)
    if where is not None:
        share *= where[layer.extent]
    part = ground[layer.extent]
    part += share[..., None] * (layer.color[layer.extent] - part)


# --- A robot as solids: links as rods with thickness or by the shapes of its model, hinges, rails, base and tool frame.

TAPER = 0.6
"""Thickness of the last link over that of the first."""

DIRECTIONS = 120
"""Directions in which a shape is touched by planes: its outline in a picture is that of the solid between them."""

_SMALL = 1e-6


@final
@dataclass(frozen=True, eq=False)
class Piece:
    """A shape on a joint's moving side (joint -1: the base), and what it is: link, other link, hinge, rail."""

    part: LinkShape
    role: str

    @property
    def joint(self) -> int:
        """The joint that it moves with."""
        return self.part.joint

    @cached_property
    def solid(self) -> Solid:
        """The same for pictures, in the frame of its joint."""
        return block(self.part)


def pieces_of(robot: Robot, Q: Matrix) -> tuple[Piece, ...]:
    """What a robot is drawn by; rails are as long as the sliders' limits, or as the motion Q (k, n) needs."""
    if not robot.tips:
        return ()
    unit = thickness(robot, Q)
    shown = [part for part in robot.shapes if not part.obstacle and not part.shape.fault]
    shaped = {part.joint for part in shown if not part.carried}
    pieces = [Piece(part, _role(part)) for part in shown]
    deep = _depths(robot)
    for line in _lines(robot, shown):
        index, step = line.joint, line.end - line.start
        if (index >= 0 or index not in shaped) and np.linalg.norm(step) > _SMALL:
            width = unit * (1 - (1 - TAPER) * (deep[index] if index >= 0 else 0.0))
            # Thickness of the rod inside a link that has shapes, which holds together those that do not touch.
            width *= 0.4 if index in shaped else 1.0
            plate = step * min(0.5, width / np.linalg.norm(step)) if index < 0 else 0.0  # it stands on it
            pieces.append(_piece(index, between(line.start + plate, line.end, width), "link"))
    for index, joint in enumerate(robot.joints):
        width = unit * (1 - (1 - TAPER) * deep[index])
        if joint.kind == "prismatic":
            pieces += _rail(robot, index, Q, 1.25 * width, index in shaped)
        elif index not in shaped and (joint.parent >= 0 or np.linalg.norm(joint.step) > width):
            half = 1.2 * width * joint.axis
            pieces.append(_piece(index, between(-half, half, 1.16 * width), "hinge"))
    first = [joint for joint in robot.joints if joint.parent < 0]
    if all(joint.kind != "prismatic" for joint in first) and -1 not in shaped:
        for foot in np.unique([joint.start for joint in first], axis=0):
            middle = pose_from(foot + [0.0, 0.0, 0.25 * unit])
            pieces.append(_piece(-1, (middle, Cylinder(2.4 * unit, 0.5 * unit)), "base"))
    return tuple(pieces)


def _role(part: LinkShape) -> str:
    """What a shape of a robot is in a picture."""
    if part.carried:
        return "tool"
    return ("link", "other")[part.joint % 2] if part.joint >= 0 else "base"


def _lines(robot: Robot, shown: Sequence[LinkShape]) -> list[Line]:
    """The rods of a robot: those of `link_lines`, but a link that carries a tool ends in the tool, not at its tip."""
    tools: dict[int, list[Vector]] = {}
    for part in shown:
        if part.carried:
            tools.setdefault(part.joint, []).append(part.placement[:3, 3])
    lines, count = link_lines(robot), len(robot.joints)
    rods = [*lines[:count], *(line for line in lines[count:] if line.joint not in tools)]
    return rods + [Line("", joint, np.zeros(3), min(places, key=np.linalg.norm)) for joint, places in tools.items()]


def thickness(robot: Robot, Q: Matrix) -> float:
    """The radius [m] of a robot's first link: a share of the length of its chain, or of what its sliders travel."""
    length = chain_length(robot)
    if length < _SMALL:
        values = [np.ptp(Q[:, joint.coordinate]) for joint in robot.joints]
        length = max(float(max(values, default=0.0)), 1e-3)
    # Length of a robot's chain over the radius of its first link, where its model has no shapes.
    return length / 26.0


def solids_at(pieces: Sequence[Piece], frames: Frames, k: int, color: str, *, still: bool = True) -> list[Solid]:
    """A robot in a colour at posture k of its joints' frames, without what stands still, if asked."""
    looks = {"link": _tint(color, white=0.42), "other": _tint(color, white=0.22), "hinge": _tint(color, ink=0.06)}
    looks |= {"base": _tint(GREY, white=0.45), "tool": _tint(INK, white=0.3), "rail": _tint(GREY, white=0.35)}
    looks["carriage"] = looks["hinge"]
    return [
        replace(piece.solid, color=looks[piece.role]).moved(*_frame(frames, piece.joint, k))
        for piece in pieces
        if still or piece.joint >= 0
    ]


def tool_frames(robot: Robot, frames: Frames, k: int, size: float) -> list[Solid]:
    """The axes of every tip at posture k: x, y and z in the colours of `AXES`, rods of a length [m]."""
    rods: list[Solid] = []
    for tip in robot.tips:
        p, R = placed(frames, tip.joint, tip.placement, len(frames[0][0]))
        rods += triad(p[k], R[k], size)
    return rods


def triad(p: Vector, R: Matrix, size: float) -> list[Solid]:
    """Three rods along the axes of a frame."""
    return [Rod(p, p + size * R[:, i], 0.075 * size, _tint(color)) for i, color in enumerate(AXES)]


def wire(points: Matrix, radius: float, color: str, dash: int = 0) -> list[Solid]:
    """A polyline (k, 3) as thin rods; with a dash, that many of them are shown, then as many not."""
    paint = _tint(color, white=0.12)
    return [Rod(a, b, radius, paint) for i, (a, b) in enumerate(pairwise(points)) if not dash or i % (2 * dash) < dash]


def standing(shapes: Sequence[LinkShape], color: str = GREY) -> list[Solid]:
    """Obstacles in the frame of the base, those that can be read."""
    paint = _tint(color, white=0.25)
    return [replace(block(part), color=paint) for part in shapes if not part.shape.fault]


def posed(robot: Robot, Q: Matrix) -> Frames:
    """The joints' frames at postures (k, n)."""
    return joint_frames(robot, np.atleast_2d(Q))


def cloud(solids: Sequence[Solid]) -> Matrix:
    """Corners (k, 3) of what solids fill: nothing of them is farther out."""
    boxes = [solid.box() for solid in solids]
    return np.array([[b[i, 0], b[j, 1], b[k, 2]] for b in boxes for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def block(part: LinkShape) -> Solid:
    """A convex shape where it is: a rod, or what is between the planes that touch it in some directions."""
    shape, p, R = part.shape, part.placement[:3, 3], part.placement[:3, :3]
    if isinstance(shape, Capsule):
        end = np.array([0.0, 0.0, shape.length / 2])
        return Rod(-end, end, shape.radius, np.zeros(3)).moved(p, R)
    solid = shape.hull if isinstance(shape, Mesh) else shape
    center, reach = solid.ball
    normals = _directions(solid)
    return Block(normals, solid.support(normals), center, reach, np.zeros(3), _corners(solid)).moved(p, R)


def _corners(shape: Shape) -> Matrix:
    """Points (k, 3) that a solid is between; none, where a ball round it tells that well enough."""
    if isinstance(shape, Box):
        return np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * shape.sides / 2
    if isinstance(shape, Cylinder):
        ring = shape.radius * _ring()
        return np.vstack([ring + [0, 0, z] for z in (-shape.length / 2, shape.length / 2)])
    return shape.corners if isinstance(shape, Hull) else np.zeros((0, 3))


def _ring() -> Matrix:
    """Points (48, 3) of the circle of radius 1 round z."""
    turn = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    return np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])


def _directions(shape: Shape) -> Matrix:
    axes = np.vstack([np.eye(3), -np.eye(3)])
    if isinstance(shape, Box):
        return axes
    if isinstance(shape, Cylinder):
        return np.vstack([axes[[2, 5]], _ring()])
    k = np.arange(DIRECTIONS) + 0.5
    z, turn = 1 - 2 * k / DIRECTIONS, np.pi * (1 + 5**0.5) * k
    ring = np.sqrt(1 - z * z)
    return np.vstack([axes, np.column_stack([ring * np.cos(turn), ring * np.sin(turn), z])])


def _frame(frames: Frames, joint: int, k: int) -> tuple[Vector, Matrix]:
    if joint < 0:
        return np.zeros(3), np.eye(3)
    p, R = frames[joint]
    return p[k], R[k]


def _depths(robot: Robot) -> list[float]:
    """How far along its chain each joint is, 0 to 1."""
    steps: list[int] = []
    for joint in robot.joints:
        steps.append(1 + steps[joint.parent] if joint.parent >= 0 else 0)
    return [step / max(*steps, 1) for step in steps]


def _rail(robot: Robot, index: int, Q: Matrix, width: float, shaped: bool) -> list[Piece]:
    """A slider: the beam that it runs on, which does not move with it, and its carriage."""
    joint = robot.joints[index]
    values = joint.multiplier * np.atleast_2d(Q)[:, joint.coordinate] + joint.offset
    entry = robot.coordinates[joint.coordinate]
    ends = joint.multiplier * np.array([entry.lower, entry.upper]) + joint.offset
    low, high = float(ends.min()), float(ends.max())
    used = float(values.min()), float(values.max())
    # How much of a rail is drawn beyond what the motion uses, at most, over the length of the robot.
    spare = max(0.15 * chain_length(robot), 4 * width)
    low, high = max(low, used[0] - spare), min(high, used[1] + spare)
    T, _ = between(low * joint.axis, high * joint.axis, 1.0)
    beam = Box(np.array([1.1 * width, 1.1 * width, high - low + 2 * width]))
    rail = _piece(joint.parent, (joint.placement @ T, beam), "rail")
    if shaped:
        return [rail]
    T[:3, 3] = 0.0
    return [rail, _piece(index, (T, Box(np.array([2.2 * width, 2.2 * width, 2.4 * width]))), "carriage")]


def _piece(joint: int, placed_shape: tuple[Matrix, Shape], role: str) -> Piece:
    return Piece(LinkShape(role, joint, *placed_shape), role)


DETAIL = 150
"""Pixels for an inch of a picture."""

_COARSE = 4
"""Pixels to a side for one of the shadow."""

_SHADOW_PIXELS = 90
"""Of the longer side of the shadow, before it is softened."""


@final
@dataclass(frozen=True)
class View:
    """From where a scene is seen [degrees]: azimuth round z from x, height of the eye over the floor."""

    azimuth: float
    elevation: float

    @cached_property
    def axes(self) -> Matrix:
        """The axes of the eye (3, 3) in rows: right, up, towards it."""
        a, e = np.deg2rad(self.azimuth), np.deg2rad(self.elevation)
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        return np.array([right, np.cross(towards, right), towards])

    def seen(self, points: Matrix) -> Matrix:
        """Points (k, 3) in the axes of the eye."""
        return points @ self.axes.T

    def turned(self, solids: Sequence[Solid]) -> list[Solid]:
        """Solids in the axes of the eye."""
        zero = np.zeros(3)
        return [solid.moved(zero, self.axes) for solid in solids]


ABOVE = View(-90.0, 90.0)
"""From above, x to the right: for robots that move in a plane."""


def best_view(
    bodies: Sequence[Matrix], paths: Sequence[Matrix] = (), pairs: Sequence[tuple[Matrix, Matrix]] = ()
) -> View:
    """The view that shows best the robot's own plane, the area of the tool's loop, and how far two ends are apart.

    Args:
        bodies: points (k, 3) of the robot, at some postures each.
        paths: points (k, 3) of the tool's path.
        pairs: postures, points (k, 3) each, whose difference is to be seen.
    """
    # What is to be seen: the robot, the loop, the difference of postures.
    body = np.vstack([points - points.mean(axis=0) for points in bodies])
    middle = np.vstack(bodies).mean(axis=0)
    path = np.vstack(paths) if len(paths) else np.zeros((0, 3))
    loop = path - path.mean(axis=0) if len(path) else path
    gaps = np.vstack([first - second for first, second in pairs]) if len(pairs) else np.zeros((0, 3))
    # Heights of the eye over the floor that are looked from [degrees].
    views = [View(a, e) for e in (8.0, 16.0, 24.0, 34.0) for a in np.arange(-170.0, 190.0, 10.0)]
    # How large each is in a view, and how near the loop is to the eye.
    scores = np.zeros((4, len(views)))
    for i, view in enumerate(views):
        flat = view.seen(body)[:, :2]
        scores[0, i] = np.sqrt(max(np.linalg.det(flat.T @ flat), 0.0))
        if len(loop):
            ring = view.seen(loop)[:, :2]
            scores[1, i] = np.sqrt(np.sqrt(max(np.linalg.det(ring.T @ ring), 0.0)))
            scores[3, i] = float(view.axes[2] @ (path.mean(axis=0) - middle))
        if len(gaps):
            scores[2, i] = np.hypot(*view.seen(gaps)[:, :2].T).max()
    # The best by the sum of shares; an eye at 20 degrees is preferred.
    size = float(np.ptp(body, axis=0).max()) + 1e-12
    most = scores[:3].max(axis=1, keepdims=True)
    shares = scores[:3] / np.where(most > 1e-9 * size, most, np.inf)
    total = shares[0] + 0.9 * shares[1] + 0.4 * shares[2] + 0.25 * scores[3] / size
    total -= [0.15 * abs(view.elevation - 20.0) / 20.0 for view in views]
    return views[int(np.argmax(total))]


@final
@dataclass(frozen=True, eq=False)
class Scene:
    """What a panel shows: view, left, right, bottom, top [m] in the axes of the eye, floor z [m] (None: seen flat)."""

    view: View
    bounds: tuple[float, float, float, float]
    floor: float | None
    spread: Matrix

    @property
    def shape(self) -> tuple[float, float]:
        """Width and height [m]."""
        left, right, bottom, top = self.bounds
        return right - left, top - bottom

    def window(self, width: int) -> Window:
        """The picture in so many pixels of width."""
        left, right, bottom, top = self.bounds
        rows = max(2, round(width * (top - bottom) / (right - left)))
        return Window(left, right, bottom, top, rows, width)


def scene_of(
    view: View,
    solids: Sequence[Solid],
    *,
    flat: bool,
    ratio: tuple[float, float] = (0.6, 1.5),
    around: Sequence[Solid] = (),
) -> Scene:
    """The scene that holds solids, in the frame of the base, and little more.

    Args:
        around: solids that shall be seen as far as the others do not become much smaller for it.
        flat: seen from above, with the axes x and y.
        ratio: least and greatest height over width.
    """
    # The solids, and where they stand on the floor.
    points = cloud(solids)
    seen = cloud(view.turned(solids))
    low, high = seen[:, :2].min(axis=0), seen[:, :2].max(axis=0)
    floor = None if flat else min(0.0, float(points[:, 2].min()))
    if floor is not None:
        stand = points.copy()
        stand[:, 2] = floor
        low[1] = min(low[1], view.seen(stand)[:, 1].min())
    # What stands around, as far as there is room.
    if len(around):
        # Room for obstacles beside a robot, over its size in the picture: what is farther out is cut off.
        room = 0.25 * float((high - low).max())
        beside = cloud(view.turned(around))[:, :2]
        low = np.maximum(np.minimum(low, beside.min(axis=0)), low - room)
        high = np.minimum(np.maximum(high, beside.max(axis=0)), high + room)
        points = np.vstack([points, np.clip(cloud(around), points.min(axis=0) - room, points.max(axis=0) + room)])
    # A margin, and a height over width that is allowed.
    pad = 0.03 * float((high - low).max())
    low, high = low - pad, high + pad
    width, height = high - low
    grow = np.array([max(height / ratio[1] - width, 0.0), max(width * ratio[0] - height, 0.0)]) / 2
    low, high = low - grow, high + grow
    spread = np.array([points[:, :2].min(axis=0), points[:, :2].max(axis=0)])
    return Scene(view, (low[0], high[0], low[1], high[1]), floor, spread)


def layer_of(scene: Scene, solids: Sequence[Solid], window: Window) -> Layer:
    """Solids, in the frame of the base, as they are seen."""
    return drawn(scene.view.turned(solids), window)


def empty(window: Window) -> Pixels:
    """A picture of nothing."""
    return np.zeros((window.rows, window.columns, 4), np.float32)


def shadowed(picture: Pixels, scene: Scene, window: Window, solids: Sequence[Solid]) -> Pixels:
    """A picture with the shadow of solids on the floor: of a lamp right above, soft."""
    if scene.floor is None or not len(solids):
        return picture
    from scipy.ndimage import gaussian_filter, map_coordinates

    low, high = scene.spread
    reach = 0.12 * float((high - low).max()) + 1e-3
    low, high = low - reach, high + reach
    columns = round(_SHADOW_PIXELS * (high[0] - low[0]) / max(high - low)) + 2
    rows = round(_SHADOW_PIXELS * (high[1] - low[1]) / max(high - low)) + 2
    above = Window(low[0], low[0] + columns * max(high - low) / _SHADOW_PIXELS, 0, 0, rows, columns)
    above = Window(above.left, above.right, high[1] - rows * above.pixel, high[1], rows, columns)
    cover = gaussian_filter(drawn(ABOVE.turned(solids), above).cover, 1.6)
    right, up, _ = scene.view.axes
    coarse = Window(*window.extent, window.rows // _COARSE + 1, window.columns // _COARSE + 1)
    xs = np.linspace(window.left, window.right, coarse.columns)
    ys = np.linspace(window.top, window.bottom, coarse.rows)
    u, v = np.meshgrid(xs, ys - scene.floor * up[2])
    place = np.linalg.inv(np.array([right[:2], up[:2]])) @ np.stack([u.ravel(), v.ravel()])
    pixel = np.array([(above.top - place[1]) / above.pixel - 0.5, (place[0] - above.left) / above.pixel - 0.5])
    dark = map_coordinates(cover, pixel, order=1).reshape(u.shape)
    rows = np.linspace(0, coarse.rows - 1, window.rows)
    columns = np.linspace(0, coarse.columns - 1, window.columns)
    fine = map_coordinates(dark, np.meshgrid(rows, columns, indexing="ij"), order=1).astype(np.float32)
    # Darkness of the shadow on the floor.
    return over(picture, Layer(np.zeros((*fine.shape, 3), np.float32), 0.16 * fine, fine))


def laid(picture: Pixels, layer: Layer, depth: Pixels, hidden: float = 0.25) -> Pixels:
    """A picture of solids of a depth with a layer in it: faint where it is behind them."""
    front = layer.depth >= depth - 1e-4
    return over(picture, layer, where=np.where(front, 1.0, hidden).astype(np.float32))


def outlined(picture: Pixels, layer: Layer, color: str, beneath: Layer, fill: float = 0.3) -> Pixels:
    """A picture with the outline of a layer in it, and its surface, faint, where it is not over what is beneath."""
    from scipy.ndimage import gaussian_filter

    soft = gaussian_filter(layer.cover, 1.6)
    line = np.exp(-(((soft - 0.45) / 0.3) ** 2)).astype(np.float32)
    line[soft < 0.02] = 0
    paint = np.broadcast_to(_tint(color, ink=0.1).astype(np.float32), (*soft.shape, 3))
    return over(over(picture, layer, fill, 1 - beneath.cover), Layer(paint, line, layer.depth))


def show(axes: Any, scene: Scene, picture: Pixels, window: Window) -> Any:
    """A picture in Axes, with its floor, or with the axes x and y where the scene is seen from above."""
    axes.imshow(np.clip(picture, 0, 1), extent=window.extent, interpolation="antialiased", zorder=2, aspect="equal")
    axes.set_xlim(window.left, window.right)
    axes.set_ylim(window.bottom, window.top)
    if scene.floor is None:
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
        return axes
    axes.set_axis_off()
    return _floor(axes, scene)


def _floor(axes: Any, scene: Scene) -> Any:
    """Lines on the floor, at round distances."""
    from matplotlib.collections import LineCollection

    low, high = scene.spread
    step = _squares(scene)
    first, last = np.floor(low / step) * step, np.ceil(high / step) * step
    ends = [
        *(([x, first[1]], [x, last[1]]) for x in np.arange(first[0], last[0] + step / 2, step)),
        *(([first[0], y], [last[0], y]) for y in np.arange(first[1], last[1] + step / 2, step)),
    ]
    lines = [scene.view.seen(np.column_stack([np.array(pair), np.full(2, scene.floor)]))[:, :2] for pair in ends]
    axes.add_collection(LineCollection(lines, colors="#dfe2e7", linewidths=0.8, zorder=1))
    return axes


def named_axes(axes: Any, scene: Scene, size: float, cover: Pixels, window: Window) -> bool:
    """The names of the base's axes beyond the ends of its rods, where nothing covers them.

    Returns:
        Whether one of them is in the corner at the right below.
    """
    wide, tall, covered = window.right - window.left, window.top - window.bottom, False
    for name, axis in zip("xyz", np.eye(3), strict=True):
        flat = scene.view.seen(axis[None])[0][:2]
        short = float(np.hypot(*flat))
        if short <= 0.2:
            continue
        # Way from the end of a base's axis to its name, at least, over the width of the picture.
        x, y = (size + max(0.2 * size, 0.042 * wide / short)) * flat
        row, column = int((window.top - y) / window.pixel), int((x - window.left) / window.pixel)
        if 0 <= row < window.rows and 0 <= column < window.columns and cover[row, column] < 0.5:
            axes.text(x, y, name, fontsize=7.5, color=INK, ha="center", va="center", zorder=6)
            covered = covered or (x > window.left + 0.5 * wide and y < window.bottom + 0.1 * tall)
    return covered


def floor_scale(axes: Any, scene: Scene, *, left: bool = False) -> Any:
    """How large the squares on the floor are, in the corner at the right below, or at the left."""
    look = {"transform": axes.transAxes, "va": "bottom", "fontsize": 7.5, "color": "#6b7280", "zorder": 6}
    words = f"floor: {_squares(scene):g} m squares"
    axes.text(0.005 if left else 0.995, 0.0, words, ha="left" if left else "right", **look)
    return axes


def _squares(scene: Scene) -> float:
    """The side of the squares on the floor [m]."""
    # The nearest of 1, 2, 5 times a power of ten, from below.
    value = float(np.ptp(scene.spread, axis=0).max()) / 5
    power = 10.0 ** np.floor(np.log10(max(value, 1e-9)))
    return float(power * max(k for k in (1, 2, 5) if k * power <= value * 1.0000001))
