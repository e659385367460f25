"""A path over several sheets: divided as seldom, changed as seldom, and moved as little as can be."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from ...base.errors import ArgumentError
from ...base.types import Array, ArrayLike, Flags, Indices, Matrix, Value, Vector, finite, whole
from ...motion.checks import Clearances
from ...motion.ik.inverse_function import AGREE, answers
from ...motion.ik.plan import check_start
from ...path import Path
from ...strategies.tasks.task import Task
from .seams import Division, Seam, SheetMotion, SheetPiece, SheetSequence, UnservedPart, allowed, fewest_changes
from .sheet import Sheet, known, postures_of_sheets
from .still_motion import Hindrance, Stage, StillMotion, joined, still_motions, straight_seconds

NEAR = 1e-9  # share of a path's duration within which two instants are one
ON_SHEET = 1e-6  # difference [joint units] below which a start posture is that of a sheet
SAME_RATES = 1e-6  # relative difference of two G at one posture below which the joints go on as they came

# Changes between two sheets that are looked at together at first, then as many again: one takes as long as sixteen.
TOGETHER = 16

Stops = ArrayLike | Callable[[Matrix], bool] | None
"""Where the sheet may change: at shares of the path's duration, or where a function of the tool pose is true."""


def follow_sheets(
    task: Task,
    sheets: Sequence[Sheet],
    clear: Clearances | None,
    path: Path,
    q0: ArrayLike | None,
    stops: Stops,
    samples: int,
    middle: Matrix,
) -> SheetMotion:
    """The best motion along a path over some sheets.

    Args:
        middle: the pose (4, 4) whose rotation the tool starts with, where neither path nor q0 say one.

    Raises:
        ArgumentError: q0 is a posture of no sheet; bad stops. StartError: its tool is not at the start of the path.
    """
    # The instants, and the tool's poses there. Its rotation is the path's own, or begins with that at q0.
    shares = np.zeros(0) if stops is None or callable(stops) else _shares(stops)
    start = None if q0 is None else task.robot.checked(q0, "the start posture")
    t = _instants(path, whole("samples", samples), shares)
    tool = path.at(t)
    begun = middle[:3, :3] if start is None else task._place(start)[1]
    poses = np.repeat(np.eye(4)[None], len(t), axis=0)
    poses[:, :3, 3] = tool.position
    poses[:, :3, :3] = tool.rotation @ (begun if path.rotation is None else path.rotation)
    # Where the sheet may change.
    may: Flags = np.ones(len(t), dtype=bool)
    if callable(stops):
        may = allowed(stops, poses)
    elif stops is not None:
        may = np.any(np.abs(t[:, None] - path.duration * shares) <= NEAR * path.duration, axis=1)
    # The joints of each sheet, and the steps on which they continue.
    q = postures_of_sheets(sheets, poses, None if clear is None else clear.clear, task.n)
    served = known(q)[:, :-1] & known(q)[:, 1:]
    for s, sheet in enumerate(sheets):
        i = np.flatnonzero(served[s])
        on, reached = answers(sheet.ik, poses[i + 1], q[s, i])
        served[s, i] = reached & (np.abs(on - q[s, i + 1]).max(axis=1) < AGREE)
    along = _Along(task, tuple(sheets), clear, path, t, poses, q, served, may)
    first = None if start is None else _stands_on(along, start)
    changes = _Changes(along)
    return _motion(along, changes, changes.best(first), first)


@dataclass(frozen=True, eq=False)
class _Along(Value):
    """A path's instants t (k,), poses (k, 4, 4), each sheet's joints (S, k, n), the steps that it serves (S, k - 1)."""

    task: Task
    sheets: tuple[Sheet, ...]
    clear: Clearances | None
    path: Path
    t: Vector
    poses: Array
    q: Array
    served: Flags
    may: Flags

    def share(self, i: int) -> float:
        """Where a sample is, as a share of the path's duration."""
        return float(self.t[i] / self.path.duration)


def _shares(stops: ArrayLike) -> Vector:
    shares = finite("the stops", np.atleast_1d(np.asarray(stops, dtype=object)).tolist(), ("k",))
    if not ((shares >= 0) & (shares <= 1)).all():
        raise ArgumentError("the stops", shares.tolist(), "give shares of the path's duration, from 0 to 1")
    return shares


def _instants(path: Path, samples: int, shares: Vector) -> Vector:
    """Times (k,) of at least so many steps, with the ends of all segments, and at shares of the duration."""
    segment, _, u = path.steps(samples)
    t = np.unique(np.concatenate([[0.0], path.starts[segment] + u * path.durations[segment], shares * path.duration]))
    near = np.argmin(np.abs(t[:, None] - path.starts), axis=1)
    t = np.unique(np.where(np.abs(t - path.starts[near]) <= NEAR * path.duration, path.starts[near], t))
    return t[np.append(np.diff(t) > NEAR * path.duration, True)]


def _stands_on(along: _Along, q0: Vector) -> int:
    """The sheet whose posture at the start of the path is q0 (n,)."""
    pose = along.poses[0]
    check_start(along.task, q0, pose[:3, 3], pose[:3, :3])
    for s, q in enumerate(along.q[:, 0]):
        if np.abs(q - q0).max() < ON_SHEET:  # false of NaN
            return s
    cure = "give the joints of a sheet there, s(pose)[1], or leave q0 out: the best sheet is chosen"
    raise ArgumentError("q0", q0.tolist(), f"it is a posture of no sheet at the start of the path: {cure}")


@dataclass(eq=False)
class _Changes:
    """The seconds of changes between sheets at the samples: at first the least that they could be; looked for where
    the best choice of sheets wants one, until all that it wants are known."""

    along: _Along
    seconds: Array = field(init=False)
    motions: dict[tuple[int, int, int], StillMotion] = field(default_factory=dict)

    def __post_init__(self) -> None:
        along = self.along
        robot, q = along.task.robot, np.swapaxes(along.q, 0, 1)
        fastest = straight_seconds(q[:, :, None], q[:, None], robot)
        self.seconds = np.where(np.isfinite(fastest) & along.may[:, None, None], fastest, np.inf)
        self.seconds[np.abs(q[:, :, None] - q[:, None]).max(axis=-1) < ON_SHEET] = 0.0  # one posture: nothing changes
        steps = straight_seconds(along.q[:, 1:], along.q[:, :-1], robot)
        self.steps = np.where(along.served, steps, np.inf)

    def best(self, first: int | None) -> SheetSequence:
        """The best choice of sheets."""
        while True:
            sequence = fewest_changes(self.steps, self.along.served, self.seconds, first)
            unknown = [change for change in turnings(sequence, first) if change not in self.motions]
            wanted = [change for change in unknown if 0 < self.seconds[change] < np.inf]
            if not wanted:
                return sequence
            for change in wanted:
                self._look(*change)

    def _look(self, i: int, a: int, b: int) -> None:
        """Look for changes between two sheets: at a sample, and where else they could be as fast."""
        if (i, a, b) in self.motions:
            return
        fastest = self.seconds[:, a, b].copy()
        done = [j for j, *pair in self.motions if pair == [a, b]]
        fastest[done] = np.inf
        fastest[fastest == 0] = np.inf
        others = np.argsort(fastest, kind="stable")[: max(TOGETHER, len(done))]
        rows: Indices = np.unique(np.append(others[np.isfinite(fastest[others])], i))
        q = self.along.q
        for j, motion in zip(
            rows.tolist(), still_motions(self.along.task, q[a, rows], q[b, rows], self.along.clear), strict=True
        ):
            self.motions[j, a, b], self.motions[j, b, a] = motion, motion.reversed()
            self.seconds[j, a, b] = self.seconds[j, b, a] = motion.seconds


def turnings(sequence: SheetSequence, first: int | None) -> list[tuple[int, int, int]]:
    """(sample, sheet before, sheet after) of each change and division, that at the start included."""
    begun = len(sequence.sheets) > 0 and first is not None and sequence.sheets[0] >= 0 and sequence.sheets[0] != first
    return [(0, int(first or 0), int(sequence.sheets[0])), *sequence.turnings] if begun else sequence.turnings


def _motion(along: _Along, changes: _Changes, best: SheetSequence, first: int | None) -> SheetMotion:
    """The motion of a choice of sheets."""
    # The pieces between changes of the sheet: served, or left out.
    labels = best.sheets
    ends = [0, *(np.flatnonzero(np.diff(labels)) + 1).tolist(), len(labels)]
    turning = {i: (a, b) for i, a, b in turnings(best, first)}
    pieces: list[SheetPiece] = []
    seams: list[Seam] = []
    divisions: list[Division] = []
    left_out: list[UnservedPart] = []
    parts: list[list[Stage]] = [[]]
    begun = 0
    for a, b in pairwise(ends):
        start, stop, s = along.share(a), along.share(b), int(labels[a])
        if s < 0:
            left_out.append(UnservedPart(start, stop, *_unserved(along, a, b)))
            parts.append([])
            continue
        # A change with the tool still, or a division where there is none.
        if a in turning and changes.seconds[(a, *turning[a])] > 0:
            change = (a, *turning[a])
            motion = changes.motions.get(change)
            if motion is not None and motion.hindrance is None:
                seams.append(Seam(along.task, *turning[a], along.poses[a], motion))
                parts[-1] += [Stage.still(along.poses[a], motion)] if len(motion.t) > 1 else []
            else:
                reason = _reason(along, changes, change)
                divisions.append(Division(start, *turning[a], along.poses[a], reason))
                parts.append([])
        if a and a in turning and changes.seconds[(a, *turning[a])] == 0 and _goes_on(along, a, *turning[a]):
            parts[-1].pop()  # one stage over both sheets: nothing rests between them
        else:
            begun = a
        pieces.append(SheetPiece(s, start, stop, joined(along.task, [_stage(along, labels, a, b)])))
        parts[-1].append(_stage(along, labels, begun, b))
    done = tuple(joined(along.task, stages) for stages in parts if stages)
    return SheetMotion(along.path, tuple(pieces), tuple(seams), tuple(divisions), tuple(left_out), done)


def _unserved(along: _Along, a: int, b: int) -> tuple[Matrix, str]:
    """(a pose between two samples that no sheet serves, why)."""
    lost = np.flatnonzero(~known(along.q[:, a : b + 1]).any(axis=0))
    if not len(lost):
        return along.poses[(a + b) // 2], "the joints of every sheet jump there"
    return along.poses[a + lost[len(lost) // 2]], "no sheet serves its poses, s.why(pose) says why"


def _reason(along: _Along, changes: _Changes, change: tuple[int, int, int]) -> str:
    i = change[0]
    if not along.may[i]:
        return Hindrance.NOT_ALLOWED.text
    motion = changes.motions.get(change)
    return Hindrance.NO_POSE.text if motion is None else motion.reason


def _goes_on(along: _Along, i: int, a: int, b: int) -> bool:
    """Whether two sheets that have one posture at a sample have the same joint rates there, too, as on one leaf."""
    gain_a, gain_b = (along.sheets[s].strategy.gain(along.q[b, i])[0] for s in (a, b))
    return bool(np.abs(gain_a - gain_b).max() <= SAME_RATES * np.abs(gain_b).max())


def _stage(along: _Along, labels: Indices, a: int, b: int) -> Stage:
    """The joints from sample a to b of the path, each step on its sheet: in its times, slower where joints would be too
    fast."""
    task, path, rows = along.task, along.path, slice(a, b + 1)
    on = np.append(labels[a:b], labels[b - 1])
    t, q = along.t[rows], along.q[on, np.arange(a, b + 1)]
    tool = path.at(t)
    x, _ = task._tool_rates(along.poses[rows, :3, :3], tool.velocity, tool.angular)
    dq, residual = np.zeros_like(q), np.zeros(len(q))
    for s in np.unique(on).tolist():
        on_sheet, sheet = on == s, along.sheets[s]
        dq[on_sheet] = sheet.strategy.rate.batch(q[on_sheet], x[on_sheet])[0].reshape(-1, task.n)
        if task.n > task.m:
            values = sheet.strategy.constraint_value.batch(q[on_sheet]).reshape(on_sheet.sum(), -1) - sheet.level
            residual[on_sheet] = np.abs(sheet.strategy.constraint.nearest(values)).max(axis=1)
    slower = max(1.0, float(np.max(np.abs(dq) / task.robot.max_velocity)))
    corners = [int(np.argmin(np.abs(t - path.starts[c]))) for c in path.corners if t[0] <= path.starts[c] < t[-1]]
    if 0 in path.corners and t[-1] == path.duration:
        corners.append(len(t) - 1)
    return Stage(slower * (t - t[0]), q, dq / slower, along.poses[rows], residual, tuple(corners))
