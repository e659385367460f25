"""The metrics of a strategy in a job: each with its meaning, how it is measured, and why it may not be known.

A new metric is one more entry of `METRICS`: the report shows it, and `[expect.NAME]` of a job file may bound it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...base.types import Vector
from ...motion.trajectory import Status, Trajectory, over_least_speed
from ...path.editing import AnyPath
from ...strategies import HolonomicStrategy, Strategy
from ...symbolic import Function
from ..report.job_result import StrategyResult


@dataclass(frozen=True, eq=False)
class Run:
    """One strategy of a job, and what was found of it; invariant: q -> those that its joint paths must keep."""

    strategy: Strategy
    path: AnyPath
    invariant: Function | None
    found: StrategyResult

    @property
    def cycles(self) -> Trajectory:
        """The cycles."""
        return self.found.cycles

    @property
    def walks(self) -> list[Trajectory]:
        """The cycles and the two paths."""
        return list(self.found.trajectories().values())

    def measured(self) -> dict[str, float]:
        """All metrics; NaN where the job has none."""
        return {key: metric.of(self) for key, metric in METRICS.items()}


@dataclass(frozen=True)
class Metric:
    """[joint] in `meaning` stands for the joints' unit; `unknown` says why `of` may be NaN."""

    meaning: str
    of: Callable[[Run], float]
    unknown: str = "no cycle was done to its end"


def _of_drifts(figure: Callable[[Vector], float]) -> Callable[[Run], float]:
    """A figure of the largest joint's drift in each cycle (cycles,)."""

    def of(run: Run) -> float:
        known = run.path.closed and run.cycles.cycles
        return float(figure(np.abs(run.cycles.drift()).max(axis=1))) if known else np.nan

    return of


def _drift_total(run: Run) -> float:
    known = run.path.closed and run.cycles.cycles
    return float(np.abs(run.cycles.drift_since_start()[-1]).max()) if known else np.nan


def _spread(run: Run) -> float:
    pair = run.found.two_paths
    if pair is None or any(path.status is not Status.COMPLETE for path in pair):
        return np.nan
    return float(np.abs(pair[0].q[-1] - pair[1].q[-1]).max())


def _tracking(run: Run) -> float:
    return max(w.tracking_error(unit) for w in run.walks for unit in dict.fromkeys(w.row_units))


def _peak_speed(run: Run) -> float:
    limits = run.strategy.task.robot.max_velocity  # without one of them the greatest share is not known
    return max(float((np.abs(w.dq) / limits).max()) for w in run.walks) if np.isfinite(limits).all() else np.nan


def _residual(run: Run) -> float:
    leaves = isinstance(run.strategy, HolonomicStrategy)
    return max(float(w.residual.max()) for w in run.walks) if leaves else np.nan


def _invariant(run: Run) -> float:
    if run.invariant is None:
        return np.nan
    values = [run.invariant.batch(w.q).reshape(len(w), -1) for w in run.walks]
    return max(float(np.abs(v - values[0][0]).max()) for v in values)


def _coverage_rcond(run: Run) -> float:
    covers = run.found.coverage
    return float(covers.rcond[covers.reached].min()) if covers is not None and covers.reached.any() else np.nan


METRICS: dict[str, Metric] = {
    "defect": Metric(
        "curvature near the start, its largest (defect): joint error of a small loop over its area",
        lambda run: run.found.verdict.defect,
    ),
    "drift": Metric("drift of the first cycle: its largest joint's [joint]", _of_drifts(lambda each: each[0])),
    "drift_mean": Metric("mean over the cycles of each one's drift [joint]", _of_drifts(np.mean)),
    "drift_total": Metric("largest joint's distance from the start after the last cycle [joint]", _drift_total),
    "drift_least": Metric("least of the cycles' drifts [joint]", _of_drifts(np.min)),
    "drift_most": Metric("greatest of the cycles' drifts [joint]", _of_drifts(np.max)),
    "spread": Metric(
        "largest joint difference between the two paths [joint]", _spread,
        "the path has no two paths, or not both were gone to their end",
    ),
    "tracking": Metric("worst tracking error [m or rad]", _tracking),
    "sigma": Metric(
        "least singular value of the task Jacobian", lambda run: min(float(w.sigma.min()) for w in run.walks)
    ),
    "speed": Metric(
        "joint speed (rms) over that of the pseudo-inverse",
        lambda run: over_least_speed(run.strategy.task, run.cycles),
        "the path has no length",
    ),
    "peak_speed": Metric(
        "greatest joint speed over that joint's limit", _peak_speed, "a joint has no speed limit"
    ),
    "residual": Metric(
        "how far the joints left their leaf: the largest change of g(q)", _residual, "the strategy has no leaves"
    ),
    "invariant": Metric("largest change of the given invariants", _invariant, "the strategy names none"),
    "same_joints": Metric(
        "largest joint difference between orientation representations [joint]",
        lambda _run: np.nan,  # of several runs: see `apart`
        "there is one representation",
    ),
    "coverage": Metric(
        "share of the workspace that the leaf reaches",
        lambda run: run.found.coverage.share if run.found.coverage is not None else np.nan,
        "the strategy has no leaves",
    ),
    "coverage_rcond": Metric(
        "least rcond of [J; J_g] over the poses of the workspace that it reaches", _coverage_rcond,
        "it reaches none of the poses, or has no leaves",
    ),
    "time": Metric(
        "seconds that the cycles take within the limits of [timing]",
        lambda run: run.found.timed.duration if run.found.timed is not None else np.nan,
    ),
    "clearance": Metric(
        "least distance of two links, or of a link and the floor or an obstacle [m]",
        lambda run: run.found.motion_check.clearance if run.found.motion_check is not None else np.nan,
        "[checks] hold no pair against a clearance, or could not read a shape",
    ),
    "limit_distance": Metric(
        "least distance of a joint to a limit of its position, in the timed motion [joint]",
        lambda run: run.found.timed.nearest_limit.distance if run.found.timed is not None else np.nan,
    ),
}  # fmt: skip


def apart(variants: list[StrategyResult]) -> float:
    """Largest joint difference between the same walks of different representations; NaN for a single one."""
    if len(variants) < 2:
        return np.nan
    worst = 0.0
    first = variants[0].trajectories()
    for other in variants[1:]:
        for key, walk in other.trajectories().items():
            k = min(len(walk), len(first[key]))
            worst = max(worst, float(np.abs(walk.q[:k] - first[key].q[:k]).max()))
    return worst
