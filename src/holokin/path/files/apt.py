"""APT and CLS: the moves of a file of cutter locations, by the words of ISO 4343, as NX, CATIA and Creo write them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import hypot
from pathlib import Path

import numpy as np

from ...base.errors import FileError
from ...base.files import shown
from ...base.tables import number_in
from ...base.types import Vector
from .moves import INCH, Moves, arc_moves, line_error

_FIRST = re.compile(
    r"\s*(?:(?:GOTO|FROM|GODLTA|FEDRAT|TOOL PATH|UNITS|TLDATA|MACHIN|MSYS|CUTTER|LOADTL|SPINDL|MULTAX|PPRINT)\s*/"
    r"|(?:RAPID|MULTAX)\s*$|PARTNO\b)"
)
"""A line that only such a file has."""

_IDLE = re.compile(
    "PARTNO.*|MACHIN|SPINDL|COOLNT|LOADTL|LOAD|SELECT|TOOLNO|CUTTER|TLDATA|PAINT|END-OF-PATH|FINI|STOP|OPSTOP|END|TOLER"
    "|INTOL|OUTTOL|CLRSRF|REWIND|SEQNO|PREFUN|AUXFUN|MODE|HEAD|ARCSLP|DISPLY|SET|CLAMP|LINTOL|NOPOST|CLPRNT|MULTAX"
    "|AUTOPS|PSIS|OFSTNO|LEADER"
)
"""Words that move no tool. What they do is the process's to say."""

FEEDS = {"MMPM": 1e-3 / 60, "IPM": 0.0254 / 60}
"""Units of feed -> m/s; PERMIN has the units of the points."""

LARGEST = 1e9
"""Size of the numbers of a statement at most: more than any length, in any unit."""

AXIS = 1e-3
"""How far the length of a tool axis may be from 1."""

PER_TURN = ("IPR", "MMPR", "PERREV", "INVERS")

REFUSED = {
    **dict.fromkeys(
        ("TRACUT", "COPY", "INDEX", "TRANS", "ROTATE"), "moves or repeats points: write them where they are"
    ),
    **dict.fromkeys(("MACRO", "CALL", "LOOPST", "LOOPND", "JUMPTO", "IF", "TERMAC"), "is a macro: write its moves"),
    "INSERT": "has text for a controller, which may move: write it as GOTO",
}

_CURVES = ("POINT", "LINE", "CIRCLE", "CYLNDR")
"""What the arcs of CATIA are made of."""


def is_apt(text: str) -> bool:
    """Whether the text has a line of such a file."""
    return any(_FIRST.match(line.upper()) for line in text.splitlines()[:2000])


@dataclass
class _Statement:
    line: int
    word: str
    arguments: list[str]
    text: str

    def numbers(self, file: Path, *counts: int) -> list[float]:
        """Its arguments as numbers. Raises: FileError: text, or not as many as asked for."""
        values = [number_in(argument) for argument in self.arguments]
        bad = [
            text
            for text, value in zip(self.arguments, values, strict=True)
            if value is None or not abs(value) <= LARGEST
        ]
        if bad:
            raise line_error(file, self.line, f"has {shown(bad[0])!r} where a number belongs", "write numbers")
        if len(values) not in counts:
            fact = f"has {len(values)} numbers after {self.word}"
            raise line_error(file, self.line, fact, f"give {' or '.join(map(str, counts))}")
        return [value for value in values if value is not None]


def _statements(text: str, moves: Moves) -> Iterator[_Statement]:
    """The statements, each of one line or more; remarks go to the comments."""
    begun, first = "", 0
    for number, raw in enumerate(text.splitlines(), 1):
        line, mark, remark = raw.partition("$$")
        if mark and remark.strip() and remark[0] not in "*-":
            moves.comments.append(f"line {number}: {shown(remark.strip())}")
        line = line.strip()
        first = first if begun else number
        if line.endswith("$"):
            begun += line[:-1]
            continue
        whole, begun = begun + line, ""
        if not whole:
            continue
        word, _, rest = whole.partition("/")
        if word.strip().upper() in ("PPRINT", "TPRINT", "NOTE", "REMARK") or word.upper().startswith("PPRINT"):
            moves.comments.append(f"line {first}: {shown(rest.strip() or word[6:].strip())}")
        else:
            arguments = [cell.strip() for cell in rest.split(",")] if rest.strip() else []
            yield _Statement(first, re.sub(r"\s+", " ", word.strip().upper()), arguments, whole)


@dataclass
class _State:
    """What earlier statements have said."""

    units: str | None
    scale: float = 1.0
    speed: float | None = None
    rapid: bool = False
    axis: Vector | None = None
    circle: tuple[int, list[float]] | None = None
    ahead: Vector | None = None
    system: list[float] = field(default_factory=list)


def read_apt(file: Path, text: str, moves: Moves, units: str | None, into: bool) -> None:
    """Adds the moves of a file. Raises: FileError: a statement that is not understood; no units."""
    reader = _Reader(file, moves, _State(units), into, units)
    for statement in _statements(text, moves):
        reader.read(statement)
    if reader.state.circle is not None:
        raise line_error(file, reader.state.circle[0], "has a CIRCLE that no GOTO follows", "complete or delete it")
    moves.done()


@dataclass
class _Reader:
    """Does one statement after the other."""

    file: Path
    moves: Moves
    state: _State
    into: bool
    given: str | None

    def _error(self, statement: _Statement, fact: str, cure: str) -> FileError:
        return line_error(self.file, statement.line, fact, cure)

    def read(self, statement: _Statement) -> None:
        """Raises: FileError: it is not understood."""
        state, word, file = self.state, statement.word, self.file
        if word in ("GOTO", "FROM", "GODLTA"):
            self._goto(statement)
        elif word == "RAPID":
            state.rapid = True
        elif word == "GOHOME":  # where that is the file need not say
            self.moves.end()
            self.moves.point = None
        elif word == "DELAY":
            self.moves.notes.append(f"line {statement.line} waits, which is left out")
        elif word == "FEDRAT":
            self._feed(statement)
        elif word == "UNITS":
            self._units(statement)
        elif word == "TLAXIS":
            state.axis = self._direction(statement, statement.numbers(file, 3))
        elif word == "INDIRV":
            state.ahead = np.array(statement.numbers(file, 3))
        elif word == "CIRCLE":
            state.circle = statement.line, statement.numbers(file, 4, *range(7, 12))
        elif word.startswith("TLON"):
            self._on_circle(statement)
        elif word == "TOOL PATH":
            self.moves.named(statement.arguments[0] if statement.arguments else "")
        elif word == "MSYS":
            self._system(statement)
        elif word in ("ORIGIN", "CUTCOM", "CYCLE"):
            self._only_off(statement)
        elif word in REFUSED:
            fact, _, cure = REFUSED[word].partition(": ")
            raise self._error(statement, f"{fact} ({word})", cure)
        elif _IDLE.fullmatch(word) is None:
            raise self._error(
                statement, f"is not understood: {shown(statement.text)!r}", "delete it if it moves nothing"
            )

    def _only_off(self, statement: _Statement) -> None:
        """Raises: FileError: a cycle, a compensation or another origin than the one that there is."""
        values = [number_in(cell) for cell in statement.arguments]
        same = statement.word == "ORIGIN" and values in ([0, 0, 0], [0, 0, 0, 1, 0, 0, 0, 0, 1])
        if not same and not all(cell.upper() in ("OFF", "NOMORE") for cell in statement.arguments):
            what = {"ORIGIN": "another origin", "CUTCOM": "a compensation of the cutter", "CYCLE": "a cycle"}
            cure = "let the CAM system write plain GOTO in one frame"
            raise self._error(statement, f"turns on {what[statement.word]}, {shown(statement.text)!r}", cure)

    def _units(self, statement: _Statement) -> None:
        known = {"MM": "mm", "INCHES": "in", "INCH": "in", "IN": "in"}
        unit = known.get(statement.arguments[0].upper() if statement.arguments else "")
        if unit is None:
            raise self._error(statement, f"has a unit that is not known, {shown(statement.text)!r}", "write UNITS/MM")
        if self.state.units not in (None, unit):
            before = f"and you say units={self.given!r}" if self.given else f"and before it is {self.state.units}"
            cure = "leave out units=" if self.given else "write one file in one unit"
            raise self._error(statement, f"sets the unit {unit}, {before}", cure)
        self.state.units = unit

    def _feed(self, statement: _Statement) -> None:
        words = [cell.upper() for cell in statement.arguments]
        values = [value for cell in words if (value := number_in(cell)) is not None]
        units = [cell for cell in words if number_in(cell) is None]
        if any(unit in PER_TURN for unit in units):
            raise self._error(
                statement, "gives a feed that is no speed", "write feed per minute, as in FEDRAT/480,MMPM"
            )
        if len(values) != 1 or not values[0] > 0 or len(units) > 1 or {*units} - {*FEEDS, "PERMIN"}:
            fact = f"has a feed that is not understood, {shown(statement.text)!r}"
            raise self._error(statement, fact, "write it as FEDRAT/480,MMPM")
        if not units:
            note = "FEDRAT without a unit is read as the units of the points a minute"
            self.moves.notes += [note] if note not in self.moves.notes else []
        self.state.speed = values[0] * (FEEDS[units[0]] if units and units[0] in FEEDS else self._scale(statement) / 60)
        self.state.rapid = False

    def _scale(self, statement: _Statement) -> float:
        if self.state.units is None:
            cure = "say units='mm' or units='in', or write UNITS/MM or UNITS/INCHES"
            raise self._error(statement, "has the first length, and nothing says its unit", cure)
        return INCH[self.state.units]

    def _system(self, statement: _Statement) -> None:
        """The frame of a file: there may be one."""
        values = statement.numbers(self.file, 9, 12)
        if self.state.system and values != self.state.system:
            raise self._error(statement, "changes the coordinates, MSYS", "write the paths of one frame into one file")
        if not self.state.system and values[:9] != [0, 0, 0, 1, 0, 0, 0, 1, 0]:
            self.moves.notes.append(
                f"the points count from the frame MSYS of line {statement.line}, not from the part's"
            )
        self.state.system = values

    def _direction(self, statement: _Statement, values: list[float]) -> Vector:
        """The tool's z axis of one from its tip to its holder. Raises: FileError: it is not of unit length."""
        vector = np.array(values)
        length = hypot(*values)
        if not abs(length - 1) <= AXIS:
            raise self._error(statement, f"has a tool axis of length {length:.6g}", "give a direction of length 1")
        return vector / length if self.into else -vector / length

    def _goto(self, statement: _Statement) -> None:
        state, moves, file = self.state, self.moves, self.file
        values = statement.numbers(file, 3, 6)
        point = self._scale(statement) * np.array(values[:3])
        if statement.word == "GODLTA":
            if moves.point is None:
                raise self._error(statement, "moves on from a point that is not known", "begin with GOTO or FROM")
            point = moves.point + point
        if len(values) == 6:
            state.axis = self._direction(statement, values[3:])
        if statement.word == "FROM":
            moves.end()
            moves.point, moves.axis = point, state.axis
        elif state.rapid and state.circle is None:
            moves.rapid(statement.line, point, state.axis)
        elif state.circle is not None:
            _, circle = state.circle
            self._arc(
                statement,
                point,
                INCH[state.units or "mm"] * np.array(circle[:3]),
                circle[3:6] if len(circle) > 4 else None,
            )
        else:
            moves.feed(statement.line, point, state.axis, state.speed)
        state.rapid, state.circle, state.ahead = False, None, None

    def _arc(self, statement: _Statement, end: Vector, center: Vector, axis: list[float] | None) -> None:
        """An arc to a point, in the direction of INDIRV, or else counter-clockwise about the axis of its circle."""
        state, moves = self.state, self.moves
        if moves.point is None:
            raise self._error(statement, "has an arc from a point that is not known", "begin with GOTO or FROM")
        normal = np.array([0.0, 0.0, 1.0] if axis is None else axis, dtype=float)
        if not np.linalg.norm(normal) > 0:
            raise self._error(statement, "has a circle without an axis", "give a direction")
        normal /= np.linalg.norm(normal)
        if state.ahead is not None:
            side = float(np.cross(normal, moves.point - center) @ state.ahead)
            normal = normal if side > 0 else -normal
        elif axis is None:
            raise self._error(statement, "has an arc, and nothing says which way round", "write INDIRV before it")
        else:
            note = "arcs of CIRCLE are read as counter-clockwise about the axis that it gives"
            moves.notes += [note] if note not in moves.notes else []
        curve = arc_moves(self.file, statement.line, moves.point, end, center, normal)
        moves.feed(statement.line, end, state.axis, state.speed, curve)

    def _on_circle(self, statement: _Statement) -> None:
        """CATIA's arcs: TLON,GOFWD/(CIRCLE/center, radius),ON,(LINE/center, end), or about a CYLNDR to a POINT."""
        text = re.sub(r"\s+", "", statement.text.upper())
        found = {name: re.findall(rf"\({name}/([-+.,\dE]+)\)", text) for name in _CURVES}
        ahead, behind = found["CIRCLE"] or found["CYLNDR"] or [""], found["LINE"] or found["POINT"] or [""]
        circle, end = ([number_in(text) for text in part.split(",")] for part in (ahead[0], behind[-1]))
        far = [value for value in circle + end if value is None or not abs(value) <= LARGEST]
        if len(circle) not in (4, 7) or len(end) not in (3, 6) or far:
            fact = f"has a move along a curve that is not understood, {shown(statement.text)!r}"
            raise self._error(statement, fact, "let the CAM system write GOTO or circles")
        numbers = np.array(circle, dtype=float)
        center, axis = numbers[:3], numbers[3:6].tolist() if len(circle) == 7 else None
        scale = self._scale(statement)
        self._arc(statement, scale * np.array(end[-3:], dtype=float), scale * center, axis)
        self.state.ahead = None
