"""The fewest leaves that together serve a workspace, each with the tool poses that it serves as one function.

Uses `designing` and `checking`. Read first: `sheet.py`, `cover_by_sheets.py`, `sheet_map.py`.
"""

from .cover_by_sheets import sheets
from .sheet import Sheet
from .sheet_map import PoseRest, SheetAnswers, Sheets
from .sheets_file import write_sheets

__all__ = ["PoseRest", "Sheet", "SheetAnswers", "Sheets", "sheets", "write_sheets"]
