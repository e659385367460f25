"""Programs of several procedures, taken apart by the rules of each language and read by its parser, as they are called.

Calls: of the documents that `grammars`, `grammars_more` and `grammars_seven` name; LinuxCNC's "O Codes": a subroutine
is defined before it is called, and no other word or comment is on the line of an o-word.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

import numpy as np

import grammars
import grammars_more
import grammars_seven
from grammars import GrammarError, Parsed
from holokin.export import Program


def procedures(
    program: Program, language: str, folder: Path, pulses: np.ndarray, speeds: np.ndarray, at: np.ndarray
) -> list[Parsed]:
    """What the main program of a language calls, in the order of the calls; joints in its own units.

    Args:
        pulses: of INFORM, per degree. speeds: greatest ones [degrees/s]. at: where a robot without calls of its own
            rests before (rad).
    """
    files = dict(program.files)
    if language == "rapid":
        return _in_one(program.text, language)
    if language == "urscript":
        return _in_one(program.text, language)
    if language == "gcode":
        return _gcode(program.text)
    if language == "sunrise":
        return _sunrise(program.text, speeds)
    if language in ("xarm", "franka", "kinova"):
        return _python(program, language, folder, at)
    called, end = _called(program.text, language)
    if language == "krl":
        read = [grammars.krl(files[f"{name}.src"], files[f"{name}.dat"]) for name in called]
    elif language == "ls":
        read = [grammars.listing(files[f"{name}.LS"]) for name in called]
    elif language == "inform":
        read = [grammars_more.inform(files[f"{name}.JBI"], pulses, speeds) for name in called]
    else:
        read = [grammars_more.val3(files[f"{name}.pgx"], speeds) for name in called]
    if [part.name for part in read] != called or len([f for f in files if f.endswith(end)]) != len(called) + 1:
        raise GrammarError(f"{called} are called, of {list(files)}")
    return read


def _called(text: str, language: str) -> tuple[list[str], str]:
    """(names that a main program calls, the ending of its files)."""
    lines = text.splitlines()
    if language == "krl":
        if (
            lines[:2] != ["&ACCESS RVP", "&REL 1"]
            or not re.fullmatch(r"DEF \w{1,24}\(\)", lines[2])
            or lines[-1] != "END"
        ):
            raise GrammarError("frame of the main program")
        return _each(lines[3:-1], r"(\w+)\(\)", ";"), ".src"
    if language == "inform":
        frame = ["/JOB", r"//NAME [A-Z]\w*", "//POS", "///NPOS 0,0,0,0,0,0", "//INST", r"///DATE [\d/]{10} \d\d:\d\d"]
        frame += ["///ATTR SC,RW", r"///GROUP1 RB\d", "NOP"]
        _frame(lines, frame)
        return _each(lines[len(frame) : -1], r"CALL JOB:([A-Z]\w*)", "'"), ".JBI"
    if language == "val3":
        root = grammars_more.ElementTree.fromstring(text.encode())
        space = "{http://www.staubli.com/robotics/VAL3/Program/2}"
        (code,) = (element.text or "" for element in root.iter(f"{space}Code"))
        lines = code.splitlines()
        if lines[0] != "begin" or lines[-1] != "end":
            raise GrammarError("frame of the code")
        return _each([line.strip() for line in lines[1:-1]], r"call (\w+)\(\)", "//"), ".pgx"
    head, _, body = text.partition("/MN\n")
    rows, _, rest = body.partition("/POS\n")
    numbered = [re.fullmatch(r" *(\d+):  (.*) ;", line) for line in rows.splitlines()]
    count = re.search(r"LINE_COUNT\s*= (\d+);", head)
    if rest != "/END\n" or None in numbered or count is None or int(count[1]) != len(numbered):
        raise GrammarError("frame of the listing")
    if [int(line[1]) for line in numbered if line] != list(range(1, len(numbered) + 1)):
        raise GrammarError("numbers of lines")
    return _each([line[2] for line in numbered if line], r"CALL (\w+)", "!"), ".LS"


def _frame(lines: Sequence[str], frame: Sequence[str]) -> None:
    for line, pattern in zip(lines, frame, strict=False):
        if not re.fullmatch(pattern, line):
            raise GrammarError(line)
    if lines[-1] != "END":
        raise GrammarError(lines[-1])


def _each(lines: Sequence[str], call: str, comment: str) -> list[str]:
    """What each line calls that is no comment."""
    found = [re.fullmatch(call, line) for line in lines if not line.startswith(comment)]
    if None in found or not found:
        raise GrammarError(f"{lines}")
    return [line[1] for line in found if line]


def _in_one(text: str, language: str) -> list[Parsed]:
    """Procedures of a module of RAPID, or functions of URScript."""
    if language == "urscript":
        *parts, main, call = re.split(r"(?m)^(?=def |\w+\(\)$)", text)[1:]
        name = re.fullmatch(r"def (\w+)\(\):", main.splitlines()[0])
        if name is None or call != f"{name[1]}()\n" or main.splitlines()[-1] != "end":
            raise GrammarError("the main function, and its call")
        called = _each([line.strip() for line in main.splitlines()[1:-1]], r"(\w+)\(\)", "#")
        read = [grammars.urscript(f"{part}{part.split('(')[0][4:]}()\n") for part in parts]
    else:
        module = re.fullmatch(r"(MODULE \w+\n)(.*)ENDMODULE\n", text, re.S)
        if module is None:
            raise GrammarError("frame of the module")
        main, *parts = re.findall(r"  PROC \w+\(\)\n.*?  ENDPROC\n", module[2], re.S)
        called = _each([line.strip() for line in main.splitlines()[1:-1]], r"(\w+);", "!")
        read = []
        for part in parts:
            # A CONST of a procedure is its own data, as that of a module is.
            name, *lines = part.splitlines()
            data = [line for line in lines if re.match(r"\s*(CONST|\[)", line)]
            moves = [line for line in lines if line not in data]
            read.append(grammars.rapid("\n".join([module[1], *data, name, *moves, "ENDMODULE"])))
    if [part.name for part in read] != called:
        raise GrammarError(f"{called} are called")
    return read


def _gcode(text: str) -> list[Parsed]:
    """Subroutines of one file; each is defined before it is called."""
    known: dict[str, list[str]] = {}
    called: list[Parsed] = []
    within = ""
    for line in text.splitlines():
        word = re.fullmatch(r"o<([a-z0-9_-]+)> (sub|endsub|call)", line)
        if line.startswith("o") and not word:
            raise GrammarError(line)
        if word and word[2] == "sub" and not within and word[1] not in known:
            within, known[word[1]] = word[1], []
        elif word and word[2] == "endsub" and within == word[1]:
            within = ""
        elif word and word[2] == "call" and not within and word[1] in known:
            called.append(grammars_more.gcode("\n".join([*known[word[1]], "M2"])))
            called[-1].name = word[1]
        elif within and line != "M2":
            known[within].append(line)
        elif line != "M2" and not line.startswith("; "):
            raise GrammarError(line)
    if not text.endswith("M2\n") or len(called) != len(known):
        raise GrammarError("no end, or subroutines that are not called")
    return called


def _sunrise(text: str, speeds: np.ndarray) -> list[Parsed]:
    """Methods of one class, each with the targets of a nested class; `javac` compiles it elsewhere."""
    run = re.search(r"public void run\(\) \{\n(.*?)\n    \}", text, re.S)
    if run is None:
        raise GrammarError("no run")
    tables = dict(
        re.findall(
            r"static class (\w+) \{\n        static final (double\[\]\[\] TARGETS = \{\n.*?\n)        \};", text, re.S
        )
    )
    head = "package application;\n\n"
    read = []
    for name in _each([line.strip() for line in run[1].splitlines()], r"(\w+)\(\);", "//"):
        body = r"\(\) \{\n        targets = (\w+)\.TARGETS;\n(.*?)\n    \}"
        method = re.search(rf"\n((?:    //[^\n]*\n)+)    private void {name}{body}", text, re.S)
        if method is None:
            raise GrammarError(f"no method {name}")
        remarks = "".join(f"{line.strip()}\n" for line in method[1].splitlines())
        alone = f"{{\n    {tables.pop(method[2])}    }};\n    public void run() {{\n{method[3]}\n    }}\n}}\n"
        read.append(
            grammars_seven.sunrise(f"{head}{remarks}public class {name} extends RoboticsAPIApplication {alone}", speeds)
        )
    if tables:
        raise GrammarError(f"{list(tables)} are of no method")
    return read


def _python(program: Program, language: str, folder: Path, at: np.ndarray) -> list[Parsed]:
    """The programs that a main program of Python runs by `runpy`; each is then run, see `grammars_seven`."""
    saved = program.save(folder)
    asked: list[Path] = []
    module = ModuleType("runpy")
    module.run_path = lambda file, run_name: asked.append(Path(file))  # type: ignore[attr-defined]
    kept = sys.modules.get("runpy")
    sys.modules["runpy"] = module
    try:
        exec(compile(program.text, str(saved[0]), "exec"), {"__name__": "__main__", "__file__": str(saved[0])})
    finally:
        sys.modules["runpy"] = kept  # type: ignore[assignment]
    read = []
    for file in asked:
        files = {name: text for name, text in program.files.items() if Path(name).stem == file.stem}
        alone = Program(files, 0, 0.0)
        ast.parse(alone.text)
        if language == "xarm":
            part = grammars_seven.xarm(alone)
        else:
            if language == "franka":
                rows = grammars_seven.franka(alone, folder, at)[-1]
            else:
                rows = np.deg2rad(grammars_seven.kinova(alone, folder)[2][:, : len(at)])
            steps = len(rows) - 1
            part = Parsed(
                "", rows, [1e-3] * steps, [False] * (steps + 1), kinds=["joint"] * steps, speeds=[np.nan] * steps
            )
            at = rows[-1]
        part.name = file.stem
        read.append(part)
    if len({Path(name).stem for name in program.files}) != len(read) + 1:
        raise GrammarError(f"{asked} are run")
    return read
