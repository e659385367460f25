"""How axes count joints: an axis may turn the other way round, begin elsewhere, or have a unit of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from .arguments import check
from .errors import ArgumentError, UnknownNameError
from .types import Array, Flags, Value, Vector, number


def check_counts(signs: Mapping[str, int], offsets: Mapping[str, float], scales: Mapping[str, float]) -> None:
    """Raises: ArgumentError: a sign that is not 1 or -1, an offset that is not finite, a scale that is not positive."""
    for what, given in (("signs", signs), ("offsets", offsets), ("scales", scales)):
        check(what, Mapping[str, float], given)
        for name, value in given.items():
            sound = np.isfinite(number(f"{what}[{name!r}]", value))
            if not sound or (what == "signs" and value not in (-1, 1)) or (what == "scales" and not value > 0):
                cure = {"signs": "give 1 or -1", "scales": "give a positive number"}.get(what, "give a finite number")
                raise ArgumentError(f"{what}[{name!r}]", value, cure)


@dataclass(frozen=True, eq=False)
class AxisCounts(Value):
    """How the axes of a file count joints: scale * value = sign * joint + offset [rad or m], as in `export.Wiring`.

    Attributes:
        signs: -1 for the joints that the file counts the other way round, by name.
        offsets: the file's value, in rad or m, where the joint is at 0, by name.
        scales: rad or m of one unit of the file, by name, as 2 pi / 4096 of an encoder; other joints are in rad, or in
            degrees, and m.
    """

    signs: Mapping[str, int] = field(default_factory=dict)
    offsets: Mapping[str, float] = field(default_factory=dict)
    scales: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_counts(self.signs, self.offsets, self.scales)

    def known(self, names: Sequence[str]) -> AxisCounts:
        """The same, of a robot with these joints. Raises: UnknownNameError."""
        for name in (*self.signs, *self.offsets, *self.scales):
            if name not in names:
                raise UnknownNameError("joint of signs, offsets or scales", name, names)
        return self

    def scaled(self, names: Sequence[str]) -> Flags:
        """Joints with a scale of their own (n,)."""
        return np.array([name in self.scales for name in names], dtype=bool)

    def joints(self, names: Sequence[str], values: Array, turn: Vector) -> Array:
        """Joints (..., n) [rad or m] of a file's values; turn (n,): rad of its unit, where there is no scale."""
        scale, sign, offset = self._numbers(names, turn)
        return sign * (scale * values - offset)

    def values(self, names: Sequence[str], joints: Array, turn: Vector) -> Array:
        """The file's values (..., n) of joints."""
        scale, sign, offset = self._numbers(names, turn)
        return (sign * joints + offset) / scale

    def _numbers(self, names: Sequence[str], turn: Vector) -> tuple[Vector, Vector, Vector]:
        scale = np.array([self.scales.get(name, one) for name, one in zip(names, turn, strict=True)])
        sign, offset = ([of.get(name, none) for name in names] for of, none in ((self.signs, 1), (self.offsets, 0.0)))
        return scale, np.array(sign, dtype=float), np.array(offset, dtype=float)
