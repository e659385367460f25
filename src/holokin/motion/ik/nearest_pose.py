"""The pose of a leaf that is nearest to a wanted one: what a robot does whose operator's hand leaves its reach."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...base.errors import ArgumentError, NativeError
from ...base.types import ArrayLike, Matrix, NoTruthValue, Value, Vector, kept, one_or_each
from ...robot import start_posture
from ...strategies import HolonomicStrategy
from ...symbolic.native import LARGEST, EdgeKernel, enabled, tell
from .descent import CONSTANTS, WITHIN, descend, inside, least_ratio, part
from .edge import SAME, Edge, Goal, Look, edge_function
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


ALONG = 0.1
"""Share of what is missing by which a step along the edge must lead on, where it is to be known whether a slide from
the start comes to a pose: below, the edge is square to the path there, and the slide as good as ended."""

LEAST = 0.5
"""Steps by which a call must bring the joints nearer to where they belong, or they go straight: it takes twice as many
calls as the joints' way has steps, at most."""

_REFUSED = {2: InverseStatus.NOT_FINITE, 3: InverseStatus.NOT_A_ROTATION}
"""What native code says of a goal that is no pose."""


@dataclass(frozen=True, eq=False)
class Nearest(NoTruthValue, Value, ask="`.status`"):
    """The posture q (n,) of a leaf whose tool pose (4, 4) is nearest to a wanted one.

    status: REACHED where nothing is missing, else CLAMPED, or what is wrong with the wanted pose: then q is as it was.
    distance [m] = sqrt(position^2 + (length angle)^2): what is missing, with its parts position [m] and angle [rad]; of
    a task that knows no whole orientation the angle is that of its rows.
    rcond: m / (|J| |G|), of Frobenius norms, angles in units of length; 1 at best, 0 at a singular posture.
    held: what stops the tool, "rcond" and the names of joints at their limits.
    moving: True where `step` was too short to get there in this call; then a joint has moved by half of it or more.
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
    constants = {**CONSTANTS, "REACHED": REACHED, "LEAST": LEAST, "ALONG": ALONG}
    task = strategy.task
    try:
        return EdgeKernel(task.n, task.m, code, stretch_code(strategy), constants, operations)
    except NativeError as problem:
        tell(problem)
        return None


@kept
def edge_of(strategy: HolonomicStrategy, start: tuple[float, ...], length: float, rcond: float, limits: bool) -> Edge:
    """The same as `edge_at`, kept with the strategy."""
    return edge_at(strategy, np.array(start), length, rcond, limits)


def edge_at(strategy: HolonomicStrategy, q0: Vector, length: float, rcond: float, limits: bool) -> Edge:
    """The edge of the leaf through a start (n,). Raises: ArgumentError: the start lies beyond it. JointLimitError."""
    robot = strategy.task.robot
    q0 = start_posture(robot, q0, limits)
    free = np.full(robot.n, np.inf)
    edge = Edge(strategy, q0, length, rcond, *((robot.lower, robot.upper) if limits else (-free, free)))
    here = edge.look(q0, edge.tool(q0))
    if not here.rcond >= rcond:
        cure = f"give a smaller one, or a start farther from singular postures: this one has {here.rcond:.3g}"
        raise ArgumentError("rcond, below which the tool is not to go", rcond, cure)
    return edge


def down(
    edge: Edge, at: Look, goal: Goal, careful: bool, begin: Goal, q: Vector, step: Vector | None = None
) -> tuple[Look, Look | None] | None:
    """The end of the path down from a look, which may be outside; and how far a step leads, where that is not its end.

    None where it is not shown to be on the branch of a posture q, whose tool is at `begin`. careful: each piece is
    shown to keep to the branch; else Newton steps alone lead down, and the straight path from q to the end is.
    """
    within = inside(edge, at, goal, careful)
    if within is None:
        return None
    end, cut = descend(edge, within, goal, careful, q, step)
    return (end, cut) if careful or edge.joined(q, begin, cut or end) else None


def _from_start(edge: Edge, goal: Goal, careful: bool) -> tuple[Look, bool]:
    """The look where the straight path from the start ends; True where at the goal, within the constraints.

    careful: the look at the start where the path is not shown to lead there; a ray is always gone as far as it goes.
    """
    way = edge.straight(edge.tool(edge.q0), goal)
    q, reached = edge.walk(edge.q0, way, TRIES) if careful else edge.glance(edge.q0, way)
    at = edge.look(q if reached or not careful or edge.ray else edge.q0, goal)
    return at, reached and at.excess <= WITHIN


def _reached_from_start(edge: Edge, goal: Goal, near: Vector | None = None) -> tuple[Look, bool]:
    """The same: what a glance does not reach is not reached; what it does reach is shown.

    But where it comes to a posture that is known to be `near`: then two paths agree, and a way that passes close by a
    singular posture takes milliseconds to show. Of 7,200 poses that were reached, a glance missed one, and came to
    another posture never. Rays are gone in Newton steps anyway.
    """
    if edge.ray:
        return _from_start(edge, goal, True)
    at, reached = _from_start(edge, goal, False)
    agrees = near is not None and float(np.abs(at.q - near).max()) <= SAME
    return _from_start(edge, goal, True) if reached and not agrees else (at, reached)


def _slid_from_start(edge: Edge, goal: Goal, at: Look) -> Look | None:
    """The look at a goal, where the path down leads to it from where the straight path from the start ends."""
    within = inside(edge, at, goal, False)
    end = at if within is None else descend(edge, within, goal, False, edge.q0, None, ALONG)[0]
    reached = end.distance <= REACHED and end.excess <= WITHIN
    return end if reached and edge.joined(edge.q0, edge.tool(edge.q0), end) else None


def cold(edge: Edge, goal: Goal) -> Look:
    """The look at the posture nearest to a goal, found from the start alone."""
    at, reached = _reached_from_start(edge, goal)
    if reached:
        return at
    found = down(edge, at, goal, False, edge.tool(edge.q0), edge.q0)
    return found[0] if found is not None else descend(edge, edge.look(edge.q0, goal), goal, True, edge.q0)[0]


def warm(edge: Edge, goal: Goal, q: Vector, step: Vector | None) -> tuple[Look, bool]:
    """The same from a posture nearby, each joint moving by at most a step (n,), and True where that cut it short.

    The joints belong to a pose that the start reaches; to one that it does not, the tool slides. Where they belong, the
    tool goes straight on the leaf, if that brings the joints nearer, else they go straight: so they arrive, from any q.
    """
    begin = edge.onto(q, goal)
    end, cut, belongs = _whither(edge, goal, q, begin, step)
    if step is None or least_ratio(end.q, q, step) >= 1.0:
        return end, False
    if belongs and begin is not None:
        share = min(1.0, least_ratio(begin.q + begin.S @ begin.e, begin.q, step))
        cut = part(edge, begin, None, share, goal, True, begin.q, step)
    straight = edge.look(limited(q, end.q, step), goal)
    if cut is None:
        return straight, True
    along = edge.look(limited(q, cut.q, step), goal)
    gone = steps(q, end.q, step) - steps(along.q, end.q, step) if belongs else steps(q, along.q, step)
    if gone < LEAST and not belongs and straight.distance + straight.excess >= along.distance:
        return along, False  # the straight path there leads by worse places
    return (along if gone >= LEAST else straight), True


def _whither(
    edge: Edge, goal: Goal, q: Vector, begin: Look | None, step: Vector | None
) -> tuple[Look, Look | None, bool]:
    """Where a posture q, or one of the leaf close to it, is to go: where the joints belong, which the start tells, then
    True; else down to the nearest pose, and how far a step leads on that way, where that is not its end."""
    at, reached = _reached_from_start(edge, goal, edge.solved(q, *goal, edge.leaf))
    if reached:
        return at, None, True
    found = None
    if begin is not None:
        tool = begin.position, begin.rotation
        tries = (down(edge, begin, goal, careful, tool, begin.q, step) for careful in (False, True))
        found = next((one for one in tries if one is not None), None)
    if found is None:
        return cold(edge, goal), None, True
    slid = _slid_from_start(edge, goal, at) if found[0].distance > REACHED else None
    return (*found, False) if slid is None else (slid, None, True)


def steps(a: Vector, b: Vector, step: Vector) -> float:
    """How many steps the joints are from a to b."""
    return 1.0 / least_ratio(b, a, step)


def limited(q: Vector, end: Vector, step: Vector) -> Vector:
    """From q straight towards a posture, as far as a step allows."""
    return q + min(1.0, least_ratio(end, q, step)) * (end - q)


def nearest(
    edge: Edge, goal: Goal, refused: Callable[[], InverseStatus], q: Vector | None, step: Vector | None
) -> Nearest:
    """The nearest pose to a goal, from the start or from q; `refused` looks whether the goal is a pose at all."""
    kernel = edge_kernel(edge.strategy)
    if kernel is not None:
        ended, found = kernel(edge.context, np.concatenate([goal[0], goal[1].ravel()]), q, step)
        moving, status = ended == 1, _REFUSED.get(ended, InverseStatus.REACHED)
    elif (status := refused()) is InverseStatus.REACHED:
        at, moving = (cold(edge, goal), False) if q is None else warm(edge, goal, q, step)
        found = at.numbers
    else:
        found, moving = None, False
    if found is None or status is not InverseStatus.REACHED:
        stays = edge.q0 if q is None else q  # without q, what is no pose was refused before
        return Nearest(stays, np.full((4, 4), np.nan), status, np.nan, np.nan, np.nan, np.nan)
    joints, e, rcond, tool, slack = found
    pose = np.zeros((4, 4))
    pose[:3, :3], pose[:3, 3], pose[3, 3] = tool[3:].reshape(3, 3), tool[:3], 1.0
    distance, position, angle = (float(part @ part) ** 0.5 for part in (e, e[edge.linear], e[~edge.linear]))
    missing = distance > REACHED
    held = tuple(edge.names[k] for k in np.flatnonzero(slack <= HELD)) if missing else ()
    status = InverseStatus.CLAMPED if missing else InverseStatus.REACHED
    return Nearest(joints, pose, status, distance, position, angle / edge.length, float(rcond[0]), held, moving)


def steps_of(step: ArrayLike, joints: int) -> Vector:
    """A step of each joint (n,). Raises: ShapeError, ArgumentError."""
    given = one_or_each("step", step, joints)
    if not (given > 0).all():  # NaN included
        raise ArgumentError("step", np.asarray(step, dtype=float).tolist(), "give positive numbers")
    return np.ascontiguousarray(given)
