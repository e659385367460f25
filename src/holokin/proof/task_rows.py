"""The rows f(q) - x of a task and what of the tool pose enters them, without a logarithm; and turns left free."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..base.errors import ArgumentError
from ..base.types import Matrix, Vector
from ..strategies.tasks.frame_task import FrameTask, parts_of
from ..strategies.tasks.free_motion import free_directions
from ..strategies.tasks.orientation_rows import AxisDirection
from ..strategies.tasks.task import Task
from ..symbolic import SX, vertcat
from ..symbolic.rotations import frame_about

ALIGNED = 1e-9
"""By how much [-] a free axis may differ from the tool's z axis and count as that."""


def parts(task: Task) -> list[tuple[int, FrameTask]]:
    """(f, the task of frame f) of a task of one frame or more, those of which it has rows.

    Raises: ArgumentError of another kind of task.
    """
    found = []
    for f, part in enumerate(parts_of(task)):
        rows = tuple(row % 6 for row in task.rows if row // 6 == f)
        if rows:
            found.append((f, part if rows == part.rows else replace(part, rows=rows)))
    if not found:
        raise ArgumentError("the task to certify", task.name, "give a task of frames: hk.pose, hk.position, hk.stacked")
    return found


def rows_of(task: Task, position: SX, rotation: SX, p: SX, R: SX) -> tuple[SX, SX]:
    """(f(q) - x (m,), what must be positive so that no half turn is taken for none, a number for each part).

    Args:
        position, rotation: (3F,), (3F, 3) of the frames. p, R: wanted of them.
    """
    found: dict[int, SX] = {}
    facing = []
    for f, part in parts(task):
        at = slice(3 * f, 3 * f + 3)
        rows, ahead = _part(part, position[at], rotation[at, :], p[at], R[at, :])
        found |= {6 * f + row: rows[i] for i, row in enumerate(part.rows)}
        facing.append(ahead)
    return vertcat(*(found[row] for row in task.rows)), vertcat(*facing)


def turned(task: FrameTask) -> bool:
    """Whether its angular rows are those of a twist: of a full orientation, or the one of a plane."""
    return task.turns or (task.geometric and any(task.angular))


def _part(task: FrameTask, position: SX, rotation: SX, p: SX, R: SX) -> tuple[SX, SX]:
    six = [position[i] - p[i] for i in range(3)]
    facing = SX(1)
    kind = task.representation
    if turned(task):
        M = R @ rotation.T
        six += [(M[1, 2] - M[2, 1]) / 2, (M[2, 0] - M[0, 2]) / 2, (M[0, 1] - M[1, 0]) / 2]
        facing = M[0, 0] + M[1, 1] + M[2, 2] + 1
    elif isinstance(kind, AxisDirection) and sum(i > 2 for i in task.rows) == 2:
        a = SX(kind.axis)
        across = (R @ SX(frame_about(kind.axis)))[:, :2].T @ (rotation @ a)
        six += [across[0], across[1]]
        facing = (R @ a).T @ (rotation @ a)
    elif task.orientation is not None:
        gap = kind.value(rotation) - kind.value(R)
        six += [gap[i] for i in range(gap.shape[0])]
    return vertcat(*(six[i] for i in task.rows)), facing


def target_of(task: Task, p: SX, R: SX) -> SX:
    """What of the poses enters E; of a turn R itself, whose change bounds that of its rows twice over."""
    found = []
    for f, part in parts(task):
        at = slice(3 * f, 3 * f + 3)
        found.append(p[at])
        if turned(part) or isinstance(part.representation, AxisDirection):
            found.append(R[at, :].reshape((9, 1)))
        elif part.orientation is not None:
            found.append(part.representation.value(R[at, :]))
    return vertcat(*found)


def reached_by(task: Task, p: SX, R: SX) -> SX:
    """What two tool poses have in common where E is the same: the rows of the task, a turn as R, an axis as R a."""
    found = []
    for f, part in parts(task):
        at = slice(3 * f, 3 * f + 3)
        place, turn, kind = p[at], R[at, :], part.representation
        found += [place[row] for row in part.rows if row < 3]
        if turned(part):
            found.append(turn.reshape((9, 1)))
        elif isinstance(kind, AxisDirection) and any(row > 2 for row in part.rows):
            found.append(turn @ SX(kind.axis))
        elif part.orientation is not None:
            value = kind.value(turn)
            found += [value[row - 3] for row in part.rows if row > 2]
    return vertcat(*found)


def spins_freely(task: Task, R: Matrix) -> bool:
    """Whether turns about the tool's z axis at the middle of a box, whose rotation is R (3, 3), are free."""
    direction = free_directions(task)[0]
    if direction is None:
        return False
    axis, of_base = direction
    return float(np.abs((R.T @ axis if of_base else axis)[:2]).max()) < ALIGNED


def deepest(turn: Matrix, axis: Vector, of_base: bool, half: Vector) -> Matrix:
    """Of turns (k, 4), as quaternions x, y, z, s, then or first turned freely about an axis (3,), those with the least
    of the largest |w_i| / half_i, w the Cayley parameters.

    A free turn by 2 atan(t) leads to a + t b, and 2 w_i = (a_i + t b_i) / (a_s + t b_s): where two of the ratios are
    as large, or one is 0, t solves a linear equation.
    """
    from scipy.spatial.transform import Rotation

    free, turns = Rotation.from_quat([*axis, 0.0]), Rotation.from_quat(turn)
    a, b = turns.as_quat(), (free * turns if of_base else turns * free).as_quat()
    size = np.maximum(half, 1e-12)
    A, B = a[:, :3] / size, b[:, :3] / size
    pairs = [(i, j, sign) for i in range(3) for j in range(i, 3) for sign in ((1.0,) if i == j else (1.0, -1.0))]
    best, least = turn, np.full(len(turn), np.inf)
    for i, j, sign in pairs:
        over, under = A[:, i] + sign * (A[:, j] if i != j else 0.0), B[:, i] + sign * (B[:, j] if i != j else 0.0)
        length = np.hypot(over, under)
        c, s = (np.where(length > 0, x / np.where(length > 0, length, 1.0), y) for x, y in ((under, 1.0), (-over, 0.0)))
        tried = c[:, None] * a + s[:, None] * b
        tried *= np.where(tried[:, 3:] < 0, -1.0, 1.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.abs(tried[:, :3] / size).max(axis=1) / tried[:, 3]
        better = ratio < least
        best, least = np.where(better[:, None], tried, best), np.where(better, ratio, least)
    return best
