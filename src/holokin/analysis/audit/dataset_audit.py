"""Does a robot learning dataset have one posture for each tool pose? Equal poses over all of its episodes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.types import ArrayLike, Flags, Indices, Matrix, NoTruthValue, Value, Vector, positive
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

Numbers = NDArray[np.floating[Any]]  # joints and tool points in single precision, which takes half the memory
PAIRS_BLOCK = 50_000  # pairs that are looked at in one go: a megabyte
Whole = NDArray[np.integer[Any]]  # rows, cells and joints; 32 bits take half the memory
MOST_ROWS = 8  # episodes that are named, the worst first; `to_dict` has all


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

    def __str__(self) -> str:
        return f"the joints differ at {int(self.beyond.sum())} of {len(self.first)} pairs of equal tool poses"


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
        unknown = np.flatnonzero(self.decided & (self.pairs.unknown >= 0))
        return int(unknown[0]) if len(unknown) else None

    @property
    def exit_code(self) -> int:
        """0: equal joints in all that the dataset tests; 1: not; 2: it does not show it."""
        return self.verdict.exit_code

    def frame(self, row: int) -> tuple[int, int]:
        """(episode, frame in it) of a row."""
        i = int(np.searchsorted(self.begins, row, side="right")) - 1
        return int(self.episodes[i]), int(row - self.begins[i])

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
        keys, columns = ("episode", "equal poses", "differ"), (self.episodes, *_of_episodes(self))
        rows = (tuple(int(column[i]) for column in columns) for i in np.flatnonzero(columns[1]))
        return [dict(zip(keys, row, strict=False)) | {"worst": self.place(row[-1])} for row in rows]

    def place(self, pair: int) -> dict[str, Any]:
        """A pair as plain data: its frames, where the tool is, and how far the joints are apart."""
        pairs, row = self.pairs, slice(pair, pair + 1)
        ends = {"first": self.frame(int(pairs.first[pair])), "second": self.frame(int(pairs.second[pair]))}
        frames: dict[str, Any] = {end: {"episode": episode, "frame": i} for end, (episode, i) in ends.items()}
        tool = self.tool.at(pairs.first[row])[0, :3].astype(np.float32).tolist()
        sizes = {"distance": float(pairs.distance[pair]), "allowed": float(pairs.allowed[pair])}
        return frames | {"tool": tool, "joint": self.robot.joint_names[pairs.joint[pair]]} | sizes

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
        shows = f"a difference of {2 * self.tolerance:g} rad or m shows; the nearest shows {pairs.allowed.min():.2g}"
        cure = "Give a greater --tolerance, or record poses that come again"
        return f"cannot tell: of {tests} none is so near that {shows}. {cure}"

    def rows(self) -> list[tuple[str, str]]:
        """(what, finding) of every question, for people."""
        pairs = self.pairs
        rows = [
            ("equal poses, equal joints", self.verdict.value.partition(":")[0]),
            ("dataset", f"{self.dataset.folder}, format {self.dataset.version}"),
            ("looked at", f"{len(self.q)} frames of {len(self.episodes)} episodes, column {self.feature}"),
            ("task", self.task.name),
            ("equal", f"tool poses within {1e3 * self.near:g} mm, joints within {self.tolerance:g} rad or m"),
            ("pairs of equal poses", f"{len(pairs.first)}, {int(self.decided.sum())} of them near enough to decide"),
            ("of them the joints differ", str(int(pairs.beyond.sum()))),
        ]
        if len(pairs.first):
            # What single precision rounds is not shown.
            sizes = (float(np.median(pairs.distance)), float(pairs.distance.max()))
            median, most = (f"{size:.3g}" if size > 1e-6 else "under 1e-6" for size in sizes)
            rows.append(("distance of the joints", f"median {median}, largest {most} rad or m"))
        episodes = sorted(self.by_episode(), key=lambda e: e["worst"]["allowed"] - e["worst"]["distance"])
        differ = [e for e in episodes if e["differ"]]
        if differ:
            rows.append(("episodes that differ", f"{len(differ)} of {len(self.episodes)}"))
        for e in differ[:MOST_ROWS]:
            w = e["worst"]
            other = next(w[k] for k in ("second", "first") if w[k]["episode"] != e["episode"] or k == "first")
            place = f"{w['distance']:.3g} ({w['joint']}) from frame {other['frame']} of episode {other['episode']}"
            summary = f"{e['differ']} of {e['equal poses']} equal poses differ, by up to {place}"
            rows.append((f"episode {e['episode']}", summary))
        return rows + [("note", note) for note in self.notes]

    def to_dict(self) -> dict[str, Any]:
        """All findings as plain data."""
        worst, pairs = self.worst(), self.pairs
        return {
            "dataset": str(self.dataset.folder),
            "format": self.dataset.version,
            "robot": self.robot.name,
            "task": self.task.name,
            "column": self.feature,
            "verdict": self.verdict.name,
            "sentence": self.sentence(),
            "frames": len(self.q),
            "episodes": len(self.episodes),
            "equal poses": len(pairs.first),
            "of them decided": int(self.decided.sum()),
            "of them differ": int(pairs.beyond.sum()),
            "near": self.near,
            "tolerance": self.tolerance,
            "worst": None if worst is None else self.place(worst),
            "by episode": self.by_episode(),
            "notes": list(self.notes),
        }

    def __str__(self) -> str:
        return "\n".join([self.sentence(), *(f"  {what}: {finding}" for what, finding in self.rows())])


def _of_episodes(audit: DatasetAudit) -> tuple[Indices, Indices, Indices]:
    """Of each episode (e,): its pairs, those of them that differ, and the one that is farthest over what is allowed."""
    pairs, size = audit.pairs, len(audit.episodes)
    count, differ, worst = (np.zeros(size, np.intp) for _ in range(3))
    most = np.full(size, -np.inf)
    for i in range(0, len(pairs.first), PAIRS_BLOCK):
        block = slice(i, i + PAIRS_BLOCK)
        over = pairs.distance[block] - pairs.allowed[block]
        ends = [np.searchsorted(audit.begins, rows[block], side="right") - 1 for rows in (pairs.first, pairs.second)]
        for episode, counts in zip(ends, (np.ones(len(over), bool), ends[0] != ends[1]), strict=True):
            np.add.at(count, episode[counts], 1)
            np.add.at(differ, episode[counts & (over > 0)], 1)
            # The worst pair of each episode, of equal ones the first.
            order = np.lexsort((-np.arange(len(over)), over))
            best = np.full(size, -1)
            best[episode[order]] = order
            better = np.flatnonzero((best >= 0) & (over[best] > most))
            most[better], worst[better] = over[best[better]], i + best[better]
    return count, differ, worst


def _place_words(audit: DatasetAudit, pair: int) -> str:
    """A pair of frames, where the tool is, and how far which joint is apart."""
    p, (x, y, z) = audit.place(pair), audit.place(pair)["tool"]
    frames = [f"frame {p[end]['frame']} of episode {p[end]['episode']}" for end in ("first", "second")]
    tool = f"tool at ({x:.3f}, {y:.3f}, {z:.3f}) m"
    return f"{p['distance']:.3g} ({p['joint']}) between {' and '.join(frames)}, {tool}"


def _turn_words(audit: DatasetAudit, pair: int) -> str:
    """Where a joint may be a whole turn apart, and what would tell."""
    pairs, joint = audit.pairs, audit.robot.joint_names[audit.pairs.unknown[pair]]
    (e, i), (f, j) = audit.frame(int(pairs.first[pair])), audit.frame(int(pairs.second[pair]))
    return (
        f"the joints are equal but for whole turns, which the dataset does not show: {joint} may be a turn farther in "
        f"frame {j} of episode {f} than in frame {i} of episode {e}, within its limits. Say --counts-turns "
        "(counts_turns=True) if the values of the joints count whole turns"
    )


NEAR = 5e-3  # distance [m] of two tool poses up to which they are compared

# Joint distance [rad or m] that counts as equal: half a degree, below which hobby servos do not stand still.
TOLERANCE = 1e-2

# How far spare joints may move beside those that follow the tool from one pose to the next, times as far. Of 780,000
# frames of a Panda with a locked joint 6,000 pairs of near poses took up to 3.3, of 97,000 frames with its arm angle
# kept 2.4; near a posture where the leaf ends it has no bound.
SLOPE = 5.0

AWAY = 4.0  # within an episode a pose counts as visited again only if the tool was so many times `near` away in between
LOOKS = 8  # frames between two visits that are looked at for that

# What the coordinates of a cell are multiplied by: their sum is the cell's number, the same for two cells by chance
# once in 2^64.
MIX = np.array([pow(0x9E3779B97F4A7C15, column + 1, 2**64) for column in range(12)], np.uint64)

PARTS = 16  # parts of the cells that are searched one after the other, each with a sixteenth of the frames
FRAMES_BLOCK = 4_000  # frames whose tool poses are in memory at one time: two megabytes
PAIRS = 1_000  # frames whose Jacobians are in memory at one time: two megabytes


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
        FileError: a dataset that cannot be read. ArgumentError: a bad argument. UnknownNameError: no such tip.
    """
    for what, value in (("near", near), ("tolerance", tolerance), ("length_scale", length_scale)):
        positive(what, value)
    chosen = list(range(len(dataset.episodes))) if episodes is None else episodes
    begins = np.cumsum([0, *(dataset.episodes[i].length for i in chosen)])
    count = int(begins[-1])
    q, by_poses = np.empty((count, robot.n), np.float32), np.empty((0, 0), np.float32)
    key, moved = np.empty(count, np.uint64), np.empty(count, np.uint16)
    # Block by block: the joints, the tool points and the cells of a grid in which these lie.
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
        frames = slice(done, done + len(postures))
        q[frames], done = postures, frames.stop
        z = tool_points(*robot.pose_batch(q[frames].astype(float), tip), axes, length_scale)
        if poses is not None:
            tool_poses = tool_poses_of(dataset, poses, part.values[poses.name], part.frame)
            by_column = tool_points(*tool_poses, axes, length_scale)
            apart, z = max(apart, float(np.linalg.norm(by_column - z, axis=1).max())), by_column
            by_poses = by_poses if by_poses.size else np.empty((count, z.shape[1]), np.float32)
            by_poses[frames] = z
        key[frames], moved[frames] = _cells(z.astype(np.float32), near)
    if task is None:
        raise ArgumentError("episodes", episodes, "name at least one")
    # Whole turns of hinges; then the pairs of frames in one cell, and how far their joints are apart.
    check_normalized(dataset, robot, joints, q.min(axis=0).astype(float), q.max(axis=0).astype(float))
    turns, notes = ({}, []) if joints.counts_turns else _join_turns(q, begins, dataset.period, robot)
    notes += [] if poses is None else [f"{poses.name} and the tool of the joints are up to {apart:.3g} m apart"]
    turned = 1 / length_scale if task.m < 3 + axes.shape[1] and axes.shape[1] == 3 and not robot.planar else 0.0
    q.flags.writeable = by_poses.flags.writeable = False  # else a `Value` copies them
    tool = ToolMotion(robot, cast("Matrix", q), tip, axes, length_scale) if poses is None else ToolColumn(by_poses)
    pairs = _pairs(tool, key, moved, begins, near)
    del key, moved
    pairs = _equal_poses(task, q, tool, pairs, tolerance, turned, turns)
    return DatasetAudit(
        robot, dataset, task, joints.name, np.array(chosen), begins, q, tool, pairs, near, tolerance, tuple(notes)
    )


def _join_turns(q: Numbers, begins: Whole, period: float, robot: Robot) -> tuple[dict[int, HingeTurns], list[str]]:
    """(hinges whose turns are not all known, or do not count; notes); q (k, n) runs on within episodes, in place."""
    steps = np.full(len(q) - 1, period, np.float32)
    steps[begins[1:-1] - 1] = np.inf
    limited = np.isfinite(robot.lower) | np.isfinite(robot.upper)
    unknown: dict[int, HingeTurns] = {}
    done: dict[bool, list[str]] = {True: [], False: []}
    for i in np.flatnonzero(robot.hinges).tolist():
        hinge = hinge_turns(q[:, i], steps, robot, i)
        if hinge.turns is not None:
            q[:, i] += hinge.turns
            done[hinge.cut].append(robot.joint_names[i])
        if not (limited[i] and hinge.known.all()):
            unknown[i] = replace(hinge, turns=None)  # which takes memory
    return unknown, turns_notes(done[True], done[False], "dataset")


def _equal_poses(
    task: Task,
    q: Numbers,
    tool: ToolMotion | ToolColumn,
    pairs: tuple[Whole, Whole],
    tolerance: float,
    turned: float,
    turns: dict[int, HingeTurns],
) -> EqualPoses:
    """The joints of pairs of rows.

    turned: how far joints [rad] follow a turn of the tool by which a distance of poses [m] grows, where the task has no
    rows for it: an arm of few joints.
    """
    first, second = pairs
    distance, allowed, joint = np.empty(len(first)), np.full(len(first), tolerance), np.empty(len(first), np.int16)
    unknown = np.broadcast_to(np.int16(-1), len(first))  # which takes no memory
    unknown = unknown.copy() if turns else unknown
    limited = np.isfinite(task.robot.lower) | np.isfinite(task.robot.upper)
    for i in range(0, len(first), PAIRS):
        block = slice(i, i + PAIRS)
        a, b = first[block], second[block]
        # How far joints may follow a turn of the tool, and joints whose whole turns do not count.
        if turned:
            angle = np.linalg.norm(_points(tool, a)[:, 3:] - _points(tool, b)[:, 3:], axis=1)
            allowed[block] += SLOPE * (turned * angle)
        less = np.zeros((len(a), task.n), bool)
        for j, hinge in turns.items():
            less[:, j] = hinge.apart(a, b) if limited[j] else hinge.runs_apart(a, b)
        if turns:
            unknown[block] = np.where((less & limited).any(axis=1), np.argmax(less & limited, axis=1), -1)
        # The joints of the second, moved to the pose of the first.
        q_a, q_b = q[a].astype(float), q[b].astype(float)
        q_b, moved = to_pose(task, q_b, *task._poses(q_a))
        gap = np.abs(less_turns(q_b - q_a, less))
        distance[block], joint[block] = gap.max(axis=1), np.argmax(gap, axis=1)
        allowed[block] += SLOPE * moved
    columns = (first, second, distance, allowed, joint, unknown)
    for column in columns:
        column.flags.writeable = False  # else a `Value` copies them
    return EqualPoses(*columns)


def _pairs(tool: ToolMotion | ToolColumn, key: Whole, moved: Whole, begins: Whole, near: float) -> tuple[Whole, Whole]:
    """(rows of first visits, rows of other visits of their poses), of both grids; a row is in the second only once."""
    compared, count = np.zeros(len(key), bool), 0
    pairs = np.empty((2, len(key)), np.int32)
    for grid in range(2):
        if grid:
            _move(key, moved)
        for first, second in _visits(tool, key, begins, near):
            new = ~compared[second]
            compared[second] = True
            new_rows = slice(count, count + np.count_nonzero(new))
            pairs[:, new_rows], count = (first[new], second[new]), new_rows.stop
    return pairs[0, :count].copy(), pairs[1, :count].copy()


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


def _visits(tool: ToolMotion | ToolColumn, key: Whole, begins: Whole, near: float) -> Iterator[tuple[Whole, Whole]]:
    """(rows of first visits, rows of other visits of their cells), at most `near` apart, in blocks."""
    width = 2**64 // PARTS
    starts = np.zeros(len(key), bool)
    starts[begins[:-1]] = True
    for low in range(0, 2**64, width):
        # The rows of some cells, by cell and time. Where a visit begins: another cell, or rows that do not follow.
        rows = np.flatnonzero((key >= np.uint64(low)) & (key <= np.uint64(low + width - 1))).astype(np.int32)
        if not len(rows):
            continue
        by_cell = np.argsort(key[rows], kind="stable")
        order, cells = rows[by_cell], key[rows[by_cell]]
        new_cell = np.append(True, cells[1:] != cells[:-1])
        new_visit = new_cell | np.append(True, np.diff(order) != 1) | starts[order]
        visit = np.append(np.flatnonzero(new_visit), len(order))  # where each begins, and the end
        # Other visits of a cell than its first are compared with the frame in the middle of that.
        is_first = new_cell[visit[:-1]]
        other, cell, first_of = np.flatnonzero(~is_first), np.cumsum(is_first), np.flatnonzero(is_first)
        for i in range(0, len(other), FRAMES_BLOCK):
            part = other[i : i + FRAMES_BLOCK]
            first = first_of[cell[part] - 1]
            first = order[(visit[first] + visit[first + 1] - 1) // 2]
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
) -> tuple[Whole, Numbers]:
    """Of each visit, rows order[begin:end], the one whose pose is nearest to a tool point, and how near."""
    length = np.minimum(end - begin, LOOKS)  # of a long rest some frames say it all
    best, nearest_gap = order[begin], np.full(len(begin), np.inf, np.float32)
    for k in range(int(length.max())):
        visits = np.flatnonzero(length > k)
        frame = order[begin[visits] + k * (end - begin)[visits] // length[visits]]
        gap = np.linalg.norm(_points(tool, frame) - reference[visits], axis=1)
        nearer = gap < nearest_gap[visits]
        best[visits[nearer]], nearest_gap[visits[nearer]] = frame[nearer], gap[nearer]
    return best, nearest_gap


def _was_away(
    tool: ToolMotion | ToolColumn, begins: Whole, first: Whole, second: Whole, points: Numbers, far: float
) -> Flags:
    """Whether two rows are of different episodes, or the tool was far from the first, at `points`, in between."""
    episodes = [np.searchsorted(begins, rows, side="right") for rows in (first, second)]
    away = episodes[0] != episodes[1]
    low, high = np.minimum(first, second).astype(np.int64), np.maximum(first, second)
    for k in range(1, LOOKS + 1):
        asked = np.flatnonzero(~away)
        between = (low + (high - low) * k // (LOOKS + 1))[asked]
        away[asked] = np.linalg.norm(_points(tool, between) - points[asked], axis=1) > far
    return away
