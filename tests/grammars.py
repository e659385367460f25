"""Small parsers of robot languages, written from the vendors' grammars, for the tests: what they refuse is an error.

ABB: "RAPID kernel" 3HAC050946 (identifiers, modules, declarations) and "RAPID Instructions, Functions and Data types"
3HAC050917 (MoveAbsJ). KUKA: KSS 8.3 "Operating and Programming Instructions for System Integrators" (DEF, DEFDAT,
E6AXIS, PTP_SPLINE, TIME_BLOCK). Universal Robots: "The URScript Programming Language" 5 (movej, servoj, stopj).
FANUC: "R-30iB Handling Tool Operator's Manual" B-83284EN (header, motion instructions, remarks, positions).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from holokin.base.types import Matrix

REAL = r"[+-]?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?"


@dataclass
class Parsed:
    """What a controller would do: axes of each target (k, axes), seconds of each move but the first, which stop."""

    name: str
    axes: Matrix
    seconds: list[float]
    stops: list[bool]
    comments: list[str] = field(default_factory=list)


class GrammarError(Exception):
    """Text that the language does not have."""


def _match(pattern: str, text: str, where: str) -> re.Match[str]:
    found = re.fullmatch(pattern, text)
    if found is None:
        raise GrammarError(f"{where}: {text!r}")
    return found


def _identifier(text: str, longest: int, where: str) -> str:
    return _match(rf"[A-Za-z][A-Za-z0-9_]{{0,{longest - 1}}}", text, where)[0]


def rapid(text: str) -> Parsed:
    """A module with CONST jointtarget and one procedure of MoveAbsJ."""
    if max(map(len, text.splitlines())) > 100 or not text.isascii():
        raise GrammarError("a long line, or letters of another alphabet")
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    comments = [line[1:].strip() for line in lines if line.startswith("!")]
    code = " ".join(line for line in lines if not line.startswith("!"))
    module = _match(r"MODULE (\w+) (.*) PROC (\w+)\(\) (.*) ENDPROC ENDMODULE", code, "module")
    for name in (module[1], module[3]):
        _identifier(name, 32, "name")
    if module[1].lower() == module[3].lower():
        raise GrammarError("a module and its procedure have one name")
    known: dict[str, list[float]] = {}
    for statement in filter(None, (part.strip() for part in module[2].split(";"))):
        six = ",".join([f"({REAL})"] * 6)
        found = _match(rf"CONST jointtarget (\w+):=\[\[{six}\], ?\[{six}\]\]", statement, "declaration")
        known[_identifier(found[1], 32, "target")] = [float(x) for x in found.groups()[1:]]
    axes, seconds, stops = [], [], []
    for statement in filter(None, (part.strip() for part in module[4].split(";"))):
        found = _match(
            rf"MoveAbsJ (\w+)(?:\\NoEOffs)?,(\w+)(?:\\T:=({REAL}))?,(fine|z\d+),(\w+)",
            statement,
            "instruction",
        )
        axes.append(known[found[1]])
        seconds.append(float(found[3]) if found[3] else np.nan)
        stops.append(found[4] == "fine")
    used = [[x for x in row if x != 9e9] for row in axes]
    return Parsed(module[3], np.array(used), seconds[1:], stops, comments)


def krl(source: str, data: str) -> Parsed:
    """A .src of SPTP and PTP_SPLINE with TIME_BLOCK, and its .dat of E6AXIS."""
    lines = source.splitlines()
    if lines[:2] != ["&ACCESS RVP", "&REL 1"] or lines[-1] != "END":
        raise GrammarError("frame of the source")
    name = _identifier(_match(r"DEF (\w+)\(\)", lines[2], "DEF")[1], 24, "name")
    targets = _krl_data(data, name)
    comments = [line[2:] for line in lines if line.startswith("; ")]
    axes: list[list[float]] = []
    seconds: list[float] = []
    stops: list[bool] = []
    block: list[tuple[str, float]] | None = None
    last, timed = "", False
    for line in (part.strip() for part in lines[3:-1] if not part.startswith(";")):
        if re.fullmatch(r"BAS ?\(#(INITMOV|VEL_PTP|ACC_PTP),\d+\)", line):
            continue
        if line == "PTP_SPLINE" and block is None:
            block, timed = [], False
        elif line == "TIME_BLOCK START" and block is not None and not timed:
            timed = True
        elif block is not None and (found := re.fullmatch(rf"TIME_BLOCK PART = ({REAL})", line)) and timed:
            block[-1] = (block[-1][0], float(found[1]))
        elif block is not None and (found := re.fullmatch(rf"TIME_BLOCK END = ({REAL})", line)) and timed:
            whole = sum(share for _, share in block[1:])
            if abs(whole - 100) > 0.01 * len(block):
                raise GrammarError(f"shares of a TIME_BLOCK sum to {whole}")
            axes += [targets[point] for point, _ in block[1:]]
            seconds += [share / whole * float(found[1]) for _, share in block[1:]]
            stops += [False] * (len(block) - 2) + [True]
            timed = False
        elif line == "ENDSPLINE" and block is not None and not timed:
            block = None
        else:
            last = _match(r"SPTP (\w+)", line, "instruction")[1]
            if block is not None:
                block.append((last, np.nan))
            else:
                axes.append(targets[last])
                stops.append(True)
    return Parsed(name, np.array(axes), seconds, stops, comments)


def _krl_data(data: str, name: str) -> dict[str, list[float]]:
    lines = data.splitlines()
    if lines[:3] != ["&ACCESS RVP", "&REL 1", f"DEFDAT {name} PUBLIC"] or lines[-1] != "ENDDAT":
        raise GrammarError("frame of the data list")
    targets = {}
    for line in lines[3:-1]:
        found = _match(r"DECL E6AXIS (\w+)=\{(.*)\}", line, "declaration")
        words = dict(_match(rf"([AE][1-6]) ({REAL})", part, "axis").groups() for part in found[2].split(","))
        if list(words)[:6] != [f"A{i}" for i in range(1, 7)]:
            raise GrammarError(line)
        targets[_identifier(found[1], 24, "target")] = [float(x) for x in words.values()]
    return targets


def urscript(text: str) -> Parsed:
    """def NAME(): of movej, servoj and stopj."""
    lines = text.splitlines()
    name = _identifier(_match(r"def (\w+)\(\):", lines[0], "def")[1], 64, "name")
    if lines[-1] != "end":
        raise GrammarError("no end")
    comments = [line.strip()[2:] for line in lines if line.strip().startswith("#")]
    axes, seconds, stops = [], [], []
    vector = r"\[(" + ", ".join([REAL] * 6) + r")\]"
    for line in (part for part in lines[1:-1] if not part.strip().startswith("#")):
        if re.fullmatch(rf"  stopj\({REAL}\)", line):
            continue
        found = re.fullmatch(rf"  movej\({vector}, a={REAL}, v={REAL}\)", line)
        moved = re.fullmatch(rf"  movej\({vector}, t=({REAL}), r=({REAL})\)", line)
        streamed = re.fullmatch(rf"  servoj\({vector}, 0, 0, ({REAL}), ({REAL}), ({REAL})\)", line)
        hit = found or moved or streamed
        if hit is None:
            raise GrammarError(line)
        axes.append([float(x) for x in hit[1].split(", ")])
        stops.append(found is not None or (moved is not None and float(moved[3]) == 0.0))
        if found is None:
            seconds.append(float(hit[2]))
        if streamed and not (0.03 <= float(streamed[3]) <= 0.2 and 100 <= float(streamed[4]) <= 2000):
            raise GrammarError(line)
    return Parsed(name, np.array(axes), seconds, stops, comments)


def listing(text: str) -> Parsed:
    """An .LS of joint motions with positions by joints."""
    head, rest = text.split("/MN\n")
    body, positions = rest.split("/POS\n")
    name = _identifier(_match(r"/PROG  (\S+)", head.splitlines()[0], "/PROG")[1], 36, "name")
    keys = re.findall(r"^(?:TCD:|)\s*([A-Z_]+)\s*=", head, re.M)
    needed = ["OWNER", "COMMENT", "CREATE", "MODIFIED", "LINE_COUNT", "PROTECT", "DEFAULT_GROUP", "CONTROL_CODE"]
    if not set(needed) <= set(keys) or name != name.upper():
        raise GrammarError(f"header {keys}")
    lines = body.splitlines()
    if int(re.search(r"LINE_COUNT\s*= (\d+);", head)[1]) != len(lines):  # type: ignore[index]
        raise GrammarError("LINE_COUNT")
    moves, comments = [], []
    for number, line in enumerate(lines, 1):
        found = _match(r" *(\d+):(?:  |)(.*) ;", line, "line")
        if int(found[1]) != number:
            raise GrammarError(line)
        if found[2].startswith("!"):
            if len(found[2]) > 33:
                raise GrammarError(f"long remark {line}")
            comments.append(found[2][1:])
        elif not re.fullmatch(r"U(?:FRAME|TOOL)_NUM=\d+", found[2]):
            moves.append(_match(r"J P\[(\d+)\] (\d+)(%|msec) (FINE|CNT(?:\d+))", found[2], "motion"))
    known = {}
    chunks = re.findall(r"P\[(\d+)\]\{\n   GP1:\n\tUF : \d+, UT : \d+,\t\n(.*?)\n\};\n", positions, re.S)
    for number, cells in chunks:
        axes = [re.fullmatch(rf"\s*([JE]\d)=\s*({REAL}) (deg|mm)", cell) for cell in re.split(r",\s*", cells)]
        known[int(number)] = [float(axis[2]) for axis in axes]  # type: ignore[index]
        if [axis[1] for axis in axes][:6] != [f"J{k}" for k in range(1, 7)]:  # type: ignore[index]
            raise GrammarError(cells)
    if not positions.endswith("/END\n") or len(chunks) != positions.count("P["):
        raise GrammarError("positions")
    rows = np.array([known[int(move[1])] for move in moves])
    if moves[0][3] != "%" or not all(1 <= int(m[2]) <= 32_000 and m[3] == "msec" for m in moves[1:]):
        raise GrammarError("times")
    return Parsed(name, rows, [int(m[2]) / 1e3 for m in moves[1:]], [m[4] == "FINE" for m in moves], comments)
