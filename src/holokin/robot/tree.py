"""A tree of links and joints, into which every reader of models turns what it reads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..base.errors import ArgumentError, RobotFileError, UnknownNameError
from ..base.types import Array, Matrix, Value, Vector
from .joints import FARTHEST, Coordinate
from .model import Robot
from .shapes.link_shapes import LinkShape
from .shapes.visuals import Visual

MOVING = ("revolute", "prismatic")
"""The kinds of joints that move here; "fixed" ones do not, and all others are refused where a chain needs them."""


@dataclass(frozen=True)
class Follow:
    """How a joint follows another one: motion = multiplier * (motion of the master) + offset."""

    master: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, eq=False)
class Branch(Value):
    """A joint of a tree: T(parent link) origin, then a motion q - zero about or along its axis (3,), then the child.

    What a file says stands here unchecked: a chain that runs through the joint checks it.
    """

    name: str
    kind: str
    parent: str
    child: str
    origin: Matrix = field(default_factory=lambda: np.eye(4))
    axis: Vector = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    lower: float = -np.inf
    upper: float = np.inf
    max_velocity: float = np.inf
    zero: float = 0.0
    follows: Follow | None = None

    @property
    def blank(self) -> bool:
        """Whether its limits are those of exporters where nobody filled them in: from 0 to 0, at speed 0."""
        return self.lower == self.upper == self.max_velocity == 0.0

    @property
    def coordinate(self) -> Coordinate:
        """Its name, kind and limits; one beyond FARTHEST is none, nor is a speed of 0.

        Raises:
            ArgumentError: they make no sense, or were never filled in.
        """
        if self.blank:
            cure = "fill in its <limit>, or hold it still: locked={name: value}"
            raise ArgumentError(f"the range of joint {self.name!r}", "from 0 to 0, at speed 0", cure)
        lower = -np.inf if self.lower <= -FARTHEST else self.lower
        upper = np.inf if self.upper >= FARTHEST else self.upper
        if lower > upper:
            cure = "give lower <= upper, and soft limits that lie between them"
            raise ArgumentError(f"the range of joint {self.name!r}", (lower, upper), cure)
        none = self.max_velocity == 0.0 or self.max_velocity >= FARTHEST
        return Coordinate(self.name, self.kind, lower, upper, np.inf if none else self.max_velocity)


@dataclass(frozen=True, eq=False)
class Mass(Value):
    """What a link weighs: mass [kg], center (3,) [m] and inertia (3, 3) about it [kg m^2], in the link's frame."""

    mass: float
    center: Vector
    inertia: Matrix


@dataclass(frozen=True)
class Loop:
    """Joints that close a loop, and what closes it. Their values depend on each other, which a tree cannot say."""

    closed_by: str
    joints: frozenset[str]


@dataclass(frozen=True)
class Tree:
    """Links (each with what it weighs, or None), joints, and shapes and looks in the frames of links.

    Errors name `source`, and call a link by `word`. `turned`: roll, pitch and yaw [rad] of joints' origins, where a
    file writes them so.
    """

    source: str
    name: str
    links: Mapping[str, Mass | None]
    joints: tuple[Branch, ...]
    loops: tuple[Loop, ...] = ()
    word: str = "link"
    shapes: Mapping[str, tuple[LinkShape, ...]] = field(default_factory=dict)
    visuals: Mapping[str, tuple[Visual, ...]] = field(default_factory=dict)
    turned: Mapping[str, Sequence[float]] = field(default_factory=dict)

    def problem(self, fact: str, cure: str) -> RobotFileError:
        """The error of what was read."""
        return RobotFileError(self.source, fact, cure)


def checked(tree: Tree) -> Tree:
    """The tree, if its links and joints form one. Raises: RobotFileError."""
    names: set[str] = set()
    children: set[str] = set()
    for joint in tree.joints:
        cure = "correct the file: links and joints must form a tree"
        if joint.name in names:
            raise tree.problem(f"has two joints named {joint.name!r}", cure)
        if joint.child in children:
            raise tree.problem(f"{tree.word} {joint.child!r} hangs on two joints", cure)
        names.add(joint.name)
        children.add(joint.child)
    for joint in tree.joints:
        for link in (joint.parent, joint.child):
            if link not in tree.links:
                raise tree.problem(f"joint {joint.name!r} joins {tree.word} {link!r}, which is not there", "add it")
        if not np.isfinite(joint.origin).all():
            raise tree.problem(f"joint {joint.name!r} has an origin that is not finite", "give plain numbers")
    return tree


def links_of(tree: Tree, base: str | None = None) -> dict[str, tuple[str, ...]]:
    """Every link that hangs on the base -> the moving joints from the base to it, mimic joints included."""
    above = above_of(tree)
    root = root_of(tree, above) if base is None else base
    if root not in tree.links:
        raise UnknownNameError(f"{tree.word} of {tree.source}", root, tuple(tree.links))
    chains = {link: chain_of(link, root, above) for link in tree.links}
    return {
        link: tuple(joint.name for joint in chain if joint.kind in MOVING)
        for link, chain in chains.items()
        if chain is not None
    }


def tips_of(tree: Tree, base: str | None = None) -> dict[str, tuple[str, ...]]:
    """Those of `links_of` at which the tree ends."""
    ends = set(leaves_of(tree))
    return {link: joints for link, joints in links_of(tree, base).items() if link in ends}


def above_of(tree: Tree) -> dict[str, Branch]:
    """Every link -> the joint on which it hangs."""
    return {joint.child: joint for joint in tree.joints}


def root_of(tree: Tree, above: Mapping[str, Branch]) -> str:
    """The link at which the tree begins. Raises: RobotFileError: it has none, or several."""
    roots = [link for link in tree.links if link not in above]
    if not roots:
        raise tree.problem("has joints that form a loop", "cut the loop: links and joints must form a tree")
    if len(roots) != 1:
        raise tree.problem(f"has {len(roots)} roots: {', '.join(roots)}", "give base=")
    return roots[0]


def leaves_of(tree: Tree) -> list[str]:
    """The links at which the tree ends."""
    inner = {joint.parent for joint in tree.joints}
    return [link for link in tree.links if link not in inner]


def chain_of(tip: str, root: str, above: Mapping[str, Branch]) -> list[Branch] | None:
    """The joints from the root to a tip; None where it does not hang on the root."""
    chain: list[Branch] = []
    link = tip
    while link != root:
        if link not in above or len(chain) > len(above):
            return None
        chain.append(above[link])
        link = above[link].parent
    return chain[::-1]


def motion(kind: str, axis: Vector, value: float) -> Matrix:
    """The step (4, 4) of a joint about or along a unit axis (3,), by a value in rad or m."""
    T = np.eye(4)
    if kind == "prismatic":
        T[:3, 3] = axis * value
    else:
        T[:3, :3] = _turn_matrix(axis, value)
    return T


def _turn_matrix(axis: Vector, angle: float | Vector) -> Array:
    """R = 1 + sin(angle) [a]x + (1 - cos(angle)) [a]x^2 for a unit axis a (3,); (..., 3, 3) for angles (...)."""
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    s, c = np.sin(angle)[..., None, None], np.cos(angle)[..., None, None]
    return np.eye(3) + s * K + (1 - c) * (K @ K)


def rerooted(tree: Tree, base: str) -> Tree:
    """The same tree with `base` as its root.

    A joint on the way up, T_parent_child = O M(q) with origin O and motion M about its axis a, turns into M about -a
    from the child, since M(q)^-1 is that, and a fixed step O^-1 to the parent.
    """
    above = above_of(tree)
    used = {*tree.links, *(joint.name for joint in tree.joints)}
    turned: dict[str, list[Branch]] = {}
    between: dict[str, None] = {}
    link = base
    while link in above and above[link].name not in turned:
        joint = above[link]
        back = np.asarray(np.linalg.inv(joint.origin), dtype=np.float64)
        if joint.kind == "fixed":
            turned[joint.name] = [Branch(joint.name, "fixed", joint.child, joint.parent, back)]
        else:
            name = f"{joint.name} seen from {joint.child}"
            while name in used:
                name += "'"
            moving = replace(joint, parent=joint.child, child=name, origin=np.eye(4), axis=-joint.axis)
            turned[joint.name] = [moving, Branch(name, "fixed", name, joint.parent, back)]
            between[name] = None
        link = joint.parent
    joints = tuple(new for joint in tree.joints for new in turned.get(joint.name, [joint]))
    return replace(tree, links={**tree.links, **between}, joints=joints)


# --- Frames of a robot's joints at many postures at once, in NumPy: without CasADi and without a compiler.

Frames = list[tuple[Matrix, Array]]
"""(positions (k, 3), rotations (k, 3, 3)) of frames at k postures."""


def joint_frames(robot: Robot, Q: Matrix) -> Frames:
    """The moving frame of every joint in the base frame, at postures Q (k, n)."""
    frames: Frames = []
    for joint in robot.joints:
        p, R = placed(frames, joint.parent, joint.placement, len(Q))
        value = joint.multiplier * Q[:, joint.coordinate] + joint.offset
        if joint.kind == "prismatic":
            p = p + (R @ joint.axis) * value[:, None]
        else:
            R = R @ _turn_matrix(joint.axis, value)
        frames.append((p, R))
    return frames


def placed(frames: Frames, joint: int, T: Matrix, count: int) -> tuple[Matrix, Array]:
    """A frame T (4, 4) on a joint's moving side (joint -1: the base), at all `count` postures."""
    if joint < 0:
        return np.broadcast_to(T[:3, 3], (count, 3)), np.broadcast_to(T[:3, :3], (count, 3, 3))
    p, R = frames[joint]
    return p + R @ T[:3, 3], R @ T[:3, :3]
