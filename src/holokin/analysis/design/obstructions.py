"""What is in the way at tool poses: the shapes that are too near to each other at every posture within the limits."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.types import Flags, Indices, Matrix, Value
from ...motion.checks import Clearances
from ...strategies.tasks.task import Task


@dataclass(frozen=True, eq=False)
class Obstructions(Value):
    """Of S poses, what is too near at how many of their postures within the joint limits.

    apart: what tells of the P pairs. Q (N, n): the postures, pose (N,): of which pose each is. postures, clear (S,):
    how many postures a pose has, and how many of these are clear. pairs (S, P), things (S, t): at how many each of the
    pairs is too near, and each of t things to any other; names: of these.
    """

    task: Task
    apart: Clearances | None
    Q: Matrix
    pose: Indices
    postures: Indices
    clear: Indices
    pairs: Matrix
    things: Matrix
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
        # One reason for all, if there is one: a pair, then a thing; else those of each pose
        for p in np.flatnonzero((self.pairs == self.postures[:, None])[chosen].all(axis=0)):
            return [(self._words((), [int(p)], int(chosen[0])), len(chosen))]
        for t in np.flatnonzero((self.things == self.postures[:, None])[chosen].all(axis=0)):
            return [(self._words((int(t),), self._of(int(t)), int(chosen[0])), len(chosen))]
        causes: dict[tuple[tuple[int, ...], tuple[int, ...]], list[int]] = {}
        for i in chosen.tolist():
            causes.setdefault(self._cause(i), []).append(i)
        ranked = sorted(causes.items(), key=lambda cause: -len(cause[1]))
        return [(self._words(things, list(pairs), of[0]), len(of)) for (things, pairs), of in ranked]

    def _cause(self, i: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """(things, pairs) in the way at every posture of a pose: what stands still, or two links, or a link, or several
        things in turn."""
        things = [t for t in range(len(self.names)) if self.things[i, t] == self.postures[i]]
        fixed = [t for t in things if self.names[t] not in self._links]
        pairs = [p for p in range(self.pairs.shape[1]) if self.pairs[i, p] == self.postures[i]]
        if pairs and not fixed:
            return (), (pairs[0],)
        often = (fixed or things)[:1] or [
            t for t in np.argsort(-self.things[i], kind="stable")[:2] if self.things[i, t]
        ]
        return tuple(map(int, often)), tuple(dict.fromkeys(p for t in often for p in self._of(int(t))))

    def _words(self, things: tuple[int, ...], pairs: list[int], i: int) -> str:
        """What is in the way, and how near at that posture of pose i at which it is least in the way."""
        best = None
        if self.apart is not None:
            best = self.apart.some(np.array(pairs)).roomiest(self.task, self.Q[self.pose == i])
        if best is None:
            return ""
        one, other = best.names
        fact = f"{other} is in the way of {one}"
        if things:
            fact = f"{' or '.join(self.names[t] for t in things)} is in the way"
        elif other in self._links:
            fact = f"{one} and {other} are in each other's way"
        return f"{fact} at every posture found: at the best one, {best}"

    def _of(self, thing: int) -> list[int]:
        """The pairs of a thing."""
        names = () if self.apart is None else self.apart.names
        return [p for p, pair in enumerate(names) if self.names[thing] in pair]

    @cached_property
    def _links(self) -> set[str]:
        """The names of links: the first of a pair always is one."""
        return {name for name, _ in (() if self.apart is None else self.apart.names)}


FIRST = 16
"""Poses that are looked at first: where one thing is in the way at all their postures, it is looked at alone."""


def obstructions(
    task: Task, apart: Clearances | None, Q: Matrix, pose: Indices, count: int
) -> tuple[Obstructions, Flags]:
    """(what is in the way at so many poses, which postures are clear (N,)), of postures Q (N, n) within the limits, at
    the poses (N,). Where one thing is in the way at all, nothing else is looked at."""
    if apart is None:
        postures, none = np.bincount(pose, minlength=count), np.zeros((count, 0))
        found = Obstructions(task, None, Q, pose, postures, postures, none, none, ())
        return found, np.ones(len(Q), dtype=bool)
    known = np.unique(pose)
    first = np.isin(pose, known[:: max(1, len(known) // FIRST)])
    near = apart.too_near(Q[first])
    _, of_thing = _things(apart)
    for t in np.flatnonzero((near.astype(float) @ of_thing > 0).all(axis=0)):
        alone = apart.some(np.flatnonzero(of_thing[:, t]))
        near = alone.too_near(Q)
        if near.any(axis=1).all():
            return _counted(task, alone, Q, near, pose, count)
    return _counted(task, apart, Q, apart.too_near(Q), pose, count)


def _things(apart: Clearances) -> tuple[tuple[str, ...], Matrix]:
    """The names of things, what stands still first, since it can be moved; and which pair (P, t) is of which."""
    names = [name for pair in apart.names for name in pair]
    fixed = {name for _, name in apart.names} - {name for name, _ in apart.names}
    names = sorted(dict.fromkeys(names), key=lambda name: name not in fixed)
    of_thing = np.array([[float(name in pair) for name in names] for pair in apart.names])
    return tuple(names), of_thing.reshape(len(apart.names), len(names))


def _counted(
    task: Task, apart: Clearances, Q: Matrix, near: Flags, pose: Indices, count: int
) -> tuple[Obstructions, Flags]:
    """Flags of pairs (N, P) at postures, counted for each pose."""
    names, of_thing = _things(apart)
    pairs, things = np.zeros((count, near.shape[1])), np.zeros((count, len(names)))
    np.add.at(pairs, pose, near)
    np.add.at(things, pose, near.astype(float) @ of_thing > 0)
    clear = np.asarray(~near.any(axis=1))
    postures, cleared = (np.bincount(pose[rows], minlength=count) for rows in (slice(None), clear))
    return Obstructions(task, apart, Q, pose, postures, cleared, pairs, things, names), clear
