"""What no section of a workspace can do better: the least cost at each tool pose, over its self-motion and all slopes.

A section has at the pose x some posture of the self-motion there and some right inverse; at best the cheapest of both.
No integrability is asked, so the mean of these least costs is a lower bound of every section's (theory 7.1).

The self-motions are walked all at once, straight: dq/ds = v, v the last direction without its part that moves the tool.
With one redundant joint that is the whole self-motion. With more it is a line in it, and lines are searched one after
another, each from the best posture before: the least found may then be too high.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..task import Task
from ..tolerances import TOLERANCES
from ..types import Array, Flags, Matrix, Value, Vector
from .coordinates import Coordinates
from .objectives import Costs

STEP = 0.2
"""Arc length [joint units] between the postures of a walk."""

LENGTH = 20.0
"""A walk goes so far each way [joint units]; a Panda's self-motions close after 13 or less."""

FINER = 8
"""Walks round the best posture have steps shorter by this, twice: the least value is then right to 1e-5."""

LINES = 24
"""Lines searched for each redundant joint, where there are several."""

LAWSON = 12
"""Changes of the joints' weights that balance their greatest speeds: every one gives a lower bound, the last ones agree
to a per cent."""


@dataclass(frozen=True, eq=False)
class LeastCosts(Value):
    """The least costs at each tool pose (S,); `traced` is True where whole self-motions were walked, one curve each."""

    squared_speed: Vector
    worst_speed: Vector
    joint_limits: Vector
    traced: bool


def least_costs(
    coordinates: Coordinates, costs: Costs, Q: Matrix, p: Matrix, R: Array, *, limits: bool, speeds: bool
) -> LeastCosts:
    """The least costs over the self-motions through postures (S, n) at tool poses p (S, 3), R (S, 3, 3).

    Args:
        limits: only postures within the joint limits count. speeds: whether the worst speed is asked for, too.
    """
    task = coordinates.chart
    r, kinds = task.n - task.m, 3 if speeds else 2

    def least(at: Matrix) -> Matrix:
        J, off = task.jacobian_batch(at)[0], np.abs(at - costs.middle) / costs.half
        G = least_slopes(J, coordinates.P, costs.joints)
        found = [np.sum(G**2 * costs.joints[:, None] * costs.columns**2, axis=(1, 2)), off.max(axis=1)]
        values = np.array([*found, least_worst(J, coordinates.P, costs)] if speeds else found)
        outside = limits & (off > 1 + TOLERANCES.limit).any(axis=1)
        values[:, outside | ~np.isfinite(values).all(axis=0)] = np.inf
        return values

    walker, values = _Walker(task, p, R, least), np.full((kinds, len(Q)), np.inf)
    best, rng = np.array([Q] * kinds), np.random.default_rng(0)
    for line in range(1 if r == 1 else LINES * r):
        v = rng.normal(size=Q.shape)
        found, at = walker.best(best[line % kinds], v, STEP, LENGTH)
        for finer in (STEP / FINER, STEP / FINER**2):
            for kind in range(kinds):
                near, there = walker.best(at[kind], v, finer, 2 * FINER * finer)
                better = near < found
                found[better], at[better] = near[better], there[better]
        better = found < values
        values[better], best[better] = found[better], at[better]
    return LeastCosts(values[0], values[2] if speeds else np.zeros(len(Q)), values[1], traced=r == 1)


def least_slopes(J: Array, P: Matrix, weights: Vector) -> Array:
    """G P (S, n, d) of the right inverse with the least weighted squared joint speed: W^-1 J^T (J W^-1 J^T)^-1 P."""
    T = np.swapaxes(J, 1, 2) / (weights[:, None] if weights.ndim == 1 else weights[:, :, None])
    with np.errstate(all="ignore"):
        try:
            return T @ np.linalg.solve(J @ T, np.broadcast_to(P, (len(J), *P.shape)))
        except np.linalg.LinAlgError:
            return T @ np.linalg.pinv(J @ T) @ P


def least_worst(J: Array, P: Matrix, costs: Costs) -> Vector:
    """Lower bounds (S,) of max_i |G_i| / max_velocity_i over all right inverses: max >= the mean with any weights."""
    known = costs.speeds > 0
    share, best = np.full((len(J), len(known)), 1.0 / known.sum()) * known, np.zeros(len(J))
    for _ in range(LAWSON):
        weights = share * costs.speeds**2 + 1e-12  # joints without a speed limit are free
        G = least_slopes(J, P, weights)
        used = np.sum((G * costs.columns) ** 2, axis=2) * costs.speeds**2
        total = np.sum(share * used, axis=1)
        best = np.fmax(best, total)
        share = share * np.sqrt(used) / np.sum(share * np.sqrt(used), axis=1, keepdims=True)
    return np.sqrt(best)


class _Walker:
    """Walks along the self-motions at tool poses p (S, 3), R (S, 3, 3), all at once, for the least of some costs.

    least: postures (k, n) -> costs (kinds, k).
    """

    def __init__(self, task: Task, p: Matrix, R: Array, least: Callable[[Matrix], Matrix]) -> None:
        self._task, self._p, self._R, self._least = task, p, R, least

    def best(self, Q: Matrix, v: Matrix, step: float, length: float) -> tuple[Matrix, Array]:
        """The least of each cost (kinds, S) on walks both ways from Q (S, n), and its postures (kinds, S, n)."""
        values = self._least(Q)
        best, closed = np.array([Q] * len(values)), np.zeros(len(Q), dtype=bool)
        for sign in (1.0, -1.0):
            i = np.flatnonzero(~closed)
            at, along, _ = self._step(Q[i], sign * v[i], i, 0.0)
            for k in range(int(np.ceil(length / step))):
                at, along, sound = self._step(at, along, i, step)
                back = np.linalg.norm(at - Q[i], axis=1) < 0.75 * step if k > 2 else np.zeros(len(i), dtype=bool)
                closed[i[back]] = True
                i, at, along = i[sound & ~back], at[sound & ~back], along[sound & ~back]
                if not len(i):
                    break
                found = self._least(at)
                for kind, better in enumerate(found < values[:, i]):
                    values[kind, i[better]], best[kind, i[better]] = found[kind, better], at[better]
        return values, best

    def _step(self, q: Matrix, v: Matrix, i: Array, step: float) -> tuple[Matrix, Matrix, Flags]:
        """One step of postures (k, n) along their directions: (postures, directions there, which of them hold)."""
        start = q
        q = q + step * v if step else q
        for _ in range(2):
            J = self._task.jacobian_batch(q)[0]
            e = self._task.error_function.batch(q, self._p[i], self._R[i]).reshape(len(q), -1)
            wanted = np.stack([e, np.einsum("kmn,kn->km", J, v)], axis=2)
            T = np.swapaxes(J, 1, 2)
            with np.errstate(all="ignore"):
                try:
                    found = T @ np.linalg.solve(J @ T, wanted)
                except np.linalg.LinAlgError:
                    found = T @ np.linalg.pinv(J @ T) @ wanted
            q, v = q + found[:, :, 0], v - found[:, :, 1]
            v = v / np.linalg.norm(v, axis=1, keepdims=True)
        sound = np.isfinite(q).all(axis=1) & (np.linalg.norm(q - start, axis=1) < 2 * step + 1e-6)
        q[~sound] = 0.0
        return q, v, sound
