"""The self-motion through a posture of an arm with one redundant joint: all postures with the same tool pose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..arguments import typed
from ..errors import ArgumentError, SingularityError, SingularityKind
from ..symbolic import wrapped
from ..symbolic.null_space import null_vector
from ..task import Task
from ..types import MOST, ArrayLike, Matrix, Value, Vector

Ending = Literal["closed", "limit", "singular", "length"]
"""Why a self-motion was traced no further."""


@dataclass(frozen=True, eq=False)
class SelfMotion(Value):
    """Postures (k, n) with one tool pose, in order, s (k,) [joint units] their arc length from the given posture.

    `endings`: why it stops at its first and at its last posture; both "closed" when it comes back to itself.
    """

    task: Task
    q: Matrix
    s: Vector
    endings: tuple[Ending, Ending]

    @property
    def closed(self) -> bool:
        """True when the self-motion leads back to where it began."""
        return self.endings[0] == "closed"


@typed
def self_motion(
    task: Task, q0: ArrayLike, *, step: float = 0.02, length: float = 4 * np.pi, limits: bool = True
) -> SelfMotion:
    """Trace the postures that hold the tool where it is at q0, both ways: dq/ds = n(q), corrected to f(q) = f(q0).

    Args:
        step: arc length between postures [joint units]. length: at most so far each way.

    Raises:
        ArgumentError: not one redundant joint, or bad numbers. SingularityError: J is singular at q0.
    """
    start = task.robot.checked(q0, "the start posture")
    if task.n - task.m != 1:
        raise ArgumentError(
            "the number of redundant joints",
            task.n - task.m,
            "give a task that leaves one",
        )
    if not (0 < step < length < np.inf and length / step <= MOST):
        raise ArgumentError(
            "the step and length of a self-motion",
            (step, length),
            f"give 0 < step < length, {MOST:g} steps at most",
        )
    pose = task.pose(start)
    ahead, end = _traced(task, start, pose, step, length, limits)
    behind, first = ([], end) if end == "closed" else _traced(task, start, pose, -step, length, limits)
    q = np.array([*behind[::-1], start, *ahead])
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1))])
    return SelfMotion(task, q, lengths - lengths[len(behind)], (first, end))


def _traced(
    task: Task, start: Vector, pose: Matrix, step: float, length: float, limits: bool
) -> tuple[list[Vector], Ending]:
    robot = task.robot
    found: list[Vector] = []
    q, before = start, None
    for k in range(int(np.ceil(length / abs(step)))):
        try:
            n = unit_null(task, q, before)
            middle = unit_null(task, q + step / 2 * n, n)
            new = q + step * middle
            for _ in range(3):
                new = new + correction(task, new, pose)
        except SingularityError:
            return found, "singular"
        if not np.linalg.norm(new - q) < 2 * abs(step):
            return found, "singular"
        if limits and ((new < robot.lower) | (new > robot.upper)).any():
            return found, "limit"
        turned = new - start
        hinges = robot.hinges
        turned[hinges] = wrapped(turned[hinges])
        if k > 2 and np.linalg.norm(turned) < 0.75 * abs(step):
            found.append(new)
            return found, "closed"
        found.append(new)
        q, before = new, n
    return found, "length"


def correction(task: Task, q: Vector, pose: Matrix) -> Vector:
    """The least joint motion (n,) that, to first order, takes the tool to a pose."""
    least = np.linalg.lstsq(task.jacobian(q), task.error(q, pose[:3, 3], pose[:3, :3]), rcond=None)[0]
    return np.asarray(least, dtype=float)


def unit_null(task: Task, q: Vector, before: Vector | None) -> Vector:
    """The unit null vector of J at q, turned as `before`. Raises: SingularityError."""
    J = task.jacobian(q)
    sigma = np.linalg.svd(J, compute_uv=False)
    if sigma[-1] < 1e-6 * sigma[0]:
        what = f"the self-motion of the {task.name}"
        raise SingularityError(SingularityKind.KINEMATIC, q, what, float(sigma[-1]))
    return null_vector(J, before)
