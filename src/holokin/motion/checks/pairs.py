"""Which pairs of links are looked at: not parent and child, nor those that always touch, nor those that may touch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...base.errors import UnknownNameError
from ...base.types import Matrix, Value, Vector
from ...robot import Capsule, LinkShape, Robot, Unread, joints_above
from ...robot.numeric import joint_frames
from .check_report import LeftOut, Unseen, cannot_tell
from .gaps import FLOOR, Gap, Link, floor_gap, link_gap, links_of

POSTURES = 200
"""Random postures within the limits at which pairs are looked at, to find those that always touch."""

ADJACENT = "parent and child"
ALWAYS = f"they touch at each of {POSTURES} random postures"
NEAR = f"nearer than the clearance at each of {POSTURES} random postures, so only collisions are told"
ASKED = "allowed to touch"

LEVEL = 1e-9
"""By how much a plane for which a floor stands may be tilted [-], or be above it [m]: round-off."""

ALL = "*"
"""In a pair that may touch: all other things."""


@dataclass(frozen=True, eq=False)
class Pairs(Value):
    """Gaps to look at, the distance asked of each [m], what is not looked at, and the clearance that was wanted [m]."""

    gaps: tuple[Gap, ...]
    limits: tuple[float, ...]
    left_out: tuple[LeftOut, ...]
    unseen: tuple[Unseen, ...]
    wanted: float

    @property
    def unread(self) -> str:
        """That nothing can be told of links whose shapes could not be read, and why; empty where all were read."""
        first = next((one.reason for one in self.unseen if one.unread), "")
        return f"{cannot_tell(self.unseen)} ({first})" if first else ""


def _readable(shapes: Sequence[LinkShape]) -> tuple[list[LinkShape], list[tuple[LinkShape, str]]]:
    """The shapes that can be looked at, and the others with the reason."""
    faults = [(shape, shape.shape.fault) for shape in shapes]
    return [s for s, fault in faults if not fault], [(s, fault) for s, fault in faults if fault]


def pairs_of(
    robot: Robot, obstacles: Sequence[LinkShape], q: Matrix, *, clearance: float, floor: float | None,
    self_collision: bool, ignore: Sequence[tuple[str, str]],
) -> Pairs:  # fmt: skip
    """The pairs of a robot among obstacles, for a motion q (k, n). Raises: UnknownNameError: an unknown link.

    Links that do not move against each other are no pair, nor are such links and what stands still.
    """
    good, faulty = _readable([*robot.shapes, *obstacles])
    links = links_of([shape for shape in good if not shape.obstacle])
    things = links_of([shape for shape in good if shape.obstacle])
    names = [link.name for link in (*links, *things)] + [shape.link for shape, _ in faulty]
    _known(ignore, names if floor is None else [*names, FLOOR])
    allowed, every = _Allowed(ignore), [*robot.shapes, *obstacles]
    unseen = [
        Unseen(one.link, fault, _asked_about(one, every, allowed, floor, self_collision)) for one, fault in faulty
    ]
    if not all(isinstance(shape.shape, Capsule) for shape in robot.shapes):  # a link without length has no capsule
        bare = sorted({*range(len(robot.joints))} - {shape.joint for shape in robot.shapes})
        unseen += [Unseen(robot.joints[j].name, "no shape moves with this joint") for j in bare]
    travel = _travel(robot, q)
    parents = [_parent(robot, links, link) for link in links]
    left_out, gaps, tested = [], [], []
    for i, one in enumerate(links):
        for thing in things if one.joint >= 0 else ():
            if (one.name, thing.name) in allowed:
                left_out.append(LeftOut((one.name, thing.name), ASKED))
            else:
                gaps.append(link_gap(robot, one, thing, travel))
        for j, other in enumerate(links[:i] if self_collision else ()):
            pair = (other.name, one.name)
            if one.joint == other.joint:
                continue  # they never move against each other
            if pair in allowed:
                left_out.append(LeftOut(pair, ASKED))
            elif other is parents[i] or one is parents[j]:
                left_out.append(LeftOut(pair, ADJACENT))
            else:
                tested.append(link_gap(robot, other, one, travel))
    limits = [clearance] * len(gaps)
    for gap, values in zip(tested, _at_random(robot, tested, clearance), strict=True):
        if values.max(initial=-np.inf) <= 0:
            left_out.append(LeftOut(gap.names, ALWAYS))
            continue
        if values.max() < clearance:
            left_out.append(LeftOut(gap.names, NEAR))
        gaps.append(gap)
        limits.append(0.0 if values.max() < clearance else clearance)
    for link in links:
        if floor is None or link.joint < 0:
            continue
        if (link.name, FLOOR) in allowed:
            left_out.append(LeftOut((link.name, FLOOR), ASKED))
        else:
            gaps.append(floor_gap(robot, link, floor, travel))
            limits.append(clearance)
    return Pairs(tuple(gaps), tuple(limits), tuple(left_out), tuple(unseen), clearance)


class _Allowed:
    """The pairs of names that may touch."""

    def __init__(self, pairs: Sequence[tuple[str, str]]) -> None:
        self.pairs = {frozenset(pair) for pair in pairs}

    def __contains__(self, names: tuple[str, str]) -> bool:
        asked = (names, *((name, ALL) for name in names)) if self.pairs else ()
        return any(frozenset(pair) in self.pairs for pair in asked)


def _asked_about(
    one: LinkShape, every: Sequence[LinkShape], allowed: _Allowed, floor: float | None, self_collision: bool
) -> bool:
    """Whether a shape may meet a thing that it may not touch."""
    up, height = one.placement[2, 2:]
    level = isinstance(one.shape, Unread) and one.shape.plane and up > 1 - LEVEL
    if level and floor is not None and floor >= height - LEVEL:
        return False  # the floor stands for it
    rivals = [FLOOR] if floor is not None and not one.obstacle and one.joint >= 0 else []
    for other in every:
        if one.obstacle or other.obstacle:
            meet = one.obstacle != other.obstacle and max(one.joint, other.joint) >= 0
        else:
            meet = self_collision and one.joint != other.joint
        rivals += [other.link] if meet else []
    return any((one.link, name) not in allowed for name in rivals)


def _known(ignore: Sequence[tuple[str, str]], names: Sequence[str]) -> None:
    for name in (name for pair in ignore for name in pair):
        if name != ALL and name not in names:
            raise UnknownNameError("link or obstacle", name, tuple(dict.fromkeys(names)))


def _travel(robot: Robot, q: Matrix) -> Vector:
    """The farthest that each joint of the tree is from its zero in a motion (joints,)."""
    values = [np.abs(joint.multiplier * q[:, joint.coordinate] + joint.offset).max() for joint in robot.joints]
    return np.array(values)


def _parent(robot: Robot, links: Sequence[Link], link: Link) -> Link | None:
    """The link with shapes on which one hangs, if only links without shapes are between. See `LinkShape.parent`."""
    own, rest = link.shapes[0], [one for one in links if not one.shapes[0].carried]
    if own.carried and any(one.joint == link.joint for one in rest):
        return None  # it is fixed to that
    for joint in [*joints_above(robot.joints, link.joint)[1:], -1] if link.joint >= 0 else ():
        there = [one for one in rest if one.joint == joint]
        named = [one for one in there if one.name == own.parent]
        if named:
            return named[0]
        if there and (own.parent is None or there[0].shapes[0].parent is None):
            return there[0] if len(there) == 1 else None
    return None


def _at_random(robot: Robot, gaps: Sequence[Gap], near: float) -> list[Vector]:
    """Distances of each gap at random postures; a hinge without limits turns once round, a slider stays in 1 m."""
    lower, upper = robot.ranges(np.where(robot.hinges, np.pi, 0.5))
    Q = np.random.default_rng(0).uniform(lower, upper, (POSTURES, robot.n))
    frames = joint_frames(robot, Q)
    return [gap.distances(frames, np.arange(POSTURES), near) for gap in gaps]
