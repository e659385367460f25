"""Tool poses as tensors of torch or JAX: positions and rotations of all frames, and the twist with which they move.

The library is an argument `xp`: of torch and of `jax.numpy` the functions used here have one signature. Leading axes,
any number, are those of a batch.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..base.errors import ArgumentError, ShapeError
from ..base.types import Array
from .joint_map import JointMap

ORDERS = {"wxyz": (0, 1, 2, 3), "xyzw": (1, 2, 3, 0)}
"""Which of w, x, y, z each number of a quaternion is."""


class JointTensors(NamedTuple):
    """What inverse kinematics of a batch found: `q` (..., n), `status` (...), an `InverseStatus` as a number.

    q is NaN, and its derivative zero, where the status is not REACHED, which is 0.
    """

    q: Any
    status: Any


def _levi_civita() -> Array:
    e = np.zeros((3, 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        e[i, j, k], e[i, k, j] = 1.0, -1.0
    return e


def _quaternion_form() -> Array:
    """C (3, 3, 4, 4) with R_ij = C_ijab q_a q_b of a unit quaternion q = (w, x, y, z)."""
    C = np.zeros((3, 3, 4, 4))
    C[:, :, 0, 0] = np.eye(3)  # (w^2 - v.v) 1 + 2 v v^T + 2 w [v]x
    for k in range(3):
        C[:, :, k + 1, k + 1] -= np.eye(3)
        C[:, :, 0, k + 1] = -2 * _levi_civita()[:, :, k]
        for i in range(3):
            C[i, k, i + 1, k + 1] += 2.0
    return C


TURN = -0.5 * _levi_civita()
"""w_k = TURN_kij (dR R^T)_ij: the angular velocity of the part of dR that keeps R a rotation."""

QUATERNION = _quaternion_form()


def _nearest_rotations(R: Any) -> Any:
    """The rotations nearest to matrices (..., 3, 3) that are rotations up to rounding, with their derivatives.

    Two Newton-Schulz steps R (3 - R^T R) / 2 towards the polar factor [Hig08]: from a gap s they leave s^4, so that
    at a rotation the first two derivatives are those of the nearest rotation.
    """
    for _ in range(2):
        R = 1.5 * R - 0.5 * _product(R, _product(R.mT, R))
    return R


def _product(A: Any, B: Any) -> Any:
    """A B (..., 3, 3), elementwise: the libraries' own products of many small matrices take 20 times longer."""
    return (A[..., :, :, None] * B[..., None, :, :]).sum(-2)


def _form_of(order: Any) -> Array:
    """C (3, 3, 4, 4) with R_ij = C_ijab q_a q_b of a unit quaternion q (4,) as it is written.

    Raises:
        ArgumentError: no order.
    """
    if not isinstance(order, str) or order not in ORDERS:
        raise ArgumentError("order", order, f"say how the quaternions are written: {' or '.join(map(repr, ORDERS))}")
    places = ORDERS[order]
    return QUATERNION[:, :, places][:, :, :, places]


def _rotations_of(xp: Any, quaternions: Any, form: Any) -> Any:
    """Rotations (..., 3, 3) of quaternions (..., 4) of any length, with the form of their order."""
    square = (quaternions * quaternions).sum(-1)[..., None, None]
    return xp.einsum("ijab,...a,...b->...ij", form, quaternions, quaternions) / square


def angular_velocity(xp: Any, turn: Any, R: Any, dR: Any) -> Any:
    """w (..., 3) of the part of dR (..., 3, 3) that keeps R a rotation."""
    return xp.einsum("kij,...il,...jl->...k", turn, dR, R)


def rotation_gradient(xp: Any, turn: Any, R: Any, w: Any) -> Any:
    """The transpose of `angular_velocity`: w (..., 3) -> (..., 3, 3)."""
    return xp.einsum("kij,...k,...jl->...il", turn, w, R)


def third_derivative() -> ArgumentError:
    """What is said of derivatives that are not computed."""
    return ArgumentError("the derivative of inverse kinematics", "a third one", "ask for first and second derivatives")


@dataclass(frozen=True, eq=False)
class GivenTensors:
    """Batches as they are given: `given` as `ik.batch` takes it, positions (..., 3F), rotations (..., F, 3, 3)."""

    given: Any
    p: Any
    R: Any


def read_tensors(
    xp: Any, joints: JointMap, tensor: Callable[[Array], Any], poses: Any, turns: Any, order: Any
) -> GivenTensors:
    """Positions and rotations of poses, of positions alone, or of positions and quaternions `turns`.

    Args:
        xp: the library. tensor: makes its tensor of an array.

    Raises:
        ShapeError; ArgumentError: quaternions without their order.
    """
    frames, (start_p, start_R) = joints.task.frames, joints.start
    axes = _leading_axes(tuple(poses.shape), joints.shapes)
    lead, one = tuple(poses.shape[:axes]), tuple(poses.shape[axes:])
    if turns is not None:
        wanted = (*poses.shape[:-1], 4)
        if one[-1] != 3 or tuple(turns.shape) != wanted:
            raise ShapeError("the quaternions", f"{wanted}, with positions (..., 3)", tuple(turns.shape))
        R = _rotations_of(xp, turns, tensor(_form_of(order)))
        last = xp.broadcast_to(tensor(np.array([[0.0, 0.0, 0.0, 1.0]])), (*poses.shape[:-1], 1, 4))
        given = xp.concatenate([xp.concatenate([R, poses[..., None]], -1), last], -2)
        return GivenTensors(given, poses.reshape(*lead, 3 * frames), R.reshape(*lead, frames, 3, 3))
    if one[-2:] == (4, 4):
        p = poses[..., :3, 3].reshape(*lead, 3 * frames)
        return GivenTensors(poses, p, _nearest_rotations(poses[..., :3, :3].reshape(*lead, frames, 3, 3)))
    size = int(np.prod(one))
    rest = xp.broadcast_to(tensor(start_p[size:]), (*lead, 3 * frames - size))
    p = xp.concatenate([poses.reshape(*lead, size), rest], -1)
    return GivenTensors(poses, p, xp.broadcast_to(tensor(start_R), (*lead, frames, 3, 3)))


def _leading_axes(shape: tuple[int, ...], known: tuple[tuple[int, ...], ...]) -> int:
    """How many axes of a shape are of the batch: those before the first known shape that fits. Raises: ShapeError."""
    for one in known:
        if len(shape) >= len(one) and shape[len(shape) - len(one) :] == one:
            return len(shape) - len(one)
    words = " or ".join(f"(..., {', '.join(map(str, one))})" for one in known)
    raise ShapeError("the tool poses", words, shape)
