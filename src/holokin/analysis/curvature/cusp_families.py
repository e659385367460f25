"""Which cusps of a leaf are of one family: cusps lie on sets of dimension m - 2. Theory 7.3

Of a task of two rows a cusp is alone. Of more rows what a search finds are samples of curves or surfaces of cusps. A
joint whose motion alone leads from cusps to cusps, as a base that turns under a task of the whole pose, takes one
dimension off. Where none is left, cusps that differ in the other joints are of different families; where one is left,
its curves are followed to their ends.
"""

from __future__ import annotations

import numpy as np

from ...base.types import Array, Flags, Indices, Matrix, Vector
from ...motion.ik.newton import newton
from ...strategies import HolonomicStrategy
from ...strategies.self_motions import joint_gap
from .cusp_search import CORANK, EXACT, LONGEST, RESIDUAL, SLOPE, CuspEquations

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
