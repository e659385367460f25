"""`coverage`: how much of a workspace one leaf reaches, how well, and why the rest is not reached."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from enum import IntEnum
from functools import cached_property
from itertools import combinations, product
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, ShapeError, brief
from ...base.files import write_csv
from ...base.progress import progress
from ...base.tolerances import TOLERANCES
from ...base.types import (
    Array,
    ArrayLike,
    Flags,
    Indices,
    Matrix,
    NoTruthValue,
    Result,
    Value,
    Vector,
    frozen,
    numbers,
    whole,
)
from ...motion.checks import Clear
from ...motion.ik import InverseStatus, ik, leaf_value
from ...motion.ik.inverse_function import ends_of_paths, leads_to
from ...motion.ik.leaf import leaf_step
from ...motion.self_motions.pose_reach import Reach, reach_of
from ...path.path import turn_between
from ...path.workspaces import PoseRange, Workspace, pose_cloud
from ...robot import start_posture
from ...strategies import HolonomicStrategy
from ...strategies.tasks.task import Task, of_one_tool
from .pose_coordinates import task_poses


class PoseStatus(NoTruthValue, IntEnum, ask="`is PoseStatus.REACHED`"):
    """What becomes of a tool pose on the straight path from the start; `text` says it in words."""

    text: str

    REACHED = 0, "reached"
    LIMIT = 1, "a joint is beyond its limit on this leaf"
    ALGORITHMIC = 2, "the strategy is singular on the way there, the arm is not"
    KINEMATIC = 3, "the arm is singular on the way there"
    REPRESENTATION = 4, "angles by which the task or the rule is written are not defined on the way there"
    STOPPED = 5, "no way there could be shown to be without a jump of the joints"
    BEYOND_LIMITS = 6, "every posture found is beyond the joint limits"
    OUT_OF_REACH = 7, "out of reach: no posture was found"
    BLOCKED = 8, "a link would be too near to an obstacle, the floor or another link"

    def __new__(cls, value: int, text: str) -> PoseStatus:
        """A status with its text."""
        status = int.__new__(cls, value)
        status._value_, status.text = value, text
        return status


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
    limits: whether joint limits were looked at. reach: by which posture the arm reaches each pose best, where the leaf
        does not; None where this was not asked: then no pose is called out of reach.
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
    reach: Reach | None

    def __len__(self) -> int:
        return len(self.status)

    @typed
    def blocked(self, clear: Clear) -> Coverage:
        """The same without the poses whose posture does not keep clear of what stands round the robot.

        Raises:
            ArgumentError: `clear` gives anything but a flag for each posture.
        """
        status, reached = self.status.copy(), np.flatnonzero(self.reached)
        flags = np.asarray(clear(self.q[reached]))
        if flags.dtype != bool or flags.shape != reached.shape:
            cure = "let it take postures (k, n) and return k flags"
            raise ArgumentError("the answer of clear", flags.tolist(), cure)
        status[reached[~flags]] = PoseStatus.BLOCKED
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
        """Share of the poses that some posture has, within the joint limits if these were looked at."""
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
        counts: Counter[tuple[str, str]] = Counter()
        for i in np.flatnonzero(self.status == PoseStatus.LIMIT):
            j = self.nearest[i]
            counts[self.joint_names[j], "lower" if self.q[i, j] < self.lower[j] else "upper"] += 1
        return dict(counts.most_common())

    def causes(self) -> list[tuple[str, int]]:
        """(what becomes of them, number of poses), for every cause that occurs; limits by joint."""
        rows: list[tuple[str, int]] = []
        for status in PoseStatus:
            if status is PoseStatus.LIMIT:
                rows += [(f"{joint} is beyond its {side} limit", k) for (joint, side), k in self.at_limits().items()]
            elif status in (PoseStatus.BEYOND_LIMITS, PoseStatus.OUT_OF_REACH) and self.reach is not None:
                out = "out of reach: " if status is PoseStatus.OUT_OF_REACH else ""
                obstacles = self.reach.obstacles(np.flatnonzero(self.status == status))
                rows += [(f"{out}{obstacle}", k) for obstacle, k in obstacles]
            elif self.count(status):
                rows.append((status.text, self.count(status)))
        return rows

    @property
    def sentence(self) -> str:
        """The share in one sentence, with the quality of what is reached."""
        k, within, size = int(self.reached.sum()), " within its limits" if self.limits else "", self.workspace.size
        drawn = "" if size is None else ", all of the cloud," if size == len(self) else f", drawn from {size},"
        facts = [f"{self.name}: reaches {k} of {len(self)} poses ({self.share:.1%}){drawn}{within}"]
        if self.reach is not None:
            reachable = round(self.reachable * len(self))
            if reachable < len(self):
                share = f"{self.share / self.reachable:.1%}" if k else "none"
                facts[0] += f", {share} of the {reachable} {'that the arm reaches' if self.reach.complete else FOUND}"
            if k < reachable:
                facts[0] += f"; other starts serve {reachable - k}"
        if k:
            rcond = self.rcond[self.reached]
            facts.append(f"rcond at least {rcond.min():.2g}, median {np.median(rcond):.2g}")
            i = int(np.argmin(np.where(self.reached, self.margin, np.inf)))
            if np.isfinite(self.margin[i]):
                j = int(self.nearest[i])
                facts.append(
                    f"{self.joint_names[j]} comes to {self.margin[i]:.2g} {self.joint_units[j]} from its limit"
                )
        return "; ".join(facts)

    @property
    def remark(self) -> str:
        """A sentence on the middle orientation where that may be why poses are not reached; else empty."""
        if self.turn < np.pi / 2 or self.reached.all():  # from a right angle on wrists use up most of their ranges
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
        header = [*["x", "y", "z", "qx", "qy", "qz", "qw", "status"], *self.joint_names, "rcond", "margin"]
        write_csv(path, header, ([*row[:7], word, *row[7:]] for row, word in zip(rows, words, strict=True)))

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready facts."""
        reached = self.reached
        return {
            "name": self.name,
            "workspace": str(self.workspace),
            "poses": len(self),
            "share": self.share,
            "reachable": None if self.reach is None else self.reachable,
            "rcond": float(self.rcond[reached].min()) if reached.any() else None,
            "causes": dict(self.causes()),
            "turn": self.turn,
            "remark": self.remark,
        }


FOUND = "for which a posture was found"
"""What is said of poses of which a search tells whether the arm reaches them."""

SAMPLES = 1024
"""Poses by default: shares of two known sets were then right to 0.3 % in a plane and 0.6 % in six dimensions (rms over
200 seeds), where random poses have 1.4 %."""


@typed
def coverage(
    strategy: HolonomicStrategy,
    workspace: Workspace,
    q0: ArrayLike,
    *,
    samples: int | None = None,
    seed: int = 0,
    limits: bool = True,
    explain: bool = True,
    reach: Reach | None = None,
) -> Coverage:
    """How much of a workspace the leaf through a posture reaches, and why the rest is not reached.

    Each pose is gone to on the straight path from the tool pose at q0, as `ik` does. Where the leaf does not get
    there within the limits, the other postures of the arm are looked at: so it shows whether the strategy fails there
    or no strategy can serve, and which joint's limit is in the way. They are all postures of whole poses of arms with
    six or seven joints; else a search by least squares finds some. A workspace that is out of reach altogether has
    the share 0.

    A task of positions looks at the positions of the poses alone.

    Args:
        samples: poses; by default 1024, or all those of a cloud.
        seed: of the poses, see `Workspace.poses`.
        limits: False leaves joint limits aside.
        explain: False does not look at other postures: faster, and no pose is called out of reach.
        reach: of the same poses, as `posture_reach` gives it, to spare looking again.

    Raises:
        JointLimitError: q0 is beyond its limits, unless limits is False. SingularityError: the strategy is singular
            there.
        ArgumentError: a strategy without leaves; rotations out of the plane for the pose task of a planar robot.
        ShapeError, NotFiniteError.
    """
    # The poses
    task, robot = strategy.task, strategy.task.robot
    of_one_tool(task, "coverage")
    start = start_posture(robot, q0, limits)
    poses = task_poses(task, workspace, samples if samples is not None else workspace.size or SAMPLES, seed)
    if reach is not None and len(reach.within) != len(poses):
        raise ShapeError("the reach", (len(poses),), reach.within.shape, "give that of the same poses")
    _check_planar(task, start, poses)
    # Where the leaf leads at each of them, on the straight path from the start
    q, last, ends = _on_straight_paths(strategy, start, poses, limits)
    on_leaf = np.isin(ends, (InverseStatus.REACHED, InverseStatus.LIMIT))
    rcond, margins = np.full(len(poses), np.nan), np.full(q.shape, np.nan)
    if on_leaf.any():
        rcond[on_leaf] = strategy.gain.batch(q[on_leaf])[1]
        margins[on_leaf] = np.minimum(q[on_leaf] - robot.lower, robot.upper - q[on_leaf])
    status = np.where(on_leaf, PoseStatus.REACHED, PoseStatus.STOPPED).astype(int)
    if limits:
        status[on_leaf & (margins < -TOLERANCES.limit).any(axis=1)] = PoseStatus.LIMIT
    ended = np.flatnonzero(~on_leaf)
    status[ended] = _endings(strategy, poses[ended], last[ended], ends[ended])
    # Whether any other posture would reach the rest
    rest = status != PoseStatus.REACHED
    if explain and reach is None:
        best, near = q.copy(), np.where(np.isfinite(last[rest]), last[rest], start)
        of_rest = reach_of(task, poses[rest, :3, 3], poses[rest, :3, :3], near, limits=limits)
        best[rest] = of_rest.q
        reach = Reach(robot, best, of_rest.complete)
    if explain and reach is not None:
        reach = Reach(robot, np.where(reach.anyhow[:, None], reach.q, q), reach.complete)
        status[rest & ~(reach.within if limits else reach.anyhow)] = PoseStatus.BEYOND_LIMITS
        status[rest & ~reach.anyhow & ~on_leaf] = PoseStatus.OUT_OF_REACH
    # The turn to the middle orientation is 0 for given poses, and where the task leaves it free
    tool, turn = task.pose(start), 0.0
    if isinstance(workspace, PoseRange) and any(row >= 3 for row in task.rows):
        turn = float(np.linalg.norm(turn_between(tool[:3, :3], workspace.rotation)))
    units = tuple("rad" if hinge else "m" for hinge in robot.hinges)
    return Coverage(
        name=strategy.name, workspace=workspace, joint_names=robot.joint_names, joint_units=units, lower=robot.lower,
        upper=robot.upper, q0=start, tool=tool, turn=turn, poses=poses, status=status, q=q, last=last, rcond=rcond,
        margins=margins, limits=limits, reach=reach if explain else None,
    )  # fmt: skip


def _on_straight_paths(
    strategy: HolonomicStrategy, q0: Vector, poses: Array, limits: bool
) -> tuple[Matrix, Matrix, Indices]:
    """Where the leaf through a posture leads at poses (k, 4, 4): its postures (k, n), also those beyond a limit, NaN
    where there is none; where its paths end (k, n); statuses."""
    solver, parts, piece = ik(strategy, q0, limits), [], 256
    with progress(f"coverage: {strategy.name}", len(poses)) as report:
        for first in range(0, len(poses), piece):
            parts.append(ends_of_paths(solver, poses[first : first + piece]))
            report(min(first + piece, len(poses)))
    last, status = (np.concatenate(part) for part in zip(*parts, strict=True))
    on_leaf = np.isin(status, (InverseStatus.REACHED, InverseStatus.LIMIT))
    return np.where(on_leaf[:, None], last, np.nan), last, status


@typed
def posture_reach(task: Task, workspace: Workspace, near: ArrayLike, *, samples: int = SAMPLES, seed: int = 0) -> Reach:
    """Which poses of a workspace the arm reaches by any posture: for several calls of `coverage` with the same poses.

    Args:
        near: the posture from which a search begins, where not all postures are known.

    Raises:
        ShapeError, NotFiniteError, ArgumentError.
    """
    of_one_tool(task, "coverage")
    poses = task_poses(task, workspace, samples, seed)
    begin = task.robot.checked(near, "the posture to begin from")
    return reach_of(task, poses[:, :3, 3], poses[:, :3, :3], np.tile(begin, (len(poses), 1)))


def _endings(strategy: HolonomicStrategy, poses: Array, last: Matrix, ends: Indices) -> Indices:
    """Why the paths to some poses ended at some postures."""
    status = np.full(len(last), int(PoseStatus.STOPPED))
    known = np.flatnonzero(np.isfinite(last).all(axis=1))
    if not len(known):
        return status
    # The arm is singular where the singular values of J, in m and rad as they come, are over 1,000 times apart: in a
    # Panda's box the ratio was 5e-4 at most where it is stretched, and 4e-3 at least where a strategy alone is singular
    s = np.linalg.svd(strategy.task.jacobian_batch(last[known])[0], compute_uv=False)
    kind = np.where(s[:, -1] > 1e-3 * s[:, 0], PoseStatus.ALGORITHMIC, PoseStatus.KINEMATIC)
    undefined = strategy.gain.batch(last[known])[2] < 2 * TOLERANCES.representation
    kind = np.where(undefined, PoseStatus.REPRESENTATION, kind)
    # The leaf ends there, or folds just behind
    singular = undefined | np.isin(ends[known], (InverseStatus.LEAF_ENDS, InverseStatus.SINGULAR))
    for i in np.flatnonzero(~singular):
        singular[i] = _folds(strategy, poses[known[i]], last[known[i]])
    status[known[singular]] = kind[singular]
    return status


def _folds(strategy: HolonomicStrategy, pose: Matrix, q: Vector) -> bool:
    """Whether det [J; J_g] changes its sign just behind a posture, on the way to a pose: [J; J_g] is singular there.

    It may be regular beside that place, where two sheets of a leaf cross.
    """
    gain, step, level = strategy.gain(q)[0], leaf_step(strategy), leaf_value(strategy, q)
    dq = np.reshape(gain, (len(q), -1)) @ strategy.task.error(q, pose[:3, 3], pose[:3, :3])
    size = float(np.abs(dq).max())
    if not 0 < size < np.inf:
        return False
    # Ways end nearer to a singularity than 1e-6 joint units
    before, behind = (step(p, pose[:3, 3], pose[:3, :3], level)[3] for p in (q, q + 1e-6 / size * dq))
    return bool(before * behind < 0)


def _check_planar(task: Task, q0: Vector, poses: Array) -> None:
    """Raises: ArgumentError where the tool of a planar robot would have to leave its plane."""
    if not task.robot.planar or all(row < 3 for row in task.rows):
        return
    R = task.pose(q0)[:3, :3]
    if np.abs(poses[:, :3, :3] @ R.T - np.eye(3))[:, 2, 2].max() > 1e-6:
        cure = "the tool of a planar robot turns in its plane: give rotation=np.eye(3) (or the tool's own) and no tilt"
        raise ArgumentError("the rotation of a pose of the workspace", poses[0, :3, :3].tolist(), cure)


# --- Slices: what a leaf reaches in the planes through a workspace's centre, at the middle orientation of the tool.


@dataclass(frozen=True, eq=False)
class Slice(Result, Value):
    """Coverage on a grid of positions in a plane through a workspace's centre.

    cuts (c, 2): neighbouring cells, by their place among the poses of `coverage`, between which `ik(pose)` jumps: the
    leaf, followed straight from the one's posture to the other's pose, has other joints there, or ends before.

    axes: the two axes, 0, 1, 2 for x, y, z, that span it; at: where it cuts the third [m]; u (columns,), v (rows,): the
    positions along them [m]; inside (rows, columns): which cells belong to the workspace; coverage: of these, by rows.
    """

    axes: tuple[int, int]
    at: float
    u: Vector
    v: Vector
    inside: Flags
    coverage: Coverage
    cuts: Indices

    def grid(self, values: ArrayLike) -> Array:
        """Numbers of the poses (k,) in their cells (rows, columns), NaN outside. Raises: ShapeError, ArgumentError."""
        given, count = numbers("the numbers of the poses", values), int(self.inside.sum())
        if given.shape != (count,):
            raise ShapeError("the numbers of the poses", (count,), given.shape)
        cells = np.full(self.inside.shape, np.nan)
        cells[self.inside] = given
        return cells

    def __str__(self) -> str:
        i, j = self.axes
        plane = f"{'xyz'[i]}-{'xyz'[j]} at {'xyz'[3 - i - j]} = {self.at:.4g} m"
        return f"{self.coverage.share:.1%} of the plane {plane} is reached, with {len(self.cuts)} jumps between cells"


@dataclass(frozen=True, eq=False)
class Plane(Value):
    """A grid of positions in a plane through a workspace, as of a `Slice`; points (rows * columns, 3)."""

    axes: tuple[int, int]
    at: float
    u: Vector
    v: Vector
    points: Matrix
    inside: Flags


def grid_planes(workspace: PoseRange, steps: int) -> Iterator[Plane]:
    """The planes x-y, x-z and y-z; of a flat one only its own. steps: cells along the longest side, at least 2."""
    whole("steps", steps, 2)
    for axes in combinations(np.flatnonzero(workspace.solid.half > 0).tolist(), 2):
        yield plane_through(workspace, axes, steps, workspace.solid.center)


def plane_through(workspace: PoseRange, axes: tuple[int, int], steps: int, place: Vector) -> Plane:
    """The plane along two axes through a place (3,) of a workspace."""
    solid, (i, j) = workspace.solid, axes
    half, center = solid.half, solid.center
    counts = np.maximum(2, np.rint(steps * half[[i, j]] / half.max())).astype(int)
    u, v = (center[k] + half[k] * (2 * (np.arange(n) + 0.5) / n - 1) for k, n in zip((i, j), counts, strict=True))
    points = np.tile(place, (len(u) * len(v), 1))
    points[:, i], points[:, j] = np.tile(u, len(v)), np.repeat(v, len(u))
    return Plane((i, j), float(place[3 - i - j]), u, v, points, solid.contains(points).reshape(len(v), len(u)))


@typed
def coverage_slices(
    strategy: HolonomicStrategy, workspace: PoseRange, q0: ArrayLike, *, steps: int = 31, limits: bool = True
) -> tuple[Slice, ...]:
    """Coverage of the planes x-y, x-z and y-z through a workspace's centre; of a flat one only of its plane.

    Args:
        steps: cells along the longest side, at least 2; they are squares, or nearly. 31 are pixels of two millimetres
            in a picture on a page.

    Raises:
        JointLimitError, SingularityError, ArgumentError, ShapeError, NotFiniteError: as `coverage`.
    """
    slices: list[Slice] = []
    for plane in grid_planes(workspace, steps):
        cells = pose_cloud(workspace.at(plane.points[plane.inside.ravel()]), f"a slice of {workspace}")
        covered = coverage(strategy, cells, q0, limits=limits)
        cuts = _cuts(strategy, plane.inside, covered)
        slices.append(Slice(plane.axes, plane.at, plane.u, plane.v, plane.inside, covered, cuts))
    return tuple(slices)


def neighbouring_cells(inside: Flags) -> Indices:
    """Pairs (e, 2) of neighbouring cells of a grid (rows, columns), by their place among those that are inside."""
    place = np.full(inside.shape, -1)
    place[inside] = np.arange(int(inside.sum()))
    sides = [(place[:, :-1], place[:, 1:]), (place[:-1], place[1:])]
    pairs = np.concatenate([np.column_stack([a.ravel(), b.ravel()]) for a, b in sides])
    return pairs[(pairs >= 0).all(axis=1)]


def _cuts(strategy: HolonomicStrategy, inside: Flags, covered: Coverage) -> Indices:
    """Pairs (c, 2) of neighbouring cells, both with a posture, that no straight path on the leaf joins.

    It is looked whether a path joins them where the joints differ by more than 0.2.
    """
    pairs = neighbouring_cells(inside)
    apart = np.abs(covered.q[pairs[:, 0]] - covered.q[pairs[:, 1]]).max(axis=1)  # NaN where there is no posture
    solver, poses, q = ik(strategy, covered.q0, limits=False), covered.poses, covered.q
    far = pairs[apart > 0.2]
    return far[[not leads_to(solver, poses[j], q[i], q[j]) for i, j in far]]


# --- The largest part of a workspace, round its centre, that a strategy serves from end to end.


def largest_part(
    workspace: PoseRange, poses: Array, known: Flags, serves: Callable[[Array], bool]
) -> tuple[float, PoseRange] | None:
    """(share of its sizes, the part): positions shrunk about the centre, turns kept; both shrunk if these do not allow
    any positions. None where not even that leaves a part.

    Args:
        known: which of some of its poses (k, 4, 4) are served (k,). serves: whether all of other poses are.
    """
    corners = np.array(list(product((0.0, 1.0), repeat=3)))

    def drawn(part: PoseRange, seed: int) -> bool:
        """Whether 128 even poses are served, and the corners of a box with the middle orientation."""
        return serves(np.concatenate([part.poses(128, seed), part.at(part.solid.points(corners))]))

    for turns_too in (False, True):
        # Seven halvings make the share right to 1 %: by the poses that are known, which say nothing of fewer turns
        low, high = 0.0, 1.0
        for _ in range(7):
            middle = (low + high) / 2
            part = _shrunk(workspace, middle, turns_too)
            fits = drawn(part, 0) if turns_too else known[part.solid.contains(poses[:, :3, 3])].all()
            low, high = (middle, high) if fits else (low, middle)
        # Poses drawn anew confirm it, or it shrinks; below a twentieth of the sides a part is of no use
        while low > 0.05:
            part = _shrunk(workspace, low, turns_too)
            if drawn(part, 1):
                return low, part
            low *= 0.95
    return None


def _shrunk(workspace: PoseRange, share: float, turns_too: bool) -> PoseRange:
    """A workspace whose positions, and its turns as well if asked for, reach only so far from its centre."""
    solid = workspace.solid
    lengths = {f.name: share * getattr(solid, f.name) for f in fields(solid) if f.name != "center"}
    turns = {"tilt": share * workspace.tilt, "spin": share * workspace.spin} if turns_too else {}
    return replace(workspace, solid=replace(solid, **lengths), **turns)
