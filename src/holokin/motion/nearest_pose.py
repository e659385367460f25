"""The pose of a leaf that is nearest to a wanted one: what a robot does whose operator's hand leaves its reach."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..codegen import LARGEST, EdgeKernel, enabled, tell
from ..errors import ArgumentError, NativeError, posture_text
from ..strategies import HolonomicStrategy
from ..types import Matrix, Value, Vector, kept
from .descent import CONSTANTS, WITHIN, descend, inside
from .edge import Edge, Goal, Look, edge_function
from .leaf import TRIES, leaf_step
from .solutions import InverseStatus
from .stretch import inverse_code, stretch_code

LENGTH = 0.3
"""Length [m] that weighs angles against positions: 0.1 rad count as 3 cm. Arms of a metre have their best rcond at it
(Panda and iiwa at their ready postures, measured)."""

MARGIN = 0.1
"""rcond up to which the tool goes. Measured on a Panda, stretched: 2 to 5 mm of reach are left out, and its joints move
at most five times as fast as at its ready posture. Half of it leaves out a quarter and lets them move twice as fast."""

HELD = 1e-7
"""Distance to a constraint [m] at which it stops the tool."""

REACHED = 1e-9
"""Distance [m] that counts as none."""


_REFUSED = {2: InverseStatus.NOT_FINITE, 3: InverseStatus.NOT_A_ROTATION}
"""What native code says of a goal that is no pose."""


@dataclass(frozen=True, eq=False)
class Nearest(Value):
    """The posture q (n,) of a leaf whose tool pose (4, 4) is nearest to a wanted one.

    status: REACHED where nothing is missing, else CLAMPED, or what is wrong with the wanted pose.
    distance [m] = sqrt(position^2 + (length angle)^2): what is missing, with its parts position [m] and angle [rad]; of
    a task that knows no whole orientation the angle is that of its rows.
    rcond: m / (|J| |G|), of Frobenius norms, angles in units of length; 1 at best, 0 at a singular posture.
    held: what stops the tool, "rcond" and the names of joints at their limits.
    moving: True where `step` was too short to get there in this call.
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
def edge_kernel(strategy: HolonomicStrategy) -> EdgeKernel | None:
    """All this as native code; None where there can be none."""
    step, look = leaf_step(strategy), edge_function(strategy)
    operations = max(step.program.instructions, look.program.instructions)
    if operations > LARGEST or not enabled():
        return None
    code = inverse_code(strategy) + step.c("hk_leaf_body") + look.c("hk_edge_body")
    constants = {**CONSTANTS, "REACHED": REACHED}
    task = strategy.task
    try:
        return EdgeKernel(task.n, task.m, code, stretch_code(strategy), constants, operations)
    except NativeError as problem:
        tell(problem)
        return None


@kept
def edge_of(strategy: HolonomicStrategy, start: tuple[float, ...], length: float, rcond: float, limits: bool) -> Edge:
    """The edge of the leaf through a start. Raises: ArgumentError: the start lies beyond it. JointLimitError."""
    robot, q0 = strategy.task.robot, np.array(start)
    if limits:
        robot.check_limits(q0)
    free = np.full(robot.n, np.inf)
    edge = Edge(strategy, q0, length, rcond, *((robot.lower, robot.upper) if limits else (-free, free)))
    here = edge.look(q0, edge.tool(q0))
    if not here.rcond >= rcond:
        cure = f"give a smaller one, or a start farther from singular postures: this one has {here.rcond:.3g}"
        raise ArgumentError("rcond, below which the tool is not to go", rcond, cure)
    return edge


def down(
    edge: Edge, at: Look, goal: Goal, careful: bool, q: Vector, tool: Goal, step: Vector | None = None
) -> tuple[Look, Look | None] | None:
    """The end of the way down from a look, which may be outside; and how far a step leads, where that is not its end.

    None where it is not shown to be on the branch of a posture q. careful: each piece is shown to keep to the branch;
    else Newton steps alone lead down, and the straight way from q to the end is.
    """
    within = inside(edge, at, goal, careful)
    if within is None:
        return None
    end, cut = descend(edge, within, goal, careful, q, step)
    return (end, cut) if careful or edge.joined(q, tool, cut or end) else None


def from_start(edge: Edge, goal: Goal, careful: bool) -> tuple[Look, bool]:
    """The look where the straight way from the start ends; True where at the goal, within the constraints."""
    way = edge.straight(edge.tool(edge.start), goal)
    q, reached = edge.walk(edge.start, way, TRIES) if careful else edge.glance(edge.start, way)
    at = edge.look(q, goal)
    return at, reached and at.excess <= WITHIN


def reached_from_start(edge: Edge, goal: Goal) -> tuple[Look, bool]:
    """The same: what a glance does not reach is not reached."""
    at, reached = from_start(edge, goal, False)
    return from_start(edge, goal, True) if reached else (at, False)


def cold(edge: Edge, goal: Goal) -> Look:
    """The look at the posture nearest to a goal, found from the start alone."""
    at, reached = reached_from_start(edge, goal)
    if reached:
        return at
    found = down(edge, at, goal, False, edge.start, edge.tool(edge.start))
    return found[0] if found is not None else descend(edge, edge.look(edge.start, goal), goal, True, edge.start)[0]


def warm(edge: Edge, goal: Goal, q: Vector, step: Vector | None) -> tuple[Look, bool] | None:
    """The same from a posture nearby, each joint moving by at most a step (n,), and True where that cut it short.

    None where it leads nowhere.
    """
    tool = edge.tool(q)
    found = edge.solved(q, *tool, edge.leaf)  # to the leaf, with its tool where it is
    if found is None:
        return None
    q, begin = found, edge.look(found, goal)
    found = down(edge, begin, goal, False, q, tool, step) or down(edge, begin, goal, True, q, tool, step)
    if found is None:
        return None
    end, cut = found
    if end.distance > REACHED:
        other, reached = reached_from_start(edge, goal)
        if reached and step is None:
            return other, False
        if reached:  # the way there leads by the start at the latest
            back = edge.tool(edge.start)
            found = down(edge, edge.look(q, back), back, True, q, tool, step)
            return None if found is None else (edge.look((found[1] or found[0]).q, goal), True)
    return (end, False) if cut is None else (cut, True)


def nearest(
    edge: Edge, goal: Goal, refused: Callable[[], InverseStatus], q: Vector | None, step: Vector | None
) -> Nearest:
    """The nearest pose to a goal, from the start or from q; `refused` looks whether the goal is a pose at all.

    Raises:
        ArgumentError: q is no posture of the leaf.
    """
    kernel, found, moving = edge_kernel(edge.strategy), None, False
    if kernel is not None:
        ended, found = kernel(edge.context, np.concatenate([goal[0], goal[1].ravel()]), q, step)
        found, moving, status = found if ended >= 0 else None, ended == 1, _REFUSED.get(ended, InverseStatus.REACHED)
    else:
        status = refused()
    if status is not InverseStatus.REACHED:
        stays = np.full(len(edge.start), np.nan) if q is None else q
        return Nearest(stays, np.full((4, 4), np.nan), status, np.nan, np.nan, np.nan, np.nan)
    if kernel is None and q is None:
        found = cold(edge, goal).numbers
    elif kernel is None and q is not None and (answer := warm(edge, goal, q, step)) is not None:
        found, moving = answer[0].numbers, answer[1]
    if found is None:
        near = posture_text([] if q is None else q)
        raise ArgumentError("the posture to begin from", near, "give the last answer, or leave it out")
    joints, e, rcond, tool, slack = found
    pose = np.zeros((4, 4))
    pose[:3, 3], pose[:3, :3], pose[3, 3] = tool[:3], tool[3:].reshape(3, 3), 1.0
    distance, position, angle = (float(part @ part) ** 0.5 for part in (e, e[edge.linear], e[~edge.linear]))
    missing = distance > REACHED
    held = tuple(edge.names[k] for k in np.flatnonzero(slack <= HELD)) if missing else ()
    status = InverseStatus.CLAMPED if missing else InverseStatus.REACHED
    return Nearest(joints, pose, status, distance, position, angle / edge.length, float(rcond[0]), held, moving)
