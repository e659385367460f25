"""The coordinates of a workspace in which polynomials are written: those of the tool pose that vary in it, scaled."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations_with_replacement

import numpy as np

from ..arguments import typed
from ..errors import ArgumentError
from ..robot import Kinematics
from ..symbolic import SX, Function, jacobian, symbol, vertcat
from ..task import Task
from ..types import Flags, Matrix, Value, Vector

MOVES = 1e-6
"""Spread [m or rad] of poses along a direction from which on the workspace reaches in it: well over round-off."""

FAR = 3.0
"""Turn [rad] from the middle orientation up to which poses have a rotation vector; at pi it jumps."""


@dataclass(frozen=True, eq=False)
class Coordinates(Value):
    """u = P^T (x - middle) / scale (d,), x the tool pose in `chart`, positions and a rotation vector about the middle.

    P (m, d) has orthonormal columns, each of positions or of turns alone; |u| <= 1 over the poses.
    """

    chart: Task
    P: Matrix
    middle: Vector
    scale: Vector
    spread: Vector

    @property
    def d(self) -> int:
        """Number of directions in which the workspace reaches."""
        return self.P.shape[1]

    @property
    def turns(self) -> Flags:
        """Which of them are turns [rad]."""
        angular = np.array([unit == "rad" for unit in self.chart.units])
        return np.any(np.abs(self.P[angular]) > 0, axis=0)

    def expression(self, k: Kinematics) -> SX:
        """u (d,) of the tool pose."""
        return (SX(self.P.T) @ (self.chart.value_expression(k) - SX(self.middle))) / SX(self.scale)

    def at(self, Q: Matrix) -> Matrix:
        """u (k, d) of the tool poses at postures (k, n)."""
        return (self.chart.value_batch(Q) - self.middle) @ self.P / self.scale


def chart_of(task: Task, rotation: Matrix) -> Task:
    """The task's rows in coordinates with x = f(q), J = df/dq: a full orientation by the rotation vector about the
    middle one.
    """
    if task.turns:
        return replace(task, orientation="rotation-vector", reference=rotation)
    return replace(task, reference=rotation) if task.robot.planar else task


def coordinates_of(chart: Task, Q: Matrix) -> Coordinates:
    """The coordinates in which the tool poses at postures (k, n) vary.

    Raises:
        ArgumentError: poses that all are one, or that turn by more than FAR from the middle orientation.
    """
    x = chart.value_batch(Q)
    angular = np.array([unit == "rad" for unit in chart.units])
    if chart.turns and (turn := float(np.linalg.norm(x[:, angular], axis=1).max())) > FAR:
        cure = f"keep them within {FAR} rad, or design two laws"
        raise ArgumentError("the largest turn of the workspace from its middle orientation [rad]", turn, cure)
    blocks = [np.flatnonzero(~angular), np.flatnonzero(angular)]
    P = np.hstack([_directions(x, rows) for rows in blocks])
    if not P.shape[1]:
        raise ArgumentError("the directions in which the workspace reaches", 0, "give poses that are not all alike")
    w = x @ P
    middle, scale = (w.max(axis=0) + w.min(axis=0)) / 2, np.ptp(w, axis=0) / 2
    rest = x.mean(axis=0) - P @ (P.T @ x.mean(axis=0))
    return Coordinates(chart, P, rest + P @ middle, scale, w.std(axis=0))


def _directions(x: Matrix, rows: np.ndarray) -> Matrix:
    """Orthonormal directions (m, d) among some rows in which values (k, m) vary; the axes where all do."""
    values = x[:, rows] - x[:, rows].mean(axis=0)
    if not len(rows):
        return np.zeros((x.shape[1], 0))
    axes = np.linalg.svd(values, full_matrices=False)[2]
    axes = axes[np.ptp(values @ axes.T, axis=0) / 2 > MOVES]
    if len(axes) == len(rows):
        axes = np.eye(len(rows))
    out = np.zeros((x.shape[1], len(axes)))
    out[rows] = axes.T
    return out


def exponents(variables: int, degree: int) -> list[tuple[int, ...]]:
    """The variables that each monomial multiplies, by increasing degree from 0: () is the constant."""
    return [c for d in range(degree + 1) for c in combinations_with_replacement(range(variables), d)]


def monomials(u: SX, terms: list[tuple[int, ...]]) -> SX:
    """All monomials (k,), each one product more than one of lower degree."""
    known: dict[tuple[int, ...], SX] = {(): SX(1)}
    for factors in terms:
        if factors:
            known[factors] = known[factors[:-1]] * u[factors[-1]]
    return vertcat(*(known[factors] for factors in terms))


def values_and_slopes(u: Matrix, terms: list[tuple[int, ...]]) -> tuple[Matrix, np.ndarray]:
    """Monomials at points (k, d) -> ((k, t), their slopes (k, t, d))."""
    v = symbol("u", u.shape[1])
    found = monomials(v, terms)
    basis = Function("monomials", {"u": v}, {"values": found, "slopes": jacobian(found, v)})
    values, slopes = basis.batch(u)
    return values.reshape(len(u), len(terms)), slopes.reshape(len(u), len(terms), u.shape[1])
