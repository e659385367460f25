"""A law on trial: what it does on one leaf at many poses of a workspace, quickly."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.types import Array, Flags, Indices, Matrix, Value, Vector
from ...motion.checks.check_report import keeps
from ...motion.checks.keeping_clear import Clearances
from ...strategies import HolonomicStrategy
from ...strategies.tasks.task import Task
from ..coverage.candidates import Candidate
from ..coverage.coordinates import Coordinates
from ..coverage.line_ends import LineEnds, along_leaf, along_radial
from .advice import PROVABLE, REGULAR, ROOM
from .lower_bound import least_slopes
from .objectives import Costs

DIFFERENCE = 1e-4
"""Half of the step of a central difference by the tool pose [m or rad]: its error is 1e-8, that of round-off, too."""


@dataclass(frozen=True, eq=False)
class Poses(Value):
    """The tool poses T (k, 4, 4) at which laws are tried, and the motions of the tool by which speeds are counted.

    twists: (k, m, d), what the tool does in the task's rows along each direction in which the workspace reaches, at
    1 m/s, or as many rad/s as its turns are wide; NaN at a pose that no posture reaches. weights: of squared joint
    speeds (n,), see `Objective`. apart: the shapes that are to keep clear of each other; None where nothing is
    asked of them.
    """

    T: Array
    twists: Array
    weights: Vector
    apart: Clearances | None = None

    def __len__(self) -> int:
        return len(self.T)

    def some(self, which: Indices | slice) -> Poses:
        """Some of them."""
        return Poses(self.T[which], self.twists[which], self.weights, self.apart)

    def squared_speed(self, G: Array) -> Array:
        """sum_ij w_i (G twist_j)_i^2 (..., k) of slopes G (..., k, n, m): the cost "squared_speed" of `Objective`."""
        return np.sum(self.weights[:, None] * (G @ self.twists) ** 2, axis=(-2, -1))


def posed(
    task: Task, T: Array, Q: Matrix, coordinates: Coordinates, costs: Costs, apart: Clearances | None = None
) -> Poses:
    """`Poses` at T (k, 4, 4), of postures that reach them, a row of NaN where there are none, Q (k, n)."""
    known = np.isfinite(Q).all(axis=1)
    J, chart = task.jacobian_batch(Q[known])[0], coordinates.chart.jacobian_batch(Q[known])[0]
    twists = np.full((len(T), task.m, coordinates.d), np.nan)
    twists[known] = J @ least_slopes(chart, coordinates.P * costs.columns, np.ones(task.n))
    return Poses(T, twists, costs.joints, apart)


@dataclass(frozen=True, eq=False)
class Trial(Value):
    """A candidate on the leaf through a start, at k poses.

    q: postures (k, n) where its lines end. reached: poses (k,) that they lead to; served: those within the joint
    limits, at clear postures. speed: squared joint speed (k,), NaN where it is not reached. rcond: of [J; J_g] there
    (k,); NaN for radial, whose leaves end only where J is singular. same: names of other laws that are this one on
    this workspace. clearance: the least distance of two shapes (k,) [m] where the law gets within the limits, else NaN,
    and `wanted`, what is asked of it; None where nothing is.
    """

    candidate: Candidate
    q0: Vector
    q: Matrix
    reached: Flags
    served: Flags
    speed: Vector
    rcond: Vector
    same: tuple[str, ...] = ()
    clearance: Vector | None = None
    wanted: float = 0.0

    @property
    def coverage(self) -> float:
        """Share of the poses that are served."""
        return float(np.mean(self.served))

    @property
    def easy(self) -> float:
        """Share of the poses that are served away from limits and singular postures."""
        away = (self.margins.min(axis=1) >= ROOM) & ~(self.rcond < REGULAR)  # of radial it is not known
        return float(np.mean(self.served & away))

    @property
    def clear(self) -> float:
        """Share of the poses that are served with a clearance that can be proven; 1 where none is asked for."""
        return clear_share(self.served, self.clearance, self.wanted)

    @cached_property
    def margins(self) -> Matrix:
        """Distance to the nearer limit over the joint's range (k, n), negative beyond it; inf without limits."""
        robot = self.candidate.task.robot
        spans = robot.upper - robot.lower
        room = np.minimum(self.q - robot.lower, robot.upper - self.q)
        return np.where(np.isfinite(spans), room / np.where(np.isfinite(spans), spans, 1.0), np.inf)

    @property
    def margin(self) -> float:
        """The least of `margins` where it serves; 0 where it does not, inf without limits."""
        return float(self.margins[self.served].min()) if self.served.any() else 0.0

    @property
    def joint(self) -> int:
        """The joint of that margin."""
        return int(np.argmin(self.margins[self.served].min(axis=0))) if self.served.any() else 0

    @property
    def least_rcond(self) -> float:
        """The least rcond where it serves; 0 where it does not, NaN for radial."""
        return float(self.rcond[self.served].min()) if self.served.any() else 0.0

    @property
    def squared_speed(self) -> float:
        """Mean squared joint speed where it serves; infinite where it does not."""
        return float(self.speed[self.served].mean()) if self.served.any() else np.inf


def tried(candidate: Candidate, starts: Matrix, poses: Poses) -> list[Trial]:
    """A trial from each of the starts (s, n) that the law can begin at."""
    task = candidate.task
    if candidate.strategy is not None and candidate.level is not None:
        starts = _on_leaf(task, candidate.strategy, starts, candidate.level)
    if not len(starts):
        return []
    if candidate.strategy is None:
        ends = along_radial(task, starts, poses.T)
        speed, rcond = _radial_speeds(task, starts, poses), np.full(ends.share.shape, np.nan)
    else:
        ends = along_leaf(candidate.strategy, starts, poses.T)
        G, rcond, _ = candidate.strategy.gain.batch(ends.q.reshape(-1, task.n))
        speed, rcond = poses.squared_speed(G.reshape(*ends.q.shape, task.m)), rcond.reshape(ends.share.shape)
    return [_trial(candidate, q0, ends, i, speed[i], rcond[i], poses.apart) for i, q0 in enumerate(starts)]


def _trial(
    candidate: Candidate, q0: Vector, ends: LineEnds, i: int, speed: Vector, rcond: Vector, apart: Clearances | None
) -> Trial:
    q, reached = ends.q[i], ends.reached[i]
    served, speed = reached & candidate.task.robot.within(q) & np.isfinite(speed), np.where(reached, speed, np.nan)
    if apart is None:
        return Trial(candidate, q0, q, reached, served, speed, rcond)
    clearance = np.full(len(q), np.nan)
    clearance[served] = apart.least(q[served], apart.wanted)
    return Trial(
        candidate, q0, q, reached, served & keeps(clearance, apart.wanted), speed, rcond, (), clearance, apart.wanted
    )


def clear_share(served: Flags, clearance: Vector | None, wanted: float) -> float:
    """Share of the poses (k,) that are served with `PROVABLE` more clearance than is wanted [m]; 1 without any."""
    return 1.0 if clearance is None else float(np.mean(served & (clearance >= wanted + PROVABLE)))


def _on_leaf(task: Task, strategy: HolonomicStrategy, starts: Matrix, level: float) -> Matrix:
    """Those starts, moved by self-motion to the leaf of a level, that get there within the joint limits."""
    moved = []
    for q in starts:
        ends = along_leaf(strategy, q[None], task.pose(q)[None], np.full(task.n - task.m, level))
        if ends.reached[0, 0] and task.robot.within(ends.q[0, 0]):
            moved.append(ends.q[0, 0])
    return np.array(moved).reshape(-1, task.n)


def _radial_speeds(task: Task, starts: Matrix, poses: Poses) -> Matrix:
    """The squared speed (s, k) by central differences of where the lines end."""
    from scipy.spatial.transform import Rotation

    total = np.zeros((len(starts), len(poses)))
    for j in range(poses.twists.shape[2]):
        six = np.zeros((len(poses), 6))
        six[:, list(task.rows)] = np.nan_to_num(poses.twists[:, :, j])
        ends = []
        for h in (DIFFERENCE, -DIFFERENCE):
            moved = poses.T.copy()
            moved[:, :3, 3] += h * six[:, :3]
            moved[:, :3, :3] = Rotation.from_rotvec(h * six[:, 3:]).as_matrix() @ moved[:, :3, :3]
            ends.append(along_radial(task, starts, moved).q)
        total += np.sum(poses.weights * ((ends[0] - ends[1]) / (2 * DIFFERENCE)) ** 2, axis=2)
    return total
