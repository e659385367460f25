"""Drift over the cycles of a closed path, and the spread between two paths to one tool pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError, OpenPathError
from ..base.types import ArrayLike, Indices, Matrix, NoTruthValue, Value, Vector
from ..path.editing import AnyPath, paths_of
from ..strategies import Strategy
from .follow_path import Following, follow
from .trajectory import Trajectory

NO_DRIFT = 1e-6
"""Drift [joint units] that needs no reason: well over the integration error of 500 samples."""


@dataclass(frozen=True, eq=False)
class Drift(NoTruthValue, Value, ask="`.largest`"):
    """Joint drift over the cycles of a closed path."""

    trajectory: Trajectory

    def __repr__(self) -> str:
        return f"Drift({self})"

    @property
    def since_start(self) -> Matrix:
        """Drift after 1, 2, ... cycles (cycles, n) [joint units]."""
        return self.trajectory.drift_since_start()

    @property
    def largest(self) -> Vector:
        """Largest joint's drift after 1, 2, ... cycles (cycles,) [joint units]."""
        return np.abs(self.since_start).max(axis=1)

    @property
    def turns(self) -> Indices:
        """Whole turns of each hinge after 1, 2, ... cycles (cycles, n): drifts of 2 pi k to 1e-6 rad; 0 for others.

        A loop that ends whole turns further winds: it cannot be contracted to a point along the leaf. A loop
        may wind with any other drift, too.
        """
        return self.trajectory.turns()

    @property
    def sentence(self) -> str:
        """How far the joints end from their start after the last cycle, with whole turns by joint."""
        last, units = self.since_start[-1], self.trajectory.joint_units
        k = int(np.abs(last).argmax())
        count = f"{len(self.since_start)} cycle{'s' * (len(self.since_start) > 1)}"
        names = self.trajectory.joint_names
        whole = [f"{name} by {turns:+d}" for name, turns in zip(names, self.turns[-1], strict=True) if turns]
        sentence = f"after {count} {names[k]} is {last[k]:.4g} {units[k]} from its start"
        return f"{sentence}; whole turns: {', '.join(whole)}" if whole else sentence

    def __str__(self) -> str:
        return ", ".join(f"{value:.4g}" for value in self.largest)


@dataclass(frozen=True, eq=False)
class Spread(NoTruthValue, Value, ask="`.largest`"):
    """Joints reached by two paths to the same tool pose."""

    a: Trajectory
    b: Trajectory

    @property
    def difference(self) -> Vector:
        """q at the end of a minus q at the end of b (n,) [joint units]."""
        return self.a.q[-1] - self.b.q[-1]

    @property
    def largest(self) -> float:
        """Largest joint's difference [joint units]."""
        return float(np.abs(self.difference).max())

    def __str__(self) -> str:
        k, names = int(np.abs(self.difference).argmax()), self.a.joint_names
        return f"{self.difference[k]:.4g} {self.a.joint_units[k]} apart at {names[k]}, where both paths end"


@typed
def drift(
    strategy: Strategy,
    path: AnyPath,
    q0: ArrayLike,
    *,
    cycles: int = 1,
    samples: int = 500,
    method: Following | None = None,
    limits: bool = True,
) -> Drift:
    """Follow a closed path for some cycles and say where the joints stand after each.

    Raises:
        OpenPathError, and what `follow` raises.
    """
    if not path.closed:
        raise OpenPathError("drift", path.gap)
    return Drift(follow(strategy, path, q0, samples=samples, cycles=cycles, method=method, limits=limits))


@typed
def path_spread(
    strategy: Strategy,
    path_a: AnyPath,
    path_b: AnyPath,
    q0: ArrayLike,
    *,
    samples: int = 500,
    method: Following | None = None,
    limits: bool = True,
) -> Spread:
    """Follow two paths from the same start posture to the same tool pose and compare the joints.

    Raises:
        ArgumentError when the paths end apart, and what `follow` raises.
    """
    if path_a.end.shape != path_b.end.shape:
        frames = len(paths_of(path_a)), len(paths_of(path_b))
        raise ArgumentError("the frames of the two paths", frames, "give equal numbers")
    apart = float(np.linalg.norm(path_a.end - path_b.end))
    turned = float(np.abs(path_a.turned - path_b.turned).max())
    if max(apart, turned) > 1e-9:
        raise ArgumentError("the distance between the ends of the two paths", max(apart, turned), "let both end alike")
    a = follow(strategy, path_a, q0, samples=samples, method=method, limits=limits)
    return Spread(a, follow(strategy, path_b, q0, samples=samples, method=method, limits=limits))
