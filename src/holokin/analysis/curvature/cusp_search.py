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
from ...motion.self_motions.posture_search import EXACT, newton
from ...strategies import HolonomicStrategy
from ...strategies.self_motion_curves import joint_gap
from ...symbolic import Function, directional, gradient, jacobian, symbol, vertcat

LONGEST = 0.3
"""Largest joint motion [joint units] of a Newton step."""

RESIDUAL = 1e-8
"""g - c [rows of g over their slopes: joint units], sigma and kappa, the rows of E of size one, up to which a posture
counts as a cusp. They are measured before the last correction, by which they only fall: below `EXACT` times slopes."""

CORANK = 1e-3
"""Second least singular value over the largest, below which the corank may be 2."""

SLOPE = 1e-3
"""Change of sigma along the leaf [1 / joint unit] below which two singular sheets may cross."""


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
    slopes = {"Ev": jacobian(E @ v, e.q), "Eu": jacobian(E.T @ u, e.q)}
    slopes |= {"kappa": kappa, "slope": gradient(kappa, e.q).T}
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
        self._residuals = np.full((k, n - self._m + 2), np.inf)
        self.down, self.along, self.normals = np.zeros((k, n)), np.zeros((k, n)), np.zeros((k, n - self._m + 2, n))

    @property
    def off(self) -> Vector:
        """By how much the equations failed (k,) when they were measured last, see `RESIDUAL`."""
        return np.abs(self._residuals * np.append(self._sizes[self._m :], [1.0, 1.0])).max(axis=1)

    def correct(self, q: Matrix, i: Indices) -> tuple[Matrix, Flags]:
        """Least-norm steps (k, n) of Newton's method, and whether they are finite (k,). It keeps what it measures."""
        k, n, m = *q.shape, self._m
        # E = U S V^T, its rows of about size one; u and v belong to the least singular value sigma
        E, g = self._extended.batch(q)
        sound = np.isfinite(E).all(axis=(1, 2)) & np.isfinite(g.reshape(k, -1)).all(axis=1)
        E = np.where(sound[:, None, None], E * self._sizes[:, None], np.eye(n))
        U, S, Vt = np.linalg.svd(E)
        u, v = U[:, :, -1], Vt[:, -1]
        Ev, Eu, kappa, slope = self._slopes.batch(q, u * self._sizes, v)
        Ev, kappa, slope = Ev * self._sizes[:, None], kappa.reshape(k, 1), slope.reshape(k, n)
        of_sigma = np.einsum("ki,kij->kj", u, Ev)

        # The slope of kappa, with what the turning of u and v adds: E dv = -dE v and E^T du = -dE^T u across them
        inverse = 1.0 / np.maximum(S[:, :-1, None], 1e-300)
        dv = -np.swapaxes(Vt[:, :-1], 1, 2) @ (inverse * (np.swapaxes(U[:, :, :-1], 1, 2) @ Ev))
        du = -U[:, :, :-1] @ (inverse * (Vt[:, :-1] @ Eu))
        by_v = np.einsum("kij,kj->ki", Eu, v) + of_sigma
        by_u = np.einsum("kij,kj->ki", Ev, v)
        of_kappa = slope + np.einsum("ki,kij->kj", by_v, dv) + np.einsum("ki,kij->kj", by_u, du)

        # The step, and what is kept of it
        gap = self._strategy.constraint.nearest(g.reshape(k, -1) - self._level)
        A = np.concatenate([E[:, m:] / self._sizes[m:, None], of_sigma[:, None], of_kappa[:, None]], axis=1)
        b = self._residuals[i] = np.concatenate([gap, S[:, -1:], kappa], axis=1)
        self._measure(i, S, of_sigma, of_kappa, E[:, m:], v)
        step, self.normals[i] = _least_norm(A, b)
        return step, sound & np.isfinite(A).all(axis=(1, 2)) & np.isfinite(b).all(axis=1)

    def _measure(self, i: Indices, S: Matrix, of_sigma: Matrix, of_kappa: Matrix, planes: Array, v: Matrix) -> None:
        """Keep how regular the point is, and the directions in which two postures of one pose lie and part."""
        rows = np.linalg.svd(planes)[2][:, : planes.shape[1]]
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
    # 40 steps: of 1,000 starts on a Panda that get anywhere, all but two take less than 30
    q, arrived = newton(equations.correct, starts, steps=40, longest=LONGEST, exact=EXACT)
    flat, low = ~(equations.slope >= SLOPE), ~(equations.second >= CORANK)
    # Newton's method converges slowly to where sheets cross, so that more may be left of the equations there
    singular = equations.off <= np.where(arrived, RESIDUAL, 1e-6)
    # Where kappa changes along v by less than 1e-5 per joint unit^2 the point may be more degenerate than a cusp
    regular = arrived & singular & ~flat & ~low & (equations.third > 1e-5)
    cusps = CuspPoints(q[regular], equations.down[regular], equations.along[regular])
    return cusps, int(np.sum(singular & flat & ~low)), int(np.sum(singular & low))


# --- Which cusps of a leaf are of one family: cusps lie on sets of dimension m - 2. Theory 7.3
#
# Of a task of two rows a cusp is alone. Of more rows what a search finds are samples of curves or surfaces of cusps. A
# joint whose motion alone leads from cusps to cusps, as a base that turns under a task of the whole pose, takes one
# dimension off. Where none is left, cusps that differ in the other joints are of different families; where one is left,
# its curves are followed to their ends.

SAME = 1e-6
"""Difference of the joints [joint units] up to which two cusps are one."""

STEP = 0.1
"""Joint motion [joint units] of a step along a curve of cusps."""

ACROSS = 0.3
"""Share of a step by which the next cusp may lie beside it: another curve of cusps lies beside it altogether."""


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

    def are_cusps(q: Array) -> Flags:
        """Which postures (..., n) fulfil the equations; the rows of E have other sizes than at the cusps."""
        equations = CuspEquations(strategy, level, postures := q.reshape(-1, q.shape[-1]))
        equations.correct(postures, np.arange(len(postures)))
        return np.asarray(equations.off <= 10 * RESIDUAL).reshape(q.shape[:-1])

    # Move a few cusps by each joint alone, by two motions of no special size, then by all these joints together
    n, some, shifts = q.shape[1], q[:8], np.array([0.7, -1.9])
    alone = are_cusps(some + shifts[:, None, None, None] * np.eye(n)[:, None, :])
    symmetric = np.asarray(alone.all(axis=(0, 2)))
    together = are_cusps(some + symmetric * np.linspace(shifts[0], shifts[1], n))
    return symmetric if together.all() else np.zeros(n, dtype=bool)


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
    while (rest := np.flatnonzero(family < 0)).size:
        curve, normals = _curve(strategy, level, q[rest[0]], moving)
        distance, nearest = KDTree(_circles(strategy, curve, moving)).query(_circles(strategy, q[rest], moving))
        gap = np.where(moving, 0.0, joint_gap(strategy.task.robot, q[rest], curve[nearest]))
        beside = np.linalg.norm(np.einsum("kij,kj->ki", normals[nearest], gap), axis=1)
        on_curve = (distance <= STEP) & (beside <= ACROSS * np.linalg.norm(gap, axis=1) + SAME)
        on_curve[0] = True
        family[rest[on_curve]] = count
        count += 1
    return family


def _curve(strategy: HolonomicStrategy, level: Vector, start: Vector, moving: Flags) -> tuple[Matrix, Array]:
    """(cusps (p, n) along the curve through one, (p, r + 2, n) their normals): both ways, until it closes or ends."""
    equations = CuspEquations(strategy, level, start[None])
    equations.correct(start[None], np.zeros(1, dtype=int))
    axes = np.eye(len(start))[moving]
    points, normals = [start], [equations.normals[0].copy()]
    for sign in (1.0, -1.0):
        q, rows, before, length = start, normals[0], None, 0.0
        while length < 200.0:  # joint units, some 30 turns: a curve is followed no farther
            # Along the curve, which is normal to the slopes and to the joints that make cusps of cusps
            tangent = np.linalg.svd(np.vstack([rows, axes]))[2][-1]
            tangent = sign * tangent if before is None else np.copysign(1.0, tangent @ before) * tangent
            cusp = _next(equations, q, tangent)
            if cusp is None:
                break
            length, before, q, rows = (
                length + float(np.linalg.norm(cusp - q)),
                tangent,
                cusp,
                equations.normals[0].copy(),
            )
            points.append(q)
            normals.append(rows)
            # It closes where it comes back to the start in its direction
            back = np.where(moving, 0.0, joint_gap(strategy.task.robot, start, q))
            if length > 4 * STEP and np.linalg.norm(back) <= STEP and back @ tangent >= 0:
                return np.array(points), np.array(normals)
    return np.array(points), np.array(normals)


def _next(equations: CuspEquations, q: Vector, tangent: Vector) -> Vector | None:
    """The next cusp (n,) in a direction; None where the curve ends, or is no curve of cusps any more."""
    for length in STEP * 0.5 ** np.arange(7):
        ahead = q + length * tangent
        (cusp,), arrived = newton(equations.correct, ahead[None], steps=8, longest=LONGEST, exact=EXACT)
        sound = arrived[0] and equations.off[0] <= RESIDUAL and np.linalg.norm(cusp - ahead) <= ACROSS * length
        if sound and equations.second[0] >= CORANK and equations.slope[0] >= SLOPE:
            return cusp
    return None
