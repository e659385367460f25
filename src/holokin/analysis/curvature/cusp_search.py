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
from ...motion.ik.posture_search import EXACT, newton
from ...strategies import HolonomicStrategy
from ...strategies.radial_strategy import joint_gap
from ...symbolic import Function, directional, gradient, jacobian, symbol, vertcat

STEPS = 40
"""Newton steps from one start: of 1,000 on a Panda that get anywhere, all but two take less than 30."""

LONGEST = 0.3
"""Largest joint motion [joint units] of one step."""

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


# --- Which cusps of a leaf are of one family: cusps lie on sets of dimension m - 2. Theory 7.3
#
# Of a task of two rows a cusp is alone. Of more rows what a search finds are samples of curves or surfaces of cusps. A
# joint whose motion alone leads from cusps to cusps, as a base that turns under a task of the whole pose, takes one
# dimension off. Where none is left, cusps that differ in the other joints are of different families; where one is left,
# its curves are followed to their ends.

SAME = 1e-6
"""Difference of the joints [joint units] up to which two cusps are one."""

SHIFTS = (0.7, -1.9)
"""Motions [joint units] of a joint after which a cusp must be one again: two of no special size."""

TESTED = 8
"""Cusps that are moved so."""

MOVED = 10 * RESIDUAL
"""What is left of their equations then: the rows of E have other sizes there."""

STEP, SHORTEST = 0.1, 0.1 / 64
"""Joint motion [joint units] of a step along a curve of cusps; and of the shortest one, before the curve ends."""

ACROSS = 0.3
"""Share of a step by which the next cusp may lie beside it: another curve of cusps lies beside it altogether."""

LENGTH = 200.0
"""Joint motion [joint units] after which a curve is followed no farther: some 30 turns."""


def distinct(strategy: HolonomicStrategy, q: Matrix) -> Indices:
    """The first of each of the cusps q (k, n) that was found several times; whole turns of hinges are not counted."""
    classes = _classes(_circles(strategy, q, np.zeros(q.shape[1], dtype=bool)), SAME)
    return np.sort(np.unique(classes, return_index=True)[1])


def families(strategy: HolonomicStrategy, level: Vector, q: Matrix) -> Indices | None:
    """The family (k,) of each of the cusps q (k, n), which are distinct; None where families are surfaces, of which the
    joints that make cusps of cusps leave two dimensions or more."""
    dimension = strategy.task.m - 2
    if not len(q) or dimension <= 0:
        return np.arange(len(q))
    moving = symmetric_joints(strategy, level, q)
    classes = _classes(_circles(strategy, q, moving), SAME)
    if moving.sum() >= dimension:
        return classes
    return _by_curves(strategy, level, q, moving) if moving.sum() == dimension - 1 else None


def symmetric_joints(strategy: HolonomicStrategy, level: Vector, q: Matrix) -> Flags:
    """Joints (n,) by whose motion alone, and by that of several of them, cusps q (k, n) become other cusps."""
    n, tested = q.shape[1], q[:TESTED]
    alone = tested + np.array(SHIFTS)[:, None, None, None] * np.eye(n)[:, None, :]
    off = _residuals(strategy, level, alone.reshape(-1, n)).reshape(len(SHIFTS), n, len(tested))
    found = np.asarray((off <= MOVED).all(axis=(0, 2)))
    together = tested + found * np.linspace(*SHIFTS, n)
    return found if (_residuals(strategy, level, together) <= MOVED).all() else np.zeros(n, dtype=bool)


def _residuals(strategy: HolonomicStrategy, level: Vector, q: Matrix) -> Vector:
    """By how much postures (k, n) fail the equations of cusps, see `RESIDUAL`."""
    equations = CuspEquations(strategy, level, q)
    equations.correct(q, np.arange(len(q)))
    return equations.off


def _circles(strategy: HolonomicStrategy, q: Matrix, without: Flags) -> Matrix:
    """Joints (k, .), some left out, hinges as points of a circle: so postures that differ by whole turns are one."""
    hinges = strategy.task.robot.hinges
    turns, slides = q[:, hinges & ~without], q[:, ~hinges & ~without]
    return np.hstack([np.cos(turns), np.sin(turns), slides])


def _classes(points: Matrix, near: float) -> Indices:
    """(k,) numbers of points (k, .), the same of those that are near to one another."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    k = len(points)
    if not k:
        return np.zeros(0, dtype=int)
    pairs = KDTree(points).query_pairs(near, output_type="ndarray")
    return connected_components(coo_array((np.ones(len(pairs)), pairs.T), shape=(k, k)), directed=False)[1]


def _by_curves(strategy: HolonomicStrategy, level: Vector, q: Matrix, moving: Flags) -> Indices:
    """The family (k,) of cusps q (k, n) on curves: one of these is followed, and what lies on it is of one family."""
    from scipy.spatial import KDTree

    family, count = np.full(len(q), -1), 0
    while (left := np.flatnonzero(family < 0)).size:
        curve, normals = _curve(strategy, level, q[left[0]], moving)
        away, near = KDTree(_circles(strategy, curve, moving)).query(_circles(strategy, q[left], moving))
        gap = np.where(moving, 0.0, joint_gap(strategy.task.robot, q[left], curve[near]))
        beside = np.linalg.norm(np.einsum("kij,kj->ki", normals[near], gap), axis=1)
        on = (away <= STEP) & (beside <= ACROSS * np.linalg.norm(gap, axis=1) + SAME)
        on[0] = True
        family[left[on]] = count
        count += 1
    return family


def _curve(strategy: HolonomicStrategy, level: Vector, start: Vector, moving: Flags) -> tuple[Matrix, Array]:
    """(cusps (p, n) along the curve through one, (p, r + 2, n) their normals): both ways, until it closes or ends."""
    equations = CuspEquations(strategy, level, start[None])
    equations.correct(start[None], np.zeros(1, dtype=int))
    first, axes = equations.normals[0].copy(), np.eye(len(start))[moving]
    points, normals = [start], [first]
    for sign in (1.0, -1.0):
        q, rows, before, gone = start, first, None, 0.0
        while gone < LENGTH:
            along = np.linalg.svd(np.vstack([rows, axes]))[2][-1]
            along = sign * along if before is None else np.copysign(1.0, along @ before) * along
            found = _next(equations, q, along)
            if found is None:
                break
            gone, before, q, rows = gone + float(np.linalg.norm(found - q)), along, found, equations.normals[0].copy()
            points.append(q)
            normals.append(rows)
            back = np.where(moving, 0.0, joint_gap(strategy.task.robot, start, q))
            if gone > 4 * STEP and np.linalg.norm(back) <= STEP and back @ along >= 0:
                return np.array(points), np.array(normals)
    return np.array(points), np.array(normals)


def _next(equations: CuspEquations, q: Vector, along: Vector) -> Vector | None:
    """The next cusp (n,) in a direction; None where the curve ends, or is no curve of cusps any more."""
    length = STEP
    while length >= SHORTEST:
        wanted = q + length * along
        found, arrived = newton(equations.correct, wanted[None], steps=8, longest=LONGEST, exact=EXACT)
        sound = arrived[0] and equations.off[0] <= RESIDUAL and np.linalg.norm(found[0] - wanted) <= ACROSS * length
        if sound and equations.second[0] >= CORANK and equations.slope[0] >= SLOPE:
            return found[0]
        length /= 2
    return None
