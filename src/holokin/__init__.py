"""holokin: makes redundant robots repeatable, and measures how repeatable any control law is.

The flow:

    Robot -> Task (x = f(q)) -> Strategy (G) -> Trajectory -> report
                 Constraint (g) --^      ^-- Path

A strategy is a right inverse G(q) of the task Jacobian, dq = G dx. It is holonomic when the planes range G
are tangent to leaves g(q) = const; then a closed tool path gives a closed joint path.
"""

from . import analysis, auditing, constraints, designing, export, laws, motion, proof, recording, robot, strategies
from .analysis import Verdict, around, curvature, involutivity
from .auditing import audit, audit_recording
from .constraints import Constraint, arm_angle, coupled, custom, linear, lock, stationary
from .designing import Advice, Coverage, Design, NearestLaw, Objective, advise, coverage, design, nearest
from .errors import HolokinError
from .export import export_c
from .frame_tasks import custom_task, line_of_sight, pose, position, relative_pose
from .motion import (
    ControlLaw,
    TimedTrajectory,
    all_postures,
    controller,
    drift,
    follow,
    inverse,
    move_to_leaf,
    obstruction,
    path_spread,
    retime,
    simulate,
)
from .path import Path, arc, circle, join, line, polyline
from .proof import Certificate, certify
from .recording import read_recording, read_workspace
from .robot import (
    Part,
    Robot,
    catalogue,
    compose,
    from_dh,
    from_mjcf,
    from_pinocchio,
    from_roboticstoolbox,
    from_urdf,
    from_yourdfpy,
    load,
    with_base_pose,
    with_tool,
)
from .strategies import Strategy, holonomic, moore_penrose, null_basis, radial, weighted
from .task import Task
from .trajectory import Status, Trajectory
from .version import __version__ as __version__
from .workspaces import Workspace, workspace

__all__ = [
    "Advice",
    "Certificate",
    "Constraint",
    "ControlLaw",
    "Coverage",
    "Design",
    "HolokinError",
    "NearestLaw",
    "Objective",
    "Part",
    "Path",
    "Robot",
    "Status",
    "Strategy",
    "Task",
    "TimedTrajectory",
    "Trajectory",
    "Verdict",
    "Workspace",
    "advise",
    "all_postures",
    "analysis",
    "arc",
    "arm_angle",
    "around",
    "audit",
    "audit_recording",
    "auditing",
    "catalogue",
    "certify",
    "circle",
    "compose",
    "constraints",
    "controller",
    "coupled",
    "coverage",
    "curvature",
    "custom",
    "custom_task",
    "design",
    "designing",
    "drift",
    "export",
    "export_c",
    "follow",
    "from_dh",
    "from_mjcf",
    "from_pinocchio",
    "from_roboticstoolbox",
    "from_urdf",
    "from_yourdfpy",
    "holonomic",
    "inverse",
    "involutivity",
    "join",
    "laws",
    "line",
    "line_of_sight",
    "linear",
    "load",
    "lock",
    "moore_penrose",
    "motion",
    "move_to_leaf",
    "nearest",
    "null_basis",
    "obstruction",
    "path_spread",
    "polyline",
    "pose",
    "position",
    "proof",
    "radial",
    "read_recording",
    "read_workspace",
    "recording",
    "relative_pose",
    "retime",
    "robot",
    "simulate",
    "stationary",
    "strategies",
    "weighted",
    "with_base_pose",
    "with_tool",
    "workspace",
]
