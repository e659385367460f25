"""Constraints that name what people see: the arm angle (shoulder, elbow, wrist), and the height of a joint."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Any, Literal, get_args

import numpy as np

from ...base.arguments import check, made, typed
from ...base.errors import ArgumentError, NoArmError, UnknownNameError
from ...base.poses import pose_from
from ...base.types import ArrayLike, Matrix, Shown, Vector, finite, numbers
from ...robot import Kinematics, Robot, joints_above
from ...symbolic import SX, Function, atan2, cross, dot, horzcat, norm_2, symbol, vertcat
from ..tasks.frame_task import Angles, three_angles
from ..tasks.task import Task
from .constraint import Constraint, as_gain, least, nothing_jumps

# --- Shoulder, elbow and wrist of an arm: found by how the axes of its joints meet, or named.

MEET = 1e-4
"""Distance [m] up to which axes meet: URDF files round right angles to 1.5708, a hundredth of a millimetre on 2 m."""


@dataclass(frozen=True)
class Point:
    """A point on the moving side of a joint: `offset` (3,) in that joint's frame, None for the frame's origin.

    `place` says which point it is.
    """

    joint: int
    offset: tuple[float, float, float] | None
    place: str

    def expression(self, task: Task, k: Kinematics, q: SX) -> SX:
        """Where it is (3,) in the base frame. Raises: ArgumentError: the task's robot has no such joint."""
        name = dict(enumerate(joint.name for joint in task.robot.joints)).get(self.joint)
        if name not in k.origins:
            raise ArgumentError("the robot of the task", task.robot.name, "give that on which the arm was found")
        if self.offset is None:
            return k.origins[name]
        return task.robot._kinematics_at(q, self.joint, pose_from(self.offset)).position


@dataclass(frozen=True)
class Arm(Shown):
    """The shoulder, elbow and wrist that an arm angle is measured by."""

    shoulder: Point
    elbow: Point
    wrist: Point

    @property
    def sentence(self) -> str:
        """Which points they are."""
        return f"shoulder {self.shoulder.place}; elbow {self.elbow.place}; wrist {self.wrist.place}"

    def __str__(self) -> str:
        return self.sentence

    @typed
    def expressions(self, task: Task, k: Kinematics, q: SX) -> tuple[SX, SX, SX]:
        """Shoulder, elbow and wrist (3,) each, in the base frame."""
        shoulder, elbow, wrist = (point.expression(task, k, q) for point in (self.shoulder, self.elbow, self.wrist))
        return shoulder, elbow, wrist

    @typed
    def places(self, task: Task) -> Function:
        """q (n,) -> shoulder, elbow and wrist, the rows of a matrix (3, 3), in the base frame [m]."""
        q = symbol("q", task.n)
        points = self.expressions(task, task.kinematics(q), q)
        return Function("arm", {"q": q}, {"points": horzcat(*points).T})


@dataclass(frozen=True, eq=False)
class _Axis:
    """The axis of a joint at q = 0, in the base frame: its origin and direction (3,)."""

    joint: int
    name: str
    frame: Matrix
    direction: Vector
    hinge: bool

    @property
    def origin(self) -> Vector:
        """The origin of the joint's frame."""
        return self.frame[:3, 3]

    def foot(self, point: Vector) -> Vector:
        """The point of the axis next to another point."""
        return self.origin + ((point - self.origin) @ self.direction) * self.direction

    def place(self, position: Vector, words: str) -> _Place:
        """A place in the base frame as one on this joint's moving side."""
        if np.linalg.norm(position - self.origin) < MEET:
            return _Place(position, Point(self.joint, None, words))
        x, y, z = (self.frame[:3, :3].T @ (position - self.origin)).tolist()
        return _Place(position, Point(self.joint, (x, y, z), words))


@dataclass(frozen=True, eq=False)
class _Place:
    """Where a point is (3,) at q = 0, in the base frame."""

    position: Vector
    point: Point


@typed
def find_arm(task: Task, joints: Sequence[Any] | None = None, tip: str | None = None) -> Arm:
    """Shoulder, elbow and wrist on the chain from the base to the task's tip, and which points these are.

    The shoulder is where three consecutive hinges meet, the elbow on the next hinge, at its point next to the shoulder,
    the wrist where the three hinges after it meet, or the two after it (a Panda's third stands aside). Of several such
    arms on the chain, as a waist before a shoulder may make them, it is the last.

    A chain of seven hinges, none parallel to the next, always has them, if need be by the rule of [EW23]: shoulder
    where the first two axes meet, or on the first, next to the second; wrist where the last three meet, or the last
    two, or the two before the last, or on the last, next to the one before; elbow where the fourth axis meets the fifth
    (with a wrist of three axes: the third) or the third (the fifth), or on the fourth, next to the shoulder. So arms
    whose axes pass each other, as a Gen3's or a Sawyer's, have them too.

    Args:
        joints: shoulder, elbow and wrist named: each a joint, by name or by index in q, for the origin of its frame, or
            (joint, (x, y, z)), for a point in that frame [m].
        tip: of a robot with several arms, that of the one to look at; by default the task's, of several the first.

    Raises:
        NoArmError: no such joints; it lists those of the chain. UnknownNameError: an unknown joint. ArgumentError.
    """
    if joints is not None:
        if len(joints) != 3:
            raise ArgumentError("the points of an arm", joints, "name three: shoulder, elbow, wrist")
        return Arm(*(_named(task.robot, joint) for joint in joints))
    task.robot._check_links()
    if tip is not None:
        task.robot.pose(np.zeros(task.n), tip)
    axes = _chain(task.robot, task.tip if tip is None else tip)
    for first in range(len(axes) - 6, -1, -1):
        shoulder, wrist = _meeting(axes[first : first + 3]), _meeting(axes[first + 4 : first + 7])
        if wrist is None or len(axes) < first + 7:
            wrist = _meeting(axes[first + 4 : first + 6])
        if shoulder is not None and wrist is not None and axes[first + 3].hinge:
            return Arm(shoulder.point, _next_to(axes[first + 3], shoulder).point, wrist.point)
    if len(axes) == 7 and all(axis.hinge for axis in axes) and _not_parallel(axes):
        shoulder = _meeting(axes[:3]) or _meeting(axes[:2]) or _beside(axes[0], axes[1])
        spherical, pairs = _meeting(axes[4:]), [axes[3:5], axes[2:4]]
        wrist = spherical or _meeting(axes[5:]) or _meeting(axes[4:6]) or _beside(axes[6], axes[5])
        first, second = pairs[::-1] if spherical else pairs
        elbow = _meeting(first) or _meeting(second) or _next_to(axes[3], shoulder)
        return Arm(shoulder.point, elbow.point, wrist.point)
    raise NoArmError(task.robot.name, [axis.name for axis in axes])


def _named(robot: Robot, joint: Any) -> Point:
    """The origin of a joint's frame, which may be that of a joint that mimics another, or a point in it."""
    joint, offset = joint if isinstance(joint, tuple | list) and len(joint) == 2 else (joint, None)
    check("a point of an arm", str | int, joint)
    names = [j.name for j in robot.joints]
    name = joint if joint in names else robot.joint_names[robot.joint_index(joint)]
    words = f"at the origin of {name}"
    if offset is None:
        return Point(names.index(name), None, words)
    x, y, z = finite(f"the point in the frame of {name}", offset, (3,)).tolist()
    return Point(names.index(name), (x, y, z), f"at ({x:g}, {y:g}, {z:g}) in the frame of {name}")


def _chain(robot: Robot, tip: str | None) -> list[_Axis]:
    """The axes of the joints from the base to a tip, at q = 0."""
    frames: list[Matrix] = []
    for joint in robot.joints:
        frames.append((frames[joint.parent] if joint.parent >= 0 else np.eye(4)) @ joint.placement)
    end = next((t for t in robot.tips if t.name == tip), robot.tips[0])
    axes: list[_Axis] = []
    for i in joints_above(robot.joints, end.joint):
        joint = robot.joints[i]
        axes.append(_Axis(i, joint.name, frames[i], frames[i][:3, :3] @ joint.axis, joint.kind == "revolute"))
    return axes[::-1]


def _meeting(axes: Sequence[_Axis]) -> _Place | None:
    """The point where two or three consecutive hinges meet, on the moving side of the second; or None."""
    if not _not_parallel(axes) or not all(axis.hinge for axis in axes):
        return None
    across = [np.eye(3) - np.outer(axis.direction, axis.direction) for axis in axes]
    feet = [P @ axis.origin for P, axis in zip(across, axes, strict=True)]
    point: Vector = np.linalg.solve(np.sum(across, axis=0), np.sum(feet, axis=0))
    if not max(np.linalg.norm(point - axis.foot(point)) for axis in axes) < MEET:
        return None
    return axes[1].place(point, f"where the axes of {', '.join(axis.name for axis in axes)} meet")


def _not_parallel(axes: Sequence[_Axis]) -> bool:
    """Whether no axis is parallel to the next, to a milliradian."""
    return all(np.linalg.norm(np.cross(a.direction, b.direction)) > 1e-3 for a, b in pairwise(axes))


def _beside(axis: _Axis, other: _Axis) -> _Place:
    """The point of an axis next to another one, not parallel to it."""
    a, b = axis.direction, other.direction
    along = np.linalg.lstsq(np.stack([a, -b], axis=1), other.origin - axis.origin, rcond=None)[0]
    return axis.place(axis.origin + along[0] * a, f"on the axis of {axis.name}, next to that of {other.name}")


def _next_to(axis: _Axis, shoulder: _Place) -> _Place:
    """The point of an axis next to the shoulder."""
    words = f"on the axis of {axis.name}, at the point nearest to the shoulder"
    return axis.place(axis.foot(shoulder.position), words)


Definition = Literal["stereographic", "conventional"]
"""The kinds of arm angles."""


@made
def arm_angle(
    *,
    definition: Definition = "stereographic",
    joints: Sequence[Any] | None = None,
    reference: ArrayLike = (0.0, 0.0, 1.0),
    pole: ArrayLike | None = None,
    tip: str | None = None,
) -> Constraint:
    """g(q) = psi, the angle of the plane shoulder-elbow-wrist about the line from shoulder to wrist [rad]. [EW23]

    It is called swivel angle, SEW angle or arm angle. With E, W the elbow and wrist seen from the shoulder and
    w = W/|W|: psi = atan2(n_sew . (w x n_ref), n_sew . n_ref), n_sew = W x E,
    n_ref = w x V ("conventional") or (w - R) x V ("stereographic"), V = `reference`, R = `pole`.

    Args:
        definition: "stereographic" or "conventional".
        joints: shoulder, elbow and wrist: each a joint, by name or by index in q, counted from 0, for the origin of its
            frame, or (joint, (x, y, z)) for a point in that frame. By default they are found by geometry, see
            `find_arm`; on a Panda and an iiwa they are the origins of joints 1, 3 and 5.
        reference: the direction V (3,), e_r of [EW23], the base's z axis by default.
        pole: the direction R (3,) of the stereographic kind alone, e_t of [EW23], perpendicular to V; by default a
            horizontal one, -x.
        tip: of a robot with several arms, that of the one to hold; by default the task's, of several the first.

    Singular (REPRESENTATION; [EW23] call it algorithmic) where psi is not defined, and the error says at which of
    these: the arm is stretched or folded, so that the elbow is on the line from shoulder to wrist; the wrist is in the
    shoulder; conventional: the wrist is on the line through the shoulder along V, above it or below; stereographic: it
    is on the half-line from the shoulder along R. Near it the elbow turns once (conventional) or twice (stereographic)
    as the wrist goes round it, so keep that direction where the robot does not work. Some such direction exists,
    whatever the definition (a field of tangent directions on a sphere has a zero). Singular (ALGORITHMIC) where
    the self-motion does not turn the elbow about the line: never when shoulder and wrist are fixed to base and tool and
    the arm is bent, but it may be so on arms with offsets. Rows: 1.

    Raises:
        UnknownNameError: an unknown definition; when bound, an unknown joint. NoArmError (when bound): no such
            joints are on the chain to the tip; it lists those there are. ArgumentError: R not perpendicular to V, or
            given for the conventional kind.
    """
    if definition not in get_args(Definition):
        raise UnknownNameError("definition of an arm angle", definition, get_args(Definition))
    conventional = definition == "conventional"
    if conventional and pole is not None:
        raise ArgumentError(
            "pole", pole, 'leave it out, or take definition="stereographic": the conventional angle has none'
        )
    V = _direction("reference", reference)
    if pole is None:  # perpendicular to V: -x, or, if V is along x, -y
        axis = np.array([-1.0, 0.0, 0.0]) if abs(V[0]) < 0.9 else np.array([0.0, -1.0, 0.0])
        R = (axis - (axis @ V) * V) / np.linalg.norm(axis - (axis @ V) * V)
    else:
        R = _direction("pole", pole)
    if not conventional and abs(float(R @ V)) > 1e-9:
        raise ArgumentError("pole", R.tolist(), f"give a direction perpendicular to the reference {V.tolist()}")
    if joints is not None and (len(joints) != 3 or any(a == b for a, b in combinations(joints, 2))):
        raise ArgumentError("the points of an arm angle", joints, "name three: shoulder, elbow, wrist")

    seen = _Seen(joints, conventional, V, R, tip)
    name, margin = f"arm angle ({definition})", least([distance for _, distance in seen.places])
    return Constraint(name, 1, seen.angle, (True,), margin, places=seen.places, formulas=nothing_jumps)


@dataclass(frozen=True, eq=False)
class _Seen:
    """An arm seen from its shoulder: its angle, counted from a normal n_ref, and how far it is from being undefined.

    joints: as of `find_arm`; V, R (3,): the directions of the reference and of the pole.
    """

    joints: Sequence[Any] | None
    conventional: bool
    V: Vector
    R: Vector
    tip: str | None = None

    def vectors(self, task: Task, k: Kinematics, q: SX) -> tuple[SX, SX, SX]:
        """Elbow E, wrist W, and the direction w of the wrist (3,)."""
        S, elbow, wrist = find_arm(task, self.joints, self.tip).expressions(task, k, q)
        E, W = elbow - S, wrist - S
        return E, W, W / norm_2(W)

    def angle(self, task: Task, k: Kinematics, q: SX) -> SX:
        """psi."""
        E, W, w = self.vectors(task, k, q)
        n_ref, n_sew = cross(w if self.conventional else w - SX(self.R), SX(self.V)), cross(W, E)
        return atan2(dot(n_sew, cross(w, n_ref)), dot(n_sew, n_ref))

    def reach(self, task: Task, k: Kinematics, q: SX) -> SX:
        """How far the wrist is from the shoulder [m]."""
        return norm_2(self.vectors(task, k, q)[1])

    def bend(self, task: Task, k: Kinematics, q: SX) -> SX:
        """The sine of the angle between elbow and wrist."""
        E, W, _ = self.vectors(task, k, q)
        return norm_2(cross(W, E)) / (norm_2(W) * norm_2(E))

    def aside(self, task: Task, k: Kinematics, q: SX) -> SX:
        """How far w is from the singular direction; n_ref itself vanishes sooner where w - R is along V."""
        w = self.vectors(task, k, q)[2]
        return norm_2(cross(w, SX(self.V)) if self.conventional else w - SX(self.R))

    @property
    def places(self) -> tuple[tuple[str, Callable[[Task, Kinematics, SX], SX]], ...]:
        """Where psi is not defined, in words, and how far the posture is from there."""
        line = (
            f"where the wrist is on the line through the shoulder along the reference {np.round(self.V, 6).tolist()}"
            if self.conventional
            else f"where the wrist is on the half-line from the shoulder along the pole {np.round(self.R, 6).tolist()}"
        )
        straight = "where the arm is stretched or folded, the elbow on the line from shoulder to wrist"
        return ("where the wrist is in the shoulder", self.reach), (straight, self.bend), (line, self.aside)


@made
def height(*joints: str | int) -> Constraint:
    """g(q) = z of the origins of joints' frames in the base frame [m]: an elbow that stays level. Rows: one a joint.

    Singular (ALGORITHMIC) where the self-motion does not raise the joint: at the top and bottom of its circle.

    Args:
        joints: by name, or by index in q, counted from 0.

    Raises:
        UnknownNameError (when bound): the robot has no such joint.
    """
    if not joints:
        raise ArgumentError("the joints to keep level", joints, "name at least one")
    if any(not isinstance(joint, str) and abs(joint) > 10_000 for joint in joints):
        raise ArgumentError("a joint to keep level", "beyond all robots", "give its name, or its index in q")

    def expression(task: Task, k: Kinematics, _q: SX) -> SX:
        return vertcat(*(_origin(task, k, joint)[2] for joint in joints))

    name = f"height of {', '.join(j if isinstance(j, str) else f'q[{j}]' for j in joints)}"
    return Constraint(name, len(joints), expression, (False,) * len(joints), formulas=nothing_jumps)


def _origin(task: Task, k: Kinematics, joint: str | int) -> SX:
    """The origin (3,) of a joint's frame; a name may also be that of a joint that mimics another."""
    task.robot._check_links()
    name = joint if joint in k.origins else task.robot.joint_names[task.robot.joint_index(joint)]
    return k.origins[str(name)]


def _direction(what: str, value: ArrayLike) -> Vector:
    v = numbers(what, value)
    if v.shape != (3,) or not 0 < np.linalg.norm(v) < np.inf:
        raise ArgumentError(what, v.tolist(), "give a direction (3,) that is not zero")
    return v / np.linalg.norm(v)


@made
def coupled(gain: ArrayLike, orientation: Angles = "zyz") -> Constraint:
    """g(q) = phi(q) + Lambda p(q): orientation angles phi (3,) follow the position p (3,). [ZR11, (28)]

    Args:
        gain: Lambda in rad/m, a number (times the identity) or a matrix (3, 3); which angle goes with which
            direction is up to it. The paper adds rad and m, a hidden gain of 1 rad/m (theory E6).
        orientation: "zyz", "rpy" or "rotation-vector".

    Rows: 3, so that it completes a position task (m = 3) of a six-joint arm. Algorithmic singularities: every
    singularity of the full 6-row Jacobian, the wrist's included (theory E5); and where the angles are undefined.

    Raises:
        UnknownNameError: an unknown orientation. ShapeError, NotFiniteError: a bad gain.
    """
    L = as_gain(gain, (3, 3))
    angles = three_angles(orientation)

    def expression(_task: Task, k: Kinematics, _q: SX) -> SX:
        # (28), (29): its gradient is J_o + Lambda J_p
        return angles.value(k.rotation) + SX(L) @ k.position

    def margin(_task: Task, k: Kinematics, _q: SX) -> SX:
        return angles.margin(k.rotation)

    return Constraint(f"coupled ({orientation})", 3, expression, (True,) * 3, margin, formulas=nothing_jumps)
