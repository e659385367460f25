"""`Coverage`: what one leaf reaches of a workspace, and what becomes of each other pose."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import brief
from ...base.files import write_csv
from ...base.types import Array, Flags, Indices, Matrix, NoTruthValue, Value, Vector, frozen
from ...motion.checks import Clear
from ...path.workspaces import Workspace

FAR_TURN = np.pi / 2
"""Turn [rad] from the tool at the start to the workspace's middle orientation from which on it is told: so far, wrists
use up most of their ranges."""

POSE_COLUMNS = ("x", "y", "z", "qx", "qy", "qz", "qw")
"""Columns of the pose in a file of coverage."""


class PoseStatus(NoTruthValue, IntEnum, ask="`is PoseStatus.REACHED`"):
    """What becomes of a tool pose on the straight path from the start; `text` says it in words."""

    REACHED = 0
    LIMIT = 1
    ALGORITHMIC = 2
    KINEMATIC = 3
    REPRESENTATION = 4
    STOPPED = 5
    BEYOND_LIMITS = 6
    OUT_OF_REACH = 7
    BLOCKED = 8

    @property
    def text(self) -> str:
        """The cause in words."""
        return _TEXTS[self]


_TEXTS = {
    PoseStatus.REACHED: "reached",
    PoseStatus.LIMIT: "a joint is beyond its limit on this leaf",
    PoseStatus.ALGORITHMIC: "the leaf ends before: the law is singular there, the arm is not",
    PoseStatus.KINEMATIC: "the leaf ends before: the arm is singular there",
    PoseStatus.REPRESENTATION: "the leaf ends before: a representation, the task's or the rule's, ends there",
    PoseStatus.STOPPED: "no path could be shown to keep to the leaf",
    PoseStatus.BEYOND_LIMITS: "every posture found is beyond the joint limits",
    PoseStatus.OUT_OF_REACH: "out of reach: no posture was found",
    PoseStatus.BLOCKED: "a link is too near to an obstacle, the floor or another link on this leaf",
}


@dataclass(frozen=True, eq=False)
class Reach(Value):
    """Which of k poses the arm reaches by any posture that was found: at all, and within its joint limits."""

    anyhow: Flags
    within: Flags


@dataclass(frozen=True, eq=False)
class Coverage(NoTruthValue, Value, ask="`.share` or `.reached`"):
    """What one leaf reaches of some tool poses (k, 4, 4).

    start, tool: the posture in which the robot begins (n,), and the tool pose there (4, 4).
    turn: from the tool there to the middle orientation of the workspace [rad]; 0 where the task leaves it free.
    status: a `PoseStatus` for each (k,).
    q: the leaf's posture (k, n), also where it is beyond a limit; a row of NaN where the leaf has none.
    last: where its path ended (k, n).
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
    q0: Vector
    tool: Matrix
    turn: float
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

    @typed
    def blocked(self, clear: Clear) -> Coverage:
        """The same without the poses whose posture does not keep clear of what stands round the robot."""
        status = self.status.copy()
        here = np.flatnonzero(self.reached)
        status[here[~clear(self.q[here])]] = PoseStatus.BLOCKED
        return replace(self, status=status)

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

    @typed
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
        k, within, size = int(self.reached.sum()), " within its limits" if self.limits else "", self.workspace.size
        whole = "" if size is None else ", all of the cloud," if size == len(self) else f", drawn from {size},"
        said = f"{self.name}: reaches {k} of {len(self)} poses ({self.share:.1%}){whole}{within}"
        if self.explained and self.reachable < 1:
            said += f", {'none' if not k else f'{self.share / self.reachable:.1%}'} of the "
            said += f"{round(self.reachable * len(self))} for which a posture was found"
        if not k:
            return said
        rcond = self.rcond[self.reached]
        said += f"; rcond at least {rcond.min():.2g}, median {np.median(rcond):.2g}"
        i = int(np.argmin(np.where(self.reached, self.margin, np.inf)))
        if np.isfinite(self.margin[i]):
            j = int(self.nearest[i])
            said += f"; {self.joint_names[j]} comes to {self.margin[i]:.2g} {self.joint_units[j]} from its limit"
        return said

    @property
    def remark(self) -> str:
        """A sentence on the middle orientation where that may be why poses are not reached; else empty."""
        if self.turn < FAR_TURN or self.reached.all():
            return ""
        return (
            f"The workspace's middle orientation is {np.degrees(self.turn):.0f} degrees from the tool at the start; "
            'rotation=robot.pose(q0)[:3, :3], in a job rotation = "start", takes that of the start.'
        )

    def __str__(self) -> str:
        width = len(str(len(self)))
        lines = [f"  {k:{width}d} ({k / len(self):5.1%})  {cause}" for cause, k in self.causes()]
        return "\n".join([brief(self.sentence, 1600), *lines, *filter(None, [self.remark])])

    @typed
    def save(self, path: str | Path) -> None:
        """Write CSV, a line a pose: x, y, z, qx, qy, qz, qw, status, the joints by name, rcond and the least margin.

        `read_workspace` reads the poses again.

        Raises:
            WriteError: the system refuses the file.
        """
        from scipy.spatial.transform import Rotation

        turns = Rotation.from_matrix(self.poses[:, :3, :3]).as_quat()
        rows = np.column_stack([self.poses[:, :3, 3], turns, self.q, self.rcond, self.margin]).tolist()
        words = [PoseStatus(status).name.lower() for status in self.status]
        header = [*POSE_COLUMNS, "status", *self.joint_names, "rcond", "margin"]
        write_csv(path, header, ([*row[:7], word, *row[7:]] for row, word in zip(rows, words, strict=True)))

    def summary(self) -> dict[str, Any]:
        """JSON-ready facts."""
        r = self.reached
        return {
            "name": self.name, "workspace": str(self.workspace), "poses": len(self), "share": self.share,
            "reachable": self.reachable if self.explained else None,
            "rcond": float(self.rcond[r].min()) if r.any() else None,
            "causes": dict(self.causes()), "turn": self.turn, "remark": self.remark,
        }  # fmt: skip
