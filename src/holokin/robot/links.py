"""What the links of a robot weigh and look like: their bodies as one each, and capsules where nothing is known."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError
from ..base.types import Matrix, positive
from .capsules import chain_length, with_capsules
from .joints import Body, Joint
from .model import Robot
from .shapes.link_shapes import Capsule, LinkShape
from .tree import motion

THICKNESS = 0.04
"""Radius of a capsule over the length of the longest chain: 56 mm for a Panda, as its arm has."""

STUMP = 0.05
"""Radius [m] of the sphere that stands for a robot without any length, such as a single slider."""

DENSITY = 1000.0
"""Of capsules that stand for links [kg/m^3]: that of water. A Panda with its hand is 21 kg of it, the real
one weighs 18 kg."""

DENSEST = 1e6
"""Forty times the density of osmium, the densest of all solids [kg/m^3]: what is beyond was given in another unit."""


def size(part: LinkShape) -> tuple[float, float]:
    """(radius, length) of a capsule [m]. Raises: ArgumentError: another shape."""
    if not isinstance(part.shape, Capsule):
        raise ArgumentError("the shape of a drawn link", type(part.shape).__name__, "give a capsule")
    return part.shape.radius, part.shape.length


def solid(part: LinkShape, density: float) -> Body:
    """The mass and inertia of a capsule as a solid of even density [kg/m^3]."""
    r, h = size(part)
    cylinder, ball = density * np.pi * r**2 * h, density * 4 / 3 * np.pi * r**3
    across = cylinder * (3 * r**2 + h**2) / 12 + ball * (2 / 5 * r**2 + h**2 / 4 + 3 / 8 * h * r)
    along = cylinder * r**2 / 2 + ball * 2 / 5 * r**2
    R = part.placement[:3, :3]
    inertia = R @ np.diag([across, across, along]) @ R.T
    return Body(part.joint, cylinder + ball, part.placement[:3, 3], inertia)


def rest(joint: Joint) -> Matrix:
    """The placement (4, 4) of a joint with its offset in it."""
    return joint.placement @ motion(joint.kind, joint.axis, joint.offset)


def drawn_links(robot: Robot) -> tuple[LinkShape, ...]:
    """A capsule along every link, a drawing of it and not its shape, and a ball for each joint without one."""
    length = chain_length(robot)
    radius = THICKNESS * length if length else STUMP
    drawn = with_capsules(replace(robot, shapes=()), radius).shapes
    long = [part for part in drawn if part.shape.ball[1] > 1.25 * radius]  # others are lost in the next one
    bare = sorted(set(range(len(robot.joints))) - {part.joint for part in long})
    balls = [LinkShape(robot.joints[j].name, j, np.eye(4), Capsule(radius)) for j in bare]
    return (*long, *balls)


def merged(bodies: Iterable[Body]) -> dict[int, Body]:
    """Joint -> all that it carries as one rigid body; the inertia about the common center, by Steiner's theorem."""
    groups: dict[int, list[Body]] = {}
    for body in bodies:
        groups.setdefault(body.joint, []).append(body)
    found = {}
    for joint, parts in groups.items():
        mass = sum(part.mass for part in parts)
        center = sum((part.mass * part.center for part in parts), np.zeros(3)) / mass if mass else np.zeros(3)
        inertia = np.zeros((3, 3))
        for part in parts:
            d = part.center - center
            inertia = inertia + part.inertia + part.mass * (d @ d * np.eye(3) - np.outer(d, d))
        found[joint] = Body(joint, mass, center, inertia)
    return found


@typed
def weighed(robot: Robot, density: float = DENSITY) -> Robot:
    """The robot, if it knows its masses; else with those of solid capsules along its links, which are placeholders.

    Args:
        density: of the capsules [kg/m^3].

    Raises:
        ArgumentError: a density that is not positive, or that no solid has.
    """
    if positive("density", density) > DENSEST:
        raise ArgumentError("density", density, f"give at most {DENSEST:g} kg/m^3: steel has 7850")
    if knows_masses(robot):
        return robot
    return replace(robot, bodies=tuple(solid(part, density) for part in drawn_links(robot)))


def knows_masses(robot: Robot) -> bool:
    """Whether its description has the mass of anything that moves."""
    return any(body.joint >= 0 for body in robot.bodies)
