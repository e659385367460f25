"""`retarget`: a LeRobot dataset with its joints on one leaf, so that a tool pose has one posture in all episodes."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..analysis.audit.logs import STATE, Dataset, JointFeature, PoseFeature
from ..analysis.audit.logs.datasets import INFO, Rows, check_normalized, postures_of, rows, tool_poses_of
from ..analysis.audit.logs.log_formats import less_turns
from ..base.arguments import typed
from ..base.errors import ArgumentError, RecordingError
from ..base.files import aside, writing
from ..base.poses import pose_from
from ..base.types import Indices, Matrix, NoTruthValue, Shown, Value
from ..motion.ik import InverseKinematics, InverseStatus
from ..robot import Robot
from .dataset_writer import Change, check_meta, write_changed

FAR = 0.5
"""Median distance [rad or m] of an action from the state beyond which it is doubted to be a position."""


def check_targets(dataset: Dataset, robot: Robot, columns: Sequence[JointFeature]) -> None:
    """Raises: RecordingError: a column of the first episode that is far from the measured joints."""
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
            raise RecordingError(dataset.folder / INFO, fact, cure)


# --- The joints of a dataset on one leaf: a posture for each tool pose of its columns, and which poses have none.

JUMPED = -1
"""The status of a frame at which the joints jump, beside those of `InverseStatus`."""

STEP = 0.5
"""Joint move [rad or m] from a frame to the next that is a jump, unless the joints of the dataset moved as fast."""

RATIO = 5.0
"""How many times as far as the joints of the dataset the new ones may move besides."""

EDGE = 0.02
"""How near to singular postures `nearest` goes, as its `rcond`."""

Source = JointFeature | PoseFeature


@dataclass(frozen=True, eq=False)
class NewJoints(Value):
    """The new joints of one column: `file` has them in double precision, (k, n) in rad and m, in the order of the rows.

    status (k,): of each row an `InverseStatus`, or `JUMPED`; before (k,): the same before the nearest poses were taken.
    kept: how far the tool is at most from its pose [m or rad] where that was reached; moved: how far from it [m] where
    the nearest pose was taken.
    """

    source: Source
    file: Path
    status: Indices
    before: Indices
    kept: float
    moved: float


def _new_joints(
    dataset: Dataset, ik: InverseKinematics, sources: Sequence[Source], tip: str | None, nearest: bool, work: Path,
    threads: int | None,
) -> list[NewJoints]:  # fmt: skip
    """Postures on the leaf for every row of some columns, written into files of a folder. Raises: RecordingError."""
    names = list(dict.fromkeys(source.name for source in sources))
    solvers = [_Solver(dataset, ik, source, tip, nearest, threads) for source in sources]
    files = [work / f"joints-{i}" for i in range(len(sources))]
    streams = [file.open("wb") for file in files]
    try:
        for part in rows(dataset, names):
            for solver, stream in zip(solvers, streams, strict=True):
                solver.solved(part).tofile(stream)
    finally:
        for stream in streams:
            stream.close()
    return [solver.result(file) for solver, file in zip(solvers, files, strict=True)]


class _Solver:
    """The leaf's postures for one column, a batch after the other."""

    def __init__(
        self, dataset: Dataset, ik: InverseKinematics, source: Source, tip: str | None, nearest: bool,
        threads: int | None,
    ) -> None:  # fmt: skip
        self.dataset, self.ik, self.source, self.tip = dataset, ik, source, tip
        self.nearest, self.threads = nearest, threads
        self.status: list[Indices] = []
        self.before: list[Indices] = []
        self.last: tuple[int, Matrix, Matrix] | None = None
        self.kept = self.moved = 0.0
        self.low, self.high = (np.full(ik.strategy.task.robot.n, end) for end in (np.inf, -np.inf))

    def solved(self, part: Rows) -> Matrix:
        """Postures (k, n) of a batch of rows; NaN where there is none."""
        robot, task = self.ik.strategy.task.robot, self.ik.strategy.task
        values = part.values[self.source.name]
        old = np.zeros((len(values), robot.n))
        if isinstance(self.source, JointFeature):
            old = postures_of(self.dataset, robot, self.source, values)
            self.low, self.high = np.minimum(self.low, old.min(axis=0)), np.maximum(self.high, old.max(axis=0))
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
        of = np.append(before[0], episode)
        moves = np.diff(whole, axis=0), less_turns(np.diff(source, axis=0), self.ik.strategy.task.robot.hinges)
        step, usual = (np.abs(motion).max(axis=1) for motion in moves)
        self.last = int(episode[-1]), q[-1], old[-1]
        with np.errstate(invalid="ignore"):
            return np.flatnonzero((of[1:] == of[:-1]) & (step > STEP + RATIO * usual))

    def result(self, file: Path) -> NewJoints:
        """What was found of all rows. Raises: RecordingError: values that are no angles."""
        if isinstance(self.source, JointFeature):
            check_normalized(self.dataset, self.ik.strategy.task.robot, self.source, self.low, self.high)
        status, before = np.concatenate(self.status), np.concatenate(self.before)
        return NewJoints(self.source, file, status, before, self.kept, self.moved)


WHY = {
    JUMPED: "the joints jump",
    InverseStatus.LIMIT: "beyond the joint limits",
    InverseStatus.LEAF_ENDS: "the leaf ends before",
    InverseStatus.SINGULAR: "singular",
    InverseStatus.NOT_CONVERGED: "not reached",
    InverseStatus.OUTSIDE: "outside the region",
    InverseStatus.NOT_A_ROTATION: "no rotation",
    InverseStatus.JUMP: "the rule jumps",
}
"""Why a frame has no posture, in words."""


MOST_LINES = 12
"""Bad episodes that are told; `bad` has all."""


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
        lines = [str(frames) for frames in self.bad[:MOST_LINES]]
        if len(self.bad) > MOST_LINES:
            lines.append(
                f"... and {len(self.bad) - MOST_LINES} more, {sum(frames.count for frames in self.bad)} frames in all"
            )
        if self.written is None:
            return "\n".join([*lines, f"no dataset was written; the joints that were computed are in {self.joints}"])
        if self.left_out:
            lines.append(f"left out: episodes {', '.join(map(str, self.left_out))}")
        if self.nearest[0]:
            lines.append(f"{self.nearest[0]} frames have the nearest pose, up to {1e3 * self.nearest[1]:.3g} mm away")
        lines.append(f"{self.frames} frames of {', '.join(self.columns)} written to {self.written}")
        lines.append(
            f"tool poses are kept to {self.kept:.1g} m or rad, and to {self.rounded:.1g} in the numbers written"
        )
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
        RecordingError: a dataset that cannot be read. ArgumentError: no columns; a folder that exists. WriteError.
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
        joints = _new_joints(dataset, ik, sources, tip, bad == "nearest", work, threads)
        bads = _bad_frames(dataset, joints)
        at_nearest = sum(int((new.before != new.status).sum()) for new in joints) if bad == "nearest" else 0
        facts = {
            "bad": tuple(bads),
            "columns": tuple(_column(new.source) for new in joints),
            "kept": max(new.kept for new in joints),
            "nearest": (at_nearest, max(new.moved for new in joints)),
        }
        if bads and bad != "skip":
            with writing(out):
                file = _keep_joints(dataset, ik, joints, work, out)
            return Retargeted(None, file, 0, left_out=(), rounded=np.nan, **facts)
        left = tuple(sorted({new.episode for new in bads}))
        if len(left) == len(dataset.episodes):
            raise ArgumentError(
                "episodes without a bad frame", 0, "choose another strategy or q0: nothing would be left"
            )
        changes = [Change(new.source, new.file, _column(new.source), double) for new in joints]
        with writing(out):
            rounded = write_changed(dataset, ik.strategy.task, changes, left, work / "new", _provenance(ik, tip))
            os.rename(work / "new", out)
        frames = dataset.frames - sum(dataset.episodes[i].length for i in left)
        rounded = max(rounded, facts["kept"])
        return Retargeted(out, None, frames, left_out=left, rounded=rounded, **facts)


def _column(source: Source) -> str:
    """The column that gets the joints."""
    return source.name if isinstance(source, JointFeature) else f"{source.name}.joints"


def _bad_frames(dataset: Dataset, joints: Sequence[NewJoints]) -> list[BadFrames]:
    out = []
    for new in joints:
        wrong = np.flatnonzero((new.status < 0) | (new.status > InverseStatus.CLAMPED))
        begins = np.array([e.first for e in dataset.episodes])
        of = np.searchsorted(begins, wrong, side="right") - 1
        for e in np.unique(of):
            mine = wrong[of == e]
            kinds, counts = np.unique(new.status[mine], return_counts=True)
            why = ", ".join(
                WHY.get(int(kind), InverseStatus(int(kind)).name.lower()) for kind in kinds[np.argsort(-counts)]
            )
            out.append(BadFrames(int(e), new.source.name, len(mine), int(mine[0] - begins[e]), why))
    return sorted(out, key=lambda b: (b.episode, b.column))


def _provenance(ik: InverseKinematics, tip: str | None) -> dict[str, Any]:
    """What the new dataset says of how it was made."""
    robot = ik.strategy.task.robot
    return {
        "robot": robot.name, "strategy": ik.strategy.name, "task": ik.strategy.task.name, "tip": tip,
        "joints": list(robot.joint_names), "q0": ik.q0.tolist(), "joint limits": ik.limits,
    }  # fmt: skip


def _keep_joints(dataset: Dataset, ik: InverseKinematics, joints: Sequence[NewJoints], work: Path, out: Path) -> Path:
    """All joints that were computed, in a parquet file beside the folder that was not made."""
    import pyarrow
    from pyarrow import parquet

    robot = ik.strategy.task.robot
    names = list(robot.joint_names)
    target, part, writer = out.with_name(f"{out.name}-joints.parquet"), work / "joints.parquet", None
    try:
        for new in joints:
            with new.file.open("rb") as stream:
                for episode in dataset.episodes:
                    q = np.fromfile(stream, count=episode.length * robot.n).reshape(-1, robot.n)
                    status = new.status[episode.first : episode.first + episode.length]
                    words = [WHY.get(int(s), InverseStatus(int(s)).name.lower()) if s else "" for s in status]
                    table = pyarrow.table(
                        {
                            "column": [new.source.name] * len(q), "episode_index": [episode.index] * len(q),
                            "frame_index": np.arange(len(q)), **dict(zip(names, q.T.copy(), strict=True)), "bad": words,
                        }
                    )  # fmt: skip
                    writer = writer or parquet.ParquetWriter(part, table.schema)
                    writer.write_table(table)
    finally:
        if writer is not None:
            writer.close()
    os.replace(part, target)
    return target
