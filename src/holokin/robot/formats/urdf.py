"""Robots from URDF files: revolute, continuous, prismatic, fixed and mimic joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, RobotFileError
from ...base.types import Matrix
from ..chains import robot_of
from ..model import Robot
from ..shapes.urdf_shapes import Finder, mesh_finder, shapes_of, slashed
from ..shapes.visuals import urdf_visuals
from ..tree import Branch, Follow, Mass, Tree, checked
from .urdf_xml import Misread, essentials, model_of, read_model, turned_joints


@typed
def from_urdf(
    path: str | Path,
    tip: str | Sequence[str] | None = None,
    base: str | None = None,
    locked: Mapping[str, float] | None = None,
    trust_units: bool = False,
) -> Robot:
    """A robot from a URDF: the chain, or chains, from `base` to `tip`.

    Limits are those of <limit>, narrowed by the soft limits of <safety_controller>, and so that all joints that mimic
    a joint are within theirs.

    Args:
        path: the file; meshes are not needed.
        tip: link that carries the tool, or several for a robot with several arms (the first is the default
            tip). Without it the tree must end in one link only.
        base: link that stays put and whose frame is used; by default the root of the tree. It may be a hand: from
            one hand of a two-armed robot to the other, the task is their relative pose and all joints share it.
        locked: joint name -> value [m or rad] of joints to hold still.
        trust_units: take the numbers for rad and m, whatever they look like.

    Raises:
        RobotFileError: missing or malformed file, a joint type that cannot be used, limits that exclude each other, a
        branching tree without `tip`; links of over 20 m on average, which look like millimetres, or limits of most
        hinges of more than two turns, which look like degrees.
        UnknownNameError: a link or joint that the file does not have.
        ArgumentError: a locked joint that cannot move, or a value that is no number or outside its limits.
    """
    return robot_of(urdf_tree(path), tip, base, locked, trust_units)


@typed
def from_yourdfpy(
    urdf: Any,
    tip: str | Sequence[str] | None = None,
    base: str | None = None,
    locked: Mapping[str, float] | None = None,
    trust_units: bool = False,
) -> Robot:
    """A robot from a `yourdfpy.URDF`; the other arguments and errors as of `from_urdf`.

    Raises:
        ArgumentError: it is none. RobotFileError, UnknownNameError.
    """
    if not all(hasattr(getattr(urdf, "robot", None), part) for part in ("name", "links", "joints")):
        raise ArgumentError("urdf", urdf, "give a yourdfpy.URDF, as yourdfpy.URDF.load(file) makes it")
    handler = getattr(urdf, "_filename_handler", None)  # what it finds its own meshes with

    def find(name: str) -> Path:
        return Path(slashed(name) if handler is None else handler(slashed(name)))

    tree = _tree(f"yourdfpy.URDF {urdf.robot.name!r}", urdf.robot, "robot", find)
    return robot_of(tree, tip, base, locked, trust_units)


def urdf_tree(path: str | Path) -> Tree:
    """The tree of a URDF. Raises: RobotFileError."""
    return urdf_text_tree(read_model(path), path)


def urdf_text_tree(text: bytes, path: str | Path) -> Tree:
    """The same of the text of a file. Raises: RobotFileError."""
    root = essentials(text, path)
    try:
        model = model_of(root)
    except Misread as e:
        raise RobotFileError(path, e.fact, e.cure) from None
    return replace(_tree(str(path), model, Path(path).stem, mesh_finder(path)), turned=turned_joints(root))


def _tree(source: str, model: Any, name: str, find: Finder) -> Tree:
    """The tree of a robot. Raises: RobotFileError."""
    if not model.joints:
        cure = "give a URDF of a robot; a xacro file is expanded when its name ends in .xacro"
        raise RobotFileError(source, "has no joints", cure)
    links: dict[str, Mass | None] = {}
    for link in model.links:
        if link.name in links:
            cure = "correct the file: links and joints must form a tree"
            raise RobotFileError(source, f"has two links named {link.name!r}", cure)
        links[link.name] = _mass(link.inertial)
    joints = tuple(_branch(joint) for joint in model.joints)
    shapes = shapes_of(model.links, source, find)
    visuals = urdf_visuals(model, find)
    return checked(Tree(source, str(model.name or name), links, joints, shapes=shapes, visuals=visuals))


def _branch(joint: Any) -> Branch:
    (lower, upper), speed = _range(joint), _of(joint.limit, "velocity", np.inf)
    kind, mimic = joint.type, None
    if kind == "continuous":
        kind, lower, upper = "revolute", -np.inf, np.inf
    if joint.mimic is not None:
        gain = 1.0 if joint.mimic.multiplier is None else float(joint.mimic.multiplier)
        shift = 0.0 if joint.mimic.offset is None else float(joint.mimic.offset)
        mimic = Follow(joint.mimic.joint, gain, shift)
    axis = np.asarray([1.0, 0.0, 0.0] if joint.axis is None else joint.axis, dtype=float)
    return Branch(
        joint.name, kind, joint.parent, joint.child, _pose(joint.origin), axis, lower, upper, speed, follows=mimic
    )


def _range(joint: Any) -> tuple[float, float]:
    """The positions within its limits, and within its soft limits, where ROS controllers and MoveIt keep it."""
    soft = joint.safety_controller
    lower = max(_of(joint.limit, "lower", -np.inf), _of(soft, "soft_lower_limit", -np.inf))
    return lower, min(_of(joint.limit, "upper", np.inf), _of(soft, "soft_upper_limit", np.inf))


def _of(element: Any, name: str, missing: float) -> float:
    value = getattr(element, name, None)
    return missing if value is None else float(value)


def _pose(origin: Any) -> Matrix:
    return np.eye(4) if origin is None else np.asarray(origin, dtype=float)


def _mass(inertial: Any) -> Mass | None:
    if getattr(inertial, "mass", None) is None:
        return None
    T = _pose(inertial.origin)
    given = np.zeros((3, 3)) if inertial.inertia is None else np.asarray(inertial.inertia, dtype=float)
    with np.errstate(all="ignore"):  # senseless masses are told by what needs them
        return Mass(float(inertial.mass), T[:3, 3], T[:3, :3] @ given @ T[:3, :3].T)
