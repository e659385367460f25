"""Which shapes are to keep apart in a proof: the pairs of `check`, and obstacles that stand still."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..base.types import Vector, number
from ..checking.keeping_clear import Clearances, posture_clearances
from ..errors import ArgumentError
from ..robot import LinkShape, Robot, chain_length
from ..strategies import HolonomicStrategy
from .clear_cells import ClearCells, joints_of, shape_pairs

CLEARANCE = 0.02
"""What is proven by default [m]: a model is off by millimetres, and so is the robot behind it."""

LARGE = 50.0
"""Lengths of the arm's chain beyond which the size or the place of an obstacle is not in metres."""


def kept_apart(
    strategy: HolonomicStrategy, q0: Vector, clear_of: Sequence[LinkShape] | None, floor: float | None,
    clearance: float, self_collision: bool, ignore: Sequence[tuple[str, str]],
    shapes_of: Robot | None = None,
) -> ClearCells | None:  # fmt: skip
    """What tells of the distances; None where nothing is asked about them.

    Raises:
        ArgumentError: an obstacle that moves, or in millimetres; shapes that are nearer at q0 than is asked; a robot
            without links; nothing to look at. UnknownNameError: no such link. RobotFileError: an unreadable mesh.
    """
    asked = clearances_of(strategy.task.robot, clear_of, floor, clearance, self_collision, ignore, shapes_of)
    if asked is None:
        return None
    found = ClearCells(asked.robot, shape_pairs(asked.pairs.gaps, asked.pairs.limits), asked.pairs)
    near = found.distances(q0[None])[0]
    for pair, distance in zip(found.pairs, near, strict=True):
        if distance < pair.wanted:
            one, other = pair.names
            fact = f"{one} and {other} are {max(distance, 0.0):.3g} m apart there"
            raise ArgumentError("q0", np.round(q0, 4).tolist(), f"{fact}: give another posture, or a smaller clearance")
    return found


def clearances_of(
    own: Robot, clear_of: Sequence[LinkShape] | None, floor: float | None, clearance: float, self_collision: bool,
    ignore: Sequence[tuple[str, str]], shapes_of: Robot | None,
) -> Clearances | None:  # fmt: skip
    """What tells of the distances at single postures; None where nothing is asked about them.

    Raises:
        ArgumentError, UnknownNameError, RobotFileError: as `kept_apart`, but for what is said of q0.
    """
    if clear_of is None:
        if floor is not None:
            raise ArgumentError("floor", floor, "give clear_of, too: [] for the floor and the links alone")
        return None
    robot = shapes_of or own
    robot.check_links()
    if joints_of(robot) != joints_of(own):
        raise ArgumentError("shapes_of", robot.name, "give the same robot, with other shapes")
    level = None if floor is None else number("floor", floor)
    if level is not None and not np.isfinite(level):
        raise ArgumentError("floor", level, "give its height in m, or None")
    _checked(robot, clear_of, {"floor": level or 0.0, "clearance": number("clearance", clearance)})
    found = posture_clearances(robot, clear_of, level, clearance, self_collision, ignore)
    for one in found.pairs.unseen:
        if any(one.link == shape.link for shape in clear_of):
            raise ArgumentError(f"the obstacle {one.link!r}", one.reason, "give a box, a capsule, a cylinder or a mesh")
    if not found.pairs.gaps:
        raise ArgumentError("clear_of", list(clear_of), "give obstacles or a floor, or let the links be looked at")
    return found


def _checked(robot: Robot, obstacles: Sequence[LinkShape], lengths: Mapping[str, float]) -> None:
    most = LARGE * max(chain_length(robot), 0.1)
    for name, length in lengths.items():
        if abs(length) > most:
            raise ArgumentError(name, length, "give metres: it is more than 50 times as far as the arm is long")
    for one in obstacles:
        if one.joint >= 0:
            cure = "a proof is about obstacles that stand still: put what the tool carries on it by hk.with_shape"
            raise ArgumentError("an obstacle that moves", one.link, cure)
        if one.shape.fault:
            raise ArgumentError(f"the obstacle {one.link!r}", one.shape.fault, "give a shape that can be read")
        center, size = one.shape.ball
        if size + np.linalg.norm(one.placement[:3, 3] + one.placement[:3, :3] @ center) > most:
            cure = "give metres: it is more than 50 times as far or as large as the arm is long"
            raise ArgumentError(f"the obstacle {one.link!r}", f"{size:.3g}", cure)
