"""Parsers of further robot languages, as those of `grammars`.

Yaskawa: "Instructions for INFORM Language" (MOVJ, MOVL, DOUT, TIMER, comments) and "Instructions for Data Transmission
Function" (job files). Staubli: "VAL3 Reference Manual" 7 (programs, mdesc, movej, movel, movec, jointToPoint).
LinuxCNC: "G-Code", "RS274/NGC overview".
"""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np

from grammars import REAL, GrammarError, Parsed


def _checked(found: re.Match[str] | None, text: str) -> re.Match[str]:
    if found is None:
        raise GrammarError(text)
    return found


def inform(text: str, pulses: np.ndarray, speeds: np.ndarray) -> Parsed:
    """A .JBI; pulses per degree or mm of each axis, greatest speeds [degrees/s, mm/s]."""
    lines = text.splitlines()
    name = _checked(re.fullmatch(r"//NAME ([A-Z][A-Z0-9_]{0,31})", lines[1]), lines[1])[1]
    start = lines.index("//INST")
    head, body = lines[2:start], lines[start + 1 :]
    if lines[0] != "/JOB" or head[0] != "//POS" or head[3:5] != ["///POSTYPE PULSE", "///PULSE"]:
        raise GrammarError("frame of the job")
    count, bases, *rest = map(int, _checked(re.fullmatch(r"///NPOS ([\d,]+)", head[1]), head[1])[1].split(","))
    _checked(re.fullmatch(r"///TOOL \d+", head[2]), head[2])
    if len(rest) != 4 or any(rest) or len(head[5:]) != count + bases:
        raise GrammarError(head[1])
    known: dict[str, list[int]] = {}
    for line in head[5:]:
        found = _checked(re.fullmatch(r"(B?C\d{5})=(-?\d+(?:,-?\d+)*)", line), line)
        known[found[1]] = [int(x) for x in found[2].split(",")]
    _checked(re.fullmatch(r"///DATE \d{4}/\d\d/\d\d \d\d:\d\d", body[0]), body[0])
    _checked(re.fullmatch(r"///GROUP1 RB(\d),BS\1" if bases else r"///GROUP1 RB\d", body[2]), body[2])
    if [body[1], body[3], body[-1]] != ["///ATTR SC,RW", "NOP", "END"]:
        raise GrammarError("frame of the instructions")
    made = Parsed(name, np.zeros(0), [], [])
    axes: list[np.ndarray] = []
    for line in body[4:-1]:
        move = re.fullmatch(rf"(MOVJ|MOVL) (C\d{{5}})(?: (BC\d{{5}}))? (VJ|V)=({REAL}) PL=([0-8])", line)
        if line.startswith("'"):
            if len(line) > 33:
                raise GrammarError(line)
            made.comments.append(line[1:])
        elif move and (move[1] == "MOVJ") == (move[4] == "VJ"):
            axes.append(np.array(known[move[2]] + (known[move[3]] if move[3] else [])) / pulses)
            made.stops.append(move[6] == "0")
            if len(axes) > 1:
                joint = move[4] == "VJ"
                share = (np.abs(axes[-1] - axes[-2]) / speeds).max()
                made.kinds.append("joint" if joint else "linear")
                made.seconds.append(share / (float(move[5]) / 100) if joint else np.nan)
                made.speeds.append(np.nan if joint else float(move[5]) / 1e3)
        else:
            _checked(re.fullmatch(r"DOUT OT#\(\d+\) (ON|OFF)|TIMER T=\d+\.\d\d", line), line)
            made.lines.append((len(axes), line))
    made.axes = np.array(axes)
    return made


def val3(text: str, speeds: np.ndarray) -> Parsed:
    """A .pgx; nominal speeds [degrees/s]."""
    space = "{http://www.staubli.com/robotics/VAL3/Program/2}"
    root = ElementTree.fromstring(text.encode())
    (program,) = root.findall(f"{space}Program")
    types = {local.get("name"): local.get("type") for local in program.iter(f"{space}Local")}
    code = (program.findtext(f"{space}Code") or "").splitlines()
    if code[0] != "begin" or code[-1] != "end":
        raise GrammarError("frame of the code")
    made = Parsed(program.get("name", ""), np.zeros(0), [], [])
    desc: dict[str, str] = {}
    values: dict[str, list[float]] = {}
    axes: list[list[float]] = []
    for line in (part.strip() for part in code[1:-1]):
        if line.startswith("//"):
            made.comments.append(line[3:])
        elif found := re.fullmatch(rf"l_mDesc\.(accel|decel|vel|tvel|rvel|leave|reach|blend)=({REAL}|\w+)", line):
            desc[found[1]] = found[2]
        elif found := re.fullmatch(r"(l_j\w)=\{(.*)\}", line):
            values[found[1]] = [float(x) for x in found[2].split(",")]
            if types[found[1]] != "jointRx" or len(values[found[1]]) != 6:
                raise GrammarError(line)
        elif found := re.fullmatch(r"(l_p\w)=jointToPoint\(\w+,\w+,(l_j\w)\)", line):
            values[found[1]] = values[found[2]]
        elif found := re.fullmatch(r"mov(e[jlc])\((?:(l_p\w),)?(l_[jp]\w),\w+,l_mDesc\)", line):
            axes.append(values[found[3]])
            made.zones.append(0.0 if desc["blend"] == "off" else float(desc["leave"]) / 1e3)
            made.stops.append(desc["blend"] == "off")
            if len(axes) > 1:
                joint = found[1] == "ej"
                share = (np.abs(np.subtract(axes[-1], axes[-2])) / speeds).max()
                if found[1] == "ec":
                    made.via[len(made.kinds)] = values[found[2]]
                made.kinds.append({"ej": "joint", "el": "linear", "ec": "circular"}[found[1]])
                made.seconds.append(share / (float(desc["vel"]) / 100) if joint else np.nan)
                made.speeds.append(np.nan if joint else float(desc["tvel"]) / 1e3)
        elif line != "waitEndMove()":
            _checked(re.fullmatch(rf"diOut\d+=(true|false)|delay\({REAL}\)", line), line)
            made.lines.append((len(axes), line))
    made.axes = np.array(axes)
    return made


def gcode(text: str) -> Parsed:
    """A .ngc of G1 in inverse time, of which the joints are the axes."""
    made = Parsed("", np.zeros(0), [], [])
    axes: list[list[float]] = []
    modes: set[str] = set()
    for line in text.splitlines():
        if line.startswith("; "):
            made.comments.append(line[2:])
        elif re.fullmatch(rf"G21 G90 G93|G61|G64 P{REAL}|G94|M2", line):
            modes |= set(line.split())
        elif found := re.fullmatch(rf"G1((?: [XYZUVWABC]{REAL})+) F({REAL})", line):
            if not {"G21", "G90", "G93"} <= modes or "M2" in modes:
                raise GrammarError(line)
            axes.append([float(word[1:]) for word in found[1].split()])
            made.stops.append(False)
            if len(axes) > 1:
                made.kinds.append("joint")
                made.seconds.append(60.0 / float(found[2]))
                made.speeds.append(np.nan)
        else:
            _checked(re.fullmatch(rf"M6[45] P\d+|G4 P{REAL}", line), line)
            made.lines.append((len(axes), line))
    if "M2" not in modes:
        raise GrammarError("no end")
    made.axes = np.array(axes)
    return made
