"""Inverse kinematics asked without a word: where it has no answer nothing is raised, and no reason is searched for."""

from __future__ import annotations

import numpy as np

from ...base.errors import HolokinError
from ...base.poses import PoseLike
from ...base.types import Array, ArrayLike, Flags, Matrix, Vector
from ...strategies import may_jump
from .inverse_function import AGREE, InverseKinematics
from .solutions import InverseStatus


def how_far(ik: InverseKinematics, pose: PoseLike, q: ArrayLike) -> tuple[Vector, InverseStatus]:
    """How far `ik.near(pose, q)` gets: (the posture (n,) to which its path was gone, what became of the pose).

    Raises:
        ShapeError, NotFiniteError, ArgumentError: a bad pose or posture.
    """
    p, R = ik._given.one(pose)
    return ik._paths.go(p, R, ik.strategy.task.robot.checked(q, "the posture to begin from"))


def leads_to(ik: InverseKinematics, pose: PoseLike, begin: ArrayLike, q: ArrayLike) -> bool:
    """Whether the leaf, followed straight from one posture (n,) to a tool pose, comes to the posture q (n,) there."""
    try:
        return bool(np.abs(ik.near(pose, begin) - np.asarray(q)).max() < AGREE)
    except HolokinError:
        return False


def answer(ik: InverseKinematics, pose: PoseLike, begin: Vector | None = None) -> Vector | None:
    """`ik(pose)`, or with a posture to begin from (n,) `ik.near(pose, begin)`; None where it has no answer: nothing is
    searched for that would say why. No region is looked at. Raises: a bad pose."""
    return ik._quiet[0](pose) if begin is None else ik._quiet[1](pose, begin)


def answers(ik: InverseKinematics, poses: Array, begin: Matrix, threads: int | None = None) -> tuple[Matrix, Flags]:
    """(postures (k, n), which are reached (k,)): of tool poses (k, 4, 4), each as `ik.near(pose, begin)` from its
    posture (k, n). No region is looked at."""
    p, R = ik._given.places(poses)
    q, reached = ik._paths.go_each(p, R, begin, threads)
    if may_jump(ik.strategy):
        for i in np.flatnonzero(reached):
            reached[i] = ik._paths.jump(p[i], R[i], begin[i], q[i], InverseStatus.REACHED) is None
    return q, reached


def is_native(ik: InverseKinematics) -> bool:
    """Whether native code answers, which is built if it is not yet there."""
    return ik._paths.kernel is not None
