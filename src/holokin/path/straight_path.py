"""`StraightPath`: from one tool pose to another, the position along a line, the rotation evenly about one axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.types import Array, Indices, Value, Vector


@dataclass(frozen=True, eq=False)
class StraightPath(Value):
    """p(s) = position + s move, R(s) = exp(s turn) rotation, s from 0 to 1: the twist (move, turn) is constant.

    One way, of (3,), (3, 3), (3,), (3,); or many side by side, of (k, 3), (k, 3, 3), (k, 3), (k, 3), or from one pose.
    One way of several frames is of (3F,), (3F, 3), (3F,), (3F,).
    """

    position: Vector
    rotation: Array
    move: Vector
    turn: Vector

    def at(self, share: float | Vector, which: Indices | None = None) -> tuple[Array, Array]:
        """Positions and rotations at a share of all ways, or at one of each (k,); `which`: of some of them."""
        parts = self.position, self.rotation, self.move, self.turn
        p, R, v, w = parts if which is None else (part[which] for part in parts)
        s = np.asarray(share)[..., None]
        if R.shape[-2] == 3:
            return p + s * v, rotation_matrix(s * w) @ R
        return p + s * v, (rotation_matrix((s * w).reshape(-1, 3)) @ R.reshape(-1, 3, 3)).reshape(R.shape)


def straight(position: Vector, rotation: Array, end: Vector, end_rotation: Array) -> StraightPath:
    """The straight path from a pose to another, by the shorter turn; or ways between many."""
    if rotation.shape[-2] == 3:
        turn = rotation_vector(end_rotation @ np.swapaxes(rotation, -1, -2))
    else:
        turn = rotation_vector(end_rotation.reshape(-1, 3, 3) @ np.swapaxes(rotation.reshape(-1, 3, 3), -1, -2)).ravel()
    return StraightPath(position, rotation, end - position, turn)


def rotation_vector(R: Array) -> Array:
    """log: the axes of rotations (..., 3, 3) times their angles (..., 3) [rad]."""
    from scipy.spatial.transform import Rotation  # here, because it doubles the time to import holokin

    return Rotation.from_matrix(R).as_rotvec()


def rotation_matrix(turn: Array) -> Array:
    """exp: the rotations (..., 3, 3) of rotation vectors (..., 3) [rad]."""
    from scipy.spatial.transform import Rotation

    if not np.any(turn):  # most paths turn no tool, and SciPy's takes as long as all else of a step
        return np.tile(np.eye(3), (*np.shape(turn)[:-1], 1, 1))
    return Rotation.from_rotvec(np.array(turn)).as_matrix()  # a copy: it refuses what nobody can write to
