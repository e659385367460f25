"""Self-motions, the postures that hold the tool where it is: walked in steps, at many tool poses side by side.

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
from ..base.types import MOST, Array, ArrayLike, Flags, Indices, Matrix, Value, Vector, finite, frozen
from ..robot import Robot, start_posture
from ..symbolic import wrapped
from ..symbolic.null_space import null_vector
from .tasks.task import Task

CORRECTIONS = 2
"""Newton corrections of a step. A step of 0.2 leaves 1e-3, the first one 1e-6 of it, the second one round-off."""

ROUGH = 1e-4
"""Last correction [joint units] of a good step, at most: the next one would be of the order of its square."""

PARTS = (4, 16, 64)
"""Steps that are tried instead of one that is not good, as close to a singular posture, where self-motions bend."""

BETWEEN = 3
"""Corrections of a posture between two of a curve: 1e-4 off at first, at round-off after three."""

CLOSED = 0.75
"""Distance from the first posture, in steps, within which a walk has come round; half a step is the farthest."""

SAME_WAY = 0.9
"""Cosine between two directions in one place from which on they are one: else the curve comes by, and is not closed."""


class CurveEnd(StrEnum):
    """Why a self-motion is followed no farther."""

    CLOSED = "closed"
    LIMIT = "limit"
    SINGULAR = "singular"
    LENGTH = "length"


@dataclass(frozen=True, eq=False)
class SelfMotion(Value):
    """Postures (k, n) with one tool pose, in order, s (k,) [joint units] their arc length from the given posture.

    `endings`: why it stops at its first and at its last posture; both CLOSED when it comes back to itself.
    """

    task: Task
    q: Matrix
    s: Vector
    endings: tuple[CurveEnd, CurveEnd]

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
        for _ in range(BETWEEN):
            q = q + correction(self.task, q, *self._target)
        return q

    @cached_property
    def _target(self) -> tuple[Vector, Matrix]:
        """Where the tool is at the given posture: position (3,), rotation (3, 3)."""
        p, R = self.task.place(self.q[int(np.argmin(np.abs(self.s)))])
        return frozen(p), frozen(R)


@typed
def self_motion(
    task: Task, q0: ArrayLike, *, step: float = 0.02, length: float = 4 * np.pi, limits: bool = True
) -> SelfMotion:
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
    return SelfMotions.through(task, start[None]).traced(start[None], step=step, length=length, limits=limits)[0]


@dataclass(frozen=True, eq=False)
class SelfMotions(Value):
    """The postures that hold the tool at poses p (S, 3), R (S, 3, 3)."""

    task: Task
    p: Matrix
    R: Array

    @classmethod
    def through(cls, task: Task, Q: Matrix) -> SelfMotions:
        """Those through postures (S, n)."""
        return cls(task, *task.poses(Q))

    def traced(
        self, Q: Matrix, *, step: float, length: float, limits: bool, directions: Matrix | None = None
    ) -> list[SelfMotion]:
        """The curves through postures (S, n), both ways, each round once.

        Args: as `self_motion`; directions (S, n): in which they begin, where several joints are redundant.
        """
        every = np.arange(len(Q))
        if directions is None:
            directions = np.array([null_vector(J) for J in self.task.jacobian_batch(Q)[0]]).reshape(Q.shape)
        v = directions
        ahead, last = self._one_way(Q, v, every, step, length, limits)
        still = np.flatnonzero([end is not CurveEnd.CLOSED for end in last])
        others, first = self._one_way(Q[still], -v[still], still, step, length, limits)
        behind, starts = dict(zip(still.tolist(), others, strict=True)), dict(zip(still.tolist(), first, strict=True))
        found = []
        for i, q in enumerate(Q):
            back = behind.get(i, Q[:0])
            line = np.concatenate([back[::-1], q[None], ahead[i]])
            s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
            found.append(SelfMotion(self.task, line, s - s[len(back)], (starts.get(i, last[i]), last[i])))
        return found

    def walked(self, Q: Matrix, v: Matrix, lengths: Vector, step: float) -> tuple[Matrix, Flags]:
        """Postures (S, n) so far [joint units] along the self-motions through Q (S, n), and which walks got there."""
        every, steps = np.arange(len(Q)), int(np.ceil(np.abs(lengths).max() / step))
        at, along, sound = self.step(Q, v, every, np.zeros(len(Q)))
        for _ in range(steps):
            at, along, here = self.step(at, along, every, lengths / steps)
            sound &= here
        return at, sound

    def step(self, q: Matrix, v: Matrix, i: Indices, length: Vector) -> tuple[Matrix, Matrix, Flags]:
        """One step of postures (k, n) of the poses i along their directions v (k, n), which need not hold the tool.

        Returns (postures, directions there, which of them are good); those that are not stay where they were.
        """
        found, along, sound = self._step(q, v, i, length)
        for parts in PARTS:
            bad = np.flatnonzero(~sound & (length != 0))
            if not len(bad):
                break
            at, way, good = q[bad], v[bad], np.ones(len(bad), dtype=bool)
            for _ in range(parts):
                at, way, here = self._step(at, way, i[bad], length[bad] / parts)
                good &= here
            found[bad], along[bad], sound[bad] = np.where(good[:, None], at, q[bad]), way, good
        return found, along, sound

    def _step(self, q: Matrix, v: Matrix, i: Indices, length: Vector) -> tuple[Matrix, Matrix, Flags]:
        start, size = q, np.inf
        J = self.task.jacobian_batch(q + length[:, None] / 2 * v)[0]
        along = _unit(v - least_motion(J, (J @ v[:, :, None]))[:, :, 0])
        q = q + length[:, None] * along
        for _ in range(CORRECTIONS):
            J = self.task.jacobian_batch(q)[0]
            e = self.task.error_function.batch(q, self.p[i], self.R[i]).reshape(len(q), -1)
            found = least_motion(J, np.stack([e, np.einsum("kmn,kn->km", J, along)], axis=2))
            q, along = q + found[:, :, 0], _unit(along - found[:, :, 1])
            size = np.abs(found[:, :, 0]).max(axis=1)
        with np.errstate(invalid="ignore"):
            near = np.linalg.norm(q - start, axis=1) < 2 * np.abs(length) + ROUGH
            sound = np.isfinite(q).all(axis=1) & near & (size < ROUGH)
        return np.where(sound[:, None], q, start), along, sound

    def _one_way(
        self, Q: Matrix, v: Matrix, i: Indices, step: float, length: float, limits: bool
    ) -> tuple[list[Matrix], list[CurveEnd]]:
        """The postures behind Q (k, n) in the direction v, and why there are no more."""
        if not len(Q):
            return [], []
        robot, ends = self.task.robot, np.full(len(Q), CurveEnd.LENGTH, dtype=object)
        on = np.arange(len(Q))
        at, along, _ = self._step(Q, v, i, np.zeros(len(Q)))
        first, numbers, points = along, [on[:0]], [Q[:0]]
        for k in range(int(np.ceil(length / step))):
            at, along, sound = self.step(at, along, i[on], np.full(len(on), step))
            ends[on[~sound]] = CurveEnd.SINGULAR
            if limits:
                beyond = sound & ~robot.within(at)
                ends[on[beyond]], sound = CurveEnd.LIMIT, sound & ~beyond
            back = sound & (np.sum(along * first[on], axis=1) > SAME_WAY) & (k > 2)
            back &= away(self.task, at, Q[on]) < CLOSED * step
            ends[on[back]] = CurveEnd.CLOSED
            numbers.append(on[sound])
            points.append(at[sound])
            left = sound & ~back
            on, at, along = on[left], at[left], along[left]
            if not len(on):
                break
        which, flat = np.concatenate(numbers), np.concatenate(points)
        order = np.argsort(which, kind="stable")
        cuts = np.searchsorted(which[order], np.arange(1, len(Q)))
        return np.split(flat[order], cuts), ends.tolist()


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
    least = np.linalg.lstsq(task.jacobian(q), task.error_function(q, p, R), rcond=None)[0]
    return np.asarray(least, dtype=float)


def unit_null(task: Task, q: Vector, before: Vector | None) -> Vector:
    """The unit null vector of J at q, turned as `before`. Raises: SingularityError."""
    J = task.jacobian(q)
    sigma = np.linalg.svd(J, compute_uv=False)
    if sigma[-1] < 1e-6 * sigma[0]:
        what = f"the self-motion of the {task.name}"
        raise SingularityError(SingularityKind.KINEMATIC, q, what, float(sigma[-1]))
    return null_vector(J, before)


def _unit(v: Matrix) -> Matrix:
    with np.errstate(all="ignore"):
        return v / np.linalg.norm(v, axis=1, keepdims=True)
