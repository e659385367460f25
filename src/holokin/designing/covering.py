"""`coverage`: how much of a workspace one leaf reaches, how well, and why the rest is not reached."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np

from ..arguments import typed
from ..errors import ArgumentError, ShapeError, brief
from ..motion import InverseStatus, inverse
from ..motion.reach import nearest_postures
from ..progress import progress
from ..strategies import HolonomicStrategy
from ..task import Task
from ..tolerances import TOLERANCES
from ..types import Array, ArrayLike, Flags, Indices, Matrix, Value, Vector, frozen
from ..workspaces import PoseCloud, Workspace

SAMPLES = 1024
"""Poses by default: a share is then right to about 1 %, since even points do better than the 1.5 % of random ones."""

PIECE = 256
"""Poses between two reports of progress."""

KINEMATIC = 1e-3
"""Smallest over largest singular value of J, in the robot's own units, below which an arm that stops is singular
itself."""


class PoseStatus(IntEnum):
    """What becomes of a tool pose on the straight way from the start; `text` says it in words."""

    REACHED = 0
    LIMIT = 1
    ALGORITHMIC = 2
    KINEMATIC = 3
    REPRESENTATION = 4
    STOPPED = 5
    BEYOND_LIMITS = 6
    OUT_OF_REACH = 7

    @property
    def text(self) -> str:
        """The cause in words."""
        return _TEXTS[self]


_TEXTS = {
    PoseStatus.REACHED: "reached",
    PoseStatus.LIMIT: "a joint is beyond its limit on this leaf",
    PoseStatus.ALGORITHMIC: "the leaf ends before: the law is singular there, the arm is not",
    PoseStatus.KINEMATIC: "the leaf ends before: the arm is singular there",
    PoseStatus.REPRESENTATION: "a representation is singular on the way",
    PoseStatus.STOPPED: "no way could be shown to keep to the leaf",
    PoseStatus.BEYOND_LIMITS: "every posture found is beyond the joint limits",
    PoseStatus.OUT_OF_REACH: "out of reach: no posture was found",
}


@dataclass(frozen=True, eq=False)
class Reach(Value):
    """Which of k poses the arm reaches by any posture that was found: at all, and within its joint limits."""

    anyhow: Flags
    within: Flags


@dataclass(frozen=True, eq=False)
class Coverage(Value):
    """What one leaf reaches of some tool poses (k, 4, 4).

    status: a `PoseStatus` for each (k,).
    q: the leaf's posture (k, n), also where it is beyond a limit; a row of NaN where the leaf has none.
    last: where its way ended (k, n).
    rcond: of [J; J_g] at q (k,), NaN where there is none.
    margins: from q to the nearer limit of each joint (k, n) [joint units]: negative beyond it, inf without limits.
    limits: whether joint limits were looked at. explained: whether other postures were searched for where the leaf
        fails; without, no pose is called out of reach.
    """

    name: str
    workspace: Workspace
    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]
    lower: Vector
    upper: Vector
    start: Vector
    poses: Array
    status: Indices
    q: Matrix
    last: Matrix
    rcond: Vector
    margins: Matrix
    limits: bool
    explained: bool

    def __len__(self) -> int:
        return len(self.status)

    @property
    def reached(self) -> Flags:
        """True where the pose is reached (k,)."""
        return self.status == PoseStatus.REACHED

    @property
    def share(self) -> float:
        """Share of the poses that is reached."""
        return float(self.reached.mean())

    @property
    def reachable(self) -> float:
        """Share of the poses that any posture found reaches, within the joint limits if these were looked at."""
        return float((self.status < PoseStatus.BEYOND_LIMITS).mean())

    @cached_property
    def nearest(self) -> Indices:
        """The joint that is nearest to a limit, or farthest beyond it, as a share of its range (k,)."""
        span = self.upper - self.lower
        shares = self.margins / np.where(np.isfinite(span), span, 2 * np.pi)
        return frozen(np.argmin(np.where(np.isfinite(shares), shares, np.inf), axis=1))

    @cached_property
    def margin(self) -> Vector:
        """The margin of that joint (k,) [joint units]; inf where no joint has limits, NaN where there is no posture."""
        return frozen(self.margins[np.arange(len(self)), self.nearest])

    def count(self, status: PoseStatus) -> int:
        """How many poses have a status."""
        return int((self.status == status).sum())

    def at_limits(self) -> dict[tuple[str, str], int]:
        """(joint, "lower" or "upper") -> poses at which it is the one farthest beyond its limit, most first."""
        found: dict[tuple[str, str], int] = {}
        for i in np.flatnonzero(self.status == PoseStatus.LIMIT):
            j = self.nearest[i]
            side = "lower" if self.q[i, j] < self.lower[j] else "upper"
            key = (self.joint_names[j], side)
            found[key] = found.get(key, 0) + 1
        return dict(sorted(found.items(), key=lambda item: -item[1]))

    def causes(self) -> list[tuple[str, int]]:
        """(what becomes of them, number of poses), for every cause that occurs; limits by joint."""
        rows: list[tuple[str, int]] = []
        for status in PoseStatus:
            if status is PoseStatus.LIMIT:
                rows += [(f"{joint} is beyond its {side} limit", k) for (joint, side), k in self.at_limits().items()]
            elif self.count(status):
                rows.append((status.text, self.count(status)))
        return rows

    @property
    def sentence(self) -> str:
        """The share in one sentence, with the quality of what is reached."""
        k, within = int(self.reached.sum()), " within its limits" if self.limits else ""
        said = f"{self.name}: reaches {k} of {len(self)} poses ({self.share:.1%}){within}"
        if self.explained and self.reachable < 1:
            said += f", {'none' if not k else f'{self.share / self.reachable:.1%}'} of the "
            said += f"{round(self.reachable * len(self))} that any posture reaches"
        if not k:
            return said
        rcond = self.rcond[self.reached]
        said += f"; rcond {rcond.min():.2g} at least, {np.median(rcond):.2g} in the middle"
        i = int(np.argmin(np.where(self.reached, self.margin, np.inf)))
        if np.isfinite(self.margin[i]):
            j = int(self.nearest[i])
            said += f"; {self.joint_names[j]} comes to {self.margin[i]:.2g} {self.joint_units[j]} from its limit"
        return said

    def __str__(self) -> str:
        width = len(str(len(self)))
        lines = [f"  {k:{width}d} ({k / len(self):5.1%})  {cause}" for cause, k in self.causes()]
        return "\n".join([brief(self.sentence, 1600), *lines])

    def summary(self) -> dict[str, Any]:
        """JSON-ready facts."""
        r = self.reached
        return {
            "name": self.name, "workspace": str(self.workspace), "poses": len(self), "share": self.share,
            "reachable": self.reachable if self.explained else None,
            "rcond": float(self.rcond[r].min()) if r.any() else None,
            "causes": dict(self.causes()),
        }  # fmt: skip


@typed
def coverage(
    strategy: HolonomicStrategy,
    q0: ArrayLike,
    workspace: Workspace,
    *,
    samples: int | None = None,
    seed: int = 0,
    limits: bool = True,
    explain: bool = True,
    reach: Reach | None = None,
) -> Coverage:
    """How much of a workspace the leaf through a posture reaches, and why the rest is not reached.

    Each pose is gone to on the straight way from the tool pose at q0, as `inverse` does. Where the leaf does not get
    there within the limits, other postures of the arm are searched for, by least squares from random postures: so it
    shows whether the law fails there or no law can serve. A workspace that is out of reach altogether has the share 0.

    A task of positions looks at the positions of the poses alone.

    Args:
        samples: poses; by default 1024, or all those of a cloud.
        seed: of the poses, see `Workspace.poses`.
        limits: False leaves joint limits aside.
        explain: False does not search for other postures: faster, and no pose is called out of reach.
        reach: of the same poses, as `posture_reach` found it, to spare the search.

    Raises:
        JointLimitError: q0 is beyond its limits, unless limits is False. SingularityError: the law is singular there.
        ArgumentError: a strategy without leaves; rotations out of the plane for the pose task of a planar robot.
        ShapeError, NotFiniteError.
    """
    task, robot = strategy.task, strategy.task.robot
    start = robot.checked(q0, "the start posture")
    if limits:
        robot.check_limits(start)
    ik = inverse(strategy, start)
    count = samples if samples is not None else len(workspace.given) if isinstance(workspace, PoseCloud) else SAMPLES
    poses = workspace.poses(count, seed)
    _check_planar(task, start, poses)
    q, last, found = np.empty((len(poses), task.n)), np.empty((len(poses), task.n)), np.empty(len(poses), dtype=int)
    with progress(f"coverage: {strategy.name}", len(poses)) as report:
        for first in range(0, len(poses), PIECE):
            some = slice(first, first + PIECE)
            solutions = ik.batch(poses[some])
            q[some], last[some], found[some] = solutions.q, solutions.last, solutions.status
            report(first + len(solutions.status))
    on_leaf = found == InverseStatus.REACHED
    rcond, margins = np.full(len(poses), np.nan), np.full(q.shape, np.nan)
    if on_leaf.any():
        rcond[on_leaf] = strategy.gain.batch(q[on_leaf])[1]
        margins[on_leaf] = np.minimum(q[on_leaf] - robot.lower, robot.upper - q[on_leaf])
    status = np.where(on_leaf, PoseStatus.REACHED, PoseStatus.STOPPED).astype(int)
    if limits:
        status[on_leaf & (margins < -TOLERANCES.limit).any(axis=1)] = PoseStatus.LIMIT
    ended = np.flatnonzero(~on_leaf)
    status[ended] = _endings(strategy, last[ended], found[ended])
    if explain:
        rest = np.flatnonzero(status != PoseStatus.REACHED)
        if reach is None:
            near = np.where(np.isfinite(last[rest]), last[rest], start)
            known = _search(task, poses[rest], near, limits)
        elif len(reach.within) != len(poses):
            raise ShapeError("the reach", (len(poses),), reach.within.shape, "give that of the same poses")
        else:
            known = Reach(reach.anyhow[rest], reach.within[rest])
        status[rest[~(known.within if limits else known.anyhow)]] = PoseStatus.BEYOND_LIMITS
        status[rest[~known.anyhow & ~on_leaf[rest]]] = PoseStatus.OUT_OF_REACH
    units = tuple("rad" if hinge else "m" for hinge in robot.hinges)
    return Coverage(
        strategy.name, workspace, robot.joint_names, units, robot.lower, robot.upper, start, poses, status, q, last,
        rcond, margins, limits, explain,
    )  # fmt: skip


@typed
def posture_reach(task: Task, workspace: Workspace, near: ArrayLike, *, samples: int = SAMPLES, seed: int = 0) -> Reach:
    """Which poses of a workspace the arm reaches by any posture: for several calls of `coverage` with the same poses.

    By least squares from a posture and from 64 random ones a pose; a pose that none of these leads to may still be
    reachable.

    Raises:
        ShapeError, NotFiniteError, ArgumentError.
    """
    poses = workspace.poses(samples, seed)
    begin = task.robot.checked(near, "the posture to begin from")
    return _search(task, poses, np.tile(begin, (len(poses), 1)), True)


def _search(task: Task, poses: Array, near: Matrix, limits: bool) -> Reach:
    p, R = poses[:, :3, 3], poses[:, :3, :3]
    anyhow = nearest_postures(task, p, R, near, limits=False).reached
    within = anyhow.copy()
    if limits and anyhow.any():
        within[anyhow] = nearest_postures(task, p[anyhow], R[anyhow], near[anyhow], limits=True).reached
    return Reach(anyhow, within)


def _endings(strategy: HolonomicStrategy, last: Matrix, found: Indices) -> Indices:
    """Why the ways ended at some postures."""
    status = np.full(len(last), int(PoseStatus.STOPPED))
    ends = np.flatnonzero(np.isin(found, (InverseStatus.LEAF_ENDS, InverseStatus.SINGULAR)))
    if not len(ends):
        return status
    s = np.linalg.svd(strategy.task.jacobian_batch(last[ends])[0], compute_uv=False)
    margin = strategy.gain.batch(last[ends])[2]
    kind = np.where(s[:, -1] > KINEMATIC * s[:, 0], PoseStatus.ALGORITHMIC, PoseStatus.KINEMATIC)
    status[ends] = np.where(margin > TOLERANCES.representation, kind, PoseStatus.REPRESENTATION)
    return status


def _check_planar(task: Task, start: Vector, poses: Array) -> None:
    """Raises: ArgumentError where the tool of a planar robot would have to leave its plane."""
    if not task.robot.planar or all(row < 3 for row in task.rows):
        return
    R = task.robot.pose(start, task.tip)[:3, :3]
    if np.abs(poses[:, :3, :3] @ R.T - np.eye(3))[:, 2, 2].max() > 1e-6:
        cure = "the tool of a planar robot turns in its plane: give rotation=np.eye(3) (or the tool's own) and no tilt"
        raise ArgumentError("the rotation of a pose of the workspace", poses[0, :3, :3].tolist(), cure)
