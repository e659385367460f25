"""What all robot programs share: their files, their names, and the facts of their headers."""

from __future__ import annotations

import re
import textwrap
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.files import write_texts
from ...base.types import Result
from ...base.units import SI
from ...motion import TimedTrajectory
from ...version import __version__
from ..c.c_text import line
from .moves import FINER, KINDS, PLACES, ToolDeviation, common
from .targets import Targets, Wiring

# --- Names that a controller's language keeps for itself, so that no program, tool or frame may have them.
#
# Words: RAPID, ABB, "Technical reference manual: RAPID kernel" (3HAC050946), reserved words; KRL, KUKA, "Quickguide KRL
# syntax, KSS release 8.x" (2012), whose names are no keyword, its statements and data types; URScript, Universal
# Robots, "The URScript Programming Language", flow of control, functions, threads; VAL3, Staubli, "VAL 3 reference
# manual" 5.3 (D28062804A), control instructions and types; TP, FANUC, "HandlingTool operator's manual", names of
# programs. The first three were held against word lists of others: the lexer of intellij-rapid (BossyMr), the syntax
# files rapid-for-vim and krl-for-vim 3.0 (KnoP-01), and vim-urscript (de-vri-es). Of VAL3 no such list was found.
#
# Instructions are those that the written programs use: a program of such a name would call itself. Others may stand in
# process lines: there a name is looked for, too. TP and INFORM call programs by CALL and RUN, and a G-code program is
# known by its file alone: their names are apart from their words. A Python program of the name of a module that it
# imports would be that module, and a table joints.csv that which `holokin export` writes beside each program.

DEVICES = frozenset({"con", "prn", "aux", "nul", *(f"{port}{i}" for port in ("com", "lpt") for i in range(1, 10))})
"""Names that Windows, on which programs are loaded, and FANUC's controllers keep for devices: no file has them."""


@dataclass(frozen=True)
class Words:
    """What a language keeps.

    Attributes:
        kept: its words and the instructions that programs use, in small letters unless `exact`.
        declared: pattern of the names that the written program declares itself.
        data: pattern of what the controller has, such as tools and zones: a tool may be named so, a program not.
        exact: whether capitals make another name.
    """

    kept: frozenset[str]
    declared: str = r"(?!)"
    data: str = r"(?!)"
    exact: bool = False

    def has(self, name: str, program: bool) -> bool:
        """Whether the language, or the program itself, has a name already."""
        pattern = f"{self.declared}|{self.data}" if program else self.declared
        match = re.fullmatch(pattern, name, 0 if self.exact else re.IGNORECASE)
        return bool(match) or (name if self.exact else name.lower()) in self.kept


_RAPID = """
    alias and backward case connect const default div do else elseif endfor endfunc endif endmodule endproc
    endrecord endtest endtrap endwhile error exit false for from func goto if inout local mod module nostepin not
    noview or pers proc raise readonly record retry return step sysmodule task test then to trap true trynext undo
    var viewonly while with xor moveabsj movel movec calcrobt cirpathmode gripload setdo waittime jointtarget
    robtarget
"""
_KRL = """
    abs acos and anin anout asycancel asycont asyptp asystop atan2 axis b_and b_exor b_not b_or bas base_data bool brake
    c_dis c_ori c_ptp c_spl c_vel ca case cast_from cast_to cclose channel char circ circ_rel confirm const const_vel
    continue copen cos cread cwrite decl def default defdat deffct delay digin disable distance do e3axis e3pos e6axis
    e6pos else enable end enddat endfct endfor endif endloop endskip endspline endswitch endwhile enum exit exor ext
    extfct extfctp extp false for forward frame global goto halt if import int interrupt inverse is lin lin_rel load
    load_data loop maximum minimum move_emi not off on on_error_proceed onstart or part path pos prio ptp ptp_rel
    ptp_spline public pulse real repeat resume return scirc scirc_rel sec signal sin skip slin slin_rel spl spl_rel
    spline sptp sptp_rel sqrt sread start step stop stop_when_path struc switch swrite tan then time_block to tool_data
    trigger true until wait when while with
"""
_URSCRIPT = """
    and or xor not def end if elif else while break continue return sec thread kill join run halt pause sleep sync
    global local enter_critical exit_critical True False movej movel movec movep servoj stopj stopl set_tcp
    set_payload set_digital_out
"""
_VAL3 = """
    and or xor not true false if then else elseif endif while endwhile do until for to step endfor switch case
    default break endswitch return call begin end program public private global local include void bool num string
    dio aio sio config trsf point frame tool joint mdesc jointrx pointrx screen off cartesian movej movel movec
    waitendmove delay jointtopoint
"""

_JAVA = """
    abstract assert boolean break byte case catch char class const continue default dispose do double else enum
    extends final finally float for goto if implements import initialize inject int interface joint jointposition
    lbr long math native new null override package private protected ptp public return roboticsapiapplication run
    short spline splinejp splinemotionjp static strictfp string super switch synchronized target targets this
    threadutil throw throws transient true false try void volatile while
"""

LANGUAGE_WORDS = {
    "RAPID": Words(frozenset(_RAPID.split()), r"[pcs]\d+", r"v\d+|z\d+|fine|do\d+|tool0|wobj0|load0"),
    "KRL": Words(frozenset(_KRL.split()), r"X[PCFG]\d+|XERR"),
    "URScript": Words(frozenset(_URSCRIPT.split()), exact=True),
    "Sunrise": Words(frozenset(_JAVA.split())),
    "xArm": Words(frozenset({"sys", "xarm", "runpy", "pathlib"})),
    "Kortex": Words(frozenset({"csv", "sys", "runpy", "threading", "pathlib", "kortex_api", "joints"})),
    "libfranka": Words(frozenset({"sys", "runpy", "pathlib", "numpy", "pylibfranka", "joints"})),
    "VAL3": Words(frozenset(_VAL3.split()), r"l_(jA|jB|pA|pB|mDesc)", r"flange|world|diOut\d+"),
}
"""By the name of the language in messages; the others keep the names of devices alone."""


CALLS = r"\b(?:CALL|RUN)\s+(?:JOB:)?{}\b"
"""How a line calls a program in languages whose names are apart from their words."""


def taken(name: str, language: str, program: bool = True, used: Sequence[str] = ()) -> str:
    """Who has the name of a program, or of what it uses, already, in words for a message; empty if it is free.

    Args:
        used: process lines, and names of tools and frames, in which a program's own name may not be.
    """
    if program and name.lower() in DEVICES:
        return "Windows and controllers keep it for a device"
    known = LANGUAGE_WORDS.get(language)
    if known and known.has(name, program):
        return f"{language}, or the program itself, has this word already"
    pattern = rf"(?<![\w$#.&]){re.escape(name)}\b" if known else CALLS.format(re.escape(name))
    for text in used:
        code = re.sub(r'"[^"]*"', "", text)
        if re.search(pattern, code, 0 if known and known.exact else re.IGNORECASE):
            return f"{text!r} has this name for something else, or calls the program from itself"
    return ""


SPELT = str.maketrans(dict(zip("äöüÄÖÜßøæ", ("ae", "oe", "ue", "Ae", "Oe", "Ue", "ss", "oe", "ae"), strict=True)))
"""Letters that are more than a letter with a mark; of others the mark is left out."""


@dataclass(frozen=True)
class Program(Result):
    """A robot program: its files by name, and how it was cut down from the samples.

    `targets` are the joint targets; `deviation` [rad or m] is how far the joints would be from the timed trajectory
    if they moved evenly from target to target. `tool` is how far the tool and the joints are from it as the
    controller moves, where the program was written to a tolerance of the tool, else None. `notes` say what a user
    should know of this program. `facts` is a text of all that is known of it, of which the program's own header has
    five lines; it is saved beside the first file, with the ending .txt.
    """

    files: Mapping[str, str]
    targets: int
    deviation: float
    tool: ToolDeviation | None = None
    notes: tuple[str, ...] = ()
    facts: str = ""

    def __str__(self) -> str:
        within = self.tool or f"joints within {self.deviation:.2g} rad or m of the timed motion"
        return "; ".join([f"{within}", f"{', '.join(self.files)}: {self.targets} targets", *self.notes])

    @property
    def text(self) -> str:
        """The first file, the program itself."""
        return next(iter(self.files.values()))

    @typed
    def save(self, folder: str | Path) -> tuple[Path, ...]:
        """Write the files and the facts into a folder, made if need be, all or none; returns their paths.

        Raises: WriteError.
        """
        beside = {Path(next(iter(self.files))).with_suffix(".txt").name: self.facts} if self.facts else {}
        every = {**self.files, **beside}
        write_texts(Path(folder), every)
        return tuple(Path(folder, name) for name in every)


@dataclass(frozen=True)
class Header:
    """What a program says of itself: `lines` of ASCII, five for its own text, all `facts` for the file beside it, and
    `notes` of words that were written in other letters."""

    lines: tuple[str, ...]
    facts: str
    notes: tuple[str, ...]

    def program(self, files: Mapping[str, str], goals: Targets, notes: Sequence[str] = ()) -> Program:
        """The program of these targets with this header in its files."""
        return Program(files, len(goals.t), goals.deviation, goals.tool, (*self.notes, *notes), self.facts)


def header(
    timed: TimedTrajectory, about: str, goals: Targets | None, more: Sequence[str] = (), width: int = 100
) -> Header:
    """What a program says of itself.

    Args:
        about: where it is from, and the strategy.
        more: facts of the language.
        width: characters of a line of the program.
    """
    start = "The controller chooses the way to the first target: make sure that this way is free"
    facts = [f"Written by holokin {__version__}", ascii_text(about) or "strategy: not told"]
    facts += [*_timing_facts(timed, goals), *_deviation_facts(timed, goals), start, *more]
    text = [part for line in facts for part in textwrap.wrap(line, 100, break_on_hyphens=False)]
    # Five lines for the operator.
    free = "make sure that the way to the first target is free; all facts: its .txt"
    beside = free if len(free) <= width else "check way to start; see its .txt"
    count = f", {len(goals.t)} targets" if goals is not None else ""
    few = [f"holokin {__version__}", facts[1], f"{timed.duration:.3f} s{count}", _within(timed, goals), beside]
    lines = [line if len(line) <= width else f"{line[: width - 3].rstrip()}..." for line in few]
    foreign = [words for words in (about, *timed.joint_names) if not words.isascii()]
    notes = [f"the program holds ASCII alone: {words!r} is {ascii_text(words)!r} there" for words in foreign]
    return Header(tuple(lines), "\n".join([*text, ""]), tuple(notes))


def docstring(head: Header) -> str:
    """Lines of a header that stand between three quotation marks in Python."""
    return "\n".join(line.replace('"', "'").replace("\\", "/") for line in head.lines)


def _within(timed: TimedTrajectory, goals: Targets | None) -> str:
    """How near a program is to the motion, in at most 32 characters."""
    if goals is None:
        return f"samples at {1e3 * timed.dt:g} ms"
    tool = goals.tool
    if tool is None:
        unit, factor = goals.dialect.units.together(timed.joint_units)
        return f"joints within {factor * goals.deviation:.2g} {unit}"
    near = f"{1e3 * tool.position:.2g} mm, {np.rad2deg(tool.rotation):.2g} deg"
    return f"tool within {near}" if tool.kept else f"NOT KEPT: {near}"


def _timing_facts(timed: TimedTrajectory, goals: Targets | None) -> list[str]:
    """How the motion was timed, and the limits, signs and offsets of each joint."""
    lines = [f"{timed.profile} motion of {timed.duration:.3f} s, timed at steps of {1e3 * timed.dt:g} ms"]
    limits, linear = timed.limits, goals is not None and goals.linear
    wiring = Wiring() if goals is None else goals.wiring
    units = SI if goals is None else goals.dialect.units
    limits_named = [("speed", "velocity", "")]
    limits_named += [] if linear else [("acc", "acceleration", "^2"), ("jerk", "jerk", "^3")]
    for i, (name, si) in enumerate(zip(timed.joint_names, timed.joint_units, strict=True)):
        unit, factor = units.name(si), units.factor(si)
        span = f"{factor * limits.lower[i]:.6g} to {factor * limits.upper[i]:.6g} {unit}"
        rates = [
            f"{what} {factor * getattr(limits, rate)[i]:.6g} {unit}/s{power}"
            for what, rate, power in limits_named
            if np.isfinite(getattr(limits, rate)[i])
        ]
        turned = [f"sign {wiring.signs[name]:+d}"] if name in wiring.signs else []
        turned += [f"offset {factor * wiring.offsets[name]:.6g} {unit}"] if name in wiring.offsets else []
        lines.append(f"{ascii_text(name)}: " + ", ".join([span, *rates, *turned]))
    return lines


def _deviation_facts(timed: TimedTrajectory, goals: Targets | None) -> list[str]:
    """How near the targets keep to the timed motion, and by which moves."""
    lines = []
    if goals is not None:
        unit, factor = goals.dialect.units.together(timed.joint_units)
        within = f"within {factor * goals.deviation:.2g} {unit}"
        if goals.tool is not None:
            lines.append(f"{len(goals.t)} joint targets, {_counted(goals)}")
            lines += [*goals.tool.sentences(unit, factor), *_resolution(timed, goals)]
        elif len(goals.t) == len(timed):
            lines.append(f"{len(goals.t)} joint targets, one for each step")
        else:
            lines.append(f"{len(goals.t)} joint targets; even motion between them is {within} of the timed motion")
        if goals.linear:
            chosen = "the controller chooses acc and jerk of the joints: none are stated"
            lines.append(f"on linear and circular moves {chosen}")
        lines += _reason(goals, timed) if goals.asked else []
    if timed.loop is not None:
        a, b = (timed.t[i] for i in timed.loop)
        lines.append(f"three cycles; the one from {a:.3f} s to {b:.3f} s may be repeated")
    return lines


def ascii_text(words: str) -> str:
    """Words of a file on one line of ASCII, without what ends a comment, a statement or a section in any language."""
    latin = unicodedata.normalize("NFKD", line(words).translate(SPELT))
    kept = "".join(c for c in latin if not unicodedata.combining(c))
    return re.sub(r"[^ -~]|[;<>%]", "?", kept).translate(str.maketrans("()", "[]"))


def _resolution(timed: TimedTrajectory, goals: Targets) -> list[str]:
    """How far apart the instants are at which deviations are measured, and the samples, of which targets are some."""
    fastest, step = float("nan") if goals.tool is None else goals.tool.fastest, 1e3 * timed.dt
    moved = f"in this time the tool moves at most {fastest * step / FINER:.2g} mm along the path"
    way = f"; {moved}" if np.isfinite(fastest) else ""
    lines = f"the lines that switch the process on and off are at multiples of {step:g} ms"
    return [f"deviations are measured every {step / FINER:g} ms{way}", lines]


def _counted(goals: Targets) -> str:
    """How many moves of each kind there are."""
    kinds = [move.kind for move in goals.moves]
    return ", ".join(f"{kinds.count(kind)} {kind} moves" for kind in KINDS if kind in kinds)


def _reason(goals: Targets, timed: TimedTrajectory) -> list[str]:
    """Why there are joint moves beside linear and circular ones."""
    ends = dict(enumerate(goals.samples[1:], 2))
    joint = [i for i, move in enumerate(goals.moves, 2) if move.kind == "joint" and ends[i] > timed.begin]
    reasons = ["joint moves on the way to the path"] if timed.begin else []
    if not joint:
        return [*reasons, "no other joint moves: the controller's own inverse gives our joints on the path"]
    shown = ", ".join(map(str, joint[:6])) + (", ..." if len(joint) > 6 else "")
    why = "there no linear or circular move keeps the tolerances, or the arm is nearly singular"
    return [*reasons, f"joint moves to targets {shown}: {why}"]


def checked_name(given: str, longest: int, language: str, program: bool = True, used: Sequence[str] = ()) -> str:
    """The name of a program, or of a tool or frame. Raises: ArgumentError: the language refuses it, or has it."""
    if not re.fullmatch(rf"[A-Za-z][A-Za-z0-9_]{{0,{longest - 1}}}", given):
        cure = f"{language} takes a letter, then letters, digits and _, at most {longest} in all"
        raise ArgumentError("name", given, cure)
    if why := taken(given, language, program, used):
        raise ArgumentError("name", given, f"{why}: give another one, such as {f'hk_{given}'[:longest]}")
    return given


def program_name(given: str | None, about: str, longest: int, goals: Targets, names: Sequence[object] = ()) -> str:
    """The name of a program that is given, or one made of a text. Raises: ArgumentError: as `checked_name`.

    Args:
        goals: the targets, whose process has names of its own.
        names: of tools, frames and loads; what is no text is left aside.
    """
    language = goals.dialect.language
    own = [line for place in PLACES for line in getattr(goals.lines, place) if not common(line)]
    used = [*own, *(word for word in names if isinstance(word, str))]
    if given is not None:
        return checked_name(given, longest, language, used=used)
    words = re.sub(r"[^A-Za-z0-9]+", "_", ascii_text(about) or "holokin").strip("_")
    name = ("hk_" + words if not words[:1].isalpha() else words)[:longest].rstrip("_")
    return f"hk_{name}"[:longest] if taken(name, language, used=used) else name
