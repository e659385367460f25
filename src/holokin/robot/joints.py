"""What a robot is made of: joints, the coordinates that move them, tips, and the masses of its links."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base.errors import ArgumentError
from ..base.types import Matrix, Shown, Value, Vector, number
from ..symbolic import SX

FARTHEST = 1e6
"""Largest length [m], angle or gear ratio of a robot, start or path: at 1,000 km a double still tells 1e-10 m apart."""

WOUND = 4 * np.pi
"""How far [rad] a joint may be beyond its limits and still be wound up, and not in degrees: two turns."""

MOST_MOVING = 1_000
"""Joints of a robot. 500 take half a second for a pose and its Jacobian, and each is looked up by name."""


@dataclass(frozen=True)
class Coordinate(Shown):
    """One entry of q: limits in m or rad, speed in m/s or rad/s; infinite where there is none.

    `given_unit`: of one that belongs to no joint, see `coordinates`.
    """

    name: str
    kind: str
    lower: float = -np.inf
    upper: float = np.inf
    max_velocity: float = np.inf
    given_unit: str = ""

    def __post_init__(self) -> None:
        for what, value in (("lower", self.lower), ("upper", self.upper), ("max_velocity", self.max_velocity)):
            number(f"{what} of joint {self.name!r}", value)
        if not self.lower <= self.upper or self.lower == np.inf or self.upper == -np.inf:  # NaN included
            raise ArgumentError(f"the range of joint {self.name!r}", (self.lower, self.upper), "give lower <= upper")
        if not self.max_velocity > 0:
            raise ArgumentError(f"the speed limit of joint {self.name!r}", self.max_velocity, "give a positive one")

    @property
    def unit(self) -> str:
        """ "m" for a prismatic joint, "rad" for a revolute one; else what was given."""
        return self.given_unit or ("m" if self.kind == "prismatic" else "rad")


@dataclass(frozen=True, eq=False)
class Joint(Value):
    """A joint of the tree: T(parent) placement, then a motion of multiplier q_k + offset along or about its axis.

    lower, upper, max_velocity: what limits the motion of a joint that follows another one; q_k keeps them, too.
    `foot` (3,): of a joint on the base, where the robot, or this arm of it, is mounted there [m]; None for the origin.
    """

    name: str
    kind: str
    parent: int
    placement: Matrix
    axis: Vector
    coordinate: int
    multiplier: float = 1.0
    offset: float = 0.0
    lower: float = -np.inf
    upper: float = np.inf
    max_velocity: float = np.inf
    foot: Vector | None = None

    @property
    def start(self) -> Vector:
        """Where the link begins that leads to it, in the frame before it (3,)."""
        return np.zeros(3) if self.foot is None else self.foot

    @property
    def step(self) -> Vector:
        """From there to its frame (3,)."""
        return self.placement[:3, 3] - self.start


def joints_above(joints: Sequence[Joint], joint: int) -> list[int]:
    """A joint of the tree and all those before it, down to the base; none for the base, -1."""
    chain = []
    while joint >= 0:
        chain.append(joint)
        joint = joints[joint].parent
    return chain


def foot_of(joints: Sequence[Joint], joint: int) -> Vector:
    """Where the arm stands that has a joint of the tree (3,); zero for the base itself, -1."""
    above = joints_above(joints, joint)
    return joints[above[-1]].start if above else np.zeros(3)


@dataclass(frozen=True, eq=False)
class Tip(Value):
    """A named frame fixed to a joint's moving side (joint -1: the base).

    `flange` (3,): where the arm ends that carries the tool, on the same joint [m]; None where the tip is its end.
    """

    name: str
    joint: int
    placement: Matrix
    flange: Vector | None = None

    @property
    def arm_end(self) -> Vector:
        """Where the arm ends, without a tool, in the frame of the joint (3,)."""
        return self.placement[:3, 3] if self.flange is None else self.flange


@dataclass(frozen=True)
class Kinematics(Shown):
    """Expressions of one tip: position p (3,), rotation R (3, 3), geometric Jacobian (6, n), linear rows first.

    `origins` holds the origin (3,) of every joint's frame by the joint's name.
    """

    position: SX
    rotation: SX
    jacobian: SX
    origins: dict[str, SX]


@dataclass(frozen=True, eq=False)
class Body(Value):
    """A rigid mass on a joint's moving side (joint -1: the base, where it weighs nothing to us).

    mass [kg], center of mass (3,) [m] and inertia (3, 3) about it [kg m^2], in that joint's frame.
    """

    joint: int
    mass: float
    center: Vector
    inertia: Matrix


def joint_rows(coordinates: Sequence[Coordinate]) -> list[Sequence[str]]:
    """A table of the coordinates with their limits."""
    rows: list[Sequence[str]] = [("joint", "from", "to", "speed")]
    for c in coordinates:
        limits = (f"{v:.4g} {c.unit}" for v in (c.lower, c.upper))
        rows.append((c.name, *limits, f"{c.max_velocity:.4g} {c.unit}/s"))
    return rows
