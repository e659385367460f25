"""Families of tool poses x(u), u = u0 + h y, y in [-1, 1]^d: a stretch of a path, d = 1, or a box of poses, d = 3 or 6.

They are expressions of y and of some numbers, u0 and h the last of them, so that one expression serves all cells of a
proof. Two cells with a value of u in common have that pose in common, exactly.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from ..symbolic import SX, cos, sin, sumsqr
from ..symbolic.geometry import skew
from ..types import Value, Vector


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
        """(position (3,), rotation (3, 3)) at y (d,)."""


@dataclass(frozen=True, eq=False)
class Stretch(Family):
    """A stretch of a line or an arc along which the tool turns evenly: u is the share of a `Segment`.

    p = centre + cos(a u) x + sin(a u) y + u v; R = (1 + sin(b u) [k]x + (1 - cos(b u)) [k]x^2) R0.
    """

    dimension = 1
    numbers = 28

    def pose(self, y: SX, numbers: SX) -> tuple[SX, SX]:
        """The tool's pose."""
        center, x, across, angle, v = numbers[0:3], numbers[3:6], numbers[6:9], numbers[9], numbers[10:13]
        axis, turn, R = numbers[13:16], numbers[16], numbers[17:26].reshape((3, 3)).T
        u = numbers[26] + numbers[27] * y
        position = center + cos(angle * u) * x + sin(angle * u) * across + u * v
        if self.turning:
            K = skew(axis)
            R = (SX.eye(3) + sin(turn * u) * K + (1 - cos(turn * u)) * (K @ K)) @ R
        return position, R

    @staticmethod
    def of(row: Vector) -> Vector:
        """The numbers (26,) of a row of `Path.table`. The path that is meant is the one with these doubles."""
        turn = row[13:16]
        size = float(np.linalg.norm(turn))
        axis = turn / size if size > 0 else np.array([0.0, 0.0, 1.0])
        return np.concatenate([row[:13], axis, [size], row[16:25]])


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
