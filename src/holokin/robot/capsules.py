"""Capsules for robots whose links have no shapes, such as those of DH tables; and obstacles around a robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError, UnknownNameError
from ..base.poses import pose_from
from ..base.types import ArrayLike, Matrix, Vector, finite, positive
from .composition import pose_matrix
from .joints import joints_above
from .model import Robot
from .shapes.link_shapes import Capsule, LinkShape, Shape

SLENDER = 20.0
"""Length of an arm over the radius of its capsules: 7 cm for a Panda, 6 cm for a UR5e."""

BASE = "base"
"""The name of what stands still, where a robot has no names of links."""

_SHORTEST = 1e-6
"""Distance [m] of two frames below which there is no link between them."""


@typed
def with_capsules(robot: Robot, radius: float | Mapping[str, float] | None = None) -> Robot:
    """The robot with capsules for links, along the lines from each joint's frame to the next ones and to the tips.

    The capsule of a link has the name of the joint that moves it, "base" for the one that stands still. Links that
    have shapes already keep them, but for those that could not be read where `radius` names the capsule in their place.
    What is between a slider and the joint before it has no capsule. A base begins where the robot is mounted, and a
    tool where the arm ends: both leave all other capsules as they are. What the robot stands on is no part of it, see
    `obstacle`. Where several arms stand side by side, each has a base of its own, "base", and "base of JOINT" of the
    others.

    Args:
        radius: of all capsules [m], or by name, where those left out have the default: a twentieth of `chain_length`.

    Raises:
        UnknownNameError: a name that no link has. ArgumentError: a bad radius, or a robot without links.
    """
    robot.check_links()
    lines = link_lines(robot)
    names = tuple(dict.fromkeys([BASE, *(joint.name for joint in robot.joints), *(line.link for line in lines)]))
    given = dict(radius) if isinstance(radius, Mapping) else {}
    for name, value in given.items():
        if name not in names:
            raise UnknownNameError("link", name, names)
        positive(f"the radius of {name}", value)
    rest = positive("radius", radius) if isinstance(radius, float | int) else chain_length(robot) / SLENDER
    carriers = [BASE, *(joint.name for joint in robot.joints)]  # of joint -1 and of each joint
    own = [shape for shape in robot.shapes if not shape.obstacle]
    unread = [shape for shape in own if given and carriers[shape.joint + 1] in given and shape.shape.fault]
    shaped = {shape.joint for shape in own} - {shape.joint for shape in unread}
    bare = [line for line in lines if line.joint not in shaped and np.linalg.norm(line.end - line.start) >= _SHORTEST]
    clad = {(line.link, line.joint) for line in bare}
    added = []
    for line in bare:
        r = given.get(line.link, rest)
        if not r > 0:
            raise ArgumentError("the length of the chain", 0.0, "give radius=")
        parent = _parent(line.joint, lines, clad, shaped)
        added.append(LinkShape(line.link, line.joint, *between(line.start, line.end, r), parent=parent))
    replaced = {shape.joint for shape in added}
    kept = [shape for shape in robot.shapes if not (shape.joint in replaced and shape in unread)]
    return replace(robot, shapes=(*kept, *added))


def _parent(joint: int, lines: Sequence[Line], clad: Set[tuple[str, int]], shaped: Set[int]) -> str | None:
    """The nearest link with a capsule above a joint's, "" where there is none; None where other shapes are nearer."""
    while joint >= 0:
        line = lines[joint]  # the one that leads to this joint
        joint = line.joint
        if (line.link, joint) in clad:
            return line.link
        if joint in shaped:
            return None
    return ""


@typed
def chain_length(robot: Robot) -> float:
    """Sum of the distances [m] from frame to frame on the way from the base to the first tip, sliders at zero.

    It counts from where the robot is mounted to where the arm ends, without a tool of `with_tool`.

    Raises:
        ArgumentError: a robot without links.
    """
    tip = robot.tip()
    total = float(np.linalg.norm(tip.arm_end))
    for index in joints_above(robot.joints, tip.joint):
        total += float(np.linalg.norm(robot.joints[index].step))
    return total


def between(start: Vector, end: Vector, radius: float) -> tuple[Matrix, Capsule]:
    """A capsule from one point to another, and where it is."""
    step = end - start
    length = float(np.linalg.norm(step))
    z = step / length if length > 0 else np.array([0.0, 0.0, 1.0])
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= np.linalg.norm(x)
    return pose_from((start + end) / 2, np.column_stack([x, np.cross(z, x), z])), Capsule(radius, length)


class Line(NamedTuple):
    """The line along a link, start (3,) to end (3,) [m] in the frame of its joint (-1: the base)."""

    link: str
    joint: int
    start: Vector
    end: Vector


def link_lines(robot: Robot) -> list[Line]:
    """The lines of all links: those to each joint, in their order, then to where the arm ends and from there along a
    tool, or in one where the tool goes straight on.

    A base begins at its foot. A tip that is fixed to the base is the end of no link.
    """
    found, feet = [], list[tuple[Vector, str]]()
    for joint in robot.joints:
        link = robot.joints[joint.parent].name
        if joint.parent < 0:
            new = BASE if not feet else f"{BASE} of {joint.name}"
            same = (name for foot, name in feet if np.linalg.norm(foot - joint.start) < _SHORTEST)
            link = next(same, new)
            feet.append((joint.start, link))
        found.append(Line(link, joint.parent, joint.start, joint.placement[:3, 3]))
    for tip in robot.tips:
        if tip.joint >= 0:
            link, points = robot.joints[tip.joint].name, [np.zeros(3), tip.arm_end, tip.placement[:3, 3]]
            if _on_the_way(points[1], points[2]):
                del points[1]
            found += [Line(link, tip.joint, *ends) for ends in pairwise(points)]
    return found


def _on_the_way(point: Vector, end: Vector) -> bool:
    """Whether a point (3,) is on the line from the origin to an end (3,)."""
    length = float(np.linalg.norm(end))
    along = float(point @ end) / length if length else 0.0
    off = point - along * end / length if length else point
    return bool(np.linalg.norm(off) < _SHORTEST and 0 <= along <= length)


@typed
def with_shape(
    robot: Robot, name: str, shape: Shape, xyz: ArrayLike = (0, 0, 0), rpy: ArrayLike = (0, 0, 0), *,
    tip: str | None = None,
) -> Robot:  # fmt: skip
    """The robot with a shape on a tip, such as that of its tool, at xyz (3,) [m], rpy (3,) [rad] in the tip's frame.

    A robot whose links have no shapes gets capsules first, as of `with_capsules`.

    Args:
        name: what the shape is called in findings.
        tip: the tip that carries it, by default the first.

    Raises:
        UnknownNameError: no such tip. ArgumentError, ShapeError, NotFiniteError.
    """
    end = robot.tip(tip)
    placed = end.placement @ pose_matrix(finite("xyz of a shape", xyz, (3,)), finite("rpy of a shape", rpy, (3,)))
    clad = with_capsules(robot) if all(known.obstacle for known in robot.shapes) else robot
    return replace(clad, shapes=(*clad.shapes, LinkShape(name, end.joint, placed, shape, carried=True)))


@typed
def obstacle(name: str, shape: Shape, xyz: ArrayLike = (0, 0, 0), rpy: ArrayLike = (0, 0, 0)) -> LinkShape:
    """A shape that stands still at xyz (3,) [m], rpy (3,) [rad] in the frame of a robot's base.

    Raises:
        ArgumentError, ShapeError, NotFiniteError.
    """
    T: Matrix = pose_matrix(finite("xyz of an obstacle", xyz, (3,)), finite("rpy of an obstacle", rpy, (3,)))
    return LinkShape(name, -1, T, shape, obstacle=True)
