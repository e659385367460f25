"""What inverse kinematics found: joints, and for each pose what became of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol, runtime_checkable

import numpy as np

from ...base.arguments import typed
from ...base.errors import JointLimitError, ShapeError
from ...base.poses import PoseLike, pose_cure, pose_numbers
from ...base.types import (
    ROTATION,
    Array,
    Flags,
    Indices,
    Matrix,
    NoTruthValue,
    Value,
    Vector,
    finite,
    last_row_gap,
    rotation_gap,
    tool_pose,
)
from ...robot import Robot
from ...strategies import HolonomicStrategy
from ...strategies.tasks.task import Task


class InverseStatus(NoTruthValue, IntEnum, ask="`is InverseStatus.REACHED`"):
    """What became of a pose."""

    REACHED = 0
    """The joints are found."""
    CLAMPED = 1
    """The joints of the nearest pose that the leaf reaches: `nearest` alone gives it."""
    LIMIT = 2
    """The joints are found, but one is beyond its limits; not with limits=False."""
    LEAF_ENDS = 3
    """[J; J_g] turns singular on the way: the leaf has no posture further on."""
    SINGULAR = 4
    """The way begins or ends at a singular posture of the arm, the strategy or a representation."""
    NOT_CONVERGED = 5
    """No next piece of the way could be shown to keep to the branch, or it took too many pieces."""
    NOT_FINITE = 6
    """The pose, or the posture near it, is not finite."""
    NOT_A_ROTATION = 7
    """The pose's rotation is scaled, skewed or left-handed."""
    OTHER_BRANCH = 8
    """The posture to begin from lies on another branch than the start."""
    JUMP = 9
    """g jumps on the way: an if_else, a floor, ... of its formula turns over."""
    OUTSIDE = 10
    """The pose does not belong to the region that was given: only where one was."""


@runtime_checkable
class PoseSet(Protocol):
    """Tool poses over which the leaf through q0 is one function, as a `UniqueRegion` is."""

    @property
    def strategy(self) -> HolonomicStrategy:
        """Of the leaf."""
        ...

    @property
    def q0(self) -> Vector:
        """A posture (n,) on it."""
        ...

    def near(self, p: Matrix, R: Array) -> tuple[Matrix, Vector]:
        """Of tool poses, positions (k, 3) and rotations (k, 3, 3): (postures (k, n) near that of the function, NaN
        outside; how far about them it is the only one of the leaf at the pose (k,) [joint unit])."""
        ...


@dataclass(frozen=True, eq=False)
class Solutions(NoTruthValue, Value, ask="`.reached`"):
    """Inverse kinematics of many poses.

    q: joints (k, n), a row of NaN where a pose was not reached.
    status: an `InverseStatus` for each pose (k,).
    last: the posture (k, n) to which its path was followed; q where it was reached, NaN where there was no path,
        as to a pose that no posture of the arm has.
    """

    q: Matrix
    status: Indices
    last: Matrix

    def __len__(self) -> int:
        return len(self.status)

    def __repr__(self) -> str:
        return f"Solutions({len(self):,} poses, {int(self.reached.sum()):,} reached)"

    def __str__(self) -> str:
        counts = [f"{count:,} {name}" for name, count in self._counts if name != "reached"]
        return "; ".join([f"{int(self.reached.sum()):,} of {len(self):,} poses reached", *counts])

    @property
    def _counts(self) -> list[tuple[str, int]]:
        counts = [(status.name.lower().replace("_", " "), self.count(status)) for status in InverseStatus]
        return [(name, count) for name, count in counts if count]

    def _shown_rows(self) -> list[Sequence[str]]:
        """How many poses have each status."""
        return [("poses", f"{len(self):,}"), *((name, f"{count:,}") for name, count in self._counts)]

    @property
    def reached(self) -> Flags:
        """True where q is found (k,)."""
        return self.status <= InverseStatus.CLAMPED

    @typed
    def count(self, status: InverseStatus) -> int:
        """How many poses have a status."""
        return int((self.status == status).sum())


def in_rows(p: Matrix, R: Array) -> Matrix:
    """Poses as native code takes them, (k, 12F): positions (k, 3F), and rotations (k, 3F, 3) by rows."""
    return np.ascontiguousarray(np.hstack([p, R.reshape(len(p), 3 * p.shape[1])]))


def beyond_limits(robot: Robot, q: Vector) -> bool:
    """True where a joint is beyond its limits."""
    try:
        robot.check_limits(q)
    except JointLimitError:
        return True
    return False


@dataclass(frozen=True, eq=False)
class GivenPoses(Value):
    """The readers of poses for a task. Of positions the rest is that of the start, `p` (3F,) and `R` (3F, 3)."""

    task: Task
    p: Vector
    R: Matrix

    def one(self, pose: PoseLike) -> tuple[Vector, Matrix]:
        """(position, rotation) of one pose. Raises: ShapeError, NotFiniteError, ArgumentError."""
        given = finite("a tool pose", pose_numbers("a tool pose", pose))
        wanted = self.shaped("a tool pose", given[None])[0]
        for matrix in wanted.reshape(-1, 4, 4) if wanted.shape[-2:] == (4, 4) else ():
            tool_pose("a tool pose", matrix)
        p, R = self.places(wanted[None])
        return p[0], R[0]

    def shaped(self, what: str, given: Array) -> Array:
        """Poses (k, 4, 4) or points (k, 3), (k, 2); of several frames (k, F, 4, 4), (k, F, 3) or (k, point).

        Raises: ShapeError.
        """
        frames, point = self.task.frames, self.task._point
        shapes = ((4, 4), (3,), (2,)) if frames == 1 else ((frames, 4, 4), (frames, 3), (point,))
        if given.shape[1:] not in shapes:
            raise ShapeError(what, " or ".join(map(str, shapes)), given.shape[1:], pose_cure(given))
        return given

    def places(self, wanted: Array) -> tuple[Matrix, Array]:
        """Positions (k, 3F) and rotations (k, 3F, 3); of zeros, which is none, where the last row is no pose's."""
        k, p, R = len(wanted), self.p, self.R
        if wanted.shape[-2:] == (4, 4):
            with np.errstate(invalid="ignore"):
                gap = last_row_gap(wanted)[..., None, None]
                turned = np.where(gap < ROTATION, wanted[..., :3, :3], 0.0 * gap)  # NaN where that row is not finite
            side = len(p)
            return np.ascontiguousarray(wanted[..., :3, 3]).reshape(k, side), turned.reshape(k, side, 3)
        points = wanted.reshape(k, int(np.prod(wanted.shape[1:])))
        missing = np.broadcast_to(p[points.shape[1] :], (k, len(p) - points.shape[1]))
        return np.hstack([points, missing]), np.broadcast_to(R, (k, *R.shape))

    def refused(self, p: Matrix, R: Array) -> Indices:
        """The statuses of bad poses; REACHED for the others."""
        status = np.full(len(p), int(InverseStatus.REACHED), dtype=np.intp)
        turned = rotation_gap(R.reshape(len(p), R.shape[1] // 3, 3, 3)).max(axis=1)
        status[~(turned < ROTATION)] = InverseStatus.NOT_A_ROTATION
        status[~(np.isfinite(p).all(axis=1) & np.isfinite(R).all(axis=(1, 2)))] = InverseStatus.NOT_FINITE
        return status
