"""What motion can be written in: each language with its writer, and what of a job the writer takes.

A new language is a writer in a file of its own, one more entry of `LANGUAGES`, and a line of help in the command line.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

from .fanuc import SHORT, to_fanuc
from .franka import to_franka
from .gcode import to_gcode
from .inform import NAME as INFORM_NAME
from .inform import to_inform
from .kinova import to_kinova
from .krl import NAME as KRL_NAME
from .krl import to_krl
from .rapid import NAME as RAPID_NAME
from .rapid import to_rapid
from .robot_program import Program
from .ros import to_ros
from .sunrise import to_sunrise
from .urscript import STEPS, to_urscript
from .val3 import NAME as VAL3_NAME
from .val3 import to_val3
from .xarm import to_xarm

COMMON = ("name", "about", "wiring", "tolerance", "lines")
CELL = ("tool", "base", "payload", "zone")


@dataclass(frozen=True)
class Language:
    """A language: its writer, the writer's arguments, the length of a program's name by default, what a job must give,
    the controller's steps [s] at which every sample is sent, unless somebody asks for fewer, and its controller in
    words, with a pattern of the names of the arms that it moves."""

    write: Callable[..., Program]
    takes: tuple[str, ...] = COMMON
    longest: int = 64
    needs: tuple[str, ...] = ()
    streams: tuple[float, ...] = ()
    controller: str = ""
    arms: str = "$^"


_INFORM = (*COMMON, "tool", "zone", "pulses", "speeds", "group")
LANGUAGES = {
    "ros": Language(to_ros, ("about",), controller="ROS 2"),
    "rapid": Language(to_rapid, (*COMMON, *CELL, "arc"), RAPID_NAME - 2, controller="ABB", arms=r"irb|abb|yumi|gofa"),
    "sunrise": Language(to_sunrise, (*COMMON, "speeds"), controller="KUKA Sunrise", arms="iiwa|lbr"),
    "krl": Language(to_krl, (*COMMON, *CELL), KRL_NAME, controller="KUKA KR C", arms=r"\bkr_?\d|kuka"),
    "urscript": Language(
        to_urscript, (*COMMON, "tool", "payload", "zone"), streams=STEPS, controller="Universal Robots", arms=r"\bur\d"
    ),
    "inform": Language(
        to_inform, _INFORM, INFORM_NAME, ("pulses",), controller="Yaskawa", arms=r"motoman|yaskawa|\bsia|\bsda|\bgp\d"
    ),
    "val3": Language(
        to_val3,
        (*COMMON, "tool", "base", "zone", "speeds"),
        VAL3_NAME,
        controller="Staubli",
        arms=r"staubli|\btx2?_?\d",
    ),
    "xarm": Language(to_xarm, controller="UFACTORY", arms="xarm|uf_"),
    "franka": Language(to_franka, ("name", "about", "wiring"), controller="Franka", arms=r"panda|franka|\bfr3|\bfer\b"),
    "kinova": Language(to_kinova, ("name", "about", "wiring"), controller="Kinova Gen3", arms="gen3"),
    "gcode": Language(to_gcode, (*COMMON, "zone", "letters"), controller="a G-code controller"),
    "ls": Language(
        to_fanuc, (*COMMON, *CELL, "coupled"), longest=SHORT, controller="FANUC", arms=r"fanuc|lr_?mate|\bcrx|\bm\d+i"
    ),
}
"""By the name of their subcommand of `holokin export`."""


def language_of(*names: str) -> str | None:
    """The language of the controller that an arm of these names comes with; None where they do not tell."""
    words = " ".join(names).lower()
    return next((name for name, language in LANGUAGES.items() if re.search(language.arms, words)), None)
