"""Leaves with a closed inverse: a joint is held, or more, on an arm whose other six joints have one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...base.errors import BranchError, HolokinError, OutOfReachError
from ...base.poses import pose_from
from ...base.tolerances import TOLERANCES
from ...base.types import ROTATION, Array, Flags, Indices, Matrix, Value, Vector, kept
from ...robot.closed_form import ArmClass, ClosedInverse, Held, NoClass, arm_class
from ...strategies import HolonomicStrategy
from ...strategies.tasks.frame_task import FrameTask
from ...strategies.tasks.task import TipFrame
from ...symbolic import symbol
from .solutions import InverseStatus

SAME = 1e-6
"""Joints [joint units] that differ less are one posture."""

DOUBT = 1e-10
"""How real an answer is, see `solver`: nearer to 0 two postures meet, and the path to them decides."""


@kept
def held_joints(strategy: HolonomicStrategy) -> tuple[tuple[int, ...], Vector, Vector] | str:
    """(coordinates that g holds, factors (r,), shifts (r,)), g = factor q + shift; or why it holds none.

    The task asks for the whole pose of one tip.
    """
    task, rows = strategy.task, strategy.constraint.rows
    if not (isinstance(task, FrameTask) and isinstance(task.frame, TipFrame) and set(task.rows) == set(range(6))):
        return "the task does not ask for the whole pose of a tip"
    q = symbol("q", task.n)
    slopes = strategy.constraint.slopes(task, task.kinematics(q), q)
    if rows and not slopes.is_constant():
        return f"{strategy.constraint.name!r} does not hold single joints"
    A = np.array([[float(slopes[i, j]) for j in range(task.n)] for i in range(rows)]).reshape(rows, task.n)
    if not ((A != 0).sum(axis=1) == 1).all() or len(set(np.argmax(A != 0, axis=1))) < rows:
        return f"{strategy.constraint.name!r} ties joints together and does not hold them one by one"
    held = np.argmax(A != 0, axis=1)
    shift = np.atleast_1d(strategy.constraint_value(np.zeros(task.n))) if rows else np.zeros(0)
    return tuple(held.tolist()), A[np.arange(rows), held], shift


@kept
def leaf_class(strategy: HolonomicStrategy) -> ArmClass | NoClass:
    """The class of the arm that the held joints of a strategy leave."""
    held = held_joints(strategy)
    return NoClass((), held) if isinstance(held, str) else arm_class(strategy.task.robot, held[0], strategy.task.tip)


def closed_leaf(strategy: HolonomicStrategy, level: Vector, limits: bool) -> Held | None:
    """The closed inverse of a leaf g(q) = level (r,); None where there is none."""
    found, held = leaf_class(strategy), held_joints(strategy)
    if isinstance(found, NoClass) or isinstance(held, str):
        return None
    leaf = _inverse(found, limits).at((level - held[2]) / held[1])
    return leaf if leaf.sound else None


@kept
def _inverse(found: ArmClass, limits: bool) -> ClosedInverse:
    return ClosedInverse(found, limits)


@dataclass(frozen=True, eq=False)
class ClosedBranch(Value):
    """The postures of a closed leaf that have the signs of a start q0 (n,): one of each pose, but for whole turns.

    row: which of the signs they are; None where signs do not tell them, as after a step of degree four. Then only poses
    that no posture has are known.
    """

    leaf: Held
    q0: Vector
    row: int | None

    @staticmethod
    def of(leaf: Held | None, q0: Vector) -> ClosedBranch | None:
        """That of a start on the leaf; None where signs tell no postures apart, and where no answer at its tool pose is
        the start, as at a singular posture."""
        if leaf is None or not leaf.inverse.arm.form.family.quadratic:
            return None
        arm = leaf.inverse.arm
        answers = leaf.one(arm.robot.pose(q0, arm.tip))
        gap = leaf.postures(answers) - q0
        gap -= 2 * np.pi * arm.robot.hinges * np.round(gap / (2 * np.pi))
        near = np.flatnonzero((np.abs(gap).max(axis=1) < SAME) & (answers[:, 9] > DOUBT))
        return ClosedBranch(leaf, q0, int(near[0])) if len(near) == 1 else None

    def on(self, leaf: Held | None) -> ClosedBranch | None:
        """The postures that have the same signs on the leaf of another level."""
        return None if leaf is None else replace(self, leaf=leaf)

    @cached_property
    def single(self) -> bool:
        """Whether a pose has at most one posture: signs tell it, and no joint has two turns within its limits.

        Not where a held joint is beyond its own.
        """
        robot, inverse = self.leaf.inverse.arm.robot, self.leaf.inverse
        if self.row is None or not inverse.limits:
            return False
        held, values = list(inverse.arm.held), self.leaf.values
        beyond = np.maximum(robot.lower[held] - values, values - robot.upper[held])
        narrow = (robot.upper - robot.lower)[inverse.others] < 2 * np.pi
        return bool(narrow.all() and (beyond <= TOLERANCES.limit).all())

    def one(self, pose: Matrix) -> Vector | None:
        """The posture (n,) of a pose, an array (4, 4) of floats; None where there is none, or more is to be asked."""
        answer = self.leaf.one(pose)[self.row]
        sound = answer[9] > DOUBT and answer[10] >= 0 and answer[11] < ROTATION
        return self.leaf.postures(answer) if sound else None

    def reach(self, p: Matrix, R: Array, threads: int | None = None) -> tuple[Matrix, Indices, Flags]:
        """(postures (k, n), statuses (k,), where both are known (k,)) of poses, positions (k, 3), rotations (k, 3, 3).

        A pose without a posture has the status LEAF_ENDS, and NaN. Where a joint has several turns within its limits,
        the straight way from the start has to tell which.
        """
        every = self.leaf.answers(pose_from(p, R), threads)
        nearest = every[:, :, 9].argmax(axis=1) if self.row is None else self.row
        answers = every[np.arange(len(every)), nearest]
        real = answers[:, 9] > DOUBT
        known = (real & self.single) | (answers[:, 9] < -DOUBT)
        q = self.leaf.postures(answers)
        q[~real] = np.nan
        robot = self.leaf.inverse.arm.robot
        within = (robot.beyond(q) <= TOLERANCES.limit).all(axis=1) | (not self.leaf.inverse.limits)
        status = np.where(real, np.where(within, InverseStatus.REACHED, InverseStatus.LIMIT), InverseStatus.LEAF_ENDS)
        return q, status.astype(np.intp), known

    def margins(self, poses: Array, held: Matrix) -> Vector:
        """How far (k,) the postures at poses (k, 4, 4) and values (k, r) of the held joints are from ceasing to serve.

        Of how real they are and of their distance to the joint limits the lesser; below 0 they do not serve.
        """
        answers = self.leaf.inverse.answers(poses, held)[:, self.row]
        return np.minimum(answers[:, 9] - DOUBT, answers[:, 10])

    def problem(self, p: Vector, R: Matrix) -> HolokinError:
        """Why a pose has no posture of the branch."""
        arm = self.leaf.inverse.arm
        others = int((self.leaf.answers(pose_from(p, R)[None])[0, :, 9] > DOUBT).sum())
        names = " and ".join(arm.robot.joint_names[k] for k in arm.held)
        held = f" with {names} held" if names else ""
        if others:
            fact = f"no posture of the start's branch has the tool pose{held}; {others} of other branches have it"
            return BranchError(fact, "take one of ik.all(pose) as the start, or another pose")
        fact = f"the pose is out of reach of {arm.robot.name!r}{held}: no posture has it"
        return OutOfReachError(fact, "give a pose nearer to the base" + (", or another level" if names else ""))
