"""What is in the way at tool poses: the shapes that are too near to each other at every posture within the limits."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from ...base.types import Flags, Indices, Matrix, Value, Vector
from ...motion.checks import Clearances
from ...motion.checks.check_report import keeps


@dataclass(frozen=True, eq=False)
class Obstructions(Value):
    """Of S poses, what is too near at how many of their postures within the joint limits.

    postures, clear (S,): how many postures a pose has, and how many of these are clear. pairs (S, P), things (S, t): at
    how many each of the P pairs is too near, and each of t things to any other. wanted (P,): the distance asked of each
    pair [m]. pair_names, names: of both.
    """

    postures: Indices
    clear: Indices
    pairs: Matrix
    things: Matrix
    wanted: Vector
    pair_names: tuple[tuple[str, str], ...]
    names: tuple[str, ...]

    @property
    def impossible(self) -> Flags:
        """Poses that have postures within the limits, but none that is clear (S,)."""
        return (self.postures > 0) & (self.clear == 0)

    def causes(self, which: Flags) -> list[tuple[str, int]]:
        """(what is in the way at every posture, at how many), of poses (S,) of which none is clear, most first."""
        return Counter(self._cause(int(i)) for i in np.flatnonzero(which)).most_common()

    def _cause(self, i: int) -> str:
        """What is in the way at every posture of a pose: two things, or one thing to several, or several."""
        for p in np.flatnonzero(self.pairs[i] == self.postures[i]):
            return f"{near_words(self.pair_names[p], self.wanted[p])} at every posture"
        for t in np.flatnonzero(self.things[i] == self.postures[i]):
            return f"{self.names[t]} is in the way at every posture"
        often = np.argsort(-self.things[i], kind="stable")
        most = [self.names[t] for t in often[:2] if self.things[i, t]]
        return f"{' or '.join(most)} is in the way at every posture"


def near_words(names: tuple[str, str], wanted: float) -> str:
    """That two things are too near."""
    both = " and ".join(names)
    return f"{both} are nearer than {wanted:.3g} m" if wanted > 0 else f"{both} touch"


def obstructions(apart: Clearances | None, Q: Matrix, pose: Indices, count: int) -> tuple[Obstructions, Flags]:
    """(what is in the way at so many poses, which postures are clear (N,)), of postures Q (N, n) within the limits, each
    at one of the poses (N,)."""
    postures = np.bincount(pose, minlength=count)
    if apart is None:
        none = np.zeros((count, 0))
        return Obstructions(postures, postures, none, none, np.zeros(0), (), ()), np.ones(len(Q), dtype=bool)
    too_near = ~keeps(apart.distances(Q, apart.wanted), apart.limits)
    # Obstacles first: they are what can be moved
    names = [other for pair in apart.names for other in pair]
    fixed = {name for _, name in apart.names} - {name for name, _ in apart.names}
    names = sorted(dict.fromkeys(names), key=lambda name: name not in fixed)
    of_thing = np.array([[name in pair for name in names] for pair in apart.names]).reshape(-1, len(names))
    pairs, things = np.zeros((count, too_near.shape[1])), np.zeros((count, len(names)))
    np.add.at(pairs, pose, too_near)
    np.add.at(things, pose, too_near.astype(float) @ of_thing > 0)
    clear = ~too_near.any(axis=1)
    cleared = np.bincount(pose[clear], minlength=count)
    return Obstructions(postures, cleared, pairs, things, apart.limits, apart.names, tuple(names)), clear
