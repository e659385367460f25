"""Robots from URDF files, read by yourdfpy: revolute, continuous, prismatic, fixed and mimic joints."""

from __future__ import annotations

import io
import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import typed
from ..errors import ArgumentError, RobotFileError, UnknownNameError
from ..tolerances import TOLERANCES
from ..types import Matrix
from .model import Body, Coordinate, Joint, Robot, Tip
from .reroot import rerooted
from .urdf_xml import essentials

MOVING = ("revolute", "continuous", "prismatic")


@typed
def from_urdf(
    path: str | Path,
    tip: str | Sequence[str] | None = None,
    base: str | None = None,
    locked: Mapping[str, float] | None = None,
) -> Robot:
    """A robot from a URDF: the chain, or chains, from `base` to `tip`.

    Args:
        path: the file; meshes are not needed.
        tip: link that carries the tool, or several for a robot with several arms (the first is the default
            tip). Without it the tree must end in one link only.
        base: link that stays put and whose frame is used; by default the root of the tree. It may be a hand: from
            one hand of a two-armed robot to the other, the task is their relative pose and all joints share it.
        locked: joint name -> value [m or rad] of joints to hold still.

    Raises:
        RobotFileError: missing or malformed file, a joint type that cannot be used, a branching tree without `tip`.
        UnknownNameError: a link or joint that the file does not have.
        ArgumentError: a locked joint that cannot move, or a value that is no number or outside its limits.
    """
    model = _read(path)
    links = [link.name for link in model.links]
    parent_joint = {joint.child: joint for joint in model.joints}
    root = base if base is not None else _root(path, links, parent_joint)
    held = dict(locked or {})
    names = [joint.name for joint in model.joints]
    for kind, wanted, known in (("link", [root], links), ("joint", held, names)):
        for word in wanted:
            if word not in known:
                raise UnknownNameError(f"{kind} of {path}", word, known)
    by_name = {joint.name: joint for joint in model.joints}
    for joint, value in held.items():
        _check_locked(path, by_name[joint], value)
    wanted_tips = _wanted_tips(path, tip, links, parent_joint, root)
    bodies = model.links
    if any(_chain(link, root, parent_joint) is None for link in wanted_tips):
        joints, bodies = rerooted(model.joints, model.links, root)
        by_name = {joint.name: joint for joint in joints}
        parent_joint = {joint.child: joint for joint in joints}
    builder = _Builder(path, by_name, parent_joint, root, held)
    return builder.build(str(model.name or Path(path).stem), wanted_tips, bodies)


@typed
def urdf_tips(path: str | Path, base: str | None = None) -> dict[str, tuple[str, ...]]:
    """Every link at which the tree ends -> the moving joints from the base to it, mimic joints included."""
    model = _read(path)
    ends = set(_leaves([link.name for link in model.links], {joint.child: joint for joint in model.joints}))
    return {link: joints for link, joints in _chains(path, model, base).items() if link in ends}


@typed
def urdf_links(path: str | Path, base: str | None = None) -> dict[str, tuple[str, ...]]:
    """Every link that hangs on the base -> the moving joints from the base to it, mimic joints included."""
    return _chains(path, _read(path), base)


@typed
def urdf_root(path: str | Path) -> str:
    """The link that the tree of a URDF hangs on. Raises: RobotFileError: there are several, or none."""
    model = _read(path)
    return _root(path, [link.name for link in model.links], {joint.child: joint for joint in model.joints})


def _chains(path: str | Path, model: Any, base: str | None) -> dict[str, tuple[str, ...]]:
    parent_joint = {joint.child: joint for joint in model.joints}
    links = [link.name for link in model.links]
    root = base if base is not None else _root(path, links, parent_joint)
    if root not in links:
        raise UnknownNameError(f"link of {path}", root, links)
    chains = {link: _chain(link, root, parent_joint) for link in links}
    return {
        link: tuple(joint.name for joint in chain if joint.type in MOVING)
        for link, chain in chains.items()
        if chain is not None
    }


class _Builder:
    """Walks the chains and collects joints and coordinates, each once."""

    def __init__(self, path: str | Path, joints: dict[str, Any], parents: dict[str, Any], root: str, held: dict):
        self.path, self.by_name, self.parents, self.root, self.held = path, joints, parents, root, held
        self.joints: list[Joint] = []
        self.index: dict[str, int] = {}
        self.coordinates: dict[str, Coordinate] = {}

    def build(self, name: str, tips: Sequence[str], links: Sequence[Any]) -> Robot:
        """The robot of the chains from the root to each tip, with the masses of everything that they carry."""
        ends = []
        for tip in tips:
            chain = _chain(tip, self.root, self.parents)
            if chain is None:
                raise RobotFileError(
                    self.path, f"link {tip!r} does not hang together with base {self.root!r}", "choose another base"
                )
            try:
                ends.append(self._add(tip, chain))
            except ArgumentError as problem:  # of a joint's limits
                raise RobotFileError(self.path, f"{problem.what} is {problem.value}", problem.cure) from problem
        bodies = tuple(self._bodies({link.name: link for link in links}))
        return Robot(name, tuple(self.coordinates.values()), tuple(self.joints), tuple(ends), str(self.path), bodies)

    def _bodies(self, links: dict[str, Any]) -> list[Body]:
        """Masses below the root. A joint beside the chains stays at zero, unless it mimics one of theirs."""
        bodies: list[Body] = []
        waiting = [(self.root, -1, np.eye(4))]
        below: dict[str, list[Any]] = {}
        for joint in self.by_name.values():
            below.setdefault(joint.parent, []).append(joint)
        while waiting:
            name, index, placement = waiting.pop()
            mass = getattr(links[name].inertial, "mass", None)
            if mass:
                bodies.append(_body(index, placement, links[name].inertial))
            for joint in below.get(name, []):
                waiting.append((joint.child, *self._carried(joint, index, placement)))
        return bodies

    def _carried(self, joint: Any, parent: int, placement: Matrix) -> tuple[int, Matrix]:
        """(index of the joint that moves a joint's child link, placement there)."""
        if joint.name in self.index:
            return self.index[joint.name], np.eye(4)
        placement = placement if joint.origin is None else placement @ np.asarray(joint.origin, dtype=float)
        if joint.type not in MOVING:
            return parent, placement
        kind = "prismatic" if joint.type == "prismatic" else "revolute"
        try:
            axis = _axis(self.path, joint)
            master, multiplier, offset = self._master(joint)
        except RobotFileError:
            return parent, placement  # beside the chains, so it must not hinder them
        if master.name in self.coordinates and master.name not in self.held:
            number = list(self.coordinates).index(master.name)
            self.index[joint.name] = len(self.joints)
            self.joints.append(Joint(joint.name, kind, parent, placement, axis, number, multiplier, offset))
            return self.index[joint.name], np.eye(4)
        return parent, placement @ _motion(kind, axis, multiplier * self.held.get(master.name, 0.0) + offset)

    def _add(self, tip: str, chain: Sequence[Any]) -> Tip:
        parent, placement = -1, np.eye(4)
        for joint in chain:
            origin = np.eye(4) if joint.origin is None else np.asarray(joint.origin, dtype=float)
            placement = placement @ origin
            if joint.type == "fixed":
                continue
            if joint.type not in MOVING:
                raise RobotFileError(
                    self.path,
                    f"joint {joint.name!r} is of type {joint.type!r}",
                    "choose base= below it: revolute, continuous, prismatic, fixed and mimic joints are supported",
                )
            axis = _axis(self.path, joint)
            master, multiplier, offset = self._master(joint)
            kind = "prismatic" if joint.type == "prismatic" else "revolute"
            if master.name in self.held:
                value = multiplier * self.held[master.name] + offset
                placement = placement @ _motion(kind, axis, value)
                continue
            if joint.name not in self.index:
                self.coordinates.setdefault(master.name, _coordinate(master))
                number = list(self.coordinates).index(master.name)
                self.index[joint.name] = len(self.joints)
                self.joints.append(Joint(joint.name, kind, parent, placement, axis, number, multiplier, offset))
            parent, placement = self.index[joint.name], np.eye(4)
        return Tip(tip, parent, placement)

    def _master(self, joint: Any) -> tuple[Any, float, float]:
        """The joint that a chain of mimics follows, and value = multiplier * master + offset."""
        multiplier, offset, seen = 1.0, 0.0, {joint.name}
        while joint.mimic is not None and joint.name not in self.held:
            gain = 1.0 if joint.mimic.multiplier is None else float(joint.mimic.multiplier)
            shift = 0.0 if joint.mimic.offset is None else float(joint.mimic.offset)
            offset += multiplier * shift
            multiplier *= gain
            master = self.by_name.get(joint.mimic.joint)
            flaw = ""
            if master is None:
                flaw = "which the file does not have"
            elif master.name in seen:
                flaw = "which leads back to it"
            elif master.type not in MOVING:
                flaw = f"which is of type {master.type!r}"
            elif not np.isfinite([multiplier, offset]).all():
                flaw = f"with multiplier {gain} and offset {shift}"
            if flaw:
                raise RobotFileError(
                    self.path,
                    f"joint {joint.name!r} mimics {joint.mimic.joint!r}, {flaw}",
                    f"correct its <mimic>, or hold it still: locked={{{joint.name!r}: value}}",
                )
            joint = master
            seen.add(joint.name)
        return joint, multiplier, offset


def _read(path: str | Path) -> Any:
    content = essentials(path)
    import yourdfpy

    logger = logging.getLogger("yourdfpy")
    level = logger.level
    logger.setLevel(logging.CRITICAL)  # what it has to say stands in its exceptions, too
    try:
        model = yourdfpy.URDF.load(
            io.BytesIO(content), build_scene_graph=False, load_meshes=False, build_collision_scene_graph=False,
            load_collision_meshes=False,
        ).robot  # fmt: skip
    except (SyntaxError, ValueError, AttributeError, TypeError, LookupError, AssertionError) as e:
        fact = str(e).splitlines()[0] if str(e) else type(e).__name__
        if isinstance(e, KeyError):
            fact = f"an element lacks its {e}"
        elif isinstance(e, AttributeError):
            fact = "an element lacks a part, such as a joint its <parent> or <child>"
        raise RobotFileError(path, f"is not a URDF that can be read ({fact})", "check it with `check_urdf`") from e
    finally:
        logger.setLevel(level)
    if not model.joints:
        raise RobotFileError(path, "has no joints", "give a URDF of a robot; xacro files must be expanded first")
    _check_tree(path, model)
    return model


def _check_tree(path: str | Path, model: Any) -> None:
    """What yourdfpy lets pass. Raises: RobotFileError."""
    links = {link.name for link in model.links}
    seen: set[tuple[str, str]] = set()
    for kind, name in [("link", link.name) for link in model.links] + [
        pair for joint in model.joints for pair in (("joint", joint.name), ("child link", joint.child))
    ]:
        if (kind, name) in seen:
            fact = f"link {name!r} hangs on two joints" if kind == "child link" else f"has two {kind}s named {name!r}"
            raise RobotFileError(path, fact, "correct the file: links and joints must form a tree")
        seen.add((kind, name))
    for joint in model.joints:
        for link in (joint.parent, joint.child):
            if link not in links:
                raise RobotFileError(path, f"joint {joint.name!r} joins link {link!r}, which is not there", "add it")
        if joint.origin is not None and not np.isfinite(joint.origin).all():
            raise RobotFileError(path, f"joint {joint.name!r} has an origin that is not finite", "give plain numbers")


def _root(path: str | Path, links: Sequence[str], parent_joint: Mapping[str, Any]) -> str:
    roots = [link for link in links if link not in parent_joint]
    if not roots:
        raise RobotFileError(path, "has joints that form a loop", "cut the loop: links and joints must form a tree")
    if len(roots) != 1:
        raise RobotFileError(path, f"has {len(roots)} roots: {', '.join(roots)}", "give base=")
    return roots[0]


def _leaves(links: Sequence[str], parent_joint: Mapping[str, Any]) -> list[str]:
    inner = {joint.parent for joint in parent_joint.values()}
    return [link for link in links if link not in inner]


def _chain(tip: str, root: str, parent_joint: Mapping[str, Any]) -> list[Any] | None:
    chain: list[Any] = []
    link = tip
    while link != root:
        if link not in parent_joint or len(chain) > len(parent_joint):
            return None
        chain.append(parent_joint[link])
        link = parent_joint[link].parent
    return chain[::-1]


def _wanted_tips(
    path: str | Path, tip: str | Sequence[str] | None, links: Sequence[str], parents: Mapping[str, Any], root: str
) -> list[str]:
    if tip is None:
        below = [leaf for leaf in _leaves(links, parents) if _chain(leaf, root, parents)]
        if not below:
            others = ", ".join(leaf for leaf in _leaves(links, parents) if leaf != root)
            raise RobotFileError(path, f"ends at base {root!r}", f"give tip=, the link to reach from there: {others}")
        if len(below) != 1:
            raise RobotFileError(
                path, f"branches into {len(below)} tips", f"give tip=, one or more of {', '.join(below)}"
            )
        return below
    wanted = [tip] if isinstance(tip, str) else list(tip)
    for link in wanted:
        if link not in links:
            raise UnknownNameError(f"link of {path}", link, links)
    return wanted


def _check_locked(path: str | Path, joint: Any, value: Any) -> None:
    what = f"locked joint {joint.name!r} of {path}"
    if joint.type not in MOVING:
        raise ArgumentError(f"the type of {what}", joint.type, "it needs no lock; name joints that move")
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not np.isfinite(value):
        raise ArgumentError(what, value, "give a finite value in m or rad")
    try:
        limits = _coordinate(joint)
    except ArgumentError as problem:
        raise RobotFileError(path, f"{problem.what} is {problem.value}", problem.cure) from problem
    if not limits.lower - TOLERANCES.limit <= value <= limits.upper + TOLERANCES.limit:
        raise ArgumentError(what, value, f"give a value within its limits [{limits.lower:.6g}, {limits.upper:.6g}]")


def _coordinate(joint: Any) -> Coordinate:
    kind = "prismatic" if joint.type == "prismatic" else "revolute"
    limit = joint.limit

    def of_limit(name: str, missing: float) -> float:
        value = getattr(limit, name, None) if limit is not None else None
        return missing if value is None else float(value)

    if joint.type == "continuous":
        return Coordinate(joint.name, kind, max_velocity=of_limit("velocity", np.inf) or np.inf)
    lower, upper = of_limit("lower", -np.inf), of_limit("upper", np.inf)
    return Coordinate(joint.name, kind, lower, upper, of_limit("velocity", np.inf) or np.inf)


def _axis(path: str | Path, joint: Any) -> np.ndarray:
    """Unit axis (3,) of a joint; x where the file has none."""
    axis = np.asarray([1.0, 0.0, 0.0] if joint.axis is None else joint.axis, dtype=float)
    length = np.linalg.norm(axis)
    if axis.shape != (3,) or not np.isfinite(length) or length == 0.0:
        raise RobotFileError(path, f"joint {joint.name!r} has axis {axis}", "give it a direction, three numbers")
    return axis / length


def _body(joint: int, placement: Matrix, inertial: Any) -> Body:
    T = placement if inertial.origin is None else placement @ np.asarray(inertial.origin, dtype=float)
    given = np.zeros((3, 3)) if inertial.inertia is None else np.asarray(inertial.inertia, dtype=float)
    with np.errstate(all="ignore"):  # senseless masses are told by what needs them
        inertia = T[:3, :3] @ given @ T[:3, :3].T
    return Body(joint, float(inertial.mass), T[:3, 3], inertia)


def _motion(kind: str, axis: np.ndarray, value: float) -> Matrix:
    T = np.eye(4)
    if kind == "prismatic":
        T[:3, 3] = axis * value
    else:
        K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        T[:3, :3] = np.eye(3) + np.sin(value) * K + (1 - np.cos(value)) * (K @ K)
    return T
