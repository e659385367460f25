"""What the tool must do, x = f(q): one frame or several, position, orientation, or an expression of your own.

Uses `robot`. Read first: `task.py`, `task_kinds.py`.
"""

from .frame_task import FrameTask, StackedTask, stacked
from .task import Task
from .task_kinds import custom_task, line_of_sight, pose, position, relative_pose

__all__ = [
    "FrameTask",
    "StackedTask",
    "Task",
    "custom_task",
    "line_of_sight",
    "pose",
    "position",
    "relative_pose",
    "stacked",
]
