"""`PhysicalRun`: what the joints did on physics. Data only, with the measures that it can show for itself."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from ..base.arguments import typed
from ..base.files import replacing
from ..base.types import Array, Matrix, NoTruthValue, Value, Vector
from ..errors import ArgumentError
from ..motion import has_leaf
from ..robot.drives import ServoKind
from ..strategies import Strategy

Feedback = Literal["commanded", "measured"]
"""What a law may be told as its joints: where they were sent, or where they are measured."""

CALM = 0.3
"""Seconds before a push whose mean is called no deflection: noise averages out."""

AFTER = 0.5
"""Seconds after a push in which its deflection is looked for."""


@dataclass(frozen=True, eq=False)
class PhysicalRun(NoTruthValue, Value, ask="`.stopped`"):
    """What the joints did on physics, at k instants.

    Attributes:
        strategy, servo, feedback: the law, the kind of servo, and the joints that the law was told.
        compensated: whether torques of its own carried the weight.
        t: (k,) [s]. clock: (k,) how far along the cycles the path is, 1 a cycle.
        q: (k, n) where the joints were. measured: the same with noise. command: the positions asked for.
        position, rotation: (k, 3), (k, 3, 3) where the tool was wanted.
        rests: (cycles + 1, n) where the joints rested at the start and after each cycle that was done to its end.
        nominal: [s] how long the cycles take when nothing slows them.
        followed, warning: share of the commanded motion that the joints made, and what `LoopWatch` says of too little.
        push: (from, to) [s] when a push acted; None without one.
        slowed: least scale of a step. stopped: why the run ended early; empty if it did not.
    """

    strategy: Strategy
    servo: ServoKind
    compensated: bool
    feedback: Feedback
    t: Vector
    clock: Vector
    q: Matrix
    measured: Matrix
    command: Matrix
    position: Matrix
    rotation: Array
    rests: Matrix
    nominal: float
    followed: float
    warning: str
    push: tuple[float, float] | None
    slowed: float
    stopped: str = ""

    @property
    def cycles(self) -> int:
        """Cycles that were done to their end."""
        return len(self.rests) - 1

    @property
    def duration(self) -> float:
        """How long the cycles took [s]."""
        return float(self.t[-1])

    @property
    def since_start(self) -> Matrix:
        """Where the joints rested after 1, 2, ... cycles less where they rested first (cycles, n)."""
        return self.rests[1:] - self.rests[0]

    @property
    def apart(self) -> Vector:
        """Largest joint of the same (cycles,) [joint units]."""
        return np.abs(self.since_start).max(axis=1)

    @cached_property
    def error(self) -> Matrix:
        """Task error (k, m) of the real joints to where the tool was wanted [m, rad]."""
        return self.strategy.task.error(self.q, self.position, self.rotation)

    @typed
    def tracking_error(self, unit: str = "m") -> float:
        """Largest task error: norm of the rows in "m", or of those in "rad", or in a unit of your own.

        Raises:
            ArgumentError: another unit.
        """
        known = tuple(dict.fromkeys(("m", "rad", *self.strategy.task.units)))
        if unit not in known:
            raise ArgumentError("unit", unit, f"use {' or '.join(map(repr, known))}")
        rows = [i for i, u in enumerate(self.strategy.task.units) if u == unit]
        return float(np.linalg.norm(self.error[:, rows], axis=1).max()) if rows else 0.0

    @cached_property
    def leaf(self) -> Matrix | None:
        """g(q) less its value at the first rest (k, r), of a strategy with leaves."""
        if not has_leaf(self.strategy):
            return None
        levels = np.array([self.strategy.g(q) for q in self.q])
        return levels - self.strategy.g(self.rests[0])

    def pushed(self, before: float = 0.0, after: float = AFTER) -> tuple[Vector, Matrix]:
        """(times since the push began (k',) [s], how far the joints are from where they were without it (k', n)).

        What the joints do elsewhere in the cycle is taken from the cycle before (or the one after, in the first), and
        of commanded joints the command is left out, so that neither drift nor lag counts.

        Args:
            before, after: seconds about the push.
        """
        if self.push is None or self.t[-1] <= self.push[0]:
            return np.zeros(0), np.zeros((0, self.q.shape[1]))
        off = self.q - self.command if self.feedback == "commanded" else self.q
        first, last = self.push
        here = (self.t >= first - max(before, CALM)) & (self.t <= last + after)
        clock = self.clock[here] + (-1.0 if self.clock[here][0] >= 1.0 else 1.0)
        usual = np.stack([np.interp(clock, self.clock, row) for row in off.T], axis=1)
        if clock[-1] > self.clock[-1]:  # one cycle alone: of measured joints nothing tells the push from the motion
            usual = np.full_like(usual, 0.0 if self.feedback == "commanded" else np.nan)
        shift = off[here] - usual
        t = self.t[here] - first
        shift = shift - shift[t < 0].mean(axis=0) if (t < 0).any() else shift - shift[0]
        return t[t >= -before], shift[t >= -before]

    @property
    def deflection(self) -> float:
        """How far the push deflects the joints: the largest one, at its most [joint units]; NaN if not known."""
        return float(np.abs(self.pushed()[1]).max(initial=0.0))

    @property
    def remark(self) -> str:
        """What is to be said of the run; empty if it went well."""
        fed = f"{self.warning} ({self.feedback} joints and {self.servo} servos)" if self.warning else ""
        return "; ".join(filter(None, [f"after {self.cycles} cycles it {self.stopped}" if self.stopped else "", fed]))

    @typed
    def save(self, path: str | Path) -> None:
        """Write CSV: t, the measured joints (names as in the robot), their commands, and the real ones.

        Raises:
            WriteError: the system refuses the file.
        """
        names = self.strategy.task.robot.joint_names
        header = ["t", *names, *(f"{name}_command" for name in names), *(f"{name}_actual" for name in names)]
        with replacing(path) as part, part.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            writer.writerow(header)
            writer.writerows(np.column_stack([self.t, self.measured, self.command, self.q]).tolist())
