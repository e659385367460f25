"""`radial`: the holonomic twin of any strategy, by transport along straight tool segments (theory 5.3).

From a centre x0 every tool pose x is reached along a straight segment; carrying a posture of the centre's
fibre along it by the given strategy makes the joints a function of x. These postures are the leaves. Near
x0 the twin is as close to the given strategy as curvature allows: |G_rad - G| <= 1/2 |x - x0| sup |F|,
with equality of both along segments and at x0.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..constraint import Constraint
from ..errors import ArgumentError
from ..robot import Kinematics
from ..symbolic import SX, as_map, symbol
from ..task import Task
from ..types import ArrayLike, Matrix
from .base import Strategy
from .build import holonomic


def radial(strategy: Strategy, start: ArrayLike, *, steps: int = 4, name: str | None = None) -> Strategy:
    """The holonomic strategy whose leaves are carried by `strategy` along straight segments from the pose at `start`.

    Its constraint is g(q) = Z^T (q_b - start): q_b is where `strategy` leads from q when the tool goes straight
    back to the centre, in position and along log(R R0^T) in orientation; Z (n, r) spans the self-motions at
    `start`. g is integrated by `steps` Runge-Kutta steps; any number gives an exactly holonomic strategy,
    more steps one nearer to the ideal radial twin (the error goes with steps^-4).

    It exists wherever the transport meets no singularity of `strategy`; it has no algorithmic singularities of
    its own.  Size: about 4 `steps` times the given strategy.

    Args:
        start: posture (n,) at the centre x0.
        steps: Runge-Kutta steps of one segment.

    Raises:
        ArgumentError: steps < 1.
        SingularityError: `strategy` is singular at `start`.
    """
    task = strategy.task
    q0 = task.robot.checked(start, "the start posture")
    if steps < 1:
        raise ArgumentError("steps", steps, "give at least 1")
    strategy(q0)
    Z = np.linalg.svd(task.jacobian(q0))[2][task.m :].T
    chart = _chart(task, task.robot.pose(q0, task.tip)[:3, :3])
    x0 = chart(q0)

    def expression(_task: Task, k: Kinematics, q: SX) -> SX:
        e = replace(strategy, task=chart).expressions
        dx = symbol("dx", task.m)
        rate = as_map([e.q, dx], e.rate(dx, written_out=True).X)
        v = chart.value_expression(k) - SX(x0)
        h = -1.0 / steps
        back = q
        for _ in range(steps):
            k1 = rate(back, v)
            k2 = rate(back + h / 2 * k1, v)
            k3 = rate(back + h / 2 * k2, v)
            k4 = rate(back + h * k3, v)
            back = back + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return SX(Z.T) @ (back - SX(q0))

    r = task.n - task.m
    constraint = Constraint(f"radial twin of {strategy.name}", r, expression, (False,) * r)
    return holonomic(task, constraint, name=name)


def _chart(task: Task, center: Matrix) -> Task:
    """The same rows in coordinates whose straight lines from the centre are p0 + t v, exp(t w) R0.

    Along such a line the twist is (v, w), constant, so the geometric Jacobian serves for all full orientations.
    """
    angular = sum(i > 2 for i in task.rows)
    if angular == 3 or task.robot.planar:
        return replace(task, orientation="twist", reference=center)
    return task
