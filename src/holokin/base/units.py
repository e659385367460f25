"""Numbers as they are printed: digits that are sure, and units, rad and m or degrees and mm."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from .errors import ArgumentError
from .types import Vector

# --- Bounds as text: rounded to the side on which they stay true.

DIGITS = 3
"""Significant digits of a bound."""


def at_least(value: float, digits: int = DIGITS) -> str:
    """A lower bound as text, not above it."""
    return _rounded(value, False, digits)


def at_most(value: float, digits: int = DIGITS) -> str:
    """An upper bound as text, not below it."""
    return _rounded(value, True, digits)


def share_text(share: float) -> str:
    """A share that is proven, 0 to 1, in percent, rounded down."""
    return percentages([share, 1 - share])[0]


def percentages(shares: Sequence[float]) -> list[str]:
    """Shares, 0 to 1, that add up to 1, in percent: the first one rounded down, and all together 100 %.

    Tenths go to those that lack most. What is there, and has none, is "under 0.1 %"; so is all that is not, "over".
    """
    tenths = np.clip(np.asarray(shares, dtype=float), 0.0, 1.0) * 1000
    counts = np.floor(tenths + 1e-9).astype(int)
    for i in 1 + np.argsort(counts[1:] - tenths[1:], kind="stable")[: max(1000 - int(counts.sum()), 0)]:
        counts[i] += 1
    return [_percent(int(k), share > 0, len(counts) > 1 and share < 1) for k, share in zip(counts, shares, strict=True)]


def _percent(tenths: int, some: bool, others: bool) -> str:
    if tenths == 0 and some:
        return "under 0.1 %"
    if tenths == 1000 and others:
        return "over 99.9 %"
    return f"{tenths / 10:g} %"


def _rounded(value: float, up: bool, digits: int) -> str:
    if value == 0 or not np.isfinite(value):
        return f"{value:g}"
    text = f"{value:.{digits - 1}e}"
    if (float(text) < value) if up else (float(text) > value):
        step = 10.0 ** (int(np.floor(np.log10(abs(value)))) - digits + 1)
        text = f"{float(text) + (step if up else -step):.{digits - 1}e}"
    short = f"{float(text):.{digits}g}"
    return short if float(short) == float(text) else text


WORDS = {
    **dict.fromkeys(("degrees", "deg"), ("rad", "deg")),
    **dict.fromkeys(("radians", "rad"), ("rad", "rad")),
    **dict.fromkeys(("mm", "millimetres"), ("m", "mm")),
    **dict.fromkeys(("m", "metres"), ("m", "m")),
}
"""What one may ask for -> the unit of SI that it is of, and the unit that is printed."""

_FACTORS = {"deg": 180 / np.pi, "rad": 1.0, "mm": 1000.0, "m": 1.0}
_NUMBER = r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
_ROW = rf"[\[(]{_NUMBER}(?:, {_NUMBER})*[\])]"
_END = r"(?:/s(?:\^[23])?)?)(?![\w/^\u00b2\u00b3]|\.\w| (?:or|and) (?:rad|m)\b)"
_QUANTITY = re.compile(
    rf"(?<![\w.,^/-])(?P<before>(?:{_NUMBER}(?:, | and | or | to | x | by ))*)(?P<value>{_NUMBER}) "
    rf"(?P<unit>(?:rad|m){_END}"
)
_LISTED = re.compile(rf"(?P<rows>{_ROW}(?: \+- {_ROW})?) (?P<unit>(?:rad|m){_END}")
_TWICE = re.compile(rf"{_NUMBER}(?: to {_NUMBER})? rad(?:/s)? \(({_NUMBER}(?: to {_NUMBER})? deg(?:/s)?)\)")
_NAMED = re.compile(rf"\[(rad|m)\] is ({_NUMBER})")
_UNIT = re.compile(r"(?<![\w/^])(rad|m)(?![\w])")


def _scaled(number: str, factor: float, bound: Callable[[float, int], str] | None = None) -> str:
    """A number in another unit, with one digit more than it had, and at least three; a bound on its side."""
    if factor == 1.0:
        return number
    digits = max(len(re.sub(r"e.*|\D", "", number).lstrip("0")) + 1, 3)
    value = factor * float(number)
    text = f"{value:.{digits}g}" if bound is None or factor == 1000.0 else bound(value, digits)
    return f"{float(text):.0f}" if "e+" in text else text


@dataclass(frozen=True)
class PrintedUnits:
    """angle: "rad" or "deg". length: "m" or "mm". Data are in rad and m all the same."""

    angle: str = "rad"
    length: str = "m"

    def name(self, unit: str) -> str:
        """A unit as it is printed: "deg/s" of "rad/s", "mm or deg" of "m or rad"; others as they are."""
        return _UNIT.sub(lambda match: self.angle if match[1] == "rad" else self.length, unit)

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
        text = f"{self.factor(unit) * value:.{digits}g}"
        return f"{f'{float(text):.0f}' if 'e+' in text else text} {self.name(unit)}".rstrip()

    def reworded(self, text: str, joints: Sequence[tuple[str, str]] = ()) -> str:
        """A text with its quantities in rad or m as they are printed, and postures of joints, each (name, unit).

        A posture is "q1 0.1, q2 0.2" or "q = [0.1, 0.2]", with all of the joints; what is "rad or m" is of joints, and
        has a unit where theirs is one. Lists of numbers without brackets, and what is "m or rad", stay as they are. A
        lower bound is not made larger, and an upper one not smaller.
        """
        if self.plain:
            return text
        units = list(dict.fromkeys(unit for _, unit in joints))
        if joints:
            text = self._with_postures(text, joints, units)
        if len(units) == 1:
            text = re.sub(r"(?<=\d)( or more)? (?:rad or m\b|\(rad or m\))", rf" {units[0]}\1", text)
        if self.angle == "deg":
            text = _TWICE.sub(r"\1", text)
        text = _NAMED.sub(lambda m: f"[{self.name(m[1])}] is {_scaled(m[2], self.factor(m[1]))}", text)
        return _QUANTITY.sub(self._quantity, _LISTED.sub(self._list, text))

    def _with_postures(self, text: str, joints: Sequence[tuple[str, str]], units: list[str]) -> str:
        factors = self.factors([unit for _, unit in joints])

        def posture(match: re.Match[str]) -> str:
            by = iter(factors)
            scaled = re.sub(rf"(?<=[ \[]){_NUMBER}(?=[,\]]|$)", lambda m: _scaled(m[0], next(by)), match[1])
            return f"{scaled} {' or '.join(map(self.name, units))}"

        each = ", ".join(f"{re.escape(name)} {_NUMBER}" for name, _ in joints)
        row = ", ".join([_NUMBER] * len(joints))
        return re.sub(
            rf"(?<!\w)({each}(?![\w.])|(?:(?<=q = )|(?<=q0 is ))\[{row}\])(?: {' or '.join(units)}\b)?", posture, text
        )

    def _list(self, match: re.Match[str]) -> str:
        """Numbers in brackets, with the unit behind them."""
        factor = self.factor(match["unit"])
        return f"{re.sub(_NUMBER, lambda m: _scaled(m[0], factor), match['rows'])} {self.name(match['unit'])}"

    def _quantity(self, match: re.Match[str]) -> str:
        """A number, or "a to b" and "a x b", with its unit; another list as it is."""
        before, value, unit = match["before"], match["value"], match["unit"]
        factor, head, rest = self.factor(unit), match.string[: match.start()], match.string[match.end() :]
        between = head.endswith("between ") and re.fullmatch(rf"{_NUMBER} and ", before)
        if factor == 1.0 or not (between or re.fullmatch(rf"(?:{_NUMBER} (?:to|x) )*", before)):
            return match[0]
        least = head.endswith(("at least ", "over ")) or rest.startswith(" or more")
        most = head.endswith(("at most ", "under ")) or rest.startswith(" or less")
        bound = at_least if least else at_most if most else None
        first = re.sub(_NUMBER, lambda m: _scaled(m[0], factor), before)
        return f"{first}{_scaled(value, factor, bound)} {self.name(unit)}"

    @property
    def plain(self) -> bool:
        """Whether these are rad and m."""
        return self == SI


SI = PrintedUnits()
"""Radians and metres."""


def printed_units(words: str | Sequence[str]) -> PrintedUnits:
    """The units of "degrees", "mm" or "degrees, mm". Raises: ArgumentError: no such unit, or two of one kind."""
    given = words.replace(",", " ").split() if isinstance(words, str) else list(words)
    units: dict[str, str] = {}
    for word in given or [""]:
        if word not in WORDS:
            raise ArgumentError("the unit", word, "results are printed in degrees or rad, and in mm or m: give these")
        kind, unit = WORDS[word]
        if units.setdefault(kind, unit) != unit:
            raise ArgumentError("the unit", word, f"{units[kind]} is asked for, too: give one of them")
    return PrintedUnits(units.get("rad", "rad"), units.get("m", "m"))
