"""What keeps the best law's joint speed above the least: joint limits, or that the least lies elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...base.types import Array, Flags, Matrix, Value, Vector
from ...strategies.self_motions import SelfMotions
from ..coverage.coordinates import Coordinates
from ..coverage.pose_postures import best_of, line_through
from .advice import CLOSE, EASY, EQUAL
from .lower_bound import least_slopes
from .objectives import Costs
from .trials import Trial

NEAR = 1.0
"""Way along a self-motion [joint units] that is called near: valleys of a Panda's joint speed are 3 apart."""

STEP, FINER = 0.1, 10
"""Step of the walks that look for the least nearby; round the best posture they are shorter by this."""

LINES = 8
"""Lines searched one after another for each redundant joint, where there are several."""

PARTLY = 0.5
"""Share of the workspace that a law serves at least which is named beside the best."""

Beyond = tuple[tuple[str, str, int], ...]
"""(joint, "lower" or "upper", poses at which it is beyond that limit), most first."""


@dataclass(frozen=True, eq=False)
class Free(Value):
    """The best law designed again without joint limits: its mean squared speed over the least, and what is beyond its
    limits then.
    """

    speed: float
    beyond: Beyond
    poses: int


@dataclass(frozen=True, eq=False)
class Rival(Value):
    """A law that comes closer to the least than the best one, where it serves, but serves less: `ends` poses at which
    its leaf ends.
    """

    name: str
    speed: float
    coverage: float
    beyond: Beyond
    ends: int


@dataclass(frozen=True, eq=False)
class Excess(Value):
    """What is known of the reasons. near: the least mean squared speed of postures within the joint limits, near those
    of the law, over the least anywhere; from whole walks (traced), or with several redundant joints from a search.
    """

    near: float
    traced: bool
    free: Free | None
    rival: Rival | None


def beyond_limits(trial: Trial, which: Flags) -> Beyond:
    """The limits that a law is beyond at some of its poses (k,)."""
    robot, found = trial.candidate.task.robot, []
    for side, over in (("lower", trial.q < robot.lower), ("upper", trial.q > robot.upper)):
        counts = over[which].sum(axis=0)
        found += [(robot.joint_names[j], side, int(counts[j])) for j in np.flatnonzero(counts)]
    return tuple(sorted(found, key=lambda entry: -entry[2]))


def rival_of(best: Trial, trials: Sequence[Trial], floor: Vector, within: Flags) -> Rival | None:
    """The law that comes closest to the least where it serves, of those that serve less but more than `PARTLY`.

    Args:
        floor: the least squared speed (k,), NaN where it is not known. within: poses (k,) that any posture within the
            limits reaches.
    """
    found: tuple[float, Trial] | None = None
    nearest = ratio(best, floor) - CLOSE / 2
    for trial in trials:
        less = trial.coverage < best.coverage - EQUAL or trial.easy < best.easy - EASY
        if less and trial.coverage > PARTLY and ratio(trial, floor) < nearest:
            found = (nearest := ratio(trial, floor)), trial
    if found is None:
        return None
    trial = found[1]
    lost = within & ~trial.served
    ends = int((lost & ~trial.reached).sum())
    return Rival(trial.candidate.name, found[0], trial.coverage, beyond_limits(trial, lost & trial.reached), ends)


def ratio(trial: Trial, floor: Vector, *, limits: bool = True) -> float:
    """The mean squared speed of a law over the least, where it serves, or, limits aside, where it gets."""
    known = (trial.served if limits else trial.reached) & np.isfinite(trial.speed) & np.isfinite(floor)
    return float(trial.speed[known].mean() / floor[known].mean()) if known.any() else np.nan


def least_near(coordinates: Coordinates, costs: Costs, Q: Matrix, p: Matrix, R: Array) -> Vector:
    """The least squared joint speed (S,) of postures within the joint limits and near those given (S, n), over all
    slopes, at tool poses p (S, 3), R (S, 3, 3).
    """
    task, rng = coordinates.chart, np.random.default_rng(0)
    r = task.n - task.m

    def over(at: Matrix) -> Vector:
        return (np.abs(at - costs.middle) - costs.half).max(axis=1)

    def least(at: Matrix) -> Vector:
        G = least_slopes(task.jacobian_batch(at)[0], coordinates.P, costs.joints)
        found = np.sum(G**2 * costs.joints[:, None] * costs.columns**2, axis=(1, 2))
        return np.where((over(at) > 0) | ~np.isfinite(found), np.inf, found)

    motions, every, best, values = SelfMotions(task, p, R), np.arange(len(Q)), Q.copy(), least(Q)

    def look(step: float, count: int) -> None:
        line = line_through(motions, best, rng.normal(size=Q.shape), every, step, count)
        at, found, _ = best_of(line, least, over)
        better = found < values
        values[better], best[better] = found[better], at[better]

    for k in range(1 if r == 1 else LINES * r):
        look(STEP if k < LINES else STEP / FINER, round(NEAR / STEP))
    if r == 1:
        look(STEP / FINER, FINER)
    return values
