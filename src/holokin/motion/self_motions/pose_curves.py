"""`self_motion`: all postures that hold the tool at one pose, as curves within the joint limits, and their levels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.poses import PoseLike, given_pose
from ...base.types import (
    Array,
    ArrayLike,
    Flags,
    Indices,
    Matrix,
    NoTruthValue,
    Result,
    Value,
    Vector,
    finite,
    tool_pose,
)
from ...robot import Robot
from ...strategies import HolonomicStrategy
from ...strategies.self_motion_curves import joint_gap
from ...strategies.tasks.task import Task, of_one_tool
from .self_motions import self_motions_at
from .stretches import Stretches
from .whole_turns import turns_of

Clear = Callable[[Matrix], Flags]
"""Which postures (k, n) are clear of a scene, as `Clearances.clear`."""

JUMP = 4.0
"""Step of g, as a multiple of those before and after it, from which on it is looked at whether g jumps there."""


class EndKind(StrEnum):
    """Why an arc of a self-motion ends."""

    CLOSED = "closed"
    LIMIT = "limit"
    CONTACT = "contact"
    SINGULAR = "singular"


@dataclass(frozen=True)
class ArcEnd(Value):
    """Why an arc ends; at a limit, which joint is at its lower or its upper one."""

    kind: EndKind
    joint: str = ""
    upper: bool = False

    def __str__(self) -> str:
        if self.kind is EndKind.LIMIT:
            return f"{self.joint} at its {'upper' if self.upper else 'lower'} limit"
        words = {EndKind.CLOSED: "where it began", EndKind.CONTACT: "a contact", EndKind.SINGULAR: "a singular posture"}
        return words[self.kind]


@dataclass(frozen=True, eq=False)
class SelfMotionArc(Value):
    """Postures q (k, n) with one tool pose, in order, and why there are no more at its first and at its last one.

    Joints are continuous, and within their limits where these count. A closed arc's last posture is its first one, but
    for whole turns. curve: number of the self-motion that it is part of.
    """

    task: Task
    pose: Matrix
    q: Matrix
    ends: tuple[ArcEnd, ArcEnd]
    curve: int

    @property
    def closed(self) -> bool:
        """Whether it comes back to where it began."""
        return self.ends[0].kind is EndKind.CLOSED

    @property
    def s(self) -> Vector:
        """Arc length (k,) [joint units] from the first posture on."""
        return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(self.q, axis=0), axis=1)))

    @property
    def length(self) -> float:
        """Arc length [joint units]."""
        return float(self.s[-1])

    def at(self, s: ArrayLike) -> Array:
        """The posture (n,) at an arc length s [joint units] from the first one, or postures (k, n), the tool still.

        Raises: ArgumentError: s is beyond the ends. NotFiniteError, ShapeError.
        """
        wanted, every = np.atleast_1d(finite("s", s)), self.s
        if wanted.ndim != 1 or (wanted < 0).any() or (wanted > every[-1]).any():
            raise ArgumentError("an arc length", s, f"give 0 to {every[-1]:.6g}")
        i = np.clip(np.searchsorted(every, wanted, side="right") - 1, 0, max(0, len(every) - 2))
        j = np.minimum(i + 1, len(every) - 1)
        width = every[j] - every[i]
        t = (wanted - every[i]) / np.where(width > 0, width, 1.0)
        q = _stretches(self.task, self.pose, self.q[i], self.q[j]).postures(t)
        return q if np.ndim(s) else q[0]

    def place_of(self, q: Vector) -> tuple[float, float]:
        """Where along the arc it is nearest to a posture (n,), and how far away [joint units], whole turns aside."""
        gap, step = joint_gap(self.task.robot, q, self.q[:-1]), np.diff(self.q, axis=0)
        t = np.clip((gap * step).sum(axis=1) / np.maximum((step * step).sum(axis=1), 1e-300), 0, 1)
        away = np.linalg.norm(gap - t[:, None] * step, axis=1)
        i = int(away.argmin())
        return float(self.s[i] + t[i] * (self.s[i + 1] - self.s[i])), float(away[i])


@dataclass(frozen=True, eq=False)
class SelfMotion(NoTruthValue, Result, Value, ask="`.arcs`"):
    """All postures with one tool pose (4, 4): the arcs of its self-motions within the joint limits.

    components: how many self-motions there are, limits and contacts aside. curves: these, limits aside; one that is not
    closed ends at contacts or singular postures, or where a slide does.
    """

    task: Task
    pose: Matrix
    arcs: tuple[SelfMotionArc, ...]
    curves: tuple[SelfMotionArc, ...]
    components: int
    limits: bool

    @property
    def sentence(self) -> str:
        """How many self-motions, how many arcs of them, and where these end."""
        if not self.components:
            return f"no posture of {self.task.robot.name!r} has this tool pose"
        many = f"{self.components} self-motion{'s' if self.components > 1 else ''} with this tool pose"
        within = " within the joint limits" if self.limits else ""
        if not self.arcs:
            return f"{many}, no arc of them{within}"
        parts = [
            f"{arc.length:.4g} joint units, " + ("closed" if arc.closed else f"from {arc.ends[0]} to {arc.ends[1]}")
            for arc in self.arcs
        ]
        return f"{many}; arcs{within}: {'; '.join(parts)}"

    def __str__(self) -> str:
        return self.sentence

    def place_of(self, q: ArrayLike) -> tuple[SelfMotionArc, float]:
        """The arc that holds a posture (n,) with this pose, at some turns of its hinges, and its arc length there.

        Raises: ArgumentError: none does.
        """
        posture = self.task.robot.checked(q)
        places = [(arc, *arc.place_of(posture)) for arc in self.arcs]
        if not places or min(away for *_, away in places) > APART:
            raise ArgumentError("a posture of the self-motion", q, "give one that holds the tool at its pose")
        arc, s, _ = min(places, key=lambda place: place[2])
        return arc, s

    def levels(self, strategy: HolonomicStrategy) -> ServedLevels:
        """The levels c of a strategy, r = 1, whose leaf g(q) = c has a posture of an arc, at any turn within limits.

        Raises: ArgumentError: the strategy is of another task, or has no leaves.
        """
        if not isinstance(strategy, HolonomicStrategy):
            raise ArgumentError("the strategy", strategy, HolonomicStrategy.cure)
        if strategy.task != self.task:
            raise ArgumentError("the strategy", strategy.name, "give one of the task of the self-motion")
        parts = _intervals(strategy, self.task, self.pose, self._turned(strategy))
        jumps = any(JUMPS in part.ends for part in parts)
        return ServedLevels(strategy, _union(parts, strategy.constraint.angular[0]), jumps)

    def _turned(self, strategy: HolonomicStrategy) -> list[SelfMotionArc]:
        """The arcs, at all turns within the limits of hinges of which a whole turn is another level."""
        robot = self.task.robot
        bound = robot.hinges & (robot.upper - robot.lower >= 2 * np.pi) & np.isfinite(robot.upper - robot.lower)
        if not self.limits or not self.arcs or not bound.any():
            return list(self.arcs)
        bound &= ~turns_of(strategy, np.vstack([arc.q[:1] for arc in self.arcs])).free
        if not bound.any():
            return list(self.arcs)
        arcs: list[SelfMotionArc] = []
        for curve in self.curves:
            q, ends, turning = curve.q, curve.ends, bound.copy()
            # A joint that turns round along a closed curve: the curve goes on, over the joint's whole range.
            wound = bound & curve.closed & (np.abs(q[-1] - q[0]) > np.pi)
            if wound.any():
                rounds = int(np.ceil((robot.upper - robot.lower)[wound].max() / (2 * np.pi))) + 1
                q = np.vstack([q[:-1] + k * (q[-1] - q[0]) for k in range(-rounds, rounds + 1)])
                ends = ArcEnd(EndKind.SINGULAR), ArcEnd(EndKind.SINGULAR)
                turning[wound.argmax()] = False
            first = np.ceil((robot.lower - q.max(axis=0)) / (2 * np.pi))
            last = np.floor((robot.upper - q.min(axis=0)) / (2 * np.pi))
            ranges = [np.arange(first[j], last[j] + 1) if turning[j] else np.zeros(1) for j in range(robot.n)]
            for turns in product(*ranges):
                pieces = _cut_at_limits(self.task, self.pose, q + 2 * np.pi * np.array(turns), ends, bound)
                arcs += [SelfMotionArc(self.task, self.pose, part, ends, curve.curve) for part, ends in pieces]
        return arcs


APART = 0.1
"""Joint motion [joint units] from the straight line between neighbours up to which a posture is on an arc."""

EXTREMUM, JUMPS, EVERY = "an extremum of g", "a jump of g", "no end"


@dataclass(frozen=True, eq=False)
class LevelInterval(Value):
    """Levels from low to high, the postures (n,) at its ends, and what they are: an extremum of g, where [J; J_g] is
    singular, a jump of it, or the end of an arc. All levels of an angle are from -pi to pi."""

    low: float
    high: float
    q_low: Vector
    q_high: Vector
    ends: tuple[str, str]


@dataclass(frozen=True, eq=False)
class ServedLevels(NoTruthValue, Result, Value, ask="`.intervals`"):
    """The intervals of levels of a strategy that serve a tool pose; where the level is an angle, low is in [-pi, pi).

    jumps: g has a jump or no value somewhere along the self-motions, where the intervals are cut.
    """

    strategy: HolonomicStrategy
    intervals: tuple[LevelInterval, ...]
    jumps: bool

    @property
    def every(self) -> bool:
        """Whether all levels of an angle serve."""
        return any(i.high - i.low >= 2 * np.pi for i in self.intervals) and self.strategy.constraint.angular[0]

    def has(self, level: float) -> bool:
        """Whether a level serves."""
        turn = 2 * np.pi if self.strategy.constraint.angular[0] else np.inf
        with np.errstate(invalid="ignore"):
            rest = [(level - i.low) % turn if turn < np.inf else level - i.low for i in self.intervals]
        return any(0 <= r <= i.high - i.low for r, i in zip(rest, self.intervals, strict=True))

    def __str__(self) -> str:
        if not self.intervals:
            return "no level serves this pose"
        if self.every:
            return "every level serves this pose"
        parts = [f"{i.low:.4g} ({i.ends[0]}) to {i.high:.4g} ({i.ends[1]})" for i in self.intervals]
        return f"levels that serve this pose: {'; '.join(parts)}" + ("; g jumps along the way" if self.jumps else "")


@typed
def self_motion(task: Task, pose: PoseLike, *, limits: bool = True, clear: Clear | None = None) -> SelfMotion:
    """All postures with f(q) = x, where one joint is redundant: arcs of curves, each with why it ends.

    An arc ends where a joint is at its limit, to round-off. With a `clear` it ends at a contact too.

    Args:
        pose: x of the tool (4, 4).
        limits: False: whole curves, beyond the joint limits.
        clear: postures (k, n) -> which are clear (k,), as `Clearances.clear` of a scene. What touches between two
            postures that are clear, up to 0.3 joint units apart, is not seen.

    Raises:
        ArgumentError: not one redundant joint.
    """
    of_one_tool(task, "self_motion")
    if task.n - task.m != 1:
        what = "the number of redundant joints"
        raise ArgumentError(what, task.n - task.m, "give a task that leaves one")
    x = tool_pose("a tool pose", given_pose("a tool pose", pose))
    motions = self_motions_at(task, x[None, :3, 3], x[None, :3, :3])

    def arc_of(piece: Piece, k: int) -> SelfMotionArc:
        return SelfMotionArc(task, x, *piece, k)

    # The curves, cut at contacts; then at limits.
    curves: list[SelfMotionArc] = []
    for k, closed in enumerate(motions.closed.tolist()):
        q = motions.q[motions.curve == k]
        whole = q, _own_ends(task.robot, q, closed)
        curves += [arc_of(p, k) for p in ([whole] if clear is None else _cut_at_contacts(task, x, *whole, clear))]
    slides = np.zeros(task.n, dtype=bool)
    arcs = (
        [arc_of(p, c.curve) for c in curves for p in _cut_at_limits(task, x, c.q, c.ends, slides)] if limits else curves
    )
    return SelfMotion(task, x, tuple(arcs), tuple(curves), len(motions.closed), limits)


Piece = tuple[Matrix, tuple[ArcEnd, ArcEnd]]


def _own_ends(robot: Robot, q: Matrix, closed: bool) -> tuple[ArcEnd, ArcEnd]:
    """The ends of a whole curve: closed, at the end of a slide that was held, or singular."""
    if closed:
        return ArcEnd(EndKind.CLOSED), ArcEnd(EndKind.CLOSED)
    ends = []
    for posture in (q[0], q[-1]):
        end = ArcEnd(EndKind.SINGULAR)
        for j in np.flatnonzero(~robot.hinges).tolist():
            for upper, limit in enumerate((robot.lower[j], robot.upper[j])):
                if abs(posture[j] - limit) < 1e-9:
                    end = ArcEnd(EndKind.LIMIT, robot.joint_names[j], bool(upper))
        ends.append(end)
    return ends[0], ends[1]


def _stretches(task: Task, pose: Matrix, a: Matrix, b: Matrix) -> Stretches:
    """The stretches of self-motions between postures a and b (k, n) at a pose."""
    p, R = np.broadcast_to(pose[:3, 3], (len(a), 3)), np.broadcast_to(pose[:3, :3], (len(a), 3, 3))
    return Stretches.between(task, p, R, a, b)


def _beside(q: Matrix, rows: Indices) -> tuple[Indices, Indices]:
    """(the rows with which the stretches beside some rows (k,) of a curve begin, which of the rows they are beside)."""
    begin, at = np.concatenate([rows - 1, rows]), np.tile(rows, 2)
    inside = (begin >= 0) & (begin < len(q) - 1)
    return begin[inside], at[inside]


# --- Arcs within the joint limits.


def _cut_at_limits(task: Task, pose: Matrix, q: Matrix, ends: tuple[ArcEnd, ArcEnd], bound: Flags) -> list[Piece]:
    """The parts of a curve q (k, n) along which the joints are within their limits, at some turn of hinges but for
    those that are bound (n,) to theirs."""
    robot = task.robot
    turn = np.where(robot.hinges & ~bound, 2 * np.pi, 0.0)
    q = _with_turning_points(task, pose, q, turn)
    runs = _runs(robot, q, turn)
    if ends[0].kind is EndKind.CLOSED:
        if runs and runs[0][:2] == (0, len(q) - 1):
            return [(q + runs[0][2], ends)]
        # It begins where an arc does.
        start = runs[0][1] + 1 if runs and runs[0][0] == 0 else 0
        q = np.vstack([q[start:], q[1 : start + 1] + (q[-1] - q[0])])
        runs = _runs(robot, q, turn)
    # The steps over a limit at their ends: run, which end, posture within and beyond.
    steps: list[tuple[int, int, Vector, Vector]] = []
    for k, (first, last, turns) in enumerate(runs):
        steps += [(k, 0, q[first] + turns, q[first - 1] + turns)] if first > 0 else []
        steps += [(k, 1, q[last] + turns, q[last + 1] + turns)] if last < len(q) - 1 else []
    parts, why = [q[first : last + 1] + turns for first, last, turns in runs], [list(ends) for _ in runs]
    for (run, side, within, _), (posture, end) in zip(steps, _at_limits(task, pose, steps), strict=True):
        why[run][side] = end
        if np.abs(posture - within).max() > 0:
            parts[run] = np.vstack([posture, parts[run]] if side == 0 else [parts[run], posture])
    return [(part, (end[0], end[1])) for part, end in zip(parts, why, strict=True) if len(part) > 1]


def _with_turning_points(task: Task, pose: Matrix, q: Matrix, turn: Vector) -> Matrix:
    """A curve with the postures between its own where a joint turns back near to a limit, and may be beyond it."""
    robot, (before, here, after) = task.robot, (q[:-2], q[1:-1], q[2:])
    found = [np.zeros((0, 3), dtype=np.intp)]
    for sign, limit in ((1, robot.upper), (-1, robot.lower)):
        with np.errstate(invalid="ignore"):
            rest = sign * (limit - here)
            # How far the limit is, at the turn where it is nearest.
            rest = np.where(turn > 0, rest - turn * np.round(rest / np.where(turn > 0, turn, 1.0)), rest)
            bend = sign * (2 * here - before - after)
            turns_back = (sign * (here - before) >= 0) & (sign * (here - after) >= 0) & (np.abs(rest) < bend)
        i, j = np.nonzero(turns_back & np.isfinite(rest))
        found.append(np.column_stack([i + 1, j, np.full(len(i), sign)]))
    # Each is on one of the two stretches beside its row.
    row, joint, sign = np.tile(np.concatenate(found).T, 2)
    begin = row - (np.arange(len(row)) < len(row) // 2)
    postures, _ = _stretches(task, pose, q[begin], q[begin + 1]).least(
        lambda Q, k: -sign[k] * Q[np.arange(len(Q)), joint[k]]
    )
    ahead, step = postures - q[begin], q[begin + 1] - q[begin]
    place = (ahead * step).sum(axis=1) / (step * step).sum(axis=1)
    keys, inside = np.arange(len(q), dtype=float), (place > 1e-7) & (place < 1 - 1e-7)
    return np.vstack([q, postures[inside]])[np.argsort(np.append(keys, (begin + place)[inside]), kind="stable")]


def _runs(robot: Robot, q: Matrix, turn: Vector) -> list[tuple[int, int, Vector]]:
    """The runs of postures (k, n) that some whole turns keep within the limits, each as long as it can be: its first
    and last row, and these turns (n,). turn (n,): of each joint, 0 of one that has none."""
    some, turning = np.where(turn > 0, turn, 1.0), turn > 0
    least = np.where(turning, np.ceil((robot.lower - q) / some - 1e-13), np.where(q >= robot.lower - 1e-12, 0, 1))
    most = np.where(turning, np.floor((robot.upper - q) / some + 1e-13), np.where(q <= robot.upper + 1e-12, 0, -1))
    inside, runs, first = np.flatnonzero((least <= most).all(axis=1)), list[tuple[int, int, Vector]](), 0
    while (k := int(np.searchsorted(inside, first))) < len(inside):
        first = int(inside[k])
        low, high = np.maximum.accumulate(least[first:], axis=0), np.minimum.accumulate(most[first:], axis=0)
        last = int((low <= high).all(axis=1).sum()) - 1
        nearest = np.round((robot.middle - q[first]) / some)
        runs.append((first, first + last, turn * np.clip(nearest, low[last], high[last])))
        first += last + 1
    return runs


def _at_limits(
    task: Task, pose: Matrix, steps: Sequence[tuple[int, int, Vector, Vector]]
) -> list[tuple[Vector, ArcEnd]]:
    """Of each step from a posture within the limits to one beyond, the posture (n,) where the first joint comes to its
    limit, and which it is."""
    robot = task.robot
    cases = [
        (k, j, bool(upper))
        for k, (*_, beyond) in enumerate(steps)
        for upper, gap in enumerate((robot.lower - beyond, beyond - robot.upper))
        for j in np.flatnonzero(gap > 0).tolist()
    ]
    which, joint = (np.array([case[i] for case in cases], dtype=np.intp) for i in range(2))
    limit = np.array([robot.upper[j] if upper else robot.lower[j] for _, j, upper in cases])
    a, b = (np.array([steps[k][2 + i] for k in which]).reshape(-1, robot.n) for i in range(2))
    q = _stretches(task, pose, a, b).at_values(joint, limit)
    way = np.abs(q - a).max(axis=1)
    found: list[tuple[Vector, ArcEnd]] = []
    for k, (_, _, within, _) in enumerate(steps):
        own = np.flatnonzero(which == k)
        if not len(own):  # round-off
            found.append((within, ArcEnd(EndKind.SINGULAR)))
            continue
        first = int(own[way[own].argmin()])
        found.append((q[first], ArcEnd(EndKind.LIMIT, robot.joint_names[joint[first]], cases[first][2])))
    return found


def _cut_at_contacts(task: Task, pose: Matrix, q: Matrix, ends: tuple[ArcEnd, ArcEnd], clear: Clear) -> list[Piece]:
    """The parts of an arc that are clear of a scene."""
    free = np.asarray(clear(q), dtype=bool)
    if free.all():
        return [(q, ends)]
    if ends[0].kind is EndKind.CLOSED:  # it begins where it is not clear
        start = int(free.argmin())
        q = np.vstack([q[start:], q[1 : start + 1] + (q[-1] - q[0])])
        free = np.append(free[start:], free[1 : start + 1])
    # Between a posture that is clear and one that is not: the last one that is clear.
    changes = np.flatnonzero(free[1:] != free[:-1])
    a, b = (q[changes + (free[changes] ^ side)] for side in (True, False))
    last = _stretches(task, pose, a, b).halved(lambda Q: np.asarray(clear(Q), dtype=bool))
    # The pieces, from change to change.
    contact, pieces = ArcEnd(EndKind.CONTACT), []
    bounds = [0, *(changes + 1).tolist(), len(q)]
    for k, (first, stop) in enumerate(pairwise(bounds)):
        if not free[first]:
            continue
        parts, own = [q[first:stop]], list(ends)
        if k > 0:
            parts, own[0] = [last[k - 1 : k], *parts], contact
        if k < len(changes):
            parts, own[1] = [*parts, last[k : k + 1]], contact
        pieces.append((np.vstack(parts), (own[0], own[1])))
    return pieces


# --- Levels of a strategy along arcs.


class _Rows(NamedTuple):
    """Postures of an arc along which g is continuous, its values (k,), what their ends are, whether they are closed."""

    q: Matrix
    level: Vector
    ends: tuple[str, str]
    closed: bool


def _intervals(
    strategy: HolonomicStrategy, task: Task, pose: Matrix, arcs: Sequence[SelfMotionArc]
) -> list[LevelInterval]:
    """The levels of arcs, each from the least to the largest one; cut where g jumps, or has no value."""
    angular, parts = strategy.constraint.angular[0], list[_Rows]()

    def g(q: Matrix) -> Vector:
        return strategy.constraint_value.batch(q).reshape(-1)

    for arc in arcs:
        level = np.unwrap(g(arc.q)) if angular else g(arc.q)
        for rows in np.split(np.arange(len(level)), _jumps(arc, g, level, angular)):
            own = rows[np.isfinite(level[rows])]
            if len(own):
                first, last = own[0] == 0, own[-1] == len(level) - 1
                ends = str(arc.ends[0]) if first else JUMPS, str(arc.ends[1]) if last else JUMPS
                closed = arc.closed and len(own) == len(level)
                parts.append(_Rows(arc.q[own], level[own], ends, closed))
    return _ranges(task, pose, g, parts, angular)


def _jumps(arc: SelfMotionArc, g: Callable[[Matrix], Vector], level: Vector, angular: bool) -> Indices:
    """The rows of an arc before which g jumps: its step is large, and stays so where that of the joints is small."""
    step = np.abs(np.diff(level))
    beside = np.maximum(np.append(step[1:], 0), np.append(0, step[:-1]))
    with np.errstate(invalid="ignore"):
        doubtful = np.flatnonzero(~(step <= JUMP * beside + 1e-9))
    if not len(doubtful):
        return doubtful
    begin, end = level[doubtful], level[doubtful + 1]

    def ahead(middle: Matrix) -> Flags:
        """Whether the larger step is ahead of postures (k, n); where g has no value it is so for ever."""
        value = g(middle)
        value = begin + (value - begin + np.pi) % (2 * np.pi) - np.pi if angular else value
        yes = ~(np.abs(value - begin) > np.abs(end - value))
        begin[yes], end[~yes] = value[yes], value[~yes]
        return yes

    with np.errstate(invalid="ignore"):
        _stretches(arc.task, arc.pose, arc.q[doubtful], arc.q[doubtful + 1]).halved(ahead, 24)
        return doubtful[~(np.abs(end - begin) < 0.1 * step[doubtful])] + 1


def _ranges(
    task: Task, pose: Matrix, g: Callable[[Matrix], Vector], parts: Sequence[_Rows], angular: bool
) -> list[LevelInterval]:
    """The levels of parts of arcs, at the ends exact."""
    # The highest row of each, for g and -g; and the stretches beside rows that are no lower than their neighbours.
    ends, found = list[tuple[float, Vector, str]](), list[tuple[Matrix, Matrix, Vector, Indices]]()
    for part, sign in product(parts, (-1.0, 1.0)):
        height = sign * part.level
        top = int(height.argmax())
        inner = part.closed or 0 < top < len(height) - 1
        ends.append((float(part.level[top]), part.q[top], EXTREMUM if inner else part.ends[int(top > 0)]))
        padded = np.concatenate([[-np.inf], height, [-np.inf]])
        begin, at = _beside(part.q, np.flatnonzero((height >= padded[:-2]) & (height >= padded[2:])))
        found.append((part.q[begin], part.q[begin + 1], part.level[at], np.full(len(at), len(ends) - 1)))
    if not found:
        return []
    a, b, center, end = (np.concatenate(arrays) for arrays in zip(*found, strict=True))
    sign = np.where(end % 2, 1.0, -1.0)

    def depth(q: Matrix, k: Indices) -> Vector:
        """g times -sign, at the turn where it is near to that of a peak."""
        away = g(q) - center[k]
        away -= 2 * np.pi * angular * np.round(away / (2 * np.pi))
        return np.where(np.isfinite(away), -sign[k] * (center[k] + away), np.inf)

    # The extremes between rows, where they are higher.
    postures, depths = _stretches(task, pose, a, b).least(depth)
    for i, side, value, q in zip(end.tolist(), sign, -sign * depths, postures, strict=True):
        if side * value > side * ends[i][0]:
            ends[i] = float(value), q, EXTREMUM
    each = zip(ends[::2], ends[1::2], strict=True)
    return [LevelInterval(low[0], high[0], low[1], high[1], (low[2], high[2])) for low, high in each]


def _union(parts: list[LevelInterval], angular: bool) -> tuple[LevelInterval, ...]:
    """Intervals that do not overlap."""
    if angular:
        if full := [part for part in parts if part.high - part.low >= 2 * np.pi]:
            return (LevelInterval(-np.pi, np.pi, full[0].q_low, full[0].q_high, (EVERY, EVERY)),)
        shifts = [2 * np.pi * np.floor((part.low + np.pi) / (2 * np.pi)) for part in parts]
        parts = [_shifted(part, -shift) for part, shift in zip(parts, shifts, strict=True)]
    merged: list[LevelInterval] = []
    for part in sorted(parts, key=lambda part: part.low):
        if merged and part.low <= merged[-1].high:
            merged[-1] = _joined(merged[-1], part)
        else:
            merged.append(part)
    # Round the circle the last one may go on into the first ones.
    while angular and len(merged) > 1 and merged[-1].high - 2 * np.pi >= merged[0].low:
        merged[-1] = _joined(merged[-1], _shifted(merged.pop(0), 2 * np.pi))
    if angular and len(merged) == 1 and merged[0].high - merged[0].low >= 2 * np.pi:
        merged = [LevelInterval(-np.pi, np.pi, merged[0].q_low, merged[0].q_high, (EVERY, EVERY))]
    return tuple(merged)


def _shifted(part: LevelInterval, by: float) -> LevelInterval:
    return LevelInterval(part.low + by, part.high + by, part.q_low, part.q_high, part.ends)


def _joined(first: LevelInterval, other: LevelInterval) -> LevelInterval:
    """Two intervals that overlap, of which the first begins before the other."""
    last = other if other.high > first.high else first
    return LevelInterval(first.low, last.high, first.q_low, last.q_high, (first.ends[0], last.ends[1]))
