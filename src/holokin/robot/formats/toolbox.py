"""Robots of the Robotics Toolbox for Python (roboticstoolbox): from DH tables, elementary transforms or URDFs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.types import Matrix, Vector
from ..chains import robot_of
from ..model import Robot
from ..tree import Branch, Mass, Tree, checked


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
            joints.append(_moving(step, names[step.jindex], parent, f"link {step.jindex + 1}", origin))
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
        joints.append(_moving(link.v, link.name, parent, link.name, origin, link.qlim) if link.isjoint else joint)
    tool = _constant(robot.tool.A)
    if not np.array_equal(tool, np.eye(4)):
        inner = {joint.parent for joint in joints}
        ends = [joint.child for joint in joints if joint.child not in inner]
        joints += [Branch(f"tool of {end}", "fixed", end, f"tool of {end}", tool) for end in ends]
    return joints


def _constant(A: Any) -> Matrix:
    return np.asarray(A, dtype=float)


def _moving(step: Any, name: str, parent: str, child: str, origin: Matrix, limits: Any = None) -> Branch:
    """The branch of a variable transform, "Rz" or "tx" and so on; a flipped one moves the other way."""
    kind = "prismatic" if step.kind.startswith("t") else "revolute"
    axis: Vector = np.eye(3)["xyz".index(step.kind[-1])] * (-1.0 if step.isflip else 1.0)
    limits = step.qlim if limits is None else limits
    lower, upper = (-np.inf, np.inf) if limits is None else map(float, np.ravel(limits)[:2])
    return Branch(name, kind, parent, child, origin, axis, lower, upper)
