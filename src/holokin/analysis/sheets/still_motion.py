"""Motions of the joints between two postures of one tool pose, with the tool still."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.tolerances import TOLERANCES
from ...base.types import Array, ArrayLike, Matrix, NoTruthValue, Value, Vector
from ...motion.checks import Clear
from ...motion.timing import Stretch
from ...motion.trajectory import Measures, Status, Trajectory
from ...robot import Robot, speed_limits
from ...strategies.self_motion_curves import CurveEnd, CurveTracer, SelfMotionCurve, joint_gap, least_motion
from ...strategies.tasks.task import Task

STEP = 0.1  # arc length [joint units] between the postures of a self-motion that is traced
CORRECTIONS = 4  # Newton corrections of a posture that is 1e-3 off: at round-off after three

# Arc length [joint units] up to which it is traced each way: those of seven-joint arms are 10 to 15 long.
LENGTH = 8 * np.pi

SAME = 1e-6  # difference [joint units] below which postures are one; of poses [m, rad] below which they are one

# Smallest over largest singular value of J below which a posture is singular: a self-motion branches there.
SINGULAR = 1e-6

# By how much [m, rad] the tool may move between the postures of a motion, joints on the spline through them.
STILL = 1e-10

FINER = 6  # times that the postures of a motion are doubled at most to keep the tool still between them
LEAST = 8  # steps of a motion at least

# Steps to the place of a self-motion that is nearest to a posture; they converge as its bend times the distance.
NEARER = 5

TINY = 1e-12  # keeps a quotient finite
ARCS, ENOUGH = 32, 4  # curves that are tried where several joints are redundant, wider and wider; so many in any case

# Motion of a joint [joint units] between two looks at what a motion is to keep clear of: a centimetre at 1 m.
LOOK = 0.01

# Instants between two postures at which limits are looked at; a parabola through three of them has the extremum.
BETWEEN = 8

ROUNDS = 16  # rounds of a closed self-motion at most, where each turns a hinge


class Hindrance(NoTruthValue, Enum, ask="`is Hindrance.NOT_REDUNDANT`"):
    """Why the arm cannot go from one posture to another with its tool still; the text says it in words."""

    NOT_REDUNDANT = "no joint is redundant: the tool moves with every motion of the joints"
    APART = "the postures belong to different self-motions: none leads from one to the other"
    TURNS = "the postures differ by whole turns of joints that the self-motion does not make"
    LIMITS = "joint limits end the self-motion before it comes to the other posture"
    BLOCKED = "every self-motion between the postures comes too near to an obstacle, the floor or another link"
    SINGULAR = "the self-motion leads to a singular posture before it comes to the other one"
    LENGTH = "the self-motion was followed for {length:.0f} joint units each way and did not come to the other posture"
    NOT_FOUND = "no self-motion between the postures was found; that does not prove that there is none"
    NO_POSE = "no pose that was looked at is served by both sheets"
    NOT_ALLOWED = "no change is allowed there"

    @property
    def text(self) -> str:
        """The cause in words."""
        return self.value.format(length=LENGTH)


@dataclass(frozen=True, eq=False)
class StillMotion(NoTruthValue, Value, ask="`.hindrance`"):
    """Joints q (k, n) at times t (k,) [s] between two postures of one tool pose; the tool stays where it is.

    The times are those at which the fastest joint just keeps its speed limit, at an even rate along the curve; the time
    for accelerating is not in them. hindrance: why there is no motion; then there are no rows.
    """

    q: Matrix
    t: Vector
    hindrance: Hindrance | None = None

    @property
    def seconds(self) -> float:
        """How long it takes; infinite where there is none."""
        return float(self.t[-1]) if len(self.t) else float("inf")

    def __str__(self) -> str:
        if self.hindrance is not None:
            return f"no motion: {self.hindrance.text}"
        return f"a motion of {self.seconds:.2f} s with the tool still, through {len(self.q)} postures"

    def reversed(self) -> StillMotion:
        """The way back."""
        return StillMotion(self.q[::-1], self.seconds - self.t[::-1], self.hindrance) if len(self.t) else self


def _hindered(n: int, why: Hindrance) -> StillMotion:
    """None, for n joints."""
    return StillMotion(np.zeros((0, n)), np.zeros(0), why)


def straight_seconds(a: Array, b: Array, robot: Robot) -> Array:
    """The least time (...) [s] between postures (..., n) at the joints' speed limits; NaN where one is unknown.

    Of a joint without a limit 1 rad/s or 1 m/s is taken: only to compare motions, for none is timed without limits.
    """
    speeds = np.where(np.isfinite(robot.max_velocity), robot.max_velocity, 1.0)
    return np.asarray(np.max(np.abs(a - b) / speeds, axis=-1))


@typed
def self_motion_between(task: Task, qa: ArrayLike, qb: ArrayLike, clear: Clear | None = None) -> StillMotion:
    """The fastest motion found from one posture to another of the same tool pose, with the tool still.

    With one redundant joint the postures of a pose are curves: those through qa are traced both ways. A whole turn of a
    hinge makes another posture. With several redundant joints straight lines and arcs between the postures are
    projected onto the postures of the pose, which need not find a motion where there is one.

    Args:
        qa, qb: postures (n,) within the joint limits.
        clear: which postures (k, n) keep clear of obstacles, as `Clearances.clear`; it is asked at steps of 0.01 rad.

    Returns:
        The motion, or the reason why there is none.

    Raises:
        ArgumentError: the postures have different tool poses; a joint has no speed limit. JointLimitError, ShapeError,
        NotFiniteError.
    """
    a, b = (task.robot.checked(q, what) for q, what in ((qa, "the first posture"), (qb, "the second posture")))
    task.robot.check_limits(a)
    task.robot.check_limits(b)
    gap = np.abs(task.error(b, *task._place(a))).max()
    if not gap < SAME:
        raise ArgumentError(
            "the second posture", b.tolist(), f"its tool pose is {gap:.3g} off: give two postures of one pose"
        )
    return still_motions(task, a[None], b[None], clear)[0]


def still_motions(task: Task, A: Matrix, B: Matrix, clear: Clear | None) -> list[StillMotion]:
    """The motions from postures A (k, n) to B (k, n), each at one tool pose; or why there is none."""
    same = np.abs(A - B).max(axis=1, initial=0.0) < SAME
    if same.any():
        others = iter(still_motions(task, A[~same], B[~same], clear))
        return [StillMotion(a[None], np.zeros(1)) if rests else next(others) for a, rests in zip(A, same, strict=True)]
    if task.n == task.m:
        return [_hindered(task.n, Hindrance.NOT_REDUNDANT) for _ in A]
    if task.n - task.m > 1:
        return [_projected(task, a, b, clear) for a, b in zip(A, B, strict=True)]
    motions = [_hindered(task.n, Hindrance.SINGULAR) for _ in A]
    sigma = np.linalg.svd(task.jacobian_batch(A)[0], compute_uv=False)
    good = np.flatnonzero(sigma[:, -1] > SINGULAR * sigma[:, 0])
    curves = CurveTracer.through(task, A[good]).traced(A[good], step=STEP, length=LENGTH, limits=False)
    for i, curve in zip(good.tolist(), curves, strict=True):
        motions[i] = _along(_Line.of(curve), A[i], B[i], clear)
    return motions


def _projected(task: Task, a: Vector, b: Vector, clear: Clear | None) -> StillMotion:
    """The fastest of some motions between two postures (n,): a line, and arcs beside it, held at the pose."""
    rng, gap = np.random.default_rng(0), float(np.linalg.norm(b - a))
    place, motions = task._place(a), []
    for k in range(ARCS):
        c = (a + b) / 2 + rng.standard_normal(task.n) * gap * k / ARCS
        u = np.linspace(0.0, 1.0, 1 + max(LEAST, int(np.ceil(2 * gap / STEP))))[1:-1, None]
        way = held(task, (1 - u) ** 2 * a + 2 * u * (1 - u) * c + u**2 * b, *place)
        motion = _checked_motion(task, np.vstack([a, way, b]), clear)
        motions += [motion] if motion.hindrance is None else []
        if motions and k >= ENOUGH:
            break
    return min(motions, key=lambda motion: motion.seconds) if motions else _hindered(task.n, Hindrance.NOT_FOUND)


@dataclass(frozen=True, eq=False)
class _Line(Value):
    """A self-motion q (k, n) at arc lengths s (k,), 0 at the posture from which it was traced.

    Of a closed one the last posture is the first, `wind` (n,) whole turns on.
    """

    task: Task
    q: Matrix
    s: Vector
    wind: Vector
    closed: bool
    why: Hindrance

    @classmethod
    def of(cls, curve: SelfMotionCurve) -> _Line:
        """That of a self-motion. `why`: what is the matter where a posture is not on it."""
        ends = {CurveEnd.SINGULAR: Hindrance.SINGULAR, CurveEnd.LENGTH: Hindrance.LENGTH}
        why = next((ends[ending] for ending in ends if ending in curve.endings), Hindrance.APART)
        q, s, wind = curve.q, curve.s, np.zeros(curve.q.shape[1])
        if curve.closed:
            wind = np.round((q[-1] - q[0]) / (2 * np.pi)) * curve.task.robot.hinges
            q = np.vstack([q, q[0] + 2 * np.pi * wind])
            s = np.append(s, s[-1] + np.linalg.norm(q[-1] - q[-2]))
        return cls(curve.task, q, s, wind, curve.closed, why)

    @property
    def length(self) -> float:
        """Of one round."""
        return float(self.s[-1] - self.s[0])

    def near(self, s: Vector) -> Matrix:
        """Postures (k, n) at arc lengths (k,), beyond the ends of a closed one as well, on straight lines between its
        own."""
        laps = np.floor((s - self.s[0]) / self.length) if self.closed else np.zeros(len(s))
        q = np.column_stack([np.interp(s - laps * self.length, self.s, joint) for joint in self.q.T])
        return q + 2 * np.pi * laps[:, None] * self.wind

    def at(self, s: Vector) -> Matrix:
        """The same with the tool exactly still."""
        return held(self.task, self.near(s), *self.task._place(self.q[int(np.argmin(np.abs(self.s)))]))

    def places(self, b: Vector) -> list[float]:
        """Arc lengths, within one round, at which it passes a posture (n,), whole turns of hinges taken off."""
        robot = self.task.robot
        d = np.linalg.norm(joint_gap(robot, self.q, b), axis=1)
        before, after = np.append(np.inf, d[:-1]), np.append(d[1:], np.inf)
        places: list[float] = []
        for j in np.flatnonzero((d <= before) & (d <= after) & (d < 2 * STEP)):
            s = float(self.s[j])
            for _ in range(NEARER):
                low, middle, high = self.at(np.array([s - 0.1 * STEP, s, s + 0.1 * STEP]))
                tangent = (high - low) / (0.2 * STEP)
                s += float(joint_gap(robot, b, middle) @ tangent / max(float(tangent @ tangent), TINY))
                if not self.closed:
                    s = float(np.clip(s, self.s[0], self.s[-1]))
            known = any(abs(s - other) < SAME or abs(abs(s - other) - self.length) < SAME for other in places)
            if not known and np.abs(joint_gap(robot, b, self.at(np.array([s]))[0])).max() < SAME:
                places.append(s)
        return places

    def ends(self, b: Vector) -> tuple[list[float], Hindrance]:
        """(arc lengths at which it is the posture b (n,), whole turns included, why there is none)."""
        ends_found, why = [], self.why
        for s in self.places(b):
            why = Hindrance.TURNS
            turns = np.round((b - self.at(np.array([s]))[0]) / (2 * np.pi)) * self.task.robot.hinges
            if not self.wind.any():
                if not turns.any():
                    ends_found += [s, s - np.copysign(self.length, s)] if self.closed else [s]
            else:
                m = round(float(turns @ self.wind / (self.wind @ self.wind)))
                if abs(m) <= ROUNDS and np.array_equal(turns, m * self.wind):
                    ends_found.append(s + m * self.length)
        return ends_found, why


def _along(line: _Line, a: Vector, b: Vector, clear: Clear | None) -> StillMotion:
    """The fastest motion along a self-motion from its own posture a (n,) to b (n,)."""
    ends, why = line.ends(b)
    motions = []
    for end in ends:
        s = np.linspace(0.0, end, 1 + max(LEAST, int(np.ceil(abs(end) / STEP))))
        if (line.task.robot.beyond(line.near(s)) > STEP).any():
            why = Hindrance.LIMITS
            continue
        way = line.at(s)
        way[[0, -1]] = a, b
        motion = _checked_motion(line.task, way, clear)
        why = why if motion.hindrance is None else motion.hindrance
        if motion.hindrance is None:
            motions.append(motion)
    return min(motions, key=lambda motion: motion.seconds) if motions else _hindered(line.task.n, why)


def _checked_motion(task: Task, q: Matrix, clear: Clear | None) -> StillMotion:
    """The motion through postures (k, n) of one tool pose, with so many between them that the tool is still.

    Splines through them keep the tool still to `STILL`, and within the limits; postures are clear at every one of them.
    """
    robot, (p, R) = task.robot, task._place(q[0])
    speeds = speed_limits(robot)
    if not np.isfinite(q).all():
        return _hindered(task.n, Hindrance.SINGULAR)
    if (robot.beyond(q) > TOLERANCES.limit).any():
        return _hindered(task.n, Hindrance.LIMITS)
    most = STILL + 2 * float(np.abs(_off(task, q[-1:], p, R)).max())  # the two postures need not agree to round-off
    for _ in range(FINER):
        curve = Stretch(_way(q, speeds), q)
        s = (curve.s[:-1] + curve.s[1:]) / 2
        middle = curve.derivatives(s, 0)[0]
        if np.abs(_off(task, middle, p, R)).max() < most:
            break
        corrected = held(task, middle, p, R)
        if not np.isfinite(corrected).all() or np.abs(corrected - middle).max() > STEP:
            return _hindered(task.n, Hindrance.SINGULAR)
        q = np.insert(q, np.arange(1, len(q)), corrected, axis=0)
    else:
        return _hindered(task.n, Hindrance.SINGULAR)
    if not _within(robot, curve):
        return _hindered(task.n, Hindrance.LIMITS)
    if clear is not None and not clear(_closely(curve)).all():
        return _hindered(task.n, Hindrance.BLOCKED)
    rate = float(np.max(np.abs(curve.derivatives(_finely(curve.s), 1)[1]) / speeds))
    return StillMotion(q, rate * curve.s)


def held(task: Task, q: Matrix, p: Vector, R: Matrix) -> Matrix:
    """Postures (k, n) with the tool at p (3,), R (3, 3): those given, corrected by the least motions."""
    for _ in range(CORRECTIONS):
        q = q + least_motion(task.jacobian_batch(q)[0], _off(task, q, p, R)[:, :, None])[:, :, 0]
    return q


def _off(task: Task, q: Matrix, p: Vector, R: Matrix) -> Matrix:
    k = len(q)
    e = task._error_function.batch(q, np.broadcast_to(p, (k, *p.shape)), np.broadcast_to(R, (k, *R.shape)))
    return np.asarray(e).reshape(k, -1)


def _way(q: Matrix, speeds: Vector) -> Vector:
    """How long (k,) the way along postures (k, n) is, joints measured by their speeds [s]."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(q, axis=0) / speeds, axis=1))])


def _finely(s: Vector) -> Vector:
    share = np.arange(BETWEEN) / BETWEEN
    return np.append((s[:-1, None] + share * np.diff(s)[:, None]).ravel(), s[-1])


def _closely(curve: Stretch) -> Matrix:
    """Postures of a curve between which no joint moves by more than `LOOK`."""
    steps = np.maximum(1, np.ceil(np.abs(np.diff(curve.q, axis=0)).max(axis=1) / LOOK)).astype(int)
    s = [a + (b - a) * np.arange(k) / k for a, b, k in zip(curve.s[:-1], curve.s[1:], steps.tolist(), strict=True)]
    return curve.derivatives(np.append(np.concatenate(s), curve.s[-1]), 0)[0]


def _within(robot: Robot, curve: Stretch) -> bool:
    """Whether a curve keeps the limits, between its postures as well: a parabola through three has its extremum."""
    q = curve.derivatives(_finely(curve.s), 0)[0]
    a, b, c = q[:-2], q[1:-1], q[2:]
    bend = a - 2 * b + c
    turn = ((b - a) * (c - b) < 0) & (bend != 0)
    top = np.where(turn, b - (c - a) ** 2 / np.where(turn, 8 * bend, 1.0), b)
    every = np.vstack([q, top])
    return bool(((every >= robot.lower - TOLERANCES.limit) & (every <= robot.upper + TOLERANCES.limit)).all())


# --- Trajectories of pieces joined with the tool at rest: along a path on a sheet, and at one pose between two.


@dataclass(frozen=True, eq=False)
class Stage(Value):
    """A piece of a motion: times t (k,) [s] from 0, joints q and rates dq (k, n), wanted poses (k, 4, 4), |g - c| (k,).

    corners: samples within it at which the tool's direction jumps.
    """

    t: Vector
    q: Matrix
    dq: Matrix
    poses: Array
    residual: Vector
    corners: tuple[int, ...] = ()

    @classmethod
    def still(cls, pose: Matrix, motion: StillMotion) -> Stage:
        """That of a motion with the tool still at a pose (4, 4)."""
        k = len(motion.t)
        dq = np.gradient(motion.q, motion.t, axis=0) if k > 1 else np.zeros_like(motion.q)
        return cls(motion.t, motion.q, dq, np.repeat(pose[None], k, axis=0), np.zeros(k))


def still_trajectory(task: Task, pose: Matrix, motion: StillMotion) -> Trajectory:
    """That of a motion with the tool still at a pose (4, 4)."""
    return joined(task, [Stage.still(pose, motion)])


def joined(task: Task, stages: Sequence[Stage]) -> Trajectory:
    """Stages one after the other, each beginning at the posture with which the one before ends; between them all rests.

    The sample between two stages is that of the later one.
    """
    t = [stage.t for stage in stages]
    starts = np.concatenate([[0.0], np.cumsum([stage[-1] for stage in t])])
    first = np.concatenate([[0], np.cumsum([len(stage) - 1 for stage in t])]).astype(int)

    def put(parts: Sequence[Array]) -> Array:
        return np.concatenate([*(part[:-1] for part in parts[:-1]), parts[-1]])

    corners = set(first[1:-1].tolist())
    corners |= {int(a) + c for a, stage in zip(first, stages, strict=False) for c in stage.corners}
    joints, rates = put([stage.q for stage in stages]), put([stage.dq for stage in stages])
    T, off, robot = put([stage.poses for stage in stages]), put([stage.residual for stage in stages]), task.robot
    units = tuple(c.unit for c in robot.coordinates)
    measures = Measures(
        dq=lambda k: rates[:k],
        x=lambda k: task.value_batch(joints[:k]),
        error=lambda k: task.error(joints[:k], T[:k, :3, 3], T[:k, :3, :3]),
        sigma=lambda k: np.linalg.svd(task.jacobian_batch(joints[:k])[0], compute_uv=False)[:, -1].astype(float),
        residual=lambda k: off[:k],
    )
    times, ends = put([stage + start for stage, start in zip(t, starts, strict=False)]), (0, len(joints) - 1)
    rows, done = (task.row_names, task.units), (Status.COMPLETE, measures, tuple(sorted(corners)))
    return Trajectory(robot, units, *rows, times, joints, ends, *done)
