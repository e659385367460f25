"""What `check` looks at: the samples of a trajectory, a timed one, a recording, or postures alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.errors import ArgumentError, NotFiniteError
from ...base.types import Matrix, Value, Vector
from ...robot import Robot
from .. import TimedTrajectory
from ..recording import Recording
from ..trajectory import Trajectory
from .check_report import FindingKind

RATES = (FindingKind.VELOCITY, FindingKind.ACCELERATION, FindingKind.JERK)

Rate = tuple[FindingKind, Matrix, Vector, str]
"""A derivative of the joints (k, n), its limits (n,), and what its unit has after that of the joint."""


@dataclass(frozen=True, eq=False)
class Motion(Value):
    """Joints q (k, n) at times t (k,) [s], and their rates with limits.

    samples (s, n): the postures between whose neighbours a jump may be: those from which a timed motion was made, and
    q of all others.
    """

    t: Vector
    q: Matrix
    rates: tuple[Rate, ...]
    remarks: tuple[str, ...] = ()
    untimed: Matrix | None = None

    @property
    def samples(self) -> Matrix:
        """As above."""
        return self.q if self.untimed is None else self.untimed

    def index(self, k: int) -> int:
        """Where the motion is at the k-th of `samples`, or nearest to it."""
        return k if self.untimed is None else int(np.argmin(np.abs(self.q - self.untimed[k]).max(axis=1)))

    def time(self, k: int) -> float:
        """When that is [s]."""
        return float(self.t[self.index(k)])


def motion_of(given: Any, robot: Robot) -> Motion:
    """The samples of a motion. Raises: ArgumentError, ShapeError, NotFiniteError: it is none of this robot."""
    names = getattr(given, "joint_names", robot.joint_names)
    if tuple(names) != robot.joint_names:
        raise ArgumentError("the robot", robot.name, f"give the one that moves {', '.join(map(str, names))}")
    if isinstance(given, TimedTrajectory):
        limits = given.limits
        bounds = limits.velocity, limits.acceleration, limits.jerk
        rates = zip(RATES, (given.dq, given.ddq, given.dddq), bounds, ("/s", "/s^2", "/s^3"), strict=True)
        return Motion(given.t, given.q, tuple(rates), untimed=given.untimed.q)
    if isinstance(given, Trajectory):
        return Motion(given.t, given.q, ((RATES[0], given.dq, robot.max_velocity, "/s"),))
    if isinstance(given, Recording):
        if len(given) < 2:
            return Motion(given.t, given.q, ())
        told = ("speeds are differences of successive samples",)
        steps = np.diff(given.q, axis=0) / np.diff(given.t)[:, None]
        return Motion(given.t, given.q, ((RATES[0], np.vstack([steps, steps[-1:]]), robot.max_velocity, "/s"),), told)
    q = robot.postures(given)
    if not np.isfinite(q).all():
        raise NotFiniteError("the postures", q[~np.isfinite(q)][:3].tolist())
    return Motion(np.arange(len(q), dtype=float), q, (), ("times are the numbers of the postures",))
