"""Several motions as one program: a procedure for each, and a main program that calls them in their order.

Calls: RAPID, ABB 3HAC050946, procedure call and data declarations in routines; KRL, KUKA KSS 8.3, calls of the main
function of another module; TP, FANUC, CALL; INFORM, Yaskawa, CALL JOB:; URScript, Universal Robots, functions; VAL3,
Staubli D28062804A, call; G-code, LinuxCNC, o<name> sub, endsub and call; Sunrise, methods of one class; programs of
Python, runpy. A trajectory of ROS calls nothing: each procedure is one of its own.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import reduce
from itertools import chain
from operator import or_

from .robot_program import Program, ascii_text

Files = dict[str, str]
Main = Callable[[str, Sequence[str], Sequence[Program], Sequence[str]], Files]
"""(name, names of the procedures, their programs, facts as lines of ASCII) -> files of the whole."""


def _rapid(name: str, names: Sequence[str], programs: Sequence[Program], facts: Sequence[str]) -> Files:
    """One module; the targets of each procedure become its own data."""
    text = [f"MODULE {name}_M", *(f"  ! {fact}" for fact in facts), f"  PROC {name}()"]
    text += [*(f"    {each};" for each in names), "  ENDPROC"]
    for each, program in zip(names, programs, strict=True):
        lines = program.text.splitlines()[1:-1]
        at = lines.index(f"  PROC {each}()")
        text += ["", lines[at], *(f"  {line}" for line in lines[:at] if line), *lines[at + 1 :]]
    return {f"{name}_M.mod": "\n".join([*text, "ENDMODULE", ""])}


def _krl(name: str, names: Sequence[str], programs: Sequence[Program], facts: Sequence[str]) -> Files:
    """A module that calls the others."""
    text = [
        "&ACCESS RVP",
        "&REL 1",
        f"DEF {name}()",
        *(f"; {fact}" for fact in facts),
        *(f"{each}()" for each in names),
    ]
    return {f"{name}.src": "\n".join([*text, "END", ""])} | _all_files(programs)


def _urscript(name: str, names: Sequence[str], programs: Sequence[Program], facts: Sequence[str]) -> Files:
    """One file of functions, of which the last one calls the others and is called itself."""
    text = []
    for each, program in zip(names, programs, strict=True):
        text += [line for line in program.text.splitlines() if line != f"{each}()"]
    text += [f"def {name}():", *(f"  # {fact}" for fact in facts), *(f"  {each}()" for each in names), "end"]
    return {f"{name}.script": "\n".join([*text, f"{name}()", ""])}


def _inform(name: str, names: Sequence[str], programs: Sequence[Program], facts: Sequence[str]) -> Files:
    """A job without positions that calls the others."""
    text = programs[0].text.splitlines()
    at, first = text.index("//INST"), text.index("NOP")
    head = ["/JOB", f"//NAME {name.upper()}", "//POS", "///NPOS 0,0,0,0,0,0"]
    body = ["NOP", *(f"'{fact[:31]}" for fact in facts), *(f"CALL JOB:{each.upper()}" for each in names), "END"]
    return {f"{name.upper()}.JBI": "\n".join([*head, *text[at:first], *body, ""])} | _all_files(programs)


def _fanuc(name: str, names: Sequence[str], programs: Sequence[Program], facts: Sequence[str]) -> Files:
    """A TP program without positions that calls the others."""
    text = programs[0].text
    head = re.sub(r"(?m)^/PROG .*$", f"/PROG  {name.upper()}", text[: text.index("/MN") + 3])
    body = [*(f"  !{fact[:30]}" for fact in facts), *(f"  CALL {each.upper()}" for each in names)]
    head = re.sub(r"(?m)^(LINE_COUNT\s*= )\d+;", rf"\g<1>{len(body)};", head)
    lines = [f"{i:4d}:{line} ;" for i, line in enumerate(body, 1)]
    return {f"{name.upper()}.LS": "\n".join([head, *lines, "/POS", "/END", ""])} | _all_files(programs)


def _val3(name: str, names: Sequence[str], programs: Sequence[Program], facts: Sequence[str]) -> Files:
    """A program that calls the others of its application."""
    first = programs[0].text
    head = first[: first.index("  <Program ")]
    code = ["begin", *(f"  // {fact}" for fact in facts), *(f"  call {each}()" for each in names)]
    text = [f'  <Program name="{name}" access="public">', "    <Locals/>", f"    <Code><![CDATA[{code[0]}", *code[1:]]
    return {
        f"{name}.pgx": "\n".join([head + text[0], *text[1:], "end]]></Code>", "  </Program>", "</Programs>", ""])
    } | (_all_files(programs))


def _gcode(name: str, names: Sequence[str], programs: Sequence[Program], facts: Sequence[str]) -> Files:
    """One file of subroutines, and the calls of them."""
    text = [f"; - {fact}" for fact in facts]
    for each, program in zip(names, programs, strict=True):
        lines = [line for line in program.text.splitlines() if line != "M2"]
        text += [f"o<{each.lower()}> sub", *lines, f"o<{each.lower()}> endsub"]
    return {f"{name}.ngc": "\n".join([*text, *(f"o<{each.lower()}> call" for each in names), "M2", ""])}


def _sunrise(name: str, names: Sequence[str], programs: Sequence[Program], facts: Sequence[str]) -> Files:
    """One class, in which each procedure is a method, with a nested class of its targets."""
    first = programs[0].text
    imports, helpers = (
        first[: first.index("// ")],
        first[first.index("    private SplineJP spline") : first.rindex("}")],
    )
    text = [
        imports + "\n".join(f"// {fact}" for fact in facts),
        f"public class {name} extends RoboticsAPIApplication {{",
    ]
    text += ["    private double[][] targets;", "", "    @Inject", "    private LBR lbr;", ""]
    text += ["    @Override", "    public void run() {", *(f"        {each}();" for each in names), "    }"]
    tables = []
    for each, program in zip(names, programs, strict=True):
        rows = program.text.partition("TARGETS = {\n")[2].partition("\n    };")[0]
        body = program.text.partition("run() {\n")[2].partition("\n    }")[0]
        remarks = re.findall(r"(?m)^// .*$", program.text)
        text += ["", *(f"    {line}" for line in remarks), f"    private void {each}() {{"]
        text += [f"        targets = Of_{each}.TARGETS;", body, "    }"]
        tables += ["", "    /** A1 to A7 in degrees, and the share of the axes' greatest speed on the way there. */"]
        tables += [
            f"    private static class Of_{each} {{",
            "        static final double[][] TARGETS = {",
            rows,
            "        };",
        ]
        tables.append("    }")
    text += ["", helpers.replace("TARGETS", "targets").rstrip(), *tables, "}", ""]
    return {f"{name}.java": "\n".join(text)}


def _python(name: str, names: Sequence[str], programs: Sequence[Program], facts: Sequence[str]) -> Files:
    """A program that runs the others, up to the first that ends with an error."""
    used = next(line for line in programs[0].text.splitlines() if line.startswith(f"python {names[0]}.py"))
    told = [fact.replace('"', "'").replace("\\", "/") for fact in facts]
    text = [
        '"""',
        *told,
        "",
        used.replace(names[0], name, 1),
        '"""',
        "",
        "import runpy",
        "from pathlib import Path",
        "",
    ]
    text += ["for name in (", *(f'    "{each}.py",' for each in names), "):"]
    text += ['    runpy.run_path(str(Path(__file__).with_name(name)), run_name="__main__")', ""]
    return {f"{name}.py": "\n".join(text)} | _all_files(programs)


def _apart(names: Sequence[str], programs: Sequence[Program]) -> Files:
    """The files of programs, with the name of each before them where it is not in them."""
    named = {}
    for each, program in zip(names, programs, strict=True):
        named |= {f if each.lower() in f.lower() else f"{each}_{f}": text for f, text in program.files.items()}
    return named


def _all_files(programs: Sequence[Program]) -> Files:
    return dict(chain.from_iterable(program.files.items() for program in programs))


MAINS: dict[str, Main] = {
    "rapid": _rapid,
    "krl": _krl,
    "urscript": _urscript,
    "inform": _inform,
    "ls": _fanuc,
    "val3": _val3,
    "gcode": _gcode,
    "sunrise": _sunrise,
    "xarm": _python,
    "franka": _python,
    "kinova": _python,
}
"""How procedures are called, by the name of the language's subcommand."""


def with_procedures(
    language: str, name: str, names: Sequence[str], programs: Sequence[Program], facts: Sequence[str]
) -> Program:
    """One program of several, each a procedure of its own name, in the order in which they are called.

    Args:
        language: a key of `LANGUAGES`. name: of the main program. names: of the procedures, as their programs have
            them. facts: lines for the header of the main program.
    """
    tools = [program.tool for program in programs if program.tool is not None]
    notes = tuple(dict.fromkeys(chain.from_iterable(program.notes for program in programs)))
    if language in MAINS:
        files = MAINS[language](name, names, programs, [ascii_text(fact) for fact in facts])
    else:
        files, order = _apart(names, programs), ", ".join(names)
        notes = (*notes, f"{language} has no calls here: run the programs in the order {order}")
    tool = reduce(or_, tools) if tools else None
    deviation = max(program.deviation for program in programs)
    each = [f"{short}\n\n{program.facts}" for short, program in zip(names, programs, strict=True)]
    about = "\n".join([*facts, "", *each])
    return Program(files, sum(program.targets for program in programs), deviation, tool, notes, about)
