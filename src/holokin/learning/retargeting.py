"""`retarget`: a LeRobot dataset with its joints on one leaf, so that a tool pose has one posture in all episodes."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..analysis.audit.logs import STATE, Dataset, JointFeature, PoseFeature
from ..analysis.audit.logs.datasets import INFO, Rows, check_normalized, postures_of, rows, tool_poses_of
from ..analysis.audit.logs.log_formats import less_turns
from ..base.arguments import typed
from ..base.errors import ArgumentError, FileError
from ..base.files import aside, writing
from ..base.poses import pose_from
from ..base.types import Indices, Matrix, NoTruthValue, Shown, Value
from ..motion.ik import InverseKinematics, InverseStatus
from ..robot import Robot
from .dataset_writer import Change, check_meta, write_changed

FAR = 0.5  # median distance [rad or m] of an action from the state beyond which it is doubted to be a position


def check_targets(dataset: Dataset, robot: Robot, columns: Sequence[JointFeature]) -> None:
    """Raises: FileError: a column of the first episode that is far from the measured joints."""
    state = next((column for column in columns if column.name == STATE), None)
    others = [column for column in columns if column.name != STATE]
    if state is None or not others:
        return
    distances: dict[str, list[float]] = {column.name: [] for column in others}
    for part in rows(dataset, [column.name for column in columns], [0]):
        measured = postures_of(dataset, robot, state, part.values[STATE])
        for column in others:
            gap = less_turns(postures_of(dataset, robot, column, part.values[column.name]) - measured, robot.hinges)
            distances[column.name] += np.abs(gap).max(axis=1).tolist()
    for name, gaps in distances.items():
        if np.median(gaps) > FAR:
            fact = f"{name} is {np.median(gaps):.2g} rad or m from {STATE} (median of episode 0): it seems no position"
            cure = f"leave it as it is by --column {STATE}, or name both columns if it is one"
            raise FileError(dataset.folder / INFO, fact, cure)


# --- The joints of a dataset on one leaf: a posture for each tool pose of its columns, and which poses have none.

JUMPED = -1  # the status of a frame at which the joints jump, beside those of `InverseStatus`

# Joint move [rad or m] from a frame to the next that is a jump, unless the joints of the dataset moved as fast.
STEP = 0.5

RATIO = 5.0  # how many times as far as the joints of the dataset the new ones may move besides
EDGE = 0.02  # how near to singular postures `nearest` goes, as its `rcond`

Source = JointFeature | PoseFeature


@dataclass(eq=False)
class _NewJoints:
    """The new joints of one column, found a batch after the other; `file` gets them, (k, n) in rad and m, row by row.

    status: of the rows of each batch an `InverseStatus`, or `JUMPED`; before: the same before the nearest poses were
    taken. kept: how far the tool is at most from its pose [m or rad] where that was reached; moved: how far from it [m]
    where the nearest pose was taken. ends: least and largest joints (2, n) of the dataset. last: of the row before, the
    episode, the new joints and the old ones.
    """

    dataset: Dataset
    ik: InverseKinematics
    source: Source
    file: Path
    tip: str | None
    nearest: bool
    threads: int | None
    status: list[Indices] = field(default_factory=list)
    before: list[Indices] = field(default_factory=list)
    kept: float = 0.0
    moved: float = 0.0
    ends: Matrix | None = None
    last: tuple[int, Matrix, Matrix] | None = None

    @property
    def column(self) -> str:
        """The column that gets the joints."""
        return self.source.name if isinstance(self.source, JointFeature) else f"{self.source.name}.joints"

    def solved(self, part: Rows) -> Matrix:
        """Postures (k, n) of a batch of rows; NaN where there is none."""
        robot, task = self.ik.strategy.task.robot, self.ik.strategy.task
        values = part.values[self.source.name]
        old = np.zeros((len(values), robot.n))
        if isinstance(self.source, JointFeature):
            old = postures_of(self.dataset, robot, self.source, values)
            every = old if self.ends is None else np.vstack([self.ends, old])
            self.ends = np.stack([every.min(axis=0), every.max(axis=0)])
            place, turn = robot.pose_batch(old, self.tip)
        else:
            place, turn = tool_poses_of(self.dataset, self.source, values, part.frame)
        poses = pose_from(place, turn)
        solutions = self.ik.batch(poses, threads=self.threads)
        q, status = solutions.q.copy(), solutions.status.astype(np.intp)
        reached = status == InverseStatus.REACHED
        if reached.any():
            gap = np.abs(task.error(q[reached], place[reached], turn[reached]))
            self.kept = max(self.kept, float(gap.max()))
        self.before.append(status.copy())
        if self.nearest:
            for i in np.flatnonzero(~reached):
                q[i], status[i] = self._nearest(poses[i], int(status[i]))
        status[self._jumps(part.episode, q, old)] = JUMPED
        self.status.append(status)
        return q

    def _nearest(self, pose: Matrix, status: int) -> tuple[Matrix, int]:
        nearest = self.ik.nearest(pose, rcond=EDGE)
        if nearest.status > InverseStatus.CLAMPED:
            return np.full_like(nearest.q, np.nan), status
        self.moved = max(self.moved, nearest.distance)
        return nearest.q, int(nearest.status)

    def _jumps(self, episode: Indices, q: Matrix, old: Matrix) -> Indices:
        """Rows to which the new joints jump within an episode."""
        before = self.last or (-1, np.full_like(q[0], np.nan), old[0])
        whole, source = np.vstack([before[1], q]), np.vstack([before[2], old])
        episodes = np.append(before[0], episode)
        moves = np.diff(whole, axis=0), less_turns(np.diff(source, axis=0), self.ik.strategy.task.robot.hinges)
        step, usual = (np.abs(motion).max(axis=1) for motion in moves)
        self.last = int(episode[-1]), q[-1], old[-1]
        with np.errstate(invalid="ignore"):
            return np.flatnonzero((episodes[1:] == episodes[:-1]) & (step > STEP + RATIO * usual))


def _find_joints(dataset: Dataset, columns: Sequence[_NewJoints]) -> None:
    """Find the postures on the leaf of every row, and write them. Raises: FileError."""
    streams = [column.file.open("wb") for column in columns]
    try:
        for part in rows(dataset, list(dict.fromkeys(column.source.name for column in columns))):
            for column, stream in zip(columns, streams, strict=True):
                column.solved(part).tofile(stream)
    finally:
        for stream in streams:
            stream.close()
    for column in columns:
        if isinstance(column.source, JointFeature) and column.ends is not None:
            check_normalized(dataset, column.ik.strategy.task.robot, column.source, *column.ends)


_WHY = {
    JUMPED: "the joints jump",
    InverseStatus.LIMIT: "beyond the joint limits",
    InverseStatus.LEAF_ENDS: "the strategy does not lead there",
    InverseStatus.SINGULAR: "singular there",
    InverseStatus.NOT_CONVERGED: "not reached",
    InverseStatus.OUTSIDE: "outside the region",
    InverseStatus.NOT_A_ROTATION: "its orientation is no rotation",
    InverseStatus.JUMP: "the rule jumps",
}


MOST_LINES = 12  # bad episodes that are told; `bad` has all


@dataclass(frozen=True)
class BadFrames(Shown):
    """Frames of an episode that have no posture on the leaf: the column, how many, the first, and why."""

    episode: int
    column: str
    count: int
    first: int
    why: str

    def __str__(self) -> str:
        many = "1 frame" if self.count == 1 else f"{self.count} frames"
        return f"episode {self.episode}: {many} of {self.column}, the first is {self.first}: {self.why}"


@dataclass(frozen=True, eq=False)
class Retargeted(NoTruthValue, Value, ask="`.written`"):
    """What `retarget` did; `str` says it.

    written: the new dataset, or None where frames are bad and nothing was asked for them. bad: of each episode and
    column. left_out: episodes that the new dataset does not have. kept: how far the tool is from its pose at most,
    before the joints are rounded to the numbers of the dataset [m or rad]; rounded: the same of what was written.
    nearest: frames with the nearest pose in place of their own, and how far [m] that is at most.
    """

    written: Path | None
    joints: Path | None
    frames: int
    columns: tuple[str, ...]
    bad: tuple[BadFrames, ...]
    left_out: tuple[int, ...]
    kept: float
    rounded: float
    nearest: tuple[int, float]

    def __str__(self) -> str:
        if self.written is None:
            lines = [f"no dataset was written; the joints that were computed are in {self.joints}"]
        else:
            lines = [f"{self.frames} frames of {', '.join(self.columns)} written to {self.written}"]
            accuracy = f"tool poses are kept to {self.kept:.1g} m or rad"
            lines.append(f"{accuracy}, and to {self.rounded:.1g} in the numbers written")
            if self.nearest[0]:
                away = f"up to {1e3 * self.nearest[1]:.3g} mm away"
                lines.append(f"{self.nearest[0]} frames have the nearest pose, {away}")
            if self.left_out:
                lines.append(f"left out: episodes {', '.join(map(str, self.left_out))}")
        lines += [str(frames) for frames in self.bad[:MOST_LINES]]
        if len(self.bad) > MOST_LINES:
            count = sum(frames.count for frames in self.bad)
            lines.append(f"... and {len(self.bad) - MOST_LINES} more, {count} frames in all")
        return "\n".join(lines)


@typed
def retarget(
    dataset: Dataset,
    ik: InverseKinematics,
    sources: Sequence[Source],
    out: Path,
    *,
    tip: str | None = None,
    bad: Literal["refuse", "skip", "nearest"] = "refuse",
    double: bool = False,
    threads: int | None = None,
) -> Retargeted:
    """Write a dataset whose joints are the function `ik` of the tool pose. All other columns stay as they are.

    Args:
        sources: columns of joints, which get new values, or of tool poses, beside which a column NAME.joints is put.
        out: the folder of the new dataset, which does not exist yet.
        tip: the link whose pose the strategy keeps; by default the robot's own.
        bad: of frames without a posture: "refuse" writes no dataset, but the joints found, as OUT-joints.parquet;
            "skip" leaves out their episodes; "nearest" takes the nearest pose of the leaf.
        double: write joints in double precision; by default in that of the dataset, which rounds them.

    Raises:
        FileError: a dataset that cannot be read. ArgumentError: no columns; a folder that exists. WriteError.
    """
    if bad not in ("refuse", "skip", "nearest"):
        raise ArgumentError("bad", bad, 'say "refuse", "skip" or "nearest"')
    if not sources:
        raise ArgumentError("the columns to retarget", list(sources), "name one that has the joints or a tool pose")
    if os.path.lexists(out):
        raise ArgumentError("the folder of the new dataset", str(out), "it exists: choose another name")
    check_meta(dataset)
    with writing(out):
        out.parent.mkdir(parents=True, exist_ok=True)
    with aside(out.parent) as work:
        # The new joints of all columns, and the frames that have none.
        files = [work / f"joints-{i}" for i in range(len(sources))]
        joints = [
            _NewJoints(dataset, ik, source, file, tip, bad == "nearest", threads)
            for source, file in zip(sources, files, strict=True)
        ]
        _find_joints(dataset, joints)
        bads = _bad_frames(dataset, joints)
        pairs = [pair for new in joints for pair in zip(new.before, new.status, strict=True)]
        at_nearest = sum(int((before != now).sum()) for before, now in pairs) if bad == "nearest" else 0
        facts = {
            "bad": tuple(bads),
            "columns": tuple(new.column for new in joints),
            "kept": max(new.kept for new in joints),
            "nearest": (at_nearest, max(new.moved for new in joints)),
        }
        if bads and bad != "skip":
            with writing(out):
                file = _keep_joints(dataset, ik, joints, work, out)
            return Retargeted(None, file, 0, left_out=(), rounded=np.nan, **facts)
        left = tuple(sorted({new.episode for new in bads}))
        if len(left) == len(dataset.episodes):
            cure = "choose another strategy or q0: nothing would be left"
            raise ArgumentError("episodes without a bad frame", 0, cure)
        # The dataset, in a folder aside that is moved to its place when it is complete.
        changes = [Change(new.source, new.file, new.column, double) for new in joints]
        with writing(out):
            rounded = write_changed(dataset, ik.strategy.task, changes, left, work / "new", _provenance(ik, tip))
            os.rename(work / "new", out)
        frames = dataset.frames - sum(dataset.episodes[i].length for i in left)
        rounded = max(rounded, facts["kept"])
        return Retargeted(out, None, frames, left_out=left, rounded=rounded, **facts)


def _why(status: int) -> str:
    """Why a frame has no posture, in words."""
    return _WHY.get(status) or InverseStatus(status).name.lower()


def _bad_frames(dataset: Dataset, joints: Sequence[_NewJoints]) -> list[BadFrames]:
    bads = []
    begins = np.array([e.first for e in dataset.episodes])
    for new in joints:
        status = np.concatenate(new.status)
        wrong = np.flatnonzero((status < 0) | (status > InverseStatus.CLAMPED))
        episodes = np.searchsorted(begins, wrong, side="right") - 1
        for e in np.unique(episodes):
            frames = wrong[episodes == e]
            kinds, counts = np.unique(status[frames], return_counts=True)
            why = ", ".join(_why(int(kind)) for kind in kinds[np.argsort(-counts)])
            bads.append(BadFrames(int(e), new.source.name, len(frames), int(frames[0] - begins[e]), why))
    return sorted(bads, key=lambda b: (b.episode, b.column))


def _provenance(ik: InverseKinematics, tip: str | None) -> dict[str, Any]:
    """What the new dataset says of how it was made."""
    strategy, robot = ik.strategy, ik.strategy.task.robot
    about = {"robot": robot.name, "strategy": strategy.name, "task": strategy.task.name, "tip": tip}
    return about | {"joints": list(robot.joint_names), "q0": ik.q0.tolist(), "joint limits": ik.limits}


def _keep_joints(dataset: Dataset, ik: InverseKinematics, joints: Sequence[_NewJoints], work: Path, out: Path) -> Path:
    """All joints that were computed, in a parquet file beside the folder that was not made."""
    import pyarrow
    from pyarrow import parquet

    names = list(ik.strategy.task.robot.joint_names)
    target, part, writer = out.with_name(f"{out.name}-joints.parquet"), work / "joints.parquet", None
    try:
        for new in joints:
            status = np.concatenate(new.status)
            with new.file.open("rb") as stream:
                for e in dataset.episodes:
                    q = np.fromfile(stream, count=e.length * len(names)).reshape(-1, len(names))
                    table = {"column": [new.source.name] * len(q), "episode_index": [e.index] * len(q)}
                    table |= {"frame_index": np.arange(len(q)), **dict(zip(names, q.T.copy(), strict=True))}
                    table["bad"] = [_why(int(s)) if s else "" for s in status[e.first : e.first + e.length]]
                    written = pyarrow.table(table)
                    writer = writer or parquet.ParquetWriter(part, written.schema)
                    writer.write_table(written)
    finally:
        if writer is not None:
            writer.close()
    os.replace(part, target)
    return target
