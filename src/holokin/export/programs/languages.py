"""What motion can be written in: each language with its writer, and what of a job the writer takes.

A new language is a writer in a file of its own, one more entry of `LANGUAGES`, and a line of help in the command line.
"""

from __future__ import annotations

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
    """A language: its writer, the writer's arguments, the length of a program's name by default, what a
    job must give, and the controller's steps [s] at which every sample is sent, unless somebody asks for fewer."""

    write: Callable[..., Program]
    takes: tuple[str, ...] = COMMON
    longest: int = 64
    needs: tuple[str, ...] = ()
    streams: tuple[float, ...] = ()


LANGUAGES = {
    "ros": Language(to_ros, ("about",)),
    "rapid": Language(to_rapid, (*COMMON, *CELL, "arc"), longest=RAPID_NAME - 2),
    "krl": Language(to_krl, (*COMMON, *CELL), longest=KRL_NAME),
    "urscript": Language(to_urscript, (*COMMON, "tool", "payload", "zone"), streams=STEPS),
    "inform": Language(to_inform, (*COMMON, "tool", "zone", "pulses", "speeds", "group"), INFORM_NAME, ("pulses",)),
    "val3": Language(to_val3, (*COMMON, "tool", "base", "zone", "speeds"), longest=VAL3_NAME),
    "sunrise": Language(to_sunrise, (*COMMON, "speeds")),
    "xarm": Language(to_xarm),
    "franka": Language(to_franka, ("name", "about", "wiring")),
    "kinova": Language(to_kinova, ("name", "about", "wiring")),
    "gcode": Language(to_gcode, (*COMMON, "zone", "letters")),
    "ls": Language(to_fanuc, (*COMMON, *CELL, "coupled"), longest=SHORT),
}
"""By the name of their subcommand of `holokin export`."""
