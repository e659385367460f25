"""A timed motion between its samples, so that programs are held against it there, too."""

from __future__ import annotations

import numpy as np

from ...base.types import Matrix, Vector
from ...motion import TimedTrajectory

FINER = 4
"""Instants a step at which a program is held against the motion. Between two of them it is a sixteenth as far off as
between two samples: the largest distance of a curve from its chord goes with the square of the step."""


def finer(timed: TimedTrajectory) -> tuple[Vector, Matrix, Matrix]:
    """Times (k,), joints and their rates (k, n) at FINER instants a step; sample i of the motion is instant FINER * i.

    Between two samples by the polynomial of degree five that has the motion's joints, rates and accelerations at both.
    Where an acceleration jumps by a within a step of h seconds it is off by 0.018 a h^2 at most.
    """
    h = np.diff(timed.t)[:, None, None]
    q, dq, ddq = timed.q[:, None], timed.dq[:, None], timed.ddq[:, None]
    gone, v0, v1, a0, a1 = q[1:] - q[:-1], h * dq[:-1], h * dq[1:], h**2 * ddq[:-1], h**2 * ddq[1:]
    c3 = 10 * gone - 6 * v0 - 4 * v1 - 1.5 * a0 + 0.5 * a1
    c4 = -15 * gone + 8 * v0 + 7 * v1 + 1.5 * a0 - a1
    c5 = 6 * gone - 3 * v0 - 3 * v1 - 0.5 * a0 + 0.5 * a1
    s = (np.arange(FINER) / FINER)[:, None]
    between = q[:-1] + s * (v0 + s * (a0 / 2 + s * (c3 + s * (c4 + s * c5))))
    rates = (v0 + s * (a0 + s * (3 * c3 + s * (4 * c4 + s * 5 * c5)))) / h
    n = timed.q.shape[1]
    t = timed.t[:-1, None] + s[:, 0] * h[:, 0]
    return (
        np.append(t.ravel(), timed.t[-1]),
        np.vstack([between.reshape(-1, n), timed.q[-1:]]),
        np.vstack([rates.reshape(-1, n), timed.dq[-1:]]),
    )
