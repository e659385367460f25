"""Constraints that name what people see: the arm angle (shoulder, elbow, wrist), and the height of a joint."""

from __future__ import annotations

import numpy as np

from ..arguments import made
from ..errors import ArgumentError, UnknownNameError
from ..robot import Kinematics
from ..symbolic import SX, atan2, cross, dot, fmin, norm_2, vertcat
from ..task import Task
from ..types import ArrayLike, Vector, numbers
from .arm_geometry import shoulder_elbow_wrist
from .base import Constraint


@made
def arm_angle(
    *,
    definition: str = "stereographic",
    joints: tuple[str | int, str | int, str | int] | None = None,
    reference: ArrayLike = (0.0, 0.0, 1.0),
    pole: ArrayLike | None = None,
) -> Constraint:
    """g(q) = psi, the angle of the plane shoulder-elbow-wrist about the line from shoulder to wrist [rad]. [EW23]

    With E, W the elbow and wrist seen from the shoulder and w = W/|W|:
    psi = atan2(n_sew . (w x n_ref), n_sew . n_ref), n_sew = W x E,
    n_ref = w x V ("conventional") or (w - R) x V ("stereographic"), V = `reference`, R = `pole`.

    Args:
        definition: "stereographic" or "conventional".
        joints: the joints whose origins are shoulder, elbow, wrist, by name or by index in q, counted from 0. By
            default they are found by geometry: shoulder, where three consecutive hinges meet; elbow, the next hinge;
            wrist, where the two or three hinges after it meet. On a Panda and an iiwa these are joints 1, 3 and 5.
        reference: the direction V (3,), the base's z axis by default.
        pole: the direction R (3,) of the stereographic kind, perpendicular to V; by default a horizontal one, -x.

    Singular (REPRESENTATION) where the arm is stretched, and where n_ref vanishes: conventional, w along V or -V;
    stereographic, w along R only. Some such direction must exist, whatever the definition (a vector field on a
    sphere). Rows: 1.

    Raises:
        UnknownNameError: an unknown definition; when bound, an unknown joint. NoArmError (when bound): no such
            joints are on the chain to the tip; it lists those there are. ArgumentError: R not perpendicular to V.
    """
    if definition not in ("stereographic", "conventional"):
        raise UnknownNameError("definition of an arm angle", definition, ("stereographic", "conventional"))
    V = _direction("reference", reference)
    R = _pole(V) if pole is None else _direction("pole", pole)
    if definition == "stereographic" and abs(float(R @ V)) > 1e-9:
        raise ArgumentError("pole", R.tolist(), f"give a direction perpendicular to the reference {V.tolist()}")

    def vectors(task: Task, k: Kinematics, q: SX) -> tuple[SX, SX, SX, SX]:
        S, elbow, wrist = _points(task, k, q, joints)
        E, W = elbow - S, wrist - S
        w = W / norm_2(W)
        return E, W, w, cross(w if definition == "conventional" else w - SX(R), SX(V))

    def expression(task: Task, k: Kinematics, q: SX) -> SX:
        E, W, w, n_ref = vectors(task, k, q)
        n_sew = cross(W, E)
        return atan2(dot(n_sew, cross(w, n_ref)), dot(n_sew, n_ref))

    def margin(task: Task, k: Kinematics, q: SX) -> SX:
        E, W, _, n_ref = vectors(task, k, q)
        return fmin(norm_2(cross(W, E)) / (norm_2(W) * norm_2(E)), norm_2(n_ref))

    return Constraint(f"arm angle ({definition})", 1, expression, (True,), margin)


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

    def expression(task: Task, k: Kinematics, _q: SX) -> SX:
        return vertcat(*(_origin(task, k, joint)[2] for joint in joints))

    name = f"height of {', '.join(j if isinstance(j, str) else f'q[{j}]' for j in joints)}"
    return Constraint(name, len(joints), expression, (False,) * len(joints))


def _origin(task: Task, k: Kinematics, joint: str | int) -> SX:
    """The origin (3,) of a joint's frame; a name may also be that of a joint that mimics another."""
    name = joint if joint in k.origins else task.robot.joint_names[task.robot.joint_index(joint)]
    return k.origins[str(name)]


def _points(task: Task, k: Kinematics, q: SX, joints: tuple[str | int, ...] | None) -> list[SX]:
    """Shoulder, elbow and wrist (3,) each."""
    if joints is not None:
        return [_origin(task, k, joint) for joint in joints]
    return [point.expression(task, k, q) for point in shoulder_elbow_wrist(task)]


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
