"""What a page is told: states of strategies and session, traces, clouds, cusps, verdicts, as frozen values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...analysis.coverage import Coverage, coverage
from ...analysis.curvature import around, curvature, involutivity
from ...analysis.design.nearby_cusps import NearbyCusps, cusps_near
from ...base.errors import HolokinError
from ...base.types import Array, ArrayLike, Flags, Matrix, Value, Vector
from ...base.units import SI, PrintedUnits
from ...motion.drift_and_spread import NO_DRIFT
from ...motion.ik.leaf import leaf_value
from ...path.workspaces import Workspace, pose_cloud, workspace
from ...robot import Robot
from ...strategies import HolonomicStrategy, Strategy
from ...strategies.tasks.task import Task
from ..report.plots import law_colors


@dataclass(frozen=True, eq=False)
class Origin(Value):
    """What a job says of the robot and the task of a session, and the folder from which files are named."""

    robot: Mapping[str, Any]
    task: Mapping[str, Any]
    folder: FilePath


class StrategyStatus(Enum):
    """How a strategy stands to its target; the text says it in a few words."""

    FOLLOWING = "following"
    OUT_OF_REACH = "out of reach"
    SINGULAR = "singular"
    LIMIT = "joint limit"
    STOPPED = "stopped"


class CloudStatus(Enum):
    """How far a coverage has got."""

    RUNNING = "running"
    DONE = "done"
    CANCELLED = "cancelled"
    FAILED = "failed"


class Phase(Enum):
    """What a session is doing."""

    IDLE = "idle"
    GATHERING = "gathering"
    RUNNING = "running"
    PAUSED = "paused"
    DONE = "done"


@dataclass(frozen=True, eq=False)
class Judgement(Value):
    """What is known of a strategy at a posture, found in the background.

    holonomic and sentence as of `hk.involutivity` about the start, None where that could not be found; `curvature`:
    the largest |F_ij| of `hk.curvature` at the posture q (n,), drift over the area of a small loop
    [joint unit / task unit^2].
    """

    holonomic: bool | None
    sentence: str
    curvature: float
    q: Vector


@dataclass(frozen=True, eq=False)
class StrategyState:
    """One strategy at one instant.

    Attributes:
        name, holonomic: as of `NamedStrategy`.
        q: joints (n,) [rad, m].
        status, sentence: whether it follows, and else why not and what helps, in one sentence; empty while it follows.
        rcond: how near it is to singular, 1 good, 0 singular; NaN of a control law.
        level: g(q) (r,) of a holonomic strategy; empty for others.
        drift: largest joint's distance from the loop's start posture after 1, 2, ... cycles (cycles,), as of
            `hk.drift(...).largest`; NaN from a cycle on in which the strategy had stopped.
        drift_joints: the same joint by joint (cycles, n), signed.
        t, history: instants (k,) [s] and joints (k, n) of the loop since it began, the latest ones.
        judgement: None until it is known, and of control laws.
    """

    name: str
    holonomic: bool
    q: Vector
    status: StrategyStatus
    sentence: str
    rcond: float
    level: Vector
    drift: Vector
    drift_joints: Matrix
    t: Vector
    history: Matrix
    judgement: Judgement | None = None

    @property
    def following(self) -> bool:
        """True while its tool is at the target."""
        return self.status is StrategyStatus.FOLLOWING

    @property
    def repeatable(self) -> bool | None:
        """Whether small closed paths of the tool bring the joints back, by leaves or verdict; None if not known."""
        return True if self.holonomic else None if self.judgement is None else self.judgement.holonomic


def colors_of(states: Sequence[StrategyState]) -> tuple[str, ...]:
    """The colour of each strategy, as in reports: by whether it is holonomic, as far as that is known."""
    return law_colors([bool(state.repeatable) for state in states])


@dataclass(frozen=True, eq=False)
class Cloud:
    """How far a coverage has got, and what it found, ready to be drawn.

    Attributes:
        strategy: its name. done, total: poses looked at, of how many.
        status: whether it goes on; `sentence` says why it failed, else empty.
        points: positions (k, 3) [m] of the poses looked at. reached: (k,).
        margin: (k,) least distance to a joint limit over half the joint's range, 1 in the middle, 0 at a limit; NaN
            where it is not reached.
    """

    strategy: str
    done: int
    total: int
    status: CloudStatus
    sentence: str
    points: Matrix
    reached: Flags
    margin: Vector


@dataclass(frozen=True, eq=False)
class LeafCusps:
    """Cusps of the leaf on which a strategy stood when they were asked for, ready to be drawn.

    Attributes:
        strategy: its name. level: g(q) = c (r,) of the leaf. running: whether they are still looked for.
        sentence: what was found, or why none were looked for.
        place: position (3,) [m] of the tool at the nearest one, None where there is none.
        loop: points (k, 3) [m] of the smallest tool loop found that does not bring the joints back; none where k is 0.
    """

    strategy: str
    level: Vector
    running: bool
    sentence: str
    place: Vector | None
    loop: Matrix


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A session at one instant: all that a page draws. It never changes, and any thread may read it.

    Attributes:
        number: counts the changes of the session; two snapshots with one number are equal.
        phase: idle, gathering (the joints move to where the loop begins), running, paused, done.
        strategies: the state of each, in order.
        target: where the tool is wanted, (F, 4, 4), a pose of each frame of the task; F is 1 but for tasks of several.
        loop: how many times `Session.set_loop` was called; the curve is to be drawn again when it changes.
        progress: share of the cycle that is done, 0 to 1. cycle: complete cycles.
        cycles: after which the loop ends, None for never. clockwise: the other way round.
        message: one sentence on the session as a whole, such as why a loop cannot begin; empty if all is well.
        cloud: the coverage, if one was asked for. cusps: those of a leaf, if they were asked for.
        loop_fault: the first strategy that does not get round the loop, and why; empty until it is known, or if all do.
        fault: what failed in the background; empty if nothing did.
    """

    number: int
    phase: Phase
    strategies: tuple[StrategyState, ...]
    target: Array
    loop: int
    progress: float
    cycle: int
    cycles: int | None
    clockwise: bool
    message: str
    cloud: Cloud | None = None
    cusps: LeafCusps | None = None
    loop_fault: str = ""
    fault: str = ""

    def strategy(self, name: str) -> StrategyState:
        """The state of a strategy by name."""
        return next(state for state in self.strategies if state.name == name)

    @property
    def following(self) -> bool:
        """True where every strategy follows."""
        return all(state.following for state in self.strategies)


# samples that are kept; when they are full every second one is dropped, so that a plot shows all of a long run
ROWS = 4096  # samples that are kept


class History:
    """Instants and joints; when they are full every second sample is dropped, so that a plot shows all of a long run.

    What was shown is never written to again, so views of it stay true.
    """

    def __init__(self, joints: int, rows: int = ROWS) -> None:
        self._t, self._q = np.empty(rows), np.empty((rows, joints))
        self._count, self._seen, self._every = 0, 0, 1

    def add(self, t: Vector, q: Matrix) -> None:
        """Samples at instants (k,) of joints (k, n)."""
        first = -self._seen % self._every
        self._seen += len(t)
        t, q = t[first :: self._every], q[first :: self._every]
        while self._count + len(t) > len(self._t):  # every second sample goes, the others into new arrays
            t, q = np.concatenate([self._t[: self._count], t])[::2], np.concatenate([self._q[: self._count], q])[::2]
            self._t, self._q = np.empty_like(self._t), np.empty_like(self._q)
            self._count, self._every = 0, 2 * self._every
        rows = slice(self._count, self._count + len(t))
        self._t[rows], self._q[rows], self._count = t, q, rows.stop

    def view(self) -> tuple[Vector, Matrix]:
        """(t (k,), q (k, n)): views that nobody can write to."""
        t, q = self._t[: self._count], self._q[: self._count]
        t.flags.writeable = q.flags.writeable = False
        return t, q


# --- The coverage of a workspace by one strategy, piece by piece, as points to draw.

PIECE = 32  # poses between two looks at whether to go on: some 50 ms where the arm is searched for other postures
# half sides of the box that is looked at by default, as a share of the tool's distance from the base; [m]; [m]
SHARE, LEAST, MOST = 0.5, 0.1, 0.6


def default_workspace(task: Task, home: Vector) -> Workspace:
    """A box of tool positions about the tool at a posture (n,), with the rotation that it has there."""
    tool = task.pose(home).reshape(-1, 4, 4)[0]
    half = np.full(3, np.clip(SHARE * float(np.linalg.norm(tool[:3, 3])), LEAST, MOST))
    if task.robot.planar:
        half[2] = 0.0
    return workspace(box=(tool[:3, 3], half), rotation=tool[:3, :3])


def covered(
    strategy: HolonomicStrategy, name: str, q0: Vector, region: Workspace, samples: int, limits: bool
) -> Iterator[Cloud]:
    """The coverage of a workspace by the leaf through a posture (n,), after each piece."""
    try:
        poses = region.poses(samples)
        parts: list[Coverage] = []
        yield _cloud(name, parts, len(poses), CloudStatus.RUNNING)
        for first in range(0, len(poses), PIECE):
            piece = poses[first : first + PIECE]
            parts.append(coverage(strategy, pose_cloud(piece), q0, samples=len(piece), limits=limits))
            status = CloudStatus.RUNNING if first + PIECE < len(poses) else CloudStatus.DONE
            yield _cloud(name, parts, len(poses), status)
    except HolokinError as problem:
        yield failed_cloud(name, str(problem))


def _cloud(name: str, parts: list[Coverage], total: int, status: CloudStatus, sentence: str = "") -> Cloud:
    """What the pieces so far show."""
    if not parts:
        none = np.zeros(0)
        return Cloud(name, 0, total, status, sentence, np.zeros((0, 3)), none > 0, none)
    poses, q = np.concatenate([part.poses for part in parts]), np.concatenate([part.q for part in parts])
    reached = np.concatenate([part.reached for part in parts])
    # The least distance to a joint limit over half the joint's range: 1 in the middle of all, and without limits.
    lower, upper = parts[0].lower, parts[0].upper
    half = (upper - lower) / 2
    bounded = np.isfinite(half) & (half > 0)
    shares = np.minimum(q - lower, upper - q)[:, bounded] / half[bounded]
    margin = np.where(reached, shares.min(axis=1, initial=1.0), np.nan)
    return Cloud(name, len(poses), total, status, sentence, poses[:, :3, 3].copy(), reached, margin)


def failed_cloud(name: str, sentence: str) -> Cloud:
    """That of a coverage that could not be found."""
    return _cloud(name, [], 0, CloudStatus.FAILED, sentence)


# --- What is said of a strategy: whether it is holonomic about its start, and its curvature at a posture.

RADIUS = 0.2  # half side [joint units] of the box about the start in which a strategy is judged, as in jobs


def judged(strategy: Strategy, home: Vector, q: Vector) -> Judgement:
    """The verdict of `hk.involutivity` about the start (n,), and the largest |F_ij| of `hk.curvature` at q (n,)."""
    try:
        verdict = involutivity(strategy, around(home, RADIUS))
        holonomic, sentence = verdict.holonomic, str(verdict).partition("\n")[0]
    except Exception as problem:  # noqa: BLE001  a control law of one's own may raise anything; its thread goes on
        holonomic, sentence = None, f"It could not be judged: {problem}"
    return Judgement(holonomic, sentence, largest_curvature(strategy, q), q)


def largest_curvature(strategy: Strategy, q: Vector) -> float:
    """The largest |F_ij| over the pairs of task rows [joint units / task units^2]; NaN where there is none."""
    try:
        return float(np.linalg.norm(curvature(strategy, q), axis=0).max(initial=0.0))
    except Exception:  # noqa: BLE001  as above
        return np.nan


POINTS = 120  # points of the line of a loop


def leaf_cusps(name: str, strategy: HolonomicStrategy, q: Vector) -> LeafCusps:
    """Those of the leaf through a posture (n,), and how far they are from the tool there."""
    cusps = cusps_near(strategy, q, pose_cloud(strategy.task.pose(q)[None]))
    place = None if cusps.pose is None else cusps.pose[:3, 3]
    smallest = None if cusps.found is None else cusps.found.witness
    loop = np.zeros((0, 3))
    if smallest is not None:
        loop = smallest.path.at(np.linspace(0, smallest.path.duration, POINTS)).position
    return LeafCusps(name, leaf_value(strategy, q), False, _sentence(name, strategy.task.robot, cusps), place, loop)


def _sentence(name: str, robot: Robot, cusps: NearbyCusps) -> str:
    """What was found, in a line or two."""
    if cusps.found is None:
        return f"{name}: cusps were not looked for: {cusps.reason}"
    if cusps.found.excluded:
        return f"{name}: its leaf has no cusp: {cusps.found.excluded}."
    if cusps.pose is None:
        return (
            f"{name}: no cusp was found within the joint limits from {cusps.found.starts:,} starts, which is no proof."
        )
    sentence = f"{name}: the nearest cusp found within the joint limits is {figure(cusps.away, 2)} m away."
    smallest = cusps.found.witness
    if smallest is None:
        return f"{sentence} No tool loop round a cusp was found."
    apart = f"{figure(smallest.apart, 2)} {joint_unit(SI, robot)}"
    length = f"{figure(smallest.length, 2)} m"
    return f"{sentence} The smallest tool loop found is {length} long; after it a joint is {apart} from where it was."


# --- In what units the page shows joints and places. Sessions, jobs and files have radians and metres throughout.

# by the names by which they are chosen
UNITS = {f"{units.angle}, {units.length}": units for units in (SI, PrintedUnits("deg", "mm"))}
SLOWEST, USUAL, FASTEST = 0.25, 2.0, 8.0  # speed of a loop in a page, times its own


def joint_factors(units: PrintedUnits, robot: Robot) -> Vector:
    """By what each joint is multiplied (n,)."""
    return units.factors([c.unit for c in robot.coordinates])


def joint_unit(units: PrintedUnits, robot: Robot) -> str:
    """The unit of what is said of any joint of a robot, that of angles first."""
    kinds = sorted({c.unit for c in robot.coordinates}, key=lambda unit: unit != "rad")
    return " or ".join(map(units.name, kinds))


def figure(value: float, digits: int = 3) -> str:
    """A number as a page shows it: so many digits, never as a power of ten."""
    return np.format_float_positional(float(f"{value:.{digits}g}"), trim="-")


def difference(units: PrintedUnits, robot: Robot, joints: ArrayLike) -> str:
    """The largest of joint differences (n,) as a page shows it, "none" where it is round-off."""
    if np.abs(np.asarray(joints)).max(initial=0.0) < NO_DRIFT:
        return "none"
    return figure(float(largest(units, robot, joints)))


def largest(units: PrintedUnits, robot: Robot, differences: ArrayLike) -> Array:
    """The largest of joint differences (..., n), each in its unit."""
    return np.abs(np.asarray(differences) * joint_factors(units, robot)).max(axis=-1, initial=0.0)
