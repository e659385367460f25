"""Robots put together: an arm on a rail or a mobile base, two arms side by side, a tool on a flange."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..base.arguments import check, typed
from ..base.errors import ArgumentError, UnknownNameError
from ..base.poses import pose_from
from ..base.types import ArrayLike, Matrix, Value, Vector, finite
from ..symbolic.rotations import rotation_from_rpy
from .joints import Body, Coordinate, Joint, Tip
from .model import Robot
from .shapes.link_shapes import LinkShape
from .shapes.visuals import Visual
from .units import TRUST, check_radians, check_tool

BASE = "base"
"""What a part stands on when it stands on the ground, in `Part.on`."""


@dataclass(frozen=True, eq=False)
class Part(Value):
    """A robot and where it is mounted: its base at xyz (3,) [m], rpy (3,) [rad] in the frame of a tip, or of the base.

    `on` names a tip of the parts before it, or "base" for the ground. By default it is the first tip of the part before
    it; the first part stands on the ground. `prefix` goes before the names of its joints and tips.
    """

    robot: Robot
    on: str | None = None
    xyz: Vector = field(default_factory=lambda: np.zeros(3))
    rpy: Vector = field(default_factory=lambda: np.zeros(3))
    prefix: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.robot, Robot):
            raise ArgumentError("the robot of a part", self.robot, "give a Robot, as hk.load makes it")
        check("on of a part", str | None, self.on)
        check("prefix of a part", str, self.prefix)
        object.__setattr__(self, "xyz", finite("xyz of a part", self.xyz, (3,)))
        object.__setattr__(self, "rpy", finite("rpy of a part", self.rpy, (3,)))
        check_radians("rpy of a part", self.rpy)
        super().__post_init__()


@typed
def compose(*parts: Robot | Part, name: str = "", order: Sequence[str] | None = None) -> Robot:
    """One robot of several, each on the tool of the one before: `hk.compose(rail, arm)`.

    The coordinates are those of all parts, in the order of the parts. The tips are those that carry no other part.

    Args:
        parts: robots, or `Part`s, which say where they are mounted and on what.
        name: by default the names of the parts, joined by "+".
        order: names of all joints in the order they shall have in q.

    Raises:
        ArgumentError: no part; a joint or tip name that two parts have (give one a prefix); an order that is none.
        UnknownNameError: a tip to mount on that no part before has.
    """
    given = [part if isinstance(part, Part) else Part(part) for part in parts]
    if not given:
        raise ArgumentError("the parts of a robot", (), "give at least one")
    coordinates: list[Coordinate] = []
    joints: list[Joint] = []
    bodies: list[Body] = []
    shapes: list[LinkShape] = []
    visuals: list[Visual] = []
    tips: list[Tip] = []
    carrying: set[str] = set()
    on = BASE
    for part in given:
        part.robot.check_links()
        on = on if part.on is None else part.on
        mount = _mount(on, tips)
        carrying.add(mount.name)
        origin = mount.placement @ pose_matrix(part.xyz, part.rpy)
        first, number = len(joints), len(coordinates)

        def placed(
            index: int, T: Matrix, mount: Tip = mount, origin: Matrix = origin, first: int = first
        ) -> tuple[int, Matrix]:
            """(joint, placement there) of what the part fixes to one of its joints, or (joint -1) to its base."""
            return (mount.joint, origin @ T) if index < 0 else (first + index, T)

        for c in part.robot.coordinates:
            coordinates.append(replace(c, name=part.prefix + c.name))
        for joint in part.robot.joints:
            parent, placement = placed(joint.parent, joint.placement)
            label, coordinate = part.prefix + joint.name, number + joint.coordinate
            foot = origin[:3, :3] @ joint.start + origin[:3, 3] if parent < 0 else None  # what moves carries it
            moved = replace(joint, name=label, parent=parent, placement=placement, coordinate=coordinate, foot=foot)
            joints.append(moved)
        for body in part.robot.bodies:
            index, T = placed(body.joint, pose_from(body.center))
            R = T[:3, :3]
            bodies.append(Body(index, body.mass, T[:3, 3], R @ body.inertia @ R.T))
        for shape in part.robot.shapes:
            index, T = placed(shape.joint, shape.placement)
            stands = shape.obstacle and index < 0  # what was round a robot is carried, where that rides on another
            label = part.prefix + shape.link
            on_link = part.prefix + shape.parent if shape.parent else shape.parent
            shapes.append(replace(shape, link=label, joint=index, placement=T, obstacle=stands, parent=on_link))
        for visual in part.robot.visuals:
            index, T = placed(visual.joint, visual.placement)
            visuals.append(replace(visual, link=part.prefix + visual.link, joint=index, placement=T))
        ends = []
        for tip in part.robot.tips:
            index, T = placed(tip.joint, tip.placement)
            flange = None if tip.flange is None else placed(tip.joint, pose_from(tip.flange))[1][:3, 3]
            ends.append(Tip(part.prefix + tip.name, index, T, flange))
        _unlike("joint", joints)
        _unlike("tip", [*tips, *ends])
        tips += ends
        on = ends[0].name
    robot = Robot(
        name or "+".join(part.robot.name for part in given),
        tuple(coordinates),
        tuple(joints),
        tuple(tip for tip in tips if tip.name not in carrying),
        "; ".join(dict.fromkeys(part.robot.source for part in given if part.robot.source)),
        tuple(bodies),
        tuple(shapes),
        tuple(visuals),
    )
    return robot if order is None else ordered(robot, order)


@typed
def ordered(robot: Robot, order: Sequence[str]) -> Robot:
    """The same robot with its joints in another order in q. Raises: ArgumentError: not each of its joints once."""
    if sorted(order) != sorted(robot.joint_names):
        raise ArgumentError("the order of the joints", list(order), f"name each once: {', '.join(robot.joint_names)}")
    places = [list(order).index(name) for name in robot.joint_names]
    return replace(
        robot,
        coordinates=tuple(robot.coordinates[robot.joint_names.index(name)] for name in order),
        joints=tuple(replace(joint, coordinate=places[joint.coordinate]) for joint in robot.joints),
    )


@typed
def with_tool(
    robot: Robot, xyz: ArrayLike = (0, 0, 0), rpy: ArrayLike = (0, 0, 0), *, tip: str | None = None, name: str = "tool",
    trust_units: bool = False,
) -> Robot:  # fmt: skip
    """The robot with a tool: a tip at xyz (3,) [m], rpy (3,) [rad] in the frame of one of its tips, which it replaces.

    R = Rz(yaw) Ry(pitch) Rx(roll), as in a URDF.

    Args:
        tip: the tip that carries the tool, by default the first.
        name: of the new tip.
        trust_units: take the numbers for rad and m, whatever they look like.

    Raises:
        UnknownNameError: no such tip. ArgumentError: another tip has that name; angles over a turn, which look like
        degrees, or a tool ten times as long as the arm, which looks like millimetres. ShapeError, NotFiniteError.
    """
    place, turn = finite("xyz of a tool", xyz, (3,)), finite("rpy of a tool", rpy, (3,))
    carrier = robot.tip(tip)
    if not trust_units:
        check_radians("rpy of a tool", turn, TRUST)
        check_tool(robot, place, carrier.name)
    T = pose_matrix(place, turn)
    tips = [Tip(name, t.joint, t.placement @ T, t.arm_end) if t is carrier else t for t in robot.tips]
    _unlike("tip", tips)
    return replace(robot, tips=tuple(tips))


@typed
def with_base_pose(robot: Robot, xyz: ArrayLike = (0, 0, 0), rpy: ArrayLike = (0, 0, 0)) -> Robot:
    """The robot mounted at xyz (3,) [m], rpy (3,) [rad]: poses then count from the frame in which these are given.

    Raises:
        ShapeError, NotFiniteError, ArgumentError.
    """
    return compose(Part(robot, xyz=finite("xyz", xyz, (3,)), rpy=finite("rpy", rpy, (3,))), name=robot.name)


def _mount(on: str, tips: Sequence[Tip]) -> Tip:
    if on == BASE and BASE not in [tip.name for tip in tips]:
        return Tip("", -1, np.eye(4))
    for tip in tips:
        if tip.name == on:
            return tip
    raise UnknownNameError("tip to mount a part on", on, [BASE, *(tip.name for tip in tips)])


def _unlike(kind: str, named: Sequence[Joint | Tip]) -> None:
    """Raises: ArgumentError where two have one name."""
    names = [thing.name for thing in named]
    for name in names:
        if names.count(name) > 1:
            cure = f"give a part a prefix, as in hk.Part(arm, prefix='left_'), or the {kind} another name"
            raise ArgumentError(f"the name of two {kind}s", name, cure)


def pose_matrix(xyz: Vector, rpy: Vector) -> Matrix:
    """The pose (4, 4) at xyz (3,) [m], turned by rpy (3,) [rad]: R = Rz(yaw) Ry(pitch) Rx(roll), as in a URDF."""
    return pose_from(xyz, rotation_from_rpy(rpy.tolist()))
