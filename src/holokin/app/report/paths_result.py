"""The findings of a job of several paths: each path as it is gone along, by each rule."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ...base.types import Matrix, Vector
from ...base.units import SI, PrintedUnits
from ...motion import TimedTrajectory
from ...motion.checks import CheckReport, Clearances, Scene
from ...robot import Robot
from .job_result import NotRun


@dataclass(frozen=True, eq=False)
class PathRow:
    """A path as it is gone along, or the way home: by which way it is come to, and what checks find.

    sheet: its number, 0 of the way home. length: of the path [m]. air, own: the timed motions, None where nothing
    moves. reports: of both. level: of the rule.
    """

    name: str
    sheet: int
    level: Vector
    length: float
    way: str
    air: TimedTrajectory | None
    own: TimedTrajectory | None
    reports: tuple[CheckReport, ...]

    @property
    def clearance(self) -> float:
        """The least distance that checks find [m], of the path and of the way to it; NaN where none was looked at."""
        return min((report.clearance for report in self.reports), default=float("nan"))


@dataclass(frozen=True, eq=False)
class RuleResult:
    """All paths by one rule: the rows in their order, what was left out and why, the whole motion.

    sentence: how often the sheet changes, and in which sense that is the least.
    """

    name: str
    rows: tuple[PathRow, ...]
    left_out: Mapping[str, str]
    sentence: str
    changes: int
    exact: bool
    motion: TimedTrajectory

    @property
    def passed(self) -> bool:
        """Whether every path is gone along, and the checks find nothing."""
        return not self.left_out and all(report.passed for row in self.rows for report in row.reports)


@dataclass(frozen=True, eq=False)
class PathsResult:
    """The findings of a job of several paths.

    robot: as it is checked, `shown` as it is drawn. tip: the name of its tool. scene: what it is held apart from, None
    where nothing was checked.
    """

    name: str
    title: str
    about: str
    robot: Robot
    shown: Robot
    task: str
    tip: str
    q0: Vector
    rules: tuple[RuleResult, ...]
    seconds: float
    scene: Scene | None = None
    not_run: tuple[NotRun, ...] = ()
    notes: tuple[str, ...] = field(default=())
    units: PrintedUnits = SI

    @property
    def passed(self) -> bool:
        """Whether every rule goes along every path, and the checks find nothing."""
        return not self.not_run and all(rule.passed for rule in self.rules)

    def distances(self, Q: Matrix) -> Vector:
        """The least distance between the shapes of the checks at postures (k, n) -> (k,) [m]."""
        if self.scene is None or not self.robot.tips:
            return np.full(len(Q), np.inf)
        return Clearances.of(self.robot, self.scene).least(Q, np.inf)

    def reworded(self, text: str) -> str:
        """A text of these results in the units in which they are printed."""
        return self.units.reworded(text, [(c.name, c.unit) for c in self.robot.coordinates])

    @property
    def exit_code(self) -> int:
        """0: all paths are gone along, clear; 1: some are not; 2: a rule goes along none."""
        return 2 if self.not_run else 0 if self.passed else 1
