"""Curves of self-motions, the postures that hold the tool where it is: traced in steps, many tool poses side by side.

dq/ds = v, where v is the last direction without its part that moves the tool, v - J^+ J v. With one redundant joint
that is the self-motion itself, a curve; with several it is a line in it.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError, SingularityError, SingularityKind
from ..base.types import (
    MOST,
    Array,
    ArrayLike,
    Flags,
    Indices,
    Matrix,
    Result,
    Value,
    Vector,
    finite,
    frozen,
    kept,
)
from ..robot import Robot, start_posture
from ..symbolic import SX, Function, as_map, fabs, factorise, fmax, if_else, norm_2, symbol, vertcat, vertsplit, wrapped
from ..symbolic.linear import null_space, null_vector
from .tasks.task import Task

ROUGH = 1e-4
"""Last correction [joint units] of a good step, at most: the next one would be of the order of its square."""

BESIDE = 0.05
"""First correction of a good step, over its length, at most: where curves bend as usual it is a thousandth; near a
singular posture, where two curves pass each other closely, a longer one may lead to the other."""

BLOCK = 32
"""Steps that are made before it is looked where curves end: a Panda's have 30 to 130 of them."""


class CurveEnd(StrEnum):
    """Why a self-motion is followed no farther."""

    CLOSED = "closed"
    LIMIT = "limit"
    SINGULAR = "singular"
    LENGTH = "length"


@dataclass(frozen=True, eq=False)
class SelfMotionCurve(Result, Value):
    """Postures (k, n) with one tool pose, in order, s (k,) [joint units] their arc length from the given posture.

    `endings`: why it stops at its first and at its last posture; both CLOSED when it comes back to itself.
    """

    task: Task
    q: Matrix
    s: Vector
    endings: tuple[CurveEnd, CurveEnd]

    def __str__(self) -> str:
        ends = "closed" if self.closed else f"open, it ends at a {' and at a '.join(self.endings)}"
        return f"{ends}: {self.s[-1] - self.s[0]:.4g} joint units long, {len(self.q)} postures with one tool pose"

    @property
    def closed(self) -> bool:
        """True when the self-motion leads back to where it began."""
        return self.endings[0] is CurveEnd.CLOSED

    def at(self, s: float) -> Vector:
        """The posture (n,) at an arc length s [joint units] of it, with the tool exactly still.

        Raises: ArgumentError, ShapeError, NotFiniteError.
        """
        s = float(finite("s", s, ()))
        q = np.array([np.interp(s, self.s, joint) for joint in self.q.T])
        for _ in range(3):  # 1e-4 off at first, at round-off after three corrections
            q = q + correction(self.task, q, *self._target)
        return q

    @cached_property
    def _target(self) -> tuple[Vector, Matrix]:
        """Where the tool is at the given posture: position (3,), rotation (3, 3)."""
        p, R = self.task._place(self.q[int(np.argmin(np.abs(self.s)))])
        return frozen(p), frozen(R)


@typed
def self_motion_curve(
    task: Task, q0: ArrayLike, *, step: float = 0.02, length: float = 4 * np.pi, limits: bool = True
) -> SelfMotionCurve:
    """Trace the postures that hold the tool where it is at q0, both ways: dq/ds = n(q), corrected to f(q) = f(q0).

    Args:
        step: arc length between postures [joint units]. length: at most so far each way.
        limits: a curve ends at the joint limits; False goes on beyond them.

    Raises:
        ArgumentError: not one redundant joint, or bad numbers. SingularityError: J is singular at q0.
        JointLimitError: with limits, q0 is beyond them.
    """
    start = start_posture(task.robot, q0, limits)
    if task.n - task.m != 1:
        what = "the number of redundant joints"
        raise ArgumentError(what, task.n - task.m, "give a task that leaves one")
    if not (0 < step < length < np.inf and length / step <= MOST):
        what = "the step and length of a self-motion"
        raise ArgumentError(what, (step, length), f"give 0 < step < length, {MOST:g} steps at most")
    unit_null(task, start, None)
    return CurveTracer.through(task, start[None]).traced(start[None], step=step, length=length, limits=limits)[0]


@dataclass(frozen=True, eq=False)
class CurveTracer(Value):
    """The postures that hold the tool at poses p (S, 3), R (S, 3, 3)."""

    task: Task
    p: Matrix
    R: Array

    @classmethod
    def through(cls, task: Task, Q: Matrix) -> CurveTracer:
        """Those through postures (S, n)."""
        return cls(task, *task._poses(Q))

    def traced(
        self, Q: Matrix, *, step: float, length: float, limits: bool | Flags, directions: Matrix | None = None
    ) -> list[SelfMotionCurve]:
        """The curves through postures (S, n), both ways, each round once.

        Args:
            step, length: as of `self_motion_curve`. limits: whether joint limits count, or those of which joints (n,).
            directions: in which they begin (S, n), where several joints are redundant.
        """
        v = null_vectors(self.task, Q) if directions is None else directions
        postures, sizes, place, endings = self.postures(Q, v, step=step, length=length, limits=limits)
        # Each curve with its arc length from the given posture.
        curves, first = [], 0
        for size, given, (begin, end) in zip(sizes.tolist(), place.tolist(), endings, strict=True):
            q = postures[first : first + size]
            s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1))])
            curves.append(SelfMotionCurve(self.task, q, s - s[given], (begin, end)))
            first += size
        return curves

    def postures(
        self, Q: Matrix, v: Matrix, *, step: float, length: float, limits: bool | Flags
    ) -> tuple[Matrix, Indices, Indices, list[tuple[CurveEnd, CurveEnd]]]:
        """The postures (N, n) of the curves through Q (S, n) that begin along v (S, n), one curve after another.

        Returns: them; how many a curve has (S,); which of those is the given one (S,); why they end.
        """
        # Ahead, and back where the curve has not come round.
        every = np.arange(len(Q))
        ahead, reached, last = self._one_way(Q, v, every, step, length, limits)
        opened = np.flatnonzero([end is not CurveEnd.CLOSED for end in last])
        back, passed, first = self._one_way(Q[opened], -v[opened], opened, step, length, limits)
        # Both halves of each as one curve.
        which = np.concatenate([opened[passed][::-1], every, reached])
        order = np.argsort(which, kind="stable")
        postures = np.concatenate([back[::-1], Q, ahead])[order]
        place, begins = np.zeros(len(Q), dtype=int), list(last)
        place[opened] = np.bincount(passed, minlength=len(opened))
        for i, end in zip(opened.tolist(), first, strict=True):
            begins[i] = end
        return postures, np.bincount(which, minlength=len(Q)), place, [*zip(begins, last, strict=True)]

    def step(self, q: Matrix, v: Matrix, i: Indices, length: Vector) -> tuple[Matrix, Matrix, Flags]:
        """One step of postures (k, n) of the poses i along their directions v (k, n), which need not hold the tool.

        Returns (postures, directions there, which of them are good); those that are not stay where they were.
        """
        steps, ways, good = self._steps(q, v, i, length, 1)
        postures, along, sound = steps[:, 0], ways[:, 0], good[:, 0]
        bad = np.flatnonzero(~sound)
        postures[bad] = q[bad]
        bad = bad[length[bad] != 0]
        postures[bad], along[bad], sound[bad] = self._in_parts(q[bad], v[bad], i[bad], length[bad])
        return postures, along, sound

    def _in_parts(self, q: Matrix, v: Matrix, i: Indices, length: Vector) -> tuple[Matrix, Matrix, Flags]:
        """The same in shorter steps, where self-motions bend, as close to a singular posture."""
        postures, along, sound = q.copy(), v.copy(), np.zeros(len(q), dtype=bool)
        for parts in (4, 16, 64, 256):
            bad = np.flatnonzero(~sound)
            if not len(bad):
                break
            posture, way, good = self._steps(q[bad], v[bad], i[bad], length[bad] / parts, parts)
            sound[bad] = good.all(axis=1)
            postures[bad], along[bad] = np.where(sound[bad, None], posture[:, -1], q[bad]), way[:, -1]
        return postures, along, sound

    def _steps(self, q: Matrix, v: Matrix, i: Indices, length: Vector, times: int) -> tuple[Array, Array, Flags]:
        """Steps (k, times, n) one after another, the directions there, and which of them are good (k, times)."""
        postures, along, sound = _curve_step(self.task).repeated(times, 2, q, v, self.p[i], self.R[i], length[:, None])
        return postures, along, sound[..., 0] > 0

    def _one_way(
        self, Q: Matrix, v: Matrix, i: Indices, step: float, length: float, limits: bool | Flags
    ) -> tuple[Matrix, Indices, list[CurveEnd]]:
        """The postures (N, n) behind Q (k, n) in the direction v, those of a curve in their order; of which curve each
        is (N,); why there are no more (k,)."""
        robot, most = self.task.robot, int(np.ceil(length / step))
        ends, walking, made = np.full(len(Q), CurveEnd.LENGTH, dtype=object), np.arange(len(Q)), np.zeros(len(Q), int)
        starts, ways, _ = self._steps(Q, v, i, np.zeros(len(Q)), 1)
        posture, along, first = starts[:, 0], ways[:, 0], ways[:, 0]
        numbers, points = [walking[:0]], [Q[:0]]
        while len(walking):
            # A block of steps, up to the first that is not good, which is made in shorter ones.
            left = most - made[walking]
            times = min(BLOCK, int(left.max()))
            q, ahead, sound = self._steps(posture, along, i[walking], np.full(len(walking), step), times)
            steps = np.where(sound.all(axis=1), times, sound.argmin(axis=1))
            bad = np.flatnonzero(steps < np.minimum(left, times))
            if len(bad):
                j = steps[bad]
                before, way = np.maximum(j - 1, 0), (j > 0)[:, None]
                begin, way = np.where(way, q[bad, before], posture[bad]), np.where(way, ahead[bad, before], along[bad])
                q[bad, j], ahead[bad, j], good = self._in_parts(begin, way, i[walking[bad]], np.full(len(bad), step))
                steps[bad] += good
                bad = bad[~good]
            ends[walking[bad]] = CurveEnd.SINGULAR
            # They end before a joint limit; and where they have come round, within 3/4 of a step of their start and
            # going the same way: else they cross themselves.
            number = np.arange(times)
            good = number < np.minimum(steps, left)[:, None]
            q[~good] = 0.0
            round_again = good & (made[walking][:, None] + number > 2)
            round_again &= away(self.task, q, Q[walking][:, None]) < 0.75 * step
            round_again &= np.einsum("ktn,kn->kt", ahead, first[walking]) > 0.9
            beyond = good & ((robot.beyond(q) > 0) & limits).any(axis=2)
            ended, end = (round_again | beyond).any(axis=1), (round_again | beyond).argmax(axis=1)
            at_limit = beyond[np.arange(len(walking)), end]
            ends[walking[ended & at_limit]], ends[walking[ended & ~at_limit]] = CurveEnd.LIMIT, CurveEnd.CLOSED
            count = np.where(ended, end + ~at_limit, good.sum(axis=1))
            # What is left goes on from its last posture.
            numbers.append(np.repeat(walking, count))
            points.append(q[number < count[:, None]])
            made[walking] += count
            going = ~ended & (made[walking] < most)
            going[bad] = False
            last = count[going] - 1
            posture, along, walking = q[going, last], ahead[going, last], walking[going]
        which = np.concatenate(numbers)
        order = np.argsort(which, kind="stable")
        return np.concatenate(points)[order], which[order], ends.tolist()


@kept
def _curve_step(task: Task) -> Function:
    """(q, v, p, R, length) -> (posture, direction there, whether the step is good) of a step with the tool at (p, R).

    Along the direction in the middle of the step, then two Newton corrections: a step of 0.2 leaves 1e-3, the first one
    1e-6 of it, the second one round-off. It is no good step where one of them is large.
    """
    q, v, (p, R), length = symbol("q", task.n), symbol("v", task.n), task._target_symbols(), symbol("length", 1)
    kinematics = task.kinematics(q)
    J = factorise(task.jacobian_expression(kinematics, q).T)
    still = J.complement_times(J.transpose_times(v)[task.m :])
    direction = still / norm_2(still)
    correction = J.solve_transposed(task._error_expression(kinematics, p, R))
    along, corrected = as_map([q, v], direction), as_map([q, v, p, R], vertcat(correction, direction))
    way = along(q + length / 2 * v, v)
    end = q + length * way
    first = corrected(end, way, p, R)
    second = corrected(end + first[: task.n], first[task.n :], p, R)
    end, way = end + first[: task.n] + second[: task.n], second[task.n :]
    size = SX(0)
    for move in vertsplit(second[: task.n]):
        size = fmax(size, fabs(move))
    # Not where something is not finite, nor where the way leads to another curve that is near.
    near = norm_2(end - q) < 2 * fabs(length) + ROUGH
    beside = norm_2(first[: task.n]) < BESIDE * fabs(length) + ROUGH
    outputs = {"q_next": end, "v_next": way, "sound": if_else(near, if_else(beside, size < ROUGH, 0), 0)}
    return Function("curve_step", {"q": q, "v": v, "p": p, "R": R, "length": length}, outputs)


def null_vectors(task: Task, Q: Matrix) -> Matrix:
    """`null_vector` of the Jacobians at postures (k, n) of a task that leaves one joint: (k, n)."""
    J = task.jacobian_batch(Q)[0]
    n = null_space(J)[..., 0]
    return np.where(np.linalg.det(np.concatenate([J, n[:, None]], axis=1))[:, None] < 0, -n, n)


def away(task: Task, q: Matrix, others: Matrix) -> Vector:
    """How far postures (..., n) are from others [joint units], full turns of hinges taken off."""
    return np.linalg.norm(joint_gap(task.robot, q, others), axis=-1)


def joint_gap(robot: Robot, q: Matrix, others: Matrix) -> Matrix:
    """Postures less others (..., n), full turns of hinges taken off."""
    gap = q - others
    return np.where(robot.hinges, wrapped(gap), gap)


def least_motion(J: Array, wanted: Array, weights: Array | float = 1.0) -> Array:
    """The least weighted dq (S, n, k) with J dq = wanted (S, m, k); weights (n,) or (S, n)."""
    T = np.swapaxes(J, 1, 2) / np.asarray(weights)[..., None]
    with np.errstate(all="ignore"):
        try:
            return T @ np.linalg.solve(J @ T, wanted)
        except np.linalg.LinAlgError:  # one of them is singular to the last bit
            return T @ np.linalg.pinv(J @ T) @ wanted


def correction(task: Task, q: Vector, p: Vector, R: Matrix) -> Vector:
    """The least joint motion (n,) that, to first order, takes the tool to a pose: position (3,), rotation (3, 3)."""
    motion = np.linalg.lstsq(task.jacobian(q), task._error_function(q, p, R), rcond=None)[0]
    return np.asarray(motion, dtype=float)


def unit_null(task: Task, q: Vector, before: Vector | None) -> Vector:
    """The unit null vector of J at q, turned as `before`. Raises: SingularityError."""
    J = task.jacobian(q)
    sigma = np.linalg.svd(J, compute_uv=False)
    if sigma[-1] < 1e-6 * sigma[0]:
        what = f"the self-motion of the {task.name}"
        raise SingularityError(SingularityKind.KINEMATIC, q, what, float(sigma[-1]))
    return null_vector(J, before)
