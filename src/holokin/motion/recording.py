"""`Recording`: the joints of a robot over time, as they were logged."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..base.arguments import check
from ..base.errors import ArgumentError, NotFiniteError, ShapeError
from ..base.types import Indices, Matrix, Value, Vector, frozen, numbers

GAP = 10.0
"""A step longer than this many median steps is a gap: something is missing there."""


@dataclass(frozen=True, eq=False)
class Recording(Value):
    """Joint positions as logged: t (k,) [s], rising; q (k, n) [rad or m] in the order of `joint_names`.

    `notes` says what was changed or left out in reading. unknown_turns (p, 2): rows (i, joint), where from sample i to
    the next that joint may have made whole turns that its values do not show; None where nobody looked for them.
    """

    joint_names: tuple[str, ...]
    t: Vector
    q: Matrix
    source: str
    notes: tuple[str, ...] = ()
    unknown_turns: Indices | None = None

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

    def part(self, first: int, last: int) -> Recording:
        """The samples from one to before another."""
        places = self.unknown_turns
        if places is not None:
            inside = (places[:, 0] >= first) & (places[:, 0] < last - 1)
            places = places[inside] - np.array([first, 0])
        return replace(self, t=self.t[first:last], q=self.q[first:last], unknown_turns=places)

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
