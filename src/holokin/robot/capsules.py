"""Capsules for robots whose links have no shapes, such as those of DH tables; and obstacles around a robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..base.arguments import typed
from ..base.poses import pose_from
from ..base.types import ArrayLike, Matrix, Vector, finite, positive
from ..errors import ArgumentError, UnknownNameError
from .composition import pose_matrix
from .joints import joints_above
from .link_shapes import Capsule, LinkShape, Shape
from .model import Robot

SLENDER = 20.0
"""Length of an arm over the radius of its capsules: 7 cm for a Panda, 7 cm for a UR5e."""

BASE = "base"
"""The name of what stands still, where a robot has no names of links."""

_SHORTEST = 1e-6
"""Distance [m] of two frames below which there is no link between them."""


@typed
def with_capsules(robot: Robot, radius: float | Mapping[str, float] | None = None) -> Robot:
    """The robot with capsules for links, along the lines from each joint's frame to the next ones and to the tips.

    The capsule of a link has the name of the joint that moves it, "base" for the one that stands still. Links that
    have shapes already keep them, but for those that could not be read where `radius` names the capsule in their place.
    What is between a slider and the joint before it has no capsule.

    Args:
        radius: of all capsules [m], or by name, where those left out have the default: a twentieth of the length of
            the chain, the sum of the distances from frame to frame on the way to the first tip.

    Raises:
        UnknownNameError: a name that no link has. ArgumentError: a bad radius, or a robot without links.
    """
    robot.check_links()
    steps = link_steps(robot)
    names = {-1: BASE} | {i: joint.name for i, joint in enumerate(robot.joints)}
    given = dict(radius) if isinstance(radius, Mapping) else {}
    for name, value in given.items():
        if name not in names.values():
            raise UnknownNameError("link", name, tuple(names.values()))
        positive(f"the radius of {name}", value)
    rest = positive("radius", radius) if isinstance(radius, float | int) else chain_length(robot) / SLENDER
    own = [shape for shape in robot.shapes if not shape.obstacle]
    unread = [s for s in own if given and names[s.joint] in given and s.shape.fault]
    shaped = {shape.joint for shape in own} - {shape.joint for shape in unread}
    added = []
    for index, step in steps:
        r = given.get(names[index], rest)
        if index in shaped or np.linalg.norm(step) < _SHORTEST:
            continue
        if not r > 0:
            raise ArgumentError("the length of the chain", 0.0, "give radius=")
        added.append(LinkShape(names[index], index, *between(np.zeros(3), step, r)))
    clad = {shape.joint for shape in added}
    kept = [shape for shape in robot.shapes if not (shape.joint in clad and shape in unread)]
    return replace(robot, shapes=(*kept, *added))


@typed
def chain_length(robot: Robot) -> float:
    """Sum of the distances [m] from frame to frame on the way from the base to the first tip, sliders at zero.

    Raises:
        ArgumentError: a robot without links.
    """
    tip = robot.tip()
    total = float(np.linalg.norm(tip.placement[:3, 3]))
    for index in joints_above(robot.joints, tip.joint):
        total += float(np.linalg.norm(robot.joints[index].placement[:3, 3]))
    return total


def between(start: Vector, end: Vector, radius: float) -> tuple[Matrix, Capsule]:
    """A capsule from one point to another, and where it is."""
    step = end - start
    length = float(np.linalg.norm(step))
    z = step / length if length > 0 else np.array([0.0, 0.0, 1.0])
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= np.linalg.norm(x)
    return pose_from((start + end) / 2, np.column_stack([x, np.cross(z, x), z])), Capsule(radius, length)


def link_steps(robot: Robot) -> list[tuple[int, Vector]]:
    """(joint, step (3,) in its frame) to every frame that hangs on it: of the joints after it, and of tips."""
    found = [(joint.parent, joint.placement[:3, 3]) for joint in robot.joints]
    return found + [(tip.joint, tip.placement[:3, 3]) for tip in robot.tips]


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
