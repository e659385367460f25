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

from .base.errors import HolokinError, MissingExtraError, NoAttributeError, error_form
from .version import __version__ as __version__

if TYPE_CHECKING:
    from . import analysis, export, learning, motion, path, proof, robot, strategies
    from .analysis.audit import audit, audit_recording
    from .analysis.audit.logs import read_recording
    from .analysis.coverage import coverage
    from .analysis.curvature import around, curvature, cusps, involutivity
    from .analysis.design import advise, design
    from .analysis.sheets import ik, sheets
    from .app.job.runner import read_sheets
    from .app.studio import studio
    from .app.survey import survey
    from .base.poses import pose_of
    from .motion import Trajectory, controller, drift, follow, retime, simulate
    from .motion.checks import Scene, check
    from .path import Path, Workspace, circle, line, polyline, read_paths, spline, workspace
    from .proof import certify, unique_region
    from .robot import Robot, compose, from_dh, from_urdf, load, obstacle, with_base_pose, with_limits, with_tool
    from .strategies import Strategy, holonomic, moore_penrose, null_basis, radial, weighted
    from .strategies.constraints import Constraint, arm_angle, coupled, custom, linear, lock, stationary
    from .strategies.tasks import Task, custom_task, pose, position, stacked

__all__ = [
    "Constraint",
    "HolokinError",
    "Path",
    "Robot",
    "Scene",
    "Strategy",
    "Task",
    "Trajectory",
    "Workspace",
    "advise",
    "analysis",
    "arm_angle",
    "around",
    "audit",
    "audit_recording",
    "certify",
    "check",
    "circle",
    "compose",
    "controller",
    "coupled",
    "coverage",
    "curvature",
    "cusps",
    "custom",
    "custom_task",
    "design",
    "drift",
    "export",
    "follow",
    "from_dh",
    "from_urdf",
    "holonomic",
    "ik",
    "involutivity",
    "learning",
    "line",
    "linear",
    "load",
    "lock",
    "moore_penrose",
    "motion",
    "null_basis",
    "obstacle",
    "path",
    "polyline",
    "pose",
    "pose_of",
    "position",
    "proof",
    "radial",
    "read_paths",
    "read_recording",
    "read_sheets",
    "retime",
    "robot",
    "sheets",
    "simulate",
    "spline",
    "stacked",
    "stationary",
    "strategies",
    "studio",
    "survey",
    "unique_region",
    "weighted",
    "with_base_pose",
    "with_limits",
    "with_tool",
    "workspace",
]

_HOMES = {
    "base.poses": "pose_of",
    "robot": "Robot compose from_dh from_urdf load obstacle with_base_pose with_limits with_tool",
    "path": "Path Workspace circle line polyline read_paths spline workspace",
    "strategies.tasks": "Task custom_task pose position stacked",
    "strategies.constraints": "Constraint arm_angle coupled custom linear lock stationary",
    "strategies": "Strategy holonomic moore_penrose null_basis radial weighted",
    "motion": "Trajectory controller drift follow retime simulate",
    "motion.checks": "Scene check",
    "proof": "certify unique_region",
    "analysis.curvature": "around curvature cusps involutivity",
    "analysis.coverage": "coverage",
    "analysis.design": "advise design",
    "analysis.sheets": "ik sheets",
    "analysis.audit": "audit audit_recording",
    "analysis.audit.logs": "read_recording",
    "app.job.runner": "read_sheets",
    "app.survey": "survey",
    "app.studio": "studio",
}
"""Folder of the package -> the names of it that are public here: it is loaded when one of them is first asked for."""

_ROOMS = (
    "robot", "path", "strategies.tasks", "strategies.constraints", "strategies", "motion.ik", "motion.control",
    "motion", "motion.checks", "proof", "analysis.curvature", "analysis.coverage", "analysis.design", "analysis.sheets",
    "analysis.audit", "analysis.audit.logs", "export",
)  # fmt: skip
"""Folders that have other public names, too."""

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
        form = next((f"hk.{room}.{name}" for room in _ROOMS if name in _loaded(room).__all__), form)
        raise NoAttributeError("holokin", name, __all__, form or error_form(name))


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
