"""What leaves for a controller: a strategy as plain C with a self-test, and timed motion as robot programs."""

from .building import check as check
from .fanuc import to_fanuc
from .folder import Exported, export_c
from .folder import c_name as c_name
from .krl import to_krl
from .program import Program, Wiring
from .rapid import to_rapid
from .ros import to_ros, write_mcap
from .urscript import to_urscript

__all__ = [
    "Exported",
    "Program",
    "Wiring",
    "export_c",
    "to_fanuc",
    "to_krl",
    "to_rapid",
    "to_ros",
    "to_urscript",
    "write_mcap",
]
