"""What is said of a law: whether it is holonomic about its start, and its curvature at a posture."""

from __future__ import annotations

import numpy as np

from ...analysis.curvature import around, curvature, involutivity
from ...base.types import Vector
from ...strategies import Strategy
from .states import Judgement

RADIUS = 0.2
"""Half side [joint units] of the box about the start in which a law is judged, as in jobs."""


def judged(strategy: Strategy, home: Vector, q: Vector) -> Judgement:
    """The verdict of `hk.involutivity` about the start (n,), and the largest |F_ij| of `hk.curvature` at q (n,)."""
    try:
        verdict = involutivity(strategy, around(home, RADIUS))
        holonomic, defect, sentence = verdict.holonomic, verdict.defect, str(verdict).partition("\n")[0]
    except Exception as problem:  # noqa: BLE001  a law of one's own may raise anything; its thread goes on
        holonomic, defect, sentence = False, np.nan, f"It could not be judged: {problem}"
    return Judgement(holonomic, defect, sentence, largest_curvature(strategy, q), q)


def largest_curvature(strategy: Strategy, q: Vector) -> float:
    """The largest |F_ij| over the pairs of task rows [joint units / task units^2]; NaN where there is none."""
    try:
        return float(np.linalg.norm(curvature(strategy, q), axis=0).max(initial=0.0))
    except Exception:  # noqa: BLE001  as above
        return np.nan
