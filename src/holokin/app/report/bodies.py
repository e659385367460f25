"""A robot as solids: links as rods with thickness or by the shapes of its model, hinges, rails, base and tool frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import final

import numpy as np

from ...base.poses import pose_from
from ...base.types import Matrix, Vector
from ...robot import Box, Capsule, Cylinder, Hull, LinkShape, Mesh, Robot, Shape, chain_length
from ...robot.capsules import Line, between, link_lines
from ...robot.numeric import Frames, joint_frames, placed
from .palette import AXES, GREY, INK
from .solids import Block, Rod, Solid, tint

TAPER = 0.6
"""Thickness of the last link over that of the first."""

SLENDER = 26.0
"""Length of a robot's chain over the radius of its first link, where its model has no shapes."""

CORE = 0.4
"""Thickness of the rod inside a link that has shapes, which holds together those that do not touch."""

BEYOND = 0.15
"""How much of a rail is drawn beyond what the motion uses, at most, over the length of the robot."""

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
    found = [Piece(part, _role(part)) for part in shown]
    deep = _depths(robot)
    for line in _lines(robot, shown):
        index, step = line.joint, line.end - line.start
        if (index >= 0 or index not in shaped) and np.linalg.norm(step) > _SMALL:
            width = unit * (1 - (1 - TAPER) * (deep[index] if index >= 0 else 0.0))
            width *= CORE if index in shaped else 1.0
            plate = step * min(0.5, width / np.linalg.norm(step)) if index < 0 else 0.0  # it stands on it
            found.append(_piece(index, between(line.start + plate, line.end, width), "link"))
    for index, joint in enumerate(robot.joints):
        width = unit * (1 - (1 - TAPER) * deep[index])
        if joint.kind == "prismatic":
            found += _rail(robot, index, Q, 1.25 * width, index in shaped)
        elif index not in shaped and (joint.parent >= 0 or np.linalg.norm(joint.step) > width):
            half = 1.2 * width * joint.axis
            found.append(_piece(index, between(-half, half, 1.16 * width), "hinge"))
    first = [joint for joint in robot.joints if joint.parent < 0]
    if all(joint.kind != "prismatic" for joint in first) and -1 not in shaped:
        for foot in np.unique([joint.start for joint in first], axis=0):
            middle = pose_from(foot + [0.0, 0.0, 0.25 * unit])
            found.append(_piece(-1, (middle, Cylinder(2.4 * unit, 0.5 * unit)), "base"))
    return tuple(found)


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
    found = [*lines[:count], *(line for line in lines[count:] if line.joint not in tools)]
    return found + [Line("", joint, np.zeros(3), min(there, key=np.linalg.norm)) for joint, there in tools.items()]


def thickness(robot: Robot, Q: Matrix) -> float:
    """The radius [m] of a robot's first link: a share of the length of its chain, or of what its sliders travel."""
    length = chain_length(robot)
    if length < _SMALL:
        values = [np.ptp(Q[:, joint.coordinate]) for joint in robot.joints]
        length = max(float(max(values, default=0.0)), 1e-3)
    return length / SLENDER


def solids_at(
    pieces: Sequence[Piece], frames: Frames, k: int, color: str, *, still: bool = True
) -> list[Solid]:  # fmt: skip
    """A robot in a colour at posture k of its joints' frames, without what stands still, if asked."""
    looks = {
        "link": tint(color, white=0.42), "other": tint(color, white=0.22), "hinge": tint(color, ink=0.06),
        "base": tint(GREY, white=0.45), "tool": tint(INK, white=0.3),
        "rail": tint(GREY, white=0.35), "carriage": tint(color, ink=0.06),
    }  # fmt: skip
    return [
        replace(piece.solid, color=looks[piece.role]).moved(*_frame(frames, piece.joint, k))
        for piece in pieces
        if still or piece.joint >= 0
    ]


def tool_frames(robot: Robot, frames: Frames, k: int, size: float) -> list[Solid]:
    """The axes of every tip at posture k: x, y and z in the colours of `AXES`, rods of a length [m]."""
    found: list[Solid] = []
    for tip in robot.tips:
        p, R = placed(frames, tip.joint, tip.placement, len(frames[0][0]))
        found += triad(p[k], R[k], size)
    return found


def triad(p: Vector, R: Matrix, size: float) -> list[Solid]:
    """Three rods along the axes of a frame."""
    return [Rod(p, p + size * R[:, i], 0.075 * size, tint(color)) for i, color in enumerate(AXES)]


def wire(points: Matrix, radius: float, color: str, dash: int = 0) -> list[Solid]:
    """A polyline (k, 3) as thin rods; with a dash, that many of them are shown, then as many not."""
    paint = tint(color, white=0.12)
    return [
        Rod(a, b, radius, paint)
        for i, (a, b) in enumerate(pairwise(points))
        if not dash or i % (2 * dash) < dash
    ]  # fmt: skip


def standing(shapes: Sequence[LinkShape], color: str = GREY) -> list[Solid]:
    """Obstacles in the frame of the base, those that can be read."""
    paint = tint(color, white=0.25)
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
    spare = max(BEYOND * chain_length(robot), 4 * width)
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
