"""holokin: makes redundant robots repeatable, and proves it.

The flow:

    Robot -> Task (x = f(q)) -> Strategy (G) -> Trajectory -> report
                 Constraint (g) --^      ^-- Path

A strategy is a right inverse G(q) of the task Jacobian, dq = G dx. It is holonomic when the planes range G
are tangent to leaves g(q) = const; then a closed tool path gives a closed joint path.
"""

from .analysis import (
    LogAudit,
    Region,
    Verdict,
    around,
    audit_recording,
    box,
    curvature,
    involutivity,
    involutivity_of,
)
from .constraint import (
    Constraint,
    Cost,
    arm_angle,
    centring_cost,
    coupled,
    custom,
    height,
    linear,
    lock,
    manipulability_cost,
    posture_cost,
    stack,
    stationary,
)
from .errors import HolokinError
from .motion import Drift, Spread, drift, follow, path_spread
from .path import Path, arc, circle, join, line, polyline
from .recording import Recording, read_recording
from .robot import DHRow, Robot, catalogue, from_dh, from_urdf, load, urdf_tips
from .strategy import Strategy, coupled_twist, holonomic, moore_penrose, null_basis, pfaffian, radial, weighted
from .task import Task, pose, position
from .trajectory import Status, Trajectory

__version__ = "0.1.0"

__all__ = [
    "Constraint",
    "Cost",
    "DHRow",
    "Drift",
    "HolokinError",
    "LogAudit",
    "Path",
    "Recording",
    "Region",
    "Robot",
    "Spread",
    "Status",
    "Strategy",
    "Task",
    "Trajectory",
    "Verdict",
    "arc",
    "arm_angle",
    "around",
    "audit_recording",
    "box",
    "catalogue",
    "centring_cost",
    "circle",
    "coupled",
    "coupled_twist",
    "curvature",
    "custom",
    "drift",
    "follow",
    "from_dh",
    "from_urdf",
    "height",
    "holonomic",
    "involutivity",
    "involutivity_of",
    "join",
    "line",
    "linear",
    "load",
    "lock",
    "manipulability_cost",
    "moore_penrose",
    "null_basis",
    "path_spread",
    "pfaffian",
    "polyline",
    "pose",
    "position",
    "posture_cost",
    "radial",
    "read_recording",
    "stack",
    "stationary",
    "urdf_tips",
    "weighted",
]
