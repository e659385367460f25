"""`Sheet`: one leaf of a strategy, and the tool poses that it serves as one function."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ...base.poses import pose_from
from ...base.types import Array, Flags, Matrix, Value, Vector, frozen
from ...motion.checks import Clear
from ...motion.ik import InverseKinematics, leaf_value
from ...motion.ik.quiet_answers import answer, answers
from ...strategies import HolonomicStrategy
from .pose_features import PosePoints, seen_features, turn_length

STATIONS = 12
"""Stations of a sheet from which a pose is tried at most, nearest first. On a Panda, of 42 poses that four sheets
refuse from six of them, four are reached from the next six, and three from another 36."""


@dataclass(frozen=True, eq=False)
class Sheet(Value):
    """The leaf g(q) = g(q0) of a strategy, on the branch of q0 (n,), and the tool poses that it serves.

    It serves the poses that a straight path reaches on the leaf from the tool pose of the nearest station, or of one of
    the next eleven, where the posture is within the joint limits, where rcond of [J; J_g] is at least `rcond`, and
    where the robot keeps clear of what was named.

    stations: postures (h, n) of the leaf from which poses are reached; none (0, n) for q0 alone. Those of `hk.sheets`
    are at the sampled poses that the sheet serves; next to each other, each leads to the other, except where the leaf
    ends between them or overlaps itself. places: the tool poses (h, 4, 4) of these. keys: what a job says of the
    strategy, empty where it was given as a value.
    """

    strategy: HolonomicStrategy
    q0: Vector
    rcond: float = 0.0
    keys: Mapping[str, Any] = field(default_factory=dict)
    stations: Matrix = field(default_factory=lambda: np.zeros((0, 0)))
    places: Array = field(default_factory=lambda: np.zeros((0, 4, 4)))

    @property
    def name(self) -> str:
        """That of the strategy."""
        return self.strategy.name

    @cached_property
    def level(self) -> Vector:
        """c (r,) of the leaf; empty where nothing is redundant."""
        return frozen(leaf_value(self.strategy, self.q0))

    def off(self, q: Vector) -> float:
        """How far a posture (n,) is off the leaf: the largest |g(q) - c| [units of g], angles by the shorter way."""
        gap = leaf_value(self.strategy, q) - self.level
        return float(np.abs(self.strategy.constraint.nearest(gap)).max()) if len(gap) else 0.0

    @cached_property
    def ik(self) -> InverseKinematics:
        """Inverse kinematics on the leaf, within the joint limits."""
        return InverseKinematics(self.strategy, self.q0, limits=True)

    def posture(self, pose: Matrix, clear: Clear | None = None) -> Vector | None:
        """The joints (n,) at a tool pose (4, 4); None where it is not served."""
        q = self._straight(pose, self.nearest_station(pose), clear)
        if q is None:
            for i in self._places.few(pose[None], STATIONS)[0, 1:]:
                if (q := self._straight(pose, self.begin[i], clear)) is not None:
                    break
        return q

    def _straight(self, pose: Matrix, begin: Vector, clear: Clear | None) -> Vector | None:
        q = answer(self.ik, pose, begin)
        if q is None or (self.rcond and not self.strategy.gain(q)[1] >= self.rcond):
            return None
        return q if clear is None or clear(q[None])[0] else None

    def postures(self, poses: Array, clear: Clear | None = None, threads: int | None = None) -> tuple[Matrix, Flags]:
        """(joints (k, n), which are served (k,)) at tool poses (k, 4, 4); a row of NaN where one is not served."""
        if not len(poses):
            return np.zeros((0, len(self.q0))), np.zeros(0, dtype=bool)
        q, served = self.reached(self.begin[self._places.nearest(poses)], poses, clear, threads)
        left = np.flatnonzero(~served)
        few = self._places.few(poses[left], STATIONS) if len(left) else np.zeros((0, 1), dtype=int)
        for column in few.T[1:]:
            still = ~served[left]
            at = left[still]
            q[at], served[at] = self.reached(self.begin[column[still]], poses[at], clear, threads)
        return q, served

    def reached(
        self, begin: Matrix, poses: Array, clear: Clear | None = None, threads: int | None = None
    ) -> tuple[Matrix, Flags]:
        """The same straight from postures of the leaf (k, n), one for each pose."""
        q, reached = answers(self.ik, poses, begin, threads)
        served = allowed_postures(self.strategy, q, reached, self.rcond, clear)
        q[~served] = np.nan
        return q, served

    def nearest_station(self, pose: Matrix) -> Vector:
        """Its station (n,) whose tool pose is nearest to a pose (4, 4)."""
        return self.begin[self._places.nearest(pose[None])[0]]

    @cached_property
    def begin(self) -> Matrix:
        """The postures (h, n) from which poses are reached: its stations, or q0 alone."""
        return self.stations if len(self.stations) else frozen(self.q0[None])

    @cached_property
    def begin_at(self) -> Array:
        """The tool poses (h, 4, 4) of these."""
        return self.places if len(self.stations) else frozen(pose_from(*self.strategy.task.poses(self.q0[None])))

    @cached_property
    def _places(self) -> PosePoints:
        task = self.strategy.task
        return PosePoints(self.begin_at, turn_length(task), seen_features(task))

    def __str__(self) -> str:
        at = ", ".join(f"{c:.4g}" for c in self.level.round(9) + 0.0)  # -0 is 0
        return f"{self.name}, level {at}" if at else self.name


def allowed_postures(
    strategy: HolonomicStrategy, q: Matrix, reached: Flags, rcond: float, clear: Clear | None
) -> Flags:
    """Which of some postures (k, n) that were reached (k,) are regular enough, and clear of what was named."""
    served = reached.copy()
    if rcond and served.any():
        served[served] = strategy.gain.batch(q[served])[1].ravel() >= rcond
    if clear is not None and served.any():
        served[served] = clear(q[served])
    return served


def known(q: Array) -> Flags:
    """Which postures (..., n) are there: rows of NaN stand for none."""
    return np.asarray(np.isfinite(q).all(axis=-1))
