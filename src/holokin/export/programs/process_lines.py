"""What a program does besides moving: lines before it, where the process begins and ends, and after it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from ...base.arguments import check
from ...base.errors import ArgumentError
from ...base.printed_units import PrintedUnits
from ...base.types import Value
from .controller_moves import KINDS, Kind

PLACES = ("before", "on", "off", "after")

OUTPUT = re.compile(r"output (\d+) (on|off)")
WAIT = re.compile(r"wait (\d+(?:\.\d+)?)")

DEGREES = PrintedUnits("deg", "mm")
"""Units of the axes in most languages."""


def common(line: str) -> bool:
    """Whether a line is written in every language."""
    return bool(OUTPUT.fullmatch(line) or WAIT.fullmatch(line))


@dataclass(frozen=True, eq=False)
class ProcessLines(Value):
    """Lines of a program, in the order in which they are done.

    "output 3 on", "output 3 off" and "wait 0.5" [s] are written in every language; any other line is written as it is,
    in the controller's own language.

    Attributes:
        before: before the first move. after: after the last one.
        on, off: where the process begins and ends: when the target at its start, or its end, is reached.
        window: the path's times [s] at which it begins and ends; by default the start and the end of the path.
    """

    before: Sequence[str] = ()
    on: Sequence[str] = ()
    off: Sequence[str] = ()
    after: Sequence[str] = ()
    window: tuple[float, float] | None = field(default=None)

    def __post_init__(self) -> None:
        super().__post_init__()
        for place in PLACES:
            lines = getattr(self, place)
            check(place, Sequence[str], lines)
            for line in (lines,) if isinstance(lines, str) else lines:
                if isinstance(lines, str) or not re.fullmatch(r"[ -~]+", line) or line != line.strip():
                    cure = "give a list of lines of printable ASCII characters, without line breaks"
                    raise ArgumentError(f"the process lines of {place!r}", line, cure)


@dataclass(frozen=True)
class Dialect:
    """A controller's language.

    Attributes:
        language: its name in messages.
        output, wait, states: how an output is set, with its words for off and on, and how the program waits.
        own: the axes of a robot that it holds; 0 for any number. external: how many external ones besides.
        sliding: whether axes of the robot may slide.
        kinds: the moves that it has.
        halt: what waits for the end of a move, where the program runs on before that.
        forbidden: pattern of lines that it cannot hold; `longest` characters of a line. end: what ends one.
        units: of the axes, in which the header speaks.
    """

    language: str
    output: str
    wait: str
    states: tuple[str, str]
    own: int = 6
    external: int = 0
    sliding: bool = False
    kinds: tuple[Kind, ...] = KINDS
    halt: str = ""
    forbidden: str = r"(?!)"
    longest: int = 200
    end: str = ""
    units: PrintedUnits = DEGREES

    def written(self, lines: Sequence[str]) -> list[str]:
        """Lines in this language. Raises: ArgumentError: one that it cannot hold."""
        return [self.halt] * bool(lines and self.halt) + [self._line(line) for line in lines]

    def _line(self, line: str) -> str:
        if found := OUTPUT.fullmatch(line):
            return self.output.format(number=int(found[1]), state=self.states[found[2] == "on"]) + self.end
        if found := WAIT.fullmatch(line):
            return self.wait.format(seconds=float(found[1])) + self.end
        if re.match(r"(?:output|wait)\b(?=[ .\d]|$)", line):
            raise ArgumentError("a process line", line, "write 'output 3 on', 'output 3 off' or 'wait 0.5'")
        if re.search(self.forbidden, line) or len(line) > self.longest:
            cure = (
                f"{self.language} takes at most {self.longest} characters, without what ends a line or starts a section"
            )
            raise ArgumentError("a process line", line, cure)
        return line
