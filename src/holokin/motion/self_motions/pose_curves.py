"""`self_motion`: all postures that hold the tool at one pose, as curves within the joint limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.poses import PoseLike, given_pose
from ...base.types import (
    Array,
    ArrayLike,
    Flags,
    Matrix,
    NoTruthValue,
    Result,
    Value,
    Vector,
    finite,
    tool_pose,
)
from ...robot import Robot
from ...strategies.self_motion_curves import joint_gap
from ...strategies.tasks.task import Task, of_one_tool
from .self_motions import self_motions_at
from .stretches import Stretches

Clear = Callable[[Matrix], Flags]
"""Which postures (k, n) are clear of a scene, as `Clearances.clear`."""


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


APART = 0.1
"""Joint motion [joint units] from the straight line between neighbours up to which a posture is on an arc."""


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
    arcs = [arc_of(p, c.curve) for c in curves for p in _cut_at_limits(task, x, c.q, c.ends)] if limits else curves
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


# --- Arcs within the joint limits.


def _cut_at_limits(task: Task, pose: Matrix, q: Matrix, ends: tuple[ArcEnd, ArcEnd]) -> list[Piece]:
    """The parts of a curve q (k, n) along which the joints are within their limits, at some turn of hinges."""
    robot = task.robot
    turn = np.where(robot.hinges, 2 * np.pi, 0.0)
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
