"""The fewest leaves that together serve a workspace, each with the tool poses that it serves as one function.

Uses `workspace_coverage` and `motion_checking`. Read first: `sheet.py`, `cover_by_sheets.py`, `sheet_map.py`.
"""

from .cover_by_sheets import sheets
from .pose_rest import PoseRest
from .seams import NoSeam, Seam, Seams
from .sheet import Sheet
from .sheet_map import SheetAnswers, Sheets
from .sheet_motion import Division, SheetMotion, SheetPiece, UnservedPart
from .sheets_file import write_sheets
from .still_motion import Hindrance, StillMotion, self_motion_between

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
    "self_motion_between",
    "sheets",
    "write_sheets",
]
