"""`CheckReport`: what was found of a motion, and what was not looked at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, NotFiniteError, brief
from ...base.files import write_json
from ...base.types import Array, Flags, Matrix, NoTruthValue, Shown, Value, Vector, number_or_none
from ...base.units import SI, PrintedUnits
from ...robot import Robot
from .. import TimedTrajectory
from ..trajectory import Recording, Trajectory

MOST_SHOWN = 20
"""Findings in a table; a cyclic motion may have one in every cycle."""

UNREAD_CURE = (
    "put the files where the robot's file says, let a capsule stand for such a link (a radius for its joint, by name), "
    'or allow the link to touch all others ("NAME, *")'
)
"""What helps where shapes could not be read."""


class FindingKind(Enum):
    """What is wrong with a motion; the text is what a table calls it."""

    COLLISION = "collision"
    CLEARANCE = "too near"
    POSITION = "joint limit"
    VELOCITY = "speed"
    ACCELERATION = "acceleration"
    JERK = "jerk"
    SINGULARITY = "near singular"
    JUMP = "jump of posture"


@dataclass(frozen=True)
class Finding(Shown):
    """Something that a motion does and should not.

    Attributes:
        kind: what it is.
        what: the joint, the two links, or the task that it is about; of a jump the joint that moves most.
        start, stop: when it begins and ends [s].
        time, index: when it is worst [s], and the sample at or just before that.
        value: the worst value: a distance [m], negative for a depth; a joint's position, speed, ...; rcond; or how far
            the tool is off its straight way in the middle of a jump.
        limit: what it is held against, in the same unit.
        unit: of both.
    """

    kind: FindingKind
    what: tuple[str, ...]
    start: float
    stop: float
    time: float
    index: int
    value: float
    limit: float
    unit: str

    @property
    def is_least(self) -> bool:
        """True where the limit is a least value, and not a largest one."""
        return self.kind in (FindingKind.COLLISION, FindingKind.CLEARANCE, FindingKind.SINGULARITY)

    @typed
    def printed(self, units: PrintedUnits) -> Finding:
        """The same in other units."""
        by = units.factor(self.unit)
        return replace(self, value=by * self.value, limit=by * self.limit, unit=units.name(self.unit))

    def __str__(self) -> str:
        when = f"{self.start:.3f} to {self.stop:.3f} s" if self.stop > self.start else f"{self.start:.3f} s"
        least = "least rcond" if self.kind is FindingKind.SINGULARITY else "least distance"
        most = "the tool off its way by" if self.kind is FindingKind.JUMP else "worst"
        worst = f"{least if self.is_least else most} {self.value:.4g} {self.unit}".rstrip()
        wanted = f"{'required:' if self.is_least else 'limit'} {self.limit:.4g} {self.unit}".rstrip()
        return f"{self.kind.value}: {' and '.join(self.what)}, {when}, {worst} at {self.time:.3f} s ({wanted})"


@dataclass(frozen=True)
class Clearance(Shown):
    """How near two things come: `least` [m] at `time` [s], and `bound`, what it is at least all the way [m].

    wanted: the distance it is held against [m]; 0 where two are always nearer than the clearance, so that only a
    collision is reported.

    Of meshes these are distances of their convex hulls, which are no larger than theirs, as long as they are above the
    clearance that was wanted; below it they are their own. A bound below 0 says nothing of how deep meshes are.
    """

    pair: tuple[str, str]
    least: float
    time: float
    bound: float
    wanted: float


@dataclass(frozen=True)
class LeftOut(Shown):
    """Two links whose distance was not looked at, or not held against the clearance, and why."""

    pair: tuple[str, str]
    reason: str


def left_out_words(pairs: Sequence[LeftOut]) -> list[str]:
    """All pairs that were left out, named, a sentence for each reason."""
    names: dict[str, list[str]] = {}
    for left_out in pairs:
        names.setdefault(left_out.reason, []).append(" and ".join(left_out.pair))
    return [f"left out, {reason}: {', '.join(those)}" for reason, those in names.items()]


@dataclass(frozen=True)
class Unseen(Shown):
    """A link without a shape that can be looked at, and why.

    unread: whether its file has a shape for it that was to be looked at and could not be read: then nothing is known
    of it.
    """

    link: str
    reason: str
    unread: bool = False


def cannot_tell(unseen: Sequence[Unseen]) -> str:
    """The verdict on distances where shapes could not be read; empty where all were."""
    names = dict.fromkeys(link.link for link in unseen if link.unread)
    return f"cannot tell: the shapes of {brief(', '.join(names))} could not be read" if names else ""


def keeps(distances: Array | float, limits: Array | float) -> Flags:
    """Which distances [m] keep their limits [m]. Two things that touch collide, whatever is asked of them."""
    return np.greater_equal(distances, limits) & np.greater(distances, 0)


def counted(distances: Array | float, limits: Array | float, wanted: float) -> Array:
    """The distances (..., P) [m] of pairs that tell the clearance, less their padding; infinite for the others.

    Args:
        limits: what is asked of each pair (P,) [m]: a pair that is always nearer than is `wanted` is not held against
            it, and counts only where it touches; one of which more is asked is padded.
    """
    padded = distances - np.maximum(np.subtract(limits, wanted), 0.0)
    return np.where(np.less(limits, wanted) & np.greater(distances, 0), np.inf, padded)


@dataclass(frozen=True)
class CheckReport(NoTruthValue, ask="`.passed`"):
    """What `check` found of a motion.

    Attributes:
        findings: sorted by time; empty where all is well.
        samples, duration: of the motion; [s].
        wanted: the clearance that was asked for [m].
        pairs: the clearances of all pairs that were looked at, the nearest first.
        left_out: pairs that were not.
        unseen: links without a shape.
        remarks: what else was not looked at, or was assumed.
        observations: what the motion does that is no fault: self-motions, and large steps where no task was given.
    """

    findings: tuple[Finding, ...]
    samples: int
    duration: float
    wanted: float = 0.0
    pairs: tuple[Clearance, ...] = ()
    left_out: tuple[LeftOut, ...] = ()
    unseen: tuple[Unseen, ...] = ()
    remarks: tuple[str, ...] = field(default=())
    observations: tuple[str, ...] = field(default=())

    @property
    def passed(self) -> bool:
        """True when nothing was found, and the shapes of all links were read that were to be looked at."""
        return not self.findings and not self.unread

    @property
    def unread(self) -> str:
        """That nothing can be told of links whose shapes could not be read; empty where all were."""
        return cannot_tell(self.unseen)

    @property
    def trouble(self) -> str:
        """Why the motion does not pass, in a sentence: the first finding, or what cannot be told; empty if it does."""
        return str(self.findings[0]) if self.findings else self.unread

    @property
    def nearest(self) -> Clearance | None:
        """The pair that gives the least distance: of those held against the clearance, and those that touch."""
        return min(self._judged, key=lambda pair: pair.least, default=None)

    @property
    def _judged(self) -> list[Clearance]:
        """The pairs that are held against the clearance, and those that touch."""
        return [pair for pair in self.pairs if np.isfinite(counted(pair.least, pair.wanted, self.wanted))]

    @property
    def clearance(self) -> float:
        """The least distance [m], that of `nearest`.

        NaN where no pair was held against the clearance, or where shapes could not be read.
        """
        return float("nan") if self.nearest is None or self.unread else self.nearest.least

    @property
    def bound(self) -> float:
        """What `clearance` is at least on the whole motion [m], joints going straight from sample to sample."""
        bounds = [pair.bound for pair in self._judged]
        return float("nan") if self.unread else min(bounds, default=float("nan"))

    def __str__(self) -> str:
        return self.table()

    @typed
    def table(self, units: PrintedUnits = SI) -> str:
        """Lines of text: the findings, the least distance, and what was not looked at."""
        return "\n".join([*self.told(units), *self.notes(units)])

    @typed
    def told(self, units: PrintedUnits = SI) -> list[str]:
        """The findings as sentences, the first of many; and that nothing was found, or that it cannot be told."""
        sentences = [str(finding.printed(units)) for finding in self.findings[:MOST_SHOWN]]
        more = len(self.findings) - len(sentences)
        sentences += [f"and {more} more"] if more > 0 else []
        return [*sentences, f"{self.unread}; {UNREAD_CURE}"] if self.unread else sentences or ["nothing found"]

    @typed
    def notes(self, units: PrintedUnits = SI) -> list[str]:
        """Sentences: the least distance, what was not looked at, and what was assumed."""
        lines: list[str] = []
        if near := self.nearest:
            by, unit, digits = units.factor("m"), units.name("m"), 4 if units.length == "m" else 1
            bound = f", and at least {by * self.bound:.{digits}f} {unit} between samples" if self.bound > 0 else ""
            least = f"{'of what was read: ' if self.unread else ''}least distance {by * near.least:.{digits}f} {unit}"
            at = f"between {' and '.join(near.pair)} at {near.time:.3f} s"
            lines.append(f"{least}, {at}{bound}; {len(self.pairs)} pairs")
        lines += [f"not looked at: {link.link}: {link.reason}" for link in self.unseen]
        return [*self.observations, *lines, *left_out_words(self.left_out), *self.remarks]

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready facts."""
        facts = {what: getattr(self, what) for what in ("passed", "unread", "samples", "duration", "wanted")}
        facts |= {what: number_or_none(getattr(self, what)) for what in ("clearance", "bound")}
        facts["findings"] = [vars(finding) | {"kind": finding.kind.name.lower()} for finding in self.findings]
        facts |= {what: [vars(part) for part in getattr(self, what)] for what in ("pairs", "left_out", "unseen")}
        return facts | {what: list(getattr(self, what)) for what in ("remarks", "observations")}

    @typed
    def save(self, path: str | Path) -> None:
        """Write `to_dict` as JSON, complete or not at all. Raises: WriteError."""
        write_json(path, self.to_dict())


# --- What `check` looks at: the samples of a trajectory, a timed one, a recording, or postures alone.

RATES = (FindingKind.VELOCITY, FindingKind.ACCELERATION, FindingKind.JERK)

Rate = tuple[FindingKind, Matrix, Vector, str]
"""A derivative of the joints (k, n), its limits (n,), and what its unit has after that of the joint."""


@dataclass(frozen=True, eq=False)
class Motion(Value):
    """Joints q (k, n) at times t (k,) [s], and their rates with limits.

    samples (s, n): the postures between whose neighbours a jump may be: those from which a timed motion was made, and
    q of all others.
    """

    t: Vector
    q: Matrix
    rates: tuple[Rate, ...]
    remarks: tuple[str, ...] = ()
    untimed: Matrix | None = None

    @property
    def samples(self) -> Matrix:
        """As above."""
        return self.q if self.untimed is None else self.untimed

    def index(self, k: int) -> int:
        """Where the motion is at the k-th of `samples`, or nearest to it."""
        return k if self.untimed is None else int(np.argmin(np.abs(self.q - self.untimed[k]).max(axis=1)))

    def time(self, k: int) -> float:
        """When that is [s]."""
        return float(self.t[self.index(k)])


def robot_of(given: Any, robot: Robot | None) -> Robot:
    """The robot that is given, or that of a trajectory. Raises: ArgumentError: there is none."""
    trajectory = given.untimed if isinstance(given, TimedTrajectory) else given
    its_robot = robot or getattr(trajectory, "robot", None)
    if its_robot is None:
        raise ArgumentError("the robot of the motion", None, "give robot=: postures and recordings have none")
    return its_robot


def motion_of(given: Any, robot: Robot) -> Motion:
    """The samples of a motion. Raises: ArgumentError, ShapeError, NotFiniteError: it is none of this robot."""
    names = getattr(given, "joint_names", robot.joint_names)
    if tuple(names) != robot.joint_names:
        raise ArgumentError("the robot", robot.name, f"give the one that moves {', '.join(map(str, names))}")
    if isinstance(given, TimedTrajectory):
        limits = given.limits
        bounds = limits.velocity, limits.acceleration, limits.jerk
        rates = zip(RATES, (given.dq, given.ddq, given.dddq), bounds, ("/s", "/s^2", "/s^3"), strict=True)
        return Motion(given.t, given.q, tuple(rates), untimed=given.untimed.q)
    if isinstance(given, Trajectory):
        return Motion(given.t, given.q, ((RATES[0], given.dq, robot.max_velocity, "/s"),))
    if isinstance(given, Recording):
        if len(given) < 2:
            return Motion(given.t, given.q, ())
        remarks = ("speeds are differences of successive samples",)
        steps = np.diff(given.q, axis=0) / np.diff(given.t)[:, None]
        rates = (RATES[0], np.vstack([steps, steps[-1:]]), robot.max_velocity, "/s")
        return Motion(given.t, given.q, (rates,), remarks)
    q = robot.postures(given)
    if not np.isfinite(q).all():
        raise NotFiniteError("the postures", q[~np.isfinite(q)][:3].tolist())
    return Motion(np.arange(len(q), dtype=float), q, (), ("times are the numbers of the postures",))
