"""Motions of the joints between postures of one tool pose, with the tool still."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.tolerances import TOLERANCES
from ...base.types import Array, ArrayLike, Indices, Matrix, NoTruthValue, Value, Vector
from ...motion.checks import Clear, Clearances, PairDistance
from ...motion.self_motions.curve_cuts import curve_of_each
from ...motion.self_motions.pose_curves import ArcEnd, EndKind
from ...motion.timing import Stretch
from ...motion.trajectory import Measures, Status, Trajectory
from ...robot import Robot, speed_limits
from ...strategies.self_motion_curves import CurveTracer, joint_gap, least_motion
from ...strategies.tasks.task import Task

CORRECTIONS = 4  # Newton corrections of a posture that is 1e-3 off: at round-off after three

SAME = 1e-6  # difference [joint units] below which postures are one; of poses [m, rad] below which they are one

# Distance [joint units] of a posture from the nearest one of its curve, at most: they are 0.2 apart.
BESIDE = 0.15

CLOSE = 0.02  # share of the way to the next posture of a curve within which it is left out beside the first or last one

# Smallest over largest singular value of J below which a posture is singular: a self-motion branches there.
SINGULAR = 1e-6

# By how much [m, rad] the tool may move between the postures of a motion, joints on the spline through them.
STILL = 1e-10

# Times that postures are put between those of a motion at most, to keep the tool still; so often between all of them,
# later on where it moves.
FINER, DOUBLED = 24, 4
LEAST = 8  # steps of a motion at least

# Arcs that are tried where several joints are redundant, wider and wider; so many in any case; their steps [joint
# units], which is also by how much a posture between two others is off the spline through them at most.
ARCS, ENOUGH, STEP = 32, 4, 0.1

# Motion of a joint [joint units] between two looks at limits, and at what is to be kept clear of: a centimetre at 1 m.
LOOK = 0.01

TINY = 1e-12  # keeps a quotient finite

ROUNDS = 16  # rounds of a closed self-motion at most, where each turns a hinge


class Hindrance(NoTruthValue, Enum, ask="`is Hindrance.NOT_REDUNDANT`"):
    """Why the arm cannot go from one posture to another with its tool still; the text says it in words."""

    NOT_REDUNDANT = "no joint is redundant: the tool moves with every motion of the joints"
    APART = "with the tool still, no motion leads from the one posture to the other"
    TURNS = "the postures differ by whole turns, which the joints do not make with the tool still"
    LIMITS = "with the tool still, a joint comes to its limit before the arm is in the other posture"
    BLOCKED = "with the tool still, the arm comes too near to something on every way to the other posture"
    SINGULAR = "with the tool still, the arm comes to a singular posture before it is in the other one"
    NOT_FOUND = "no motion to the other posture was found with the tool still; that does not prove that there is none"
    NO_POSE = "no pose that was looked at is served by both sheets"
    NOT_ALLOWED = "no change is allowed there"

    @property
    def text(self) -> str:
        """The cause in words."""
        return str(self.value)


@dataclass(frozen=True, eq=False)
class StillMotion(NoTruthValue, Value, ask="`.hindrance`"):
    """Joints q (k, n) at times t (k,) [s] between two postures of one tool pose; the tool stays where it is.

    The times are those at which the fastest joint just keeps its speed limit, at an even rate along the curve; the time
    for accelerating is not in them. hindrance: why there is no motion; then there are no rows. ends: a joint that comes
    to its limit, or two things that come too near to each other; on a closed self-motion those of both ways round.
    nearest: these two things, their distance and where that is.
    """

    q: Matrix
    t: Vector
    hindrance: Hindrance | None = None
    ends: tuple[str, ...] = ()
    nearest: PairDistance | None = None

    @property
    def seconds(self) -> float:
        """How long it takes; infinite where there is none."""
        return float(self.t[-1]) if len(self.t) else float("inf")

    @property
    def reason(self) -> str:
        """Why there is none, in words, with what is in the way; empty where there is one."""
        text = "" if self.hindrance is None else self.hindrance.text
        if self.nearest is not None:
            return f"{text}: {self.nearest}"
        return f"{text}: {' and '.join(dict.fromkeys(self.ends))}" if self.ends else text

    def __str__(self) -> str:
        if self.hindrance is not None:
            return f"no motion: {self.reason}"
        return f"a motion of {self.seconds:.2f} s with the tool still, through {len(self.q)} postures"

    def reversed(self) -> StillMotion:
        """The way back."""
        back = (self.q[::-1], self.seconds - self.t[::-1]) if len(self.t) else (self.q, self.t)
        return StillMotion(*back, self.hindrance, self.ends[::-1], self.nearest)


def _hindered(n: int, why: Hindrance, ends: Sequence[str] = (), nearest: PairDistance | None = None) -> StillMotion:
    """None, for n joints."""
    return StillMotion(np.zeros((0, n)), np.zeros(0), why, tuple(ends), nearest)


def straight_seconds(a: Array, b: Array, robot: Robot) -> Array:
    """The least time (...) [s] between postures (..., n) at the joints' speed limits; NaN where one is unknown.

    Of a joint without a limit 1 rad/s or 1 m/s is taken: only to compare motions, for none is timed without limits.
    """
    speeds = np.where(np.isfinite(robot.max_velocity), robot.max_velocity, 1.0)
    return np.asarray(np.max(np.abs(a - b) / speeds, axis=-1))


@typed
def self_motion_between(
    task: Task, qa: ArrayLike, qb: ArrayLike, clear: Clear | Clearances | None = None
) -> StillMotion:
    """The fastest motion from one posture to another of the same tool pose, with the tool still.

    With one redundant joint the postures of a pose are curves: those through qa are followed both ways. A whole turn of
    a hinge makes another posture. With several redundant joints straight lines and arcs between the postures are
    projected onto the postures of the pose, which need not find a motion where there is one.

    Args:
        qa, qb: postures (n,) within the joint limits.
        clear: which postures (k, n) keep clear of obstacles, as `Clearances.clear`; it is asked at steps of 0.01 rad. A
            `Clearances` also says what touches.

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


def still_motions(task: Task, A: Matrix, B: Matrix, clear: Clear | Clearances | None) -> list[StillMotion]:
    """The motions from postures A (k, n) to B (k, n), each at one tool pose; or why there is none."""
    same = np.abs(A - B).max(axis=1, initial=0.0) < SAME
    if same.any():
        others = iter(still_motions(task, A[~same], B[~same], clear))
        return [StillMotion(a[None], np.zeros(1)) if rests else next(others) for a, rests in zip(A, same, strict=True)]
    if task.n == task.m or not len(A):
        return [_hindered(task.n, Hindrance.NOT_REDUNDANT) for _ in A]
    if task.n - task.m > 1:
        return [_projected(task, a, b, clear) for a, b in zip(A, B, strict=True)]
    return [curve.motion(clear) for curve in _curves(task, A, B)]


class _Place(NamedTuple):
    """Where a posture is on a curve, which counts the curve's rows, and the whole turns (n,) by which it differs."""

    number: float
    turns: Vector


class _Curve(NamedTuple):
    """The self-motion q (k, n) through posture a (n,), or b, and where on it these are; None where one is not.

    closed: the last row is the first one, but for whole turns. regular: neither posture is singular.
    """

    task: Task
    q: Matrix
    closed: bool
    regular: bool
    a: tuple[Vector, _Place | None]
    b: tuple[Vector, _Place | None]

    def motion(self, clear: Clear | Clearances | None) -> StillMotion:
        """The fastest motion along it from a to b; or why there is none."""
        (a, begin), (b, end), robot = self.a, self.b, self.task.robot
        if begin is None or end is None:
            return _hindered(robot.n, *self._apart())
        # The whole turns by which the postures differ are those of some rounds; where none turns, both ways round.
        wind = 2 * np.pi * np.round((self.q[-1] - self.q[0]) / (2 * np.pi)) * robot.hinges * self.closed
        turns, size, count = end.turns - begin.turns, float(wind @ wind), len(self.q) - 1
        rounds = round(float(turns @ wind) / size) if size else 0
        if np.abs(turns - rounds * wind).max() > 1 or abs(rounds) > ROUNDS:
            return _hindered(robot.n, Hindrance.TURNS if self.regular else Hindrance.SINGULAR)
        ends = [end.number + rounds * count]
        if self.closed and not size:
            ends.append(ends[0] - np.copysign(count, ends[0] - begin.number))
        motions: list[StillMotion] = []
        for number in ends:
            way = -1 if number < begin.number else 1
            first, last = np.floor(way * begin.number + CLOSE), np.ceil(way * number - CLOSE)
            between = way * np.arange(int(first) + 1, int(last))
            laps = between // max(count, 1) if self.closed else np.zeros(len(between), dtype=int)
            rows = self.q[np.clip(between - laps * count, 0, count)] + laps[:, None] * wind + begin.turns
            motions.append(_along(self.task, np.vstack([a, rows, b]), clear))
        best = min(motions, key=lambda motion: motion.seconds)
        if best.hindrance is None:
            return best
        met = {motion.hindrance for motion in motions}
        why = next(h for h in (Hindrance.BLOCKED, Hindrance.SINGULAR, Hindrance.LIMITS) if h in met)
        nearest = next((motion.nearest for motion in motions if motion.nearest), None)
        return _hindered(robot.n, why, [end for motion in motions for end in motion.ends], nearest)

    def _apart(self) -> tuple[Hindrance, tuple[str, ...]]:
        """Why it has not both postures, and what is there where it ends."""
        if not self.regular or (self.a[1] is None and self.b[1] is None):
            return Hindrance.SINGULAR, ()
        if self.closed:
            return Hindrance.APART, ()
        # It ends at limits of slides, or is singular there.
        robot, tips = self.task.robot, self.q[[0, -1]]
        gaps = enumerate((tips - robot.lower, robot.upper - tips))
        at = [(upper, j) for upper, gap in gaps for _, j in np.argwhere((np.abs(gap) < SAME) & ~robot.hinges).tolist()]
        return (Hindrance.LIMITS if len(at) > 1 else Hindrance.SINGULAR), tuple(_limit(robot, *end) for end in at)


def _curves(task: Task, A: Matrix, B: Matrix) -> list[_Curve]:
    """The self-motions through postures A (k, n), or through B (k, n) where A is singular."""
    p, R = task._poses(A)
    sigma = np.linalg.svd(task.jacobian_batch(np.vstack([A, B]))[0], compute_uv=False).reshape(2, len(A), -1)
    regular = sigma[:, :, -1] > SINGULAR * sigma[:, :, 0]
    tracer = CurveTracer(task if task._geometric else task._geometric_twin, p, R)
    q, number, closed = curve_of_each(tracer.task, p, R, np.where(regular[0][:, None], A, B))
    first = np.searchsorted(number, np.arange(len(A) + 1))
    places = zip(*(_places(tracer, q, number, first, Q) for Q in (A, B)), strict=True)
    return [
        _Curve(task, q[first[i] : first[i + 1]], bool(closed[i]), bool(regular[:, i].all()), (A[i], a), (B[i], b))
        for i, (a, b) in enumerate(places)
    ]


def _places(tracer: CurveTracer, q: Matrix, number: Indices, first: Indices, Q: Matrix) -> list[_Place | None]:
    """Where postures Q (k, n) are on curves, rows q (N, n) of those of `number` (N,), which begin at `first` (k,)."""
    robot, after = tracer.task.robot, np.minimum(np.arange(len(q)) + 1, first[number + 1] - 1)
    before = np.maximum(np.arange(len(q)) - 1, first[number])
    # Steps along the curve from rows that are near, each of the length that is left, lead to a posture or do not.
    row = np.flatnonzero(np.linalg.norm(joint_gap(robot, Q[number], q), axis=1) < BESIDE)
    i, posture, length = number[row], q[row], np.zeros(len(row))
    _, way, _ = tracer.step(posture, q[after[row]] - q[before[row]], i, length)
    for _ in range(4):
        left = np.einsum("kn,kn->k", joint_gap(robot, Q[i], posture), way)
        posture, way, _ = tracer.step(posture, way, i, left)
        length = length + left
    on = np.flatnonzero(np.abs(joint_gap(robot, Q[i], posture)).max(axis=1) < SAME)
    beside = np.where(length > 0, after[row], before[row])
    step = np.linalg.norm(q[beside] - q[row], axis=1)
    places: list[_Place | None] = [None] * len(Q)
    # The nearest row comes last, of those with a row beside them on that side: not the seam of one that is closed.
    for k in on[np.lexsort((-np.abs(length[on]), step[on] > 0))].tolist():
        turns = 2 * np.pi * np.round((Q[i[k]] - q[row[k]]) / (2 * np.pi)) * robot.hinges
        share = float(np.clip(length[k] / max(step[k], TINY), -1, 1))
        places[i[k]] = _Place(float(row[k] - first[i[k]]) + share, turns)
    return places


def _limit(robot: Robot, upper: int, joint: int) -> str:
    """A joint at its limit, in words."""
    return str(ArcEnd(EndKind.LIMIT, robot.joint_names[joint], upper > 0))


def _first_limit(robot: Robot, q: Matrix) -> StillMotion | None:
    """None if postures (k, n) on a way are within the limits; else no motion, and the joint that comes to one first."""
    beyond = (robot.beyond(q) > TOLERANCES.limit).any(axis=1)
    if not beyond.any():
        return None
    a, b = q[[max(int(beyond.argmax()) - 1, 0), int(beyond.argmax())]]
    rest, past = np.append(a - robot.lower, robot.upper - a), np.append(robot.lower - b, b - robot.upper)
    with np.errstate(all="ignore"):
        share = np.where(past > 0, np.maximum(rest, 0.0) / (rest + past), np.inf)
    return _hindered(robot.n, Hindrance.LIMITS, [_limit(robot, *divmod(int(share.argmin()), robot.n))])


def _along(task: Task, q: Matrix, clear: Clear | Clearances | None) -> StillMotion:
    """The motion along rows (k, n) of a self-motion, from the first to the last one."""
    if (ended := _first_limit(task.robot, q)) is not None:
        return ended
    s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1)))
    even = np.linspace(0.0, s[-1], 1 + max(LEAST, int(np.ceil(s[-1] / STEP))))[1:-1]
    way = held(task, np.column_stack([np.interp(even, s, joint) for joint in q.T]), *task._place(q[0]))
    return _checked_motion(task, np.vstack([q[0], way, q[-1]]), clear)


def _projected(task: Task, a: Vector, b: Vector, clear: Clear | Clearances | None) -> StillMotion:
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


def _checked_motion(task: Task, q: Matrix, clear: Clear | Clearances | None) -> StillMotion:
    """The motion through postures (k, n) of one tool pose, with so many between them that the tool is still.

    Splines through them keep the tool still to `STILL`, and within the limits; postures are clear at every one of them.
    """
    robot, (p, R) = task.robot, task._place(q[0])
    speeds = speed_limits(robot)
    if (blocked := _blocked(task, q, clear)) is not None:
        return blocked
    most = STILL + 2 * float(np.abs(_off(task, q[-1:], p, R)).max())  # the two postures need not agree to round-off
    for finer in range(FINER):
        way = np.linalg.norm(np.diff(q, axis=0) / speeds, axis=1)
        if not np.isfinite(way).all():
            return _hindered(task.n, Hindrance.SINGULAR)
        curve = Stretch(np.append(0.0, np.cumsum(way)), q)
        middle = curve.derivatives((curve.s[:-1] + curve.s[1:]) / 2, 0)[0]
        off = np.abs(_off(task, middle, p, R)).max(axis=1)
        if off.max() < most:
            break
        wide = np.flatnonzero(off >= (most if finer >= DOUBLED else 0.0))
        corrected = held(task, middle[wide], p, R)
        if not np.abs(corrected - middle[wide]).max() < STEP:  # NaN is not
            return _hindered(task.n, Hindrance.SINGULAR)
        q = np.insert(q, wide + 1, corrected, axis=0)
    else:
        return _hindered(task.n, Hindrance.SINGULAR)
    # Closely along the curve: the limits, a parabola through three postures has an extremum; what is clear; rates.
    steps = np.maximum(2, np.ceil(np.abs(np.diff(q, axis=0)).max(axis=1) / LOOK)).astype(int)
    share = (np.arange(steps.sum()) - np.repeat(np.cumsum(steps) - steps, steps)) / np.repeat(steps, steps)
    s = np.append(np.repeat(curve.s[:-1], steps) + share * np.repeat(np.diff(curve.s), steps), curve.s[-1])
    close, slope = curve.derivatives(s, 1)
    a, b, c = close[:-2], close[1:-1], close[2:]
    bend, turns = a - 2 * b + c, (b - a) * (c - b) < 0
    extremes = close.copy()
    extremes[1:-1] = np.where(turns, b - (c - a) ** 2 / np.where(turns, 8 * bend, 1.0), b)
    if (ended := _first_limit(robot, extremes)) is not None:
        return ended
    if (blocked := _blocked(task, close, clear)) is not None:
        return blocked
    return StillMotion(q, float(np.max(np.abs(slope) / speeds)) * curve.s)


def _blocked(task: Task, q: Matrix, clear: Clear | Clearances | None) -> StillMotion | None:
    """None if postures (k, n) are clear; else no motion, and the pair that is too near at the first one that is not."""
    if clear is None:
        return None
    free = clear.clear(q) if isinstance(clear, Clearances) else clear(q)
    if free.all():
        return None
    first = q[[int(np.argmin(free))]]
    pair = clear.closest(task, first) if isinstance(clear, Clearances) else None
    return _hindered(task.n, Hindrance.BLOCKED, () if pair is None else (" and ".join(pair.names),), pair)


def held(task: Task, q: Matrix, p: Vector, R: Matrix) -> Matrix:
    """Postures (k, n) with the tool at p (3,), R (3, 3): those given, corrected by the least motions."""
    for _ in range(CORRECTIONS):
        q = q + least_motion(task.jacobian_batch(q)[0], _off(task, q, p, R)[:, :, None])[:, :, 0]
    return q


def _off(task: Task, q: Matrix, p: Vector, R: Matrix) -> Matrix:
    k = len(q)
    e = task._error_function.batch(q, np.broadcast_to(p, (k, *p.shape)), np.broadcast_to(R, (k, *R.shape)))
    return np.asarray(e).reshape(k, -1)


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
