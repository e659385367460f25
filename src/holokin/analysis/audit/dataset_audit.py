"""Does a robot learning dataset have one posture for each tool pose? Equal poses over all of its episodes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import cast

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.types import ArrayLike, Flags, Matrix, Vector
from ...robot import Robot
from ...strategies.tasks.task import Task
from .arcs import WHOLE, ToolMotion, tool_points
from .cycles import LENGTH_SCALE
from .dataset_findings import DatasetAudit, EqualPoses, Numbers, ToolColumn, Whole
from .equal_poses import to_pose
from .log_audit import task_of_tool
from .logs.dataset_columns import JointFeature, PoseFeature, check_normalized, postures_of, tool_poses_of
from .logs.dataset_folder import Dataset, rows
from .logs.logged_turns import HingeTurns, hinge_turns, less_turns, turns_notes

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

MIX = np.array([pow(0x9E3779B97F4A7C15, column + 1, 2**64) for column in range(12)], np.uint64)
"""What the coordinates of a cell are multiplied by: their sum is the cell's number, the same for two cells by chance
once in 2^64."""

PARTS = 16
"""Parts of the cells that are searched one after the other, each with a sixteenth of the frames."""

BLOCK = 4_000
"""Frames whose tool poses are in memory at one time: two megabytes."""

PAIRS = 1_000
"""Frames whose Jacobians are in memory at one time: two megabytes."""


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
    count = int(begins[-1])
    q, told = np.empty((count, robot.n), np.float32), np.empty((0, 0), np.float32)
    key, moved = np.empty(count, np.uint64), np.empty(count, np.uint16)
    task: Task | None = None
    done, apart, axes = 0, 0.0, WHOLE
    names = [joints.name, *([poses.name] if poses is not None and poses.name != joints.name else [])]
    for part in rows(dataset, names, chosen, size=BLOCK):
        postures = postures_of(dataset, robot, joints, part.values[joints.name])
        if not len(postures):
            continue
        if task is None:
            few = orientation is None and axis is None and robot.n < (3 if robot.planar else 6)
            whole = True if orientation is None and axis is None and not few else orientation
            task, axes = task_of_tool(robot, tip, whole, axis, postures[0])
            axes = WHOLE if few else axes
        here = slice(done, done + len(postures))
        q[here], done = postures, here.stop
        z = tool_points(*robot.pose_batch(q[here].astype(float), tip), axes, length_scale)
        if poses is not None:
            found = tool_poses_of(dataset, poses, part.values[poses.name], part.frame)
            by_column = tool_points(*found, axes, length_scale)
            apart, z = max(apart, float(np.linalg.norm(by_column - z, axis=1).max())), by_column
            told = told if told.size else np.empty((count, z.shape[1]), np.float32)
            told[here] = z
        key[here], moved[here] = _cells(z.astype(np.float32), near)
    if task is None:
        raise ArgumentError("episodes", episodes, "name at least one")
    check_normalized(dataset, robot, joints, q.min(axis=0).astype(float), q.max(axis=0).astype(float))
    turns, notes = ({}, []) if joints.counts_turns else _join_turns(q, begins, dataset.period, robot)
    notes += [] if poses is None else [f"{poses.name} and the tool of the joints are up to {apart:.3g} m apart"]
    turned = 1 / length_scale if task.m < 3 + axes.shape[1] and axes.shape[1] == 3 and not robot.planar else 0.0
    q.flags.writeable = told.flags.writeable = False  # else a `Value` copies them
    tool = ToolMotion(robot, cast("Matrix", q), tip, axes, length_scale) if poses is None else ToolColumn(told)
    pairs = _pairs(tool, key, moved, begins, near)
    del key, moved
    pairs = _equal_poses(task, q, tool, *pairs, tolerance, turned, turns)
    return DatasetAudit(
        robot, dataset, task, joints.name, np.array(chosen), begins, q, tool, pairs, near, tolerance, tuple(notes)
    )  # fmt: skip


def _join_turns(q: Numbers, begins: Whole, period: float, robot: Robot) -> tuple[dict[int, HingeTurns], list[str]]:
    """(hinges whose turns are not all known, or do not count; notes); q (k, n) runs on within episodes, in place."""
    steps = np.full(len(q) - 1, period, np.float32)
    steps[begins[1:-1] - 1] = np.inf
    limited = np.isfinite(robot.lower) | np.isfinite(robot.upper)
    unknown: dict[int, HingeTurns] = {}
    done: dict[bool, list[str]] = {True: [], False: []}
    for i in np.flatnonzero(robot.hinges).tolist():
        one = hinge_turns(q[:, i], steps, robot, i)
        if one.turns is not None:
            q[:, i] += one.turns
            done[one.cut].append(robot.joint_names[i])
        if not (limited[i] and one.known.all()):
            unknown[i] = replace(one, turns=None)  # which takes memory
    return unknown, turns_notes(done[True], done[False], "dataset")


def _equal_poses(
    task: Task, q: Numbers, tool: ToolMotion | ToolColumn, first: Whole, second: Whole, tolerance: float,
    turned: float, turns: dict[int, HingeTurns],
) -> EqualPoses:  # fmt: skip
    """The joints of pairs of rows.

    turned: how far joints [rad] follow a turn of the tool by which a distance of poses [m] grows, where the task has no
    rows for it: an arm of few joints.
    """
    distance, allowed, joint = np.empty(len(first)), np.full(len(first), tolerance), np.empty(len(first), np.int16)
    none = np.broadcast_to(np.int16(-1), len(first))  # which takes no memory
    unknown = none.copy() if turns else none
    limited = np.isfinite(task.robot.lower) | np.isfinite(task.robot.upper)
    for i in range(0, len(first), PAIRS):
        here = slice(i, i + PAIRS)
        a, b = first[here], second[here]
        if turned:
            angle = np.linalg.norm(_points(tool, a)[:, 3:] - _points(tool, b)[:, 3:], axis=1)
            allowed[here] += SLOPE * (turned * angle)
        less = np.zeros((len(a), task.n), bool)
        for j, one in turns.items():
            less[:, j] = one.apart(a, b) if limited[j] else one.runs_apart(a, b)
        if turns:
            unknown[here] = np.where((less & limited).any(axis=1), np.argmax(less & limited, axis=1), -1)
        distance[here], moved, joint[here] = _compared(task, q, a, b, less)
        allowed[here] += SLOPE * moved
    columns = (first, second, distance, allowed, joint, unknown)
    for column in columns:
        column.flags.writeable = False  # else a `Value` copies them
    return EqualPoses(*columns)


def _pairs(
    tool: ToolMotion | ToolColumn, key: Whole, moved: Whole, begins: Whole, near: float
) -> tuple[Whole, Whole]:  # fmt: skip
    """(rows of first visits, rows of other visits of their poses), of both grids; a row is in the second only once."""
    compared, count = np.zeros(len(key), bool), 0
    found = np.empty((2, len(key)), np.int32)
    for grid in range(2):
        if grid:
            _move(key, moved)
        for first, second in _visits(tool, key, begins, near):
            new = ~compared[second]
            compared[second] = True
            here = slice(count, count + np.count_nonzero(new))
            found[:, here], count = (first[new], second[new]), here.stop
    return found[0, :count].copy(), found[1, :count].copy()


def _cells(points: Numbers, near: float) -> tuple[Whole, Whole]:
    """A number for the cell of a grid in which each tool point lies (k,), and a bit for each side on which it is nearer
    to the next cell (k,)."""
    key, moved = np.zeros(len(points), np.uint64), np.zeros(len(points), np.uint16)
    for column, values in enumerate(points.T):
        place = values / (near if column < 3 else 2 * near)
        cell = np.floor(place).astype(np.int64)
        key += cell.view(np.uint64) * MIX[column]
        moved |= (np.floor(place + 0.5).astype(np.int64) - cell).astype(np.uint16) << np.uint16(column)
    return key, moved


def _move(key: Whole, moved: Whole) -> None:
    """From the numbers of cells to those of the grid that lies half a cell aside, in place."""
    bits = np.arange(2 ** len(MIX))[:, None] >> np.arange(len(MIX)) & 1
    more = (bits.astype(np.uint64) * MIX).sum(axis=1, dtype=np.uint64)
    for i in range(0, len(key), BLOCK):
        key[i : i + BLOCK] += more[moved[i : i + BLOCK]]


def _visits(
    tool: ToolMotion | ToolColumn, key: Whole, begins: Whole, near: float
) -> Iterator[tuple[Whole, Whole]]:  # fmt: skip
    """(rows of first visits, rows of other visits of their cells), at most `near` apart, in blocks."""
    width = 2**64 // PARTS
    starts = np.zeros(len(key), bool)
    starts[begins[:-1]] = True
    for low in range(0, 2**64, width):
        rows = np.flatnonzero((key >= np.uint64(low)) & (key <= np.uint64(low + width - 1))).astype(np.int32)
        if len(rows):
            yield from _visits_of(tool, rows, key[rows], starts, begins, near)


def _visits_of(
    tool: ToolMotion | ToolColumn, rows: Whole, key: Whole, starts: Flags, begins: Whole, near: float
) -> Iterator[tuple[Whole, Whole]]:  # fmt: skip
    """The same of some cells: all their rows, with their keys; starts: rows with which episodes begin."""
    by_cell = np.argsort(key, kind="stable")
    order, key = rows[by_cell], key[by_cell]
    new_cell = np.append(True, key[1:] != key[:-1])
    new_visit = new_cell | np.append(True, np.diff(order) != 1) | starts[order]
    visit = np.append(np.flatnonzero(new_visit), len(order))  # where each begins, and the end
    first_here = new_cell[visit[:-1]]
    other, cell, first_of = np.flatnonzero(~first_here), np.cumsum(first_here), np.flatnonzero(first_here)
    for i in range(0, len(other), BLOCK):
        part = other[i : i + BLOCK]
        first = first_of[cell[part] - 1]
        first = order[(visit[first] + visit[first + 1] - 1) // 2]  # the frame in the middle stands for the visit
        points = _points(tool, first)
        second, gap = _nearest_frames(tool, order, visit[part], visit[part + 1], points)
        close = gap <= near
        first, second, points = first[close], second[close], points[close]
        apart = _was_away(tool, begins, first, second, points, AWAY * near)
        yield first[apart], second[apart]


def _points(tool: ToolMotion | ToolColumn, rows: Whole) -> Numbers:
    """Tool points of some rows, in single precision; those of equal rows that follow each other are computed once."""
    new = np.ones(len(rows), bool)
    new[1:] = rows[1:] != rows[:-1]
    return tool.at(rows[new]).astype(np.float32)[np.cumsum(new) - 1]


def _nearest_frames(
    tool: ToolMotion | ToolColumn, order: Whole, begin: Whole, end: Whole, reference: Numbers
) -> tuple[Whole, Numbers]:  # fmt: skip
    """Of each visit, rows order[begin:end], the one whose pose is nearest to a tool point, and how near."""
    length = np.minimum(end - begin, LOOKS)  # of a long rest some frames say it all
    best, least = order[begin], np.full(len(begin), np.inf, np.float32)
    for k in range(int(length.max())):
        mine = np.flatnonzero(length > k)
        at = order[begin[mine] + k * (end - begin)[mine] // length[mine]]
        gap = np.linalg.norm(_points(tool, at) - reference[mine], axis=1)
        nearer = gap < least[mine]
        best[mine[nearer]], least[mine[nearer]] = at[nearer], gap[nearer]
    return best, least


def _was_away(
    tool: ToolMotion | ToolColumn, begins: Whole, first: Whole, second: Whole, points: Numbers, far: float
) -> Flags:  # fmt: skip
    """Whether two rows are of different episodes, or the tool was far from the first, at `points`, in between."""
    of = [np.searchsorted(begins, rows, side="right") for rows in (first, second)]
    away = of[0] != of[1]
    low, high = np.minimum(first, second).astype(np.int64), np.maximum(first, second)
    for k in range(1, LOOKS + 1):
        asked = np.flatnonzero(~away)
        between = (low + (high - low) * k // (LOOKS + 1))[asked]
        away[asked] = np.linalg.norm(_points(tool, between) - points[asked], axis=1) > far
    return away


def _compared(task: Task, q: Numbers, first: Whole, second: Whole, less: Flags) -> tuple[Vector, Vector, Whole]:
    """Of some pairs the largest joint distance, how far joints were moved to one pose, and which joint it is.

    less: joints (p, n) whose whole turns do not count.
    """
    here, there = q[first].astype(float), q[second].astype(float)
    met, moved = to_pose(task, there, *task.poses(here))
    gap = np.abs(less_turns(met - here, less))
    joint = np.argmax(gap, axis=1)
    return gap[np.arange(len(gap)), joint], moved, joint
