"""The metrics of a strategy in a job: how each is measured, what it means, and why it may not be known.

A new metric is an entry of `METRICS`, a line of `measured` and a key of `ExpectTable` in `schema.py`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...motion.trajectory import Status, over_least_speed
from ...path.editing import AnyPath
from ...strategies import HolonomicStrategy, Strategy
from ...symbolic import Function
from ..report.job_result import StrategyResult


@dataclass(frozen=True)
class Metric:
    """[joint] in `meaning` stands for the joints' unit; `unknown` says why the metric may be NaN."""

    meaning: str
    unknown: str = "no cycle was done to its end"


METRICS: dict[str, Metric] = {
    "defect": Metric("curvature near the start, its largest (defect): joint error of a small loop over its area"),
    "drift": Metric("drift of the first cycle: its largest joint's [joint]"),
    "drift_mean": Metric("mean over the cycles of each one's drift [joint]"),
    "drift_total": Metric("largest joint's distance from the start after the last cycle [joint]"),
    "drift_least": Metric("least of the cycles' drifts [joint]"),
    "drift_most": Metric("greatest of the cycles' drifts [joint]"),
    "spread": Metric(
        "largest joint difference between the two paths [joint]",
        "the path has no two paths, or not both were gone to their end",
    ),
    "tracking": Metric("worst tracking error [m or rad]"),
    "sigma": Metric("least singular value of the task Jacobian"),
    "speed": Metric("joint speed (rms) over that of the pseudo-inverse", "the path has no length"),
    "peak_speed": Metric("greatest joint speed over that joint's limit", "a joint has no speed limit"),
    "residual": Metric("how far the joints left their leaf: the largest change of g(q)", "the strategy has no leaves"),
    "invariant": Metric("largest change of the given invariants", "the strategy names none"),
    "same_joints": Metric(
        "largest joint difference between orientation representations [joint]", "there is one representation"
    ),
    "coverage": Metric("share of the workspace that the leaf reaches", "the strategy has no leaves"),
    "coverage_rcond": Metric(
        "least rcond of [J; J_g] over the poses of the workspace that it reaches",
        "it reaches none of the poses, or has no leaves",
    ),
    "time": Metric("seconds that the cycles take within the limits of [timing]"),
    "clearance": Metric(
        "least distance of two links, or of a link and the floor or an obstacle [m]",
        "[checks] hold no pair against a clearance, or could not read a shape",
    ),
    "limit_distance": Metric("least distance of a joint to a limit of its position, in the timed motion [joint]"),
}


def measured(strategy: Strategy, path: AnyPath, invariant: Function | None, result: StrategyResult) -> dict[str, float]:
    """All metrics of a strategy's result; NaN where one is not known, `same_joints` until `representation_gap`.

    Args:
        invariant: q -> the invariants (k,) that the strategy's joint paths must keep, None where it names none.
    """
    metrics = dict.fromkeys(METRICS, np.nan)
    cycles, walks, pair = result.cycles, list(result.trajectories().values()), result.two_paths
    metrics["defect"] = result.verdict.defect
    # Drift: of the largest joint in each cycle that was done to its end, and from the start to the end of the last.
    if path.closed and cycles.cycles:
        drifts = np.abs(cycles.drift()).max(axis=1)
        metrics |= {"drift": float(drifts[0]), "drift_mean": float(drifts.mean())}
        metrics |= {"drift_least": float(drifts.min()), "drift_most": float(drifts.max())}
        metrics["drift_total"] = float(np.abs(cycles.drift_since_start()[-1]).max())
    # Spread: between the joints at the ends of the two paths.
    if pair is not None and all(walk.status is Status.COMPLETE for walk in pair):
        metrics["spread"] = float(np.abs(pair[0].q[-1] - pair[1].q[-1]).max())
    # Along all trajectories: tracking, singular values, speeds, and what the strategy keeps.
    metrics["tracking"] = max(w.tracking_error(unit) for w in walks for unit in dict.fromkeys(w.row_units))
    metrics["sigma"] = min(float(w.sigma.min()) for w in walks)
    metrics["speed"] = over_least_speed(strategy.task, cycles)
    limits = strategy.task.robot.max_velocity
    if np.isfinite(limits).all():
        metrics["peak_speed"] = max(float((np.abs(w.dq) / limits).max()) for w in walks)
    if isinstance(strategy, HolonomicStrategy):
        metrics["residual"] = max(float(w.residual.max()) for w in walks)
    if invariant is not None:
        values = [invariant.batch(w.q).reshape(len(w), -1) for w in walks]
        metrics["invariant"] = max(float(np.abs(v - values[0][0]).max()) for v in values)
    # What [workspace], [timing] and [checks] found.
    if result.coverage is not None:
        metrics["coverage"] = result.coverage.share
        if result.coverage.reached.any():
            metrics["coverage_rcond"] = float(result.coverage.rcond[result.coverage.reached].min())
    if result.timed is not None:
        metrics |= {"time": result.timed.duration, "limit_distance": result.timed.nearest_limit.distance}
    if result.motion_check is not None:
        metrics["clearance"] = result.motion_check.clearance
    return metrics


def representation_gap(variants: list[StrategyResult]) -> float:
    """Largest joint difference between the same walks of different representations; NaN for a single one."""
    if len(variants) < 2:
        return np.nan
    first = variants[0].trajectories()
    gaps = [0.0]
    for other in variants[1:]:
        for key, walk in other.trajectories().items():
            k = min(len(walk), len(first[key]))
            gaps.append(float(np.abs(walk.q[:k] - first[key].q[:k]).max()))
    return max(gaps)
