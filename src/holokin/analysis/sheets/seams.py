"""`Seam`: where the arm changes from one sheet to another with its tool still, and how."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, NoSeamError
from ...base.poses import PoseLike, given_pose, pose_numbers, tool_poses
from ...base.types import Array, Flags, Indices, Matrix, NoTruthValue, Value
from ...motion.checks import Clear
from ...motion.trajectory import Trajectory
from ...path.workspaces import Workspace
from ...strategies.tasks.task import Task
from .joined_motion import still_trajectory
from .sheet import Sheet, known
from .still_motion import Hindrance, StillMotion, still_motions, straight_seconds

FIRST, MOST = 8, 256
"""Poses that are tried at first for a pair of sheets, twice as many each time; and at most, those with the nearest
postures first."""

PLACES = 128
"""Poses of a workspace in which seams are to lie."""

Where = PoseLike | Workspace | Callable[[Matrix], bool] | None
"""Where seams may lie: at given poses, in a workspace, where a function of the tool pose is true; or anywhere."""


@dataclass(frozen=True, eq=False)
class Seam(Value):
    """A change from the sheet `first` to the sheet `second` at a tool pose (4, 4), with the tool still.

    motion: the joints from the posture of the first sheet to that of the second.
    """

    task: Task
    first: int
    second: int
    pose: Matrix
    motion: StillMotion

    @property
    def q(self) -> Matrix:
        """Postures (k, n) of the change."""
        return self.motion.q

    @property
    def seconds(self) -> float:
        """How long it takes at the joints' speed limits; the time for accelerating is not in it."""
        return self.motion.seconds

    @property
    def trajectory(self) -> Trajectory:
        """The change as a motion, for `hk.check` and `hk.retime`."""
        return still_trajectory(self.task, self.pose, self.motion)

    def reversed(self) -> Seam:
        """The change back."""
        return replace(self, first=self.second, second=self.first, motion=self.motion.reversed())

    def __str__(self) -> str:
        at = ", ".join(f"{x:.3f}" for x in self.pose[:3, 3])
        return f"sheet {self.first} to sheet {self.second}: {self.seconds:.2f} s at [{at}]"


@dataclass(frozen=True, eq=False)
class NoSeam(Value):
    """Two sheets between which the arm does not change with its tool still, and why not.

    both: poses looked at that both serve. hindrances: each with the number of poses at which it was met.
    """

    first: int
    second: int
    both: int
    hindrances: tuple[tuple[Hindrance, int], ...]

    @property
    def reason(self) -> str:
        """Why, in words."""
        tried = sum(count for _, count in self.hindrances)
        said = "; ".join(f"{count} times: {one.text}" for one, count in self.hindrances)
        if not self.both:
            return Hindrance.NO_POSE.text
        return f"at {tried} of {self.both} poses that both serve: {said}"

    def __str__(self) -> str:
        return f"sheet {self.first} to sheet {self.second}: {self.reason}"


@dataclass(frozen=True, eq=False)
class Seams(NoTruthValue, Value, ask="`.missing`"):
    """The cheapest change that was found between each pair of sheets; `missing` has the pairs without one, and why."""

    found: tuple[Seam, ...]
    missing: tuple[NoSeam, ...]

    def __len__(self) -> int:
        return len(self.found)

    def __iter__(self) -> Iterator[Seam]:
        return iter(self.found)

    def __getitem__(self, index: int) -> Seam:
        return self.found[index]

    @typed
    def between(self, first: int, second: int) -> Seam:
        """The change from one sheet to another. Raises: NoSeamError: there is none. ArgumentError: no such pair."""
        for one in self.found:
            if (one.first, one.second) == (first, second):
                return one
            if (one.second, one.first) == (first, second):
                return one.reversed()
        for none in self.missing:
            if {none.first, none.second} == {first, second} and first != second:
                raise NoSeamError(first, second, none.reason)
        raise ArgumentError("the sheets", (first, second), "give the indices of two sheets of the map")

    def __str__(self) -> str:
        pairs = len(self.found) + len(self.missing)
        lines = [f"{len(self.found)} of {pairs} pairs of sheets have a seam"]
        return "\n".join([*lines, *(f"  {one}" for one in (*self.found, *self.missing))])


def seams_of(
    task: Task, sheets: Sequence[Sheet], poses: Array, q: Array, clear: Clear | None, at: Where = None,
    middle: Matrix | None = None,
) -> Seams:  # fmt: skip
    """The fastest change between each pair of sheets, of those at some poses.

    Poses are tried by the least time that the joints could take, until none that is left can be faster, and `MOST` at
    most.

    Args:
        poses, q: tool poses (k, 4, 4), and the joints of each sheet there (S, k, n), NaN where it does not serve.
        at: where seams may lie; a function chooses among the poses, others bring their own.
        middle: the pose (4, 4) whose rotation the points of a task of positions take.

    Raises:
        ArgumentError, ShapeError, NotFiniteError: bad poses.
    """
    poses, q = _placed(task, sheets, poses, q, clear, at, middle)
    found: list[Seam] = []
    missing: list[NoSeam] = []
    for first in range(len(sheets)):
        for second in range(first + 1, len(sheets)):
            both = np.flatnonzero(known(q[first]) & known(q[second]))
            i, motion, met = _fastest(task, q[first, both], q[second, both], clear)
            if motion is None:
                missing.append(NoSeam(first, second, len(both), met))
            else:
                found.append(Seam(task, first, second, poses[both[i]], motion))
    return Seams(tuple(found), tuple(missing))


def _placed(
    task: Task, sheets: Sequence[Sheet], poses: Array, q: Array, clear: Clear | None, at: Where, middle: Matrix | None
) -> tuple[Array, Array]:
    """(poses (k, 4, 4), joints (S, k, n)) at which seams may lie."""
    if at is None:
        return poses, q
    if callable(at) and not isinstance(at, Workspace):
        chosen = allowed(at, poses)
        return poses[chosen], q[:, chosen]
    T = at.poses(min(PLACES, at.size or PLACES)) if isinstance(at, Workspace) else _given(task, at, middle)
    return T, np.array([sheet.postures(T, clear)[0] for sheet in sheets]).reshape(len(sheets), len(T), task.n)


def allowed(where: Callable[[Matrix], bool], poses: Array) -> Flags:
    """At which of the poses (k, 4, 4) a function is true. Raises: ArgumentError: it does not say yes or no."""
    said = [where(pose.copy()) for pose in poses]
    bad = [one for one in said if not isinstance(one, bool | np.bool_)]
    if bad:
        raise ArgumentError("the answer of the function", bad[0], "let it take a pose (4, 4) and return True or False")
    return np.array(said, dtype=bool)


def _given(task: Task, at: PoseLike, middle: Matrix | None) -> Array:
    """Poses (k, 4, 4), or points of a task of positions: one or several."""
    given = pose_numbers("the poses of seams", at)
    if middle is not None and task.orientation is None and given.ndim in (1, 2) and given.shape[-1] in (2, 3):
        T = np.repeat(middle[None], max(1, len(given) if given.ndim == 2 else 1), axis=0)
        T[:, : given.shape[-1], 3] = given
        return tool_poses("of seams", T)
    return tool_poses("of seams", given_pose("the pose of a seam", given)[None] if given.ndim == 2 else given)


def _fastest(
    task: Task, A: Matrix, B: Matrix, clear: Clear | None
) -> tuple[int, StillMotion | None, tuple[tuple[Hindrance, int], ...]]:
    """(row, motion) of the fastest motion from postures A (k, n) to B (k, n), or the hindrances that were met."""
    least = straight_seconds(A, B, task.robot)
    order: Indices = np.argsort(least, kind="stable")[:MOST]
    best, at, met, done, size = None, -1, Counter[Hindrance](), 0, FIRST
    while done < len(order) and (best is None or least[order[done]] < best.seconds):
        rows = order[done : done + size]
        for i, motion in zip(rows.tolist(), still_motions(task, A[rows], B[rows], clear), strict=True):
            if motion.hindrance is not None:
                met[motion.hindrance] += 1
            elif best is None or motion.seconds < best.seconds:
                best, at = motion, i
        done, size = done + size, 2 * size
    return at, best, tuple(met.most_common())
