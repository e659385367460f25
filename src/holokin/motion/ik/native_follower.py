"""Following a plan by native code: many steps in one call, the same as those of the Python steppers."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from ...base.tolerances import TOLERANCES
from ...base.types import Matrix, Vector
from ...symbolic.native import FollowKernel
from .plan import Plan


class NativeFollower:
    """A kernel on its path along a plan; `x` is its memory, which begins with the posture.

    halted: raises why it did fewer steps than asked, where that is known; else a step in Python tells it.
    """

    def __init__(
        self, kernel: FollowKernel, plan: Plan, x: Vector, rules: ctypes.Structure, limits: bool,
        halted: Callable[[], None] = lambda: None,
    ) -> None:  # fmt: skip
        self.halted = halted
        robot, n, slack = plan.task.robot, plan.task.n, TOLERANCES.limit
        p, R = plan.first
        self._kernel, self._x, self._rules = kernel, x, rules
        self._segments = plan.table
        self._counts = np.array([*plan.counts, 0], dtype=np.int64)
        self._home = np.concatenate([p, R.ravel()]) if plan.path.closed else None
        span = np.full(n, np.inf)
        self._limits = (robot.lower - slack, robot.upper + slack) if limits else (-span, span)

    def run(self, q: Vector, first: int, last: int, Q: Matrix) -> int:
        """Steps [first, last) of a cycle from q into the rows of Q; returns how many were done before a halt."""
        self._x[: len(q)] = q
        return self._kernel(
            self._segments, self._counts, self._home, self._x, (first, last), self._limits, self._rules, Q
        )
