"""What leaves for a controller: strategies and maps of sheets as plain C with a self-test, and timed motion as robot
programs.

Uses `motion` and `sheet_maps`. Read first: `c_folder.py`, `robot_program.py`.
"""

from .c_folder import Exported, export_c
from .c_folder import c_name as c_name
from .controller_moves import ToolDeviation, ToolTolerance
from .fanuc import to_fanuc
from .gcode import to_gcode
from .inform import to_inform
from .krl import to_krl
from .languages import LANGUAGES as LANGUAGES
from .moveit_package import MoveItPackage, export_moveit
from .process_lines import ProcessLines
from .program_targets import Wiring
from .rapid import to_rapid
from .robot_program import Program
from .ros import to_ros, write_mcap
from .ros2_control_package import Ros2ControlPackage, export_ros2_control
from .self_test import check as check
from .sheets_c import export_sheets
from .urscript import to_urscript
from .val3 import to_val3

__all__ = [
    "Exported",
    "MoveItPackage",
    "ProcessLines",
    "Program",
    "Ros2ControlPackage",
    "ToolDeviation",
    "ToolTolerance",
    "Wiring",
    "export_c",
    "export_moveit",
    "export_ros2_control",
    "export_sheets",
    "to_fanuc",
    "to_gcode",
    "to_inform",
    "to_krl",
    "to_rapid",
    "to_ros",
    "to_urscript",
    "to_val3",
    "write_mcap",
]
