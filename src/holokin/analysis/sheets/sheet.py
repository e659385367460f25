"""`Sheet`: one leaf of a strategy, and the tool poses that it serves as one function."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ...base.poses import pose_from
from ...base.types import Array, Flags, Indices, Matrix, Value, Vector, frozen
from ...motion.checks import Clear
from ...motion.ik import InverseKinematics, InverseStatus, leaf_value
from ...motion.ik.inverse_function import answer, answers, has_one_posture
from ...strategies import HolonomicStrategy
from ...strategies.tasks.frame_task import free_directions
from ...strategies.tasks.task import Task

# --- Tool poses as points: which of many is nearest, which are neighbours, which are far from each other.

TURN_LENGTH = 0.3  # metres that a turn of 1 rad counts where poses are compared: about what it moves what a tool holds
NEIGHBOURS = 8  # nearest poses of each pose that count as its neighbours
PIECE = 4096  # poses that are compared at once


def turn_length(task: Task) -> float:
    """What a turn of 1 rad counts for a task [m]: nothing where only positions matter."""
    return TURN_LENGTH if any(task._angular) else 0.0


def features(T: Array, length: float) -> Matrix:
    """Poses (k, 4, 4) as points (k, 12): their distances are those of the positions, and length times the turn's chord
    2 sin(angle / 2)."""
    return np.hstack([T[:, :3, 3], (length / np.sqrt(2)) * T[:, :3, :3].reshape(-1, 9)])


def seen_features(task: Task) -> Matrix:
    """S (12, 12): poses as points X (k, 12), X S, are as far apart as the task tells them apart.

    Coordinates without a row count nothing; of a tool that may spin about a direction a, R a a^T stands for R.
    """
    S, direction = np.eye(12), free_directions(task)[0]
    S[:3, :3] = np.diag(np.isin((0, 1, 2), task.rows))
    if direction is not None:
        axis, of_base = direction
        scale = np.sqrt(2) * np.outer(axis, axis)
        S[3:, 3:] = np.kron(scale, np.eye(3)) if of_base else np.kron(np.eye(3), scale)
    return S


@dataclass(frozen=True, eq=False)
class PosePoints(Value):
    """Poses (k, 4, 4) among which the nearest is asked for; a turn of 1 rad counts `length` m, `seen` by a task."""

    poses: Array
    length: float
    seen: Matrix

    def nearest(self, T: Array) -> Indices:
        """The nearest to each of some poses (l, 4, 4), the first one of equals; there must be one at least."""
        return np.concatenate([np.argmin(values, axis=1) for values in self._compared(T)])

    def few(self, T: Array, count: int) -> Indices:
        """The nearest `count`, or all, to each of some poses (l, 4, 4), nearest first."""
        count = min(count, len(self.poses))
        nearest = []
        for values in self._compared(T):
            near = np.argpartition(values, count - 1, axis=1)[:, :count]
            order = np.argsort(np.take_along_axis(values, near, axis=1), axis=1, kind="stable")
            nearest.append(np.take_along_axis(near, order, axis=1))
        return np.concatenate(nearest)

    def _compared(self, T: Array) -> Iterator[Matrix]:
        """Half the squared distances of some poses to all, but for what all of one pose have in common.

        Each pose for itself, so that they have the same last bits in any company: of equal ones one is the nearest.
        """
        X, half = self._points
        Y = np.matmul(features(T, self.length)[:, None], self.seen)[:, 0]
        for part in np.array_split(Y, 1 + len(Y) // PIECE):
            yield half - np.matmul(X[None], part[:, :, None])[..., 0]

    @cached_property
    def _points(self) -> tuple[Matrix, Vector]:
        """(points (k, 12), half their squared lengths)."""
        X = features(self.poses, self.length) @ self.seen
        return X, 0.5 * np.sum(X**2, axis=1)


def nearby(T: Array, length: float, count: int = NEIGHBOURS) -> Indices:
    """Of each of some poses (k, 4, 4) its nearest others (k, m), nearest first."""
    from scipy.spatial import KDTree

    X = features(T, length)
    return np.asarray(KDTree(X).query(X, min(count + 1, len(X)))[1]).reshape(len(X), -1)[:, 1:]


def neighbours(T: Array, length: float, count: int = NEIGHBOURS) -> Indices:
    """Pairs (e, 2) of poses (k, 4, 4) that are near each other: each with its nearest `count`."""
    if len(T) < 2:
        return np.zeros((0, 2), dtype=int)
    near = nearby(T, length, count)
    pairs = np.column_stack([np.repeat(np.arange(len(T)), near.shape[1]), near.ravel()])
    return np.unique(np.sort(pairs, axis=1), axis=0)


def spread_out(T: Array, which: Indices, count: int, length: float) -> Indices:
    """Of some poses of T (k, 4, 4), up to `count` that are far from each other; a turn of 1 rad counts `length` m."""
    if not len(which):
        return which
    X = features(T[which], length)
    chosen = [int(np.argmin(np.linalg.norm(X - X.mean(axis=0), axis=1)))]
    away = np.full(len(X), np.inf)
    while len(chosen) < min(count, len(X)):
        away = np.minimum(away, np.linalg.norm(X - X[chosen[-1]], axis=1))
        chosen.append(int(np.argmax(away)))
    return which[chosen]


# Stations of a sheet from which a pose is tried at most, nearest first. On a Panda, of 42 poses that four sheets
# refuse from six of them, four are reached from the next six, and three from another 36.
STATIONS = 12


@dataclass(frozen=True, eq=False)
class Sheet(Value):
    """The leaf g(q) = g(q0) of a strategy, on the branch of q0 (n,), and the tool poses that it serves.

    It serves the poses that a straight path reaches on the leaf from the tool pose of the nearest station, or of one of
    the next eleven, where the posture is within the joint limits, where rcond of [J; J_g] is at least `rcond`, and
    where the robot keeps clear of what was named.

    stations: postures (h, n) of the leaf from which poses are reached; none (0, n) for q0 alone. Those of `hk.sheets`
    are at the sampled poses that the sheet serves; next to each other, each leads to the other, except where the leaf
    ends between them or overlaps itself. places: the tool poses (h, 4, 4) of these. keys: what a job says of the
    strategy, empty where it was given as a value.
    """

    strategy: HolonomicStrategy
    q0: Vector
    rcond: float = 0.0
    keys: Mapping[str, Any] = field(default_factory=dict)
    stations: Matrix = field(default_factory=lambda: np.zeros((0, 0)))
    places: Array = field(default_factory=lambda: np.zeros((0, 4, 4)))

    @property
    def name(self) -> str:
        """That of the strategy."""
        return self.strategy.name

    @cached_property
    def level(self) -> Vector:
        """c (r,) of the leaf; empty where nothing is redundant."""
        return frozen(leaf_value(self.strategy, self.q0))

    def off(self, q: Vector) -> float:
        """How far a posture (n,) is off the leaf: the largest |g(q) - c| [units of g], angles by the shorter way."""
        gap = leaf_value(self.strategy, q) - self.level
        return float(np.abs(self.strategy.constraint.nearest(gap)).max()) if len(gap) else 0.0

    @cached_property
    def ik(self) -> InverseKinematics:
        """Inverse kinematics on the leaf, within the joint limits."""
        return InverseKinematics(self.strategy, self.q0, limits=True)

    @cached_property
    def single(self) -> bool:
        """Whether signs of a closed form tell its posture of a pose, on the whole arm: then no path is followed."""
        return has_one_posture(self.ik)

    def posture(self, pose: Matrix, clear: Clear | None = None) -> Vector | None:
        """The joints (n,) at a tool pose (4, 4); None where it is not served."""
        if self.single:
            return self._straight(pose, None, clear)
        q = self._straight(pose, self.nearest_station(pose), clear)
        if q is None:
            for i in self._places.few(pose[None], STATIONS)[0, 1:]:
                if (q := self._straight(pose, self.begin[i], clear)) is not None:
                    break
        return q

    def _straight(self, pose: Matrix, begin: Vector | None, clear: Clear | None) -> Vector | None:
        q = answer(self.ik, pose, begin)
        if q is None or (self.rcond and not self.strategy.gain(q)[1] >= self.rcond):
            return None
        return q if clear is None or clear(q[None])[0] else None

    def postures(self, poses: Array, clear: Clear | None = None, threads: int | None = None) -> tuple[Matrix, Flags]:
        """(joints (k, n), which are served (k,)) at tool poses (k, 4, 4); a row of NaN where one is not served."""
        if not len(poses):
            return np.zeros((0, len(self.q0))), np.zeros(0, dtype=bool)
        if self.single:
            found = self.ik.batch(poses, threads=threads)
            q, reached = found.last.copy(), found.status == InverseStatus.REACHED
            served = allowed_postures(self.strategy, q, reached, self.rcond, clear)
            q[~served] = np.nan
            return q, served
        q, served = self.reached(self.begin[self._places.nearest(poses)], poses, clear, threads)
        left = np.flatnonzero(~served)
        few = self._places.few(poses[left], STATIONS) if len(left) else np.zeros((0, 1), dtype=int)
        for column in few.T[1:]:
            still = ~served[left]
            poses_left = left[still]
            q[poses_left], served[poses_left] = self.reached(
                self.begin[column[still]], poses[poses_left], clear, threads
            )
        return q, served

    def reached(
        self, begin: Matrix, poses: Array, clear: Clear | None = None, threads: int | None = None
    ) -> tuple[Matrix, Flags]:
        """The same straight from postures of the leaf (k, n), one for each pose."""
        q, reached = answers(self.ik, poses, begin, threads)
        served = allowed_postures(self.strategy, q, reached, self.rcond, clear)
        q[~served] = np.nan
        return q, served

    def nearest_station(self, pose: Matrix) -> Vector:
        """Its station (n,) whose tool pose is nearest to a pose (4, 4)."""
        return self.begin[self._places.nearest(pose[None])[0]]

    @cached_property
    def begin(self) -> Matrix:
        """The postures (h, n) from which poses are reached: its stations, or q0 alone."""
        return self.stations if len(self.stations) else frozen(self.q0[None])

    @cached_property
    def begin_at(self) -> Array:
        """The tool poses (h, 4, 4) of these."""
        return self.places if len(self.stations) else frozen(pose_from(*self.strategy.task._poses(self.q0[None])))

    @cached_property
    def _places(self) -> PosePoints:
        task = self.strategy.task
        return PosePoints(self.begin_at, turn_length(task), seen_features(task))

    def __str__(self) -> str:
        level = ", ".join(f"{c:.4g}" for c in self.level.round(9) + 0.0)  # -0 is 0
        return f"{self.name}, level {level}" if level and self.strategy.constraint.tilt is None else self.name


def allowed_postures(
    strategy: HolonomicStrategy, q: Matrix, reached: Flags, rcond: float, clear: Clear | None
) -> Flags:
    """Which of some postures (k, n) that were reached (k,) are regular enough, and clear of what was named."""
    served = reached.copy()
    if rcond and served.any():
        served[served] = strategy.gain.batch(q[served])[1].ravel() >= rcond
    if clear is not None and served.any():
        served[served] = clear(q[served])
    return served


def known(q: Array) -> Flags:
    """Which postures (..., n) are there: rows of NaN stand for none."""
    return np.asarray(np.isfinite(q).all(axis=-1))


def postures_of_sheets(sheets: Sequence[Sheet], T: Array, clear: Clear | None, n: int) -> Array:
    """The joints of each sheet (S, k, n) at tool poses (k, 4, 4), NaN where it does not serve."""
    return np.array([sheet.postures(T, clear)[0] for sheet in sheets]).reshape(len(sheets), len(T), n)
