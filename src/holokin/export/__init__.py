"""What leaves for a controller: strategies and maps of sheets as plain C with a self-test, and timed motion as robot
programs.

Uses `motion` and `analysis/sheets`. Read first: `c/c_folder.py`, `programs/robot_program.py`.
"""

from .c.c_folder import Exported, export_c
from .c.c_folder import c_name as c_name
from .c.c_folder import check as check
from .c.sheets_c import export_sheets
from .programs.fanuc import to_fanuc
from .programs.franka import to_franka
from .programs.gcode import to_gcode
from .programs.inform import to_inform
from .programs.kinova import to_kinova
from .programs.krl import to_krl
from .programs.languages import LANGUAGES as LANGUAGES
from .programs.languages import language_of as language_of
from .programs.moves import ProcessLines, ToolDeviation, ToolTolerance
from .programs.rapid import to_rapid
from .programs.robot_program import Program
from .programs.robot_program import ascii_text as ascii_text
from .programs.ros import to_ros, write_mcap
from .programs.sunrise import to_sunrise
from .programs.targets import Wiring
from .programs.urscript import to_urscript
from .programs.val3 import to_val3
from .programs.xarm import to_xarm
from .ros.moveit_package import MoveItPackage, export_moveit
from .ros.ros2_control_package import Ros2ControlPackage, export_ros2_control

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
    "to_franka",
    "to_gcode",
    "to_inform",
    "to_kinova",
    "to_krl",
    "to_rapid",
    "to_ros",
    "to_sunrise",
    "to_urscript",
    "to_val3",
    "to_xarm",
    "write_mcap",
]
