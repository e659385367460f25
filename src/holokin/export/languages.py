"""What motion can be written in: each language with its writer, and what of a job the writer takes.

A new language is a writer in a file of its own, and one more entry of `LANGUAGES`: the command line and jobs follow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from .fanuc import SHORT, to_fanuc
from .krl import NAME as KRL_NAME
from .krl import to_krl
from .rapid import NAME as RAPID_NAME
from .rapid import to_rapid
from .robot_program import Program
from .ros import to_ros
from .urscript import STEPS, to_urscript

COMMON = ("name", "about", "wiring", "tolerance", "lines")
CELL = ("tool", "base", "payload", "zone")


@dataclass(frozen=True)
class Language:
    """A language: what it is, its writer, the writer's arguments, the length of a program's name by default, and the
    controller's steps [s] at which every sample is sent, unless somebody asks for fewer."""

    about: str
    write: Callable[..., Program]
    takes: tuple[str, ...] = COMMON
    longest: int = 64
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
    "ls": Language("FANUC TP: an .LS of J, L and C.", to_fanuc, (*COMMON, *CELL, "coupled"), SHORT),
}
"""By the name of their subcommand of `holokin export`."""
