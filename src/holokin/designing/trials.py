"""A law on trial: what it does on one leaf at many poses of a workspace, quickly."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..strategies import HolonomicStrategy
from ..task import Task
from ..types import Array, Flags, Matrix, Value, Vector
from .candidates import Candidate
from .rays import Rays, along_leaf, along_radial, least_rate
from .starts import inside

DIFFERENCE = 1e-4
"""Half of the step of a central difference by the tool pose [m or rad]: its error is 1e-8, of round-off 1e-8, too."""


@dataclass(frozen=True, eq=False)
class Motions(Value):
    """How joint speed is counted: sum_ij w_i (G d_j)_i^2, over the directions d_j in which a workspace reaches.

    directions: (m, d), orthonormal ones of positions, and of turns over the length that makes the workspace as wide in
    turns as in positions. weights: w (n,), 1 for hinges; a slider counts as a hinge that uses the same share of its
    speed limit.
    """

    directions: Matrix
    weights: Vector

    def of(self, G: Array) -> Vector:
        """The squared speed (k,) of slopes G (k, n, m) [rad^2/m^2]."""
        return np.sum(self.weights[:, None] * (G @ self.directions) ** 2, axis=(1, 2))


@dataclass(frozen=True, eq=False)
class Trial(Value):
    """A candidate on the leaf through a start, at the poses (k, 4, 4) of a workspace.

    q: postures (k, n) where its lines end. served: poses (k,) that it reaches within the joint limits. speed: squared
    joint speed (k,), the mean over the tool's directions of motion, NaN where it is not served. rcond: how regular the
    law is there (k,); 1 for radial, whose leaf ends only where J is singular.
    """

    candidate: Candidate
    start: Vector
    q: Matrix
    reached: Flags
    served: Flags
    speed: Vector
    rcond: Vector

    @property
    def coverage(self) -> float:
        """Share of the poses that are served."""
        return float(np.mean(self.served))

    @cached_property
    def margins(self) -> Matrix:
        """Distance to the nearer limit over the joint's range (k, n); infinite for joints without limits."""
        robot = self.candidate.task.robot
        spans = robot.upper - robot.lower
        room = np.minimum(self.q - robot.lower, robot.upper - self.q)
        return np.where(np.isfinite(spans), room / np.where(np.isfinite(spans), spans, 1.0), np.inf)

    @property
    def margin(self) -> float:
        """The least of `margins` over the poses that are served; 0 where there are none."""
        return float(self.margins[self.served].min(initial=1.0)) if self.served.any() else 0.0

    @property
    def least_rcond(self) -> float:
        """The least rcond over the poses that are served; 0 where there are none."""
        return float(self.rcond[self.served].min()) if self.served.any() else 0.0

    def ratio(self, floor: Vector) -> float:
        """Mean squared joint speed over the floor's (k,), where it is served."""
        return float(self.speed[self.served].sum() / floor[self.served].sum()) if self.served.any() else np.inf


def tried(candidate: Candidate, starts: Matrix, poses: Array, motions: Motions) -> list[Trial]:
    """A trial from each of the starts (s, n) that the law can begin at.

    Args:
        motions: how joint speed is counted.
    """
    task = candidate.task
    if candidate.strategy is None:
        rays = along_radial(task, starts, poses)
        speed, rcond = _radial_speeds(task, starts, poses, motions), np.ones(rays.share.shape)
        return [_trial(candidate, q0, rays, i, speed[i], rcond[i]) for i, q0 in enumerate(starts)]
    if candidate.level is not None:
        starts = _on_leaf(task, candidate.strategy, starts, candidate.level)
    if not len(starts):
        return []
    rays = along_leaf(candidate.strategy, starts, poses)
    G, rcond, _ = candidate.strategy.gain.batch(rays.q.reshape(-1, task.n))
    speed = motions.of(G.reshape(-1, task.n, task.m)).reshape(rays.share.shape)
    rcond = rcond.reshape(rays.share.shape)
    return [_trial(candidate, q0, rays, i, speed[i], rcond[i]) for i, q0 in enumerate(starts)]


def least_speed(task: Task, Q: Matrix, motions: Motions) -> Vector:
    """The squared speed (k,) of the right inverse that has the least, at postures (k, n)."""
    root = 1 / np.sqrt(motions.weights)
    J = task.jacobian_batch(Q)[0] * root
    gram = J @ J.transpose(0, 2, 1)
    gram[np.linalg.det(gram) < 1e-300] = np.nan
    rates = root[:, None] * (J.transpose(0, 2, 1) @ np.linalg.solve(gram, np.broadcast_to(motions.directions, (len(Q), *motions.directions.shape))))
    return np.sum(motions.weights[:, None] * rates**2, axis=(1, 2))


def _trial(candidate: Candidate, start: Vector, rays: Rays, i: int, speed: Vector, rcond: Vector) -> Trial:
    q, reached = rays.q[i], rays.reached[i]
    served = reached & inside(candidate.task.robot, q) & np.isfinite(speed)
    return Trial(candidate, start, q, reached, served, np.where(served, speed, np.nan), rcond)


def _on_leaf(task: Task, strategy: HolonomicStrategy, starts: Matrix, level: float) -> Matrix:
    """Those starts, moved by self-motion to the leaf of a level, that get there within the joint limits."""
    moved = []
    for q in starts:
        rays = along_leaf(strategy, q[None], task.robot.pose(q, task.tip)[None], np.full(task.n - task.m, level))
        if rays.reached[0, 0] and inside(task.robot, rays.q[0])[0]:
            moved.append(rays.q[0, 0])
    return np.array(moved).reshape(-1, task.n)


def _radial_speeds(task: Task, starts: Matrix, poses: Array, motions: Motions) -> Matrix:
    """The squared speed (s, k) by central differences of where the lines end."""
    from scipy.spatial.transform import Rotation

    slopes = []
    for d in motions.directions.T:
        six = np.zeros(6)
        six[list(task.rows)] = d
        ends = []
        for h in (DIFFERENCE, -DIFFERENCE):
            moved = poses.copy()
            moved[:, :3, 3] += h * six[:3]
            moved[:, :3, :3] = Rotation.from_rotvec(h * six[3:]).as_matrix() @ moved[:, :3, :3]
            ends.append(along_radial(task, starts, moved).q)
        slopes.append((ends[0] - ends[1]) / (2 * DIFFERENCE))
    return np.sum(motions.weights * np.array(slopes) ** 2, axis=(0, 3))
