"""`Seam`: where the arm changes from one sheet to another with its tool still, and how."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, PathError
from ...base.poses import PoseLike, given_pose, pose_numbers, tool_poses
from ...base.types import Array, Flags, Indices, Matrix, NoTruthValue, Value, Vector, runs
from ...motion.checks import Clearances, PairDistance
from ...motion.trajectory import Trajectory
from ...path import Path
from ...path.workspaces import Workspace
from ...strategies.tasks.task import Task
from .sheet import Sheet, known, postures_of_sheets
from .still_motion import Hindrance, StillMotion, still_motions, still_trajectory, straight_seconds

# Poses that are looked at first for a pair of sheets, twice as many each time; and at most together, and at all where
# there are obstacles or several redundant joints: those with the nearest postures first.
FIRST, MOST = 8, 256

SHOWN = 4  # things that are in the way of a change, of those that are most often

PLACES = 128  # poses of a workspace in which seams are to lie

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
        place = ", ".join(f"{x:.3f}" for x in self.pose[:3, 3])
        return f"sheet {self.first} to sheet {self.second}: {self.seconds:.2f} s at [{place}]"


@dataclass(frozen=True, eq=False)
class NoSeam(Value):
    """Two sheets between which the arm does not change with its tool still, and why not.

    both: poses looked at that both serve. hindrances: each with the number of poses at which it was met. ends: the
    joints at their limits, and the things too near to each other, that end the most self-motions, and how many.
    nearest: two of these things, how near they came, and where.
    """

    first: int
    second: int
    both: int
    hindrances: tuple[tuple[Hindrance, int], ...]
    ends: tuple[tuple[str, int], ...] = ()
    nearest: PairDistance | None = None

    @property
    def reason(self) -> str:
        """Why, in words."""
        if not self.both:
            return Hindrance.NO_POSE.text
        tried = sum(count for _, count in self.hindrances)
        reasons = "; ".join(f"{hindrance.text} ({count} of them)" for hindrance, count in self.hindrances)
        most = f"; most often {', '.join(f'{end}, {count} times' for end, count in self.ends)}" if self.ends else ""
        example = f"; for instance {self.nearest}" if self.nearest else ""
        return f"{tried} of the {self.both} poses that both serve were looked at: {reasons}{most}{example}"

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
        """The change from one sheet to another. Raises: PathError: there is none. ArgumentError: no such pair."""
        for seam in self.found:
            if (seam.first, seam.second) == (first, second):
                return seam
            if (seam.second, seam.first) == (first, second):
                return seam.reversed()
        for none in self.missing:
            if {none.first, none.second} == {first, second} and first != second:
                raise PathError(
                    f"between the sheets {first} and {second} there is no seam: {none.reason}",
                    "let the arm leave the pose to change, or name other places: s.seams(at=...)",
                )
        raise ArgumentError("the sheets", (first, second), "give the indices of two sheets of the map")

    def __str__(self) -> str:
        pairs = len(self.found) + len(self.missing)
        lines = [f"{len(self.found)} of {pairs} pairs of sheets have a seam"]
        return "\n".join([*lines, *(f"  {part}" for part in (*self.found, *self.missing))])


def seams_of(
    task: Task,
    sheets: Sequence[Sheet],
    poses: Array,
    q: Array,
    clear: Clearances | None,
    at: Where = None,
    middle: Matrix | None = None,
) -> Seams:
    """The fastest change between each pair of sheets, of those at some poses.

    Poses are looked at by the least time that the joints could take, until none that is left can be faster; with
    obstacles, or several redundant joints, `MOST` at most.

    Args:
        poses, q: tool poses (k, 4, 4), and the joints of each sheet there (S, k, n), NaN where it does not serve.
        at: where seams may lie; a function chooses among the poses, others bring their own.
        middle: the pose (4, 4) whose rotation the points of a task of positions take.

    Raises:
        ArgumentError, ShapeError, NotFiniteError: bad poses.
    """
    poses, q = _placed(task, sheets, poses, q, clear, at, middle)
    every = [_change(task, poses, q, first, second, clear) for first, second in combinations(range(len(sheets)), 2)]
    found = tuple(one for one in every if isinstance(one, Seam))
    return Seams(found, tuple(one for one in every if isinstance(one, NoSeam)))


def _change(task: Task, poses: Array, q: Array, first: int, second: int, clear: Clearances | None) -> Seam | NoSeam:
    """The fastest change between two sheets, of those at some poses; or what was met at these."""
    both = np.flatnonzero(known(q[[first, second]]).all(axis=0))
    fastest = straight_seconds(q[first, both], q[second, both], task.robot)
    most = len(both) if clear is None and task.n - task.m == 1 else MOST
    order = both[np.argsort(fastest, kind="stable")][:most]
    fastest = np.sort(fastest)
    best, met, ends, done, size = None, Counter[Hindrance](), Counter[str](), 0, FIRST
    nearest: PairDistance | None = None
    while done < len(order) and (best is None or fastest[done] < best.seconds):
        rows = order[done : done + size]
        for i, motion in zip(rows.tolist(), still_motions(task, q[first, rows], q[second, rows], clear), strict=True):
            if motion.hindrance is not None:
                met[motion.hindrance] += 1
                ends.update(motion.ends)
                nearest = nearest or motion.nearest
            elif best is None or motion.seconds < best.seconds:
                best = Seam(task, first, second, poses[i], motion)
        done, size = done + size, min(2 * size, MOST)
    if best is not None:
        return best
    return NoSeam(first, second, len(both), tuple(met.most_common()), tuple(ends.most_common(SHOWN)), nearest)


def _placed(
    task: Task,
    sheets: Sequence[Sheet],
    poses: Array,
    q: Array,
    clear: Clearances | None,
    at: Where,
    middle: Matrix | None,
) -> tuple[Array, Array]:
    """(poses (k, 4, 4), joints (S, k, n)) at which seams may lie."""
    if at is None:
        return poses, q
    if callable(at) and not isinstance(at, Workspace):
        chosen = allowed(at, poses)
        return poses[chosen], q[:, chosen]
    T = at.poses(min(PLACES, at.size or PLACES)) if isinstance(at, Workspace) else _given(task, at, middle)
    return T, postures_of_sheets(sheets, T, None if clear is None else clear.clear, task.n)


def allowed(where: Callable[[Matrix], bool], poses: Array) -> Flags:
    """At which of the poses (k, 4, 4) a function is true. Raises: ArgumentError: it does not say yes or no."""
    answers = [where(pose.copy()) for pose in poses]
    bad = [answer for answer in answers if not isinstance(answer, bool | np.bool_)]
    if bad:
        raise ArgumentError("the answer of the function", bad[0], "let it take a pose (4, 4) and return True or False")
    return np.array(answers, dtype=bool)


def _given(task: Task, at: PoseLike, middle: Matrix | None) -> Array:
    """Poses (k, 4, 4), or points of a task of positions: one or several."""
    given = pose_numbers("the poses of seams", at)
    if middle is not None and task.orientation is None and given.ndim in (1, 2) and given.shape[-1] in (2, 3):
        T = np.repeat(middle[None], len(given) if given.ndim == 2 else 1, axis=0)
        T[:, : given.shape[-1], 3] = given
        return tool_poses("of seams", T)
    return tool_poses("of seams", given_pose("the pose of a seam", given)[None] if given.ndim == 2 else given)


@dataclass(frozen=True, eq=False)
class SheetPiece(Value):
    """A part of a path on one sheet: from `start` to `stop`, as shares of the path's duration; its joints alone."""

    sheet: int
    start: float
    stop: float
    trajectory: Trajectory

    def __str__(self) -> str:
        return f"{_percent(self.start)} to {_percent(self.stop)} of the path: sheet {self.sheet}"


@dataclass(frozen=True, eq=False)
class Division(Value):
    """Where on a path, as a share of its duration, the arm must leave the tool's pose to go on, and why."""

    at: float
    first: int
    second: int
    pose: Matrix
    reason: str

    def __str__(self) -> str:
        sheets = f"from sheet {self.first} to sheet {self.second}"
        return f"divided at {_percent(self.at)} of the path, {sheets}: {self.reason}"


@dataclass(frozen=True, eq=False)
class UnservedPart(Value):
    """A part of a path that no sheet serves, from `start` to `stop` as shares of its duration, a pose of it, why."""

    start: float
    stop: float
    pose: Matrix
    reason: str

    def __str__(self) -> str:
        return f"{_percent(self.start)} to {_percent(self.stop)} of the path are left out: {self.reason}"


@dataclass(frozen=True, eq=False)
class SheetMotion(NoTruthValue, Value, ask="`.complete`"):
    """Joints along a path over several sheets; `s.follow(path)` makes one.

    Of all choices of sheets along the path, at its samples, this one has the fewest divisions, of these the fewest
    changes, of these the least seconds of joint motion.

    pieces: each on one sheet. seams: the changes between them, with the tool at rest. divisions: where the arm must
    leave the pose. left_out: what no sheet serves. parts: motions without a division, seams included.
    """

    path: Path
    pieces: tuple[SheetPiece, ...]
    seams: tuple[Seam, ...]
    divisions: tuple[Division, ...]
    left_out: tuple[UnservedPart, ...]
    parts: tuple[Trajectory, ...]

    @property
    def complete(self) -> bool:
        """Whether the whole path is served without a division."""
        return not self.divisions and not self.left_out

    @property
    def changes(self) -> int:
        """How often the sheet changes with the tool at rest."""
        return len(self.seams)

    @property
    def cuts(self) -> int:
        """How often the motion is interrupted: by a division, or by what is left out between two pieces."""
        return max(0, len(self.parts) - 1)

    @property
    def trajectory(self) -> Trajectory:
        """The motion along the whole path, seams included, for `hk.check`, `hk.retime` and robot programs.

        It has the path's own times, longer where a joint would exceed its speed limit; the tool rests at seams.

        Raises:
            PathError: the path is divided, or not served as a whole.
        """
        if self.complete:
            return self.parts[0]
        why = str((*self.left_out, *self.divisions)[0])
        cure = "take `.parts`, the motions without a division, or change the path, the sheets or the stops"
        first = self.parts[0] if self.parts else None
        raise PathError(f"the path is not followed as a whole: {why}", cure, first)

    @property
    def sentence(self) -> str:
        """How it came out, in words."""
        used = len({part.sheet for part in self.pieces})
        parts = [_count(used, "sheet"), _count(self.changes, "change"), _count(len(self.divisions), "division")]
        lost = sum(part.stop - part.start for part in self.left_out)
        sentence = f"{parts[0]}, {parts[1]}, {parts[2]}; {_percent(1 - lost)} of the path served"
        return (
            f"{sentence}; at these samples no choice among the sheets has fewer divisions, or as few and fewer changes"
        )

    def __str__(self) -> str:
        rows = [(part.start, f"  {part}") for part in (*self.pieces, *self.left_out)]
        rows += [(part.at, f"  {part}") for part in self.divisions]
        lines = [text for _, text in sorted(rows, key=lambda row: row[0])]
        return "\n".join([self.sentence, *lines, *(f"  change: {part}" for part in self.seams)])


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def _count(many: int, word: str) -> str:
    return f"{many} {word}{'' if many == 1 else 's'}"


# --- Which sheet to take on each part of a path: with the fewest divisions, then changes, then the least joint motion.

Cost = tuple[int, int, float]  # divisions, changes, seconds: compared in this order

# Seconds that going over to another sheet of the same posture counts, so that rounding does not decide: where parts
# of one leaf overlap, both have the same motion.
SWITCH = 1e-6


@dataclass(frozen=True, eq=False)
class SheetSequence(Value):
    """A sheet for each step of a path (k - 1,), -1 where none serves.

    divisions: places at which the arm must leave the tool's pose to go on. changes: places at which it changes its
    sheet with the tool still. seconds: of the joints' motion, at their speed limits.
    """

    sheets: Indices
    divisions: int
    changes: int
    seconds: float

    @property
    def turnings(self) -> list[tuple[int, int, int]]:
        """(sample, sheet before, sheet after) of each change and division between two steps that are served."""
        s = self.sheets
        samples = np.flatnonzero((s[:-1] != s[1:]) & (s[:-1] >= 0) & (s[1:] >= 0)) + 1
        return [(int(i), int(s[i - 1]), int(s[i])) for i in samples]


def fewest_changes(steps: Vector, served: Flags, change: Array, first: int | None = None) -> SheetSequence:
    """The best choice of sheets along a path, by dynamic programming over its samples.

    Of all choices that take a sheet on every step that one serves: the fewest divisions, of these the fewest changes,
    of these the least seconds.

    Args:
        steps: seconds of the joints on each sheet and step (S, k - 1).
        served: which sheet serves which step (S, k - 1).
        change: seconds of a change from a sheet to another at each sample (k, S, S); infinite where there is none, 0
            where both have one posture: then it is no change, and counts a microsecond.
        first: the sheet on which the arm stands at the first sample; None for any.
    """
    S, k = served.shape
    # Of each sheet the least cost so far, and from which one it came: -1 for none, from which every one is free.
    costs: dict[int, Cost] = {-1 if first is None else first: (0, 0, 0.0)}
    come = np.full((k, S + 1), -1)
    for i in range(k):
        after: dict[int, Cost] = {}
        for s in np.flatnonzero(served[:, i]).tolist() or [-1]:
            best, come[i, s] = min((_plus(cost, i, t, s, change), t) for t, cost in costs.items())
            after[s] = (best[0], best[1], best[2] + (float(steps[s, i]) if s >= 0 else 0.0))
        costs = after
    cost, s = min((cost, s) for s, cost in costs.items())
    chosen = np.empty(k, dtype=int)
    for i in range(k - 1, -1, -1):
        chosen[i], s = s, int(come[i, s])
    gaps = max(0, len(runs(np.asarray(chosen >= 0))) - 1)
    return SheetSequence(chosen, gaps + cost[0], cost[1], cost[2])


def _plus(cost: Cost, i: int, t: int, s: int, change: Array) -> Cost:
    """The cost of going on from sheet t to sheet s at sample i."""
    if t == s or -1 in (t, s):
        return cost
    seconds = float(change[i, t, s])
    if seconds == 0:
        return cost[0], cost[1], cost[2] + SWITCH
    return (cost[0], cost[1] + 1, cost[2] + seconds) if np.isfinite(seconds) else (cost[0] + 1, cost[1], cost[2])
