"""Does a robot learning dataset have one posture for each tool pose? Equal poses over all of its episodes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.types import ArrayLike, Flags, Indices, Matrix, NoTruthValue, Value, Vector
from ...robot import Robot
from ...strategies.tasks.task import Task
from ...strategies.tasks.task_kinds import Axis
from .arcs import WHOLE, ToolMotion, tool_points
from .cycles import LENGTH_SCALE
from .log_audit import task_of_tool
from .logs import Dataset
from .logs.datasets import JointFeature, PoseFeature, check_normalized, postures_of, rows, tool_poses_of
from .logs.log_formats import HingeTurns, hinge_turns, less_turns, turns_notes
from .questions import LogVerdict, to_pose

# --- What the audit of a dataset found: pairs of equal tool poses, and words that say how sure they are.

Numbers = NDArray[np.floating[Any]]
"""Joints and tool points in single precision, which takes half the memory."""

PAIRS_BLOCK = 50_000
"""Pairs that are looked at in one go: a megabyte."""

Whole = NDArray[np.integer[Any]]
"""Rows, cells and joints; 32 bits take half the memory."""

MOST_ROWS = 8
"""Episodes that are named, the worst first; `to_dict` has all."""


@dataclass(frozen=True, eq=False)
class ToolColumn(Value):
    """Tool points z (k, d) that were read, as `tool_points` makes them."""

    z: Numbers

    def at(self, rows: Whole) -> Numbers:
        """Those of some rows."""
        return self.z[rows]


@dataclass(frozen=True, eq=False)
class EqualPoses(Value):
    """Pairs of frames with equal tool poses: `first` and `second` (p,) are rows of the frames that were looked at;
    distance (p,) of the joints of the second, moved to the pose of the first, from those of the first; allowed (p,):
    up to which they are equal; joint (p,): the one that is farthest; unknown (p,): a joint that may be whole turns
    farther apart, which the dataset does not show, or -1."""

    first: Whole
    second: Whole
    distance: Vector
    allowed: Vector
    joint: Whole
    unknown: Whole

    @property
    def beyond(self) -> Flags:
        """Pairs whose joints differ (p,)."""
        return self.distance > self.allowed


@dataclass(frozen=True, eq=False)
class DatasetAudit(NoTruthValue, Value, ask="`.verdict`"):
    """Findings of `audit_dataset`; `str` prints them, `to_dict` gives them as plain data.

    episodes (e,): those that were looked at; begins (e + 1,): where each begins among the rows of `q` (k, n), joints
    [rad or m] in single precision as they are stored; tool: `tool.at(rows)` are their tool poses, as `tool_points`;
    pairs: equal poses.
    """

    robot: Robot
    dataset: Dataset
    task: Task
    feature: str
    episodes: Indices
    begins: Indices
    q: Numbers
    tool: ToolMotion | ToolColumn
    pairs: EqualPoses
    near: float
    tolerance: float
    notes: tuple[str, ...] = ()

    @property
    def decided(self) -> Flags:
        """Pairs so near that a difference of twice the tolerance would show (p,)."""
        return self.pairs.allowed <= 2 * self.tolerance

    @property
    def verdict(self) -> LogVerdict:
        """Whether equal tool poses have equal joints."""
        if self.pairs.beyond.any():
            return LogVerdict.DIFFERS
        sure = self.decided.any() and self.open_turn is None
        return LogVerdict.REPEATS if sure else LogVerdict.UNDECIDED

    @property
    def open_turn(self) -> int | None:
        """The first decided pair in which a joint may be whole turns farther apart; None where there is none."""
        found = np.flatnonzero(self.decided & (self.pairs.unknown >= 0))
        return int(found[0]) if len(found) else None

    @property
    def exit_code(self) -> int:
        """0: equal joints in all that the dataset tests; 1: not; 2: it does not show it."""
        return self.verdict.exit_code

    def frame(self, row: int) -> tuple[int, int]:
        """(episode, frame in it) of a row."""
        at = int(np.searchsorted(self.begins, row, side="right")) - 1
        return int(self.episodes[at]), int(row - self.begins[at])

    def worst(self) -> int | None:
        """The pair that is farthest over what is allowed, or else farthest apart; None where there is none."""
        pairs = self.pairs
        if not len(pairs.first):
            return None
        if not pairs.beyond.any():
            return int(np.argmax(pairs.distance))
        return int(np.argmax(pairs.distance - pairs.allowed))

    def by_episode(self) -> list[dict[str, Any]]:
        """Of each episode with equal poses: how many, how many differ, and the worst, with its frames and place."""
        count, differ, worst = _of_episodes(self)
        return [
            {
                "episode": int(self.episodes[at]), "equal poses": int(count[at]), "differ": int(differ[at]),
                "worst": self.place(int(worst[at])),
            }
            for at in np.flatnonzero(count)
        ]  # fmt: skip

    def place(self, pair: int) -> dict[str, Any]:
        """A pair as plain data: its frames, where the tool is, and how far the joints are apart."""
        pairs = self.pairs
        (e, i), (f, j) = self.frame(int(pairs.first[pair])), self.frame(int(pairs.second[pair]))
        xyz = self.tool.at(pairs.first[pair : pair + 1])[0, :3].astype(np.float32).tolist()
        return {
            "first": {"episode": e, "frame": i}, "second": {"episode": f, "frame": j}, "tool": xyz,
            "joint": self.robot.joint_names[pairs.joint[pair]], "distance": float(pairs.distance[pair]),
            "allowed": float(pairs.allowed[pair]),
        }  # fmt: skip

    def sentence(self) -> str:
        """The verdict, what it rests on, and what the dataset does not test."""
        pairs, worst = self.pairs, self.worst()
        if worst is None:
            return (
                f"cannot tell: in {len(self.q)} frames no tool pose comes again within {1e3 * self.near:g} mm; "
                "a greater --near compares poses that are farther apart"
            )
        tests = f"{len(pairs.first)} pairs of equal tool poses"
        if self.verdict is LogVerdict.DIFFERS:
            count = int(pairs.beyond.sum())
            return f"differs: at {count} of {tests} the joints are not equal. Worst: {_place_words(self, worst)}"
        if self.verdict is LogVerdict.REPEATS:
            return (
                f"repeats: the joints are equal at all {int(self.decided.sum())} equal tool poses that are near enough "
                f"to tell (of {tests}); poses that come only once say nothing"
            )
        if self.open_turn is not None:
            return f"cannot tell: at {tests} {_turn_words(self, self.open_turn)}"
        least = float(pairs.allowed.min())
        return (
            f"cannot tell: of {tests} none is so near that a difference of {2 * self.tolerance:g} rad or m shows; the "
            f"nearest shows {least:.2g}. Give a greater --tolerance, or record poses that come again"
        )

    def rows(self) -> list[tuple[str, str]]:
        """(what, finding) of every question, for people."""
        pairs = self.pairs
        found = [
            ("equal poses, equal joints", self.verdict.value.partition(":")[0]),
            ("dataset", f"{self.dataset.folder}, format {self.dataset.version}"),
            ("looked at", f"{len(self.q)} frames of {len(self.episodes)} episodes, column {self.feature}"),
            ("task", self.task.name),
            ("equal", f"tool poses within {1e3 * self.near:g} mm, joints within {self.tolerance:g} rad or m"),
            ("pairs of equal poses", f"{len(pairs.first)}, {int(self.decided.sum())} of them near enough to decide"),
            ("of them the joints differ", str(int(pairs.beyond.sum()))),
        ]
        if len(pairs.first):
            median, most = (_size(float(v)) for v in (np.median(pairs.distance), pairs.distance.max()))
            found.append(("distance of the joints", f"median {median}, largest {most} rad or m"))
        episodes = sorted(self.by_episode(), key=lambda e: e["worst"]["allowed"] - e["worst"]["distance"])
        differ = [e for e in episodes if e["differ"]]
        if differ:
            found.append(("episodes that differ", f"{len(differ)} of {len(self.episodes)}"))
        for e in differ[:MOST_ROWS]:
            w = e["worst"]
            other = next(w[k] for k in ("second", "first") if w[k]["episode"] != e["episode"] or k == "first")
            at = f"{w['distance']:.3g} ({w['joint']}) from frame {other['frame']} of episode {other['episode']}"
            said = f"{e['differ']} of {e['equal poses']} equal poses differ, by up to {at}"
            found.append((f"episode {e['episode']}", said))
        return found + [("note", note) for note in self.notes]

    def to_dict(self) -> dict[str, Any]:
        """All findings as plain data."""
        worst, pairs = self.worst(), self.pairs
        return {
            "dataset": str(self.dataset.folder), "format": self.dataset.version, "robot": self.robot.name,
            "task": self.task.name, "column": self.feature, "verdict": self.verdict.name, "sentence": self.sentence(),
            "frames": len(self.q), "episodes": len(self.episodes), "equal poses": len(pairs.first),
            "of them decided": int(self.decided.sum()), "of them differ": int(pairs.beyond.sum()),
            "near": self.near, "tolerance": self.tolerance, "worst": None if worst is None else self.place(worst),
            "by episode": self.by_episode(), "notes": list(self.notes),
        }  # fmt: skip

    def __str__(self) -> str:
        return "\n".join([*(f"{what}: {found}" for what, found in self.rows()), self.sentence()])


def _of_episodes(audit: DatasetAudit) -> tuple[Indices, Indices, Indices]:
    """Of each episode (e,): its pairs, those of them that differ, and the one that is farthest over what is allowed."""
    pairs, size = audit.pairs, len(audit.episodes)
    count, differ, worst = (np.zeros(size, np.intp) for _ in range(3))
    most = np.full(size, -np.inf)

    def block(i: int) -> tuple[list[Indices], Vector]:
        rows = [column[i : i + PAIRS_BLOCK] for column in (pairs.first, pairs.second)]
        over = pairs.distance[i : i + PAIRS_BLOCK] - pairs.allowed[i : i + PAIRS_BLOCK]
        return [np.searchsorted(audit.begins, part, side="right") - 1 for part in rows], over

    starts = range(0, len(pairs.first), PAIRS_BLOCK)
    for i in starts:
        of, over = block(i)
        for mine, counts in zip(of, (np.ones(len(over), bool), of[0] != of[1]), strict=True):
            np.add.at(count, mine[counts], 1)
            np.add.at(differ, mine[counts & (over > 0)], 1)
            np.maximum.at(most, mine, over)
    for which in (1, 0):  # of equal ones the first counts, which is written last
        for i in reversed(starts):
            of, over = block(i)
            best = np.flatnonzero(over == most[of[which]])[::-1]
            worst[of[which][best]] = i + best
    return count, differ, worst


def _place_words(audit: DatasetAudit, pair: int) -> str:
    """A pair of frames, where the tool is, and how far which joint is apart."""
    p = audit.place(pair)
    (e, i), (f, j) = [(p[which]["episode"], p[which]["frame"]) for which in ("first", "second")]
    x, y, z = p["tool"]
    return (
        f"{p['distance']:.3g} ({p['joint']}) between frame {i} of episode {e} and frame {j} of episode {f}, tool at "
        f"({x:.3f}, {y:.3f}, {z:.3f}) m"
    )


def _turn_words(audit: DatasetAudit, pair: int) -> str:
    """Where a joint may be a whole turn apart, and what would tell."""
    p, joint = audit.place(pair), audit.robot.joint_names[audit.pairs.unknown[pair]]
    (e, i), (f, j) = [(p[which]["episode"], p[which]["frame"]) for which in ("first", "second")]
    return (
        f"the joints are equal but for whole turns, which the dataset does not show: {joint} may be a turn farther in "
        f"frame {j} of episode {f} than in frame {i} of episode {e}, within its limits. Say --counts-turns "
        "(counts_turns=True) if the values of the joints count whole turns"
    )


def _size(distance: float) -> str:
    """A distance of joints; what single precision rounds is not shown."""
    return f"{distance:.3g}" if distance > 1e-6 else "under 1e-6"


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

FRAMES_BLOCK = 4_000
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
    axis: Axis | ArrayLike | None = None,
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
    for part in rows(dataset, names, chosen, size=FRAMES_BLOCK):
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
    for i in range(0, len(key), FRAMES_BLOCK):
        key[i : i + FRAMES_BLOCK] += more[moved[i : i + FRAMES_BLOCK]]


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
    for i in range(0, len(other), FRAMES_BLOCK):
        part = other[i : i + FRAMES_BLOCK]
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
    met, moved = to_pose(task, there, *task._poses(here))
    gap = np.abs(less_turns(met - here, less))
    joint = np.argmax(gap, axis=1)
    return gap[np.arange(len(gap)), joint], moved, joint
