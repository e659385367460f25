"""How far will a loop carry the joints? The area law: drift = area times curvature. [LA92], theory 2a"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..control import make_plan
from ..errors import OpenPathError
from ..path import Path
from ..strategy import Strategy
from ..types import Array, ArrayLike, Matrix, Vector
from .curvature import curvature
from .transport import transport

SAMPLES = 400
"""Samples of a loop: the area of a circle is then right to 1e-9."""


@dataclass(frozen=True, eq=False)
class Forecast:
    """drift (n,) of one cycle [joint units], right to the square of the loop's size.

    area (m, m): area_ij that the loop encloses in the task plane (i, j), counter-clockwise positive, antisymmetric;
    curvature (n, m, m) at `center`, the posture to which the strategy leads from the start at the loop's middle.
    """

    drift: Vector
    area: Matrix
    curvature: Array
    center: Vector

    @property
    def largest(self) -> float:
        """Largest joint's drift a cycle [joint units]."""
        return float(np.abs(self.drift).max())


def forecast(strategy: Strategy, path: Path, q0: ArrayLike) -> Forecast:
    """The drift of one cycle of a closed path, without following it: sum over i < j of area_ij F_ij(q_center).

    Raises:
        OpenPathError: the path is not closed. SingularityError: on the way to the middle. ShapeError, NotFiniteError.
    """
    task = strategy.task
    start = task.robot.checked(q0, "the start posture")
    if not path.closed:
        raise OpenPathError("a drift forecast", path.gap)
    plan = make_plan(task, path, SAMPLES, task.robot.pose(start, task.tip)[:3, :3])
    x0, x1, x2 = plan.rates
    steps = plan.h[:, None] / 6 * (x0 + 4 * x1 + x2)
    x = np.vstack([np.zeros(task.m), np.cumsum(steps, axis=0)])
    middle = np.sum(plan.h[:, None] * (x[:-1] + x[1:]) / 2, axis=0) / path.duration
    # 1/2 loop integral of x_i dx_j - x_j dx_i; Simpson's rule on every step, with its midpoint from the rates there
    half = x[:-1] + plan.h[:, None] * (5 * x0 + 8 * x1 - x2) / 24
    moment = np.zeros((task.m, task.m))
    for weight, place, rate in ((1 / 6, x[:-1], x0), (4 / 6, half, x1), (1 / 6, x[1:], x2)):
        moment += np.einsum("k,ki,kj->ij", weight * plan.h, place, rate)
    area = (moment - moment.T) / 2
    center = transport(strategy, start, middle)
    F = curvature(strategy, center)
    return Forecast(np.einsum("ij,aij->a", area, F) / 2, area, F, center)
