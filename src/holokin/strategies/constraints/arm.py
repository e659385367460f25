"""Constraints that name what people see: the arm angle (shoulder, elbow, wrist), and the height of a joint."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Literal, get_args

import numpy as np

from ...base.arguments import made
from ...base.errors import ArgumentError, UnknownNameError
from ...base.types import ArrayLike, Vector, numbers
from ...robot import Kinematics
from ...symbolic import SX, atan2, cross, dot, norm_2, vertcat
from ..tasks.task import Task
from .arm_geometry import find_arm
from .constraint import Constraint, least, nothing_jumps

MOST_JOINTS = 10_000
"""Indices of joints beyond it are of no robot."""


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
    whatever the definition (a field of tangent directions on a sphere, see `obstruction`). Singular (ALGORITHMIC) where
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
    R = _pole(V) if pole is None else _direction("pole", pole)
    if not conventional and abs(float(R @ V)) > 1e-9:
        raise ArgumentError("pole", R.tolist(), f"give a direction perpendicular to the reference {V.tolist()}")
    if joints is not None and (len(joints) != 3 or any(a == b for a, b in combinations(joints, 2))):
        raise ArgumentError("the points of an arm angle", joints, "name three: shoulder, elbow, wrist")

    seen = _Seen(joints, conventional, V, R, tip)
    margin = least([distance for _, distance in seen.places])
    return Constraint(
        f"arm angle ({definition})", 1, seen.angle, (True,), margin, places=seen.places, formulas=nothing_jumps
    )


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
    if any(not isinstance(joint, str) and abs(joint) > MOST_JOINTS for joint in joints):
        raise ArgumentError("a joint to keep level", "beyond all robots", "give its name, or its index in q")

    def expression(task: Task, k: Kinematics, _q: SX) -> SX:
        return vertcat(*(_origin(task, k, joint)[2] for joint in joints))

    name = f"height of {', '.join(j if isinstance(j, str) else f'q[{j}]' for j in joints)}"
    return Constraint(name, len(joints), expression, (False,) * len(joints), formulas=nothing_jumps)


def _origin(task: Task, k: Kinematics, joint: str | int) -> SX:
    """The origin (3,) of a joint's frame; a name may also be that of a joint that mimics another."""
    task.robot.check_links()
    name = joint if joint in k.origins else task.robot.joint_names[task.robot.joint_index(joint)]
    return k.origins[str(name)]


def _direction(what: str, value: ArrayLike) -> Vector:
    v = numbers(what, value)
    if v.shape != (3,) or not 0 < np.linalg.norm(v) < np.inf:
        raise ArgumentError(what, v.tolist(), "give a direction (3,) that is not zero")
    return v / np.linalg.norm(v)


def _pole(V: Vector) -> Vector:
    """A direction perpendicular to V: -x, or, if V is along x, -y."""
    axis = np.array([-1.0, 0.0, 0.0]) if abs(V[0]) < 0.9 else np.array([0.0, -1.0, 0.0])
    R = axis - (axis @ V) * V
    return R / np.linalg.norm(R)
