"""`check`: limits, singularities, self-collision, the floor and obstacles, for a whole motion."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, final

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, RobotFileError
from ...base.tolerances import TOLERANCES
from ...base.types import Array, Flags, Indices, Matrix, Result, Value, Vector, not_negative
from ...base.units import at_least
from ...robot import Robot, chain_length, joints_above, with_capsules
from ...robot.links import SLENDER
from ...robot.tree import Frames, joint_frames
from ...strategies.tasks.task import Task
from .check_report import (
    MOST_SHOWN,
    UNREAD_CURE,
    CheckReport,
    Clearance,
    Finding,
    FindingKind,
    Motion,
    counted,
    keeps,
    motion_of,
    robot_of,
)
from .clearance import Link, LinkGap, Pairs, Swept, pairs_of, stretches, sweep
from .scene import Scene


def _limit_findings(robot: Robot, motion: Motion, margin: float) -> Iterator[Finding]:
    """Where a joint is nearer than `margin` [joint units] to a limit of its position, or exceeds one of a rate."""
    for i, c in enumerate(robot.coordinates):
        q, lower, upper = motion.q[:, i], c.lower + margin, c.upper - margin
        for past, limit in ((lower - q, lower), (q - upper, upper)):
            for a, b, k in stretches(past > TOLERANCES.limit, past):
                facts = _times(motion, a, b, k), k, float(q[k]), float(limit), c.unit
                yield _finding(FindingKind.POSITION, c.name, *facts)
        for kind, values, limits, per in motion.rates:
            size, most = np.abs(values[:, i]), float(limits[i])
            for a, b, k in stretches(size > most * (1 + 1e-9), size):  # but for round-off
                yield _finding(kind, c.name, _times(motion, a, b, k), k, float(size[k]), most, c.unit + per)


def _singular_findings(task: Task, motion: Motion, J: Array, rcond: float) -> Iterator[Finding]:
    """Where the smallest singular value of the task Jacobian J (k, m, n) is less than `rcond` times the largest."""
    values = np.linalg.svd(J, compute_uv=False)
    ratios = values[:, -1] / np.maximum(values[:, 0], np.finfo(float).tiny)
    for a, b, k in stretches(ratios < rcond, -ratios):
        yield _finding(FindingKind.SINGULARITY, task.name, _times(motion, a, b, k), k, float(ratios[k]), rcond, "")


Times = tuple[float, float, float]
"""When a finding begins, when it ends, and when it is worst [s]."""


def _finding(kind: FindingKind, what: str, times: Times, k: int, value: float, limit: float, unit: str) -> Finding:
    """A finding that is worst at sample k."""
    return Finding(kind, (what,), *times, k, value, limit, unit)


def _times(motion: Motion, first: float, last: float, worst: float) -> Times:
    """The times of samples, whose numbers need not be whole."""
    return _time(motion, first), _time(motion, last), _time(motion, worst)


def _time(motion: Motion, s: float) -> float:
    return float(np.interp(s, np.arange(len(motion.t)), motion.t))


# --- Jumps of posture inside a motion: joint steps in whose middle the tool is off its way; and self-motions.
#
# On a step from q to q + d, the joints going straight, the tool is near the middle of its way at q + d/2: it is off by
# (1/8) d^T H d, H the second derivative of the pose, which is of second order in its step. A step to another posture of
# nearly the same tool pose takes the tool off by as much, but leads it nowhere.

SHARE = 0.25
"""Share of the tool's step by which its middle may be off, beside `TOLERANCES.tracking`: a circle of six samples is off
by an eighth, joints that go 1 rad in any direction by a ninth as a rule."""

LARGE = 0.3
"""A joint step [rad or m] that is reported in any case, if it is 20 times the median; motion of a self-motion, too."""

AT_REST = 0.01
"""How far the tool goes, over how far points at the arm's length would go, up to which it is called at rest."""


def _jump_findings(task: Task, motion: Motion) -> Iterator[Finding]:
    """Where a joint step takes the tool off the straight way between its two poses, by more than is allowed.

    The middle may be off by `TOLERANCES.tracking` [m, rad] and `SHARE` of how far the step leads the tool, where a turn
    counts as the arm's length times it. Of a joint without limits a step is what is left without whole turns.
    """
    robot, Q, task = task.robot, motion.samples, task._geometric_twin
    step = _steps(robot, Q)
    candidates = np.flatnonzero(_off_at_most(robot, Q, step) > TOLERANCES.tracking)
    if not len(candidates):
        return
    # How far the tool is off in the middle of each step, and how far the step leads it.
    begin, move = Q[candidates], step[candidates]
    middle, (p, R), end = begin + move / 2, task._poses(begin), task._poses(begin + move)
    back, on = task.error(middle, p, R), task.error(middle, *end)
    way, turn = _sizes(task, task.error(begin, *end))
    off = [
        np.maximum(np.linalg.norm(a + b, axis=1), sum(np.linalg.norm(x, axis=1) for x in (a, b)) - size) / 2
        for a, b, size in zip(_parts(task, back), _parts(task, on), (way, turn), strict=True)
    ]
    # How far it may be off; each stretch of steps by more than that is a finding.
    length = _length(robot)
    allowed = [TOLERANCES.tracking + SHARE * size for size in (way + length * turn, turn + way / length)]
    worst = np.zeros(len(step))
    worst[candidates] = np.maximum(off[0] / allowed[0], off[1] / allowed[1])
    for a, b, k in stretches(worst > 1, worst):
        i = int(np.searchsorted(candidates, k))
        part = int(off[1][i] / allowed[1][i] > off[0][i] / allowed[0][i])
        joint = robot.joint_names[int(np.argmax(np.abs(step[k])))]
        times = motion.time(a), motion.time(b + 1), (motion.time(k) + motion.time(k + 1)) / 2
        value, limit, unit = float(off[part][i]), float(allowed[part][i]), ("m", "rad")[part]
        yield _finding(FindingKind.JUMP, joint, times, motion.index(k), value, limit, unit)


def _large_steps(robot: Robot, motion: Motion, known: Sequence[Finding] | None) -> list[str]:
    """A note on the largest joint step, where it is larger than the others by far.

    Args:
        known: the jumps that were found by a task; None where there was none.
    """
    step = np.abs(_steps(robot, motion.samples))
    size = step.max(axis=1, initial=0.0)
    usual = float(np.median(size[size > 0])) if (size > 0).any() else 0.0
    wrong = (size > LARGE) & (size > 20.0 * usual)
    for k in np.flatnonzero(wrong).tolist():
        wrong[k] = not any(jump.start <= motion.time(k) < jump.stop for jump in known or ())
    if not wrong.any():
        return []
    k = int(np.argmax(np.where(wrong, size, 0.0)))
    joint, more = robot.coordinates[int(np.argmax(step[k]))], int(wrong.sum()) - 1
    unknown = "whether it is a jump of posture cannot be told without the task of a tool"
    often = f"{size[k] / usual:.0f} times the median step{f', and there are {more} more' * (more > 0)}"
    return [
        f"a large step: {joint.name} goes {size[k]:.3g} {joint.unit} from one sample to the next at "
        f"{motion.time(k):.3f} s, {often}; {unknown if known is None else 'the tool stays near its straight line'}"
    ]


def self_motions(task: Task, motion: Motion, J: Array) -> list[str]:
    """Notes on where joints move, by `LARGE` at least, and the tool rests. J (k, m, n): along the motion."""
    robot, q = task.robot, motion.q
    step = _steps(robot, q)
    joints = np.abs(step).sum(axis=1)
    # Stretches in which the tool goes a hundredth as far as points at the arm's length would.
    way, turn = _sizes(task, np.einsum("kmn,kn->km", (J[1:] + J[:-1]) / 2, step))
    length, notes = _length(robot), []
    rests = (way <= AT_REST * length * joints) & (turn <= AT_REST * joints)
    for a, b, _ in stretches(rests, joints):
        # At 64 samples of them, at most, the tool must be where it was.
        moved = np.abs(np.cumsum(step[a : b + 1], axis=0)).max(axis=0)
        joint = robot.coordinates[int(np.argmax(moved))]
        some = np.unique(np.linspace(a, b + 1, 64).astype(int))
        p, R = task._poses(q[some[:1]])
        strays = max(size.max() for size in _sizes(task, task.error(q[some], p[0], R[0])))
        if moved.max() <= LARGE or strays > TOLERANCES.tracking:
            continue
        when, by = f"{motion.t[a]:.3f} to {motion.t[b + 1]:.3f} s", f"{moved.max():.3g} {joint.unit}"
        notes.append(f"a self-motion: from {when} the tool rests while {joint.name} moves by {by}")
    more = len(notes) - MOST_SHOWN
    return notes if more <= 0 else [*notes[:MOST_SHOWN], f"and {more} more self-motions"]


def _length(robot: Robot) -> float:
    """Of the arm [m], by which turns are compared with distances; that of sliders alone may be 0."""
    return max(chain_length(robot), TOLERANCES.tracking)


def _steps(robot: Robot, Q: Matrix) -> Matrix:
    """Joint steps (k - 1, n); of joints without limits those that are left without whole turns."""
    step = np.diff(Q, axis=0)
    endless = robot.hinges & np.isinf(robot.lower) & np.isinf(robot.upper)
    return step - 2 * np.pi * np.where(endless, np.round(step / (2 * np.pi)), 0.0)


def _off_at_most(robot: Robot, Q: Matrix, step: Matrix) -> Vector:
    """How far off the tool can be in the middle of a step at most [m], and how far turned [rad]: roughly, for a choice.

    With |d^2 x / dq_i dq_j| <= arm of two hinges, 1 of a hinge and a slider, 0 of two sliders; 2 of rotations.
    """
    turns, slides = np.zeros(len(step)), np.zeros(len(step))
    arm = max((float(np.linalg.norm(tip.placement[:3, 3])) for tip in robot.tips), default=0.0)
    for joint in robot.joints:
        size = abs(joint.multiplier) * np.abs(step[:, joint.coordinate])
        arm += float(np.linalg.norm(joint.placement[:3, 3]))
        if joint.kind == "prismatic":
            slides += size
            arm += float(np.abs(joint.multiplier * Q[:, joint.coordinate] + joint.offset).max(initial=0.0))
        else:
            turns += size
    return turns * (max(2.0, arm) * turns + 2 * slides) / 8


def _parts(task: Task, rows: Matrix) -> tuple[Matrix, Matrix]:
    """The rows in metres, and those in radians, of (k, m)."""
    turning = np.array([unit == "rad" for unit in task.units])
    return rows[:, ~turning], rows[:, turning]


def _sizes(task: Task, rows: Matrix) -> tuple[Vector, Vector]:
    way, turn = (np.linalg.norm(part, axis=1) for part in _parts(task, rows))
    return way, turn


LINKS = Scene()
"""What `check` looks at by default: links against links."""

RCOND = 0.01
"""Smallest over largest singular value of J below which a posture is reported: rates are 100 times those elsewhere."""


@typed
def check(
    motion: Any,
    scene: Scene | None = LINKS,
    *,
    robot: Robot | None = None,
    task: Task | None = None,
    limits: bool = True,
    margin: float = 0.0,
    rcond: float = RCOND,
) -> CheckReport:
    """Look at a motion for what a robot should not do: exceed limits, meet a singularity, touch itself or the floor.

    Distances are those of the robot's shapes: the <collision> elements of a URDF, the geoms of MJCF that collide, or
    capsules between the frames of the joints for a robot without any, see `with_capsules`. Meshes are their convex
    hulls, and where these are nearer than the clearance, themselves. Left out are parent and child in the robot's tree,
    links without shapes between counted out, pairs that touch at each of 200 random postures, and those that the
    scene allows. Links beside the chain stand where their joints are at zero, or at the `locked` value of `load`.

    What is found of distances holds for the whole motion, with the joints going straight from one sample to the next:
    between two postures with distances d and e, over which points move by S at most, the distance is at least
    (d + e - S) / 2, and the interval is halved until that tells. Limits and singularities are looked at at the samples.

    Args:
        motion: a Trajectory, a TimedTrajectory, a Recording, or postures (k, n).
        scene: what it is to keep clear of, by default its own links alone; None leaves distances aside.
        robot: whose motion it is, by default that of the trajectory or of the task; a recording and postures need one.
        task: whose Jacobian must not be singular; None leaves singularities aside.
        limits: whether limits of the joints are looked at: of position and speed, and of a TimedTrajectory those of
            acceleration and jerk.
        margin: how far joints must keep from limits of their positions [joint units].
        rcond: the least that the smallest singular value of J over the largest may be.

    Returns:
        All that was found, and all that was not looked at.

    Raises:
        ArgumentError, ShapeError, NotFiniteError: it is no motion of this robot; a floor or obstacles for
            `coordinates`, which have no links. UnknownNameError: no such link.
        MissingExtraError: coal is not installed, and shapes other than capsules meet.
    """
    robot = robot_of(motion, robot or (None if task is None else task.robot))
    samples = motion_of(motion, robot)
    if not len(samples.t):
        raise ArgumentError("the samples of the motion", 0, "give at least one")
    edge, scene = not_negative("margin", margin), scene or Scene(self_collision=False)
    remarks, observations = list(samples.remarks), []
    findings: list[Finding] = []
    # Limits of the joints, and the joints whose speeds nothing limits.
    if limits:
        findings += _limit_findings(robot, samples, edge)
        speeds = [most for kind, _, most, _ in samples.rates if kind is FindingKind.VELOCITY]
        endless = [robot.joint_names[i] for most in speeds for i in np.flatnonzero(~np.isfinite(most))]
        if endless:
            remarks.append(f"cannot tell whether {', '.join(endless)} can be so fast: there is no limit of the speed")
    # Singular postures, jumps of posture and self-motions, by the task.
    jumps: list[Finding] | None = None
    if task is not None:
        J = task.jacobian_batch(samples.q)[0]
        findings += _singular_findings(task, samples, J, not_negative("rcond", rcond))
        if task._spatial:
            jumps = list(_jump_findings(task, samples))
            findings += jumps
            observations += self_motions(task, samples, J)
    else:
        remarks.append("singularities were not looked at: no task was given")
    observations += _large_steps(robot, samples, jumps)
    # Distances on the whole motion.
    swept: list[Swept] = []
    pairs = Pairs((), (), (), (), scene.clearance)
    if scene.floor is not None or scene.obstacles:
        robot._check_links()
    if not robot.tips:
        remarks.append(f"{robot.name} has no links: distances were not looked at")
    elif not scene.empty:
        if all(shape.obstacle for shape in robot.shapes):
            robot = with_capsules(robot)
            capsules = f"capsules of radius {chain_length(robot) / SLENDER:.3f} m from joint to joint"
            remarks.append(f"{robot.name} has no shapes: {capsules} stand for its links")
        pairs = pairs_of(robot, scene, samples.q)
        swept = sweep(robot, pairs.gaps, samples.q, pairs.limits, scene.clearance)
    clearances = []
    for pair, limit in sorted(zip(swept, pairs.limits, strict=True), key=lambda both: both[0].least):
        clearances.append(Clearance(pair.gap.names, pair.least, _time(samples, pair.least_at), pair.bound, limit))
        for first, last, nearest in stretches(~keeps(pair.d, limit), -pair.d):
            least, times = float(pair.d[nearest]), _times(samples, *pair.s[[first, last, nearest]])
            kind = FindingKind.COLLISION if least <= 0 else FindingKind.CLEARANCE
            findings.append(Finding(kind, pair.gap.names, *times, int(pair.s[nearest]), least, limit, "m"))
    findings.sort(key=lambda finding: (finding.start, finding.time))
    duration, left_out = float(samples.t[-1] - samples.t[0]), (pairs.left_out, pairs.unseen)
    notes = tuple(clearances), *left_out, tuple(remarks), tuple(observations)
    return CheckReport(tuple(findings), len(samples.t), duration, scene.clearance, *notes)


SURE = 1e-9
"""A distance [m] is less than asked by more than this, where two bodies are said to be too near: it is rounded."""


@final
@dataclass(frozen=True, eq=False)
class PairDistance(Result, Value):
    """How far apart two bodies are at one posture.

    Of meshes it is the distance of their convex hulls, which is no larger than theirs, as long as it is what is asked
    at least; below it their own.

    Attributes:
        names: two links, a link and an obstacle, or a link and the floor.
        distance: between them [m]; negative for how deep the one is in the other.
        wanted: what is asked of them [m].
        q: the posture (n,).
        pose: of the tool there (4, 4), of several tools (F, 4, 4).
    """

    names: tuple[str, str]
    distance: float
    wanted: float
    q: Vector
    pose: Array

    @property
    def too_near(self) -> bool:
        """Whether they are nearer than is asked, by more than round-off."""
        return self.distance < self.wanted - SURE

    @property
    def fact(self) -> str:
        """The two bodies and their distance, which is rounded down, and what is asked of them."""
        both = " and ".join(self.names)
        if self.distance <= 0:
            fact = f"{both} overlap by {-self.distance:.3g} m" if self.distance else f"{both} touch"
        else:
            fact = f"{both} are {at_least(self.distance)} m apart"
        return f"{fact}, where {self.wanted:.3g} m is asked" if self.wanted else fact

    @property
    def place(self) -> str:
        """Where the tool is."""
        tools = self.pose.reshape(-1, 4, 4)[:, :3, 3]
        return " and ".join(f"[{', '.join(f'{x:.4g}' for x in np.round(p, 4) + 0.0)}]" for p in tools) + " m"

    def __str__(self) -> str:
        return f"{self.fact}, with the tool at {self.place}"


Clear = Callable[[Matrix], Flags]
"""Which of some postures (k, n) are clear (k,)."""


@dataclass(frozen=True, eq=False)
class Clearances(Value):
    """What tells at single postures how far apart P pairs are: two links, a link and an obstacle, a link and the floor.

    pairs: as of `check`, of the shapes of the robot; of a pair that is always nearer than is wanted it is only asked
    that it does not touch.
    """

    robot: Robot
    pairs: Pairs

    @classmethod
    def of(cls, robot: Robot, scene: Scene) -> Clearances:
        """Those of a robot in a scene; what happens between postures is not looked at.

        Raises:
            UnknownNameError: no such link. ArgumentError: a robot without links. RobotFileError: the shape of a link
            could not be read, and no clearance can be told.
        """
        robot._check_links()
        shaped = with_capsules(robot) if all(shape.obstacle for shape in robot.shapes) else robot
        pairs = pairs_of(shaped, scene, np.zeros((1, robot.n)))
        if pairs.unread:
            raise RobotFileError(robot.name, pairs.unread, UNREAD_CURE)
        return cls(shaped, pairs)

    @property
    def wanted(self) -> float:
        """The distance asked for [m]."""
        return self.pairs.wanted

    @cached_property
    def limits(self) -> Vector:
        """The distance asked of each pair (P,) [m]."""
        return np.array(self.pairs.limits)

    @property
    def names(self) -> tuple[tuple[str, str], ...]:
        """Of the pairs."""
        return tuple(gap.names for gap in self.pairs.gaps)

    @property
    def free(self) -> Clearances:
        """Those of the pairs that are not always nearer than is wanted."""
        return self.some(np.flatnonzero(self.limits >= self.wanted))

    def some(self, which: Indices) -> Clearances:
        """Those of some of the pairs."""
        gaps, limits = tuple(self.pairs.gaps[p] for p in which.tolist()), tuple(self.limits[which].tolist())
        return replace(self, pairs=replace(self.pairs, gaps=gaps, limits=limits))

    def distances(self, Q: Matrix, near: float | Vector = -np.inf) -> Matrix:
        """Of each pair at postures (k, n) -> (k, P) [m]; negative where they overlap.

        Of meshes those of their convex hulls, and where these are below `near`, or that of each pair (P,), their own.
        """
        frames, every, gaps = joint_frames(self.robot, Q), np.arange(len(Q)), self.pairs.gaps
        nears = np.broadcast_to(near, len(gaps)).tolist()
        columns = [gap.distances(frames, every, e) for gap, e in zip(gaps, nears, strict=True) if len(Q)]
        return np.column_stack(columns) if columns else np.zeros((len(Q), len(gaps)))

    def least(self, Q: Matrix, near: float = -np.inf) -> Vector:
        """The least distance at postures (k, n) -> (k,) [m]; of pairs that are always near only where they touch."""
        return counted(self.distances(Q, near), self.limits, self.wanted).min(axis=1, initial=np.inf)

    def clear(self, Q: Matrix) -> Flags:
        """Which postures (k, n) keep all pairs as far apart as is asked of them (k,)."""
        return np.asarray(~self.too_near(Q).any(axis=1))

    def too_near(self, Q: Matrix) -> Flags:
        """Which pairs are nearer than is asked of them at postures (k, n) -> (k, P)."""
        frames, balls = joint_frames(self.robot, Q), {}

        def ball(link: Link) -> tuple[Matrix, float]:
            """The ball round a link: its centre at the postures (k, 3), its radius."""
            if id(link) not in balls:
                center, radius = link.ball
                place = center[None] if link.joint < 0 else frames[link.joint][0] + frames[link.joint][1] @ center
                balls[id(link)] = place, radius
            return balls[id(link)]

        near, gaps = np.zeros((len(Q), len(self.pairs.gaps)), dtype=bool), self.pairs.gaps
        for p, (gap, limit) in enumerate(zip(gaps, self.pairs.limits, strict=True)):
            # Where the balls round both are as far apart as is asked, the links are, too
            rows = np.arange(len(Q))
            if isinstance(gap, LinkGap):
                (a, one), (b, other) = ball(gap.one), ball(gap.other)
                apart = np.linalg.norm(a - b, axis=1) - one - other
                rows = np.flatnonzero(np.broadcast_to(apart <= limit, len(Q)))
            if len(rows):
                near[rows, p] = ~keeps(gap.distances(frames, rows, max(limit, self.wanted)), limit)
        return near

    def touching(self, Q: Matrix) -> list[str]:
        """The pair of which postures (k, n) are too near, in words; of several the nearest, "" where there is none."""
        words, blocked = [""] * len(Q), np.flatnonzero(~self.clear(Q))
        gaps = self.distances(Q[blocked], np.maximum(self.limits, self.wanted)) - self.limits
        for i, row in zip(blocked, gaps, strict=True):
            words[i] = " and ".join(self.names[int(np.nanargmin(row))])
        return words

    def closest(self, task: Task, Q: Matrix, distances: Matrix | None = None) -> PairDistance | None:
        """The two bodies that have the least room over what is asked of them, or are deepest in each other, of all at
        postures (k, n); None where nothing is asked of any.

        distances: those of Q (k, P), where they are known.
        """
        near = np.maximum(self.limits, self.wanted)
        apart = self.distances(Q, near) if distances is None else distances
        judged = counted(apart, self.limits, self.wanted)
        if not np.isfinite(judged).any():
            return None
        i, p = np.unravel_index(int(np.argmin(judged)), judged.shape)
        return self.pair_at(task, Q[i], int(p), float(apart[i, p]))

    def roomiest(self, task: Task, Q: Matrix) -> PairDistance | None:
        """The closest pair at that of postures (k, n) at which it has the most room: at all others it is in the way,
        too, or a nearer one is; None where nothing is asked of any."""
        near = np.maximum(self.limits, self.wanted)
        distances = self.distances(Q, near)
        room = counted(distances, self.limits, self.wanted).min(axis=1, initial=np.inf)
        rows = slice(k := int(np.argmax(room)), k + 1)
        return self.closest(task, Q[rows], distances[rows])

    def pair_at(self, task: Task, q: Vector, p: int, distance: float) -> PairDistance:
        """Pair p at a posture (n,), where its distance [m] is known."""
        return PairDistance(self.names[p], distance, float(self.limits[p]), q, task.pose(q))

    def slopes(self, Q: Matrix, near: float) -> tuple[Matrix, Array]:
        """The distances of pairs that are nearer than `near` (k, P), infinite for others, and their slopes (k, P, n).

        Of points a and b of the two shapes where they are nearest, and n the unit vector from b to a,

            d distance / dq = n . (J_a - J_b)
        """
        frames, robot = joint_frames(self.robot, Q), self.robot
        distances, slopes = np.empty((len(Q), len(self.limits))), np.zeros((len(Q), len(self.limits), robot.n))
        turn, shift = _screws(robot, frames)
        for p, gap in enumerate(self.pairs.gaps):
            nearest = gap.nearest(frames, near)
            distances[:, p] = nearest.distance
            rows = np.isfinite(nearest.distance)
            if not rows.any():
                continue
            # The joints that move one of the two points and not the other.
            above = [joints_above(robot.joints, joint) for joint in gap.joints]
            for sign, own, other, point in ((1.0, *above, nearest.on_one), (-1.0, *above[::-1], nearest.on_other)):
                moving = [i for i in own if i not in other]
                n = nearest.away[rows]
                each = np.einsum("kij,kj->ki", turn[rows][:, moving], np.cross(point[rows], n))
                each += np.einsum("kij,kj->ki", shift[rows][:, moving], n)
                for column, i in enumerate(moving):
                    joint = robot.joints[i]
                    slopes[rows, p, joint.coordinate] += sign * joint.multiplier * each[:, column]
        return distances, slopes


def _screws(robot: Robot, frames: Frames) -> tuple[Array, Array]:
    """z and v (k, joints, 3): a joint moves a point x of what it carries by z x x + v per joint unit."""
    turn, shift = np.zeros((len(frames[0][0]), len(frames), 3)), np.zeros((len(frames[0][0]), len(frames), 3))
    for i, (p, R) in enumerate(frames):
        axis = R @ robot.joints[i].axis
        if robot.joints[i].kind == "prismatic":
            shift[:, i] = axis
        else:
            turn[:, i], shift[:, i] = axis, np.cross(p, axis)
    return turn, shift
