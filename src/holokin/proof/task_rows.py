"""The rows f(q) - x of a task and what of the tool pose enters them, as expressions without a logarithm."""

from __future__ import annotations

from dataclasses import replace

from ..errors import ArgumentError
from ..symbolic import SX, vertcat
from ..symbolic.rotations import frame_about
from ..tasks.frame_task import FrameTask, parts_of
from ..tasks.orientation_rows import AxisDirection
from ..tasks.task import Task


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
