"""What a job found: values for reports and plots to read."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from ...analysis.coverage import Coverage, Slice
from ...analysis.curvature import Verdict
from ...base.printed_units import SI, PrintedUnits
from ...base.types import NoTruthValue, Vector, number_or_none
from ...motion import TimedTrajectory
from ...motion.checks import CheckReport
from ...motion.trajectory import Status, Trajectory
from ...path.synchronized_paths import AnyPath
from ...robot import LinkShape, Robot
from .sheets_result import SheetsResult


@dataclass(frozen=True)
class Check(NoTruthValue, ask="`.passed`"):
    """One expectation: what was wanted, what was found."""

    metric: str
    wanted: str
    found: str
    passed: bool

    @property
    def unmet(self) -> str:
        """What is not as expected; unless the job says otherwise, a path must be followed to its end."""
        if self.metric == "completes" and self.wanted == "true":
            return f"the path was not followed to its end ({self.found})"
        if self.metric == "completes":
            return "the path was followed to its end, but the job says completes = false"
        return f"expected {self.metric} {self.wanted}, found {self.found}"


@dataclass(frozen=True, eq=False)
class StrategyResult:
    """One strategy in a job: its verdict, its two paths (clockwise, counter-clockwise), its cycles, metrics, checks.

    coverage, slices: of the job's workspace, where it has one and the strategy has leaves. timed: the cycles as the
    job's [timing] has them, where it has one and they were followed to their end. motion_check: what [checks] found,
    which look at the share `followed` of the path, all of it unless the law stopped.

    `group` is its name in the job; results of one group differ in the orientation representation only.
    """

    name: str
    group: str
    verdict: Verdict
    two_paths: tuple[Trajectory, Trajectory] | None
    cycles: Trajectory
    status: Status
    trouble: str
    metrics: dict[str, float]
    checks: tuple[Check, ...] = field(default=())
    coverage: Coverage | None = None
    slices: tuple[Slice, ...] = ()
    timed: TimedTrajectory | None = None
    motion_check: CheckReport | None = None
    followed: float = 1.0

    @property
    def passed(self) -> bool:
        """True when every expectation holds, and the checks of its motion found nothing."""
        looked_at = self.motion_check is None or self.motion_check.passed
        return looked_at and all(check.passed for check in self.checks)

    def trajectories(self) -> dict[str, Trajectory]:
        """All trajectories by a short name."""
        named = {"cycles": self.cycles}
        if self.two_paths is not None:
            named |= {"clockwise": self.two_paths[0], "counter-clockwise": self.two_paths[1]}
        return named

    def summary(self) -> dict[str, Any]:
        """JSON-ready facts."""
        v = self.verdict
        return {
            "name": self.name,
            "status": self.status.name.lower(),
            "trouble": self.trouble,
            "holonomic": v.holonomic,
            "defect": v.defect,
            "defect_unit": v.unit,
            "relative_defect": v.relative,
            "witness": v.witness.tolist(),
            "plane": list(v.plane),
            "metrics": {key: number_or_none(value) for key, value in self.metrics.items()},
            "drift_each_cycle": self.cycles.drift().tolist(),
            "coverage": self.coverage.summary() if self.coverage is not None else None,
            "timing": self.timed.summary() if self.timed is not None else None,
            "motion_check": self.motion_check.summary() if self.motion_check is not None else None,
            "followed": self.followed,
            "checks": [vars(check) for check in self.checks],
            "passed": self.passed,
        }


@dataclass(frozen=True)
class NotRun:
    """A strategy that could not be run, and why."""

    name: str
    reason: str


@dataclass(frozen=True, eq=False)
class JobResult:
    """A whole job's findings.

    obstacles: those of [checks] that stand still. one_way: why its path has no two paths to a pose, at which joints
    could be compared, or empty. meanings: of the metrics of its strategies; [joint] there stands for the joints' unit.
    units: in which it is printed; all values here are in rad and m. sheets: what was found of [sheets], None in a job
    without.
    """

    name: str
    title: str
    about: str
    robot: Robot
    task: str
    q0: Vector
    path: AnyPath
    cycles: int
    strategies: tuple[StrategyResult, ...]
    seconds: float
    not_run: tuple[NotRun, ...] = ()
    workspace: str = ""
    obstacles: tuple[LinkShape, ...] = ()
    one_way: str = ""
    meanings: Mapping[str, str] = field(default_factory=dict)
    units: PrintedUnits = SI
    sheets: SheetsResult | None = None

    @property
    def joint_unit(self) -> tuple[str, float]:
        """The unit in which figures of all joints are printed, and by what they are multiplied for that."""
        return self.units.together(c.unit for c in self.robot.coordinates)

    @property
    def row_unit(self) -> tuple[str, float]:
        """The same of figures of all rows of the task."""
        return self.units.together(unit for s in self.strategies for unit in s.cycles.row_units)

    def factor(self, metric: str) -> float:
        """By what a metric is multiplied to be printed: its meaning says its unit."""
        found = re.search(r"\[([^\]]+)\]$", self.meanings.get(metric, ""))
        known = {"joint": self.joint_unit[1], "m or rad": self.row_unit[1], "m": self.units.factor("m")}
        return known.get(found[1], 1.0) if found else 1.0

    def meaning(self, metric: str) -> str:
        """What a metric is, with its unit as it is printed."""
        text = self.meanings[metric].replace("[joint]", f"[{self.joint_unit[0]}]")
        return text.replace("[m or rad]", f"[{self.row_unit[0]}]").replace("[m]", f"[{self.units.length}]")

    @cached_property
    def printed(self) -> JobResult:
        """The same with the motions of its strategies in the units in which it is printed: for figures of them."""
        if self.units.plain:
            return self
        found = []
        for s in self.strategies:
            pair = s.two_paths and (s.two_paths[0].printed(self.units), s.two_paths[1].printed(self.units))
            found.append(replace(s, two_paths=pair, cycles=s.cycles.printed(self.units)))
        return replace(self, strategies=tuple(found))

    @property
    def drawn(self) -> tuple[StrategyResult, ...]:
        """The first result of each group: further representations would draw the same picture."""
        return tuple({result.group: result for result in reversed(self.strategies)}.values())[::-1]

    @property
    def passed(self) -> bool:
        """True when every strategy could be run, every expectation of each holds, and sheets serve what they should."""
        served = self.sheets is None or self.sheets.passed
        return not self.not_run and served and all(result.passed for result in self.strategies)

    @property
    def exit_code(self) -> int:
        """0: as expected; 1: an expectation fails; 2: a strategy could not be run, whatever the others do."""
        return 2 if self.not_run else 0 if self.passed else 1

    @cached_property
    def stems(self) -> dict[str, str]:
        """What the files of each strategy begin with: its name without what file names do not hold.

        Numbered where two strategies would write one file, also on disks that do not tell A from a.
        """
        return _file_stems({strategy.name: strategy.trajectories() for strategy in self.strategies})


def _file_stems(named: Mapping[str, Iterable[str]]) -> dict[str, str]:
    """Name -> the STEM of its files STEM-KEY, unlike those of the others; for names with the keys of their files."""
    stems: dict[str, str] = {}
    taken: set[str] = set()
    for name, keys in named.items():
        word = re.sub(r"[\W_]+", "-", name).strip("-")
        base = word.encode()[:80].decode(errors="ignore") or "strategy"  # a file's name may have 255 bytes
        stem, number = base, 1
        while taken & (files := {f"{stem}-{key}".casefold() for key in keys}):
            number += 1
            stem = f"{base}-{number}"
        stems[name] = stem
        taken |= files
    return stems
