"""`JointCurve`: the joints along a path without any time, q(s), as splines between the corners."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import ArgumentError
from ..base.types import Matrix, Value, Vector
from ..path.waypoints import Poses, distinct
from .trajectory import Status, Trajectory

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

DEGREE = 5
"""Of the splines: up to the third derivative they have no jumps, so that jerks are defined."""

CLOSED = 1e-12
"""Difference [joint units] between the starts of cycles up to which one cycle stands for all: that of round-off. A
controller at 1 kHz sees it as an acceleration of 1e-6."""


@dataclass(frozen=True, eq=False)
class Stretch(Value):
    """A smooth part of a curve: a spline through samples q (k, n) at s (k,), from 0; `round`: its end is its start.

    s is the time of the untimed trajectory: s runs as a clock when the tool keeps the speed of its path.
    """

    s: Vector
    q: Matrix
    round: bool = False

    def __post_init__(self) -> None:
        from scipy.interpolate import make_interp_spline

        super().__post_init__()
        degree = min(DEGREE, len(self.s) - 1)
        q, bounds = self.q, None
        if self.round and degree == DEGREE:
            q, bounds = np.vstack([self.q[:-1], self.q[:1]]), "periodic"
        odd = degree - (degree in (2, 4))  # even splines are not uniquely given by their samples
        object.__setattr__(self, "_spline", make_interp_spline(self.s, q, odd, bc_type=bounds))

    @property
    def length(self) -> float:
        """Where s ends [s]."""
        return float(self.s[-1])

    def derivatives(self, s: Vector, most: int = 3) -> list[Matrix]:
        """[q, dq/ds, ... to the order `most`], each (k, n); a round stretch goes on from its start beyond its end."""
        inside = np.clip(s - self.length * np.floor(s / self.length) * self.round, 0.0, self.length)
        spline: BSpline = self.__dict__["_spline"]
        return [np.asarray(spline(inside, order)) for order in range(most + 1)]

    def motion(self, s: Vector, rates: list[Vector]) -> list[Matrix]:
        """[q, dq, ddq, dddq] of q(s(t)) from s and its three derivatives in time, by the chain rule."""
        q, d1, d2, d3 = self.derivatives(s)
        v, a, j = (rate[:, None] for rate in rates)
        return [q, d1 * v, d2 * v**2 + d1 * a, d3 * v**3 + 3 * d2 * v * a + d1 * j]

    def __setstate__(self, state: dict[str, object]) -> None:
        super().__setstate__(state)
        self.__post_init__()


@dataclass(frozen=True, eq=False)
class JointCurve(Value):
    """The stretches of one cycle, or of all cycles where no two are alike; between them the joints must stand still."""

    stretches: tuple[Stretch, ...]
    repeats: bool

    @property
    def smooth(self) -> bool:
        """True of a cycle that can be run again and again without a stop."""
        return len(self.stretches) == 1 and self.stretches[0].round


def joint_curve(trajectory: Trajectory) -> JointCurve:
    """The curve of a trajectory. Raises: ArgumentError: it did not reach its end, or has no two samples."""
    if trajectory.status is not Status.COMPLETE:
        cure = "time one that was followed to its end"
        raise ArgumentError("the trajectory", trajectory.status.cause, cure)
    if len(trajectory) < 2:
        raise ArgumentError("the samples of the trajectory", len(trajectory), "give at least two")
    if not np.ptp(trajectory.q, axis=0).any():
        raise ArgumentError("the motion of the joints", 0.0, "they all stand still: there is nothing to time")
    marks = list(trajectory.marks)
    repeats = len(marks) > 1 and bool(np.abs(trajectory.q[marks] - trajectory.q[0]).max() <= CLOSED)
    last = marks[1] if repeats else len(trajectory) - 1
    t, q = trajectory.t[: last + 1], trajectory.q[: last + 1]
    kept = distinct(Poses(q, None), t)[1]  # samples that repeat the one before, of a piece of path as short as that
    kept[-1] = last
    corners = np.searchsorted(kept, [k for k in trajectory.corners if 0 < k < last], side="right") - 1
    ends = np.unique([0, *corners, len(kept) - 1]).tolist()
    turns_round = repeats and len(ends) == 2 and 0 not in trajectory.corners
    t, q = t[kept], q[kept]
    stretches = [Stretch(t[a : b + 1] - t[a], q[a : b + 1], turns_round) for a, b in pairwise(ends)]
    return JointCurve(tuple(stretches), repeats)
