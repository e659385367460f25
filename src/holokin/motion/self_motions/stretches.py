"""Stretches of self-motions between neighbouring postures, as cubics: extremes of functions along them, and roots."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from ...base.types import Array, Flags, Indices, Matrix, Value, Vector
from ...strategies.self_motion_curves import least_motion
from ...strategies.tasks.task import Task
from .posture_search import newton, to_poses

LOOKS = np.linspace(0.0, 1.0, 17)
"""Shares of a stretch at which a function is compared at once: what is left of it is an eighth."""

CLOSER = (1, 2, 6)
"""How often a stretch is cut down to an eighth before its ends are moved onto the self-motion again: from 0.3 joint
units to 0.04, to 0.0006, where a cubic is exact but for round-off, and to 2e-9. Once at first: near sharp bends cubics
are off."""

ROUNDS = 20
"""Cubics through a root and the nearest postures on both sides, each of which has about twice the digits."""

HALVINGS = 48
"""Of a stretch: to round-off."""

ValueOf = Callable[[Matrix, Indices], Vector]
"""(postures (m, n), of which stretches they are (m,)) -> values (m,)."""


@dataclass(frozen=True, eq=False)
class Stretches(Value):
    """Parts of self-motions from postures a (k, n) to a + move, with the tool at p (k, 3), R (k, 3, 3).

    q(u), u from 0 to 1, is near the cubic with the slopes `first` and `last` (k, n) of the self-motion at both ends.
    """

    task: Task
    p: Matrix
    R: Array
    a: Matrix
    move: Matrix
    first: Matrix
    last: Matrix

    @classmethod
    def between(cls, task: Task, p: Matrix, R: Array, a: Matrix, b: Matrix) -> Self:
        """Those between postures a and b (k, n) on self-motions."""
        move = b - a
        length = np.linalg.norm(move, axis=1, keepdims=True)
        first, last = (length * along for along in _directions(task, np.array([a, b]), move))
        return cls(task, p, R, a, move, first, last)

    def __len__(self) -> int:
        return len(self.a)

    def some(self, which: Indices | Flags) -> Self:
        """Some of them."""
        return type(self)(self.task, *(getattr(self, field.name)[which] for field in fields(self)[1:]))

    def on_cubics(self, u: Matrix) -> Array:
        """Postures (k, j, n) at shares (k, j), near the self-motions."""
        move, first, last = (x[:, None] for x in (self.move, self.first, self.last))
        return self.a[:, None] + cubic(move, first, last, u[:, :, None])

    def postures(self, u: Vector) -> Matrix:
        """Postures (k, n) of the self-motions at shares u (k,)."""
        return onto(self.task, self.p, self.R, self.on_cubics(u[:, None])[:, 0])

    def part(self, low: Vector, high: Vector) -> Self:
        """Their parts between two shares (k,)."""
        ends = np.concatenate(self.on_cubics(np.array([low, high]).T).transpose(1, 0, 2))
        a, b = np.split(onto(self.task, np.tile(self.p, (2, 1)), np.tile(self.R, (2, 1, 1)), ends), 2)
        return self.between(self.task, self.p, self.R, a, b)

    def bracket(self, value: ValueOf, times: int = 1) -> tuple[Vector, Vector, Vector]:
        """(from which share (k,) to which the least value lies, the least one that was seen (k,)), on the cubics."""
        k, n = self.a.shape
        every, low, high, least = np.arange(k), np.zeros(k), np.ones(k), np.full(k, np.inf)
        of_stretch = np.repeat(every, len(LOOKS))
        for _ in range(times):
            u = low[:, None] + (high - low)[:, None] * LOOKS
            values = value(self.on_cubics(u).reshape(-1, n), of_stretch).reshape(k, len(LOOKS))
            i = values.argmin(axis=1)
            low, high = u[every, np.maximum(i - 1, 0)], u[every, np.minimum(i + 1, len(LOOKS) - 1)]
            least = values[every, i]
        return low, high, least

    def least(self, value: ValueOf, closer: tuple[int, ...] = CLOSER) -> tuple[Matrix, Vector]:
        """The postures (k, n) at which a value is least, one on each, and the values (k,)."""
        part = self
        for times in closer[:-1]:
            low, high, _ = part.bracket(value, times)
            part = part.part(low, high)
        low, high, _ = part.bracket(value, closer[-1])
        q = part.postures((low + high) / 2)
        return q, value(q, np.arange(len(self)))

    def at_values(self, joint: Indices, value: Vector) -> Matrix:
        """The postures (k, n) at which joints (k,) have values (k,) that they pass; without one those they begin at."""
        every, q = np.arange(len(self)), self.a.copy()
        begin, end = self.a[every, joint] - value, (self.a + self.move)[every, joint] - value
        going = np.flatnonzero(begin * end < 0)
        part, begin, end = self.some(going), begin[going], end[going]
        for _ in range(ROUNDS):
            if not len(going):
                break
            j = joint[going], np.arange(len(going))
            u = root_of_cubic(begin, end, part.first[j[::-1]], part.last[j[::-1]])
            q[going] = part.postures(u)
            miss = q[going, j[0]] - value[going]
            near = ~(np.abs(miss) > 1e-14 * np.maximum(1.0, np.abs(value[going])))
            ahead = (miss * begin > 0)[:, None]
            a, b = np.where(ahead, q[going], part.a), np.where(ahead, part.a + part.move, q[going])
            part = self.between(self.task, part.p, part.R, a, b).some(~near)
            begin, end = (np.where(ahead[:, 0], x, y)[~near] for x, y in ((miss, begin), (end, miss)))
            going = going[~near]
        passed = np.abs(q[every, joint] - value) < 1e-9
        q[every[passed], joint[passed]] = value[passed]
        return q

    def halved(self, ahead: Callable[[Matrix], Flags], times: int = HALVINGS) -> Matrix:
        """The last postures (k, n) of which (postures (k, n)) -> `ahead` (k,) is true, as at the beginning."""
        low, high = np.zeros(len(self)), np.ones(len(self))
        for _ in range(times if len(self) else 0):
            middle = 0.5 * (low + high)
            yes = ahead(self.postures(middle))
            low, high = np.where(yes, middle, low), np.where(yes, high, middle)
        return self.postures(low)


def onto(task: Task, p: Matrix, R: Array, q: Matrix) -> Matrix:
    """Postures (k, n) with the tool at p (k, 3), R (k, 3, 3), by the least joint motion from others."""
    return newton(to_poses(task._geometric_twin, p, R), q, steps=8, exact=1e-13)[0]


def _directions(task: Task, q: Array, along: Matrix) -> Array:
    """The unit directions (j, k, n) of self-motions at postures (j, k, n), nearest to others (k, n)."""
    J = task._geometric_twin.jacobian_batch(q.reshape(-1, q.shape[2]))[0]
    along = np.broadcast_to(along, q.shape).reshape(-1, q.shape[2])
    v = along - least_motion(J, J @ along[:, :, None])[:, :, 0]
    with np.errstate(invalid="ignore", divide="ignore"):
        v = v / np.linalg.norm(v, axis=1, keepdims=True)
    return np.where(np.isfinite(v).all(axis=1, keepdims=True), v, along).reshape(q.shape)


# --- Cubics over u from 0 to 1, by their values and slopes at both ends.


def cubic(rise: Array, first: Array, last: Array, u: Array) -> Array:
    """The value at shares u of a cubic that rises by `rise` from 0."""
    return u * (first + u * (3 * rise - 2 * first - last + u * (first + last - 2 * rise)))


def root_of_cubic(a: Vector, b: Vector, first: Vector, last: Vector) -> Vector:
    """The share (k,) where a cubic from a to b, of other sign, is 0: by Newton's method between bounds."""
    rise, low, high = b - a, np.zeros(len(a)), np.ones(len(a))
    c2, c3, up = 3 * rise - 2 * first - last, first + last - 2 * rise, a < 0
    with np.errstate(all="ignore"):
        u = np.nan_to_num(-a / rise, nan=0.5)
        for _ in range(5):
            f = a + u * (first + u * (c2 + u * c3))
            before = (f < 0) == up
            low, high = np.where(before, u, low), np.where(before, high, u)
            u = u - f / (first + u * (2 * c2 + 3 * c3 * u))
            u = np.where((u >= low) & (u <= high), u, 0.5 * (low + high))
    return u


def extremum_of_cubic(a: Vector, b: Vector, first: Vector, last: Vector) -> Vector:
    """The share (k,) of that extremum of a cubic from a to b that is nearest to 0; 1/2 where none is well inside."""
    rise = b - a
    c2, c3 = 3 * rise - 2 * first - last, first + last - 2 * rise
    with np.errstate(all="ignore"):
        sum_of_roots = -(c2 + np.copysign(np.sqrt(c2 * c2 - 3 * c3 * first), c2))
        u = np.array([sum_of_roots / (3 * c3), first / sum_of_roots])
        inside = (u > 1e-4) & (u < 1 - 1e-4)
        value = np.where(inside, np.abs(a + cubic(rise, first, last, u)), np.inf)
    best, every = value.argmin(axis=0), np.arange(len(a))
    return np.where(inside[best, every], u[best, every], 0.5)
