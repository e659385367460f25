"""Tool poses as points: which of many is nearest, which are neighbours, which are far from each other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.types import Array, Indices, Matrix, Value, Vector
from ...strategies.tasks.free_motion import free_directions
from ...strategies.tasks.task import Task

TURN_LENGTH = 0.3
"""Metres that a turn of 1 rad counts where poses are compared: about what it moves what a tool holds."""

NEIGHBOURS = 8
"""Nearest poses of each pose that count as its neighbours."""

PIECE = 4096
"""Poses that are compared at once."""


def turn_length(task: Task) -> float:
    """What a turn of 1 rad counts for a task [m]: nothing where only positions matter."""
    return TURN_LENGTH if any(task.angular) else 0.0


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
        one = np.sqrt(2) * np.outer(axis, axis)
        S[3:, 3:] = np.kron(one, np.eye(3)) if of_base else np.kron(np.eye(3), one)
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
        found = []
        for values in self._compared(T):
            near = np.argpartition(values, count - 1, axis=1)[:, :count]
            order = np.argsort(np.take_along_axis(values, near, axis=1), axis=1, kind="stable")
            found.append(np.take_along_axis(near, order, axis=1))
        return np.concatenate(found)

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
