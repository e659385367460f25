"""Where the level of a strategy may lie at sampled poses, on each branch of its leaves; those of held joints."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import cast

import numpy as np

from ...base.types import Array, Indices, Matrix, Value, Vector
from ...motion.checks import Clear
from ...motion.ik.held_coordinate import HeldCoordinate
from ...robot.closed_form import NoClass, arm_class
from ...strategies import HolonomicStrategy, holonomic
from ...strategies.constraints import lock
from ...strategies.tasks.frame_task import asks_whole_pose
from ...strategies.tasks.task import Task
from ...symbolic import wrapped
from ..coverage.starts import Candidate
from .held_arm import HeldArm
from .level_fit import Ranges, ranges_of

CONSTANTS = 96
"""Constant levels of which the best begins a fit."""

LEAST = 0.05
"""Share of the poses that a choice of signs serves at least, if rules are fitted to it."""

VALUES = 64
"""Values of a held joint at which the postures of a pose are looked at."""


@dataclass(frozen=True, eq=False)
class Branch(Value):
    """The levels of a strategy at which poses have a posture that is allowed, on one branch of its leaves.

    A pose and a level have at most one posture of a branch, those levels that are in a range of the pose.

    candidate: the strategy. ranges: of levels. postures: (poses (k,), levels (k,)) -> postures (k, n) there, NaN where
    none is allowed. turning: whether levels that differ by a whole turn are the same postures.
    """

    candidate: Candidate
    ranges: Ranges
    postures: Callable[[Indices, Vector], Matrix]
    turning: bool = False

    @property
    def strategy(self) -> HolonomicStrategy:
        """The candidate's, which has one."""
        return cast(HolonomicStrategy, self.candidate.strategy)

    def off(self, levels: Array, middle: Array) -> Array:
        """From a middle to a level, the shorter way where a whole turn more is the same posture."""
        gap = levels - middle
        return wrapped(gap) if self.turning else gap

    @cached_property
    def poses(self) -> Indices:
        """Those that have a range."""
        return np.unique(self.ranges.pose)

    @cached_property
    def constants(self) -> Vector:
        """Levels (c,) all over the ranges, evenly."""
        _, middle, half = self.ranges
        return np.linspace((middle - half).min(), (middle + half).max(), CONSTANTS)


def branches_by_signs(task: Task, poses: Array, clear: Clear | None) -> list[Branch]:
    """The branches of all joints that, held, leave a closed form whose signs tell postures apart: the exact ranges of
    the joint at poses (k, 4, 4). None where there is no such joint."""
    robot, branches = task.robot, list[Branch]()
    arms = [arm_class(robot, (k,), task.tip) for k in range(robot.n)] if asks_whole_pose(task) else []
    for arm in arms:
        if isinstance(arm, NoClass) or not arm.proven or not robot.hinges[list(arm.held)].all():
            continue
        held_arm, name = HeldArm(HeldCoordinate(arm, 1.0), count=VALUES), robot.joint_names[arm.held[0]]
        candidate = Candidate(
            f"lock {name}", {"kind": "lock", "joints": [name]}, task, holonomic(task, lock(name), name=f"lock {name}")
        )
        flags, turning = held_arm.arcs(poses, clear), held_arm.held.turning
        for sign in np.flatnonzero(flags.any(axis=1).mean(axis=0) > LEAST).tolist():
            ranges = ranges_of(flags[:, :, sign], held_arm.values, turning)
            branches.append(Branch(candidate, ranges, partial(_postures, held_arm, poses, sign, clear), turning))
    return branches


def _postures(
    held_arm: HeldArm, poses: Array, sign: int, clear: Clear | None, which: Indices, levels: Vector
) -> Matrix:
    return held_arm.postures(poses[which], levels, sign, clear)
