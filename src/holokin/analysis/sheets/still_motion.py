"""Motions of the joints between postures of one tool pose, with the tool still."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.tolerances import TOLERANCES
from ...base.types import Array, ArrayLike, Flags, Indices, Matrix, NoTruthValue, Value, Vector
from ...motion.checks import Clear, Clearances
from ...motion.ik.curve_cuts import curve_of_each
from ...motion.ik.pose_curves import ArcEnd, EndKind
from ...motion.timing import Stretch
from ...motion.trajectory import Measures, Status, Trajectory
from ...robot import Robot, speed_limits
from ...strategies.self_motion_curves import CurveTracer, joint_gap, least_motion
from ...strategies.tasks.task import Task

CORRECTIONS = 4  # Newton corrections of a posture that is 1e-3 off: at round-off after three

SAME = 1e-6  # difference [joint units] below which postures are one; of poses [m, rad] below which they are one

TOGETHER = 256  # curves that are made together

# Distance [joint units] of a posture from the nearest one of its curve, at most: they are 0.2 apart.
BESIDE = 0.15

CLOSE = 0.02  # share of the way to the next posture of a curve within which it is left out beside the first or last one

# Smallest over largest singular value of J below which a posture is singular: a self-motion branches there.
SINGULAR = 1e-6

# By how much [m, rad] the tool may move between the postures of a motion, joints on the spline through them.
STILL = 1e-10

FINER = 6  # times that the postures of a motion are doubled at most to keep the tool still between them
LEAST = 8  # steps of a motion at least

# Arcs that are tried where several joints are redundant, wider and wider; so many in any case; their steps [joint
# units], which is also by how much a posture between two others is off the spline through them at most.
ARCS, ENOUGH, STEP = 32, 4, 0.1

# Motion of a joint [joint units] between two looks at limits, and at what is to be kept clear of: a centimetre at 1 m.
LOOK = 0.01

ROUNDS = 16  # rounds of a closed self-motion at most, where each turns a hinge


class Hindrance(NoTruthValue, Enum, ask="`is Hindrance.NOT_REDUNDANT`"):
    """Why the arm cannot go from one posture to another with its tool still; the text says it in words."""

    NOT_REDUNDANT = "no joint is redundant: the tool moves with every motion of the joints"
    APART = "the postures belong to different self-motions: none leads from one to the other"
    TURNS = "the postures differ by whole turns of joints that the self-motion does not make"
    LIMITS = "joint limits end the self-motion before it comes to the other posture"
    BLOCKED = "every self-motion between the postures comes too near to an obstacle, the floor or another link"
    SINGULAR = "the self-motion leads to a singular posture before it comes to the other one"
    NOT_FOUND = "no self-motion between the postures was found; that does not prove that there is none"
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
    for accelerating is not in them. hindrance: why there is no motion; then there are no rows. ends: what is in the way,
    a joint at its limit or two things that touch; of a closed self-motion on both ways round.
    """

    q: Matrix
    t: Vector
    hindrance: Hindrance | None = None
    ends: tuple[str, ...] = ()

    @property
    def seconds(self) -> float:
        """How long it takes; infinite where there is none."""
        return float(self.t[-1]) if len(self.t) else float("inf")

    @property
    def reason(self) -> str:
        """Why there is none, in words, with what is in the way; empty where there is one."""
        text = "" if self.hindrance is None else self.hindrance.text
        return f"{text}: {'; the other way round: '.join(self.ends)}" if self.ends else text

    def __str__(self) -> str:
        if self.hindrance is not None:
            return f"no motion: {self.reason}"
        return f"a motion of {self.seconds:.2f} s with the tool still, through {len(self.q)} postures"

    def reversed(self) -> StillMotion:
        """The way back."""
        back = (self.q[::-1], self.seconds - self.t[::-1]) if len(self.t) else (self.q, self.t)
        return StillMotion(*back, self.hindrance, self.ends[::-1])


def _hindered(n: int, why: Hindrance, ends: Sequence[str] = ()) -> StillMotion:
    """None, for n joints."""
    return StillMotion(np.zeros((0, n)), np.zeros(0), why, tuple(ends))


def straight_seconds(a: Array, b: Array, robot: Robot) -> Array:
    """The least time (...) [s] between postures (..., n) at the joints' speed limits; NaN where one is unknown.

    Of a joint without a limit 1 rad/s or 1 m/s is taken: only to compare motions, for none is timed without limits.
    """
    return np.asarray(np.max(np.abs(a - b) / _speeds(robot), axis=-1))


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
    return StillMotions(task, np.array([[a], [b]]), clear).motion(0, 0, 1)


# --- Many at once, such as those between the postures of sheets.


@dataclass(frozen=True, eq=False)
class StillMotions(Value):
    """The motions between postures q (S, k, n), S at each of k tool poses; NaN where there is none.

    clear: as of `self_motion_between`.
    """

    task: Task
    q: Array
    clear: Clear | Clearances | None

    @cached_property
    def seconds(self) -> Array:
        """About how long (k, S, S) [s] they take, clear or not; infinite where there is none, or not both postures.

        With one redundant joint by ways within the limits, up to a few per cent less; with several as if joints went
        straight.
        """
        q, robot = np.swapaxes(self.q, 0, 1), self.task.robot
        seconds = np.full(q.shape[:2] + q.shape[1:2], np.inf)
        if self.task.n - self.task.m > 1:
            seconds = np.nan_to_num(straight_seconds(q[:, :, None], q[:, None], robot), nan=np.inf)
        for (a, b), ways in self._ways.items():
            np.minimum.at(seconds[:, a, b], ways.pose, ways.seconds)
            seconds[:, b, a] = seconds[:, a, b]
        seconds[np.abs(q[:, :, None] - q[:, None]).max(axis=-1) < SAME] = 0.0
        return seconds

    def motion(self, i: int, a: int, b: int) -> StillMotion:
        """The fastest one at pose i from posture a to b, with the tool exactly still; or why there is none."""
        task, qa, qb = self.task, self.q[a, i], self.q[b, i]
        if a > b:
            return self.motion(i, b, a).reversed()
        if np.abs(qa - qb).max(initial=0.0) < SAME:
            return StillMotion(qa[None], np.zeros(1))
        if task.n == task.m:
            return _hindered(task.n, Hindrance.NOT_REDUNDANT)
        if task.n - task.m > 1:
            return _projected(task, qa, qb, self.clear)
        # The ways, as long as one may be faster than the one before.
        ways, motions = self._ways[a, b], [_hindered(task.n, *self._curves.apart(i, a, b))]
        own = np.flatnonzero(ways.pose == i)
        for w in own[np.argsort(ways.seconds[own], kind="stable")].tolist():
            if w in ways.ends:
                motions.append(_hindered(task.n, Hindrance.LIMITS, [ways.ends[w]]))
            elif ways.seconds[w] < motions[-1].seconds:
                rows, _ = self._curves.along(np.array([i]), a, b, ways.begin[[w]], ways.end[[w]])
                motions.append(_checked_motion(task, _evenly(task, rows), self.clear))
        fastest = min(motions, key=lambda motion: motion.seconds)
        if fastest.hindrance is None:
            return fastest
        hindrances = [motion.hindrance for motion in motions]
        why = next((h for h in (Hindrance.BLOCKED, Hindrance.LIMITS) if h in hindrances), motions[-1].hindrance)
        return _hindered(task.n, why, [end for motion in motions for end in motion.ends])

    @cached_property
    def _curves(self) -> _Curves:
        """The self-motions through the postures, with one redundant joint."""
        return _Curves.through(self.task, self.q)

    @cached_property
    def _ways(self) -> dict[tuple[int, int], _Ways]:
        """Those between each two of the postures; only with one redundant joint."""
        pairs = combinations(range(len(self.q)), 2) if self.task.n - self.task.m == 1 else ()
        return {(a, b): self._curves.ways(a, b) for a, b in pairs}


class _Ways(NamedTuple):
    """Ways from a posture to another one of its pose (w,) along their curve, from place begin (w,) to place end (w,).

    seconds (w,): about how long one takes; infinite where a joint comes to its limit on it, `ends` says which.
    """

    pose: Indices
    begin: Vector
    end: Vector
    seconds: Vector
    ends: dict[int, str]


class _Curves(NamedTuple):
    """Curves, rows q (N, n) one after another from `first` (C + 1,) on, through postures Q (S, k, n), which are not
    singular where `regular` (S, k).

    The last row of one that is closed is its first one, `wind` (C, n) on, whole turns. Of each posture, the curve
    (S, k), -1 where it is on none; its place, which counts rows of the curve, on round a closed one; and by what turns
    (S, k, n) it differs from the row there.
    """

    robot: Robot
    Q: Array
    regular: Flags
    q: Matrix
    first: Indices
    closed: Flags
    wind: Matrix
    curve: Indices
    place: Matrix
    turns: Array

    @classmethod
    def through(cls, task: Task, Q: Array) -> _Curves:
        """Those through the postures, and where on them these are; none of a posture that is on no curve of others."""
        task, robot, known = task if task._geometric else task._geometric_twin, task.robot, np.isfinite(Q).all(axis=2)
        S, k, n = Q.shape
        sigma = np.linalg.svd(task.jacobian_batch(Q[known])[0], compute_uv=False)
        regular = np.zeros((S, k), dtype=bool)
        regular[known] = sigma[:, -1] > SINGULAR * sigma[:, 0]
        none, flags = (np.zeros((0, n)), np.zeros(1, int)), np.zeros(0, dtype=bool)
        places = np.full((S, k), -1), np.zeros((S, k)), np.zeros((S, k, n))
        found = cls(robot, Q, regular, *none, flags, none[0], *places)
        # Of each pose with two postures left the curve through the first one that is not singular.
        tracer = CurveTracer(task, *task._poses(np.nan_to_num(Q[known.argmax(axis=0), np.arange(k)])))
        begin = regular.copy()
        while len(i := np.flatnonzero(begin.any(axis=0) & ((known & (found.curve < 0)).sum(axis=0) > 1))[:TOGETHER]):
            s = begin[:, i].argmax(axis=0)
            begin[s, i] = False
            found = found._with_those(tracer, i, Q[s, i])
            begin &= found.curve < 0
        return found

    def _with_those(self, tracer: CurveTracer, i: Indices, begin: Matrix) -> _Curves:
        """With the curves through postures (j, n) at poses i (j,), and the other postures that are on them."""
        q, number, closed = curve_of_each(tracer.task, tracer.p[i], tracer.R[i], begin)
        first, turn = np.searchsorted(number, np.arange(len(closed) + 1)), 2 * np.pi * self.robot.hinges
        wind = turn * np.round((q[first[1:] - 1] - q[first[:-1]]) / (2 * np.pi)) * closed[:, None]
        rows, curves = len(self.q), len(self.closed)
        more = np.vstack([self.q, q]), np.append(self.first[:-1], first + rows), np.append(self.closed, closed)
        found = _Curves(self.robot, self.Q, self.regular, *more, np.vstack([self.wind, wind]), *self[-3:])
        # Rows near postures, joint by joint.
        pose, last = i[number], np.zeros(len(q), dtype=bool)
        last[first[1:][closed] - 1] = True
        s, row = np.nonzero((self.curve[:, pose] < 0) & ~last)
        for joint, full in enumerate(turn):
            gap = self.Q[s, pose[row], joint] - q[row, joint]
            near = np.abs(gap - full * np.round(gap / (2 * np.pi))) < BESIDE
            s, row = s[near], row[near]
        # Steps along the curve from there, each of the length that is left, lead to the postures or do not.
        i, c, row = pose[row], number[row] + curves, row + rows
        forward = found.rows(c, row - found.first[c] + 1) - found.q[row]
        there, along, _ = tracer.step(found.q[row], forward, i, np.zeros(len(row)))
        length, left = np.zeros(len(row)), np.ones(len(row))
        for _ in range(4):
            if not np.abs(left).max(initial=0.0) > SAME / 10:
                break
            left = np.einsum("kn,kn->k", joint_gap(self.robot, self.Q[s, i], there), along)
            there, along, _ = tracer.step(there, along, i, left)
            length += left
        on = np.flatnonzero(np.abs(joint_gap(self.robot, self.Q[s, i], there)).max(axis=1) < SAME)
        on = on[np.argsort(-np.abs(length[on]), kind="stable")]  # the nearest row comes last
        s, i, c, row, length = s[on], i[on], c[on], row[on], length[on]
        place = row - found.first[c]
        step = np.linalg.norm(found.rows(c, place + np.where(length < 0, -1, 1)) - found.q[row], axis=1)
        found.curve[s, i], found.turns[s, i] = c, turn * np.round((self.Q[s, i] - found.q[row]) / (2 * np.pi))
        found.place[s, i] = place + np.clip(length / np.where(step > 0, step, 1.0), -1, 1)
        return found

    def rows(self, c: Indices, number: Indices) -> Matrix:
        """Rows (k, n) of curves c (k,) by their numbers, on round closed ones, up to the ends of others."""
        count = self.first[c + 1] - self.first[c] - 1
        laps = np.where(self.closed[c], number // np.maximum(count, 1), 0)
        return self.q[self.first[c] + np.clip(number - laps * count, 0, count)] + laps[:, None] * self.wind[c]

    def along(self, i: Indices, a: int, b: int, begin: Vector, end: Vector) -> tuple[Matrix, Indices]:
        """(postures (N, n) of ways from posture a to b at poses i (w,), one way after another, how many each has)."""
        way = np.where(end < begin, -1, 1)
        low, high = np.floor(way * begin + CLOSE).astype(int), np.ceil(way * end - CLOSE).astype(int)
        size = np.maximum(high - low - 1, 0) + 2
        first = np.cumsum(size) - size
        w, last = np.repeat(np.arange(len(i)), size), first + size - 1
        q = self.rows(self.curve[a, i][w], way[w] * (low[w] + np.arange(len(w)) - first[w])) + self.turns[a, i][w]
        q[first], q[last] = self.Q[a, i], self.Q[b, i]
        return q, size

    def ways(self, a: int, b: int) -> _Ways:
        """Those between two postures at all poses where one curve has both."""
        i = np.flatnonzero((self.curve[a] >= 0) & (self.curve[a] == self.curve[b]))
        c, begin, end = self.curve[a, i], self.place[a, i], self.place[b, i]
        # The whole turns by which the postures differ are those of some rounds.
        turns, wind = self.turns[b, i] - self.turns[a, i], self.wind[c]
        size, length = np.sum(wind**2, axis=1), np.diff(self.first)[c] - 1
        rounds = np.round(np.sum(turns * wind, axis=1) / np.where(size > 0, size, 1.0))
        fits = (np.abs(turns - rounds[:, None] * wind).max(axis=1) < 1) & (np.abs(rounds) <= ROUNDS)
        end = end + rounds * length
        # Where none turns there are two ways round a closed curve.
        two = fits & self.closed[c] & (size == 0)
        back = end - np.where(end < begin, -length, length)
        i, begin, end = np.append(i[fits], i[two]), np.append(begin[fits], begin[two]), np.append(end[fits], back[two])
        if not len(i):
            return _Ways(i, begin, end, begin, {})
        # How long they take at an even rate, of straight lines between rows; and the first joint beyond its limits.
        q, size = self.along(i, a, b, begin, end)
        first = np.cumsum(size) - size
        step = np.abs(np.diff(q, axis=0, append=q[-1:])) / _speeds(self.robot)
        step[first[1:] - 1] = 0.0
        norm = np.linalg.norm(step, axis=1)
        rate = step.max(axis=1) / np.where(norm > 0, norm, 1.0)
        seconds = np.add.reduceat(norm, first) * np.maximum.reduceat(rate, first)
        beyond = (self.robot.beyond(q) > TOLERANCES.limit).any(axis=1)
        row = np.minimum.reduceat(np.where(beyond, np.arange(len(q)), len(q)), first)
        ended = np.flatnonzero(row < len(q))
        seconds[ended] = np.inf
        names = _limits_between(self.robot, q[row[ended] - 1], q[row[ended]])
        return _Ways(i, begin, end, seconds, dict(zip(ended.tolist(), names, strict=True)))

    def apart(self, i: int, a: int, b: int) -> tuple[Hindrance, tuple[str, ...]]:
        """Why no way leads from posture a to b at a pose, and what is there where their curves end."""
        curves = self.curve[[a, b], i]
        if curves.max() < 0 or not self.regular[[a, b], i].all():
            return Hindrance.SINGULAR, ()
        if curves[0] == curves[1]:
            return Hindrance.TURNS, ()
        curves = curves[curves >= 0]
        if self.closed[curves].any():
            return Hindrance.APART, ()
        # A curve that is not closed ends at limits of slides, or is singular there.
        robot, tips = self.robot, self.q[[self.first[curves[0]], self.first[curves[0] + 1] - 1]]
        gaps = enumerate((tips - robot.lower, robot.upper - tips))
        at = [(upper, j) for upper, gap in gaps for _, j in np.argwhere((np.abs(gap) < SAME) & ~robot.hinges)]
        return (Hindrance.LIMITS if len(at) > 1 else Hindrance.SINGULAR), tuple(_limit(robot, *end) for end in at)


def _speeds(robot: Robot) -> Vector:
    """The joints' speed limits (n,) to compare motions: 1 rad/s or 1 m/s of one that has none."""
    return np.where(np.isfinite(robot.max_velocity), robot.max_velocity, 1.0)


def _limits_between(robot: Robot, a: Matrix, b: Matrix) -> list[str]:
    """The limit that a joint comes to first between each of some postures a within them and b (k, n) beyond."""
    rest, past = np.hstack([a - robot.lower, robot.upper - a]), np.hstack([robot.lower - b, b - robot.upper])
    with np.errstate(all="ignore"):
        share = np.where(past > 0, np.maximum(rest, 0.0) / (rest + past), np.inf)
    return [_limit(robot, *divmod(k, robot.n)) for k in np.argmin(share, axis=1).tolist()]


def _limit(robot: Robot, upper: int, joint: int) -> str:
    return str(ArcEnd(EndKind.LIMIT, robot.joint_names[joint], upper > 0))


def _evenly(task: Task, q: Matrix) -> Matrix:
    """Postures (j, n) of one tool pose at even steps along others (k, n), with the first and the last one of these."""
    s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1)))
    even = np.linspace(0.0, s[-1], 1 + max(LEAST, int(np.ceil(s[-1] / STEP))))[1:-1]
    way = held(task, np.column_stack([np.interp(even, s, joint) for joint in q.T]), *task._place(q[0]))
    return np.vstack([q[0], way, q[-1]])


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
    if (blocked := _blocked(q, clear)) is not None:
        return blocked
    most = STILL + 2 * float(np.abs(_off(task, q[-1:], p, R)).max())  # the two postures need not agree to round-off
    for _ in range(FINER):
        way = np.linalg.norm(np.diff(q, axis=0) / speeds, axis=1)
        if not np.isfinite(way).all():
            return _hindered(task.n, Hindrance.SINGULAR)
        curve = Stretch(np.append(0.0, np.cumsum(way)), q)
        middle = curve.derivatives((curve.s[:-1] + curve.s[1:]) / 2, 0)[0]
        if np.abs(_off(task, middle, p, R)).max() < most:
            break
        corrected = held(task, middle, p, R)
        if not np.abs(corrected - middle).max() < STEP:  # NaN is not
            return _hindered(task.n, Hindrance.SINGULAR)
        q = np.insert(q, np.arange(1, len(q)), corrected, axis=0)
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
    beyond = np.flatnonzero((robot.beyond(extremes) > TOLERANCES.limit).any(axis=1))[:1]
    if len(beyond):
        return _hindered(task.n, Hindrance.LIMITS, _limits_between(robot, extremes[beyond - 1], extremes[beyond]))
    if (blocked := _blocked(close, clear)) is not None:
        return blocked
    return StillMotion(q, float(np.max(np.abs(slope) / speeds)) * curve.s)


def _blocked(q: Matrix, clear: Clear | Clearances | None) -> StillMotion | None:
    """None if postures (k, n) are clear; else no motion, and what the first one that is not comes near to."""
    if clear is None:
        return None
    free = clear.clear(q) if isinstance(clear, Clearances) else clear(q)
    if free.all():
        return None
    first = q[[int(np.argmin(free))]]
    return _hindered(q.shape[1], Hindrance.BLOCKED, clear.touching(first) if isinstance(clear, Clearances) else ())


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
