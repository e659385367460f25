"""The pose of a leaf that is nearest to a wanted one: what a robot does whose operator's hand leaves its reach."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arguments import typed
from ..errors import ArgumentError, ShapeError
from ..strategies import HolonomicStrategy
from ..types import ArrayLike, Matrix, Value, Vector, frozen, kept, numbers, positive
from .edge import WITHIN, Edge, Look
from .leaf import WayEnd, leaf_value, leaf_walk, straight_way
from .solutions import InverseStatus

LENGTH = 0.3
"""Length [m] that weighs angles against positions: 0.1 rad count as 3 cm. Arms of a metre have their best rcond at it
(Panda and iiwa at their ready postures, measured)."""

MARGIN = 0.1
"""rcond up to which the tool goes. Measured on a Panda, stretched: 3 mm of reach are left out, and its joints move at
most five times as fast as at its ready posture."""

REACHED = 1e-9
"""Distance [m] that counts as none."""

@dataclass(frozen=True, eq=False)
class Nearest(Value):
    """The posture q (n,) of a leaf whose tool pose (4, 4) is nearest to a wanted one.

    distance [m] = sqrt(position^2 + (length angle)^2): what is missing, with its parts position [m] and angle [rad].
    status: REACHED where nothing is missing, else CLAMPED, or what is wrong with the wanted pose. held: what stops the
    tool, "rcond" and the names of joints at their limits. moving: True where `step` was too short to get there in this
    call.
    """

    q: Vector
    pose: Matrix
    status: InverseStatus
    distance: float
    position: float
    angle: float
    rcond: float
    held: tuple[str, ...] = ()
    moving: bool = False


@kept
def edge_of(strategy: HolonomicStrategy, start: tuple[float, ...], length: float, rcond: float, limits: bool) -> Edge:
    """The edge of the leaf through a start. Raises: ArgumentError: the start lies beyond it. JointLimitError."""
    robot, q0 = strategy.task.robot, np.array(start)
    if limits:
        robot.check_limits(q0)
    free = np.full(robot.n, np.inf)
    edge = Edge(strategy, q0, length, rcond, *((robot.lower, robot.upper) if limits else (-free, free)))
    here = edge.look(q0, *edge.tool(q0))
    if here.rcond < rcond:
        cure = f"give a smaller one, or a start farther from singular postures: this one has {here.rcond:.3g}"
        raise ArgumentError("rcond, which the tool is not to go below", rcond, cure)
    return edge


def from_start(edge: Edge, p: Vector, R: Matrix) -> tuple[Look, bool]:
    """The look where the straight way from the start to (p, R) ends; True where that is its end, within constraints."""
    s, start = edge.strategy, edge.start
    q, ended = leaf_walk(s, start)(start, straight_way(s.task, start, p, R, (edge.leaf, edge.leaf)))
    at = edge.look(q, p, R)
    return at, ended is WayEnd.REACHED and at.excess <= WITHIN


def cold(edge: Edge, p: Vector, R: Matrix) -> Look:
    """The look at the posture nearest to (p, R), found from the start alone."""
    at, reached = from_start(edge, p, R)
    if reached:
        return at
    return edge.descend(edge.inside(at, p, R) or edge.look(edge.start, p, R), p, R)[0]


def warm(edge: Edge, p: Vector, R: Matrix, q: Vector, step: Vector | None) -> tuple[Look, bool]:
    """The same from a posture nearby, each joint moving by at most a step (n,); with True where that cut it short."""
    at = edge.inside(edge.look(q, p, R), p, R)
    if at is None:
        raise ArgumentError("the posture to begin from", q.tolist(), "give the last answer, or leave it out")
    end, cut = edge.descend(at, p, R, step)
    if end.distance > REACHED:
        other, reached = from_start(edge, p, R)
        if reached and step is None:
            return other, False
        if reached:  # the way there leads by the start at the latest, from which it is straight
            back = edge.tool(edge.start)
            end, cut = edge.descend(edge.look(at.q, *back), *back, step)
            return edge.look((cut or end).q, p, R), True
    return (end, False) if cut is None else (cut, True)


def nearest_made(edge: Edge, at: Look, moving: bool = False) -> Nearest:
    """The result of a look."""
    task, pose = edge.strategy.task, np.eye(4)
    pose[:3, 3], pose[:3, :3] = at.position, at.rotation
    linear = np.array([row < 3 for row in task.rows])
    status = InverseStatus.REACHED if at.distance <= REACHED else InverseStatus.CLAMPED
    position, angle = (float(np.linalg.norm(at.e[rows])) for rows in (linear, ~linear))
    return Nearest(at.q, pose, status, at.distance, position, angle / edge.length, at.rcond, edge.held(at), moving)


def nearest(
    edge: Edge, p: Vector, R: Matrix, status: InverseStatus, q: Vector | None, step: ArrayLike | None
) -> Nearest:
    """The nearest pose to (p, R), from the start or from q; `status`: whether they are a pose at all."""
    if status is not InverseStatus.REACHED:
        n = len(edge.start)
        stays, nothing = np.full(n, np.nan) if q is None else q, np.full((4, 4), np.nan)
        return Nearest(stays, nothing, status, np.nan, np.nan, np.nan, np.nan)
    if q is None:
        return nearest_made(edge, cold(edge, p, R))
    most = None if step is None else np.broadcast_to(numbers("step", step), q.shape)
    return nearest_made(edge, *warm(edge, p, R, q, most))
