"""`Recording`: the joints of a robot over time, and the raw samples that a file holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from ..base.arguments import check
from ..base.given_files import listed, shown
from ..base.types import Indices, Matrix, Value, Vector, frozen, numbers
from ..errors import ArgumentError, NotFiniteError, RecordingError, ShapeError
from ..robot import Robot

GAP = 10.0
"""A step longer than this many median steps is a gap: something is missing there."""


@dataclass(frozen=True, eq=False)
class Recording(Value):
    """Joint positions as logged: t (k,) [s], rising; q (k, n) [rad or m] in the order of `joint_names`.

    `notes` says what was changed or left out in reading.
    """

    joint_names: tuple[str, ...]
    t: Vector
    q: Matrix
    source: str
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("t", "q"):
            object.__setattr__(self, name, numbers(f"{name} of a recording", getattr(self, name)))
        check("joint_names", tuple[str, ...], self.joint_names)
        super().__post_init__()
        if self.t.ndim != 1:
            raise ShapeError("t of a recording", ("k",), self.t.shape)
        if self.q.shape != (len(self.t), len(self.joint_names)):
            raise ShapeError("q of a recording", (len(self.t), len(self.joint_names)), self.q.shape)
        for what, values in (("t of a recording", self.t), ("q of a recording", self.q)):
            if not np.isfinite(values).all():
                raise NotFiniteError(what, values[~np.isfinite(values)][:3].tolist())
        if len(self.t) > 1 and not (np.diff(self.t) > 0).all():
            raise ArgumentError("a step of t", float(np.diff(self.t).min()), "give rising times in seconds")

    def __len__(self) -> int:
        return len(self.t)

    @property
    def duration(self) -> float:
        """Time from the first sample to the last [s]."""
        return float(self.t[-1] - self.t[0])

    @property
    def rate(self) -> float:
        """Samples a second, of the median step [Hz]."""
        return float(1 / np.median(np.diff(self.t)))

    @cached_property
    def gaps(self) -> Indices:
        """Indices i at which the step from sample i to i + 1 is over `GAP` median steps."""
        steps = np.diff(self.t)
        return frozen(np.flatnonzero(steps > GAP * np.median(steps)))


@dataclass(frozen=True, eq=False)
class Samples:
    """What a file holds, in its own order and units: t (k,) [s] and q (k, n); `place` and `numbers` (k,) name each
    ('line 7'), for messages. in_si: whether the file named its units, so that q is in rad and m for sure.
    origin: the stamp [s] from which t counts."""

    t: Vector
    q: Matrix
    place: str
    numbers: Indices
    notes: list[str] = field(default_factory=list)
    in_si: bool = False
    origin: float = 0.0

    def some(self, first: int, last: int) -> Samples:
        """The samples from one to before another."""
        return replace(
            self, t=self.t[first:last], q=self.q[first:last].copy(), numbers=self.numbers[first:last],
            notes=list(self.notes),
        )  # fmt: skip

    def where(self, i: int) -> str:
        """The place of sample i in the file, in words."""
        return f"{self.place} {self.numbers[i]}"


def joints_missing(file: Path, missing: Sequence[str], there: Sequence[str], what: str, robot: Robot) -> RecordingError:
    """The error that names the joints missing and what is there instead."""
    fact = f"joints {listed(missing)} of {shown(robot.name)} are not in it"
    named = ", name them by --columns (columns=...)" if what == "columns" else ""
    return RecordingError(file, fact, f"rename them{named} or choose another robot; the {what} are {listed(there)}")
