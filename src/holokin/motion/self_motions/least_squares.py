"""Postures nearest to tool poses by damped least squares, for tasks of which not all postures are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.tolerances import TOLERANCES
from ...base.types import Array, Flags, Indices, Matrix, Value, Vector, kept
from ...robot.chains import Span, longest_span
from ...strategies.tasks.frame_task import FrameTask
from ...strategies.tasks.task import Task, TipFrame

RESTARTS = 64
"""Random postures tried besides the last one before a target is called out of reach. At eleven poses far out on a
Panda's circle of 0.35 m, one start in three got there; with 8 starts one of them was missed."""

ROUND = 16
"""Random postures that are tried side by side before a target that none of them reached gets more."""

ALIKE = 1.01
"""Where half of a round's searches end within this factor of the least error that was found, no more are made: beyond
the reach of an arm all of them lead to the same stretched posture."""

STATIONARY = 1e-3
"""Largest cosine between the error that is left and what a joint does to it at which a search has got to its end."""

REACHED = TOLERANCES.tracking / 10
"""Error [m or rad] at which a target counts as reached."""

FAR = TOLERANCES.tracking
"""Error [m or rad] from which a search that gains no more has got to its end: nearer by it may yet arrive."""


@dataclass(frozen=True, eq=False)
class NearestPostures(Value):
    """For each of k targets the posture found nearest to it, and the error that is left [m or rad].

    ended (k,): True where the search had got to its end there, so that more looks would find no more.
    """

    q: Matrix
    missing: Vector
    ended: Flags

    @property
    def reached(self) -> Flags:
        """True where a posture reaches the target (k,)."""
        return self.missing <= REACHED


def surely_beyond(task: Task, position: Matrix, rotation: Array) -> Flags:
    """Which targets (k, 3), (k, 3, 3) no posture reaches, since they are further away than the links are long.

    A bound, at once; of the others only a search can tell. It needs all three positions of a tip.
    """
    span = _span(task)
    return np.zeros(len(position), dtype=bool) if span is None else span.beyond(position, rotation)


@kept
def _span(task: Task) -> Span | None:
    """How far the links reach, of a task that asks for all three positions of a tip."""
    if not (isinstance(task, FrameTask) and isinstance(task.frame, TipFrame) and set(task.rows) >= {0, 1, 2}):
        return None
    return longest_span(task.robot, task.tip, turned=bool(task._rotations))


def nearest_postures(
    task: Task, position: Matrix, rotation: Array, near: Matrix, *, limits: bool, restarts: int = RESTARTS
) -> NearestPostures:
    """Postures that bring the tool to targets (k, 3), (k, 3, 3), or as near as was found.

    Least squares, within the joint limits or without, from a posture `near` each target (k, n), and from random
    ones for those that it does not reach. A count and not a clock ends it, so the answer is the same on every
    machine; and each target's is the same whatever the others are.
    """
    robot = task.robot
    lower, upper = (robot.lower, robot.upper) if limits else (np.full(robot.n, -np.inf), np.full(robot.n, np.inf))
    # From the posture near each target, then from random ones, some at a time, for those that it does not reach.
    best = _search(task, position, rotation, near, lower, upper)
    q, missing, ended = best.q.copy(), best.missing.copy(), best.ended.copy()
    low = np.where(np.isfinite(robot.lower), robot.lower, near - np.pi)
    high = np.where(np.isfinite(robot.upper), robot.upper, near + np.pi)
    shares = np.random.default_rng(0).uniform(size=(restarts, robot.n))
    sure = np.zeros(len(q), dtype=bool)
    for first in range(0, restarts, ROUND):
        left = np.flatnonzero((missing > REACHED) & ~sure)
        if not left.size:
            break
        some = shares[first : first + ROUND]
        begin = low[left, None] + some * (high - low)[left, None]
        rows = np.repeat(left, len(some))
        nearest = _search(task, position[rows], rotation[rows], begin.reshape(-1, robot.n), lower, upper)
        each = nearest.missing.reshape(len(left), -1)
        chosen = np.argmin(each, axis=1) + len(some) * np.arange(len(left))
        better = nearest.missing[chosen] < missing[left]
        to, of = left[better], chosen[better]
        q[to], missing[to], ended[to] = nearest.q[of], nearest.missing[of], nearest.ended[of]
        alike = (each <= ALIKE * missing[left, None]).sum(axis=1)
        sure[left] = ended[left] & (alike >= ROUND / 2)
    return NearestPostures(q, missing, ended)


def _search(task: Task, position: Matrix, rotation: Array, q: Matrix, lower: Vector, upper: Vector) -> NearestPostures:
    """Damped least squares, many at once; a joint at its limit stays there while the error pushes it out.

    [GVL13, section 6.1]
    """
    k, m, n = len(q), task.m, task.n
    q = np.clip(q, lower, upper)

    def look(postures: Matrix, rows: Indices) -> tuple[Matrix, Array]:
        error, slope = task._error_and_slope.batch(postures, position[rows], rotation[rows])
        return error.reshape(-1, m), slope.reshape(-1, m, n)

    error, D = look(q, np.arange(k))
    damping, before, ended = np.full(k, 1e-6), np.full(k, np.inf), np.zeros(k, dtype=bool)
    rows = np.flatnonzero(np.isfinite(error).all(axis=1) & np.isfinite(D).all(axis=(1, 2)))
    for looks in range(1, 200):  # some six for a target that is reached
        e, S, postures = error[rows], D[rows], q[rows]
        # A joint at its limit is not free while the error pushes it out; a posture with no free slope left is
        # stationary.
        size = np.linalg.norm(e, axis=1)
        slope = np.einsum("kmn,km->kn", S, e)
        free = ~(((postures <= lower) & (slope >= 0)) | ((postures >= upper) & (slope <= 0)))
        still = np.abs(slope) > STATIONARY * np.linalg.norm(S, axis=1) * size[:, None]
        # One that gains less than 1 % within 20 looks is close to a stretched arm: other postures need the looks.
        stalled = np.zeros(len(rows), dtype=bool)
        if looks % 20 == 0:
            stalled, before[rows] = size > 0.99 * before[rows], size
        ended[rows] = ~(free & still).any(axis=1) | (stalled & (size > FAR))
        # Only postures that are not there, may still get nearer, and are not damped for ever go on.
        go = ~ended[rows] & ~stalled & (np.abs(e).max(axis=1) > REACHED / 10) & (damping[rows] <= 1e12)
        rows, e, A, postures = rows[go], e[go], S[go] * free[go, None], postures[go]
        if not rows.size:
            break
        # Levenberg-Marquardt: (A A^T + damping) y = e, a motion by A^T y within the limits.
        normal = A @ np.swapaxes(A, 1, 2)
        scale = np.maximum(np.trace(normal, axis1=1, axis2=2), 1e-300)
        normal += (damping[rows] * scale)[:, None, None] * np.eye(m)
        moved = postures - np.einsum("kmn,km->kn", A, np.linalg.solve(normal, e[..., None])[..., 0])
        moved = np.clip(moved, lower, upper)
        left, derivative = look(moved, rows)
        sound = np.isfinite(left).all(axis=1) & np.isfinite(derivative).all(axis=(1, 2))
        with np.errstate(invalid="ignore", over="ignore"):
            better = sound & (np.sum(left**2, axis=1) < np.sum(e**2, axis=1))
        # Keep motions that lessen the error, and trust the slopes more after them, less after others.
        to = rows[better]
        q[to], error[to], D[to] = moved[better], left[better], derivative[better]
        damping[rows] = np.where(better, np.maximum(damping[rows] / 10, 1e-12), damping[rows] * 10)
    with np.errstate(invalid="ignore"):
        missing = np.where(np.isfinite(error).all(axis=1), np.abs(error).max(axis=1), np.inf)
    return NearestPostures(q, missing, ended)
