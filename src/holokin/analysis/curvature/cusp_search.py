"""Cusp points of a leaf by Newton's method from many postures. [Wen07], theory 7.3

f restricted to a leaf g(q) = c is no local diffeomorphism where E = [J; J_g] is singular. There E v = 0, u^T E = 0, and

    kappa = u^T (dE/dt v)  for dq/dt = v

tells a fold, kappa != 0, from what may be a cusp. It is one where the corank is 1, the least singular value sigma
changes along the leaf, and kappa changes along v: then the leaf lies over the poses as (s, y) -> (s^3 + y s, y). Where
sigma does not change along the leaf two singular sheets cross, as for spherical wrists: a double point, and no cusp.
These are r + 2 equations of n joints, so that cusps form a set of dimension m - 2. A task of one row has none: its leaf
is a curve, whose tangent is v wherever the leaf is singular, and sigma changes along v by kappa = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.types import Array, Flags, Indices, Matrix, Value, Vector, kept
from ...motion.ik.branch import turning
from ...motion.ik.newton import newton
from ...strategies import HolonomicStrategy
from ...symbolic import Function, directional, gradient, jacobian, symbol, vertcat

STEPS = 40
"""Newton steps from one start: of 1,000 on a Panda that get anywhere, all but two take less than 30."""

LONGEST = 0.3
"""Largest joint motion [joint units] of one step."""

EXACT = 1e-10
"""Last correction [joint units] of a cusp that counts as found."""

RESIDUAL = 1e-8
"""g - c [rows of g over their slopes: joint units], sigma and kappa, the rows of E of size one, up to which a posture
counts as a cusp. They are measured before the last correction, by which they only fall: below `EXACT` times slopes."""

SINGULAR = 1e-6
"""The same of a start that came to crossing sheets, where Newton's method converges slowly."""

CORANK = 1e-3
"""Second least singular value over the largest, below which the corank may be 2."""

SLOPE = 1e-3
"""Change of sigma along the leaf [1 / joint unit] below which two singular sheets may cross."""

THIRD = 1e-5
"""Change of kappa along v [1 / joint unit^2] below which the point may be more degenerate than a cusp."""


@dataclass(frozen=True, eq=False)
class CuspPoints(Value):
    """Cusps q (k, n) of a leaf. At each, unit directions (k, n): `down` along the leaf, to where three postures share a
    pose; `along`, v, in which these part.
    """

    q: Matrix
    down: Matrix
    along: Matrix


@kept
def cusp_functions(strategy: HolonomicStrategy) -> tuple[Function, Function]:
    """(q -> (E (n, n), g (r,)), (q, u, v) -> (d(E v)/dq, d(E^T u)/dq, kappa, its gradient by q with u and v held)).

    E has the geometric rows of a full orientation, and no scale.
    """
    e, n = turning(strategy), strategy.task.n
    E, u, v = vertcat(e.J, e.planes), symbol("u", n), symbol("v", n)
    kappa = u.T @ directional(E @ v, e.q, v)
    slopes = {
        "Ev": jacobian(E @ v, e.q), "Eu": jacobian(E.T @ u, e.q), "kappa": kappa, "slope": gradient(kappa, e.q).T,
    }  # fmt: skip
    extended = Function("cusp_rows", {"q": e.q}, {"E": E, "g": strategy.constraint_expression})
    return extended, Function("cusp_slopes", {"q": e.q, "u": u, "v": v}, slopes)


class CuspEquations:
    """g(q) = c, sigma(q) = 0, kappa(q) = 0: r + 2 equations of n joints, and their exact slopes.

    Of each of k starts it keeps what was measured last: second, slope and third, (k,), as of the thresholds above;
    down, along (k, n), as of `CuspPoints`; normals (k, r + 2, n), orthonormal rows that span the slopes.
    """

    def __init__(self, strategy: HolonomicStrategy, level: Vector, q: Matrix) -> None:
        self._strategy, self._level, self._m = strategy, level, strategy.task.m
        self._extended, self._slopes = cusp_functions(strategy)
        rows = np.nanmean(np.square(self._extended.batch(q)[0]).sum(axis=2), axis=0)
        self._sizes = 1.0 / np.sqrt(np.where(rows > 0, rows, 1.0))
        k, n = q.shape
        self.second, self.slope, self.third = (np.full(k, np.inf) for _ in range(3))
        self._left = np.full((k, n - self._m + 2), np.inf)
        self.down, self.along, self.normals = np.zeros((k, n)), np.zeros((k, n)), np.zeros((k, n - self._m + 2, n))

    @property
    def off(self) -> Vector:
        """By how much the equations failed (k,) when they were measured last, see `RESIDUAL`."""
        return np.abs(self._left * np.append(self._sizes[self._m :], [1.0, 1.0])).max(axis=1)

    def correct(self, q: Matrix, i: Indices) -> tuple[Matrix, Flags]:
        """Least-norm steps (k, n) of Newton's method, and whether they are finite (k,). It keeps what it measures."""
        k, n, m = *q.shape, self._m
        E, g = self._extended.batch(q)
        sound = np.isfinite(E).all(axis=(1, 2)) & np.isfinite(g.reshape(k, -1)).all(axis=1)
        E = np.where(sound[:, None, None], E * self._sizes[:, None], np.eye(n))
        U, S, Vt = np.linalg.svd(E)
        u, v = U[:, :, -1], Vt[:, -1]
        Ev, Eu, kappa, slope = self._slopes.batch(q, u * self._sizes, v)
        Ev, kappa, slope = Ev * self._sizes[:, None], kappa.reshape(k, 1), slope.reshape(k, n)
        of_sigma = np.einsum("ki,kij->kj", u, Ev)
        of_kappa = slope + self._of_vectors(U, S, Vt, Ev, Eu, of_sigma)
        gap = self._strategy.constraint.nearest(g.reshape(k, -1) - self._level)
        A = np.concatenate([E[:, m:] / self._sizes[m:, None], of_sigma[:, None], of_kappa[:, None]], axis=1)
        b = np.concatenate([gap, S[:, -1:], kappa], axis=1)
        self._left[i] = b
        self._measure(i, S, of_sigma, of_kappa, E[:, m:], v)
        step, self.normals[i] = _least_norm(A, b)
        return step, sound & np.isfinite(A).all(axis=(1, 2)) & np.isfinite(b).all(axis=1)

    def _of_vectors(self, U: Array, S: Matrix, Vt: Array, Ev: Array, Eu: Array, of_sigma: Matrix) -> Matrix:
        """What the turning of u and v adds to the slope of kappa: E dv = -dE v and E^T du = -dE^T u across them."""
        v, inverse = Vt[:, -1], 1.0 / np.maximum(S[:, :-1, None], 1e-300)
        dv = -np.swapaxes(Vt[:, :-1], 1, 2) @ (inverse * (np.swapaxes(U[:, :, :-1], 1, 2) @ Ev))
        du = -U[:, :, :-1] @ (inverse * (Vt[:, :-1] @ Eu))
        by_v = np.einsum("kij,kj->ki", Eu, v) + of_sigma
        by_u = np.einsum("kij,kj->ki", Ev, v)
        return np.einsum("ki,kij->kj", by_v, dv) + np.einsum("ki,kij->kj", by_u, du)

    def _measure(self, i: Indices, S: Matrix, of_sigma: Matrix, of_kappa: Matrix, planes: Array, v: Matrix) -> None:
        """Keep how regular the point is, and the directions in which two postures of one pose lie and part."""
        r = planes.shape[1]
        along = of_sigma
        if r:
            rows = np.linalg.svd(planes)[2][:, :r]
            along = of_sigma - np.einsum("kji,kj->ki", rows, np.einsum("kij,kj->ki", rows, of_sigma))
        size = np.linalg.norm(along, axis=1)
        third = np.einsum("ki,ki->k", of_kappa, v)
        self.second[i], self.slope[i], self.third[i] = S[:, -2] / S[:, 0], size, np.abs(third)
        self.down[i] = -np.sign(third)[:, None] * along / np.maximum(size, 1e-300)[:, None]
        self.along[i] = v


def _least_norm(A: Array, b: Matrix) -> tuple[Matrix, Array]:
    """(-A^+ b of many wide systems, their rows of size one; orthonormal rows that span those of A)."""
    size = np.maximum(np.linalg.norm(A, axis=2), 1e-300)
    A, b = A / size[:, :, None], b / size
    finite = np.asarray(np.isfinite(A).all(axis=(1, 2)))
    U, S, Vt = np.linalg.svd(np.where(finite[:, None, None], A, 0.0), full_matrices=False)
    with np.errstate(invalid="ignore", over="ignore"):
        return -np.einsum("kji,kj->ki", Vt, np.einsum("kij,ki->kj", U, b) / np.maximum(S, 1e-300)), Vt


def seek_cusps(strategy: HolonomicStrategy, level: Vector, starts: Matrix) -> tuple[CuspPoints, int, int]:
    """The cusps of the leaf g = level (r,) that Newton's method finds from starts (k, n); how many others came to where
    singular sheets cross; and to a corank of two or more. A task of one row has none."""
    if strategy.task.m < 2:
        none = np.zeros((0, strategy.task.n))
        return CuspPoints(none, none, none), 0, 0
    equations = CuspEquations(strategy, level, starts)
    q, arrived = newton(equations.correct, starts, steps=STEPS, longest=LONGEST, exact=EXACT)
    flat, low = ~(equations.slope >= SLOPE), ~(equations.second >= CORANK)
    there = equations.off <= np.where(arrived, RESIDUAL, SINGULAR)
    good = arrived & there & ~flat & ~low & (equations.third > THIRD)
    found = CuspPoints(q[good], equations.down[good], equations.along[good])
    return found, int(np.sum(there & flat & ~low)), int(np.sum(there & low))
