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

from .base.errors import HolokinError, MissingExtraError, NoAttributeError
from .version import __version__ as __version__

if TYPE_CHECKING:
    from . import analysis, export, learning, motion, proof, robot, strategies
    from .analysis.audit import audit, audit_recording
    from .analysis.audit.logs import read_recording
    from .analysis.coverage import Coverage, coverage
    from .analysis.curvature import Verdict, around, curvature, cusps, involutivity, obstruction
    from .analysis.design import Advice, ClosestHolonomic, Design, Objective, advise, closest_holonomic, design
    from .analysis.sheets import Sheets, sheets, write_sheets
    from .app.job.runner import read_sheets
    from .app.studio import studio
    from .app.survey import survey
    from .base.poses import pose_of
    from .export import export_c
    from .motion import TimedTrajectory, approach, controller, drift, follow, path_spread, retime, simulate
    from .motion.checks import CheckReport, Scene, check
    from .motion.control import ControlLaw, mink_task, pink_task
    from .motion.ik import all_postures, ik, move_to_leaf
    from .motion.trajectory import Status, Trajectory
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
    from .path.editing import synchronized, through
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
    from .strategies import Strategy, holonomic, moore_penrose, null_basis, radial, weighted
    from .strategies.constraints import Constraint, arm_angle, coupled, custom, linear, lock, stationary
    from .strategies.tasks.frame_task import stacked
    from .strategies.tasks.task import Task
    from .strategies.tasks.task_kinds import custom_task, line_of_sight, pose, position, relative_pose

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
    "Scene",
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
    "analysis",
    "approach",
    "arc",
    "arm_angle",
    "around",
    "audit",
    "audit_recording",
    "blended",
    "catalogue",
    "certify",
    "check",
    "circle",
    "closest_holonomic",
    "compose",
    "controller",
    "coordinates",
    "coupled",
    "coverage",
    "curvature",
    "cusps",
    "custom",
    "custom_task",
    "design",
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
    "ik",
    "involutivity",
    "join",
    "learning",
    "line",
    "line_of_sight",
    "linear",
    "load",
    "lock",
    "mink_task",
    "moore_penrose",
    "motion",
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
    "write_sheets",
]

_HOMES = {
    "analysis.audit": "audit audit_recording",
    "base.poses": "pose_of",
    "strategies.constraints": "Constraint arm_angle coupled custom linear lock stationary",
    "motion.control": "ControlLaw mink_task pink_task",
    "analysis.design": "Advice ClosestHolonomic Design Objective advise closest_holonomic design",
    "export": "export_c",
    "motion.ik": "all_postures ik move_to_leaf",
    "app.job.runner": "read_sheets",
    "motion": "TimedTrajectory approach controller drift follow path_spread retime simulate",
    "motion.trajectory": "Status Trajectory",
    "analysis.curvature": "Verdict around curvature cusps involutivity obstruction",
    "motion.checks": "CheckReport Scene check",
    "path": "Path Waypoints arc blended circle figure_eight join line passes path_of polyline raster"
    " read_svg read_waypoints read_workspace spiral spline with_leads",
    "path.editing": "synchronized through",
    "path.workspaces": "Workspace workspace",
    "proof": "Certificate certify unique_region",
    "robot": "Part Robot catalogue compose coordinates from_dh from_mjcf from_pinocchio from_roboticstoolbox from_urdf"
    " from_yourdfpy load obstacle to_mjcf to_urdf with_base_pose with_capsules with_limits with_shape with_tool",
    "analysis.audit.logs": "read_recording",
    "analysis.sheets": "Sheets sheets write_sheets",
    "strategies": "Strategy holonomic moore_penrose null_basis radial weighted",
    "app.studio": "studio",
    "app.survey": "survey",
    "strategies.tasks.frame_task": "stacked",
    "strategies.tasks.task": "Task",
    "strategies.tasks.task_kinds": "custom_task line_of_sight pose position relative_pose",
    "analysis.coverage": "Coverage coverage",
}
"""Module of the package -> the public names that it has: it is loaded when one of them is first asked for."""

_APP = {"app.studio": "studio", "app.survey": "survey"}
"""Folders of the applications whose packages an extra of their own installs; that of the others is `app`."""


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
    room = ".".join(home.split(".")[:2])
    try:
        return import_module(f".{home}", __name__)
    except ModuleNotFoundError as problem:
        if not room.startswith("app") or not problem.name or problem.name.startswith(__name__):
            raise
        raise MissingExtraError(problem.name, _APP.get(room, "app")) from None


def _refusing(problem: MissingExtraError) -> Callable[..., Any]:
    """What stands in the place of a function that needs an extra, so that `help(hk)` and `import *` work without it."""

    def refuse(*_values: Any, **_keys: Any) -> Any:
        raise problem

    refuse.__doc__ = str(problem)
    return refuse
