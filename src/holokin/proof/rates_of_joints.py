"""`joint_rates`: how fast each joint is at most, over the speed of the tool, wherever the tool goes in what is proven.

Along the predictor p(y) of a cell E(p(y), y) changes by F', and at the roots q(y) the derivative is
q' = p' - A^-1 (F' + ...), so that |q' - p'| is at most (|Y F'| + (|Y D_q D_y E| + omega |p'|) r) / (1 - e - omega r).
The sizes of q' by y are `Findings.slopes`; here they are taken over the tool's motion per y.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arguments import typed
from ..base.types import Matrix, Value, Vector
from ..symbolic import jacobian, symbol
from ..symbolic.interval_function import IntervalFunction
from .bounds import UP
from .certificate import Certificate
from .targets import PoseBox


@dataclass(frozen=True, eq=False)
class JointRates(Value):
    """Upper bounds of joint speeds, in joint units a second: `per_speed` (n,) where the tool moves by 1 m/s, `per_turn`
    (n,) where it turns by 1 rad/s. Joint i is no faster than per_speed[i] |v| + per_turn[i] |w|.

    Of a path the two stand for each other: the tool turns as the path says, and `per_turn` is 0. Of several tools
    |v| is the speed of the fastest.
    """

    per_speed: Vector
    per_turn: Vector
    limits: Vector
    """The speed limits (n,) of the joints."""

    @property
    def tool_speed(self) -> float:
        """The speed of the tool [m/s] at which no joint is faster than its limit, where it does not turn besides.

        NaN where a joint has no limit.
        """
        if not np.isfinite(self.limits).all():
            return np.nan
        with np.errstate(divide="ignore", invalid="ignore"):
            return float(np.nan_to_num(self.limits / self.per_speed, nan=np.inf, posinf=np.inf).min(initial=np.inf))


@typed
def joint_rates(certificate: Certificate) -> JointRates:
    """How fast each joint is at most over what a certificate proves, for any motion of the tool in it.

    Infinite for a path on which the tool stands still while it turns.
    """
    found, equation = certificate.findings, certificate.equation
    limits, n = equation.strategy.task.robot.max_velocity, equation.joints
    if not len(certificate):
        return JointRates(np.zeros(n), np.zeros(n), limits)
    if not isinstance(equation.family, PoseBox):
        steps = _steps(certificate)
        with np.errstate(divide="ignore", invalid="ignore"):
            rates = np.where(found.slopes[:, :, 0] > 0, found.slopes[:, :, 0] / steps[:, None], 0.0)
        return JointRates(rates.max(axis=0) * UP, np.zeros(n), limits)
    boxes, d = certificate.proven.boxes, equation.d
    sides = certificate.pieces[0, 12 : 12 + d]
    h = (boxes.high - boxes.low) / 2 * sides
    each = found.slopes / np.where(h > 0, h, np.inf)[:, None, :]
    bend = 1 + float(np.sum(np.square(sides[3:]))) / 4  # |dw| <= (1 + |w|^2 / 4) |turn| of the Cayley parameters
    return JointRates(_largest(each[:, :, :3]), _largest(each[:, :, 3:]) * bend * UP, limits)


def _largest(columns: Matrix) -> Vector:
    return np.linalg.norm(columns, axis=2).max(axis=0, initial=0.0) * UP


def _steps(certificate: Certificate) -> Vector:
    """(k,) what the tool, of several the fastest, moves by, at least, per y over each cell of a path [m]."""
    family, numbers = certificate.equation.family, certificate.cells.numbers
    y, given = symbol("y", 1), symbol("numbers", family.numbers)
    moved = IntervalFunction("the tool's motion", {"y": y, "numbers": given}, jacobian(family.pose(y, given)[0], y))
    ones = np.ones((1, len(numbers)))
    found = moved(np.vstack([-ones, numbers.T]), np.vstack([ones, numbers.T]))
    least = np.maximum(np.maximum(found.low, -found.high), 0.0)
    return np.linalg.norm(least.reshape(-1, 3, len(numbers)), axis=1).max(axis=0) / UP
