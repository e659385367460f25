"""Laws whose level is a polynomial of the tool pose, fitted so that one leaf serves more poses.

    g(q) = c(q) - zeta(x)

At a pose x the self-motion leads through many levels of a law c(q), and the limits allow some of them. A polynomial
zeta that is an allowed level at each pose gives a law that serves them all on one leaf, g = 0. The levels that are
allowed are looked at once for each sheet that a search began with; each polynomial then is a linear program.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.errors import ArgumentError
from ...base.poses import pose_from
from ...base.types import Array, Flags, Indices, Matrix, Value, Vector
from ...strategies import HolonomicStrategy, holonomic
from ...strategies.constraints import tilted
from ...strategies.polynomial import monomials_up_to
from ..coverage.candidates import Candidate
from ..coverage.coordinates import Coordinates, Polynomial, chart_of, coordinates_of, values_and_slopes
from ..coverage.line_ends import along_leaf, one_by_one
from .sheet import known
from .sheet_growth import Go, grown

STEPS = 16
"""Levels on each side of that of the start at most."""

DEGREES = (1, 2, 3)
"""Of the polynomials that are tried."""

POSES_A_TERM = 2
"""Poses for each coefficient of a polynomial at least: fewer would be served by chance."""

INSIDE = 2.5
"""Steps of the levels by which a polynomial is to keep within the levels that are allowed, where there is room."""

ROUNDS, NEAR = 5, 0.25
"""Linear programs, each with weights 1 / (excess + NEAR steps) of the one before: so few poses are missed, rather than
all by little."""

SMALL = 0.03
"""What a coefficient of one step costs against a pose that is missed by one step."""


@dataclass(frozen=True, eq=False)
class LevelTable(Value):
    """Which levels (l,) of a law the poses T (k, 4, 4) have on one branch: postures q (l, k, n), NaN for none."""

    law: Candidate
    T: Array
    levels: Vector
    step: float
    q: Array

    @cached_property
    def coordinates(self) -> Coordinates | None:
        """Those of the polynomials; None where the poses are all alike, or full orientations turn too far."""
        R = self.T[:, :3, :3]
        middle = int(np.argmax(np.einsum("aij,bij->ab", R, R).min(axis=1).round(9)))  # least turn to the farthest
        if not self.allowed.any():
            return None
        try:
            return coordinates_of(chart_of(self.law.task, self.T[middle, :3, :3]), self._some[self.allowed])
        except ArgumentError:
            return None

    @cached_property
    def allowed(self) -> Flags:
        """The poses (k,) that have a level."""
        return np.asarray(known(self.q).any(axis=0))

    @cached_property
    def _some(self) -> Matrix:
        """A posture (k, n) at each pose, NaN where there is none."""
        return self.q[np.argmax(known(self.q), axis=0), np.arange(len(self.T))]

    @cached_property
    def ranges(self) -> tuple[Vector, Vector]:
        """The least and the largest level (k,) of the longest row of levels that are allowed; NaN where none is."""
        there, best = known(self.q), np.zeros(len(self.T), dtype=int)
        long, last = np.zeros(len(self.T), dtype=int), np.zeros(len(self.T), dtype=int)
        for i, row in enumerate(there):
            long = np.where(row, long + 1, 0)
            last, best = np.where(long > best, i, last), np.maximum(best, long)
        low, high = self.levels[last - np.maximum(best - 1, 0)], self.levels[last]
        return np.where(best > 0, low, np.nan), np.where(best > 0, high, np.nan)

    def fitted(self, weights: Vector) -> list[tuple[Candidate, Vector, Vector]]:
        """Laws fitted to the poses, by their weights (k,); of each a posture (n,), and the levels of this law that it
        wants at the poses (k,), NaN where none is known."""
        c, found = self.coordinates, []
        if c is None:
            return []
        at = np.flatnonzero(self.allowed)
        u, (low, high) = c.at(self._some[at]), (one[at] for one in self.ranges)
        for degree in DEGREES:
            terms = monomials_up_to(c.d, degree)
            if POSES_A_TERM * len(terms) > len(at):
                break
            A, _ = values_and_slopes(u, terms)
            x = _least_excess(A, low, high, self.step, weights[at])
            if x is None:
                continue
            wanted, room = np.full(len(self.T), np.nan), np.full(len(self.T), -np.inf)
            wanted[at] = A @ (x := _short(x, self.step))
            room[at] = np.minimum(wanted[at] - low, high - wanted[at])
            if (law := self._law(c, x, degree, room, wanted)) is not None:
                found.append((*law, wanted))
        return found

    def _law(
        self, c: Coordinates, x: Vector, degree: int, room: Vector, wanted: Vector
    ) -> tuple[Candidate, Vector] | None:
        """The law of a polynomial's coefficients (t,), and its posture at the pose with most room (k,) on both sides of
        the level that it wants there."""
        task, base = self.law.task, self.law.strategy
        if base is None:
            return None
        at = int(np.argmax(room))
        level = int(np.argmin(np.where(known(self.q[:, at]), np.abs(self.levels - wanted[at]), np.inf)))
        name = f"{self.law.name}, level of degree {degree}"
        zeta = Polynomial(c, x[None])
        strategy = holonomic(task, tilted(base.constraint, zeta, chart=c.chart, name=name), name=name)
        q, reached = one_by_one(strategy, self.q[level, at][None], self.T[at][None], levels=np.zeros(1))
        if not reached[0] or not task.robot.within(q[0]):
            return None
        return Candidate(name, zeta.keys_over(self.law.keys), task, strategy, 0.0), q[0]


def _short(x: Vector, step: float) -> Vector:
    """Numbers that a job can be read with: to a millionth of the step between levels, or a little better."""
    return np.asarray(np.round(x, 6 - math.floor(math.log10(step))))


def level_table(
    law: Candidate, strategy: HolonomicStrategy, q0: Vector, step: float, T: Array, near: Indices, go: Go,
    native: int | None,
) -> LevelTable:  # fmt: skip
    """The levels of a law at poses T (k, 4, 4), on the branch of a posture q0 (n,) of the law's own.

    From q0 the self-motion leads to other levels. On each of them the leaf is followed to all poses, first straight,
    then from neighbour to neighbour, and at each pose from level to level, as long as that adds any.

    Args:
        step: between levels [units of c]. near: of each pose its neighbours (k, m). go: straight along the leaf, to
            what is allowed.
    """
    at = pose_from(*law.task.poses(q0[None]))
    levels, starts = _along_self_motion(strategy, q0, at, step)
    count, k = len(levels), len(T)
    q = along_leaf(strategy, starts, T, native_from=native)
    rows, poses = np.where(q.reached[..., None], q.q, np.nan).reshape(count * k, -1), np.tile(T, (count, 1, 1))
    rows = _allowed(go, rows, np.arange(count * k) % k)
    beside = (np.tile(near, (count, 1)) + k * np.repeat(np.arange(count), k)[:, None]).astype(int)
    before = -1
    while (now := int(known(rows).sum())) > before:
        before = now
        rows = grown(rows, beside, lambda begin, at: go(begin, at % k))[0]
        for shift in (k, -k):
            at = np.arange(count * k)[:-k] + (k if shift > 0 else 0)
            at = at[known(rows[at - shift]) & ~known(rows[at])]
            if not len(at):
                continue
            there, reached = one_by_one(strategy, rows[at - shift], poses[at], native, levels[at // k, None])
            there[~reached] = np.nan
            rows[at] = _allowed(go, there, at % k)
    return LevelTable(law, T, levels, step, rows.reshape(count, k, -1))


def _along_self_motion(strategy: HolonomicStrategy, q0: Vector, at: Array, step: float) -> tuple[Vector, Matrix]:
    """Levels (l,) in order, and the postures (l, n) of them to which the self-motion leads from q0."""
    level = float(strategy.constraint_value.batch(q0[None]).ravel()[0])
    found = [(level, q0)]
    for sign in (1, -1):
        q = q0[None]
        for i in range(1, STEPS + 1):
            q, reached = one_by_one(strategy, q, at, levels=np.array([level + sign * i * step]))
            if not reached[0] or not strategy.task.robot.within(q[0]):
                break
            found.append((level + sign * i * step, q[0]))
    found.sort(key=lambda one: one[0])
    return np.array([one[0] for one in found]), np.array([one[1] for one in found])


def _allowed(go: Go, q: Matrix, poses: Indices) -> Matrix:
    """Postures (k, n) at their poses, by their numbers (k,); NaN where they are not there, or not allowed."""
    at = np.flatnonzero(known(q))
    if not len(at):
        return q
    there, served = go(q[at], poses[at])
    q[at] = np.where(served[:, None], there, np.nan)
    return q


def _least_excess(A: Matrix, low: Vector, high: Vector, step: float, weights: Vector) -> Vector | None:
    """Coefficients x (t,) with low <= A x <= high at as many rows as can be, by linear programs; None if they fail."""
    from scipy.optimize import linprog
    from scipy.sparse import csr_array, eye_array, hstack, vstack

    inside = np.minimum(INSIDE * step, (high - low) / 2)
    low, high = (low + inside) / step, (high - inside) / step
    (k, t), weigh, x = A.shape, weights, None
    rows = csr_array(A)
    out = vstack([hstack([rows, -rows, -eye_array(k)]), hstack([-rows, rows, -eye_array(k)])])
    for _ in range(ROUNDS):
        cost = np.concatenate([np.full(2 * t, SMALL), weigh])
        found = linprog(cost, A_ub=out, b_ub=np.concatenate([high, -low]), method="highs")
        if found.x is None:
            break
        x = step * (found.x[:t] - found.x[t : 2 * t])
        weigh = weights / (found.x[2 * t :] + NEAR)
    return x
