"""Errors that a motion meets: limits, singularities, the ends of the workspace."""

from __future__ import annotations

from collections.abc import Iterable
from enum import Enum
from typing import Any, ClassVar

from .holokin_error import HolokinError, posture_text

KEPT = "what was computed is in .trajectory"
"""The cure of a path that ends early, for who calls from Python."""


class JointLimitError(HolokinError):
    """A posture outside the joint limits: the joint that is farthest outside."""

    def __init__(self, joint: str, value: float, lower: float, upper: float, cure: str = "") -> None:
        self.joint, self.value, self.lower, self.upper = joint, value, lower, upper
        past = max(lower - value, value - upper)
        self.fact = f"joint {joint!r} is at {value:.6g}, {past:.3g} outside its limits [{lower:.6g}, {upper:.6g}]"
        self.cure = cure or "choose another start posture or path, or widen the limits in the robot description"
        super().__init__(f"{self.fact}; {self.cure}")


class SingularityKind(Enum):
    """Why a strategy has no value at a posture."""

    KINEMATIC = "the task Jacobian J loses rank: the tool cannot move in every direction of the task"
    ALGORITHMIC = (
        "J has full rank, but the strategy does not determine the joint rates: a self-motion obeys it, too "
        "(H = [N_G N], or [J; J_g], is singular)"
    )
    REPRESENTATION = (
        "a representation that the task or the constraint uses is singular or ends: its rates are not defined"
    )


class SingularityError(HolokinError):
    """A posture at which a strategy or representation is not defined."""

    _cure: ClassVar[dict[SingularityKind, str]] = {
        SingularityKind.KINEMATIC: "keep the path away from this posture, or drop task rows",
        SingularityKind.ALGORITHMIC: "choose another constraint or N_G there, or another leaf (start posture)",
        SingularityKind.REPRESENTATION: "choose another orientation=, 'twist' has no such singularity, or another "
        "constraint; for a radial law a start nearer by, or more steps",
    }

    _measure: ClassVar[dict[SingularityKind, str]] = {
        SingularityKind.KINEMATIC: "smallest singular value",
        SingularityKind.ALGORITHMIC: "rcond",
        SingularityKind.REPRESENTATION: "distance from the singularity",
    }

    def __init__(self, kind: SingularityKind, q: Iterable[float], what: str, measure: float) -> None:
        self.kind, self.q, self.measure = kind, tuple(float(v) for v in q), float(measure)
        super().__init__(
            f"{kind.name.lower()} singularity of {what} at q = {posture_text(self.q)} "
            f"({self._measure[kind]} {measure:.2e}): {kind.value}; {self._cure[kind]}"
        )


class StartError(HolokinError):
    """The start posture does not put the tool at the start of the path. `unit`: what speaks against metres; `turned`:
    angle between the tool's orientation and that of the path."""

    def __init__(
        self, distance: float, tool: Iterable[float], path: Iterable[float], unit: str = "", turned: float = 0.0
    ) -> None:
        self.distance, self.tool, self.path, self.turned = distance, tuple(tool), tuple(path), turned
        angle = f", {turned:.3g} rad from the tool's orientation to the path's" if turned > 1e-9 else ""
        cure = "move the path with path.starting_at(point), choose a start on it, or go there by hk.motion.approach"
        super().__init__(
            f"the tool at the start posture is {distance:.3g} (m or rad) away from the start of the path: "
            f"tool {posture_text(self.tool)}, path {posture_text(self.path)}{angle}; {unit or cure}"
        )


class OpenPathError(HolokinError):
    """A closed path is needed."""

    def __init__(self, what: str, gap: float) -> None:
        self.gap = gap
        super().__init__(
            f"{what} needs a closed path, but this one ends {gap:.3g} (m or rad) from its start; "
            "close it with hk.path.join(path, ...) or use path + path.reversed()"
        )


class LostToolError(HolokinError):
    """The tool is too far from where a control step wants it."""

    def __init__(self, error: float, most: float) -> None:
        self.error, self.most = error, most
        super().__init__(
            f"the tool is {error:.3g} (m or rad) from where it is wanted, a control step corrects at most {most:.3g}; "
            "give poses in metres that begin at the tool (hk.motion.approach leads to them), or a larger most_error"
        )


class PathError(HolokinError):
    """A path that could not be followed to its end; `.trajectory` holds what was computed."""

    def __init__(self, fact: str, cure: str, trajectory: Any = None) -> None:
        self.trajectory = trajectory
        self.fact, self.cure = fact, cure
        super().__init__(f"{fact}; {cure}")


class OutOfReachError(PathError):
    """The path leaves the workspace."""


class OutsideRegionError(PathError):
    """A tool pose that does not belong to the region over which inverse kinematics was asked to be one function."""

    def __init__(self, position: Iterable[float]) -> None:
        self.position = tuple(float(x) for x in position)
        at = ", ".join(f"{x:.4g}" for x in self.position)
        super().__init__(
            f"the pose at [{at}] does not belong to the region", "give a pose in it, ask for a larger region, or none"
        )


class NoSheetError(PathError):
    """A tool pose that no sheet of a map serves."""

    def __init__(self, position: Iterable[float], sheets: int) -> None:
        self.position = tuple(float(x) for x in position)
        at = ", ".join(f"{x:.4g}" for x in self.position)
        many = f"none of the {sheets} sheets serves" if sheets != 1 else "the only sheet does not serve"
        cure = "ask s.why(pose), keep to the workspace, or ask for more of it: hk.sheets(..., share=1)"
        super().__init__(f"{many} the pose at [{at}]", cure)


class NoSeamError(HolokinError):
    """Two sheets between which the arm does not change with its tool still."""

    def __init__(self, first: int, second: int, reason: str) -> None:
        self.first, self.second, self.reason = first, second, reason
        cure = "let the arm leave the pose to change, or name other places: s.seams(at=...)"
        super().__init__(f"between the sheets {first} and {second} there is no seam: {reason}; {cure}")


class DividedPathError(PathError):
    """A path that the sheets serve in parts only; `.trajectory` is the first part."""


class PathSingularityError(PathError):
    """The path leads into a singularity of the strategy; `.kind` says of which sort."""

    def __init__(self, kind: SingularityKind, fact: str, cure: str, trajectory: Any = None) -> None:
        self.kind = kind
        super().__init__(fact, cure, trajectory)


class TrackingError(PathError):
    """Integration lost the path."""


class BranchError(PathError):
    """Leaf following met the end of its branch."""


class JumpError(BranchError):
    """A leaf that ends where g jumps: at the posture `.q`, by `.level`, in the operation `.what` of its formula."""

    def __init__(
        self, fact: str, cure: str, trajectory: Any = None, what: str = "", q: Iterable[float] = (), level: float = 0.0
    ) -> None:
        self.what, self.q, self.level = what, tuple(float(v) for v in q), level
        super().__init__(fact, cure, trajectory)


class LimitReachedError(PathError):
    """A joint ran into its limit along the path."""


class ControllerError(PathError):
    """A controller that threw, blocked, or answered with something that is not n finite joint rates."""

    def __init__(self, name: str, fact: str, trajectory: Any = None) -> None:
        self.name = name
        cure = f"a law takes (q, pose, twist, dt) and returns n finite joint rates; {KEPT}"
        super().__init__(f"{name} stopped {fact}", cure, trajectory)


class InfeasibleError(HolokinError):
    """No joint rates within the limits do what the task asks."""

    def __init__(self, name: str, q: Iterable[float]) -> None:
        self.q = tuple(float(v) for v in q)
        super().__init__(
            f"{name}: at q = {posture_text(self.q)} no joint rates within the limits follow the path; "
            "go slower, or choose another start or path"
        )
