"""Families of tool poses x(u), u = u0 + h y, y in [-1, 1]^d: a stretch of a path, d = 1, or a box of poses, d = 3 or 6.

They are expressions of y and of some numbers, u0 and h the last of them, so that one expression serves all cells of a
proof. Two cells with a value of u in common have that pose in common, exactly.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import factorial

import numpy as np

from ..base.errors import ArgumentError
from ..base.types import Array, Matrix, Value, Vector
from ..symbolic import SX, cos, sin, sumsqr, vertcat
from ..symbolic.rotations import skew


@dataclass(frozen=True, eq=False)
class Family(Value, ABC):
    """A family of `dimension` parameters y, given by `numbers` numbers. `turning`: whether the tool turns in it."""

    turning: bool

    @property
    @abstractmethod
    def dimension(self) -> int:
        """d."""

    @property
    @abstractmethod
    def numbers(self) -> int:
        """How many numbers give a member."""

    @abstractmethod
    def pose(self, y: SX, numbers: SX) -> tuple[SX, SX]:
        """(position (3F,), rotation (3F, 3)) of F frames at y (d,)."""


TERMS = 22
"""Terms of the series of exp(phi): for |phi| <= 2 pi what is left out is below 1e-19."""


BEZIER = np.array([[1, 0, 0, 0], [1, 1 / 3, 0, 0], [1, 2 / 3, 1 / 3, 0], [1, 1, 1, 1]])
"""Times the coefficients of a cubic, its control points: over [0, 1] it lies between them."""


@dataclass(frozen=True, eq=False)
class Stretch(Family):
    """A stretch of a `Segment` of a path: u is the share of it.

    p = centre + cos(a u) x + sin(a u) y + u b + u^2 c + u^3 d. An even turn is R = (1 + sin(t u) [k]x + (1 - cos(t u))
    [k]x^2) R0; where it is `curved`, R = (1 + S(|w|^2) [w]x + C(|w|^2) [w]x^2) R0, w(u) a cubic, with the series
    S(z) = sum_k (-z)^k / (2k + 1)! and C(z) = sum_k (-z)^k / (2k + 2)!, their coefficients rounded to doubles: at most
    1e-14 from exp([w]x) for |w| <= 2 pi.
    """

    curved: bool = False

    @property
    def dimension(self) -> int:
        """One: u."""
        return 1

    @property
    def numbers(self) -> int:
        """Those of `of`, u0 and h."""
        return 42 if self.curved else 34

    def pose(self, y: SX, numbers: SX) -> tuple[SX, SX]:
        """The tool's pose."""
        center, x, across, angle = numbers[0:3], numbers[3:6], numbers[6:9], numbers[9]
        along, turn, R = numbers[10:19], numbers[19:-11], numbers[-11:-2].reshape((3, 3)).T
        u = numbers[-2] + numbers[-1] * y
        cubic = u * (along[0:3] + u * (along[3:6] + u * along[6:9]))
        position = center + cos(angle * u) * x + sin(angle * u) * across + cubic
        if self.curved:
            w = turn[0:3] + u * (turn[3:6] + u * (turn[6:9] + u * turn[9:12]))
            z, K = sumsqr(w), skew(w)
            S = _series([(-1) ** k / factorial(2 * k + 1) for k in range(TERMS)], z)
            C = _series([(-1) ** k / factorial(2 * k + 2) for k in range(TERMS)], z)
            R = (SX.eye(3) + S * K + C * (K @ K)) @ R
        elif self.turning:
            K = skew(turn[0:3])
            R = (SX.eye(3) + sin(turn[3] * u) * K + (1 - cos(turn[3] * u)) * (K @ K)) @ R
        return position, R

    def of(self, row: Vector) -> Vector:
        """The numbers of a row of `Path.table`, but for u0 and h. The path that is meant is the one with these doubles.

        Raises:
            ArgumentError: a curved turn of more than a whole turn.
        """
        turning = row[19:31].reshape(4, 3)
        if self.curved:
            largest = float(np.linalg.norm(BEZIER @ turning, axis=1).max())
            if largest > 2 * np.pi:
                cure = "give more waypoints, so that no piece turns the tool by more than a whole turn"
                raise ArgumentError("the turn of a piece of the path", largest, cure)
            return row[:40]
        size = float(np.linalg.norm(turning[1]))
        axis = turning[1] / size if size > 0 else np.array([0.0, 0.0, 1.0])
        return np.concatenate([row[:19], axis, [size], row[31:40]])


@dataclass(frozen=True, eq=False)
class Stretches(Family):
    """Stretches of several frames' paths, run through together: one share u for all. `members`: of each frame.

    Their numbers follow each other; u0 and h are the last ones. Positions and rotations stand one below the other.
    """

    members: tuple[Stretch, ...]

    @property
    def dimension(self) -> int:
        """One: u."""
        return 1

    @property
    def numbers(self) -> int:
        """Those of all frames, u0 and h."""
        return 2 + sum(member.numbers - 2 for member in self.members)

    def pose(self, y: SX, numbers: SX) -> tuple[SX, SX]:
        """The poses of the tools, (3F,) and (3F, 3)."""
        positions, rotations, first = [], [], 0
        for member in self.members:
            last = first + member.numbers - 2
            p, R = member.pose(y, vertcat(numbers[first:last], numbers[-2:]))
            positions.append(p)
            rotations.append(R)
            first = last
        return vertcat(*positions), vertcat(*rotations)

    def of(self, rows: Matrix) -> Vector:
        """The numbers of a row of `Path.table` of each frame (F, .), but for u0 and h. Raises: as `Stretch.of`."""
        return np.concatenate([member.of(row) for member, row in zip(self.members, rows, strict=True)])

    @staticmethod
    def along(tables: Array) -> Stretches:
        """Of the tables of `Path.table` of F frames (F, pieces, .)."""
        members = []
        for rows in tables:
            curved = bool(rows[:, [19, 20, 21, *range(25, 31)]].any())
            members.append(Stretch(bool(rows[:, 19:31].any()), curved))
        return Stretches(any(member.turning for member in members), tuple(members))


def _series(coefficients: list[float], z: SX) -> SX:
    total = SX(0)
    for c in reversed(coefficients):
        total = total * z + c
    return total


@dataclass(frozen=True, eq=False)
class PoseBox(Family):
    """A box of poses: p = p0 + P u with the half sides P, R = R0 C(w) with w = W u the Cayley parameters of a turn.

    C(w) = ((4 - |w|^2) 1 + 4 [w]x + 2 w w^T) / (4 + |w|^2) turns by 2 atan(|w| / 2) about w, in the tool's frame. The
    first three parameters are the position's, the others, where there are any, the turn's.
    """

    @property
    def dimension(self) -> int:
        """3, or 6 with turns."""
        return 6 if self.turning else 3

    @property
    def numbers(self) -> int:
        """p0 (3), R0 (9), half sides (d); u0 (d), h (d)."""
        return 12 + 3 * self.dimension

    def pose(self, y: SX, numbers: SX) -> tuple[SX, SX]:
        """The tool's pose."""
        d = self.dimension
        p0, R0, sides = numbers[0:3], numbers[3:12].reshape((3, 3)).T, numbers[12 : 12 + d]
        u = numbers[12 + d : 12 + 2 * d] + numbers[12 + 2 * d :] * y
        position = p0 + sides[:3] * u[:3]
        if not self.turning:
            return position, R0
        w = sides[3:] * u[3:]
        size = sumsqr(w)
        return position, R0 @ (((4 - size) * SX.eye(3) + 4 * skew(w) + 2 * w @ w.T) / (4 + size))
