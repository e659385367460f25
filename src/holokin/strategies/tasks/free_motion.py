"""What a task leaves free: motions of its frames that no row of it sees. They are no demand.

A pose that is asked for of such a task says more than is meant: a spin about a free axis, a height where only x and y
count. What is meant is `completed` from where the frames are: the pose that the task cannot tell from the one asked
for, whose free part is that of a pose at hand. Straight paths lead to it, so that they hold no free motion.
"""

from __future__ import annotations

import numpy as np

from ...base.types import Matrix, Vector, kept
from ...symbolic import Function, vertcat
from .frame_task import FrameTask, parts_of
from .task import Task

Place = tuple[Vector, Matrix]
"""Positions (3F,) and rotations (3F, 3) of F frames."""


@kept
def leaves_free(task: Task) -> bool:
    """Whether a task has not all six rows of all its frames."""
    return not all({0, 1, 2} <= rows and len(rows) == 6 for _, rows in _rows(task))


def completed(task: Task, place: Place, here: Place) -> Place:
    """The place that a task cannot tell from the one that is given, and whose free part is that of another, `here`.

    Coordinates of positions that the task has no rows of are those of `here`; a rotation is that of `here`, turned no
    farther than the task asks.
    """
    return completing(task)(*here, *place) if leaves_free(task) else place


@kept
def completing(task: Task) -> Function:
    """(p0, R0, p, R) -> (p, R) `completed` from p0, R0: positions (3F,) and rotations (3F, 3)."""
    (p0, R0), (p, R) = task.target_symbols(), task.target_symbols()
    positions, rotations = [], []
    for f, (part, rows) in enumerate(_rows(task)):
        at = slice(3 * f, 3 * f + 3)
        positions += [p[3 * f + i] if i in rows else p0[3 * f + i] for i in range(3)]
        turned = sorted(row - 3 for row in rows if row > 2)
        rotations.append(part.representation.completed(R[at, :], turned, R0[at, :]))
    inputs = {"p0": p0, "R0": R0, "p": p, "R": R}
    return Function("completed", inputs, {"p": vertcat(*positions), "R": vertcat(*rotations)})


@kept
def free_directions(task: Task) -> list[tuple[Vector, bool] | None]:
    """Of each frame the axis (3,) about which it may spin, fixed in it, or, with True, in the base; None where none."""
    found: list[tuple[Vector, bool] | None] = []
    for part, rows in _rows(task):
        one = part.representation.directions.get(tuple(sorted(row - 3 for row in rows if row > 2)))
        found.append(None if one is None else (np.asarray(one[0], dtype=float), one[1]))
    return found


def _rows(task: Task) -> list[tuple[FrameTask, set[int]]]:
    """The part of each frame, and which of its six rows the task has."""
    return [(part, {row % 6 for row in task.rows if row // 6 == f}) for f, part in enumerate(parts_of(task))]
