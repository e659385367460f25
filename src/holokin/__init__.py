"""holokin: makes redundant robots repeatable, and measures how repeatable any control law is.

The flow:

    Robot -> Task (x = f(q)) -> Strategy (G) -> Trajectory -> report
                 Constraint (g) --^      ^-- Path

A strategy is a right inverse G(q) of the task Jacobian, dq = G dx. It is holonomic when the planes range G
are tangent to leaves g(q) = const; then, in a region of tool poses around the start, the same pose has the same joints.
"""

from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import TYPE_CHECKING, Any

from .errors import HolokinError, MissingExtraError, NoAttributeError
from .version import __version__ as __version__

if TYPE_CHECKING:
    from . import (
        auditing,
        constraints,
        control_laws,
        designing,
        export,
        interop,
        inverse_kinematics,
        motion,
        motion_analysis,
        motion_checking,
        proof,
        robot,
        robot_logs,
        sheet_maps,
        strategies,
        workspace_coverage,
    )
    from .auditing import audit, audit_recording
    from .base.poses import pose_of
    from .constraints import Constraint, arm_angle, coupled, custom, linear, lock, stationary
    from .control_laws import ControlLaw, mink_task, pink_task
    from .designing import (
        Advice,
        ClosestHolonomic,
        Design,
        Objective,
        advise,
        closest_holonomic,
        design,
    )
    from .export import export_c
    from .inverse_kinematics import all_postures, inverse, move_to_leaf
    from .job.saved_sheets import read_sheets
    from .motion import TimedTrajectory, approach, controller, drift, follow, path_spread, retime, simulate
    from .motion.trajectory import Status, Trajectory
    from .motion_analysis import Verdict, around, curvature, cusps, involutivity, obstruction
    from .motion_checking import CheckReport, check
    from .path import (
        Path,
        Waypoints,
        arc,
        blended,
        circle,
        figure_eight,
        join,
        line,
        passes,
        path_of,
        polyline,
        raster,
        read_svg,
        read_waypoints,
        read_workspace,
        spiral,
        spline,
        with_leads,
    )
    from .path.synchronized_paths import synchronized, through
    from .path.workspaces import Workspace, workspace
    from .proof import Certificate, certify, unique_region
    from .robot import (
        Part,
        Robot,
        catalogue,
        compose,
        coordinates,
        from_dh,
        from_mjcf,
        from_pinocchio,
        from_roboticstoolbox,
        from_urdf,
        from_yourdfpy,
        load,
        obstacle,
        to_mjcf,
        to_urdf,
        with_base_pose,
        with_capsules,
        with_limits,
        with_shape,
        with_tool,
    )
    from .robot_logs import read_recording
    from .sheet_maps import Sheets, sheets, write_sheets
    from .strategies import Strategy, holonomic, moore_penrose, null_basis, radial, weighted
    from .studios import studio
    from .surveys import survey
    from .tasks.frame_task import stacked
    from .tasks.task import Task
    from .tasks.task_kinds import custom_task, line_of_sight, pose, position, relative_pose
    from .workspace_coverage import Coverage, coverage

__all__ = [
    "Advice",
    "Certificate",
    "CheckReport",
    "ClosestHolonomic",
    "Constraint",
    "ControlLaw",
    "Coverage",
    "Design",
    "HolokinError",
    "Objective",
    "Part",
    "Path",
    "Robot",
    "Sheets",
    "Status",
    "Strategy",
    "Task",
    "TimedTrajectory",
    "Trajectory",
    "Verdict",
    "Waypoints",
    "Workspace",
    "advise",
    "all_postures",
    "approach",
    "arc",
    "arm_angle",
    "around",
    "audit",
    "audit_recording",
    "auditing",
    "blended",
    "catalogue",
    "certify",
    "check",
    "circle",
    "closest_holonomic",
    "compose",
    "constraints",
    "control_laws",
    "controller",
    "coordinates",
    "coupled",
    "coverage",
    "curvature",
    "cusps",
    "custom",
    "custom_task",
    "design",
    "designing",
    "drift",
    "export",
    "export_c",
    "figure_eight",
    "follow",
    "from_dh",
    "from_mjcf",
    "from_pinocchio",
    "from_roboticstoolbox",
    "from_urdf",
    "from_yourdfpy",
    "holonomic",
    "interop",
    "inverse",
    "inverse_kinematics",
    "involutivity",
    "join",
    "line",
    "line_of_sight",
    "linear",
    "load",
    "lock",
    "mink_task",
    "moore_penrose",
    "motion",
    "motion_analysis",
    "motion_checking",
    "move_to_leaf",
    "null_basis",
    "obstacle",
    "obstruction",
    "passes",
    "path_of",
    "path_spread",
    "pink_task",
    "polyline",
    "pose",
    "pose_of",
    "position",
    "proof",
    "radial",
    "raster",
    "read_recording",
    "read_sheets",
    "read_svg",
    "read_waypoints",
    "read_workspace",
    "relative_pose",
    "retime",
    "robot",
    "robot_logs",
    "sheet_maps",
    "sheets",
    "simulate",
    "spiral",
    "spline",
    "stacked",
    "stationary",
    "strategies",
    "studio",
    "survey",
    "synchronized",
    "through",
    "to_mjcf",
    "to_urdf",
    "unique_region",
    "weighted",
    "with_base_pose",
    "with_capsules",
    "with_leads",
    "with_limits",
    "with_shape",
    "with_tool",
    "workspace",
    "workspace_coverage",
    "write_sheets",
]

_HOMES = {
    "auditing": "audit audit_recording",
    "base.poses": "pose_of",
    "constraints": "Constraint arm_angle coupled custom linear lock stationary",
    "control_laws": "ControlLaw mink_task pink_task",
    "designing": "Advice ClosestHolonomic Design Objective advise closest_holonomic design",
    "export": "export_c",
    "inverse_kinematics": "all_postures inverse move_to_leaf",
    "job.saved_sheets": "read_sheets",
    "motion": "TimedTrajectory approach controller drift follow path_spread retime simulate",
    "motion.trajectory": "Status Trajectory",
    "motion_analysis": "Verdict around curvature cusps involutivity obstruction",
    "motion_checking": "CheckReport check",
    "path": "Path Waypoints arc blended circle figure_eight join line passes path_of polyline raster"
    " read_svg read_waypoints read_workspace spiral spline with_leads",
    "path.synchronized_paths": "synchronized through",
    "path.workspaces": "Workspace workspace",
    "proof": "Certificate certify unique_region",
    "robot": "Part Robot catalogue compose coordinates from_dh from_mjcf from_pinocchio from_roboticstoolbox from_urdf"
    " from_yourdfpy load obstacle to_mjcf to_urdf with_base_pose with_capsules with_limits with_shape with_tool",
    "robot_logs": "read_recording",
    "sheet_maps": "Sheets sheets write_sheets",
    "strategies": "Strategy holonomic moore_penrose null_basis radial weighted",
    "studios": "studio",
    "surveys": "survey",
    "tasks.frame_task": "stacked",
    "tasks.task": "Task",
    "tasks.task_kinds": "custom_task line_of_sight pose position relative_pose",
    "workspace_coverage": "Coverage coverage",
}
"""Module of the package -> the public names that it has: it is loaded when one of them is first asked for."""

_APP = {"job": "app", "reports": "app", "commands": "app", "surveys": "survey", "studios": "studio"}
"""Folders whose packages an extra installs."""


def __dir__() -> list[str]:
    """All public names, loaded or not."""
    return sorted({*globals(), *__all__})


if not TYPE_CHECKING:  # so that a misspelt name is an error of types

    def __getattr__(name: str) -> Any:
        """A public name, or a folder of the package, is loaded when it is first asked for."""
        home = next((home for home, names in _HOMES.items() if name in names.split()), None)
        if home is not None:
            try:
                value = globals()[name] = getattr(_loaded(home), name)
            except MissingExtraError as problem:
                return _refusing(problem)
            return value
        if name.startswith("_"):  # what Python and other libraries look for
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        if find_spec(f"{__name__}.{name}") is not None:
            return _loaded(name)
        form = f"hk.load({name.lower()!r})" if name.lower() in _loaded("robot").catalogue() else ""
        raise NoAttributeError("holokin", name, __all__, form)


def _loaded(home: str) -> ModuleType:
    """A module of the package. Raises: MissingExtraError: an extra installs what it needs."""
    room = home.partition(".")[0]
    try:
        return import_module(f".{home}", __name__)
    except ModuleNotFoundError as problem:
        if room not in _APP or not problem.name or problem.name.startswith(__name__):
            raise
        raise MissingExtraError(problem.name, _APP[room]) from None


def _refusing(problem: MissingExtraError) -> Callable[..., Any]:
    """What stands in the place of a function that needs an extra, so that `help(hk)` and `import *` work without it."""

    def refuse(*_values: Any, **_keys: Any) -> Any:
        raise problem

    refuse.__doc__ = str(problem)
    return refuse
