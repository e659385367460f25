"""Robots of other libraries: Pinocchio models, and the Robotics Toolbox for Python (roboticstoolbox)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.types import Matrix, Vector
from ..chains import robot_of
from ..model import Robot
from ..tree import Branch, Follow, Mass, Tree, checked

# --- Robots from Pinocchio models.


@typed
def from_pinocchio(
    model: Any,
    tip: str | Sequence[str] | None = None,
    base: str | None = None,
    locked: Mapping[str, float] | None = None,
    trust_units: bool = False,
) -> Robot:
    """A robot from a `pinocchio.Model`: the chain, or chains, from `base` to `tip`.

    Where Pinocchio has a cosine and a sine for an unlimited joint, the robot has its angle. Joints that mimic others
    follow them when the model was built with `mimic=True`; else Pinocchio itself makes them independent.

    Args:
        model: a `pinocchio.Model`.
        tip: frame that carries the tool, or several. Of frames of one name the body's keeps it; the others are
            called "name (joint)", "name (fixed_joint)". Without it the tree of frames must end in one only.
        base: frame that stays put and that poses count from; by default the universe.
        locked: joint name -> value [m or rad] of joints to hold still.
        trust_units: take the numbers for rad and m, whatever they look like.

    Raises:
        ArgumentError: it is none. UnknownNameError: a frame or joint that it does not have.
        RobotFileError: on the chain a joint of several degrees of freedom, or a helical one; a branching tree
        without `tip`; units as of `from_urdf`.
    """
    if not all(hasattr(model, part) for part in ("jointPlacements", "frames", "lowerPositionLimit")):
        raise ArgumentError("model", model, "give a pinocchio.Model, as pinocchio.buildModelFromUrdf(file) makes it")
    return robot_of(_tree(model), tip, base, locked, trust_units)


def _tree(model: Any) -> Tree:
    """Frames are links. That of a joint hangs on the frame before it by the joint, all others are fixed to theirs."""
    names = _frame_names(model)
    links: dict[str, Mass | None] = dict.fromkeys(names)
    of_joint = {frame.parentJoint: name for frame, name in zip(model.frames, names, strict=True) if _is_joint(frame)}
    of_joint[0] = names[0]
    joints = []
    for number in range(1, model.njoints):
        if number not in of_joint:  # added without a frame of its own
            parent, name = of_joint[model.parents[number]], model.names[number]
            joints.append(_pinocchio_joint(model, number, parent, name, model.jointPlacements[number].homogeneous))
            of_joint[number], links[name] = name, None
    for frame, name in list(zip(model.frames, names, strict=True))[1:]:
        before = model.frames[frame.parentFrame]
        carrier = model.parents[frame.parentJoint] if _is_joint(frame) else frame.parentJoint
        placement = model.jointPlacements[frame.parentJoint] if _is_joint(frame) else frame.placement
        parent, origin = of_joint[carrier], placement.homogeneous
        if before.parentJoint == carrier and names[frame.parentFrame] != name:
            parent, origin = names[frame.parentFrame], _between(before.placement.homogeneous, origin)
        if _is_joint(frame):
            joints.append(_pinocchio_joint(model, frame.parentJoint, parent, name, origin))
        else:
            joints.append(Branch(f"to {name}", "fixed", parent, name, origin))
    for joint, name in of_joint.items():
        inertia = model.inertias[joint]
        if inertia.mass:
            links[name] = Mass(float(inertia.mass), np.array(inertia.lever), np.array(inertia.inertia))
    return checked(Tree(f"pinocchio.Model {model.name!r}", model.name, links, tuple(joints), word="frame"))


def _frame_names(model: Any) -> list[str]:
    """A name of its own for each frame."""
    kinds = [str(frame.type).rpartition(".")[2].lower() for frame in model.frames]
    bodies = {frame.name for frame, kind in zip(model.frames, kinds, strict=True) if kind == "body"}
    names: list[str] = []
    for frame, kind in zip(model.frames, kinds, strict=True):
        name = frame.name
        if name in names or (name in bodies and kind != "body"):
            name = f"{name} ({kind})"
        while name in names:
            name += "'"
        names.append(name)
    return names


def _is_joint(frame: Any) -> bool:
    return str(frame.type).endswith("JOINT") and not str(frame.type).endswith("FIXED_JOINT")


def _between(first: Matrix, second: Matrix) -> Matrix:
    """The pose of one frame in another; both in the same third one."""
    if np.array_equal(first, np.eye(4)):
        return second
    T, R = np.eye(4), first[:3, :3].T
    T[:3, :3], T[:3, 3] = R @ second[:3, :3], R @ (second[:3, 3] - first[:3, 3])
    return T


def _pinocchio_joint(model: Any, number: int, parent: str, child: str, origin: Matrix) -> Branch:
    """The branch of a joint: its axis is the one column of the motion subspace S (6, 1), v above w."""
    joint = model.joints[number]
    name, kind, follows, scale = model.names[number], joint.shortname(), None, 1.0
    if "Mimic" in kind:
        law = joint.extract()
        same = [i for i in range(1, model.njoints) if model.joints[i].idx_q == joint.idx_q and model.joints[i].nq]
        follows, scale = Follow(model.names[same[0]], float(law.scaling), float(law.offset)), float(law.scaling)
    elif joint.nv != 1:
        return Branch(name, kind, parent, child, origin)
    data = joint.createData()
    joint.calc(data, np.eye(max(joint.nq, 1))[0])
    v, w = np.asarray(data.S, dtype=float).reshape(2, 3) / scale  # that of a mimic holds its scale
    if v.any() == w.any():
        return Branch(name, kind, parent, child, origin)
    kind, axis = ("prismatic", v) if v.any() else ("revolute", w)
    bounded = joint.nq == 1
    lower = _bound(model.lowerPositionLimit[joint.idx_q]) if bounded else -np.inf
    upper = _bound(model.upperPositionLimit[joint.idx_q]) if bounded else np.inf
    speed = _bound(model.velocityLimit[joint.idx_v]) if joint.nv else np.inf
    return Branch(name, kind, parent, child, origin, axis, lower, upper, speed, follows=follows)


def _bound(value: float) -> float:
    """A limit; Pinocchio writes the largest double where there is none."""
    return float(value) if abs(value) < np.finfo(float).max else float(np.copysign(np.inf, value))


@typed
def from_roboticstoolbox(
    robot: Any,
    tip: str | Sequence[str] | None = None,
    base: str | None = None,
    locked: Mapping[str, float] | None = None,
    trust_units: bool = False,
) -> Robot:
    """A robot from a `roboticstoolbox.DHRobot` or `roboticstoolbox.Robot`, with its base and tool transforms.

    It has no speed limits and no masses, since the toolbox gives them in other frames, or not at all.

    Args:
        robot: the toolbox's robot. Joints are called like their links; those of a DH robot q1 to qn, and its end
            "tool".
        tip: link that carries the tool, or several. Without it the tree must end in one link only.
        base: link that stays put and that poses count from; by default the world.
        locked: joint name -> value [m or rad] of joints to hold still.
        trust_units: take the numbers for rad and m, whatever they look like.

    Raises:
        ArgumentError: it is no robot of the toolbox. UnknownNameError: a link or joint that it does not have.
        RobotFileError: a branching tree without `tip`; units as of `from_urdf`.
    """
    if not all(hasattr(robot, part) for part in ("links", "ets", "fkine", "qlim")):
        raise ArgumentError("robot", robot, "give a robot of roboticstoolbox: a DHRobot or a Robot")
    joints = _of_table(robot) if hasattr(robot, "mdh") else _of_links(robot)
    links: dict[str, Mass | None] = dict.fromkeys(["world", *(joint.child for joint in joints)])
    name = str(robot.name or "robot")
    tree = checked(Tree(f"roboticstoolbox {name!r}", name, links, tuple(joints)))
    return robot_of(tree, tip, base, locked, trust_units)


def _of_table(robot: Any) -> list[Branch]:
    """A DH robot: its elementary transforms, base and tool included, one after the other."""
    names = [f"q{i + 1}" for i in range(robot.n)]
    joints, parent, origin = [], "world", np.eye(4)
    for step in robot.ets():
        if step.isjoint:
            joints.append(_toolbox_joint(step, names[step.jindex], parent, f"link {step.jindex + 1}", origin))
            parent, origin = f"link {step.jindex + 1}", np.eye(4)
        else:
            origin = origin @ _constant(step.A())
    return [*joints, Branch("to tool", "fixed", parent, "tool", origin)]


def _of_links(robot: Any) -> list[Branch]:
    """A tree of links: constant transforms, then at most one joint; the tool is fixed to the links at its ends."""
    joints = []
    for link in robot.links:
        parent = "world" if link.parent is None else link.parent.name
        origin = np.eye(4) if link.parent is not None else _constant(robot.base.A)
        for step in link.ets:
            if not step.isjoint:
                origin = origin @ _constant(step.A())
        joint = Branch(f"to {link.name}", "fixed", parent, link.name, origin)
        joints.append(
            _toolbox_joint(link.v, link.name, parent, link.name, origin, link.qlim) if link.isjoint else joint
        )
    tool = _constant(robot.tool.A)
    if not np.array_equal(tool, np.eye(4)):
        inner = {joint.parent for joint in joints}
        ends = [joint.child for joint in joints if joint.child not in inner]
        joints += [Branch(f"tool of {end}", "fixed", end, f"tool of {end}", tool) for end in ends]
    return joints


def _constant(A: Any) -> Matrix:
    return np.asarray(A, dtype=float)


def _toolbox_joint(step: Any, name: str, parent: str, child: str, origin: Matrix, limits: Any = None) -> Branch:
    """The branch of a variable transform, "Rz" or "tx" and so on; a flipped one moves the other way."""
    kind = "prismatic" if step.kind.startswith("t") else "revolute"
    axis: Vector = np.eye(3)["xyz".index(step.kind[-1])] * (-1.0 if step.isflip else 1.0)
    limits = step.qlim if limits is None else limits
    lower, upper = (-np.inf, np.inf) if limits is None else map(float, np.ravel(limits)[:2])
    return Branch(name, kind, parent, child, origin, axis, lower, upper)
