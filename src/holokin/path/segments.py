"""`Segment`: a piece of a path, on which the tool moves along a line, an arc or a cubic and turns meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..base.errors import ArgumentError
from ..base.types import Array, Matrix, Value, Vector, frozen
from .straight_path import rotation_matrix, rotation_vector

NODES, WEIGHTS = (frozen(values) for values in np.polynomial.legendre.leggauss(20))
"""Gauss-Legendre points on [-1, 1]: exact for the area of a cubic, and 1e-15 of the length of the segments of a spline,
which bend little."""

SURE = np.pi - 1e-4
"""Turns [rad] from one waypoint to the next beyond which digits that files leave out may decide their direction."""

HALF_TURN = "it is half a turn, and the last digits decide in which direction: put a waypoint between the two"
"""What to say of longer ones."""

WIDTH = 43
"""Numbers of a segment in a table."""


@dataclass(frozen=True, eq=False)
class Segment(Value):
    """p(u) = center + cos(a u) x + sin(a u) y + [u, u^2, u^3] along, R(u) = exp([1, u, u^2, u^3] turning) R_0.

    u is in [0, 1]. A line has a = 0, x = y = 0 and one row of `along` (3, 3) [m] that is not 0; a cubic has three; an
    arc has along = 0 and perpendicular radii x, y. The rotation vector in the base frame is a cubic, too: `turning`
    (4, 3) [rad]; an even turn has one row, the second.

    nominal [m]: the segment takes nominal / speed seconds; None where its length and its turn decide.
    """

    center: Vector
    x: Vector
    y: Vector
    angle: float
    along: Matrix
    turning: Matrix
    nominal: float | None = None

    @property
    def length(self) -> float:
        """Distance travelled by the point [m]."""
        if not self.along[1:].any():
            return float(np.linalg.norm(self.x)) * abs(self.angle) + float(np.linalg.norm(self.along[0]))
        return self._integral(lambda u: np.linalg.norm(self.derivative(u), axis=1))

    @property
    def turn(self) -> float:
        """Angle by which the tool turns [rad], all the way counted."""
        if not self.turning[2:].any():
            return float(np.linalg.norm(self.turning[1]))
        phi, rate = self.turning, self.turning[1:] * [[1.0], [2.0], [3.0]]
        return self._integral(lambda u: np.linalg.norm(spin(powers(u, 4) @ phi, powers(u, 3) @ rate), axis=1))

    @property
    def twice_area(self) -> Vector:
        """The integral of p x dp (3,) [m^2], exact."""
        if self.angle == 0.0:
            u = (1 + NODES) / 2
            return np.asarray(WEIGHTS / 2 @ np.cross(self.position(u), self.derivative(u)), dtype=float)
        a, b = self.position(np.array([0.0, 1.0]))
        return np.asarray(np.cross(self.center, b - a) + self.angle * np.cross(self.x, self.y), dtype=float)

    @property
    def rotation(self) -> Matrix:
        """R(1) R(0)^T (3, 3): the rotation of the tool from its start to its end."""
        if not self.turning[0].any():
            return rotation_matrix(self.turning.sum(axis=0))
        return rotation_matrix(self.turning.sum(axis=0)) @ rotation_matrix(self.turning[0]).T

    @property
    def bend(self) -> float:
        """A bound of |d^2 p / du^2| [m]."""
        b, c = 2 * self.along[1], 6 * self.along[2]
        return self.angle**2 * float(np.linalg.norm(self.x)) + float(max(np.linalg.norm(b), np.linalg.norm(b + c)))

    @property
    def sway(self) -> float:
        """The even turn [rad] whose second derivatives bound the tool's: its square bounds |w|^2 + |w'| / 2.

        |w| is at most |phi'|, which lies within its control points, and |w'| at most |phi''| + |phi'|^2 / 2.
        """
        even, b, c = self.turning[1:]
        if not (b.any() or c.any()):
            return float(np.linalg.norm(even))
        rate = max(float(np.linalg.norm(v)) for v in (even, even + b, even + 2 * b + 3 * c))
        change = max(float(np.linalg.norm(v)) for v in (2 * b, 2 * b + 6 * c)) + rate**2 / 2
        return (rate**2 + change / 2) ** 0.5

    def position(self, u: Vector) -> Matrix:
        """Points (k, 3) at u (k,)."""
        return positions(self.row[None], u)

    def derivative(self, u: Vector) -> Matrix:
        """dp/du (k, 3)."""
        return derivatives(self.row[None], u)[0]

    @property
    def row(self) -> Vector:
        """The numbers (`WIDTH`,) of a table: center, x, y, angle, along, turning, R_0, seconds, bend, sway.

        R_0 and the seconds are the path's to say: 0 here.
        """
        parts = [self.center, self.x, self.y, [self.angle], self.along.ravel(), self.turning.ravel(), np.zeros(10)]
        return np.concatenate([*parts, [self.bend, self.sway]])

    def part(self, start: float, stop: float) -> Segment:
        """The piece from u = start to u = stop, turned round when stop < start."""
        share = stop - start
        along, turning = _shifted(np.vstack([np.zeros(3), self.along]), start, share), self.turning
        turning = _shifted(turning, start, share)
        if not self.turning[2:].any():  # an even turn goes on about its axis
            turning = np.vstack([np.zeros(3), turning[1:]])
        nominal = None if self.nominal is None else abs(share) * self.nominal
        if self.angle == 0.0:
            return replace(
                self, center=self.position(np.array([start]))[0], along=along[1:], turning=turning, nominal=nominal
            )
        c, s = np.cos(self.angle * start), np.sin(self.angle * start)
        x, y = c * self.x + s * self.y, c * self.y - s * self.x
        return replace(self, x=x, y=y, angle=share * self.angle, turning=turning, nominal=nominal)

    def mapped(self, matrix: Matrix, shift: Vector) -> Segment:
        """The segment under p -> M p + s, M = c R a rotation (3, 3) times a factor; its turns are turned by M / c."""
        turn = matrix / np.cbrt(np.linalg.det(matrix))
        return replace(
            self, center=matrix @ self.center + shift, x=matrix @ self.x, y=matrix @ self.y,
            along=self.along @ matrix.T, turning=self.turning @ turn.T,
        )  # fmt: skip

    def evenly(self, turn: Vector) -> Segment:
        """The same curve of the point with another turn, an even one by a rotation vector (3,) [rad]."""
        return replace(self, turning=_even(turn))

    def _integral(self, density: Callable[[Vector], Vector]) -> float:
        return float(WEIGHTS / 2 @ density((1 + NODES) / 2))


def line_segment(start: Vector, end: Vector, turn: Vector) -> Segment:
    """A straight line with an even turn."""
    zero = np.zeros(3)
    return Segment(start, zero, zero, 0.0, np.array([end - start, zero, zero]), _even(turn))


def arc_segment(center: Vector, x: Vector, y: Vector, angle: float, turn: Vector) -> Segment:
    """An arc of perpendicular radii x, y about a center, with an even turn."""
    return Segment(center, x, y, angle, np.zeros((3, 3)), _even(turn))


def cubic_segment(
    start: Vector, end: Vector, slopes: tuple[Vector, Vector], turn: Vector, spins: tuple[Vector, Vector],
    nominal: float | None,
) -> Segment:  # fmt: skip
    """The cubic between two points with dp/du = slopes at its ends, turning by exp(turn) with w = spins there."""
    zero = np.zeros(3)
    turning = _hermite(turn, spins[0], _unspin(turn, spins[1]))
    along = _hermite(end - start, *slopes)
    return Segment(start, zero, zero, 0.0, along, np.vstack([zero, turning]), nominal)


def _hermite(change: Vector, first: Vector, last: Vector) -> Matrix:
    """Rows [u, u^2, u^3] of the cubic from 0 to `change` with these derivatives at its ends."""
    return np.array([first, 3 * change - 2 * first - last, first + last - 2 * change])


def _even(turn: Vector) -> Matrix:
    return np.array([np.zeros(3), turn, np.zeros(3), np.zeros(3)])


def _shifted(rows: Matrix, start: float, share: float) -> Matrix:
    """The cubic of rows [1, u, u^2, u^3] as one of v, u = start + share v."""
    s, k = start, share
    a, b, c, d = rows
    return np.array([
        a + s * b + s * s * c + s**3 * d, k * (b + 2 * s * c + 3 * s * s * d), k * k * (c + 3 * s * d), k**3 * d
    ])  # fmt: skip


def powers(u: Vector, count: int) -> Matrix:
    """[1, u, u^2, ...] (k, count)."""
    return u[:, None] ** np.arange(count)


def positions(rows: Matrix, u: Vector) -> Matrix:
    """Points (k, 3) at u (k,) of segments, a row of a table each, or one for all."""
    angle, along, u = rows[:, 9:10] * u[:, None], rows[:, 10:19], u[:, None]
    cubic = u * along[:, :3] + (u * u) * (along[:, 3:6] + u * along[:, 6:])
    return rows[:, :3] + np.cos(angle) * rows[:, 3:6] + np.sin(angle) * rows[:, 6:9] + cubic


def derivatives(rows: Matrix, u: Vector) -> tuple[Matrix, Matrix, Matrix]:
    """(dp/du, phi, w), each (k, 3): w du is the turn of the tool, phi its rotation vector."""
    a, along, turning, u = rows[:, 9:10], rows[:, 10:19], rows[:, 19:31], u[:, None]
    angle = a * u
    arc = a * (np.cos(angle) * rows[:, 6:9] - np.sin(angle) * rows[:, 3:6])
    slope = arc + (along[:, :3] + u * (2 * along[:, 3:6] + 3 * u * along[:, 6:]))
    phi = turning[:, :3] + u * (turning[:, 3:6] + u * (turning[:, 6:9] + u * turning[:, 9:]))
    even = ~turning[:, 6:].any(axis=1, keepdims=True)
    if even.all():
        return slope, phi, np.broadcast_to(turning[:, 3:6], phi.shape)
    rate = turning[:, 3:6] + u * (2 * turning[:, 6:9] + 3 * u * turning[:, 9:])
    return slope, phi, np.where(even, turning[:, 3:6], spin(phi, rate))


def spin(phi: Array, rate: Array) -> Array:
    """w (..., 3) of R = exp(phi) with phi' = rate: w = rate + b phi x rate + c phi x (phi x rate) [SLA21]."""
    b, c = _factors(np.linalg.norm(phi, axis=-1, keepdims=True))
    once = np.cross(phi, rate)
    return np.asarray(rate + b * once + c * np.cross(phi, once), dtype=float)


def _unspin(phi: Vector, w: Vector) -> Vector:
    """phi' (3,) of R = exp(phi) that turns with w: what `spin` undoes. |phi| < 2 pi."""
    if not phi.any():
        return w
    columns = spin(np.broadcast_to(phi, (3, 3)), np.eye(3)).T
    return np.asarray(np.linalg.solve(columns, w), dtype=float)


def _factors(angle: Array) -> tuple[Array, Array]:
    """((1 - cos a) / a^2, (a - sin a) / a^3), by their series near 0."""
    small, square = np.asarray(angle < 0.3), angle * angle
    a = np.where(small, 1.0, angle)
    series = 1 / 6 - square * (1 / 120 - square * (1 / 5040 - square * (1 / 362880 - square / 39916800)))
    b = np.where(small, 0.5 - square * (1 / 24 - square * (1 / 720 - square * (1 / 40320 - square / 3628800))),
                 2 * (np.sin(a / 2) / a) ** 2)  # fmt: skip
    return b, np.where(small, series, (a - np.sin(a)) / a**3)


def turn_between(first: Array, last: Array) -> Array:
    """The rotation vectors (..., 3) by which rotations go over into others, by the shorter way."""
    return rotation_vector(last @ np.swapaxes(first, -1, -2))


def sure_turns(rotations: Array) -> Matrix:
    """The rotation vectors (k - 1, 3) from each rotation to the next, by the shorter way.

    Raises:
        ArgumentError: half a turn, whose direction is by chance.
    """
    turns = turn_between(rotations[:-1], rotations[1:])
    size = np.linalg.norm(turns, axis=-1)
    if len(size) and size.max() > SURE:
        i = int(np.argmax(size))
        what = f"the turn from waypoint {i}, counted from 0, to the next one"
        raise ArgumentError(what, turns[i].tolist(), HALF_TURN)
    return turns
