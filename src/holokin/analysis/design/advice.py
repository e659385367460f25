"""`Advice`: laws for a robot and a workspace, the best first, and what speaks for the best."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar

import numpy as np

from ...base.types import Flags, NoTruthValue, Value, Vector, number_or_none
from ...path.workspaces import Box, PoseRange, Workspace
from ...strategies import HolonomicStrategy
from ...strategies.tasks.task import Task
from ..coverage.coverage_result import Coverage
from ..coverage.starts import kinds_that_fit
from ..coverage.tips import Chain
from .nearby_cusps import NearbyCusps
from .serving_levels import LevelRange

EQUAL = 0.02
"""Difference of coverage up to which two laws cover alike: five of 256 poses, which other poses would decide
otherwise."""

EASY = 0.05
"""Difference of the share that is served away from limits and singular postures up to which it counts as alike."""

ROOM = 0.02
"""Share of a joint's range to its limit from which on a posture keeps away from limits: 6 degrees of 300."""

REGULAR = 0.01
"""rcond from which on a posture keeps away from singular ones: joints are then at most a hundred times as fast."""

PROVABLE = 0.01
"""Clearance [m] beyond that asked for from which on a posture keeps well clear: what `certify` proves of a Panda was a
centimetre less than the least at many poses."""

CLOSE = 0.03
"""Excess of mean squared joint speed over the least possible that is called close: 1.5 % of speed."""


class Ranked(Protocol):
    """What laws are ranked by."""

    @property
    def coverage(self) -> float:
        """Share of the poses that are served."""
        ...

    @property
    def clear(self) -> float:
        """Share of the poses that are served with a clearance that can be proven; 1 where none is asked for."""
        ...

    @property
    def easy(self) -> float:
        """Share of the poses that are served away from limits and singular postures."""
        ...

    @property
    def squared_speed(self) -> float:
        """Mean squared joint speed."""
        ...


Entry = TypeVar("Entry", bound=Ranked)


def ranked(entries: Iterable[Entry]) -> list[Entry]:
    """The best first: by coverage; of those that cover alike, by the share that is served well clear of what stands
    round; of those alike in this, too, by the share that is served away from limits and singular postures; of those
    alike in all this by joint speed.
    """
    found: list[Entry] = []
    for group in _alike(entries, lambda one: one.coverage, EQUAL):
        for clear in _alike(group, _clear, EQUAL):
            for part in _alike(clear, lambda one: one.easy, EASY):
                found += sorted(part, key=lambda one: one.squared_speed)
    return found


def alike(one: Ranked, other: Ranked) -> bool:
    """Whether two cover alike, and serve alike shares well clear, and away from limits and singular postures."""
    same = abs(one.coverage - other.coverage) <= EQUAL and abs(_clear(one) - _clear(other)) <= EQUAL
    return same and abs(one.easy - other.easy) <= EASY


def _clear(one: Ranked) -> float:
    """The share that is well clear, and more where it is all: what is not clear somewhere cannot be proven."""
    return one.clear if one.clear < 1 else 1 + 2 * EQUAL


def _alike(entries: Iterable[Entry], share: Callable[[Entry], float], apart: float) -> Iterator[list[Entry]]:
    """Groups of entries whose shares are nearly those of the best in them, the best first."""
    left = list(entries)
    while left:
        least = max(map(share, left)) - apart
        yield [one for one in left if share(one) >= least]
        left = [one for one in left if share(one) < least]


@dataclass(frozen=True, eq=False)
class Law(Value):
    """A law on one leaf, and what it does in the workspace.

    same: names of laws that are this one there: their G is the same at every pose. keys: what a job file says of it.
    q0: the posture that its leaf goes through (n,). coverage: share of the poses that it reaches within the joint
    limits, `served` (k,); easy: of these, those away from limits and singular postures. margin: the least distance to
    a limit over the joint's range, of `joint`; inf without limits. rcond: the least of [J; J_g]; NaN where it was not
    looked at. squared_speed: mean squared joint speed [rad^2/m^2]; speed: that over the least of the postures found
    there. clearance: the least distance of two shapes [m] at the poses that it reaches within the joint limits; inf
    where nothing was asked of it. clear: share of the poses that are served with 0.01 m more of it than was asked for.
    """

    name: str
    same: tuple[str, ...]
    keys: Mapping[str, Any]
    strategy: HolonomicStrategy
    q0: Vector
    coverage: float
    served: Flags
    easy: float
    margin: float
    joint: str
    rcond: float
    squared_speed: float
    speed: float
    clearance: float = np.inf
    clear: float = 1.0

    @property
    def sentence(self) -> str:
        """What it does, in words."""
        said = f"it reaches {self.coverage:.1%} of the workspace within the joint limits"
        if not self.served.any():
            return said
        if np.isfinite(self.margin):
            said += f", the joint nearest to a limit is {self.joint}, at a distance of {self.margin:.1%} of its range"
        if np.isfinite(self.rcond):
            said += f", rcond is {self.rcond:.2g} at least"
        if np.isfinite(self.clearance):
            said += f", shapes come to {self.clearance:.3f} m of each other"
        return f"{said}, and its mean squared joint speed is {self.speed - 1:.1%} above the least found there"


@dataclass(frozen=True, eq=False)
class Part(Value):
    """The largest part of a workspace, round its centre, that one law serves: `share` of its sizes."""

    law: Law
    share: float
    workspace: PoseRange


@dataclass(frozen=True, eq=False)
class Advice(NoTruthValue, Value, ask="`.best.coverage`"):
    """Laws that fit a robot, compared on a workspace, the best first.

    chain: the robot, its base and its tip. proposed: which of tip, task, start and workspace were not given but chosen.
    floor: the least mean squared joint speed of the postures found at the poses, where the best one serves
    [rad^2/m^2]. coverage: of the best. reasons: sentences on the best. cusps: those found on its leaf, and how near to
    the workspace they are. part: the largest part of the workspace that a law
    serves, where none serves the whole. levels: those of the best law that serve the workspace, where they were asked
    for and it has one row. asked: what shapes are to keep clear of, as arguments of `certify`; empty where nothing is.
    """

    chain: Chain
    task: Task
    workspace: Workspace
    proposed: tuple[str, ...]
    laws: tuple[Law, ...]
    floor: float
    coverage: Coverage
    reasons: tuple[str, ...]
    cusps: NearbyCusps
    part: Part | None
    seconds: float
    levels: LevelRange | None = None
    asked: Mapping[str, Any] = field(default_factory=dict)

    @property
    def best(self) -> Law:
        """The law to take."""
        return self.laws[0]

    @property
    def q0(self) -> Vector:
        """The posture (n,) to begin at with the best law."""
        return self.best.q0

    def __str__(self) -> str:
        return "\n".join([self.subject, *self.reasons, *filter(None, [self.certify_by])])

    @property
    def certify_by(self) -> str:
        """The call that proves what was looked at here pose by pose, with this as `advice`; empty for `radial`, and
        where no pose is served.
        """
        if self.best.strategy.constraint.looped is not None or not self.best.served.any():
            return ""
        more, space = ", **advice.asked" if self.asked else "", self.workspace
        if not isinstance(space, PoseRange) or not isinstance(space.solid, Box):
            return f"Certify it by: hk.unique_region(advice.best.strategy, advice.q0{more})"
        if not self.best.served.all():
            call = f"hk.unique_region(advice.best.strategy, advice.q0, advice.workspace{more})"
            return f"Certify what it serves by: {call}"
        return f"Certify it by: hk.certify(advice.best.strategy, advice.workspace, advice.q0{more})"

    @property
    def subject(self) -> str:
        """What was asked about: the robot and its tip, the task, the workspace."""
        return f"{self.chain}. Task: {self.work}. Workspace: {self.workspace}."

    @property
    def work(self) -> str:
        """The task in words, with the axis about which the tool may spin."""
        axis = getattr(self.task, "axis", None)
        if self.task.orientation != "axis" or axis is None:
            return self.task.name
        names = {(1.0, 0.0, 0.0): "x", (0.0, 1.0, 0.0): "y", (0.0, 0.0, 1.0): "z"}
        which = names.get(tuple(np.asarray(axis).tolist()))
        said = f"its {which} axis" if which else f"the axis [{', '.join(f'{v:.4g}' for v in axis)}] of its frame"
        return f"{self.task.name}, the tool free to spin about {said}"

    @property
    def offers(self) -> str:
        """Which tasks there are for this robot, in words; empty where the task is the whole pose, or was given."""
        kinds = kinds_that_fit(self.task.robot)
        if "task" not in self.proposed or "pose" in kinds or not kinds:
            return ""
        said = {
            "axis": "'axis' holds the tool's point and the direction of its z axis, as for a torch",
            "position": "'position' holds the tool's point",
        }
        few = f"{self.task.n} joints leave none free for a whole pose ('pose')"
        return f"{few}; of the other tasks {', '.join(said[kind] for kind in kinds)}"

    def summary(self) -> dict[str, Any]:
        """JSON-ready facts."""
        return {
            "robot": self.task.robot.name, "base": self.chain.base, "tip": self.chain.tip,
            "other_tips": list(self.chain.others), "task": self.task.name, "workspace": str(self.workspace),
            "cusp_distance": number_or_none(self.cusps.away),
            "levels": None if self.levels is None else [list(ends) for ends in self.levels.intervals],
            "floor": number_or_none(self.floor),
            "proposed": list(self.proposed), "reasons": list(self.reasons),
            "laws": [
                {
                    "name": law.name, "same": list(law.same), "coverage": law.coverage, "joint": law.joint,
                    "margin": number_or_none(law.margin),
                    "rcond": number_or_none(law.rcond),
                    "squared_speed": number_or_none(law.squared_speed),
                    "speed": number_or_none(law.speed), "start": law.q0.tolist(),
                    "clearance": number_or_none(law.clearance), "clear": law.clear,
                }
                for law in self.laws
            ],
        }  # fmt: skip
