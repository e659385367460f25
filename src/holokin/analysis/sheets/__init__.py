"""The fewest leaves that together serve a workspace, each with the tool poses that it serves as one function; the maps
of whole arms, and `ik`, which answers by them.

Uses `analysis/coverage` and `motion/checks`. Read first: `sheet.py`, `cover_by_sheets.py`, `arm_maps.py`.
"""

from typing import TYPE_CHECKING

from ...base.extra_module import loads
from .arm_maps import ik

if TYPE_CHECKING:
    from .cover_by_sheets import sheets
    from .seams import Division, NoSeam, Seam, Seams, SheetMotion, SheetPiece, UnservedPart
    from .sheet import Sheet
    from .sheet_map import PoseRest, SheetAnswers, Sheets, write_sheets
    from .still_motion import Hindrance, StillMotion, self_motion_between
else:  # who asks for an arm's joints does not wait for what looks for sheets
    __getattr__ = loads(
        __name__,
        cover_by_sheets="sheets",
        seams="Division NoSeam Seam Seams SheetMotion SheetPiece UnservedPart",
        sheet="Sheet",
        sheet_map="PoseRest SheetAnswers Sheets write_sheets",
        still_motion="Hindrance StillMotion self_motion_between",
    )

__all__ = [
    "Division",
    "Hindrance",
    "NoSeam",
    "PoseRest",
    "Seam",
    "Seams",
    "Sheet",
    "SheetAnswers",
    "SheetMotion",
    "SheetPiece",
    "Sheets",
    "StillMotion",
    "UnservedPart",
    "ik",
    "self_motion_between",
    "sheets",
    "write_sheets",
]
