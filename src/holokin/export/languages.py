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
from .urscript import by_step

COMMON = ("name", "about", "wiring", "tolerance")


@dataclass(frozen=True)
class Language:
    """A language: what it is, its writer, the writer's arguments, and the length of a program's name by default."""

    about: str
    write: Callable[..., Program]
    takes: tuple[str, ...] = COMMON
    longest: int = 64


LANGUAGES = {
    "ros": Language("ROS 2: a trajectory_msgs/JointTrajectory, as YAML.", to_ros, ("about",)),
    "rapid": Language("ABB RAPID: a module of MoveAbsJ.", to_rapid, longest=RAPID_NAME - 2),
    "krl": Language("KUKA KRL: a .src of SPTP, and its .dat.", to_krl, longest=KRL_NAME),
    "urscript": Language("Universal Robots URScript: servoj at 2 or 8 ms, else movej.", by_step),
    "ls": Language("FANUC TP: an .LS of joint motions.", to_fanuc, (*COMMON, "coupled"), SHORT),
}
"""By the name of their subcommand of `holokin export`."""
