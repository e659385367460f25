"""The units in which results are printed: rad and m, or degrees and mm where somebody asks for them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from .errors import ArgumentError
from .types import Vector

WORDS = {
    "degrees": ("rad", "deg"), "deg": ("rad", "deg"), "radians": ("rad", "rad"), "rad": ("rad", "rad"),
    "mm": ("m", "mm"), "millimetres": ("m", "mm"), "m": ("m", "m"), "metres": ("m", "m"),
}  # fmt: skip
"""What one may ask for -> the unit of SI that it is of, and the unit that is printed."""

_FACTORS = {"deg": 180 / np.pi, "rad": 1.0, "mm": 1000.0, "m": 1.0}
_UNIT = re.compile(r"(?<![\w/^])(rad|m)(?![\w])")


@dataclass(frozen=True)
class PrintedUnits:
    """angle: "rad" or "deg". length: "m" or "mm". Data are in rad and m all the same."""

    angle: str = "rad"
    length: str = "m"

    def name(self, unit: str) -> str:
        """A unit as it is printed: "deg/s" of "rad/s", "mm or deg" of "m or rad"; others as they are."""
        return _UNIT.sub(lambda found: self.angle if found[1] == "rad" else self.length, unit)

    def factor(self, unit: str) -> float:
        """By what a value in a unit that begins with rad or m is multiplied; 1 for other units."""
        plain = re.split(r"[/^ ]", unit)[0]
        return _FACTORS[{"rad": self.angle, "m": self.length}[plain]] if plain in ("rad", "m") else 1.0

    def factors(self, units: Sequence[str]) -> Vector:
        """Those of several units (k,)."""
        return np.array([self.factor(unit) for unit in units])

    def together(self, units: Iterable[str]) -> tuple[str, float]:
        """(unit, factor) for figures that may be in any of several units: of more than one they stay as they are."""
        kinds = tuple(dict.fromkeys(units))
        return (self.name(kinds[0]), self.factor(kinds[0])) if len(kinds) == 1 else (" or ".join(kinds), 1.0)

    def said(self, value: float, unit: str, digits: int = 4) -> str:
        """A value with its unit as they are printed."""
        return f"{self.factor(unit) * value:.{digits}g} {self.name(unit)}".rstrip()

    @property
    def plain(self) -> bool:
        """Whether these are rad and m."""
        return self == SI


SI = PrintedUnits()
"""Radians and metres."""


def printed_units(words: str | Sequence[str]) -> PrintedUnits:
    """The units of "degrees", "mm" or "degrees, mm". Raises: ArgumentError: no such unit, or two of one kind."""
    given = words.replace(",", " ").split() if isinstance(words, str) else list(words)
    found: dict[str, str] = {}
    for word in given or [""]:
        if word not in WORDS:
            raise ArgumentError("the unit", word, "results are printed in degrees or rad, and in mm or m: give these")
        kind, unit = WORDS[word]
        if found.setdefault(kind, unit) != unit:
            raise ArgumentError("the unit", word, f"{found[kind]} is asked for, too: give one of them")
    return PrintedUnits(found.get("rad", "rad"), found.get("m", "m"))
