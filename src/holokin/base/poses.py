"""Tool poses as callers have them: arrays, poses of other libraries, a position with a quaternion."""

from __future__ import annotations

from typing import Any, Literal, Protocol, runtime_checkable

import numpy as np

from .arguments import typed
from .errors import ArgumentError, ShapeError
from .types import ROTATION, Array, ArrayLike, check_rotation, finite, last_row_gap, numbers, rotation_gap, tool_pose

QuaternionOrder = Literal["wxyz", "xyzw"]
"""Where the scalar w of a quaternion stands: first, or last."""

ORDERS = {"wxyz": (1, 2, 3, 0), "xyzw": (0, 1, 2, 3)}
"""Where x, y, z and the scalar w stand in a quaternion of each order."""

UNIT = 1e-3
"""How far from 1 the length of a quaternion may be: four digits leave 1e-4, another quantity leaves more."""

TURNED = "give hk.pose_of(position, rotation)"
"""What to do with a position and a rotation."""

CURE = 'give hk.pose_of(position, quaternion, order="wxyz"), or order="xyzw": the numbers do not tell the order'
"""What to do with a position and a quaternion."""


@runtime_checkable
class MatrixPose(Protocol):
    """A pose or rotation of a library that gives its matrix by a method, as `mink.SE3` and SciPy's `Rotation`."""

    def as_matrix(self) -> Any:
        """The matrix (4, 4), or (3, 3)."""


@runtime_checkable
class HomogeneousPose(Protocol):
    """A pose of a library that has its matrix (4, 4) as an attribute, as `pinocchio.SE3`."""

    @property
    def homogeneous(self) -> Any:
        """The matrix (4, 4)."""


PoseLike = ArrayLike | MatrixPose | HomogeneousPose
"""What a caller may pass as a pose, or as many: arrays, `mink.SE3`, `pinocchio.SE3`, or a list of these."""


@typed
def pose_of(
    position: ArrayLike, quaternion: ArrayLike | MatrixPose, *, order: QuaternionOrder | Literal[""] = ""
) -> Array:
    """The pose of a position and a quaternion or rotation, or of many: T = [R p; 0 1].

    No number of a quaternion tells whether the scalar w stands first or last: both orders are rotations. So the order
    has no default. MuJoCo, mink and Eigen's constructor have "wxyz"; ROS, SciPy and Pinocchio's arrays have "xyzw".

    Args:
        position: (3,) or (k, 3) [m].
        quaternion: (4,) or (k, 4), of length 1 to 1e-3; its length is then made 1. Or SciPy's `Rotation`, or rotation
            matrices (3, 3) or (k, 3, 3), which have no order.
        order: "wxyz" or "xyzw".

    Returns:
        (4, 4), or (k, 4, 4).

    Raises:
        ArgumentError: another order, or a quaternion that has not length 1. ShapeError, NotFiniteError.
    """
    p = finite("the position", position)
    if p.ndim not in (1, 2) or p.shape[-1] != 3:
        raise ShapeError("the position", "(3,) or (k, 3)", p.shape)
    turned: Any = quaternion
    four = finite("the quaternion", turned.as_matrix() if hasattr(turned, "as_matrix") else turned)
    if four.shape == (*p.shape[:-1], 3, 3) and not order:
        for R in four.reshape(-1, 3, 3):
            check_rotation("the rotation", R)
        return pose_from(p, four)
    if order not in ORDERS:
        raise ArgumentError("order", order, f"say where the scalar w stands: {' or '.join(map(repr, ORDERS))}")
    if four.shape != (*p.shape[:-1], 4):
        raise ShapeError("the quaternion", (*p.shape[:-1], 4), four.shape, "give one for each position")
    length = np.linalg.norm(four, axis=-1, keepdims=True)
    off = np.abs(length - 1)
    if not (off < UNIT).all():
        worst = four.reshape(-1, 4)[np.argmax(off)]
        cure = f"its length is {np.linalg.norm(worst):.4g}: give one of length 1"
        raise ArgumentError("the quaternion", worst.tolist(), cure)
    return pose_from(p, _turned((four / length)[..., ORDERS[order]]))


def pose_from(position: ArrayLike, rotation: ArrayLike = ((1, 0, 0), (0, 1, 0), (0, 0, 1))) -> Array:
    """Poses (..., 4, 4) of positions (..., 3) and rotations (..., 3, 3), or one rotation for all; unchecked."""
    p = np.asarray(position, dtype=float)
    T = np.zeros((*p.shape[:-1], 4, 4))
    T[..., :3, :3], T[..., :3, 3], T[..., 3, 3] = rotation, p, 1.0
    return T


def _turned(quaternion: Array) -> Array:
    """Rotations (..., 3, 3) of unit quaternions (..., 4), the scalar last: R = 2 v v^T + (2 w^2 - 1) 1 + 2 w [v]."""
    v, w = quaternion[..., :3], quaternion[..., 3, None, None]
    crossed = -np.cross(v[..., None, :], np.eye(3))
    return 2 * v[..., :, None] * v[..., None, :] + (2 * w**2 - 1) * np.eye(3) + 2 * w * crossed


def pose_numbers(what: str, value: Any) -> Array:
    """The numbers of a pose, or of many, of any shape: of poses of other libraries their matrices.

    Raises:
        ArgumentError: no numbers; a position and a quaternion, whose order nobody said.
    """
    if isinstance(value, np.ndarray) and value.dtype == np.float64:
        return np.asarray(value)
    return numbers(what, with_matrices(what, value))


def given_pose(what: str, value: Any, shape: tuple[int | str, ...] = (4, 4), cure: str = "") -> Array:
    """Poses of a shape, of finite numbers. Raises: ArgumentError, ShapeError, NotFiniteError."""
    given = pose_numbers(what, value)
    return finite(what, given, shape, pose_cure(given) or cure)


def pose_cure(given: Array) -> str:
    """What to say of an array of the wrong shape: seven numbers are a position and a quaternion."""
    return CURE if given.shape[-1:] == (7,) else ""


def tool_poses(whose: str, poses: PoseLike) -> Array:
    """Tool poses (k, 4, 4), or none. Raises: ShapeError, NotFiniteError; ArgumentError: one is no pose."""
    empty = poses.size == 0 if isinstance(poses, np.ndarray) else isinstance(poses, list | tuple) and not poses
    given = np.zeros((0, 4, 4)) if empty else given_pose(f"the poses {whose}", poses, ("k", 4, 4))
    sound = (last_row_gap(given) < ROTATION) & (rotation_gap(given[:, :3, :3]) < ROTATION)
    for i in np.flatnonzero(~sound):
        tool_pose(f"pose {i} {whose}", given[i])
    return given


def with_matrices(what: str, value: Any, depth: int = 3) -> Any:
    """A pose, or a list of them, with matrices in the place of other libraries' poses; what is none is left as it is.

    Args:
        depth: how deep lists may lie in lists: one for each pose, in it one for each frame, in it the pose.

    Raises:
        ArgumentError: a position and a quaternion, whose order nobody said.
    """
    if isinstance(value, list | tuple) and depth:
        widths = [_width(part) for part in value]
        if widths == [3, 4] or (7 in widths and len(set(widths)) > 1):
            raise ArgumentError(what, value, CURE)
        parts = [with_matrices(what, part, depth - 1) for part in value]
        if len(parts) == 2 and widths[0] == 3 and [_height(part) for part in parts] == [0, 3]:
            raise ArgumentError(what, value, TURNED)
        return parts
    if isinstance(value, int | float | np.ndarray | type):
        return value
    if isinstance(value, MatrixPose):
        return value.as_matrix()
    return value.homogeneous if isinstance(value, HomogeneousPose) else getattr(value, "A", value)  # of spatialmath


def _height(part: Any) -> int:
    """Rows of a matrix, as an array or as lists; 0 of one row."""
    return len(part) if _width(part) > 1 and _width(part[0]) > 1 else 0


def _width(part: Any) -> int:
    """Numbers in a row of an array or list; 0 of anything else."""
    if isinstance(part, np.ndarray):
        return int((1, *part.shape)[-1])
    return len(part) if isinstance(part, list | tuple) else 0
