"""Self-motions of an arm with one redundant joint, and the postures on them where small loops do not drift. [KK89]"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, cast

import numpy as np

from ..errors import ArgumentError, SingularityError, SingularityKind
from ..strategy import Strategy
from ..task import Task
from ..types import ArrayLike, Matrix, Vector
from .curvature import curvature, curvature_function, pairs

Ending = Literal["closed", "limit", "singular", "length"]
"""Why a self-motion was traced no further."""


@dataclass(frozen=True, eq=False)
class SelfMotion:
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


@dataclass(frozen=True, eq=False)
class DriftFree:
    """A posture q (n,) whose curvature vanishes in a task plane, so that small loops in it do not drift.

    `slope` [1 / (task unit i * task unit j)]: d kappa / ds along the self-motion. Near it, small loops of one
    direction drift towards q, those of the other away from it.
    """

    q: Vector
    plane: tuple[int, int]
    slope: float

    @property
    def attracts(self) -> str:
        """The direction of loops, in the plane (x_i, x_j), that drift towards it."""
        return "counter-clockwise" if self.slope < 0 else "clockwise"


def self_motion(
    task: Task, q0: ArrayLike, *, step: float = 0.02, length: float = 4 * np.pi, limits: bool = True
) -> SelfMotion:
    """Trace the postures that hold the tool where it is at q0, both ways: dq/ds = n(q), corrected to f(q) = f(q0).

    Args:
        step: arc length between postures [joint units]. length: at most so far each way.

    Raises:
        ArgumentError: not one redundant joint, or bad figures. SingularityError: J is singular at q0.
    """
    start = task.robot.checked(q0, "the start posture")
    if task.n - task.m != 1:
        raise ArgumentError("the number of redundant joints", task.n - task.m, "self-motions of one are curves")
    if not (0 < step < length < np.inf):
        raise ArgumentError("the step and length of a self-motion", (step, length), "give 0 < step < length")
    pose = task.robot.pose(start, task.tip)
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
            n = _unit_null(task, q, before)
            middle = _unit_null(task, q + step / 2 * n, n)
            new = q + step * middle
            for _ in range(3):
                new = new + _correction(task, new, pose)
        except SingularityError:
            return found, "singular"
        if not np.linalg.norm(new - q) < 2 * abs(step):
            return found, "singular"
        if limits and ((new < robot.lower) | (new > robot.upper)).any():
            return found, "limit"
        turned = new - start
        hinges = np.array([c.unit == "rad" for c in robot.coordinates])
        turned[hinges] = np.arctan2(np.sin(turned[hinges]), np.cos(turned[hinges]))
        if k > 2 and np.linalg.norm(turned) < 0.75 * abs(step):
            found.append(new)
            return found, "closed"
        found.append(new)
        q, before = new, n
    return found, "length"


def _correction(task: Task, q: Vector, pose: Matrix) -> Vector:
    """The least joint motion (n,) that, to first order, takes the tool to a pose."""
    least = np.linalg.lstsq(task.jacobian(q), task.error(q, pose[:3, 3], pose[:3, :3]), rcond=None)[0]
    return np.asarray(least, dtype=float)


def _unit_null(task: Task, q: Vector, before: Vector | None) -> Vector:
    """The unit null vector of J at q, turned as `before`. Raises: SingularityError."""
    J = task.jacobian(q)
    _, sigma, V = np.linalg.svd(J)
    if sigma[-1] < 1e-6 * sigma[0]:
        what = f"the self-motion of the {task.name}"
        raise SingularityError(SingularityKind.KINEMATIC, q, what, float(sigma[-1]))
    n = V[-1]
    sign = np.linalg.det(np.vstack([J, n])) if before is None else n @ before
    return n if sign >= 0 else -n


def drift_free(
    strategy: Strategy, q0: ArrayLike, plane: tuple[int, int] = (0, 1), *, step: float = 0.02, limits: bool = True
) -> tuple[DriftFree, ...]:
    """The postures with the tool pose of q0 at which small loops in a task plane do not drift, and their stability.

    Zeros along the self-motion of kappa = n . F_ij; a counter-clockwise loop nears those where kappa falls, a
    clockwise one those where it rises (theory 2a).

    Args:
        plane: two rows (i, j) of the task.

    Raises:
        ArgumentError: not one redundant joint, or no such plane. SingularityError: J is singular at q0.
    """
    from scipy.optimize import brentq

    task = strategy.task
    i, j = plane
    if not (0 <= i < task.m and 0 <= j < task.m and i != j):
        raise ArgumentError("plane", plane, f"name two of the {task.m} task rows, from 0")
    curve = self_motion(task, q0, step=step, limits=limits)
    column = pairs(task.m).index((min(i, j), max(i, j)))
    sign = 1.0 if i < j else -1.0
    F = curvature_function(strategy).batch(curve.q)[0].reshape(len(curve.q), task.n, -1)[:, :, column] * sign
    normals = [_unit_null(task, curve.q[0], None)]
    for q in curve.q[1:]:
        normals.append(_unit_null(task, q, normals[-1]))
    kappa = np.einsum("ka,ka->k", F, np.array(normals))
    found = []
    for k in np.flatnonzero(kappa[:-1] * kappa[1:] < 0):
        a, b, n = curve.q[k], curve.q[k + 1], normals[k]
        pose = task.robot.pose(a, task.tip)

        def between(share: float, a=a, b=b, pose=pose) -> Vector:
            q = a + share * (b - a)
            for _ in range(3):
                q = q + _correction(task, q, pose)
            return q

        def value(share: float, n=n) -> float:
            q = between(share)
            return float(_unit_null(task, q, n) @ curvature(strategy, q)[:, i, j])

        share = float(cast(float, brentq(value, 0.0, 1.0, xtol=1e-13)))
        gap = float(np.linalg.norm(b - a))
        h = min(0.05, share, 1 - share) or 0.05
        slope = (value(min(1.0, share + h)) - value(max(0.0, share - h))) / (2 * h * gap)
        found.append(DriftFree(between(share), (i, j), slope))
    return tuple(found)
