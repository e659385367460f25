"""Names that a controller's language keeps for itself, so that no program, tool or frame may have them.

Words: RAPID, ABB, "Technical reference manual: RAPID kernel" (3HAC050946), reserved words; KRL, KUKA, "KSS 8.x: KRL
syntax", keywords and data types; URScript, Universal Robots, "The URScript Programming Language", flow of control,
functions, threads; VAL3, Staubli, "VAL 3 reference manual", control instructions and types; TP, FANUC, "HandlingTool
operator's manual", names of programs. Instructions are those that the written programs use: a program of such a name
would call itself. INFORM calls a job by `CALL JOB:NAME`, and a G-code program is known by its file alone: their names
are apart from their words.
"""

from __future__ import annotations

import re
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
    and anin anout b_and b_exor b_not b_or bool brake c_dis c_ori c_ptp c_spl c_vel case char circ circ_rel confirm
    const continue decl def default defdat deffct delay digin distance do else end enddat endfct endfor endif
    endloop endspline endswitch endwhile enum exit exor ext extfct false for frame global goto halt if import int
    interrupt is lin lin_rel loop maximum minimum not off on or part path prio ptp ptp_rel ptp_spline public pulse
    real repeat resume return scirc sec scirc_rel signal slin slin_rel spl spl_rel spline sptp sptp_rel start
    stop_when_path struc switch then time_block to trigger true until wait when while axis e6axis pos e6pos load bas
    forward inverse
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


def taken(name: str, language: str, program: bool = True) -> str:
    """Who has the name of a program, or of what it uses, already, in words for a message; empty if it is free."""
    if program and name.lower() in DEVICES:
        return "Windows and controllers keep it for a device"
    known = LANGUAGE_WORDS.get(language)
    return f"{language}, or the program itself, has this word already" if known and known.has(name, program) else ""
