"""The least cost at each tool pose, over the self-motion through a given posture there and over all slopes.

A section has at the pose x some posture and some right inverse; at best the cheapest of both. No integrability is
asked, so the mean of these least costs is a lower bound of the sections whose postures lie on these self-motions
(theory 7.1). The postures of one pose may form several separate curves: others may cost less, and are not looked at.

With one redundant joint whole self-motions are walked. With more a walk is a line in it, and lines are searched one
after another, each from the best posture before: the least found may then be too high.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..tolerances import TOLERANCES
from ..types import Array, Matrix, Value, Vector
from .coordinates import Coordinates
from .objectives import Costs
from .self_motions import STEP, SelfMotions, right_inverse

LENGTH = 20.0
"""A walk goes so far each way [joint units]; a Panda's self-motions close after 13 or less."""

FINER = 8
"""Walks round the best posture have steps shorter by this, twice: the least value is then right to 1e-5."""

LINES = 12
"""Lines searched for each redundant joint, where there are several; a second and a third third of them have steps that
are shorter by `SHORTER` and by its square."""

STEPS = 10
"""Steps of such a line each way."""

SHORTER = 5
"""See `LINES`."""

LAWSON = 12
"""Changes of the joints' weights that balance their greatest speeds: every one gives a lower bound, the last ones agree
to a per cent."""


@dataclass(frozen=True, eq=False)
class LeastCosts(Value):
    """The least costs at each tool pose (S,), and how far postures are beyond the allowed joint limits there, at least.

    `traced` is True where whole self-motions were walked, one curve each.
    """

    squared_speed: Vector
    worst_speed: Vector
    joint_limits: Vector
    beyond: Vector
    traced: bool


def least_costs(
    coordinates: Coordinates, costs: Costs, Q: Matrix, p: Matrix, R: Array, allowed: Vector, *, speeds: bool
) -> LeastCosts:
    """The least costs over the self-motions through postures (S, n) at tool poses p (S, 3), R (S, 3, 3).

    Args:
        allowed: |q - middle| over half the range (n,) up to which postures count; inf for all.
        speeds: whether the worst speed is asked for, too.
    """
    task = coordinates.chart
    r, kinds = task.n - task.m, 4 if speeds else 3

    def least(at: Matrix) -> Matrix:
        J, off = task.jacobian_batch(at)[0], np.abs(at - costs.middle) / costs.half
        G = least_slopes(J, coordinates.P, costs.joints)
        found = [np.sum(G**2 * costs.joints[:, None] * costs.columns**2, axis=(1, 2)), off.max(axis=1)]
        over = (off - allowed).max(axis=1)
        values = np.array([over, *found, *([least_worst(J, coordinates.P, costs)] if speeds else [])])
        values[1:, (over > TOLERANCES.limit) | ~np.isfinite(values[1:]).all(axis=0)] = np.inf
        return values

    motions, values = SelfMotions(task, p, R), np.full((kinds, len(Q)), np.inf)
    best, rng = np.array([Q] * kinds), np.random.default_rng(0)
    v = np.zeros_like(Q)
    for k in range(1 if r == 1 else LINES * r):
        v, step = rng.normal(size=Q.shape), STEP / SHORTER ** (3 * k // (LINES * r))
        found, at = motions.best(least, best[k % kinds], v, step, LENGTH if r == 1 else STEPS * step)
        better = found < values
        values[better], best[better] = found[better], at[better]
    for step in (STEP / FINER, STEP / FINER**2) if r == 1 else ():
        for kind in range(kinds):
            found, at = motions.best(least, best[kind], v, step, 2 * FINER * step)
            better = found < values
            values[better], best[better] = found[better], at[better]
    worst = values[3] if speeds else np.zeros(len(Q))
    return LeastCosts(values[1], worst, values[2], np.maximum(values[0], 0.0), traced=r == 1)


def least_slopes(J: Array, P: Matrix, weights: Array) -> Array:
    """G P (S, n, d) of the right inverse with the least weighted squared joint speed: W^-1 J^T (J W^-1 J^T)^-1 P.

    weights: (n,), or one for each sample (S, n).
    """
    return right_inverse(J, np.broadcast_to(P, (len(J), *P.shape)), weights)


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
