"""`PhysicalRun`: what the joints did on physics. Data only, with the measures that it can show for itself."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from ..arguments import typed
from ..files import replacing
from ..motion import StepStatus, has_leaf
from ..strategies import Strategy
from ..trajectory import Status
from ..types import Array, Matrix, Value, Vector

STARVED = 0.5
"""Share of the commanded motion that the joints make, below which a law is starved: a servo that lags keeps above."""


@dataclass(frozen=True, eq=False)
class PhysicalRun(Value):
    """What the joints did on physics, at k instants.

    Attributes:
        strategy, servo, feedback: the law, the kind of servo, and the joints that the law was told.
        t: (k,) [s]. clock: (k,) how far along the cycles the path is, 1 a cycle.
        q: (k, n) where the joints were. measured: the same with noise. command: the positions asked for.
        position, rotation: (k, 3), (k, 3, 3) where the tool was wanted.
        rests: (cycles + 1, n) where the joints rested at the start and after each cycle that was done to its end.
        nominal: [s] how long the cycles take when nothing slows them.
        followed: share of the commanded motion that the joints made, over the whole run.
        push: (from, to) [s] when a push acted; None without one.
        deflection: (n,) how far the joints were deflected from their command by the push.
        slowed: least scale of a step. status: how the run ended.
    """

    strategy: Strategy
    servo: str
    feedback: str
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
    push: tuple[float, float] | None
    deflection: Vector
    slowed: float
    status: Status
    last: StepStatus = StepStatus.OK

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
        """Largest task error: norm of the rows in "m", or of those in "rad"."""
        rows = [i for i, u in enumerate(self.strategy.task.units) if u == unit]
        return float(np.linalg.norm(self.error[:, rows], axis=1).max()) if rows else 0.0

    @cached_property
    def leaf(self) -> Matrix | None:
        """g(q) less its value at the first rest (k, r), of a strategy with leaves."""
        if not has_leaf(self.strategy):
            return None
        levels = np.array([self.strategy.g(q) for q in self.q])
        return levels - self.strategy.g(self.rests[0])

    @property
    def starved(self) -> bool:
        """Whether the joints made so little of what was asked for that the law must have been fed the wrong joints."""
        return self.followed < STARVED

    @property
    def remark(self) -> str:
        """What is to be said of the run; empty if it went well."""
        if self.starved:
            longer = self.duration / self.nominal
            return (
                f"the joints made {self.followed:.0%} of the motion asked for, in {longer:.1f} times the path's time: "
                f"{self.feedback} joints are fed back to {self.servo} servos; feed back "
                f"{'commanded' if self.servo == 'position' else 'measured'} ones"
            )
        return "" if self.status is Status.COMPLETE else f"after {self.cycles} cycles it {self.status.value}"

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
