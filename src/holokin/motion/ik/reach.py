"""Can the tool get there at all? Asked only after following has failed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...base.errors import posture_text
from ...base.tolerances import TOLERANCES
from ...base.types import Array, Flags, Indices, Matrix, Value, Vector
from ...robot.longest_span import longest_span
from ...strategies.tasks.frame_task import FrameTask
from ...strategies.tasks.frames import TipFrame
from ...strategies.tasks.task import Task
from .plan import Plan

TARGETS = 24
"""Targets of the rest of the path that are tried."""

RESTARTS = 64
"""Random postures tried besides the last one before a target is called out of reach. At eleven poses far out on a
Panda's circle of 0.35 m, one start in three got there; with 8 starts one of them was missed."""

ROUND = 16
"""Random postures that are tried side by side before a target that none of them reached gets more."""

ALIKE = 1.01
"""Where half of a round's searches end within this factor of the least error that was found, no more are made: beyond
the reach of an arm all of them lead to the same stretched posture."""

LOOKS = 200
"""Postures that one search for a target looks at. A target that is reached takes some six."""

STALLED, AFTER = 0.99, 20
"""A search that makes the error no smaller than this share within so many looks ends: close to a stretched arm, each
step gains less than the one before, and the looks are needed for other postures."""

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


class Beyond(NamedTuple):
    """The first target of a path that no search reaches: at which share of the path, by how much the tool misses it [m
    or rad], where it is (3,) [m], and what is in the way, in words."""

    share: float
    missing: float
    position: Vector
    why: str

    @property
    def fact(self) -> str:
        """All of it in words."""
        at = posture_text(np.round(self.position, 9))
        where = f"{100 * self.share:.3g} % along it, at the point {at} m"
        off = f"no search came closer to the tool pose than {self.missing:.3g} (m or rad)"
        return f"the path is out of reach: {where}, {off}{self.why}"


def out_of_reach(plan: Plan, q: Vector, step: int, limits: bool) -> Beyond | None:
    """The first target of a path from a step on that no search reaches; else None.

    Least squares within the joint limits from the last posture, then from random ones. None also where the searches
    did not come to an end, since nothing is known then.
    """
    for i in np.unique(np.linspace(step, plan.steps - 1, TARGETS).astype(int)):
        position, rotation = plan.target(int(i), 1.0)
        found = nearest_postures(plan.task, position[None], rotation[None], q[None], limits=limits)
        if not found.reached[0]:
            if not found.ended[0]:
                return None
            why = _in_the_way(plan.task, position, rotation, q, limits)
            return Beyond((i + 1) / plan.steps, float(found.missing[0]), position, why)
        q = found.q[0]
    return None


def _in_the_way(task: Task, position: Vector, rotation: Matrix, q: Vector, limits: bool) -> str:
    """By which joint's limit a target is missed, or that no posture at all was found."""
    robot = task.robot
    if not limits:
        return ", without joint limits"
    free = nearest_postures(task, position[None], rotation[None], q[None], limits=False)
    if not free.reached[0]:
        return ", even without joint limits"
    past = robot.beyond(free.q[0])
    k = int(np.argmax(past))
    name, unit = robot.joint_names[k], robot.coordinates[k].unit
    lower, upper = robot.lower[k], robot.upper[k]
    limit = f"its limits [{lower:.6g}, {upper:.6g}]"
    return f" within the joint limits: a posture that reaches it has {name!r} {past[k]:.3g} {unit} outside {limit}"


def pose_out_of_reach(task: Task, position: Vector, rotation: Matrix, q: Vector, limits: bool) -> float | None:
    """Distance [m or rad] of a tool pose that no search from q or elsewhere reaches; else None.

    None also where the searches did not come to an end.
    """
    found = nearest_postures(task, position[None], rotation[None], q[None], limits=limits)
    return float(found.missing[0]) if found.ended[0] and not found.reached[0] else None


def surely_beyond(task: Task, position: Matrix, rotation: Array) -> Flags:
    """Which targets (k, 3), (k, 3, 3) no posture reaches, since they are further away than the links are long.

    A bound, at once; of the others only a search can tell. It needs all three positions of a tip.
    """
    if not (isinstance(task, FrameTask) and isinstance(task.frame, TipFrame) and set(task.rows) >= {0, 1, 2}):
        return np.zeros(len(position), dtype=bool)
    return longest_span(task.robot, task.tip, turned=bool(task.rotations)).beyond(position, rotation)


def nearest_postures(task: Task, position: Matrix, rotation: Array, near: Matrix, *, limits: bool) -> NearestPostures:
    """Postures that bring the tool to targets (k, 3), (k, 3, 3), or as near as was found.

    Least squares, within the joint limits or without, from a posture `near` each target (k, n), and from RESTARTS
    random ones for those that it does not reach. A count and not a clock ends it, so the answer is the same on every
    machine; and each target's is the same whatever the others are.
    """
    robot = task.robot
    lower, upper = (robot.lower, robot.upper) if limits else (np.full(robot.n, -np.inf), np.full(robot.n, np.inf))
    best = _search(task, position, rotation, near, lower, upper)
    q, missing, ended = best.q.copy(), best.missing.copy(), best.ended.copy()
    low = np.where(np.isfinite(robot.lower), robot.lower, near - np.pi)
    high = np.where(np.isfinite(robot.upper), robot.upper, near + np.pi)
    shares = np.random.default_rng(0).uniform(size=(RESTARTS, robot.n))
    sure = np.zeros(len(q), dtype=bool)
    for first in range(0, RESTARTS, ROUND):
        left = np.flatnonzero((missing > REACHED) & ~sure)
        if not left.size:
            break
        some = shares[first : first + ROUND]
        begin = low[left, None] + some * (high - low)[left, None]
        rows = np.repeat(left, len(some))
        found = _search(task, position[rows], rotation[rows], begin.reshape(-1, robot.n), lower, upper)
        each = found.missing.reshape(len(left), -1)
        chosen = np.argmin(each, axis=1) + len(some) * np.arange(len(left))
        better = found.missing[chosen] < missing[left]
        to, of = left[better], chosen[better]
        q[to], missing[to], ended[to] = found.q[of], found.missing[of], found.ended[of]
        alike = (each <= ALIKE * missing[left, None]).sum(axis=1)
        sure[left] = ended[left] & (alike >= ROUND / 2)
    return NearestPostures(q, missing, ended)


def _search(task: Task, position: Matrix, rotation: Array, q: Matrix, lower: Vector, upper: Vector) -> NearestPostures:
    """Damped least squares, many at once; a joint at its limit stays there while the error pushes it out.

    [GVL13, section 6.1]
    """
    k, m, n = len(q), task.m, task.n
    q = np.clip(q, lower, upper)

    def look(at: Matrix, rows: Indices) -> tuple[Matrix, Array]:
        error, slope = task.error_and_slope.batch(at, position[rows], rotation[rows])
        return error.reshape(-1, m), slope.reshape(-1, m, n)

    error, D = look(q, np.arange(k))
    damping, before, ended = np.full(k, 1e-6), np.full(k, np.inf), np.zeros(k, dtype=bool)
    rows = np.flatnonzero(np.isfinite(error).all(axis=1) & np.isfinite(D).all(axis=(1, 2)))
    for looks in range(1, LOOKS):
        e, S, at = error[rows], D[rows], q[rows]
        size = np.linalg.norm(e, axis=1)
        slope = np.einsum("kmn,km->kn", S, e)
        free = ~(((at <= lower) & (slope >= 0)) | ((at >= upper) & (slope <= 0)))
        still = np.abs(slope) > STATIONARY * np.linalg.norm(S, axis=1) * size[:, None]
        stalled = np.zeros(len(rows), dtype=bool)
        if looks % AFTER == 0:
            stalled, before[rows] = size > STALLED * before[rows], size
        ended[rows] = ~(free & still).any(axis=1) | (stalled & (size > FAR))
        go = ~ended[rows] & ~stalled & (np.abs(e).max(axis=1) > REACHED / 10) & (damping[rows] <= 1e12)
        rows, e, A, at = rows[go], e[go], S[go] * free[go, None], at[go]
        if not rows.size:
            break
        normal = A @ np.swapaxes(A, 1, 2)
        scale = np.maximum(np.trace(normal, axis1=1, axis2=2), 1e-300)
        normal += (damping[rows] * scale)[:, None, None] * np.eye(m)
        moved = at - np.einsum("kmn,km->kn", A, np.linalg.solve(normal, e[..., None])[..., 0])
        moved = np.clip(moved, lower, upper)
        there, derivative = look(moved, rows)
        sound = np.isfinite(there).all(axis=1) & np.isfinite(derivative).all(axis=(1, 2))
        with np.errstate(invalid="ignore", over="ignore"):
            better = sound & (np.sum(there**2, axis=1) < np.sum(e**2, axis=1))
        to = rows[better]
        q[to], error[to], D[to] = moved[better], there[better], derivative[better]
        damping[rows] = np.where(better, np.maximum(damping[rows] / 10, 1e-12), damping[rows] * 10)
    with np.errstate(invalid="ignore"):
        missing = np.where(np.isfinite(error).all(axis=1), np.abs(error).max(axis=1), np.inf)
    return NearestPostures(q, missing, ended)
