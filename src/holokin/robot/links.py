"""Links of a robot: where they are, capsules about them, and what they weigh."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal, NamedTuple, get_args

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError, RobotFileError, ShapeError, UnknownNameError
from ..base.poses import pose_from
from ..base.types import Array, ArrayLike, Matrix, Value, Vector, finite, one_or_each, positive
from ..symbolic import SX, Function, dot, horzcat, n_nodes, sparsify, symbol, vertcat
from ..symbolic.rotations import rotation_about
from .chains import BASE, pose_matrix
from .joints import Body, Coordinate, Joint, Tip, foot_of, joints_above
from .model import Robot
from .shapes.link_shapes import Capsule, LinkShape, Shape
from .tree import joint_frames, motion, placed

# --- The geometric Jacobian as a link in the middle of the chain sees it: of few operations, for proofs.
#
# Seen from the base each column holds all joints before it; seen from a middle link only those in between. The rows are
# turned together, and the linear ones are the velocities of another point of the tool: a factor A with det A = 1, which
# keeps null vectors and det J J^T.

Frames = dict[int, tuple[SX, SX]]


def link_jacobian(robot: Robot, q: SX, tip: str | None = None, *, turned: bool = True) -> SX:
    """A(q) J (6, n), det A = 1, of the link and the point that leave most zeros in it.

    A turns with the fixed rotations of the model, whose inverses are their transposes: of right angles exactly, else
    to the rounding of their doubles.

    Args:
        turned: all six rows are to count. Else the linear ones (3, n) of the tool's own point.
    """
    end = robot._find_tip(tip)
    chain = joints_above(robot.joints, end.joint)
    candidates = []
    for middle in range(len(chain)):
        frames = _seen_from(robot, q, chain[::-1], middle, end)
        points = chain if turned else [-1]
        candidates += [_columns(robot, frames, end, frames[point][0], turned) for point in points]
    return min(candidates, key=lambda J: (sparsify(J).nnz(), n_nodes(J)))


def _seen_from(robot: Robot, q: SX, chain: list[int], middle: int, end: Tip) -> Frames:
    """(origin, rotation) of every joint's moving frame, seen from that of one of them; of the tool's point at -1."""
    frames: Frames = {chain[middle]: (SX.zeros(3, 1), SX.eye(3))}
    for before, link in zip(chain[middle:], chain[middle + 1 :], strict=False):
        joint, (p, R) = robot.joints[link], frames[before]
        shift, turn = _joint_motion(joint, q, 1.0)
        R_placed = R @ SX(joint.placement[:3, :3])
        frames[link] = p + R @ SX(joint.placement[:3, 3]) + R_placed @ shift, R_placed @ turn
    for before, link in zip(chain[:middle][::-1], chain[1 : middle + 1][::-1], strict=True):
        joint, (p, R) = robot.joints[link], frames[link]
        shift, turn = _joint_motion(joint, q, -1.0)
        R_placed = R @ turn
        R_before = R_placed @ SX(joint.placement[:3, :3].T)
        frames[before] = p + R_placed @ shift - R_before @ SX(joint.placement[:3, 3]), R_before
    p, R = frames[end.joint]
    frames[-1] = p + R @ SX(end.placement[:3, 3]), R
    return frames


def _joint_motion(joint: Joint, q: SX, way: float) -> tuple[SX, SX]:
    """(shift (3,), turn (3, 3)) of a joint, or back again."""
    value = way * (joint.multiplier * q[joint.coordinate] + joint.offset)
    if joint.kind == "prismatic":
        return SX(joint.axis) * value, SX.eye(3)
    return SX.zeros(3, 1), rotation_about(joint.axis, value)


def _columns(robot: Robot, frames: Frames, end: Tip, point: SX, turned: bool) -> SX:
    columns = [SX.zeros(6, 1)] * robot.n
    for coordinate, multiplier, v, w in reversed(robot._columns(frames, end.joint, point)):
        columns[coordinate] = columns[coordinate] + multiplier * vertcat(v, w)
    return horzcat(*columns)[: 6 if turned else 3, :]


@typed
def coordinates(
    names: Sequence[str],
    *,
    lower: ArrayLike = -np.inf,
    upper: ArrayLike = np.inf,
    max_velocity: ArrayLike = np.inf,
    units: str | Sequence[str] = "1",
    name: str = "coordinates",
) -> Robot:
    """Coordinates u (n,) with limits and no links, for `custom_task`: the thrusts and angles of a ship's thrusters.

    Whatever needs the pose of a tool is refused.

    Args:
        names: of each coordinate.
        lower, upper: limits, one number for all or one each.
        max_velocity: largest rates [unit/s], likewise.
        units: of each, or one for all: "N", "m", "rad" of an angle; "1" where there is none.
        name: of the whole.

    Raises:
        ArgumentError: no names, two alike, or a bad limit. ShapeError: limits or units that are not one for each.
    """
    known = tuple(names)
    if not known:
        raise ArgumentError("the names of the coordinates", known, "give at least one")
    each = (units,) * len(known) if isinstance(units, str) else tuple(units)
    if len(each) != len(known):
        raise ShapeError("the units of the coordinates", (len(known),), (len(each),))
    bounds = (
        one_or_each(f"{what} of the coordinates", value, len(known))
        for what, value in (("lower", lower), ("upper", upper), ("max_velocity", max_velocity))
    )
    rows = zip(known, each, *bounds, strict=True)
    made = tuple(
        Coordinate(name_of_row, "quantity", float(a), float(b), float(v), unit) for name_of_row, unit, a, b, v in rows
    )
    return Robot(name, made, (), (), "coordinates without links")


_SAMPLES = 2048
"""Postures of which the farthest are improved: for the robots of the catalogue 16 times as many change no digit."""

_STARTS = 8
"""Postures that are improved."""


@typed
def reach(robot: Robot, tip: str | None = None) -> float:
    """The largest distance [m] of a tip from where the robot stands, max |p(q) - foot| within the joint limits.

    It is the farthest of random postures, the best of which are improved by a truncated Newton method. Infinite for a
    slider without limits; a hinge without limits turns once round.

    Raises:
        UnknownNameError: no such tip.
    """
    from scipy.optimize import minimize

    end = robot._find_tip(tip)
    if not (np.isfinite(robot.upper - robot.lower) | robot.hinges).all():
        return float("inf")
    lower, upper = robot.ranges(np.pi)
    Q = np.random.default_rng(0).uniform(lower, upper, (_SAMPLES, robot.n))
    foot = foot_of(robot.joints, end.joint)
    far = np.linalg.norm(_points(robot, Q, end)[0] - foot, axis=1)

    def cost(q: Vector) -> tuple[float, Vector]:
        p, J = _points(robot, q[None], end)
        step = p[0] - foot
        return -float(step @ step) / 2, -J[0].T @ step

    bounds = list(zip(lower, upper, strict=True))
    starts = Q[np.argsort(-far)[:_STARTS]]
    return float(np.sqrt(-2 * min(minimize(cost, q, jac=True, method="TNC", bounds=bounds).fun for q in starts)))


def _points(robot: Robot, Q: Matrix, end: Tip) -> tuple[Matrix, Array]:
    """Points p (k, 3) of a tip at postures (k, n), and dp/dq (k, 3, n)."""
    frames = joint_frames(robot, Q)
    axes = [R @ joint.axis for joint, (_, R) in zip(robot.joints, frames, strict=True)]  # it turns about its own axis
    point = placed(frames, end.joint, end.placement, len(Q))[0]
    J = np.zeros((len(Q), 3, robot.n))
    for index in joints_above(robot.joints, end.joint):
        joint, axis = robot.joints[index], axes[index]
        step = axis if joint.kind == "prismatic" else np.cross(axis, point - frames[index][0])
        J[:, :, joint.coordinate] += joint.multiplier * step
    return point, J


# --- Capsules for robots whose links have no shapes, such as those of DH tables; and obstacles around a robot.

SLENDER = 20.0
"""Length of an arm over the radius of its capsules: 7 cm for a Panda, 6 cm for a UR5e."""

_SHORTEST = 1e-6
"""Distance [m] of two frames below which there is no link between them."""


@typed
def with_capsules(robot: Robot, radius: float | Mapping[str, float] | None = None) -> Robot:
    """The robot with capsules for links, along the lines from each joint's frame to the next ones and to the tips.

    The capsule of a link has the name of the joint that moves it, "base" for the one that stands still. Links that
    have shapes already keep them, but for those that could not be read where `radius` names the capsule in their place.
    What is between a slider and the joint before it has no capsule. A base begins where the robot is mounted, and a
    tool where the arm ends: both leave all other capsules as they are. What the robot stands on is no part of it, see
    `obstacle`. Where several arms stand side by side, each has a base of its own, "base", and "base of JOINT" of the
    others.

    Args:
        radius: of all capsules [m], or by name, where those left out have the default: a twentieth of `chain_length`.

    Raises:
        UnknownNameError: a name that no link has. ArgumentError: a bad radius, or a robot without links.
    """
    robot._check_links()
    lines = link_lines(robot)
    names = tuple(dict.fromkeys([BASE, *(joint.name for joint in robot.joints), *(line.link for line in lines)]))
    given = dict(radius) if isinstance(radius, Mapping) else {}
    for name, value in given.items():
        if name not in names:
            raise UnknownNameError("link", name, names)
        positive(f"the radius of {name}", value)
    rest = positive("radius", radius) if isinstance(radius, float | int) else chain_length(robot) / SLENDER
    carriers = [BASE, *(joint.name for joint in robot.joints)]  # of joint -1 and of each joint
    own = [shape for shape in robot.shapes if not shape.obstacle]
    unread = [shape for shape in own if given and carriers[shape.joint + 1] in given and shape.shape.fault]
    shaped = {shape.joint for shape in own} - {shape.joint for shape in unread}
    bare = [line for line in lines if line.joint not in shaped and np.linalg.norm(line.end - line.start) >= _SHORTEST]
    clad = {(line.link, line.joint) for line in bare}
    added = []
    for line in bare:
        r = given.get(line.link, rest)
        if not r > 0:
            raise ArgumentError("the length of the chain", 0.0, "give radius=")
        parent = _parent(line.joint, lines, clad, shaped)
        added.append(LinkShape(line.link, line.joint, *between(line.start, line.end, r), parent=parent))
    replaced = {shape.joint for shape in added}
    readable = [shape for shape in robot.shapes if not (shape.joint in replaced and shape in unread)]
    return replace(robot, shapes=(*readable, *added))


def _parent(joint: int, lines: Sequence[Line], clad: Set[tuple[str, int]], shaped: Set[int]) -> str | None:
    """The nearest link with a capsule above a joint's, "" where there is none; None where other shapes are nearer."""
    while joint >= 0:
        line = lines[joint]  # the one that leads to this joint
        joint = line.joint
        if (line.link, joint) in clad:
            return line.link
        if joint in shaped:
            return None
    return ""


@typed
def chain_length(robot: Robot) -> float:
    """Sum of the distances [m] from frame to frame on the way from the base to the first tip, sliders at zero.

    It counts from where the robot is mounted to where the arm ends, without a tool of `with_tool`.

    Raises:
        ArgumentError: a robot without links.
    """
    tip = robot._find_tip()
    total = float(np.linalg.norm(tip.arm_end))
    for index in joints_above(robot.joints, tip.joint):
        total += float(np.linalg.norm(robot.joints[index].step))
    return total


def between(start: Vector, end: Vector, radius: float) -> tuple[Matrix, Capsule]:
    """A capsule from one point to another, and where it is."""
    step = end - start
    length = float(np.linalg.norm(step))
    z = step / length if length > 0 else np.array([0.0, 0.0, 1.0])
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= np.linalg.norm(x)
    return pose_from((start + end) / 2, np.column_stack([x, np.cross(z, x), z])), Capsule(radius, length)


class Line(NamedTuple):
    """The line along a link, start (3,) to end (3,) [m] in the frame of its joint (-1: the base)."""

    link: str
    joint: int
    start: Vector
    end: Vector


def link_lines(robot: Robot) -> list[Line]:
    """The lines of all links: those to each joint, in their order, then to where the arm ends and from there along a
    tool, or in one where the tool goes straight on.

    A base begins at its foot. A tip that is fixed to the base is the end of no link.
    """
    lines, feet = [], list[tuple[Vector, str]]()
    for joint in robot.joints:
        link = robot.joints[joint.parent].name
        if joint.parent < 0:
            new = BASE if not feet else f"{BASE} of {joint.name}"
            same = (name for foot, name in feet if np.linalg.norm(foot - joint.start) < _SHORTEST)
            link = next(same, new)
            feet.append((joint.start, link))
        lines.append(Line(link, joint.parent, joint.start, joint.placement[:3, 3]))
    for tip in robot.tips:
        if tip.joint >= 0:
            link, points = robot.joints[tip.joint].name, [np.zeros(3), tip.arm_end, tip.placement[:3, 3]]
            if _on_the_way(points[1], points[2]):
                del points[1]
            lines += [Line(link, tip.joint, *ends) for ends in pairwise(points)]
    return lines


def _on_the_way(point: Vector, end: Vector) -> bool:
    """Whether a point (3,) is on the line from the origin to an end (3,)."""
    length = float(np.linalg.norm(end))
    along = float(point @ end) / length if length else 0.0
    off = point - along * end / length if length else point
    return bool(np.linalg.norm(off) < _SHORTEST and 0 <= along <= length)


@typed
def with_shape(
    robot: Robot,
    name: str,
    shape: Shape,
    xyz: ArrayLike = (0, 0, 0),
    rpy: ArrayLike = (0, 0, 0),
    *,
    tip: str | None = None,
) -> Robot:
    """The robot with a shape on a tip, such as that of its tool, at xyz (3,) [m], rpy (3,) [rad] in the tip's frame.

    A robot whose links have no shapes gets capsules first, as of `with_capsules`.

    Args:
        name: what the shape is called in findings.
        tip: the tip that carries it, by default the first.

    Raises:
        UnknownNameError: no such tip. ArgumentError, ShapeError, NotFiniteError.
    """
    end = robot._find_tip(tip)
    placed = end.placement @ pose_matrix(finite("xyz of a shape", xyz, (3,)), finite("rpy of a shape", rpy, (3,)))
    clad = with_capsules(robot) if all(known.obstacle for known in robot.shapes) else robot
    return replace(clad, shapes=(*clad.shapes, LinkShape(name, end.joint, placed, shape, carried=True)))


@typed
def obstacle(name: str, shape: Shape, xyz: ArrayLike = (0, 0, 0), rpy: ArrayLike = (0, 0, 0)) -> LinkShape:
    """A shape that stands still at xyz (3,) [m], rpy (3,) [rad] in the frame of a robot's base.

    Raises:
        ArgumentError, ShapeError, NotFiniteError.
    """
    T: Matrix = pose_matrix(finite("xyz of an obstacle", xyz, (3,)), finite("rpy of an obstacle", rpy, (3,)))
    return LinkShape(name, -1, T, shape, obstacle=True)


THICKNESS = 0.04
"""Radius of a capsule over the length of the longest chain: 56 mm for a Panda, as its arm has."""

STUMP = 0.05
"""Radius [m] of the sphere that stands for a robot without any length, such as a single slider."""

DENSITY = 1000.0
"""Of capsules that stand for links [kg/m^3]: that of water. A Panda with its hand is 21 kg of it, the real
one weighs 18 kg."""

DENSEST = 1e6
"""Forty times the density of osmium, the densest of all solids [kg/m^3]: what is beyond was given in another unit."""


def size(part: LinkShape) -> tuple[float, float]:
    """(radius, length) of a capsule [m]. Raises: ArgumentError: another shape."""
    if not isinstance(part.shape, Capsule):
        raise ArgumentError("the shape of a drawn link", type(part.shape).__name__, "give a capsule")
    return part.shape.radius, part.shape.length


def solid(part: LinkShape, density: float) -> Body:
    """The mass and inertia of a capsule as a solid of even density [kg/m^3]."""
    r, h = size(part)
    cylinder, ball = density * np.pi * r**2 * h, density * 4 / 3 * np.pi * r**3
    across = cylinder * (3 * r**2 + h**2) / 12 + ball * (2 / 5 * r**2 + h**2 / 4 + 3 / 8 * h * r)
    along = cylinder * r**2 / 2 + ball * 2 / 5 * r**2
    R = part.placement[:3, :3]
    inertia = R @ np.diag([across, across, along]) @ R.T
    return Body(part.joint, cylinder + ball, part.placement[:3, 3], inertia)


def rest(joint: Joint) -> Matrix:
    """The placement (4, 4) of a joint with its offset in it."""
    return joint.placement @ motion(joint.kind, joint.axis, joint.offset)


def drawn_links(robot: Robot) -> tuple[LinkShape, ...]:
    """A capsule along every link, a drawing of it and not its shape, and a ball for each joint without one."""
    length = chain_length(robot)
    radius = THICKNESS * length if length else STUMP
    drawn = with_capsules(replace(robot, shapes=()), radius).shapes
    long = [part for part in drawn if part.shape.ball[1] > 1.25 * radius]  # others are lost in the next one
    bare = sorted(set(range(len(robot.joints))) - {part.joint for part in long})
    balls = [LinkShape(robot.joints[j].name, j, np.eye(4), Capsule(radius)) for j in bare]
    return (*long, *balls)


def merged(bodies: Iterable[Body]) -> dict[int, Body]:
    """Joint -> all that it carries as one rigid body; the inertia about the common center, by Steiner's theorem."""
    groups: dict[int, list[Body]] = {}
    for body in bodies:
        groups.setdefault(body.joint, []).append(body)
    bodies_by_joint = {}
    for joint, parts in groups.items():
        mass = sum(part.mass for part in parts)
        center = sum((part.mass * part.center for part in parts), np.zeros(3)) / mass if mass else np.zeros(3)
        inertia = np.zeros((3, 3))
        for part in parts:
            d = part.center - center
            inertia = inertia + part.inertia + part.mass * (d @ d * np.eye(3) - np.outer(d, d))
        bodies_by_joint[joint] = Body(joint, mass, center, inertia)
    return bodies_by_joint


@typed
def weighed(robot: Robot, density: float = DENSITY) -> Robot:
    """The robot, if it knows its masses; else with those of solid capsules along its links, which are placeholders.

    Args:
        density: of the capsules [kg/m^3].

    Raises:
        ArgumentError: a density that is not positive, or that no solid has.
    """
    if positive("density", density) > DENSEST:
        raise ArgumentError("density", density, f"give at most {DENSEST:g} kg/m^3: steel has 7850")
    if knows_masses(robot):
        return robot
    return replace(robot, bodies=tuple(solid(part, density) for part in drawn_links(robot)))


def knows_masses(robot: Robot) -> bool:
    """Whether its description has the mass of anything that moves."""
    return any(body.joint >= 0 for body in robot.bodies)


# --- What a robot's masses give: the joint-space mass matrix and the gravity potential. [Kha87]


def mass_matrix_expression(robot: Robot, q: SX) -> SX:
    """M(q) (n, n), symmetric: kinetic energy 1/2 dq^T M dq [kg m^2, kg m, kg].

    M = sum_b m J_v^T J_v + J_w^T R I R^T J_w over the bodies b. Raises: RobotFileError: the description has no masses.
    """
    total = SX.zeros(robot.n, robot.n)
    for body in _bodies(robot):
        k = robot._kinematics_at(q, body.joint, pose_from(body.center))
        v, w = k.jacobian[:3, :], k.rotation.T @ k.jacobian[3:, :]
        total = total + body.mass * (v.T @ v) + w.T @ SX(body.inertia) @ w
    return total


def potential_expression(robot: Robot, q: SX, gravity: Vector) -> SX:
    """U = - sum_b m g . c_b [J]. Raises: RobotFileError."""
    total = SX(0)
    for body in _bodies(robot):
        total = total - body.mass * dot(
            SX(gravity), robot._kinematics_at(q, body.joint, pose_from(body.center)).position
        )
    return total


def _bodies(robot: Robot) -> tuple[Body, ...]:
    moving = tuple(body for body in robot.bodies if body.joint >= 0)
    if not moving:
        raise RobotFileError(robot.name, "has no masses", "load a URDF with sound <inertial> elements")
    for body in moving:
        if not (np.isfinite(body.mass) and body.mass > 0 and np.isfinite(body.inertia).all()):
            raise RobotFileError(
                robot.name, f"has a mass of {body.mass} kg", "load a URDF with sound <inertial> elements"
            )
    return moving


ServoKind = Literal["position", "velocity", "torque"]
"""What a servo is told."""

SERVOS: tuple[ServoKind, ...] = get_args(ServoKind)
"""The kinds of servos."""


@dataclass(frozen=True, eq=False)
class Servo(Value):
    """The drives of a robot: what they are commanded, and their gains. Make one with `servo`.

    position: torque = stiffness (command - q) - damping dq. velocity: torque = damping (command - dq). torque: what
    is commanded; stiffness and damping are then those of a law of computed torques, per unit of inertia.

    Attributes:
        kind: "position", "velocity" or "torque".
        stiffness: (n,) [N m/rad, N/m; torque: 1/s^2], zero for velocity.
        damping: (n,) [N m s/rad, N s/m; torque: 1/s].
        compensated: whether the weight of the links is carried by a torque of its own, known from the model.
    """

    kind: ServoKind
    stiffness: Vector
    damping: Vector
    compensated: bool = False


@typed
def servo(
    robot: Robot,
    kind: ServoKind,
    q: ArrayLike,
    *,
    frequency: float = 25.0,
    damping_ratio: float = 1.0,
    compensated: bool | None = None,
) -> Servo:
    """Servos whose gains fit the inertia of each joint at a posture.

    With M the mass matrix and w = 2 pi frequency: stiffness_i = M_ii w^2, damping_i = 2 damping_ratio M_ii w of a
    position servo, damping_i = M_ii w of a velocity servo, and w^2 and 2 damping_ratio w for torques.

    Args:
        kind: "position", "velocity" or "torque".
        q: the posture (n,).
        frequency: of the closed loop of each joint alone [Hz].
        compensated: whether the weight of the links is carried by torques of its own; by default of velocity and
            torque servos, and not of position servos, whose stiffness carries it.

    Raises:
        ArgumentError: an unknown kind, or a number that is not positive. ShapeError, NotFiniteError.
    """
    if kind not in SERVOS:
        raise ArgumentError("the kind of servo", kind, f"use one of {', '.join(SERVOS)}")
    w, zeta = 2 * np.pi * positive("frequency", frequency), positive("damping_ratio", damping_ratio)
    posture, heavy = robot.checked(q), weighed(robot)
    s = symbol("q", robot.n)
    M = Function("mass_matrix", {"q": s}, {"M": mass_matrix_expression(heavy, s)})(posture)
    inertia = np.diag(np.reshape(M, (robot.n, robot.n)))
    scale = np.ones(robot.n) if kind == "torque" else inertia
    stiffness = np.zeros(robot.n) if kind == "velocity" else scale * w**2
    damping = scale * w * (1.0 if kind == "velocity" else 2 * zeta)
    return Servo(kind, stiffness, damping, kind != "position" if compensated is None else compensated)  # type: ignore[arg-type]
