"""`GeneralInverse`: all postures, up to sixteen, of six hinges of any kind at a tool pose, other joints being held."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...base.types import Array, ArrayLike, Flags, Indices, Matrix, Value, Vector, frozen, joined, some
from ..model import Robot
from .arm_classes import Link, NoClass, links_of, no_six_hinges
from .loop_roots import ORDERS, LoopRoots, Order, inverse_poses, loop_roots, turn_z

SURE = 1e-4
"""Imaginary part [rad] below which a root must come to a posture of its own, or the pose is doubtful."""

SAME = 1e-6
"""Distance [rad] of joints up to which two postures are one: a double root is found to the root of round-off, 1e-8."""

CLOSED = 1e-13
"""Largest difference [m, -] between the tool at a posture and the pose, as a share of distances over 1 m."""

SINGULAR = 1e-7
"""Smallest over largest singular value of the Jacobian of the six joints below which two postures meet."""

_STEPS = 20
"""Steps of Newton's method, each of which halves what is left near a double root. Most roots need one."""

_LONGEST = 0.3
"""Longest step [rad]: roots are nearer than that."""

_SETTLED = 1e-8
"""Length of a step [rad] after which the next one would be round-off."""

_ASIDE = 0.02
"""How far [rad] a singular posture is moved on, to see whether it is on a curve of them."""

_BESIDE = 1e-3 * np.array([0.5, -0.7, 0.5])
"""How far [m] from a singular pose are those beside it, at which roots are single; held values by the first number."""

_PROBES = 16
"""Random postures by which the orders of the loop are compared."""

_FAIR = 1e-4
"""How well a root closes the loop, and finds a posture again [m, rad], that is not yet polished."""


@dataclass(frozen=True, eq=False)
class _Polished(Value):
    """Joints (K, 6) of postures, and the pose (K,), residual (K,) and rcond (K,) of each.

    roots (K,): how many real ones came to it.
    """

    q: Matrix
    row: Indices
    residual: Vector
    rcond: Vector
    roots: Indices

    def distinct(self, k: int) -> _Polished:
        """Without those that are another of the same of k poses, in the order of these."""
        ordered = some(self, np.argsort(self.row, kind="stable"))
        count = np.bincount(ordered.row, minlength=k)
        begin = np.cumsum(count) - count
        place = np.arange(len(ordered.row)) - begin[ordered.row]
        each = np.full((k, max(1, count.max(initial=0)), 6), np.nan)
        each[ordered.row, place] = ordered.q
        later, before = np.tril_indices(each.shape[1], -1)
        row, pair = np.nonzero(_apart(each[:, later], each[:, before]) < SAME)
        if not len(row):
            return ordered
        first = np.arange(len(ordered.row))
        np.minimum.at(first, begin[row] + later[pair], begin[row] + before[pair])
        roots = np.bincount(first, weights=ordered.roots, minlength=len(first)).astype(int)
        return some(replace(ordered, roots=roots), first == np.arange(len(first)))


_NONE = _Polished(np.zeros((0, 6)), np.zeros(0, int), np.zeros(0), np.zeros(0), np.zeros(0, int))


@dataclass(frozen=True, eq=False)
class GeneralPostures(Value):
    """Postures at k poses.

    q (K, n). row (K,): the pose of each, in increasing order. residual (K,): largest difference [m, -] between the
    tool's pose and it. rcond (K,): smallest over largest singular value of the Jacobian of the six joints; below
    `SINGULAR` two postures meet. doubtful (k,): a real eigenvalue came to no posture of its own, or the equations are
    singular at the pose, so postures may be missing. curve (k,): some posture is on a curve of them, of which there are
    only points here.
    """

    q: Matrix
    row: Indices
    residual: Vector
    rcond: Vector
    doubtful: Flags
    curve: Flags

    def at(self, row: int) -> Matrix:
        """Those of one pose, (j, n)."""
        first, last = np.searchsorted(self.row, [row, row + 1])
        return self.q[first:last]


@dataclass(frozen=True, eq=False)
class GeneralInverse(Value):
    """All postures of an arm at a tool pose, up to sixteen, for given values of the joints that are held.

    held: the coordinates without which six hinges of the chain to the tip are left. `general_inverse` says of which
    arms it is.
    """

    robot: Robot
    held: tuple[int, ...]
    tip: str | None = None

    def postures(self, poses: ArrayLike, held: ArrayLike) -> GeneralPostures:
        """The postures at tool poses (k, 4, 4), the held joints having values (k, r) or (r,).

        The values of hinges are at the turn nearest to the middle of their range; nothing is left out for its limits.
        Coordinates off the chain are 0.
        """
        poses = _rigid(np.asarray(poses, dtype=float))
        k = len(poses)
        held = np.broadcast_to(np.asarray(held, dtype=float), (k, len(self.held)))
        known, doubtful = _NONE, np.ones(k, dtype=bool)
        for order in self.orders:
            left = np.flatnonzero(doubtful)
            roots = self._roots(poses[left], held[left], order)
            more = self._polished(roots.angles, left[roots.row], poses, held, roots.imaginary < SURE).distinct(k)
            # Each real root comes to a posture of its own; only one that is singular is that of several. An order that
            # knows no real root takes away no doubt of another.
            real = np.bincount(left[roots.row[roots.imaginary < SURE]], minlength=k)
            serves = np.where(more.rcond < SINGULAR, np.maximum(more.roots, 1), 1)
            doubtful[left] = roots.ill | ((real[left] == 0) & (order != self.orders[0]))
            doubtful |= real > np.bincount(more.row, weights=serves, minlength=k)
            known = joined(known, more).distinct(k) if len(known.row) else more
            if not doubtful.any():
                break
        left = np.flatnonzero(doubtful)
        if len(left):
            known = joined(known, self._beside(left, poses, held)).distinct(k)
        q = self._whole(known.q, known.row, held)
        curve = self._curves(known, poses, held)
        return GeneralPostures(*(frozen(x) for x in (q, known.row, known.residual, known.rcond, doubtful, curve)))

    @cached_property
    def others(self) -> list[int]:
        """The coordinates of the six joints, in their order along the arm."""
        return [link.coordinate for link in self._free]

    @cached_property
    def orders(self) -> tuple[Order, ...]:
        """The orders of the loop by which random postures are found again: the best, then those for poses in doubt.

        None, where the equations are singular for all poses.
        """
        q = _probes(self.robot)
        loop = self._loop(self.robot.pose(q, self.tip), q[:, list(self.held)])
        multipliers, offsets, _ = self._joints
        marks = []
        for order in ORDERS:
            roots = loop_roots(loop, order)
            T = np.eye(4)
            for i in range(6):
                T = T @ turn_z(roots.angles[:, i]) @ loop[i][roots.row]
            gap = np.abs(T - np.eye(4)).max(axis=(1, 2))
            fair = gap < _FAIR
            away = _apart(roots.angles, (q[:, self.others] * multipliers + offsets)[roots.row])
            again = np.bincount(roots.row[fair & (away < _FAIR)], minlength=_PROBES) > 0
            # Real roots that do not close the loop are a sign of mixed ones.
            if again.all() and not roots.ill.any():
                bad = np.count_nonzero(~fair & (roots.imaginary < SURE))
                marks.append((bad, float(np.log(np.maximum(gap[fair], 1e-16)).mean()), order))
        best = [order for *_, order in sorted(marks)]
        middle = [order.joints[2] for order in best]
        return tuple(order for _, order in sorted(enumerate(best), key=lambda x: middle[: x[0]].count(middle[x[0]])))

    @cached_property
    def _links(self) -> list[Link]:
        return links_of(self.robot, self.tip)

    @cached_property
    def _free(self) -> list[Link]:
        return [link for link in self._links if link.coordinate >= 0 and link.coordinate not in self.held]

    @cached_property
    def _joints(self) -> tuple[Vector, Vector, Vector]:
        """(multipliers, offsets, middles of the ranges) of the six joints, (6,) each."""
        multipliers, offsets = (np.array([getattr(x, name) for x in self._free]) for name in ("multiplier", "offset"))
        return multipliers, offsets, self.robot.middle[self.others]

    def _loop(self, poses: Array, held: Matrix) -> list[Array]:
        """The six links (k, 4, 4) between the hinges' z axes, the last over tool and base to the first."""
        k = len(poses)
        T, between = np.broadcast_to(np.eye(4), (k, 4, 4)), []
        for link in self._links:
            T = T @ _placed(link.rotation, link.position)
            if link.coordinate in self.held:
                value = link.multiplier * held[:, self.held.index(link.coordinate)] + link.offset
                upright = _upright(link.axis)
                move = turn_z(np.zeros(k) if link.slides else value)
                move[:, 2, 3] = value if link.slides else 0.0
                T = T @ upright @ move @ upright.T
            elif link.coordinate >= 0:
                upright = _upright(link.axis)
                between.append(T @ upright)
                T = np.broadcast_to(upright.T, (k, 4, 4))
        return [*between[1:], T @ inverse_poses(poses) @ between[0]]

    def _roots(self, poses: Array, held: Matrix, order: Order) -> LoopRoots:
        """The roots, their angles being the joints' values (K, 6)."""
        roots = loop_roots(self._loop(poses, held), order)
        multipliers, offsets, _ = self._joints
        return roots._replace(angles=(roots.angles - offsets) / multipliers)

    def _whole(self, q: Matrix, row: Indices, held: Matrix) -> Matrix:
        """Postures (K, n) of joints (K, 6)."""
        out = np.zeros((len(q), self.robot.n))
        out[:, list(self.held)] = held[row]
        out[:, self.others] = q
        return out

    def _polished(self, q: Matrix, row: Indices, poses: Array, held: Matrix, real: ArrayLike = 0) -> _Polished:
        """The postures that Newton's method on the robot's model comes to, from joints (K, 6) of roots, real or not."""
        if not len(q):
            return _NONE
        q, goal, middle = q.copy(), poses[row], self._joints[2]
        left = np.arange(len(q))
        for _ in range(_STEPS):
            posture = self._whole(q[left], row[left], held)
            error = _error(self.robot.pose(posture, self.tip), goal[left])
            step = _solved(self.robot.jacobian(posture, self.tip)[:, :, self.others], error)
            length = np.linalg.norm(step, axis=1)
            q[left] += step * np.minimum(1, _LONGEST / np.maximum(length, _SETTLED))[:, None]
            left = left[length > _SETTLED]
            if not len(left):
                break
        q = middle + (q - middle + np.pi) % (2 * np.pi) - np.pi
        posture = self._whole(q, row, held)
        residual = np.abs(self.robot.pose(posture, self.tip) - goal).max(axis=(1, 2))
        closed = np.flatnonzero(residual < CLOSED * np.maximum(1, np.abs(goal).max(axis=(1, 2))))
        J = self.robot.jacobian(posture[closed], self.tip)[:, :, self.others]
        size = np.linalg.svd(J, compute_uv=False)
        roots = np.broadcast_to(real, len(q))[closed].astype(int)
        return _Polished(q[closed], row[closed], residual[closed], size[:, -1] / size[:, 0], roots)

    def _beside(self, left: Indices, poses: Array, held: Matrix) -> _Polished:
        """Postures at singular poses (left,), from those at poses and held values beside: of a curve, some points."""
        out = _NONE
        for sign in (1, -1):
            beside = poses[left] @ _placed(np.eye(3), sign * _BESIDE)
            for order in self.orders[:2]:
                roots = self._roots(beside, held[left] + sign * _BESIDE[0], order)
                out = joined(out, self._polished(roots.angles, left[roots.row], poses, held))
        return out

    def _curves(self, known: _Polished, poses: Array, held: Matrix) -> Flags:
        """At which poses (k,) a singular posture can move on while the tool stays."""
        out = np.zeros(len(poses), dtype=bool)
        singular = some(known, known.rcond < SINGULAR)
        if not len(singular.row):
            return out
        J = self.robot.jacobian(self._whole(singular.q, singular.row, held), self.tip)[:, :, self.others]
        along = np.linalg.svd(J)[2][:, -1]
        moved = self._polished(singular.q + _ASIDE * along, singular.row, poses, held)
        for q, row, rcond in zip(moved.q, moved.row, moved.rcond, strict=True):
            away = _apart(q, singular.q[singular.row == row])
            out[row] |= bool(rcond < SINGULAR and away.min() > _ASIDE / 10)
        return out


def general_inverse(robot: Robot, held: Sequence[int], tip: str | None = None) -> GeneralInverse | NoClass:
    """The general inverse of what is left when the coordinates `held` are, or why it is none of its arms."""
    links, held = links_of(robot, tip), tuple(held)
    if reason := no_six_hinges(links, held):
        return NoClass(held, reason)
    inverse = GeneralInverse(robot, held, tip)
    if inverse.orders:
        return inverse
    J = robot.jacobian(_probes(robot), tip)[:, :, inverse.others]
    if (np.linalg.cond(J) > 1 / SINGULAR).all():
        return NoClass(held, "the other joints cannot move the tool in all directions, at any posture", singular=True)
    return NoClass(held, "the equations of the general inverse are singular at every pose")


def _probes(robot: Robot) -> Matrix:
    """Random postures (16, n), slides within a metre."""
    low = np.where(robot.hinges, -np.pi, np.clip(robot.lower, -1, 1))
    high = np.where(robot.hinges, np.pi, np.clip(robot.upper, -1, 1))
    return np.random.default_rng(0).uniform(low, high, (_PROBES, robot.n))


def _apart(q: Array, other: Array) -> Array:
    """Largest difference (...,) of joints (..., 6), whole turns aside."""
    away = np.abs(q - other) % (2 * np.pi)
    return np.minimum(away, 2 * np.pi - away).max(axis=-1)


def _error(T: Array, goal: Array) -> Matrix:
    """The twists (K, 6) from poses to others nearby [m, rad]."""
    turn = goal[:, :3, :3] @ T[:, :3, :3].transpose(0, 2, 1)
    out = np.empty((len(T), 6))
    out[:, :3] = goal[:, :3, 3] - T[:, :3, 3]
    for i, (j, k) in enumerate(((2, 1), (0, 2), (1, 0))):
        out[:, 3 + i] = (turn[:, j, k] - turn[:, k, j]) / 2
    return out


def _solved(J: Array, error: Matrix) -> Any:
    """x (K, 6) with J x = error."""
    try:
        return np.linalg.solve(J, error[:, :, None])[:, :, 0]
    except np.linalg.LinAlgError:  # one is singular to the last digit
        return (np.linalg.pinv(J) @ error[:, :, None])[:, :, 0]


def _rigid(poses: Array) -> Array:
    """Poses with the nearest rotations: those of single precision are 1e-7 from any."""
    out = poses.copy()
    for _ in range(2):
        R = out[:, :3, :3]
        out[:, :3, :3] = 1.5 * R - 0.5 * R @ R.transpose(0, 2, 1) @ R
    return out


def _placed(rotation: Matrix, position: Vector) -> Matrix:
    """A pose (4, 4)."""
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = rotation, position
    return out


def _upright(axis: Vector) -> Matrix:
    """A pose (4, 4) without position whose z axis is a unit vector."""
    if axis[2] < -0.5:
        return _upright(-axis) @ np.diag([1.0, -1.0, -1.0, 1.0])
    x, y, z = axis
    s = 1 / (1 + z)
    R = np.array([[1 - x * x * s, -x * y * s, x], [-x * y * s, 1 - y * y * s, y], [-x, -y, z]])
    return _placed(R, np.zeros(3))
