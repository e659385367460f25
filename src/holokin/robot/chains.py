"""The robot of the chains of a tree, from a base to one tip or several."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..base.errors import ArgumentError, RobotFileError, UnknownNameError, shown
from ..base.tolerances import TOLERANCES
from ..base.types import Matrix, Vector
from .joints import Body, Coordinate, Joint, Tip
from .model import Robot
from .reroot import rerooted
from .shapes.link_shapes import LinkShape
from .shapes.visuals import Visual
from .tree import MOVING, Branch, Tree, above_of, chain_of, leaves_of, motion, root_of
from .units import TRUST, check_radians, plausible


def robot_of(
    tree: Tree, tip: str | Sequence[str] | None, base: str | None, locked: Mapping[str, float] | None,
    trust_units: bool = False,
) -> Robot:  # fmt: skip
    """The robot of the chains from a base to its tips, as `from_urdf` says.

    Raises:
        RobotFileError, UnknownNameError, ArgumentError.
    """
    above = above_of(tree)
    root = root_of(tree, above) if base is None else base
    held = dict(locked or {})
    by_name = {joint.name: joint for joint in tree.joints}
    for kind, wanted, known in ((tree.word, [root], tree.links), ("joint", held, by_name)):
        for word in wanted:
            if word not in known:
                raise UnknownNameError(f"{kind} of {tree.source}", word, tuple(known))
    tips = _wanted_tips(tree, tip, above, root)
    if any(chain_of(link, root, above) is None for link in tips):
        tree = rerooted(tree, root)
    builder = _Builder(tree, root, held)
    for joint, value in held.items():
        builder.check_locked(by_name[joint], value)
    robot = builder.build(tips)
    if trust_units:
        return robot
    try:
        for joint, rpy in tree.turned.items():
            check_radians(f"rpy of joint {joint!r}", np.array(rpy), TRUST)
        return plausible(robot)
    except ArgumentError as problem:
        raise tree.problem(f"{problem.what} is {shown(problem.value)}", problem.cure) from None


class _Builder:
    """Walks the chains and collects joints and coordinates, each once."""

    def __init__(self, tree: Tree, root: str, held: dict[str, float]):
        self.tree, self.root, self.held = tree, root, held
        self.by_name = {joint.name: joint for joint in tree.joints}
        self.above = above_of(tree)
        self.followers = self._all_followers()
        self.joints: list[Joint] = []
        self.index: dict[str, int] = {}
        self.coordinates: dict[str, Coordinate] = {}

    def build(self, tips: Sequence[str]) -> Robot:
        """The robot of the chains from the root to each tip, with the masses of everything that they carry."""
        ends = []
        for tip in tips:
            chain = chain_of(tip, self.root, self.above)
            if chain is None:
                fact = f"{self.tree.word} {tip!r} does not hang together with base {self.root!r}"
                raise self.tree.problem(fact, "choose another base")
            try:
                ends.append(self._add(tip, chain))
            except ArgumentError as problem:  # of a joint's limits
                raise self.tree.problem(f"{problem.what} is {problem.value}", problem.cure) from None
        bodies, shapes, visuals = self._carried_things()
        tree, coordinates = self.tree, tuple(self.coordinates.values())
        return Robot(tree.name, coordinates, tuple(self.joints), tuple(ends), tree.source, bodies, shapes, visuals)

    def _add(self, tip: str, chain: Sequence[Branch]) -> Tip:
        parent, placement, foot, begun = -1, np.eye(4), None, False
        for joint in chain:
            before, placement = placement, placement @ joint.origin
            if joint.kind == "fixed":
                continue
            foot = foot if begun else before[:3, 3]  # it stands where the link does on which its first joint hangs
            begun = True
            if joint.kind not in MOVING:
                cure = "choose base= below it: revolute, continuous, prismatic, fixed and mimic joints are supported"
                if (plain := str(joint.kind).strip().lower()) in (*MOVING, "continuous", "fixed"):
                    cure = f"write {plain!r}: types are in lower case"
                raise self.tree.problem(f"joint {joint.name!r} is of type {joint.kind!r}", cure)
            axis = _axis(self.tree, joint)
            self._check_loops(joint)
            master, multiplier, offset = self._master(joint)
            if master.name in self.held:
                placement = placement @ motion(joint.kind, axis, multiplier * self.held[master.name] + offset)
                continue
            if joint.name not in self.index:
                if master.name not in self.coordinates:
                    self.coordinates[master.name] = self._coordinate(master)
                self._move(joint, parent, placement, axis, (master.name, multiplier, offset), foot)
            parent, placement, foot = self.index[joint.name], np.eye(4), None
        return Tip(tip, parent, placement)

    def _move(
        self, joint: Branch, parent: int, placement: Matrix, axis: Vector, law: tuple[str, float, float],
        foot: Vector | None,
    ) -> None:  # fmt: skip
        master, multiplier, offset = law
        number = list(self.coordinates).index(master)
        self.index[joint.name] = len(self.joints)
        own = _own_limits(joint) if joint.name != master else ()
        law_of = (number, multiplier, offset)
        self.joints.append(Joint(joint.name, joint.kind, parent, placement, axis, *law_of, *own, foot=foot))

    def _carried_things(self) -> tuple[tuple[Body, ...], tuple[LinkShape, ...], tuple[Visual, ...]]:
        """What is below the root. A joint beside the chains stays at zero, unless it mimics one of theirs.

        Each shape knows the nearest link above its own that has shapes: the two are neighbours.
        """
        bodies: list[Body] = []
        shapes: list[LinkShape] = []
        visuals: list[Visual] = []
        waiting = [(self.root, -1, np.eye(4), "")]
        below: dict[str, list[Branch]] = {}
        for joint in self.by_name.values():
            below.setdefault(joint.parent, []).append(joint)
        while waiting:
            name, index, placement, above = waiting.pop()
            weight = self.tree.links[name]
            if weight is not None and weight.mass:
                R = placement[:3, :3]
                with np.errstate(all="ignore"):  # senseless masses are told by what needs them
                    center, inertia = R @ weight.center + placement[:3, 3], R @ weight.inertia @ R.T
                bodies.append(Body(index, weight.mass, center, inertia))
            carrier = above
            for shape in self.tree.shapes.get(name, ()):
                shapes.append(replace(shape, joint=index, placement=placement @ shape.placement, parent=above))
                carrier = above if shape.obstacle else name
            for visual in self.tree.visuals.get(name, ()):
                visuals.append(replace(visual, joint=index, placement=placement @ visual.placement))
            for joint in below.get(name, []):
                waiting.append((joint.child, *self._carried(joint, index, placement), carrier))
        return tuple(bodies), tuple(shapes), tuple(visuals)

    def _carried(self, joint: Branch, parent: int, placement: Matrix) -> tuple[int, Matrix]:
        """(index of the joint that moves a joint's child link, placement there)."""
        if joint.name in self.index:
            return self.index[joint.name], np.eye(4)
        foot = placement[:3, 3] if parent < 0 else None
        placement = placement @ joint.origin
        if joint.kind not in MOVING:
            return parent, placement
        try:
            axis = _axis(self.tree, joint)
            master, multiplier, offset = self._master(joint)
        except RobotFileError:
            return parent, placement  # beside the chains, so it must not hinder them
        if master.name in self.coordinates and master.name not in self.held:
            self._move(joint, parent, placement, axis, (master.name, multiplier, offset), foot)
            return self.index[joint.name], np.eye(4)
        value = self.held.get(master.name, master.zero)
        return parent, placement @ motion(joint.kind, axis, multiplier * value + offset)

    def _master(self, joint: Branch) -> tuple[Branch, float, float]:
        """The joint that a chain of mimics follows, and motion = multiplier * (its coordinate) + offset."""
        multiplier, offset, seen = 1.0, 0.0, {joint.name}
        while joint.follows is not None and joint.name not in self.held:
            law = joint.follows
            offset += multiplier * law.offset
            multiplier *= law.multiplier
            master = self.by_name.get(law.master)
            flaw = ""
            if master is None:
                flaw = "which the file does not have"
            elif master.name in seen:
                flaw = "which leads back to it"
            elif master.kind not in MOVING:
                flaw = f"which is of type {master.kind!r}"
            elif not np.isfinite([multiplier, offset]).all():
                flaw = f"with multiplier {law.multiplier} and offset {law.offset}"
            if flaw or master is None:
                fact = f"joint {joint.name!r} mimics {law.master!r}, {flaw}"
                cure = f"correct its <mimic>, or hold it still: locked={{{joint.name!r}: value}}"
                raise self.tree.problem(fact, cure)
            joint = master
            seen.add(joint.name)
        return joint, multiplier, offset - multiplier * joint.zero

    def _all_followers(self) -> dict[str, list[tuple[Branch, float, float]]]:
        """Every joint that leads -> those that follow it in the end, each with its multiplier and offset."""
        found: dict[str, list[tuple[Branch, float, float]]] = {}
        for joint in self.by_name.values():
            if joint.follows is not None and joint.name not in self.held and joint.kind in MOVING:
                try:
                    master, multiplier, offset = self._master(joint)
                except RobotFileError:
                    continue  # told where a chain needs it
                found.setdefault(master.name, []).append((joint, multiplier, offset))
        return found

    def _coordinate(self, master: Branch) -> Coordinate:
        """A joint's name, kind and limits, such that all joints that follow it are within theirs, too.

        low <= multiplier q + offset <= high of a follower is a range of q, and its largest speed over |multiplier| one
        of q'. Raises: ArgumentError, RobotFileError: limits make no sense, or the ranges have nothing in common.
        """
        found = master.coordinate
        lower, upper, speed = found.lower, found.upper, found.max_velocity
        for joint, multiplier, offset in self.followers.get(master.name, ()):
            low, high, most = _own_limits(joint)
            if multiplier:
                low, high = sorted(((low - offset) / multiplier, (high - offset) / multiplier))
                speed = min(speed, most / abs(multiplier))
            elif low - TOLERANCES.limit <= offset <= high + TOLERANCES.limit:
                continue  # it stands still, where it may
            else:
                low, high = np.inf, -np.inf
            lower, upper = max(lower, low), min(upper, high)
            if lower > upper + TOLERANCES.limit:
                fact = f"joint {joint.name!r} follows {master.name!r} and is never within its own limits"
                cure = f"correct the limits of both, or hold it still: locked={{{joint.name!r}: value}}"
                raise self.tree.problem(fact, cure)
        return replace(found, lower=min(lower, upper), upper=max(lower, upper), max_velocity=speed)

    def check_locked(self, joint: Branch, value: object) -> None:
        """Raises: ArgumentError, RobotFileError: a joint that cannot be held at a value."""
        tree = self.tree
        what = f"locked joint {joint.name!r} of {tree.source}"
        if joint.kind not in MOVING:
            raise ArgumentError(f"the type of {what}", joint.kind, "it needs no lock; name joints that move")
        if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not np.isfinite(value):
            raise ArgumentError(what, value, "give a finite value in m or rad")
        free = replace(joint, lower=-np.inf, upper=np.inf, max_velocity=np.inf)
        try:
            limits = self._coordinate(free if joint.blank else joint)
        except ArgumentError as problem:
            raise tree.problem(f"{problem.what} is {problem.value}", problem.cure) from None
        if not limits.lower - TOLERANCES.limit <= value <= limits.upper + TOLERANCES.limit:
            raise ArgumentError(what, value, f"give a value within its limits [{limits.lower:.6g}, {limits.upper:.6g}]")

    def _check_loops(self, joint: Branch) -> None:
        """Raises: RobotFileError for a joint whose value others determine round a closed loop."""
        for loop in self.tree.loops:
            if joint.name in loop.joints and joint.name not in self.held:
                fact = f"joint {joint.name!r} is part of a closed loop of joints ({loop.closed_by})"
                cure = "choose base= and tip= so that the chain leaves the loop out, or lock its joints at their values"
                raise self.tree.problem(fact, cure)


def _wanted_tips(tree: Tree, tip: str | Sequence[str] | None, above: Mapping[str, Branch], root: str) -> list[str]:
    if tip is None:
        below = [leaf for leaf in leaves_of(tree) if chain_of(leaf, root, above)]
        if not below:
            others = ", ".join(leaf for leaf in leaves_of(tree) if leaf != root)
            raise tree.problem(f"ends at base {root!r}", f"give tip=, the {tree.word} to reach from there: {others}")
        if len(below) != 1:
            fact = f"branches into {len(below)} tips"
            raise tree.problem(fact, f"give tip=, one or more of {', '.join(below)}")
        return below
    wanted = [tip] if isinstance(tip, str) else list(tip)
    for link in wanted:
        if link not in tree.links:
            raise UnknownNameError(f"{tree.word} of {tree.source}", link, tuple(tree.links))
    return wanted


def _own_limits(joint: Branch) -> tuple[float, float, float]:
    """(least, greatest, fastest) motion from its zero that a follower's own limits allow; none were filled in: any.

    Raises: ArgumentError: they make no sense.
    """
    if joint.blank:
        return -np.inf, np.inf, np.inf
    own = joint.coordinate
    return own.lower - joint.zero, own.upper - joint.zero, own.max_velocity


def _axis(tree: Tree, joint: Branch) -> Vector:
    """Unit axis (3,) of a joint."""
    length = np.linalg.norm(joint.axis)
    if joint.axis.shape != (3,) or not np.isfinite(length) or length == 0.0:
        raise tree.problem(f"joint {joint.name!r} has axis {joint.axis}", "give it a direction, three numbers")
    return joint.axis / length
