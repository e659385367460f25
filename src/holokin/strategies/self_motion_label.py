"""Labels of the postures with one tool pose: what tells the leaves of a `radial` strategy apart.

With one redundant joint these postures are a curve, the self-motion, and the label is arc length along it as an
angle: it never turns back. With more the label is the projection on the self-motions at the start, which does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..base.types import Matrix, Vector
from ..robot import Robot
from ..symbolic import SX, atan2, cos, exp, fabs, factorise, sin, vertcat
from ..symbolic.null_space import null_space, null_space_expression
from .self_motions import self_motion
from .tasks.task import Task

STEP = 0.05
"""Arc length between the postures that the curve is traced by [joint units]."""

LENGTH = 40.0
"""The curve is traced so far each way [joint units]; a Panda's closes after 13 or less, the planar arm's after 24."""

SPACINGS = (0.4, 0.2, 0.1)
"""Arc length between the nodes of the label [joint units]: the first that is fine enough is taken."""

WIDTH = 0.8
"""Width of a node's weight, in spacings: the label's slope then ripples by less than 1 % on a straight curve."""

PRESENT = 0.7
"""Weight of the nodes, as a share of that in the middle of a curve, from which on a posture counts as one of it: it is
3/4 at an open end, and falls to this 0.84 widths beside the curve."""

SLOPES = (0.3, 3.0)
"""The label's slope over that of arc length, least and greatest: it is 1 but at open ends and sharp turns."""


@dataclass(frozen=True)
class Label:
    """value: q (n,) -> (r,); margin: q -> how far the posture is from where the label ends or turns, 0 there."""

    value: Callable[[SX], SX]
    margin: Callable[[SX], SX]
    angular: bool


def label_of(task: Task, q0: Vector) -> Label:
    """A label of the postures that hold the tool where it is at `q0` (n,), 0 there.

    Arc length where the self-motions are curves; a curve that turns too sharply for it, as close to singular postures,
    is labelled by the projection too.
    """
    return (_arc_length(task, q0) if task.n - task.m == 1 else None) or _projection(task, q0)


def _projection(task: Task, q0: Vector) -> Label:
    """Z^T (q - start), Z (n, r) the self-motions at the start; it turns where det(Z^T N) = 0, N (n, r) those at q."""
    Z = null_space(task.jacobian(q0))

    def margin(q: SX) -> SX:
        J = task.jacobian_expression(task.kinematics(q), q)
        R, product = factorise(SX(Z.T) @ null_space_expression(J)).R, SX(1)
        for i in range(R.shape[0]):
            product = product * R[i, i]
        return fabs(product)

    return Label(lambda q: SX(Z.T) @ (q - SX(q0)), margin, angular=False)


def _arc_length(task: Task, q0: Vector) -> Label | None:
    """The weighted mean of the angles of nodes along the self-motion: atan2(sum w_k sin a_k, sum w_k cos a_k).

    a = 2 pi s / S once round a closed one of length S, pi s / S on an open one; w_k = exp(-d_k^2 / 2 width^2), d_k the
    distance to node k with hinges on their circles, so that a full turn of a joint is no way at all. None if no nodes
    are fine enough.
    """
    curve = self_motion(task, q0, step=STEP, length=LENGTH, limits=False)
    E, turn = _on_circles(task.robot, curve.q), 2 * np.pi if curve.closed else np.pi
    length = curve.s[-1] - curve.s[0]
    angles = turn * curve.s / length
    for spacing in SPACINGS:
        count = max(4, int(np.ceil(length / spacing)))
        s = np.linspace(curve.s[0], curve.s[-1], count, endpoint=not curve.closed)
        nodes, width = np.array([np.interp(s, curve.s, e) for e in E.T]).T, WIDTH * (s[1] - s[0])
        weights = np.exp(-np.sum((E[:, None] - nodes) ** 2, axis=2) / (2 * width**2))
        a = turn * s / length
        found = np.arctan2(weights @ np.sin(a), weights @ np.cos(a))
        slopes = (np.diff(np.unwrap(found)) / np.diff(angles))[1:-1]
        present = weights.sum(axis=1) / (np.sqrt(2 * np.pi) * WIDTH) > PRESENT
        slopes = slopes[present[1:-2] & present[2:-1]]
        if len(slopes) and slopes.min() > SLOPES[0] and slopes.max() < SLOPES[1]:
            a = a - found[np.argmin(np.abs(curve.s))]
            return _weighted(task.robot, nodes, width, a)
    return None


def _weighted(robot: Robot, nodes: Matrix, width: float, angles: Vector) -> Label:
    hinges = robot.hinges
    slide, turn = np.flatnonzero(~hinges).tolist(), np.flatnonzero(hinges).tolist()
    center = nodes.mean(axis=0)
    away = (nodes - center) / width**2
    fixed = np.sum((nodes - center) ** 2, axis=1) / (2 * width**2)

    def weights(q: SX) -> SX:
        here = vertcat(q[slide], cos(q[turn]), sin(q[turn])) - SX(center)
        # |here - node|^2 by its three terms: half the work of the difference itself
        return exp(SX(away) @ here - SX(fixed) - here.T @ here / (2 * width**2))

    def value(q: SX) -> SX:
        w = weights(q)
        return atan2(SX(np.sin(angles)).T @ w, SX(np.cos(angles)).T @ w)

    def margin(q: SX) -> SX:
        share = SX(np.ones(len(nodes))).T @ weights(q) / (np.sqrt(2 * np.pi) * WIDTH)
        return (share - PRESENT) / (1 - PRESENT)

    return Label(value, margin, angular=True)


def _on_circles(robot: Robot, Q: Matrix) -> Matrix:
    """Postures (k, n) as points: sliders as they are, hinges as (cos, sin)."""
    hinges = robot.hinges
    return np.hstack([Q[:, ~hinges], np.cos(Q[:, hinges]), np.sin(Q[:, hinges])])
