"""The pose of a leaf that is nearest to a wanted one: what a robot does whose operator's hand leaves its reach."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from ..errors import ArgumentError
from ..strategies import HolonomicStrategy
from ..types import ArrayLike, Matrix, Value, Vector, frozen, kept, positive
from .edge import Edge, Look
from .leaf import WayEnd, leaf_value, leaf_walk, straight_way

LENGTH = 0.3
"""Length [m] that weighs angles against positions: 0.1 rad count as 3 cm. Arms of a metre have their best rcond at it
(Panda and iiwa at their ready postures, measured)."""

MARGIN = 0.1
"""rcond to which the tool may go. Measured on a Panda, stretched: 3 mm of reach are left out, and its joints move at
most five times as fast as at its ready posture."""

BETTER = 1e-6
"""By how much nearer, as a share, the pose found from the start must be for the robot to leave one that it has."""


class InverseStatus(IntEnum):
    REACHED = 0
    CLAMPED = 1
    NOT_FINITE = 5
    NOT_A_ROTATION = 6


@dataclass(frozen=True, eq=False)
class Nearest(Value):
    """The posture q (n,) of a leaf whose tool pose (4, 4) is nearest to a wanted one.

    distance [m] = sqrt(position^2 + (length angle)^2): what is missing, with its parts position [m] and angle [rad].
    status: REACHED where nothing is missing, else CLAMPED, or what is wrong with the wanted pose. held: what stops the
    tool, "rcond" and the names of joints at their limits. moving: the step was too short to get there in this call.
    """

    q: Vector
    pose: Matrix
    status: InverseStatus
    distance: float
    position: float
    angle: float
    rcond: float
    held: tuple[str, ...]
    moving: bool = False


def nearest_pose(ik, pose: ArrayLike, q=None, *, length=LENGTH, rcond=MARGIN, limits=False, step=None) -> Nearest:
    strategy, start = ik.strategy, ik.start
    robot = strategy.task.robot
    inf = np.full(robot.n, np.inf)
    edge = Edge(strategy, start, length, rcond, robot.lower if limits else -inf, robot.upper if limits else inf)
    p, R = ik.target(pose)
    if q is None:
        at, status = cold(edge, strategy, start, p, R)
        return made(edge, strategy, at, status)
    return warm(edge, strategy, start, q, p, R, step)


def cold(edge: Edge, strategy: HolonomicStrategy, start: Vector, p: Vector, R: Matrix) -> tuple[Look, InverseStatus]:
    leaf = leaf_value(strategy, start)
    q, ended = leaf_walk(strategy, start)(start, straight_way(strategy.task, start, p, R, (leaf, leaf)))
    at = edge.look(q, p, R)
    if ended is WayEnd.REACHED and at.excess <= 1e-10:
        return at, InverseStatus.REACHED
    at = edge.inside(at, p, R) or edge.look(start, p, R)
    at, _ = edge.descend(at, p, R)
    return at, InverseStatus.REACHED if at.distance <= 1e-9 else InverseStatus.CLAMPED


def warm(edge, strategy, start, q, p, R, step):
    at = edge.inside(edge.look(q, p, R), p, R)
    if at is None:
        at, status = cold(edge, strategy, start, p, R)
        return made(edge, strategy, at, status)
    end, cut = edge.descend(at, p, R, step)
    status = InverseStatus.REACHED if end.distance <= 1e-9 else InverseStatus.CLAMPED
    if status is InverseStatus.CLAMPED:
        other, cold_status = cold(edge, strategy, start, p, R)
        if other.distance < (1 - BETTER) * end.distance - 1e-9:
            if step is None:
                return made(edge, strategy, other, cold_status)
            x = strategy.task.robot.pose(start, strategy.task.tip)
            back = edge.look(at.q, x[:3, 3], x[:3, :3])
            end, cut = edge.descend(back, x[:3, 3], x[:3, :3], step)
            end = edge.look(end.q, p, R)
            cut = cut and edge.look(cut.q, p, R)
    if cut is not None:
        return made(edge, strategy, cut, InverseStatus.CLAMPED, True)
    return made(edge, strategy, end, status)


def made(edge, strategy, at: Look, status, moving=False):
    m = strategy.task.m
    far = [row < 3 for row in strategy.task.rows]
    T = np.eye(4)
    T[:3, 3], T[:3, :3] = at.position, at.rotation
    linear = float(np.linalg.norm(at.e[far]))
    angular = float(np.linalg.norm(at.e[np.logical_not(far)])) / edge._length[0]
    return Nearest(at.q, T, status, at.distance, linear, angular, at.rcond, ())
