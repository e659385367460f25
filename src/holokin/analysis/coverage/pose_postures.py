"""The postures at many tool poses: those of all self-motions that a search finds, and the least of a cost over them.

Newton's method leads from many starts to postures of all branches. With one redundant joint they are on curves, and
whole curves are walked, each once. With more, a walk is a line among them, and lines are searched one after another,
each from the best postures before: the least found may then be too high.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.types import Array, Flags, Indices, Matrix, Value, Vector
from ...motion.ik.posture_search import postures_from, spread
from ...strategies.self_motions import SelfMotions, away
from ...strategies.tasks.task import Task

STARTS = 64
"""Starts of Newton's method at each pose. A Panda and an iiwa 14 have 4 to 8 self-motions at a pose, and each of them
draws a tenth of the starts or more: 64 miss one once in a thousand poses."""

STEP = 0.2
"""Arc length between the postures of a self-motion [joint units]."""

LENGTH = 20.0
"""A walk goes so far each way [joint units]; a Panda's self-motions close after 20 or less."""

LOOKS = ((8, 8), (3, 8), (1, 8))
"""(places, parts): round the best places of a pose steps are shorter by the parts, three times: the least value is then
right to 1e-5, also where a joint limit cuts the self-motion."""

LINES = 12
"""Lines searched for each redundant joint, where there are several; a second and a third third of them have steps that
are shorter by `SHORTER` and by its square."""

STEPS = 10
"""Steps of such a line each way."""

SHORTER = 5
"""See `LINES`."""

PLACES = (6, 2, 1)
"""Postures of a pose from which each third of the lines is searched: the best ones."""

Cost = Callable[[Matrix], Vector]
"""Postures (k, n) -> values (k,), inf for those that do not count."""


@dataclass(frozen=True, eq=False)
class PosePostures(Value):
    """Postures q (N, n) found at tool poses p (S, 3), R (S, 3, 3), that at `pose` (N,) of them.

    Where one joint is redundant they are those of whole self-motions, in their order, numbered by `curve` (N,).
    Elsewhere each is a curve of its own.
    """

    task: Task
    p: Matrix
    R: Array
    q: Matrix
    pose: Indices
    curve: Indices

    @property
    def traced(self) -> bool:
        """Whether they are whole self-motions."""
        return self.task.n - self.task.m == 1

    def least(self, cost: Cost, over: Cost) -> Vector:
        """The least (S,) of a cost at each pose, looked for between these postures, too; inf where it is inf at all.

        Args:
            over: what is above 0 where the cost is inf, and falls towards where it is not (k,).
        """
        return (_on_curves if self.traced else _on_lines)(self, cost, over)

    @cached_property
    def motions(self) -> SelfMotions:
        """The self-motions at these poses."""
        return SelfMotions(self.task, self.p, self.R)


def postures_at_poses(task: Task, Q: Matrix, p: Matrix, R: Array, *, starts: int) -> PosePostures:
    """The postures at tool poses p (S, 3), R (S, 3, 3), on the self-motions of Q (S, n) and of those that Newton's
    method finds from so many starts at each pose.
    """
    task = task.geometric_twin  # which has no singular angles on the way
    S = len(Q)
    pose = np.repeat(np.arange(S), starts)
    found, arrived = postures_from(task, spread(task.robot, starts * S), p[pose], R[pose])
    q, pose = np.concatenate([Q, found[arrived]]), np.concatenate([np.arange(S), pose[arrived]])
    if task.n - task.m > 1:
        return PosePostures(task, p, R, q, pose, np.arange(len(q)))
    left, curves, whose = np.arange(len(q)), [], []
    while len(left):
        poses, first = np.unique(pose[left], return_index=True)
        first = left[first]
        motions = SelfMotions(task, p[poses], R[poses])
        lines = [line.q for line in motions.traced(q[first], step=STEP, length=LENGTH, limits=False)]
        curves, whose = curves + lines, [*whose, *poses]
        others = [left[(pose[left] == k) & (left != i)] for k, i in zip(poses, first, strict=True)]
        left = np.concatenate([i[_apart(task, q[i], line) > STEP] for i, line in zip(others, lines, strict=True)])
    sizes = [len(line) for line in curves]
    which = np.repeat(np.arange(len(sizes)), sizes)
    return PosePostures(task, p, R, np.concatenate(curves), np.array(whose)[which], which)


def _apart(task: Task, q: Matrix, line: Matrix) -> Vector:
    """How far postures (k, n) are from the nearest of others (j, n)."""
    return away(task, q[:, None], line).min(axis=1)


def _on_curves(postures: PosePostures, cost: Cost, over: Cost) -> Vector:
    """The least cost (S,) on whole self-motions: at their postures, then ever closer round the best places.

    Between two postures that do not count there may be one that does: such places are looked at, too.
    """
    q, pose, rng = postures.q, postures.pose, np.random.default_rng(0)
    value, excess, best = cost(q), over(q), np.full(len(postures.p), np.inf)
    np.minimum.at(best, pose, value)
    lowest, (dips, steps) = _dips(value, postures.curve)[0], _dips(excess, postures.curve)
    hidden = np.isinf(value) & dips & (excess < steps)
    places, step = np.flatnonzero(lowest | hidden), STEP
    value = np.where(hidden, 0.0, value)  # to be looked at before all others
    q, pose, value, excess = q[places], pose[places], value[places], excess[places]
    for count, parts in LOOKS:
        chosen, step = _lowest(value, excess, pose, count), step / parts
        q, pose = q[chosen], pose[chosen]
        q, value, excess = best_of(
            line_through(postures.motions, q, rng.normal(size=q.shape), pose, step, parts), cost, over
        )
        np.minimum.at(best, pose, value)
    return best


def _on_lines(postures: PosePostures, cost: Cost, over: Cost) -> Vector:
    """The least cost (S,) that lines in random directions of the self-motions come down to, from the best postures."""
    pose, rng, best = postures.pose, np.random.default_rng(0), np.full(len(postures.p), np.inf)
    q, value, excess = best_of(postures.q[None], cost, over)
    every = LINES * (postures.task.n - postures.task.m)
    for third, count in enumerate(PLACES):
        chosen, step = _lowest(value, excess, pose, count), STEP / SHORTER**third
        q, pose = q[chosen], pose[chosen]
        for _ in range(every // len(PLACES)):
            line = line_through(postures.motions, q, rng.normal(size=q.shape), pose, step, STEPS)
            q, value, excess = best_of(line, cost, over)
    np.minimum.at(best, pose, value)
    return best


def line_through(motions: SelfMotions, q: Matrix, v: Matrix, pose: Indices, step: float, count: int) -> Array:
    """Postures (2 count + 1, k, n) on self-motions through some (k, n): these, and so many steps both ways."""
    found = [q]
    for sign in (1.0, -1.0):
        at, along, _ = motions.step(q, sign * v, pose, np.zeros(len(q)))
        for _ in range(count):
            at, along, _ = motions.step(at, along, pose, np.full(len(q), step))
            found.append(at)
    return np.array(found)


def best_of(line: Array, cost: Cost, over: Cost) -> tuple[Matrix, Vector, Vector]:
    """(the best (k, n) of postures (j, k, n), its cost (k,) and excess (k,)); of those that cost inf the nearest."""
    flat = line.reshape(-1, line.shape[2])
    value, excess = cost(flat).reshape(line.shape[:2]), over(flat).reshape(line.shape[:2])
    every = np.arange(line.shape[1])
    chosen = np.where(np.isfinite(value).any(axis=0), value.argmin(axis=0), excess.argmin(axis=0))
    return line[chosen, every], value[chosen, every], excess[chosen, every]


def _dips(value: Vector, curve: Indices) -> tuple[Flags, Vector]:
    """(where values along curves are finite and not above their neighbours', by how much they differ from these)."""
    same = np.diff(curve) == 0
    after = np.append(np.where(same, value[1:], np.inf), np.inf)
    before = np.append(np.inf, np.where(same, value[:-1], np.inf))
    with np.errstate(invalid="ignore"):
        steps = np.fmax(*(np.where(np.isfinite(v), np.abs(v - value), 0.0) for v in (before, after)))
    return np.isfinite(value) & (value <= np.minimum(before, after)), steps


def _lowest(value: Vector, excess: Vector, pose: Indices, count: int) -> Indices:
    """Which of some places cost the least at their poses, so many of each."""
    order = np.lexsort((excess, value, pose))
    first = np.searchsorted(pose[order], pose[order])
    return order[np.arange(len(order)) - first < count]
