"""What is in the way at tool poses: the shapes that are too near to each other at every posture within the limits."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.types import Flags, Indices, Matrix, Value, Vector
from ...motion.checks import Clearances


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
        chosen = np.flatnonzero(which)
        if not len(chosen):
            return []
        # One reason for all, if there is one: a pair, then a thing
        for p in np.flatnonzero((self.pairs == self.postures[:, None])[chosen].all(axis=0)):
            return [(f"{near_words(self.pair_names[p], self.wanted[p])} at every posture", len(chosen))]
        for t in np.flatnonzero((self.things == self.postures[:, None])[chosen].all(axis=0)):
            return [(f"{self.names[t]} is in the way at every posture", len(chosen))]
        return Counter(self._cause(int(i)) for i in chosen).most_common()

    def _cause(self, i: int) -> str:
        """What is in the way at every posture of a pose: what stands still, or two links, or a link, or several."""
        things = [t for t in range(len(self.names)) if self.things[i, t] == self.postures[i]]
        fixed = [t for t in things if self.names[t] in {other for _, other in self.pair_names} - self._links]
        pairs = [p for p in range(len(self.pair_names)) if self.pairs[i, p] == self.postures[i]]
        if fixed or (things and not pairs):
            return f"{self.names[(fixed or things)[0]]} is in the way at every posture"
        if pairs:
            return f"{near_words(self.pair_names[pairs[0]], self.wanted[pairs[0]])} at every posture"
        often = np.argsort(-self.things[i], kind="stable")[:2]
        return f"{' or '.join(self.names[t] for t in often if self.things[i, t])} is in the way at every posture"

    @cached_property
    def _links(self) -> set[str]:
        """The names of links: the first of a pair always is one."""
        return {name for name, _ in self.pair_names}


def near_words(names: tuple[str, str], wanted: float) -> str:
    """That two things are too near."""
    both = " and ".join(names)
    return f"{both} are nearer than {wanted:.3g} m" if wanted > 0 else f"{both} touch"


FIRST = 16
"""Poses that are looked at first: where one thing is in the way at all their postures, it is looked at alone."""


def obstructions(apart: Clearances | None, Q: Matrix, pose: Indices, count: int) -> tuple[Obstructions, Flags]:
    """(what is in the way at so many poses, which postures are clear (N,)), of postures Q (N, n) within the limits, at
    the poses (N,). Where one thing is in the way at all, nothing else is looked at."""
    if apart is None:
        postures, none = np.bincount(pose, minlength=count), np.zeros((count, 0))
        return Obstructions(postures, postures, none, none, np.zeros(0), (), ()), np.ones(len(Q), dtype=bool)
    known = np.unique(pose)
    first = np.isin(pose, known[:: max(1, len(known) // FIRST)])
    near = apart.too_near(Q[first])
    _, of_thing = _things(apart)
    for t in np.flatnonzero((near.astype(float) @ of_thing > 0).all(axis=0)):
        alone = apart.some(np.flatnonzero(of_thing[:, t]))
        near = alone.too_near(Q)
        if near.any(axis=1).all():
            return _counted(alone, near, pose, count)
    return _counted(apart, apart.too_near(Q), pose, count)


def _things(apart: Clearances) -> tuple[tuple[str, ...], Matrix]:
    """The names of things, what stands still first, since it can be moved; and which pair (P, t) is of which."""
    names = [name for pair in apart.names for name in pair]
    fixed = {name for _, name in apart.names} - {name for name, _ in apart.names}
    names = sorted(dict.fromkeys(names), key=lambda name: name not in fixed)
    of_thing = np.array([[float(name in pair) for name in names] for pair in apart.names])
    return tuple(names), of_thing.reshape(len(apart.names), len(names))


def _counted(apart: Clearances, near: Flags, pose: Indices, count: int) -> tuple[Obstructions, Flags]:
    """Flags of pairs (N, P) at postures, counted for each pose."""
    names, of_thing = _things(apart)
    pairs, things = np.zeros((count, near.shape[1])), np.zeros((count, len(names)))
    np.add.at(pairs, pose, near)
    np.add.at(things, pose, near.astype(float) @ of_thing > 0)
    clear = np.asarray(~near.any(axis=1))
    postures, cleared = (np.bincount(pose[rows], minlength=count) for rows in (slice(None), clear))
    return Obstructions(postures, cleared, pairs, things, apart.limits, apart.names, names), clear
