"""holokin: makes redundant robots repeatable, and proves it.

The flow:

    Robot -> Task (x = f(q)) -> Strategy (G) -> Trajectory -> report
                 Constraint (g) --^      ^-- Path

A strategy is a right inverse G(q) of the task Jacobian, dq = G dx. It is holonomic when the planes range G
are tangent to leaves g(q) = const; then a closed tool path gives a closed joint path.
"""

from .analysis import Region, Verdict, around, box, curvature, involutivity, involutivity_of
from .constraint import (
    Constraint,
    Cost,
    arm_angle,
    centring_cost,
    coupled,
    custom,
    gravity_cost,
    height,
    linear,
    lock,
    manipulability_cost,
    posture_cost,
    stack,
    stationary,
    tilted,
    total,
)
from .control import (
    Controller,
    asymptotically_cyclic,
    closed_loop,
    damped,
    drive,
    gradient_projection,
    impedance_with_memory,
    repetitive_motion,
)
from .errors import HolokinError
from .motion import Drift, InverseKinematics, Spread, drift, follow, inverse, path_spread, settle
from .path import Path, arc, circle, join, line, polyline
from .robot import DHRow, Robot, catalogue, from_dh, from_urdf, load, mass_matrix, urdf_tips
from .strategy import (
    Strategy,
    coupled_twist,
    holonomic,
    impedance,
    inertia_weighted,
    moore_penrose,
    null_basis,
    pfaffian,
    radial,
    right_inverse,
    weighted,
)
from .task import Task, pose, position
from .trajectory import Status, Trajectory

__version__ = "0.1.0"

__all__ = [
    "Constraint",
    "Controller",
    "Cost",
    "DHRow",
    "Drift",
    "HolokinError",
    "InverseKinematics",
    "Path",
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
    "asymptotically_cyclic",
    "box",
    "catalogue",
    "centring_cost",
    "circle",
    "closed_loop",
    "coupled",
    "coupled_twist",
    "curvature",
    "custom",
    "damped",
    "drift",
    "drive",
    "follow",
    "from_dh",
    "from_urdf",
    "gradient_projection",
    "gravity_cost",
    "height",
    "holonomic",
    "impedance",
    "impedance_with_memory",
    "inertia_weighted",
    "inverse",
    "involutivity",
    "involutivity_of",
    "join",
    "line",
    "linear",
    "load",
    "lock",
    "manipulability_cost",
    "mass_matrix",
    "moore_penrose",
    "null_basis",
    "path_spread",
    "pfaffian",
    "polyline",
    "pose",
    "position",
    "posture_cost",
    "radial",
    "repetitive_motion",
    "right_inverse",
    "settle",
    "stack",
    "stationary",
    "tilted",
    "total",
    "urdf_tips",
    "weighted",
]
