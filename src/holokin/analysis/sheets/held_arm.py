"""An arm with one joint held: the values of that joint at which poses have postures that are allowed, by signs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from ...base.types import Array, Flags, Indices, Matrix, Value, Vector
from ...motion.checks import Clear
from ...motion.ik.closed_leaf import DOUBT
from ...robot.closed_form import ArmClass, ClosedInverse, NoClass, arm_class
from ...robot.closed_form.closed_inverse import SIGNS
from ...strategies import holonomic
from ...strategies.constraints import lock
from ...strategies.tasks.frame_task import asks_whole_pose
from ...strategies.tasks.task import Task
from ..coverage.starts import Candidate
from .branch import Branch
from .level_fit import Ranges

VALUES = 96
"""Values of the held joint at which the postures of a pose are looked at."""

TOGETHER = 500
"""Poses whose postures are looked at together."""


@dataclass(frozen=True, eq=False)
class HeldArm(Value):
    """An arm of which one joint is held, or of six joints none, so that the others have a closed inverse."""

    arm: ArmClass

    @cached_property
    def inverse(self) -> ClosedInverse:
        """The closed form, within the joint limits."""
        return ClosedInverse(self.arm, limits=True)

    @property
    def limits(self) -> tuple[float, float]:
        """Of the held joint."""
        k, robot = self.arm.held[0], self.arm.robot
        return float(robot.lower[k]), float(robot.upper[k])

    @property
    def turning(self) -> bool:
        """Whether they leave all of a turn."""
        low, high = self.limits
        return high - low >= 2 * np.pi

    @cached_property
    def values(self) -> Vector:
        """Values of the held joint, evenly."""
        ends = (-np.pi, np.pi) if self.turning else self.limits
        return np.linspace(*ends, VALUES, endpoint=not self.turning)

    def postures(self, rows: Array, held: Matrix) -> Matrix:
        """The postures (k, n) of answers (k, 12) and values (k, r) of the held joints."""
        q = np.zeros((len(rows), self.arm.robot.n))
        q[:, self.inverse.others], q[:, list(self.arm.held)] = rows[:, :6], held
        return q

    def postures_at(self, poses: Array, values: Matrix, sign: int, clear: Clear | None = None) -> Matrix:
        """The postures (k, n) of a choice of signs at poses (k, 4, 4) and values (k, r); NaN where none is allowed."""
        robot, held = self.arm.robot, list(self.arm.held)
        if held and self.turning:
            middle = sum(self.limits) / 2
            values = values + 2 * np.pi * np.floor((middle - values) / (2 * np.pi) + 0.5)
        rows = self.inverse.answers(poses, values)[:, sign]
        q = self.postures(rows, values)
        within = ((values >= robot.lower[held]) & (values <= robot.upper[held])).all(axis=1)
        allowed = (rows[:, 9] > DOUBT) & (rows[:, 10] >= 0) & within
        if clear is not None and allowed.any():
            allowed[allowed] = clear(q[allowed])
        q[~allowed] = np.nan
        return q

    def allowed(self, poses: Array, clear: Clear | None = None) -> Flags:
        """Whether a posture is allowed (k, C, 8) at poses, values and signs."""
        held = [self.inverse.at(value) for value in self.values]
        chain, own = (np.array([getattr(at, name) for at in held]) for name in ("chain", "own"))
        serves = np.zeros((len(poses), len(self.values), len(SIGNS)), dtype=bool)
        for first in range(0, len(poses), TOGETHER):
            some = poses[first : first + TOGETHER]
            each = np.repeat(some, len(self.values), axis=0)
            rows = self.inverse.answers_of(
                *(np.tile(x, (len(some), 1)) for x in (chain, own)), poses=each, threads=None
            )
            rows = rows.reshape(*serves[first : first + TOGETHER].shape, -1)
            flags = (rows[..., 9] > DOUBT) & (rows[..., 10] >= 0)
            if clear is not None and flags.any():
                _, value, _ = np.nonzero(flags)
                flags[flags] = clear(self.postures(rows[flags], self.values[value, None]))
            serves[first : first + TOGETHER] = flags
        return serves

    def ranges(self, flags: Flags) -> Ranges:
        """The ranges of the held joint in which postures of one choice of signs are allowed (k, C)."""
        # A turn begins behind a value that is not allowed.
        k, count = flags.shape
        begin = flags.argmin(axis=1) if self.turning else np.zeros(k, dtype=int)
        flags = np.take_along_axis(flags, (begin[:, None] + np.arange(count)) % count, axis=1)
        edge, step = np.zeros((k, 1), dtype=bool), self.values[1] - self.values[0]
        change = np.diff(np.hstack([edge, flags, edge]).astype(int), axis=1)
        (pose, first), (_, after) = np.nonzero(change == 1), np.nonzero(change == -1)
        middle = self.values[0] + step * (begin[pose] + 0.5 * (first + after - 1))
        return Ranges(pose, middle, 0.5 * step * (after - 1 - first) + 0.2 * step)


LEAST = 0.05
"""Share of the poses that a choice of signs serves at least, if rules are fitted to it."""


def branches_by_signs(task: Task, poses: Array, clear: Clear | None) -> list[Branch]:
    """The branches of all joints that, held, leave a closed form whose signs tell postures apart: the exact ranges of
    the joint at poses (k, 4, 4). None where there is no such joint."""
    robot, branches = task.robot, []
    arms = [arm_class(robot, (k,), task.tip) for k in range(robot.n)] if asks_whole_pose(task) else []
    for arm in arms:
        if isinstance(arm, NoClass) or not arm.proven or not robot.hinges[list(arm.held)].all():
            continue
        held_arm, name = HeldArm(arm), robot.joint_names[arm.held[0]]
        keys, strategy = {"kind": "lock", "joints": [name]}, holonomic(task, lock(name), name=f"lock {name}")
        flags = held_arm.allowed(poses, clear)
        for sign in np.flatnonzero(flags.any(axis=1).mean(axis=0) > LEAST).tolist():
            branches.append(
                Branch(
                    Candidate(strategy.name, keys, task, strategy),
                    held_arm.ranges(flags[:, :, sign]),
                    partial(_postures, held_arm, poses, sign, clear),
                    held_arm.turning,
                )
            )
    return branches


def _postures(
    held_arm: HeldArm, poses: Array, sign: int, clear: Clear | None, which: Indices, levels: Vector
) -> Matrix:
    return held_arm.postures_at(poses[which], levels[:, None], sign, clear)
