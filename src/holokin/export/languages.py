"""What motion can be written in: each language with its writer, and what of a job the writer takes.

A new language is a writer in a file of its own, and one more entry of `LANGUAGES`: the command line and jobs follow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from .fanuc import SHORT, to_fanuc
from .gcode import to_gcode
from .inform import NAME as INFORM_NAME
from .inform import to_inform
from .krl import NAME as KRL_NAME
from .krl import to_krl
from .rapid import NAME as RAPID_NAME
from .rapid import to_rapid
from .robot_program import Program
from .ros import to_ros
from .urscript import STEPS, to_urscript
from .val3 import NAME as VAL3_NAME
from .val3 import to_val3

COMMON = ("name", "about", "wiring", "tolerance", "lines")
CELL = ("tool", "base", "payload", "zone")


@dataclass(frozen=True)
class Language:
    """A language: what it is, its writer, the writer's arguments, the length of a program's name by default, what a
    job must give, and the controller's steps [s] at which every sample is sent, unless somebody asks for fewer."""

    about: str
    write: Callable[..., Program]
    takes: tuple[str, ...] = COMMON
    longest: int = 64
    needs: tuple[str, ...] = ()
    streams: tuple[float, ...] = ()


LANGUAGES = {
    "ros": Language("ROS 2: a trajectory_msgs/JointTrajectory, as YAML.", to_ros, ("about",)),
    "rapid": Language(
        "ABB RAPID: a module of MoveAbsJ, MoveL and MoveC.", to_rapid, (*COMMON, *CELL), longest=RAPID_NAME - 2
    ),
    "krl": Language(
        "KUKA KRL: a .src of SPTP, LIN and CIRC, and its .dat.", to_krl, (*COMMON, *CELL), longest=KRL_NAME
    ),
    "urscript": Language(
        "Universal Robots URScript: servoj at 2 or 8 ms, else movej, movel and movec.",
        to_urscript,
        (*COMMON, "tool", "payload", "zone"),
        streams=STEPS,
    ),
    "inform": Language(
        "Yaskawa INFORM: a .JBI of MOVJ and MOVL, in pulses.",
        to_inform,
        (*COMMON, "tool", "zone", "pulses", "speeds"),
        INFORM_NAME,
        needs=("pulses",),
    ),
    "val3": Language(
        "Staubli VAL3: a .pgx of movej, movel and movec.",
        to_val3,
        (*COMMON, "tool", "base", "zone", "speeds"),
        VAL3_NAME,
    ),
    "gcode": Language("G-code: a .ngc of G1; the joints are the axes.", to_gcode, (*COMMON, "zone", "letters")),
    "ls": Language("FANUC TP: an .LS of J, L and C.", to_fanuc, (*COMMON, *CELL, "coupled"), SHORT),
}
"""By the name of their subcommand of `holokin export`."""
