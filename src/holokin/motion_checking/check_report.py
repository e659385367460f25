"""`CheckReport`: what was found of a motion, and what was not looked at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from pathlib import Path
from typing import Any

from ..base.arguments import typed
from ..base.files import write_json
from ..base.printed_units import SI, PrintedUnits
from ..base.shown import Shown
from ..base.types import NoTruthValue, number_or_none

MOST_TOLD = 20
"""Findings in a table; a cyclic motion may have one in every cycle."""


class FindingKind(Enum):
    """What is wrong with a motion; the text is what a table calls it."""

    COLLISION = "collision"
    CLEARANCE = "too near"
    POSITION = "joint limit"
    VELOCITY = "speed"
    ACCELERATION = "acceleration"
    JERK = "jerk"
    SINGULARITY = "near singular"


@dataclass(frozen=True)
class Finding(Shown):
    """Something that a motion does and should not.

    Attributes:
        kind: what it is.
        what: the joint, the two links, or the task that it is about.
        start, stop: when it begins and ends [s].
        time, index: when it is worst [s], and the sample at or just before that.
        value: the worst value: a distance [m], negative for a depth; a joint's position, speed, ...; or rcond.
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
        worst = f"{least if self.is_least else 'worst'} {self.value:.4g} {self.unit}".rstrip()
        wanted = f"{'required:' if self.is_least else 'limit'} {self.limit:.4g} {self.unit}".rstrip()
        return f"{self.kind.value}: {' and '.join(self.what)}, {when}, {worst} at {self.time:.3f} s ({wanted})"


@dataclass(frozen=True)
class Clearance(Shown):
    """How near two things come: `least` found [m] at `time` [s], and `bound`, what it is at least all the way [m].

    Of meshes these are distances of their convex hulls, which are no larger than theirs, as long as they are above the
    clearance that was wanted; below it they are their own. A bound below 0 says nothing of how deep meshes are.
    """

    pair: tuple[str, str]
    least: float
    time: float
    bound: float


@dataclass(frozen=True)
class LeftOut(Shown):
    """Two links whose distance was not looked at, or not held against the clearance, and why."""

    pair: tuple[str, str]
    reason: str


def left_out_words(pairs: Sequence[LeftOut]) -> list[str]:
    """All pairs that were left out, named, a sentence for each reason."""
    found: dict[str, list[str]] = {}
    for one in pairs:
        found.setdefault(one.reason, []).append(" and ".join(one.pair))
    return [f"left out, {reason}: {', '.join(names)}" for reason, names in found.items()]


@dataclass(frozen=True)
class Unseen(Shown):
    """A link without a shape that can be looked at, and why."""

    link: str
    reason: str


@dataclass(frozen=True)
class CheckReport(NoTruthValue, ask="`.passed`"):
    """What `check` found of a motion.

    Attributes:
        findings: sorted by time; none is well.
        samples, duration: of the motion; [s].
        pairs: the clearances of all pairs that were looked at, the nearest first.
        left_out: pairs that were not.
        unseen: links without a shape.
        remarks: what else was not looked at, or was assumed.
    """

    findings: tuple[Finding, ...]
    samples: int
    duration: float
    pairs: tuple[Clearance, ...] = ()
    left_out: tuple[LeftOut, ...] = ()
    unseen: tuple[Unseen, ...] = ()
    remarks: tuple[str, ...] = field(default=())

    @property
    def passed(self) -> bool:
        """True when nothing was found."""
        return not self.findings

    @property
    def clearance(self) -> float:
        """The least distance found [m] of any two links, of a link and the floor or an obstacle; NaN without pairs."""
        return min((pair.least for pair in self.pairs), default=float("nan"))

    @property
    def bound(self) -> float:
        """What the clearance is at least on the whole motion [m], joints going straight from sample to sample."""
        return min((pair.bound for pair in self.pairs), default=float("nan"))

    @typed
    def table(self, units: PrintedUnits = SI) -> str:
        """Lines of text: the findings, the least distance, and what was not looked at."""
        told = [str(finding.printed(units)) for finding in self.findings[:MOST_TOLD]] or ["nothing found"]
        more = len(self.findings) - len(told)
        return "\n".join([*told, *([f"and {more} more"] if more > 0 else []), *self.notes(units)])

    @typed
    def notes(self, units: PrintedUnits = SI) -> list[str]:
        """Sentences: the least distance, what was not looked at, and what was assumed."""
        lines: list[str] = []
        if self.pairs:
            near = self.pairs[0]
            by, unit, digits = units.factor("m"), units.name("m"), 4 if units.length == "m" else 1
            told = f"; on the whole motion at least {by * self.bound:.{digits}f} {unit}" if self.bound > 0 else ""
            least = f"{by * near.least:.{digits}f} {unit}"
            lines.append(
                f"least distance {least}, {' and '.join(near.pair)} at {near.time:.3f} s{told}; {len(self.pairs)} pairs"
            )
        lines += [f"not looked at: {one.link}: {one.reason}" for one in self.unseen]
        return [*lines, *left_out_words(self.left_out), *self.remarks]

    def summary(self) -> dict[str, Any]:
        """JSON-ready facts."""
        return {
            "passed": self.passed, "samples": self.samples, "duration": self.duration,
            "clearance": number_or_none(self.clearance), "bound": number_or_none(self.bound),
            "findings": [vars(one) | {"kind": one.kind.name.lower()} for one in self.findings],
            "pairs": [vars(one) for one in self.pairs], "left_out": [vars(one) for one in self.left_out],
            "unseen": [vars(one) for one in self.unseen], "remarks": list(self.remarks),
        }  # fmt: skip

    @typed
    def save(self, path: str | Path) -> None:
        """Write `summary` as JSON, complete or not at all. Raises: WriteError."""
        write_json(path, self.summary())
