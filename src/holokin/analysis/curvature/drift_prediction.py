"""How far will a loop carry the joints? The area law: drift = area times curvature. [LA92], theory 2a

The product is taken at the loop's centre of area and carried to the start. For plane loops at constant orientation its
relative error then falls with the second power of the loop's size (measured on Panda, iiwa14 and the PPR arm, loops of
8 to 1 cm); for others, and for area times curvature without the carrying, with the first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.arguments import typed
from ...base.errors import OpenPathError
from ...base.types import Array, ArrayLike, Matrix, Value, Vector
from ...motion.ik.plan import make_plan
from ...path import Path
from ...strategies import Strategy
from .curvature_of_planes import curvature
from .straight_transport import transport

SAMPLES = 400
"""Samples of a loop: the area of a circle is then right to 1e-9."""

AREA = 1e-6
"""Area of a loop, as a share of its extent squared, below which it has no centre of area."""


@dataclass(frozen=True, eq=False)
class DriftPrediction(Value):
    """drift (n,) of one cycle at the start [joint units].

    area (m, m): area_ij that the loop encloses in the task plane (i, j), counter-clockwise positive, antisymmetric;
    curvature (n, m, m) at `center`, the posture to which the strategy leads straight from the start when the tool goes
    to the loop's centre of area.
    """

    drift: Vector
    area: Matrix
    curvature: Array
    center: Vector

    @property
    def largest(self) -> float:
        """Largest joint's drift a cycle [joint units]."""
        return float(np.abs(self.drift).max())


@typed
def predicted_drift(strategy: Strategy, path: Path, q0: ArrayLike) -> DriftPrediction:
    """The drift of one cycle of a closed path, without following it: T sum over i < j of area_ij F_ij(q_center).

    T carries a small change of the posture at the centre back to the start. The relative error is O(size^2) for plane
    loops at constant orientation, O(size) for others; it says nothing of loops that enclose no area.

    Raises:
        OpenPathError: the path is not closed. SingularityError: on the way to the middle. ShapeError, NotFiniteError.
    """
    task = strategy.task
    start = task.robot.checked(q0, "the start posture")
    if not path.closed:
        raise OpenPathError("predicting drift", path.gap)
    plan = make_plan(task, path, SAMPLES, task.pose(start)[:3, :3])
    x0, x1, x2 = plan.rates
    steps = plan.h[:, None] / 6 * (x0 + 4 * x1 + x2)
    x = np.vstack([np.zeros(task.m), np.cumsum(steps, axis=0)])
    # 1/2 loop integral of x_i dx_j - x_j dx_i; Simpson's rule on every step, with its midpoint from the rates there
    half = x[:-1] + plan.h[:, None] * (5 * x0 + 8 * x1 - x2) / 24
    moment, first = np.zeros((task.m, task.m)), np.zeros((task.m, task.m, task.m))
    for weight, place, rate in ((1 / 6, x[:-1], x0), (4 / 6, half, x1), (1 / 6, x[1:], x2)):
        moment += np.einsum("k,ki,kj->ij", weight * plan.h, place, rate)
        first += np.einsum("k,ka,ki,kj->aij", weight * plan.h, place, place, rate)
    area = (moment - moment.T) / 2
    middle = _center_of_area(x, area, first)
    center = transport(strategy, start, middle)
    F = curvature(strategy, center)
    change = np.einsum("ij,aij->a", area, F) / 2
    ends = [transport(strategy, center + side * change / 2, -middle) for side in (1, -1)]
    return DriftPrediction(ends[0] - ends[1], area, F, center)


def _center_of_area(x: Matrix, area: Matrix, first: Array) -> Vector:
    """Where a loop's area is (m,), from x (k, m) and first_aij, its integral of x_a x_i dx_j: exact for a plane loop.

    1/3 (first_aij - first_aji) = c_a area_ij, by least squares over the planes; within the loop's own extent.
    """
    moments, size = (first - np.swapaxes(first, 1, 2)) / 3, np.sum(area**2)
    if not size > (AREA * np.ptp(x, axis=0).max() ** 2) ** 2:
        return (x.min(axis=0) + x.max(axis=0)) / 2
    return np.clip(np.einsum("aij,ij->a", moments, area) / size, x.min(axis=0), x.max(axis=0))
