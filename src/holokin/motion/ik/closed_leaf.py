"""Leaves with a closed inverse: a joint is held, or more, on an arm whose other six joints have one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

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

PIECES = (16, 128)
"""Pieces of the straight way to a pose over which whole turns are counted; the many where the few move a joint far."""

AT_ONCE = 1024
"""Poses whose turns are counted together, which takes some 100 MB."""

FAR = 0.8
"""Motion [rad] of a joint over a piece above which its turns are not told."""


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
    return _inverse(found, limits).at((level - held[2]) / held[1])


@kept
def _inverse(found: ArmClass, limits: bool) -> ClosedInverse:
    return ClosedInverse(found, limits)


@dataclass(frozen=True, eq=False)
class ClosedBranch(Value):
    """The postures of a closed leaf that have the signs of a start q0 (n,): one of each pose, but for whole turns.

    row: which of the signs they are.
    """

    leaf: Held
    q0: Vector
    row: int

    @staticmethod
    def of(leaf: Held | None, q0: Vector) -> ClosedBranch | None:
        """That of a start on the leaf; None where no answer at its tool pose is the start, as at a singular posture."""
        if leaf is None:
            return None
        arm = leaf.inverse.arm
        answers = leaf.one(arm.robot.pose(q0, arm.tip))
        gap = leaf.postures(answers) - q0
        gap -= 2 * np.pi * arm.robot.hinges * np.round(gap / (2 * np.pi))
        near = np.flatnonzero((np.abs(gap).max(axis=1) < SAME) & (answers[:, 9] > DOUBT))
        return ClosedBranch(leaf, q0, int(near[0])) if len(near) == 1 else None

    @cached_property
    def single(self) -> bool:
        """Whether no joint has two turns within its limits."""
        robot, inverse = self.leaf.inverse.arm.robot, self.leaf.inverse
        return inverse.limits and bool(((robot.upper - robot.lower)[inverse.others] < 2 * np.pi).all())

    def one(self, pose: Matrix) -> Vector | None:
        """The posture (n,) of a pose, an array (4, 4) of floats; None where there is none, or more is to be asked."""
        answer = self.leaf.one(pose)[self.row]
        sound = answer[9] > DOUBT and answer[10] >= 0 and answer[11] < ROTATION
        return self.leaf.postures(answer) if sound else None

    def reach(self, p: Matrix, R: Array, threads: int | None = None) -> tuple[Matrix, Indices, Flags]:
        """(postures (k, n), statuses (k,), where both are known (k,)) of poses, positions (k, 3), rotations (k, 3, 3).

        A pose without a posture has the status LEAF_ENDS, and NaN. Of several turns within the limits that one is taken
        to which the straight way from the start leads; where it leads to none, nothing is known.
        """
        answers = self.leaf.answers(pose_from(p, R), threads)[:, self.row]
        real = answers[:, 9] > DOUBT
        known = real | (answers[:, 9] < -DOUBT)
        q = self.leaf.postures(answers)
        q[~real] = np.nan
        if not self.single:
            for some in np.array_split(np.flatnonzero(real), max(1, int(real.sum()) // AT_ONCE)):
                q[some], known[some] = self._wound(p[some], R[some], q[some], threads)
        robot = self.leaf.inverse.arm.robot
        within = (robot.beyond(q) <= TOLERANCES.limit).all(axis=1) | (not self.leaf.inverse.limits)
        status = np.where(real, np.where(within, InverseStatus.REACHED, InverseStatus.LIMIT), InverseStatus.LEAF_ENDS)
        return q, status.astype(np.intp), known

    def _wound(self, p: Matrix, R: Array, q: Matrix, threads: int | None) -> tuple[Matrix, Flags]:
        """Postures (k, n) with the whole turns to which the straight ways from the start lead; which are known (k,)."""
        robot, tip, others = self.leaf.inverse.arm.robot, self.leaf.inverse.arm.tip, self.leaf.inverse.others
        start, q, known = robot.pose(self.q0, tip), q.copy(), np.zeros(len(q), dtype=bool)
        turns = Rotation.from_matrix(R @ start[:3, :3].T).as_rotvec()
        for pieces in PIECES:
            left = np.flatnonzero(~known)
            if not len(left):
                break
            shares = np.linspace(0.0, 1.0, pieces + 1)[1:, None]
            ways = (shares * turns[left, None]).reshape(-1, 3)
            positions = (start[:3, 3] + shares * (p[left, None] - start[:3, 3])).reshape(-1, 3)
            poses = pose_from(positions, Rotation.from_rotvec(ways).as_matrix() @ start[:3, :3])
            answers = self.leaf.answers(poses, threads)[:, self.row].reshape(len(left), pieces, -1)
            steps = np.diff(
                self.leaf.postures(answers), axis=1, prepend=np.broadcast_to(self.q0, (len(left), 1, robot.n))
            )
            steps -= 2 * np.pi * np.round(steps / (2 * np.pi)) * robot.hinges
            told = (answers[:, :, 9] > DOUBT).all(axis=1) & (np.abs(steps[:, :, others]).max(axis=(1, 2)) < FAR)
            ends = self.q0 + steps[told].sum(axis=1)
            q[left[told]] += 2 * np.pi * np.round((ends - q[left[told]]) / (2 * np.pi)) * robot.hinges
            known[left[told]] = True
        return q, known

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
