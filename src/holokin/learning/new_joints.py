"""The joints of a dataset on one leaf: a posture for each tool pose of its columns, and which poses have none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..analysis.audit.logs import Dataset, JointFeature, PoseFeature
from ..analysis.audit.logs.dataset_columns import check_normalized, postures_of, tool_poses_of
from ..analysis.audit.logs.dataset_folder import Rows, rows
from ..analysis.audit.logs.logged_turns import less_turns
from ..base.poses import pose_from
from ..base.types import Indices, Matrix, Value
from ..motion.ik import InverseKinematics, InverseStatus

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


def new_joints(
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
        found = self.ik.batch(poses, threads=self.threads)
        q, status = found.q.copy(), found.status.astype(np.intp)
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
        found = self.ik.nearest(pose, rcond=EDGE)
        if found.status > InverseStatus.CLAMPED:
            return np.full_like(found.q, np.nan), status
        self.moved = max(self.moved, found.distance)
        return found.q, int(found.status)

    def _jumps(self, episode: Indices, q: Matrix, old: Matrix) -> Indices:
        """Rows to which the new joints jump within an episode."""
        before = self.last or (-1, np.full_like(q[0], np.nan), old[0])
        whole, source = np.vstack([before[1], q]), np.vstack([before[2], old])
        of = np.append(before[0], episode)
        moves = np.diff(whole, axis=0), less_turns(np.diff(source, axis=0), self.ik.strategy.task.robot.hinges)
        step, usual = (np.abs(one).max(axis=1) for one in moves)
        self.last = int(episode[-1]), q[-1], old[-1]
        with np.errstate(invalid="ignore"):
            return np.flatnonzero((of[1:] == of[:-1]) & (step > STEP + RATIO * usual))

    def result(self, file: Path) -> NewJoints:
        """What was found of all rows. Raises: RecordingError: values that are no angles."""
        if isinstance(self.source, JointFeature):
            check_normalized(self.dataset, self.ik.strategy.task.robot, self.source, self.low, self.high)
        status, before = np.concatenate(self.status), np.concatenate(self.before)
        return NewJoints(self.source, file, status, before, self.kept, self.moved)
