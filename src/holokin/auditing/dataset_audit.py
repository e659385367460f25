"""Does a robot learning dataset have one posture for each tool pose? Equal poses over all of its episodes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arguments import typed
from ..base.types import ArrayLike, Flags, Vector
from ..errors import ArgumentError
from ..recording.dataset_columns import JointFeature, PoseFeature, postures_of, tool_poses_of
from ..recording.dataset_folder import Dataset, rows
from ..robot import Robot
from ..tasks.task import Task
from .arcs import tool_points
from .cycles import LENGTH_SCALE
from .dataset_findings import DatasetAudit, EqualPoses, Numbers
from .equal_poses import to_pose
from .log_audit import task_of_tool

NEAR = 5e-3
"""Distance [m] of two tool poses up to which they are compared."""

TOLERANCE = 1e-2
"""Joint distance [rad or m] that counts as equal: half a degree, below which hobby servos do not stand still."""

SLOPE = 5.0
"""How far spare joints may move beside those that follow the tool from one pose to the next, times as far. Of 780,000
frames of a Panda with a locked joint 6,000 pairs of near poses took up to 3.3, of 97,000 frames with its arm angle kept
2.4; near a posture where the leaf ends it has no bound."""

AWAY = 4.0
"""Within an episode a pose counts as visited again only if the tool was so many times `near` away in between."""

LOOKS = 8
"""Frames between two visits that are looked at for that."""

Whole = NDArray[np.integer[Any]]
"""Rows and cells; 32 bits take half the memory."""

BLOCK = 20_000
"""Frames whose Jacobians are in memory at one time."""


@typed
def audit_dataset(
    dataset: Dataset,
    robot: Robot,
    joints: JointFeature,
    *,
    poses: PoseFeature | None = None,
    episodes: list[int] | None = None,
    tip: str | None = None,
    orientation: bool | None = None,
    axis: str | ArrayLike | None = None,
    near: float = NEAR,
    tolerance: float = TOLERANCE,
    length_scale: float = LENGTH_SCALE,
) -> DatasetAudit:
    """Compare the joints of a dataset wherever its tool pose comes again, within an episode or in another one.

    Two frames have equal poses where they are at most `near` apart. The joints of the second are moved to the pose of
    the first by the pseudo-inverse, dq = J^+ e. They differ if more than the tolerance and `SLOPE` times that move is
    left, which is how far spare joints of a repeating arm may move beside those that follow the tool.

    Args:
        joints: the column of the joints, of `joint_feature`.
        poses: the column of the tool poses; by default they are computed from the joints.
        episodes: indices of those that are compared; by default all.
        tip, axis, length_scale: as of `audit_recording`.
        orientation: False where the orientation of the tool is free; by default it belongs to the pose.
        near: distance [m] of poses that count as equal; angles count `length_scale` [m/rad].
        tolerance: joint distance [rad or m] that counts as equal.

    Raises:
        RecordingError: a dataset that cannot be read. ArgumentError: a bad argument. UnknownNameError: no such tip.
    """
    for what, value in (("near", near), ("tolerance", tolerance), ("length_scale", length_scale)):
        if not (np.isfinite(value) and value > 0):
            raise ArgumentError(what, value, "give a positive number")
    chosen = list(range(len(dataset.episodes))) if episodes is None else episodes
    begins = np.cumsum([0, *(dataset.episodes[i].length for i in chosen)])
    q, points = np.empty((begins[-1], robot.n), np.float32), np.empty((0, 0), np.float32)
    task: Task | None = None
    done, apart, axes = 0, 0.0, np.eye(3)
    names = [joints.name, *([poses.name] if poses is not None and poses.name != joints.name else [])]
    for part in rows(dataset, names, chosen):
        postures = postures_of(dataset, robot, joints, part.values[joints.name])
        if not len(postures):
            continue
        if task is None:
            few = orientation is None and axis is None and robot.n < (3 if robot.planar else 6)
            whole = True if orientation is None and axis is None and not few else orientation
            task, axes = task_of_tool(robot, tip, whole, axis, postures[0])
            axes = np.eye(3) if few else axes
        z = tool_points(*robot.pose_batch(postures, tip), axes, length_scale)
        if poses is not None:
            told = tool_poses_of(dataset, poses, part.values[poses.name], part.frame)
            by_column = tool_points(*told, axes, length_scale)
            apart, z = max(apart, float(np.linalg.norm(by_column - z, axis=1).max())), by_column
        if not done:
            points = np.empty((begins[-1], z.shape[1]), np.float32)
        q[done : done + len(z)], points[done : done + len(z)] = postures, z
        done += len(z)
    if task is None:
        raise ArgumentError("episodes", episodes, "name at least one")
    notes = () if poses is None else (f"{poses.name} and the tool of the joints are up to {apart:.3g} m apart",)
    turns = 1 / length_scale if task.m < 3 + axes.shape[1] and axes.shape[1] == 3 and not robot.planar else 0.0
    q.flags.writeable = points.flags.writeable = False  # else a `Value` copies them
    pairs = _equal_poses(task, q, points, begins, near, tolerance, turns)
    return DatasetAudit(
        robot, dataset, task, joints.name, np.array(chosen), begins, q, points, pairs, near, tolerance, notes
    )  # fmt: skip


def _equal_poses(
    task: Task, q: Numbers, points: Numbers, begins: Whole, near: float, tolerance: float, turns: float
) -> EqualPoses:  # fmt: skip
    """The first visit of each cell of two grids, beside each other visit of it.

    turns: how far joints [rad] follow a turn of the tool by which a distance of poses [m] grows, where the task has no
    rows for it: an arm of few joints.
    """
    compared, found = np.zeros(len(q), bool), []
    for shift in (0.0, 0.5):
        for first, second in _visits(points, begins, near, shift):
            new = ~compared[second]
            first, second = first[new], second[new]
            compared[second] = True
            for i in range(0, len(first), BLOCK):
                a, b = first[i : i + BLOCK], second[i : i + BLOCK]
                turned = turns * np.linalg.norm(points[a, 3:] - points[b, 3:], axis=1)
                found.append(_compared(task, q, a, b, tolerance + SLOPE * turned))
    if not found:
        none = np.empty(0, np.intp)
        return EqualPoses(none, none, np.empty(0), np.empty(0), none)
    return EqualPoses(*(np.concatenate(column) for column in zip(*found, strict=True)))


def _cells(points: Numbers, near: float, shift: float) -> Whole:
    """A number for the cell of a grid in which each tool point lies (k,)."""
    key = np.zeros(len(points), np.uint64)
    for column, values in enumerate(points.T):
        width = near if column < 3 else 2 * near
        cell = np.floor(values / width + shift).astype(np.int64).view(np.uint64)
        key = (key ^ cell) * np.uint64(0x9E3779B97F4A7C15)
        key ^= key >> np.uint64(29)
    return key


def _visits(points: Numbers, begins: Whole, near: float, shift: float) -> Iterator[tuple[Whole, Whole]]:
    """(rows of first visits, rows of other visits of their cells), at most `near` apart, in blocks."""
    key = _cells(points, near, shift)
    order = np.argsort(key, kind="stable").astype(np.int32)
    key = key[order]
    new_cell = np.append(True, key[1:] != key[:-1])
    del key
    starts = np.zeros(len(points), bool)
    starts[begins[:-1]] = True
    new_visit = new_cell | np.append(True, np.diff(order) != 1) | starts[order]
    visit = np.append(np.flatnonzero(new_visit), len(order)).astype(np.int32)  # where each begins, and the end
    first_here = new_cell[visit[:-1]]
    other, cell = np.flatnonzero(~first_here).astype(np.int32), np.cumsum(first_here, dtype=np.int32)
    first_of = np.flatnonzero(first_here).astype(np.int32)
    del new_cell, new_visit, starts
    for i in range(0, len(other), BLOCK):
        part = other[i : i + BLOCK]
        first = first_of[cell[part] - 1]
        reference = order[(visit[first] + visit[first + 1] - 1) // 2]  # the frame in the middle stands for the visit
        second = _nearest_frames(points, order, visit[part], visit[part + 1], reference)
        close = np.linalg.norm(points[second] - points[reference], axis=1) <= near
        first, second = reference[close], second[close]
        apart = _was_away(points, begins, first, second, AWAY * near)
        yield first[apart], second[apart]


def _nearest_frames(points: Numbers, order: Whole, begin: Whole, end: Whole, reference: Whole) -> Whole:
    """Of each visit, rows order[begin:end], the one whose pose is nearest to that of its reference."""
    length = np.minimum(end - begin, LOOKS)  # of a long rest some frames say it all
    best, least = order[begin], np.full(len(begin), np.inf)
    for k in range(int(length.max())):
        at = order[begin + np.minimum(k * (end - begin) // length, end - begin - 1)]
        gap = np.linalg.norm(points[at] - points[reference], axis=1)
        best, least = np.where(gap < least, at, best), np.minimum(gap, least)
    return best


def _was_away(points: Numbers, begins: Whole, first: Whole, second: Whole, far: float) -> Flags:
    """Whether two rows are of different episodes, or the tool was far from both of them in between."""
    of = [np.searchsorted(begins, rows, side="right") for rows in (first, second)]
    away = of[0] != of[1]
    low, high = np.minimum(first, second), np.maximum(first, second)
    for k in range(1, LOOKS + 1):
        between = low + (high - low).astype(np.int64) * k // (LOOKS + 1)
        away |= np.linalg.norm(points[between] - points[first], axis=1) > far
    return away


def _compared(
    task: Task, q: Numbers, first: Whole, second: Whole, tolerance: Vector
) -> tuple[Whole, Whole, Vector, Vector, Whole]:  # fmt: skip
    """The columns of `EqualPoses` for some pairs."""
    here, there = q[first].astype(float), q[second].astype(float)
    met, moved = to_pose(task, there, *task.poses(here))
    gap = np.abs(met - here)
    joint = np.argmax(gap, axis=1)
    return first, second, gap[np.arange(len(gap)), joint], tolerance + SLOPE * moved, joint
