"""`Samples`: what the file of a log holds, in its own order and units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from ....base.errors import RecordingError
from ....base.given_files import listed, shown
from ....base.types import Indices, Matrix, Vector
from ....robot import Robot


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
    cure = f"rename them, name them by --columns (columns=...) or choose another robot; the {what} are {listed(there)}"
    return RecordingError(file, fact, cure)
