"""The coordinates of a workspace in which polynomials are written: those of the tool pose that vary in it, scaled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...base.errors import ArgumentError
from ...base.types import Array, Flags, Indices, Matrix, Value, Vector
from ...path.workspaces import PoseCloud, Workspace
from ...robot import check_metres
from ...strategies.constraints.constraint import ChartFunction
from ...strategies.right_inverses import Terms, monomials, monomials_up_to
from ...strategies.tasks.frame_task import FrameTask, parts_of
from ...strategies.tasks.task import Task
from ...symbolic import SX, Function, jacobian, symbol

FAR = 3.0
"""Turn [rad] from the middle orientation up to which poses have a rotation vector; at pi it jumps."""


@dataclass(frozen=True, eq=False)
class Coordinates(Value):
    """u = P^T (x - middle) / scale (d,), x (m,) the tool pose in `chart`.

    P (m, d) has orthonormal columns, each of positions or of turns alone; |u| <= 1 over the poses of the workspace, and
    `spread` (d,) [m or rad] is their standard deviation along the columns.
    """

    chart: FrameTask
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
        """Which of them are turns [rad] (d,)."""
        angular = np.array([unit == "rad" for unit in self.chart.units])
        return np.any(self.P[angular] != 0, axis=0)

    def of(self, x: SX) -> SX:
        """u (d,) of a tool pose in the chart, as an expression."""
        return (SX(self.P.T) @ (x - SX(self.middle))) / SX(self.scale)

    def at(self, Q: Matrix) -> Matrix:
        """u (k, d) of the tool poses at postures (k, n)."""
        return (self.chart.value_batch(Q) - self.middle) @ self.P / self.scale


def task_poses(task: Task, workspace: Workspace, count: int, seed: int = 0) -> Array:
    """Tool poses (k, 4, 4) of a workspace for a task.

    Raises:
        ArgumentError: they are too far away to be in metres; or they have directions of the tool's z axis alone, and
            the task asks for more.
    """
    if isinstance(workspace, PoseCloud) and workspace.directed and task.orientation is not None:
        z = isinstance(task, FrameTask) and task.orientation == "axis" and np.allclose(task.axis[:2], 0.0)
        if not z:
            cure = 'the poses do not say how the tool is turned about its z axis: give a task with orientation="axis"'
            raise ArgumentError("the task", task.name, f"{cure}, whose axis is z, or whole orientations")
    poses = workspace.poses(count, seed)
    check_metres(task.robot, poses, task.tip)
    return poses


def chart_of(task: Task, rotation: Matrix) -> FrameTask:
    """The task's rows in coordinates with J = df/dq: a full orientation by the rotation vector about the middle one.

    The direction of an axis counts from the middle orientation, too.
    """
    part = parts_of(task)[0]
    if part.orientation != "axis" and part._turns:
        return replace(part, orientation="rotation-vector", reference=rotation)
    return replace(part, reference=rotation) if part.orientation == "axis" or part.robot.planar else part


def coordinates_of(chart: FrameTask, Q: Matrix) -> Coordinates:
    """The coordinates in which the tool poses at postures (k, n) vary.

    Raises:
        ArgumentError: poses that all are one, or that turn by more than FAR from the middle orientation.
    """
    x, angular = chart.value_batch(Q), np.array([unit == "rad" for unit in chart.units])
    if chart._turns and (turn := float(np.linalg.norm(x[:, angular], axis=1).max())) > FAR:
        what = "the largest turn of the workspace from its middle orientation [rad]"
        raise ArgumentError(what, turn, f"keep it below {FAR:g}, or design two strategies")
    P = np.hstack([_directions(x, np.flatnonzero(rows)) for rows in (~angular, angular)])
    if not P.shape[1]:
        raise ArgumentError("the directions in which the workspace reaches", 0, "give poses that are not all alike")
    w, mean = x @ P, x.mean(axis=0)
    middle = mean - P @ (P.T @ mean) + P @ (w.max(axis=0) + w.min(axis=0)) / 2
    return Coordinates(chart, P, middle, np.ptp(w, axis=0) / 2, w.std(axis=0))


def _directions(x: Matrix, rows: Indices) -> Matrix:
    """Orthonormal directions (m, d) among some rows in which values (k, m) vary; the axes where all do.

    A half width of 1e-6 m or rad is well over round-off.
    """
    values = x[:, rows] - x[:, rows].mean(axis=0)
    axes = np.linalg.svd(values, full_matrices=False)[2] if len(rows) else np.zeros((0, 0))
    axes = axes[np.ptp(values @ axes.T, axis=0) / 2 > 1e-6]
    directions = np.zeros((x.shape[1], len(axes)))
    directions[rows] = np.eye(len(rows)) if len(axes) == len(rows) else axes.T
    return directions


@dataclass(frozen=True, eq=False)
class Polynomial(ChartFunction):
    """zeta(x) (r,), a polynomial of a workspace's coordinates: `coefficients` (r, t) of monomials of u, in order."""

    coordinates: Coordinates
    coefficients: Matrix

    @property
    def chart(self) -> FrameTask:
        """That of the coordinates."""
        return self.coordinates.chart

    @cached_property
    def terms(self) -> Terms:
        """The monomials, the constant first, then by increasing degree."""
        degree = 0
        while len(terms := monomials_up_to(self.coordinates.d, degree)) < self.coefficients.shape[1]:
            degree += 1
        return terms

    def __call__(self, x: SX) -> SX:
        """zeta as an expression of the tool pose in the chart."""
        return SX(self.coefficients) @ monomials(self.coordinates.of(x), self.terms)

    def keys_over(self, keys: Mapping[str, Any]) -> dict[str, Any]:
        """What a job file says of a strategy's constraint less this polynomial, `keys` what it says of the strategy."""
        u = self.coordinates
        return {
            "kind": "designed",
            "base": {key: value for key, value in keys.items() if key != "level"},
            "reference": u.chart.reference.tolist(),
            "directions": u.P.tolist(),
            "middle": u.middle.tolist(),
            "scale": u.scale.tolist(),
            "coefficients": self.coefficients.tolist(),
        }


def values_and_slopes(u: Matrix, terms: Terms) -> tuple[Matrix, Array]:
    """Monomials at points (k, d): their values (k, t) and slopes (k, t, d)."""
    v = symbol("u", u.shape[1])
    powers = monomials(v, terms)
    values, slopes = Function("monomials", {"u": v}, {"values": powers, "slopes": jacobian(powers, v)}).batch(u)
    return values.reshape(len(u), len(terms)), slopes.reshape(len(u), len(terms), u.shape[1])
