"""`Setup`: what people set in a session, to come back to; `Undo`: the setups before and after."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..base.types import Array, Value, Vector, frozen
from .joint_history import History
from .runs import Run
from .session_loops import Loop

MOST = 200
"""Setups that are kept."""

JOINED = 1.0
"""Seconds within which changes of one kind are one: a drag is many small ones."""


@dataclass(frozen=True, eq=False)
class Setup(Value):
    """The start posture (n,), the laws on their leaves and where each stands, the target, the loop and how it runs."""

    home: Vector
    runs: tuple[Run, ...]
    target: Array
    loop: Loop | None
    cycles: int | None
    factor: float

    def same(self, other: Setup) -> bool:
        """Whether both are one; laws and loops are values, so another one was set by somebody."""
        return (
            self.loop is other.loop
            and len(self.runs) == len(other.runs)
            and all(a.law is b.law and np.array_equal(a.q, b.q) for a, b in zip(self.runs, other.runs, strict=True))
            and (self.cycles, self.factor) == (other.cycles, other.factor)
            and np.array_equal(self.home, other.home)
            and np.array_equal(self.target, other.target)
        )


def kept(run: Run) -> Run:
    """A law where it stands on its leaf, apart from the one that moves on; nothing of what it did on the loop."""
    n, nothing = len(run.q), History(len(run.q), 1)  # hundreds are kept
    return replace(
        run, curves={}, levels={}, state=None, q0=None, walk=None, whole=True, history=nothing,
        drifts=frozen(np.zeros((0, n))),
    )  # fmt: skip


class Undo:
    """The setups of a session in the order in which people made them, and the place of the one that is there."""

    def __init__(self, first: Setup) -> None:
        self._known, self._at = [first], 0
        self._kind: object = None
        self._since = -np.inf

    def note(self, setup: Setup, kind: object = None, now: float = 0.0) -> None:
        """What there is now [s]. What was undone cannot be redone after a change; of changes of one kind, soon after
        each other, only the last is kept."""
        if setup.same(self.here):
            return
        joined = kind is not None and kind == self._kind and now - self._since < JOINED
        del self._known[self._at + (0 if joined else 1) :]
        self._known.append(setup)
        del self._known[:-MOST]
        self._at, self._kind, self._since = len(self._known) - 1, kind, now

    def back(self, setup: Setup) -> Setup | None:
        """The setup before the one that there is now; None if there is none."""
        self.note(setup)
        return self._step(-1)

    def forward(self, setup: Setup) -> Setup | None:
        """The setup that was undone last; None if there is none."""
        self.note(setup)
        return self._step(1)

    @property
    def here(self) -> Setup:
        """The setup that was noted, undone to or redone last."""
        return self._known[self._at]

    @property
    def steps(self) -> tuple[bool, bool]:
        """Whether there is a setup before, and one after."""
        return self._at > 0, self._at < len(self._known) - 1

    def _step(self, by: int) -> Setup | None:
        if not 0 <= self._at + by < len(self._known):
            return None
        self._at, self._kind = self._at + by, None
        return self.here
