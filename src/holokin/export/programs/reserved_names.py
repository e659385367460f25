"""Names that a controller's language keeps for itself, so that no program, tool or frame may have them.

Words: RAPID, ABB, "Technical reference manual: RAPID kernel" (3HAC050946), reserved words; KRL, KUKA, "Quickguide KRL
syntax, KSS release 8.x" (2012), whose names are no keyword, its statements and data types; URScript, Universal Robots,
"The URScript Programming Language", flow of control, functions, threads; VAL3, Staubli, "VAL 3 reference manual" 5.3
(D28062804A), control instructions and types; TP, FANUC, "HandlingTool operator's manual", names of programs. The first
three were held against word lists of others: the lexer of intellij-rapid (BossyMr), the syntax files rapid-for-vim and
krl-for-vim 3.0 (KnoP-01), and vim-urscript (de-vri-es). Of VAL3 no such list was found.

Instructions are those that the written programs use: a program of such a name would call itself. Others may stand in
process lines: there a name is looked for, too. TP and INFORM call programs by CALL and RUN, and a G-code program is
known by its file alone: their names are apart from their words.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

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
        found = re.fullmatch(pattern, name, 0 if self.exact else re.IGNORECASE)
        return bool(found) or (name if self.exact else name.lower()) in self.kept


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

LANGUAGE_WORDS = {
    "RAPID": Words(frozenset(_RAPID.split()), r"[pc]\d+", r"v\d+|z\d+|fine|do\d+|tool0|wobj0|load0"),
    "KRL": Words(frozenset(_KRL.split()), r"X[PCFG]\d+|XERR"),
    "URScript": Words(frozenset(_URSCRIPT.split()), exact=True),
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
    for line in used:
        code = re.sub(r'"[^"]*"', "", line)
        if re.search(pattern, code, 0 if known and known.exact else re.IGNORECASE):
            return f"{line!r} has this name for something else, or calls the program from itself"
    return ""
