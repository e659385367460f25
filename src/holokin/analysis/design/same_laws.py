"""Laws of different names that are one: the same joint rates at every pose of a workspace."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...base.types import Array
from ...strategies import HolonomicStrategy, moore_penrose, radial
from .trials import Trial

SPEEDS = 1e-5
"""Relative difference of squared joint speeds up to which two laws are looked at closely: those of `radial` come from
differences, which are right to 1e-8."""

ALIKE = 1e-6
"""Largest difference of the joint rates of two laws that are one, over the largest rate: round-off, and no rule."""


def strategy_of(trial: Trial) -> HolonomicStrategy:
    """The law of a trial: its own, or `radial` of the pseudo-inverse round where it begins."""
    return trial.candidate.strategy or radial(moore_penrose(trial.candidate.task), trial.q0)


def distinct(trials: Sequence[Trial]) -> list[Trial]:
    """The trials without those whose law is that of an earlier one, whose names that one gets as `same`.

    Two laws are one if they serve the same poses of the workspace, and their G are equal up to round-off at each.
    """
    found: list[Trial] = []
    gains: dict[str, Array] = {}
    for trial in trials:
        place = next((k for k, one in enumerate(found) if _one_law(one, trial, gains)), None)
        if place is None:
            found.append(trial)
        else:
            first = found[place]
            found[place] = replace(first, same=(*first.same, trial.candidate.name))
    return found


def _one_law(one: Trial, other: Trial, gains: dict[str, Array]) -> bool:
    """Whether two trials are of one law."""
    if not one.served.any() or not np.array_equal(one.served, other.served):
        return False
    if not np.allclose(one.speed[one.served], other.speed[one.served], rtol=SPEEDS, atol=0.0):
        return False
    A, B = _gains(one, gains), _gains(other, gains)
    return bool(np.abs(A - B).max() <= ALIKE * np.abs(A).max())


def _gains(trial: Trial, gains: dict[str, Array]) -> Array:
    """G (k, n, m) at the postures of a trial's leaf, kept by its name."""
    name = trial.candidate.name
    if name not in gains:
        gains[name] = np.asarray(strategy_of(trial).gain.batch(trial.q[trial.served])[0])
    return gains[name]
