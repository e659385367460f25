"""G-code: the moves G0 to G3 of a program by the words of ISO 6983, as FANUC, LinuxCNC and Siemens read them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import copysign, isnan, nan, sqrt
from pathlib import Path

import numpy as np

from ...base.errors import ArgumentError, FileError
from ...base.files import shown
from ...base.types import Matrix, Vector
from .moves import INCH, Moves, arc_moves, line_error

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)"
_WORD = re.compile(
    rf"\s*(?:(?P<long>CR|[ABC]3|[A-Z])\s*=\s*(?:(?P<way>AC|IC)\s*\(\s*)?(?P<set>{_NUMBER})(?(way)\s*\))"
    rf"|(?P<letter>[A-Z])\s*(?P<number>{_NUMBER})(?![\d(])|(?P<bare>TRAORI(?:\(1\))?|TRAFOOF))",
)
_COMMENT = re.compile(r"(?<![A-Za-z])\(([^()]*)\)|;(.*)$")
_PROGRAM = re.compile(r"(?:%.*|O\d+|:\d+)\s*")
_FIRST = re.compile(r"\s*(?:/\s*)?(?:N\s*\d+\s*)?G\s*\d+(?:\.\d+)?(?![\w.]*\s*[,;\t]\s*[-+.\d])(?!\w*_)", re.IGNORECASE)
"""A line that begins with a word G, and is no row of a table of points with names."""

PLANES = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}
"""G of a plane -> its two axes and its normal."""

UNITS = {20: "in", 21: "mm", 70: "in", 71: "mm", 700: "in", 710: "mm"}

IDLE = {4, 5.1, 9, 15, 40, 43, 49, 60, 61, 61.1, 64, 69, 80, 94, 98, 99, 500, 601, 602, 641, 642, 643, 644, 645}
"""Words G that change no point: a dwell, no compensation of the radius, that of the length, feed per minute, how
exactly the points are met, no cycle, no polar or turned coordinates."""

REFUSED = {
    **dict.fromkeys((41, 42), "turns on the compensation of the tool's radius: write the path of the tool's center"),
    **dict.fromkeys((93, 95), "gives a feed that is no speed: write feed per minute, G94"),
    **dict.fromkeys((10, 52, 68, 92), "changes the coordinates: write the points in one frame of the workpiece"),
    **dict.fromkeys((65, 66, 67), "calls a macro: let the postprocessor write moves"),
}
OFFSETS = {54, 55, 56, 57, 58, 59}
"""Words G of the frames of workpieces."""

CALLS = (97, 98, 99)
"""Words M that call a subprogram or end one."""

_ROTARY = re.compile(r"(?:-?[ABC]){1,3}")


def is_gcode(text: str) -> bool:
    """Whether the text has a line of such a program."""
    return any(_FIRST.match(line) for line in text.splitlines()[:2000])


@dataclass(slots=True)
class _Word:
    """A word of a line: address, number, how it is written, and "AC" or "IC" where it says from where it counts."""

    address: str
    value: float
    text: str
    way: str = ""


@dataclass
class _State:
    """What earlier lines have said: None or NaN where none has. Coordinates as written: X, Y, Z, A, B, C."""

    units: str | None
    motion: int | None = None
    plane: int | None = None
    absolute: bool | None = None
    absolute_centers: bool = False
    feed: float | None = None
    offset: int | None = None
    tip: bool = False
    axis_words: bool = False
    at: dict[str, float] = field(default_factory=lambda: dict.fromkeys("XYZABC", nan))
    vector: Vector | None = None


def read_gcode(file: Path, text: str, moves: Moves, units: str | None, rotary: str | None, into: bool) -> None:
    """Adds the moves of a program. Raises: FileError: a line that is not understood; no units."""
    kinematics = _kinematics(rotary)
    lines = [*_lines(file, text, moves)]
    used = {word.address for _, words in lines for word in words}
    state = _State(units)
    for letter in "XYZABC":
        if letter not in used:
            state.at[letter] = 0.0
    if missing := [letter for letter in ("X", "Y", "Z", *dict(kinematics)) if letter not in used]:
        moves.notes.append(f"no line has {' or '.join(missing)}: read as 0 everywhere")
    reader = _Reader(file, moves, state, kinematics, into, units)
    for line, words in lines:
        if reader.read(line, words):
            break
    moves.done()
    reader.note(used)


def _kinematics(rotary: str | None) -> list[tuple[str, float]]:
    """(axis, sign) of rotary axes from the workpiece to the tool. Raises: ArgumentError."""
    if rotary is None:
        return []
    letters = rotary.replace("-", "")
    if not _ROTARY.fullmatch(rotary) or len(set(letters)) < len(letters):
        cure = "name the axes from the workpiece to the tool, as in 'CA'; '-C' where C counts the table's own turn"
        raise ArgumentError("rotary", rotary, cure)
    return [(part[-1], -1.0 if part[0] == "-" else 1.0) for part in re.findall(r"-?[ABC]", rotary)]


def _lines(file: Path, text: str, moves: Moves) -> Iterator[tuple[int, list[_Word]]]:
    """(number, words) of each line; comments count as one word. Raises: FileError: what is none."""
    for number, raw in enumerate(text.splitlines(), 1):
        words = [_Word("comment", 0.0, (a or b).strip()) for a, b in _COMMENT.findall(raw) if (a or b).strip()]
        rest = _COMMENT.sub(" ", raw).strip().upper()
        if rest.startswith("/"):
            cure = "delete the line, or its slash"
            raise line_error(file, number, "begins with /: a switch of the machine decides whether it is done", cure)
        place = len(rest) if _PROGRAM.fullmatch(rest) else 0
        while place < len(rest):
            match = _WORD.match(rest, place)
            if match is None:
                raise line_error(file, number, *_not_understood(rest, place))
            named, way, value, letter, plain, bare = match.groups()
            if bare:
                words.append(_Word(bare[:6], 0.0, bare))
            else:
                words.append(_Word(named or letter, float(value or plain), value or plain, way or ""))
            place = match.end()
        yield number, words


def _not_understood(rest: str, place: int) -> tuple[str, str]:
    """(fact, cure) of a piece of a line that is no word of a number."""
    piece = rest[place:].strip()
    if re.search(r"[#\[\]=<>]|\b(IF|WHILE|GOTO|CALL|REPEAT|FOR|DEF|O<)|\bR\d+\s*=", rest):
        return f"has a macro or a formula, {shown(piece)!r}", "let the postprocessor write numbers"
    return f"is not understood from {shown(piece)!r} on", "let the postprocessor write G0 to G3 with numbers"


@dataclass
class _Reader:
    """Does one line after the other."""

    file: Path
    moves: Moves
    state: _State
    kinematics: list[tuple[str, float]]
    into: bool
    given: str | None
    left_out: set[str] = field(default_factory=set)
    whole: int = 0
    turned: int = 0

    def _error(self, line: int, fact: str, cure: str) -> FileError:
        return line_error(self.file, line, fact, cure)

    def read(self, line: int, words: list[_Word]) -> bool:
        """Does a line; whether the program ends there. Raises: FileError."""
        # The words that say how the others are meant.
        coordinates: dict[str, _Word] = {}
        codes = [round(word.value, 1) for word in words if word.address == "G"]
        for word in words:
            if not (4 in codes and word.address in "XFPSU"):  # the seconds of a dwell
                self._word(line, word, coordinates)
        ends = any(word.address == "M" and word.value in (2, 30) for word in words)
        if 4 in codes:
            self.moves.notes.append(f"line {line} waits, which is left out")
            return ends
        if {28, 30, 53} & {*codes}:
            if 53 in codes and self.state.motion != 0:
                raise self._error(
                    line, "cuts in the frame of the machine, G53", "write the points in that of the workpiece"
                )
            self._home(coordinates)
            return ends
        # A move.
        if self.state.motion in (2, 3) and any(word.address == "P" for word in words):
            raise self._error(line, "has P beside an arc, which may be its turns", "write one turn a line")
        if coordinates.keys() & set("XYZABCIJK") or coordinates.keys() & {"A3", "B3", "C3"}:
            self._move(line, coordinates)
        elif coordinates:
            raise self._error(line, f"has {' and '.join(coordinates)} without a point", "complete or delete it")
        return ends

    def _word(self, line: int, word: _Word, coordinates: dict[str, _Word]) -> None:
        """Takes a word. Raises: FileError: one that is not understood, or said twice."""
        state, address, value = self.state, word.address, word.value
        if address == "comment":
            self.moves.comments.append(f"line {line}: {shown(word.text)}")
        elif address == "G":
            self._code(line, round(value, 1))
        elif address == "M":
            if value in CALLS:
                raise self._error(line, f"calls a subprogram, M{value:g}", "write its moves in its place")
            state.tip |= value == 128
            self.left_out |= {f"M{value:g}"} - {"M2", "M30", "M128"}
        elif address in ("TRAORI", "TRAFOO"):
            state.tip = address == "TRAORI"
        elif address == "F":
            if not value > 0:
                raise self._error(line, f"has a feed of {value:g}", "give one above 0")
            state.feed = value
        elif address in ("X", "Y", "Z", "A", "B", "C", "I", "J", "K", "R", "CR", "A3", "B3", "C3"):
            address = "R" if address == "CR" else address
            if address in coordinates:
                raise self._error(line, f"has {address} twice", "keep one of them")
            coordinates[address] = word
            if address in "XYZIJKR" and "." not in word.text and value != 0 and not self.whole:
                self.whole = line
        elif address in ("S", "T", "D", "H", "P", "Q"):
            self.left_out.add(address)
        elif address != "N":
            fact = f"has the word {address}{word.text}, which is not understood"
            raise self._error(line, fact, "let the postprocessor write X, Y, Z, A, B, C, I, J, K, R and F")

    def _code(self, line: int, code: float) -> None:
        """Takes a word G. Raises: FileError: one that is not understood, or that contradicts an earlier one."""
        state = self.state
        if code in UNITS:
            unit = UNITS[int(code)]
            if state.units is not None and state.units != unit:
                before = f"and you say units={self.given!r}" if self.given else f"and before them are {state.units}"
                cure = "leave out units=" if self.given else "write one program in one unit"
                raise self._error(line, f"sets the unit {unit}, {before}", cure)
            state.units = unit
        elif code in (0, 1, 2, 3):
            state.motion = int(code)
        elif code in PLANES:
            state.plane = int(code)
        elif code in (90, 91):
            state.absolute = code == 90
        elif code in (90.1, 91.1):
            state.absolute_centers = code == 90.1
        elif code in OFFSETS:
            if state.offset not in (None, code):
                fact = f"changes the frame of the workpiece from G{state.offset} to G{code:g}"
                raise self._error(line, fact, "write the paths of one frame into one file")
            state.offset = int(code)
        elif code in (43.4, 43.5, 234):  # FANUC's and Haas'
            state.tip, state.axis_words = True, code == 43.5
        elif code in REFUSED:
            fact, _, cure = REFUSED[int(code)].partition(": ")
            raise self._error(line, f"{fact}, G{code:g}", cure)
        elif code not in IDLE and code not in (28, 30, 53):
            what = "is a cycle" if 73 <= code < 90 else "is not understood"
            raise self._error(line, f"has G{code:g}, which {what}", "let the postprocessor write G0 to G3")
        if code == 49:
            state.tip = state.axis_words = False

    def _home(self, coordinates: dict[str, _Word]) -> None:
        """A rapid move in the frame of the machine: where it leads the file does not say, and it ends the path."""
        self.moves.end()
        self.moves.point = None
        for letter in [c for c in coordinates if c in self.state.at] or "XYZ":
            self.state.at[letter] = nan

    def _move(self, line: int, words: dict[str, _Word]) -> None:
        """Raises: FileError: a move of which something is not known."""
        state, file = self.state, self.file
        if state.motion is None:
            raise self._error(line, "has a point, and no G0 to G3 stands before it", "say how the tool moves there")
        if state.units is None:
            cure = "say units='mm' or units='in', or write G21 or G20"
            raise self._error(line, "has the first point, and nothing says its unit", cure)
        scale, before = INCH[state.units], dict(state.at)
        for letter, word in words.items():
            if letter in state.at:
                incremental = word.way == "IC" or (not word.way and state.absolute is False)
                state.at[letter] = word.value + (before[letter] if incremental else 0.0)
        # A rapid move may leave something unknown; one at feed may not.
        unknown = [letter for letter, value in state.at.items() if isnan(value)]
        needed = [letter for letter in unknown if letter in "XYZ" or letter in dict(self.kinematics)]
        if needed and state.motion == 0:
            self.moves.end()
            self.moves.point = None
            return
        if needed:
            raise self._error(line, f"cuts where {' and '.join(needed)} is not known", "give it before")
        point = scale * np.array([state.at[letter] for letter in "XYZ"])
        axis = self._axis(line, words)
        if state.motion == 0:
            self.moves.rapid(line, point, axis)
            return
        speed = None if state.feed is None else state.feed * scale / 60
        if state.motion == 1:
            if extra := sorted(words.keys() & set("IJKR")) if not state.axis_words else []:
                raise self._error(line, f"has {' and '.join(extra)} in a straight move", "delete it, or write G2 or G3")
            self.moves.feed(line, point, axis, speed)
            return
        start = scale * np.array([before[letter] for letter in "XYZ"])
        if self.moves.point is None or np.isnan(start).any():
            raise self._error(line, "has an arc that begins at a point that is not known", "give its start before")
        start = self.moves.point
        center, normal = self._center(line, words, start, point, scale)
        self.moves.feed(line, point, axis, speed, arc_moves(file, line, start, point, center, normal))

    def _center(
        self, line: int, words: dict[str, _Word], start: Vector, end: Vector, scale: float
    ) -> tuple[Vector, Vector]:
        """(center, normal about which it turns counter-clockwise) of an arc. Raises: FileError: it has none."""
        state = self.state
        if state.plane is None:
            self.moves.notes.append(f"line {line} has an arc, and nothing says its plane: read as that of X and Y, G17")
            state.plane = 17
        a, b, c = PLANES[state.plane]
        normal = np.zeros(3)
        normal[c] = 1.0 if state.motion == 3 else -1.0
        given = words.keys() & set("IJKR")
        if "R" in given:
            if len(given) > 1:
                raise self._error(line, "gives the center of an arc and its radius", "keep one of them")
            return self._by_radius(line, scale * words["R"].value, start, end, normal, c), normal
        if "IJK"[c] in given or not given:
            fact = f"has {'IJK'[c]} beside the plane G{state.plane}" if given else "has an arc without center or radius"
            raise self._error(line, fact, f"give {'IJK'[a]} and {'IJK'[b]}, or R")
        center = start.copy()
        for i in (a, b):
            word = words.get("IJK"[i])
            absolute = state.absolute_centers if word is None or not word.way else word.way == "AC"
            value = 0.0 if word is None else scale * word.value
            if word is not None or not absolute:
                center[i] = value if absolute else start[i] + value
        return center, normal

    def _by_radius(self, line: int, radius: float, start: Vector, end: Vector, normal: Vector, c: int) -> Vector:
        """The center: left of the way from start to end for the shorter arc, right of it for a negative radius."""
        chord = end - start
        chord[c] = 0.0
        length = float(np.linalg.norm(chord))
        rest = radius**2 - (length / 2) ** 2
        if length == 0.0 or rest < -1e-3 * radius**2:
            fact = f"has an arc of radius {1e3 * radius:g} mm between points {1e3 * length:.6g} mm apart"
            raise self._error(line, fact, "give a radius of at least half of that, and for a circle its center")
        left = np.cross(normal, chord / length)
        return start + chord / 2 + copysign(sqrt(max(rest, 0.0)), radius) * left

    def _axis(self, line: int, words: dict[str, _Word]) -> Vector | None:
        """The tool's z axis; None where the program never turns the tool. Raises: FileError: no kinematics."""
        state = self.state
        names = ("I", "J", "K") if state.axis_words else ("A3", "B3", "C3")
        if words.keys() & set(names) and (not state.axis_words or state.motion == 1):
            vector = np.array([words[name].value if name in words else 0.0 for name in names])
            if not np.linalg.norm(vector) > 0:
                raise self._error(line, "has a tool axis of no length", "give a direction")
            state.vector = vector / np.linalg.norm(vector)
        elif missing := sorted((words.keys() & set("ABC")) - dict(self.kinematics).keys()):
            fact = f"turns {' and '.join(missing)}, and nothing says how the machine is built"
            cure = "say rotary=, its axes from the workpiece to the tool, as in rotary='CA'"
            raise self._error(line, fact, cure)
        if state.vector is None and not self.kinematics:
            return None
        up = state.vector if state.vector is not None else self._turn() @ [0.0, 0.0, 1.0]
        if state.vector is None and not state.tip and any(state.at[letter] for letter, _ in self.kinematics):
            self.turned = self.turned or line
        return np.asarray(up if self.into else -up, dtype=float)

    def _turn(self) -> Matrix:
        """The rotation of the tool against the workpiece, from its rotary axes [ISO 841]."""
        from scipy.spatial.transform import Rotation

        letters = "".join("XYZ"["ABC".index(letter)] for letter, _ in self.kinematics)
        angles = [sign * self.state.at[letter] for letter, sign in self.kinematics]
        return Rotation.from_euler(letters, angles, degrees=True).as_matrix()

    def note(self, used: set[str]) -> None:
        """What was assumed in reading the program."""
        notes, state = self.moves.notes, self.state
        if state.absolute is None and used & set("XYZ"):
            notes.append("nothing says G90 or G91: the points are read as absolute, G90")
        if self.whole:
            notes.append(f"line {self.whole} has a number without a decimal point: read as whole {state.units}")
        if self.turned:
            fact = f"line {self.turned} turns the tool, and nothing turns on the control of its center (G43.4, TRAORI)"
            notes.append(f"{fact}: X, Y, Z are read as the tool's tip in the frame of the workpiece")
        if self.left_out:
            notes.append(f"left out: {', '.join(sorted(self.left_out))}")
