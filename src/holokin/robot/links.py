"""What the links of a robot weigh and look like: their bodies as one each, and capsules where nothing is known."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from ..arguments import typed
from ..types import Matrix, Value, Vector, positive
from .model import Body, Joint, Robot
from .tree import motion

THICKNESS = 0.04
"""Radius of a capsule over the length of the longest chain: 56 mm for a Panda, as its arm has."""

STUMP = 0.05
"""Radius [m] of the sphere that stands for a robot without any length, such as a single slider."""

DENSITY = 1000.0
"""Of capsules that stand for links [kg/m^3]: that of water. A Panda with its hand is 21 kg of it, the real
one weighs 18 kg."""


@dataclass(frozen=True, eq=False)
class Capsule(Value):
    """A cylinder with half spheres at its ends (3,) [m], in the frame of a joint's moving side; a sphere if they meet.

    joint: the index of that joint, -1 for the base.
    """

    joint: int
    start: Vector
    end: Vector
    radius: float

    @property
    def length(self) -> float:
        """Of the cylinder [m]."""
        return float(np.linalg.norm(self.end - self.start))

    @property
    def rotation(self) -> Matrix:
        """A rotation (3, 3) whose z axis is the capsule's."""
        if self.length == 0:
            return np.eye(3)
        z = (self.end - self.start) / self.length
        x = np.cross(z, np.eye(3)[int(np.abs(z).argmin())])
        x /= np.linalg.norm(x)
        return np.array([x, np.cross(z, x), z], dtype=np.float64).T

    def solid(self, density: float) -> Body:
        """Its mass and inertia as a solid of even density [kg/m^3]."""
        r, h = self.radius, self.length
        cylinder, ball = density * np.pi * r**2 * h, density * 4 / 3 * np.pi * r**3
        across = cylinder * (3 * r**2 + h**2) / 12 + ball * (2 / 5 * r**2 + h**2 / 4 + 3 / 8 * h * r)
        along = cylinder * r**2 / 2 + ball * 2 / 5 * r**2
        R = self.rotation
        return Body(
            self.joint, cylinder + ball, (self.start + self.end) / 2, R @ np.diag([across, across, along]) @ R.T
        )


def rest(joint: Joint) -> Matrix:
    """The placement (4, 4) of a joint with its offset in it."""
    return joint.placement @ motion(joint.kind, joint.axis, joint.offset)


def capsules(robot: Robot) -> tuple[Capsule, ...]:
    """A capsule from every joint to each of the next ones, and to the tips: a drawing of the links, not their shape."""
    ends = [(joint.parent, rest(joint)[:3, 3]) for joint in robot.joints]
    ends += [(tip.joint, tip.placement[:3, 3]) for tip in robot.tips]
    lengths = np.zeros(len(robot.joints) + 1)
    for k, joint in enumerate(robot.joints):
        lengths[k] = lengths[joint.parent] + np.linalg.norm(rest(joint)[:3, 3])
    whole = max(lengths[j] + float(np.linalg.norm(end)) for j, end in ends)
    radius = float(THICKNESS * whole) if whole else STUMP
    found = [Capsule(j, np.zeros(3), end, radius) for j, end in ends if np.linalg.norm(end) > radius / 2]
    bare = set(range(len(robot.joints))) - {capsule.joint for capsule in found}
    return tuple(found + [Capsule(j, np.zeros(3), np.zeros(3), radius) for j in sorted(bare)])


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
        ArgumentError: a density that is not positive.
    """
    density = positive("density", density)
    if knows_masses(robot):
        return robot
    return replace(robot, bodies=tuple(capsule.solid(density) for capsule in capsules(robot)))


def knows_masses(robot: Robot) -> bool:
    """Whether its description has the mass of anything that moves."""
    return any(body.joint >= 0 for body in robot.bodies)
