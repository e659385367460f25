"""Leaves with a closed inverse: joints are held, or follow the tool's pose, and the other six joints have one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, reduce
from typing import Any, NamedTuple

import numpy as np

from ...base.errors import BranchError, HolokinError, OutOfReachError
from ...base.poses import pose_from
from ...base.tolerances import TOLERANCES
from ...base.types import ROTATION, Array, ArrayLike, Flags, Indices, Matrix, Value, Vector, frozen, kept
from ...robot import Kinematics, nearer_or_other
from ...robot.closed_form import ArmClass, ClosedInverse, Held, NoClass, arm_class
from ...robot.closed_form.closed_inverse import DOUBT
from ...robot.closed_form.six_hinges import COLUMNS, answer
from ...strategies import HolonomicStrategy, may_jump
from ...strategies.constraints.constraint import Tilt
from ...strategies.tasks.frame_task import asks_whole_pose
from ...symbolic import SX, Function, fmin, substitute, symbol
from .solutions import InverseStatus

SAME = 1e-6
"""Joints [joint units] that differ less are one posture."""

BOUNDLESS = 1e9
"""Distance to a limit [joint units] where there is none."""


class HeldJoints(NamedTuple):
    """g = factors q[joints] + shifts - h(x), each (r,): the coordinates that g holds; h is 0 where nothing follows."""

    joints: tuple[int, ...]
    factors: Vector
    shifts: Vector
    follows: Tilt | None

    def at(self, level: Any, follows: Any) -> Any:
        """The values (r,) of the joints on a level (r,), h given: numbers or expressions."""
        return (level + follows - self.shifts) / self.factors


@kept
def held_joints(strategy: HolonomicStrategy) -> HeldJoints | str:
    """The joints that g holds, or that follow the tool's pose; or why it holds none.

    The task asks for the whole pose of one tip.
    """
    task, rows, tilt = strategy.task, strategy.constraint.rows, strategy.constraint.tilt
    if not asks_whole_pose(task):
        return "the task does not ask for the whole pose of a tip"
    base, q = strategy.constraint if tilt is None else tilt.base, symbol("q", task.n)
    kinematics = task.kinematics(q)
    slopes = base.slopes(task, kinematics, q)
    if rows and not slopes.is_constant():
        return f"{strategy.constraint.name!r} does not hold single joints"
    A = np.array([[float(slopes[i, j]) for j in range(task.n)] for i in range(rows)]).reshape(rows, task.n)
    if rows and may_jump(replace(strategy, constraint=base)):
        return f"{strategy.constraint.name!r} may jump"
    if not ((A != 0).sum(axis=1) == 1).all() or len(set(np.argmax(A != 0, axis=1))) < rows:
        return f"{strategy.constraint.name!r} ties joints together and does not hold them one by one"
    held = np.argmax(A != 0, axis=1)
    at_zero = substitute(base.bind(task, kinematics, q), q, SX.zeros(task.n, 1))
    shifts = np.array([float(at_zero[i]) for i in range(rows)])
    return HeldJoints(tuple(held.tolist()), A[np.arange(rows), held], shifts, tilt)


@kept
def leaf_class(strategy: HolonomicStrategy) -> ArmClass | NoClass:
    """The class of the arm that the held joints of a strategy leave."""
    held = held_joints(strategy)
    return NoClass((), held) if isinstance(held, str) else arm_class(strategy.task.robot, held[0], strategy.task.tip)


def closed_branch(strategy: HolonomicStrategy, q0: Vector, level: Vector, limits: bool) -> ClosedBranch | None:
    """The closed form of the postures of a leaf on the branch of a start (n,); None where there is none.

    Where g may jump the paths from the start decide.
    """
    if may_jump(strategy):
        return None
    turn = turn_before_jump(strategy, q0)
    leaf = closed_leaf(strategy, level, limits) if turn > 0 else None
    if leaf is not None and not leaf.inverse.arm.proven:
        return ClosedBranch(leaf, q0, None, frozen(strategy.task._place(q0)[1]), turn)
    return ClosedBranch.of(leaf, q0, turn)


def turn_before_jump(strategy: HolonomicStrategy, q0: Vector) -> float:
    """How far [rad] the tool may turn from its rotation at q0 before coordinates jump that g takes; else infinite."""
    if (tilt := strategy.constraint.tilt) is None:
        return np.inf
    if strategy.task.frames > 1:
        return 0.0
    p, R = strategy.task._place(q0)
    return float(tilt.turn(strategy.task, Kinematics(SX(p), SX(R), SX(6, 0), {})))


def closed_leaf(strategy: HolonomicStrategy, level: Vector, limits: bool) -> Held | Following | None:
    """The closed inverse of a leaf g(q) = level (r,); None where there is none."""
    found, held = leaf_class(strategy), held_joints(strategy)
    if isinstance(found, NoClass) or isinstance(held, str):
        return None
    if held.follows is not None:
        return Following(_inverse(found, limits), _followed(strategy, limits), frozen(np.array(level, dtype=float)))
    leaf = _inverse(found, limits).at(held.at(level, 0.0))
    return leaf if leaf.sound else None


@kept
def _inverse(found: ArmClass, limits: bool) -> ClosedInverse:
    return ClosedInverse(found, limits)


@kept
def _followed(strategy: HolonomicStrategy, limits: bool) -> Function:
    """(tool pose (4, 4), level (r,)) -> the numbers of `ClosedInverse.numbers`, the values (r,) of the held joints, and
    how far within their limits they are."""
    pose, level = symbol("pose", 4, 4), symbol("level", strategy.constraint.rows)
    inverse, values, within = _values(strategy, limits, pose, level)
    chain, own = inverse.numbers(values)
    outputs = {"chain": chain, "own": own, "held": values, "within": within}
    return Function("followed", {"pose": pose, "level": level}, outputs)


def _values(strategy: HolonomicStrategy, limits: bool, pose: SX, level: SX) -> tuple[ClosedInverse, SX, SX]:
    """The inverse of a leaf that has one, the values (r,) of its held joints, how far within their limits they are."""
    held, found, task = held_joints(strategy), leaf_class(strategy), strategy.task
    if isinstance(held, str) or isinstance(found, NoClass):
        raise ValueError(strategy.name)
    k = Kinematics(pose[:3, 3], pose[:3, :3], SX(6, 0), {})
    h = SX.zeros(len(held.joints), 1) if held.follows is None else held.follows.pose(task, k)
    values, joints = held.at(level, h), list(held.joints)
    low, high = task.robot.lower[joints] - TOLERANCES.limit, task.robot.upper[joints] + TOLERANCES.limit
    bounds = [values[i] - x for i, x in enumerate(low) if np.isfinite(x)]
    bounds += [x - values[i] for i, x in enumerate(high) if np.isfinite(x)]
    return _inverse(found, limits), values, reduce(fmin, bounds if limits else [], SX(BOUNDLESS))


def posture_of_signs(strategy: HolonomicStrategy, limits: bool) -> Function | None:
    """(tool pose (4, 4), level (r,), signs (3,)) -> (posture (n,), how real it is, how far within the limits, fault).

    As of `solver`, with the numbers of the arm in it: for code that stands by itself. None where there is none.
    """
    found = leaf_class(strategy)
    if isinstance(found, NoClass):
        return None
    pose, level, signs = symbol("pose", 4, 4), symbol("level", strategy.constraint.rows), symbol("signs", 3)
    inverse, values, within = _values(strategy, limits, pose, level)
    chain, own = inverse.numbers(values)
    joints = SX(np.clip(inverse.joints, -BOUNDLESS, BOUNDLESS))
    x = answer(found.form, True, chain, pose, own, joints, signs)
    q = SX.zeros(strategy.task.n, 1)
    q[inverse.others], q[list(found.held)] = x[:6], values
    inputs = {"pose": pose, "level": level, "signs": signs}
    outputs = {"q": q, "share": x[9], "within": fmin(x[10], within), "fault": x[11]}
    return Function("posture", inputs, outputs)


@dataclass(frozen=True, eq=False)
class Following(Value):
    """A closed inverse whose held joints follow the tool's pose, on one level (r,), as `Held` is one at fixed values.

    Behind the numbers of an answer come the values (r,) of the held joints.
    """

    inverse: ClosedInverse
    followed: Function
    level: Vector

    def answers(self, poses: Array, threads: int | None = None) -> Array:
        """The answers (k, 8, 12 + r) at poses (k, 4, 4)."""
        chain, own, held, within = self.followed.batch(poses, self.level, threads=threads)
        rows = self.inverse.answers_of(chain, own, poses, threads)
        return self._with_held(rows, held.reshape(len(poses), 1, -1), within[:, None])

    def one(self, pose: Array) -> Matrix:
        """The same at one pose, an array (4, 4) of floats: (8, 12 + r)."""
        kernel = self.inverse.kernel
        if kernel is None:
            return self.answers(pose[None], 1)[0]
        chain, own, held, within = self.followed(pose, self.level)
        return self._with_held(kernel.call(chain, pose, own, self.inverse.joints), held, within)

    def _with_held(self, rows: Array, held: ArrayLike, within: ArrayLike) -> Array:
        answers = np.empty((*rows.shape[:-1], COLUMNS + len(self.level)))
        answers[..., :COLUMNS], answers[..., COLUMNS:] = rows, held
        np.minimum(rows[..., 10], within, out=answers[..., 10])
        return answers

    def postures(self, answers: Array) -> Array:
        """The postures (..., n) of answers (..., 12 + r); other coordinates than those of the arm are 0."""
        columns, beside = self._columns
        q = answers[..., columns]
        if len(beside):
            q[..., beside] = 0.0
        return q

    @cached_property
    def _columns(self) -> tuple[Indices, Indices]:
        """The column of each coordinate in an answer, and the coordinates that have none."""
        columns = np.full(self.inverse.arm.robot.n, -1)
        columns[self.inverse.others] = np.arange(6)
        columns[list(self.inverse.arm.held)] = COLUMNS + np.arange(len(self.level))
        return columns, np.flatnonzero(columns < 0)


@dataclass(frozen=True, eq=False)
class ClosedBranch(Value):
    """The postures of a closed leaf that have the signs of a start q0 (n,): one of each pose, but for whole turns.

    row: which of the signs they are; None where signs do not tell them, as after a step of degree four. Then only poses
    that no posture has are known. turn: from which angle [rad] to the start's rotation (3, 3) on the straight path has
    to tell, since joints follow coordinates of the pose that may jump there; see `Tilt`.
    """

    leaf: Held | Following
    q0: Vector
    row: int | None
    rotation: Matrix
    turn: float = np.inf

    @staticmethod
    def of(leaf: Held | Following | None, q0: Vector, turn: float = np.inf) -> ClosedBranch | None:
        """That of a start on the leaf; None where signs tell no postures apart, and where no answer at its tool pose is
        the start, as at a singular posture."""
        if leaf is None or not leaf.inverse.arm.proven:
            return None
        arm = leaf.inverse.arm
        pose = arm.robot.pose(q0, arm.tip)
        answers = leaf.one(pose)
        gap = leaf.postures(answers) - q0
        gap -= 2 * np.pi * arm.robot.hinges * np.round(gap / (2 * np.pi))
        near = np.flatnonzero((np.abs(gap).max(axis=1) < SAME) & (answers[:, 9] > DOUBT))
        return ClosedBranch(leaf, q0, int(near[0]), frozen(pose[:3, :3]), turn) if len(near) == 1 else None

    def on(self, leaf: Held | Following | None) -> ClosedBranch | None:
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
        narrow = bool(((robot.upper - robot.lower)[inverse.others] < 2 * np.pi).all())
        if isinstance(self.leaf, Following):  # which tells of each pose how far its held joints are within
            return narrow
        held, values = list(inverse.arm.held), self.leaf.values
        beyond = np.maximum(robot.lower[held] - values, values - robot.upper[held])
        return narrow and bool((beyond <= TOLERANCES.limit).all())

    @cached_property
    def least_trace(self) -> float:
        """The trace of R^T R_0 from which a rotation R is less than `turn` away from the start's."""
        return 1 + 2 * float(np.cos(self.turn)) if self.turn < np.inf else -np.inf

    def one(self, pose: Matrix) -> Vector | None:
        """The posture (n,) of a pose, an array (4, 4) of floats; None where there is none, or more is to be asked."""
        answer = self.leaf.one(pose)[self.row]
        sound = answer[9] > DOUBT and answer[10] >= 0 and answer[11] < ROTATION
        if sound and self.turn < np.inf:
            sound = float(np.vdot(pose[:3, :3], self.rotation)) > self.least_trace
        return self.leaf.postures(answer) if sound else None

    def reach(self, p: Matrix, R: Array, threads: int | None = None) -> tuple[Matrix, Indices, Flags]:
        """(postures (k, n), statuses (k,), where both are known (k,)) of poses, positions (k, 3), rotations (k, 3, 3).

        As `postures`; where a joint has several turns within its limits, the straight way from the start has to tell
        which, and of a pose that has a posture nothing is known.
        """
        answers = self._answers(p, R, threads)
        near = np.einsum("kij,ij->k", R, self.rotation) > self.least_trace
        real, none = answers[:, 9] > DOUBT, (answers[:, 9] < -DOUBT) & near
        if not self.single:
            return np.full((len(p), len(self.q0)), np.nan), np.full(len(p), int(InverseStatus.LEAF_ENDS)), none
        return *self._told(answers), (real & near) | none

    def postures(self, p: Matrix, R: Array) -> tuple[Matrix, Indices]:
        """(postures (k, n), each at some turn of its joints; statuses (k,)) of positions (k, 3), rotations (k, 3, 3).

        A pose without a posture has the status LEAF_ENDS, and NaN.
        """
        return self._told(self._answers(p, R, None))

    def _answers(self, p: Matrix, R: Array, threads: int | None) -> Matrix:
        """The answers of the branch; where signs do not tell it, those that are the most real."""
        poses = pose_from(p, R)
        every = self.leaf.one(poses[0])[None] if len(poses) == 1 else self.leaf.answers(poses, threads)
        nearest = every[:, :, 9].argmax(axis=1) if self.row is None else self.row
        return every[np.arange(len(every)), nearest]

    def _told(self, answers: Matrix) -> tuple[Matrix, Indices]:
        real, q = answers[:, 9] > DOUBT, self.leaf.postures(answers)
        q[~real] = np.nan
        robot = self.leaf.inverse.arm.robot
        within = (robot.beyond(q) <= TOLERANCES.limit).all(axis=1) | (not self.leaf.inverse.limits)
        status = np.where(real, np.where(within, InverseStatus.REACHED, InverseStatus.LIMIT), InverseStatus.LEAF_ENDS)
        return q, status.astype(np.intp)

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
        fact = f"the pose is out of reach of {arm.robot.name!r}{held}: no posture has the pose"
        cure = nearer_or_other(arm.robot, p, arm.tip)
        return OutOfReachError(fact, f"{cure}, or take another level" if names else cure)
