"""Small parsers of robot languages, written from the vendors' grammars, for the tests: what they refuse is an error.

ABB: "RAPID kernel" 3HAC050946 (identifiers, modules, declarations) and "RAPID Instructions, Functions and Data types"
3HAC050917 (MoveAbsJ, MoveL, MoveC, CalcRobT, CirPathMode, GripLoad, SetDO, WaitTime). KUKA: KSS 8.3 "Operating
and Programming Instructions for System Integrators" (DEF, DEFDAT, E6AXIS, PTP_SPLINE, TIME_BLOCK, LIN, CIRC, FORWARD,
$OUT, WAIT). Universal Robots: "The URScript Programming Language" 5 (movej, movel, movec, servoj, stopj,
set_tcp, set_payload, set_digital_out, sleep).
FANUC: "R-30iB Handling Tool Operator's Manual" B-83284EN (header, motion instructions, remarks, positions).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from holokin.base.types import Matrix
from holokin.export import Program

REAL = r"[+-]?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?"


@dataclass
class Parsed:
    """What a controller would do: axes of each target (k, axes), seconds of each move but the first, which stop.

    `kinds` of those moves, where they are not all joint moves; linear and circular ones with a speed have NaN seconds,
    and `speeds` in m/s. `via` holds axes on the way of circular moves. `lines` are process lines by the target that is
    reached before; `zones` the radii [m] at which targets are passed.
    """

    name: str
    axes: Matrix
    seconds: list[float]
    stops: list[bool]
    comments: list[str] = field(default_factory=list)
    kinds: list[str] = field(default_factory=list)
    speeds: list[float] = field(default_factory=list)
    via: dict[int, list[float]] = field(default_factory=dict)
    lines: list[tuple[int, str]] = field(default_factory=list)
    zones: list[float] = field(default_factory=list)


def facts(program: Program) -> str:
    """The text beside a program on one line."""
    return " ".join(program.facts.split())


class GrammarError(Exception):
    """Text that the language does not have."""


def _match(pattern: str, text: str, where: str) -> re.Match[str]:
    found = re.fullmatch(pattern, text)
    if found is None:
        raise GrammarError(f"{where}: {text!r}")
    return found


def _identifier(text: str, longest: int, where: str) -> str:
    return _match(rf"[A-Za-z][A-Za-z0-9_]{{0,{longest - 1}}}", text, where)[0]


def rapid(text: str, own: str = "(?!)") -> Parsed:
    """A module with CONST jointtarget and one procedure of moves; `own`: statements of the user."""
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
    speeds: dict[str, float] = {}
    for statement in filter(None, (part.strip() for part in module[2].split(";"))):
        if found := re.fullmatch(rf"CONST speeddata (\w+):=\[({REAL}),500,5000,1000\]", statement):
            speeds[_identifier(found[1], 32, "speed")] = float(found[2]) / 1e3
            continue
        six = ",".join([f"({REAL})"] * 6)
        found = _match(rf"CONST jointtarget (\w+):=\[\[{six}\], ?\[{six}\]\]", statement, "declaration")
        known[_identifier(found[1], 32, "target")] = [float(x) for x in found.groups()[1:]]
    made = Parsed(module[3], np.zeros(0), [], [], comments)
    axes: list[list[float]] = []
    burning = False
    used = r"(\w+(?:\\WObj:=\w+)?)"
    speed = rf"v1000\\V:=({REAL})"
    zone = rf"(fine|z\d+(?:\\Z:={REAL})?)"
    for statement in filter(None, (part.strip() for part in module[4].split(";"))):
        if found := re.fullmatch(rf"MoveAbsJ (\w+)\\NoEOffs,(v100|v1000\\T:=({REAL})),{zone},{used}", statement):
            axes.append(known[found[1]])
            if found[3]:
                _moved(made, "joint", seconds=float(found[3]))
            made.stops.append(found[4] == "fine")
        elif found := re.fullmatch(rf"MoveL CalcRobT\((\w+),{used}\),{speed},{zone},{used}", statement):
            axes.append(known[found[1]])
            _moved(made, "linear", speed=float(found[3]) / 1e3)
            made.stops.append(found[4] == "fine")
        elif found := re.fullmatch(
            rf"MoveC CalcRobT\((\w+),{used}\),CalcRobT\((\w+),{used}\), +{speed},{zone},{used}", statement
        ):
            made.via[len(made.kinds)] = [x for x in known[found[1]] if x != 9e9]
            axes.append(known[found[3]])
            _moved(made, "circular", speed=float(found[5]) / 1e3)
            made.stops.append(found[6] == "fine")
        elif found := re.fullmatch(
            rf"Arc([LC])(Start|End|) (?:CalcRobT\((\w+),{used}\),)?CalcRobT\((\w+),{used}\), *"
            rf"(\w+),(\w+),(\w+),{zone},{used}",
            statement,
        ):
            if (
                (found[2] == "Start") == burning
                or (found[2] and found[10] != "fine")
                or (found[1] == "C") != bool(found[3])
            ):
                raise GrammarError(statement)
            burning = found[2] != "End"
            made.lines.append((len(axes), f"Arc{found[1]}{found[2]} {found[8]} {found[9]}"))
            if found[7] == "v100":  # the arc starts where the torch stands
                if known[found[5]] != axes[-1]:
                    raise GrammarError(statement)
                continue
            if found[3]:
                made.via[len(made.kinds)] = [x for x in known[found[3]] if x != 9e9]
            axes.append(known[found[5]])
            _moved(made, "circular" if found[3] else "linear", speed=speeds[found[7]])
            made.stops.append(found[10] == "fine")
        else:
            _match(
                rf"(SetDO \w+,[01]|WaitTime {REAL}|GripLoad \w+|CirPathMode\\(?:Object|Path)Frame|{own})",
                statement,
                "instruction",
            )
            made.lines.append((len(axes), statement))
    if burning:
        raise GrammarError("an arc that does not end")
    made.axes = np.array([[x for x in row if x != 9e9] for row in axes])
    return made


def _moved(made: Parsed, kind: str, seconds: float = np.nan, speed: float = np.nan) -> None:
    made.kinds.append(kind)
    made.seconds.append(seconds)
    made.speeds.append(speed)


def krl(source: str, data: str, own: str = "(?!)") -> Parsed:
    """A .src of SPTP, PTP_SPLINE with TIME_BLOCK, LIN and CIRC, and its .dat of E6AXIS; `own`: lines of the user."""
    lines = source.splitlines()
    if lines[:2] != ["&ACCESS RVP", "&REL 1"] or lines[-1] != "END":
        raise GrammarError("frame of the source")
    name = _identifier(_match(r"DEF (\w+)\(\)", lines[2], "DEF")[1], 24, "name")
    targets = _krl_data(data, name)
    comments = [line[2:] for line in lines if line.startswith("; ")]
    made = Parsed(name, np.zeros(0), [], [], comments)
    axes: list[list[float]] = []
    poses: dict[str, list[float]] = {}
    declared: set[str] = set()
    block: list[tuple[str, float]] | None = None
    last, timed, speed, halt = "", False, np.nan, []
    for line in (part.strip() for part in lines[3:-1] if not part.startswith(";")):
        if re.fullmatch(r"BAS ?\(#(INITMOV|VEL_PTP|ACC_PTP|TOOL|BASE),\d+\)|\$LOAD=LOAD_DATA\[\d+\]", line):
            continue
        if found := re.fullmatch(r"DECL (?:INT|E6POS) (\w+)", line):
            declared.add(_identifier(found[1], 24, "variable"))
            if axes:
                raise GrammarError("a declaration behind an instruction")
        elif (found := re.fullmatch(r"(\w+)=FORWARD\((\w+),XERR\)", line)) and found[1] in declared:
            poses[found[1]] = targets[found[2]]
            halt = ["IF XERR<>0 THEN", "HALT", "ENDIF"]
        elif halt and line == halt[0]:
            halt.pop(0)
        elif line in ("$ORI_TYPE=#VAR", "$CIRC_TYPE=#BASE"):
            continue
        elif found := re.fullmatch(rf"\$(VEL\.CP|APO\.CDIS)=({REAL})", line):
            speed = float(found[2]) if found[1] == "VEL.CP" else speed
        elif found := re.fullmatch(r"LIN (\w+)( C_DIS)?", line):
            axes.append(poses[found[1]])
            _moved(made, "linear", speed=speed)
            made.stops.append(found[2] is None)
        elif found := re.fullmatch(r"CIRC (\w+),(\w+)( C_DIS)?", line):
            made.via[len(made.kinds)] = poses[found[1]]
            axes.append(poses[found[2]])
            _moved(made, "circular", speed=speed)
            made.stops.append(found[3] is None)
        elif line == "PTP_SPLINE" and block is None:
            block, timed = [], False
        elif line == "TIME_BLOCK START" and block is not None and not timed:
            timed = True
        elif block is not None and (found := re.fullmatch(rf"TIME_BLOCK PART = ({REAL})", line)) and timed:
            block[-1] = (block[-1][0], float(found[1]))
        elif block is not None and (found := re.fullmatch(rf"TIME_BLOCK END = ({REAL})", line)) and timed:
            whole = sum(share for _, share in block[1:])
            if abs(whole - 100) > 0.01 * len(block):
                raise GrammarError(f"shares of a TIME_BLOCK sum to {whole}")
            if targets[block[0][0]] != axes[-1]:
                raise GrammarError("a block that begins elsewhere")
            axes += [targets[point] for point, _ in block[1:]]
            for _, share in block[1:]:
                _moved(made, "joint", seconds=share / whole * float(found[1]))
            made.stops += [False] * (len(block) - 2) + [True]
            timed = False
        elif line == "ENDSPLINE" and block is not None and not timed:
            block = None
        elif block is None and re.fullmatch(rf"\$OUT\[\d+\]=(TRUE|FALSE)|WAIT SEC {REAL}|{own}", line):
            made.lines.append((len(axes), line))
        else:
            last = _match(r"SPTP (\w+)", line, "instruction")[1]
            if block is not None:
                block.append((last, np.nan))
            else:
                axes.append(targets[last])
                made.stops.append(True)
    made.axes = np.array(axes)
    return made


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


def urscript(text: str, own: str = "(?!)") -> Parsed:
    """def NAME(): of movej, movel, movec, servoj and stopj, and its call; `own`: lines of the user."""
    lines = text.splitlines()
    name = _identifier(_match(r"def (\w+)\(\):", lines[0], "def")[1], 64, "name")
    if lines[-2:] != ["end", f"{name}()"]:
        raise GrammarError("no end, or no call")
    made = Parsed(name, np.zeros(0), [], [], [line.strip()[2:] for line in lines if line.strip().startswith("#")])
    axes: list[list[float]] = []
    vector = r"\[(" + ", ".join([REAL] * 6) + r")\]"
    for line in (part for part in lines[1:-2] if not part.strip().startswith("#")):
        if re.fullmatch(rf"  (stopj\({REAL}\)|set_tcp\(p{vector}\)|set_payload\({REAL}\))", line):
            continue
        if re.fullmatch(rf"  (set_digital_out\(\d+, (True|False)\)|sleep\({REAL}\)|{own})", line):
            made.lines.append((len(axes), line.strip()))
            continue
        found = re.fullmatch(rf"  movej\({vector}, a={REAL}, v={REAL}\)", line)
        moved = re.fullmatch(rf"  movej\({vector}, t=({REAL}), r=({REAL})\)", line)
        straight = re.fullmatch(rf"  movel\({vector}, a={REAL}, v=({REAL}), r=({REAL})\)", line)
        round_ = re.fullmatch(rf"  movec\({vector}, {vector}, a={REAL}, v=({REAL}), r=({REAL})\)", line)
        streamed = re.fullmatch(rf"  servoj\({vector}, 0, 0, ({REAL}), ({REAL}), ({REAL})\)", line)
        hit = found or moved or straight or round_ or streamed
        if hit is None:
            raise GrammarError(line)
        if round_:
            made.via[len(made.kinds)] = [float(x) for x in hit[1].split(", ")]
        axes.append([float(x) for x in hit[2 if round_ else 1].split(", ")])
        passed = moved or straight or round_
        made.stops.append(found is not None or (passed is not None and float(passed.groups()[-1]) == 0.0))
        made.zones.append(float(passed.groups()[-1]) if passed else 0.0)
        if moved or streamed:
            _moved(made, "joint", seconds=float(hit[2]))
        elif straight or round_:
            _moved(made, "linear" if straight else "circular", speed=float(hit.groups()[-2]))
        if streamed and not (0.03 <= float(streamed[3]) <= 0.2 and 100 <= float(streamed[4]) <= 2000):
            raise GrammarError(line)
    made.axes = np.array(axes)
    return made


def listing(text: str, own: str = "(?!)") -> Parsed:
    """An .LS of moves to positions by joints; `own`: lines of the user."""
    head, rest = text.split("/MN\n")
    body, positions = rest.split("/POS\n")
    name = _identifier(_match(r"/PROG  (\S+)", head.splitlines()[0], "/PROG")[1], 36, "name")
    keys = re.findall(r"^(?:TCD:|)\s*([A-Z_]+)\s*=", head, re.M)
    needed = ["OWNER", "COMMENT", "CREATE", "MODIFIED", "LINE_COUNT", "PROTECT", "DEFAULT_GROUP", "CONTROL_CODE"]
    if not set(needed) <= set(keys) or name != name.upper():
        raise GrammarError(f"header {keys}")
    lines = body.replace("\n    :  P[", " :P[").splitlines()  # the second line of a circular move
    if int(re.search(r"LINE_COUNT\s*= (\d+);", head)[1]) != len(lines):  # type: ignore[index]
        raise GrammarError("LINE_COUNT")
    known = _positions(positions)
    made = Parsed(name, np.zeros(0), [], [])
    axes: list[list[float]] = []
    for number, line in enumerate(lines, 1):
        found = _match(r" *(\d+):(  |)(.*) ;", line, "line")
        if int(found[1]) != number:
            raise GrammarError(line)
        motion = re.fullmatch(
            r"(?:([JL]) |C P\[(\d+)\] :)P\[(\d+)\] (\d+(?:\.\d)?)(%|msec|sec|mm/sec|cm/min) (FINE|CNT(?:\d+))", found[3]
        )
        if motion:
            ranges = {
                "%": (1, 100),
                "msec": (1, 32_000),
                "sec": (0.1, 3200),
                "mm/sec": (1, 2000),
                "cm/min": (1, 12_000),
            }
            least, most = ranges[motion[5]]
            per_second = {"mm/sec": 1e-3, "cm/min": 1e-2 / 60}.get(motion[5])
            if (motion[5] == "%") != (not axes) or not least <= float(motion[4]) <= most or found[2]:
                raise GrammarError(line)
            if motion[2]:
                made.via[len(made.kinds)] = known[int(motion[2])]
            if axes:
                kind = {"J": "joint", "L": "linear", None: "circular"}[motion[1]]
                if per_second is None:
                    _moved(made, kind, seconds=float(motion[4]) / (1e3 if motion[5] == "msec" else 1.0))
                elif kind == "joint" or "." in motion[4]:
                    raise GrammarError(line)
                else:
                    _moved(made, kind, speed=per_second * int(motion[4]))
            axes.append(known[int(motion[3])])
            made.stops.append(motion[6] == "FINE")
        elif found[3].startswith("!"):
            if len(found[3]) > 33:
                raise GrammarError(f"long remark {line}")
            made.comments.append(found[3][1:])
        elif not re.fullmatch(r"U(?:FRAME|TOOL)_NUM=\d+|PAYLOAD\[\d+\]", found[3]):
            _match(rf"DO\[\d+\]=(ON|OFF)|WAIT \d+\.\d\d\(sec\)|{own}", found[3], "instruction")
            made.lines.append((len(axes), found[3]))
    made.axes = np.array(axes)
    return made


def _positions(text: str) -> dict[int, list[float]]:
    known = {}
    chunks = re.findall(r"P\[(\d+)\]\{\n   GP1:\n\tUF : \d+, UT : \d+,\t\n(.*?)\n\};\n", text, re.S)
    for number, cells in chunks:
        axes = [re.fullmatch(rf"\s*([JE]\d)=\s*({REAL}) (deg|mm)", cell) for cell in re.split(r",\s*", cells)]
        known[int(number)] = [float(axis[2]) for axis in axes]  # type: ignore[index]
        if [axis[1] for axis in axes][:6] != [f"J{k}" for k in range(1, 7)]:  # type: ignore[index]
            raise GrammarError(cells)
    if not text.endswith("/END\n") or len(chunks) != text.count("P["):
        raise GrammarError("positions")
    return known
