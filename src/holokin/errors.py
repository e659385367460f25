"""Every error of the library: each takes the facts, writes the sentence and names the cure."""

from __future__ import annotations

import errno
from collections.abc import Callable, Iterable, Sequence
from difflib import get_close_matches
from enum import Enum
from typing import Any, ClassVar

LONGEST_PART = 400
"""Characters that a fact, a value or a cure may have in a message: more, nobody reads in one sentence."""

LONGEST = 1_600
"""Characters of a whole message: a fact, a cure and some names; files and keys are at its beginning."""

MOST_NAMES = 40
"""Names that a message lists of those that are known: those of any job, robot or table of this library."""

SYNONYMS = {"pseudo-inverse": "moore-penrose", "pseudoinverse": "moore-penrose", "pinv": "moore-penrose"}
"""Names that people use -> those that are known."""

LONGEST_NAME = 200
"""Characters up to which a name is compared with the known ones; the comparison takes the product of the lengths."""


def brief(value: object, most: int = LONGEST_PART) -> str:
    """A text on one line without control characters, with its middle left out where it is longer than `most`."""
    text = value if isinstance(value, str) else _written(value, str)
    if len(text) > most:
        left_out = f" ... ({len(text) - most} characters left out) ... "
        text = text[: most - most // 3] + left_out + text[len(text) - most // 3 :]
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def shown(value: object, most: int = LONGEST_PART) -> str:
    """`repr` of a value, cut; only its type where it has none, as a whole number of 5,000 digits or a deep list."""
    return brief(_written(value, repr), most)


def _written(value: object, write: Callable[[Any], str]) -> str:
    try:
        return write(value)
    except (RecursionError, ValueError):
        return f"a value of type {type(value).__name__} that is too long to show"


def posture_text(q: Iterable[float], names: Sequence[str] = ()) -> str:
    """A posture as [0.1, -2], or with its joints' names, elbow 0.1, wrist -2; round-off below 1e-12 is 0."""
    values = [f"{0.0 if abs(float(v)) < 1e-12 else float(v):.6g}" for v in q]
    if names:
        return brief(", ".join(f"{n} {v}" for n, v in zip(names, values, strict=True)), 4 * LONGEST_PART)
    return brief(f"[{', '.join(values)}]", 2 * LONGEST_PART)


def _near(word: str, known: Sequence[str]) -> list[str]:
    """The known name most like a word, whatever the case; none if none is like it."""
    if len(word) > LONGEST_NAME:
        return []
    found = get_close_matches(word.lower(), [k.lower() for k in known], n=1, cutoff=0.5)
    return [k for k in known if k.lower() in found]


def closest(word: object, known: Sequence[str]) -> str:
    """The known name nearest to a word, as a question, and all that are known."""
    word = brief(word, LONGEST_NAME + 1)
    meant = SYNONYMS.get(word.lower())
    close = [k for k in known if k.partition(".")[0] == word or k == meant] or _near(word, known)
    hint = f"did you mean {shown(close[0], LONGEST_NAME)}? " if close else ""
    names = ", ".join(brief(name, 60) for name in known[:MOST_NAMES]) or "none"
    return f"{hint}known: {names}{f' and {len(known) - MOST_NAMES} more' if len(known) > MOST_NAMES else ''}"


class HolokinError(Exception):
    """The parent of every error that holokin raises on purpose. Its message is one line of 1,600 characters at most."""

    def __init__(self, message: object = "") -> None:
        super().__init__(brief(message, LONGEST))


class UnknownNameError(HolokinError):
    """A name (robot, joint, link, strategy, job, key) that does not exist."""

    def __init__(self, kind: str, name: str, known: Iterable[str]) -> None:
        self.kind, self.name, self.known = kind, name, tuple(known)
        super().__init__(f"unknown {brief(kind)} {shown(name, 100)}; {closest(name, self.known)}")


class ShapeError(HolokinError):
    """An array or expression of the wrong shape."""

    def __init__(self, what: str, expected: object, found: object, cure: str = "") -> None:
        self.what, self.expected, self.found = what, expected, found
        tail = f"; {cure}" if cure else ""
        super().__init__(f"{brief(what)} has shape {brief(found, 100)}, expected {brief(expected, 100)}{brief(tail)}")


class NotFiniteError(HolokinError):
    """NaN or infinite numbers where finite ones are needed."""

    def __init__(self, what: str, value: object, cure: str = "give finite numbers, in SI units") -> None:
        self.what, self.value, self.cure = what, value, cure
        super().__init__(f"{brief(what)}: NaN or infinite numbers, {brief(value)}; {cure}")


class RobotFileError(HolokinError):
    """A robot description that is missing, malformed or not supported."""

    def __init__(self, path: object, fact: str, cure: str) -> None:
        self.path, self.fact, self.cure = path, fact, cure
        super().__init__(f"{brief(path)}: {brief(fact)}; {brief(cure, LONGEST)}")


class JobError(HolokinError):
    """A job file that cannot be run: names file, key, value and cure."""

    def __init__(self, path: object, key: str, fact: str, cure: str) -> None:
        self.path, self.key, self.fact, self.cure = path, key, fact, cure
        super().__init__(f"{brief(path)}: [{brief(key, 200)}] {brief(fact)}; {brief(cure, LONGEST)}")


class RecordingError(HolokinError):
    """A log of joint motion, or a table of tool poses, that cannot be read or judged."""

    def __init__(self, path: object, fact: str, cure: str) -> None:
        self.path, self.fact, self.cure = path, fact, cure
        super().__init__(f"{brief(path)}: {brief(fact)}; {brief(cure, LONGEST)}")


class ExpressionError(HolokinError):
    """A formula in a job file that cannot be read."""

    def __init__(self, text: str, fact: str, cure: str) -> None:
        self.text = text
        self.fact, self.cure = f"cannot read the formula {shown(text, 150)}: {brief(fact)}", cure
        super().__init__(f"{self.fact}; {brief(cure, LONGEST)}")


class MassError(HolokinError):
    """A robot whose description lacks masses, or has senseless ones, where they are needed."""

    def __init__(self, robot: str, fact: str) -> None:
        super().__init__(f"the description of {robot!r} {fact}; load a URDF with sound <inertial> elements")


class ArgumentError(HolokinError):
    """A value that makes no sense where it stands."""

    def __init__(self, what: str, value: object, cure: str) -> None:
        self.what, self.value, self.cure = what, value, cure
        super().__init__(f"{brief(what)} is {shown(value)}; {brief(cure, LONGEST)}")


class NoArmError(HolokinError):
    """A chain of joints on which no shoulder, elbow and wrist are found."""

    def __init__(self, robot: str, chain: Sequence[str]) -> None:
        self.chain = tuple(chain)
        super().__init__(
            "no shoulder (three consecutive hinges that meet), elbow (the next hinge) and wrist (two or three that "
            f"meet) were found on {robot!r}, and its chain is not one of seven hinges; name joints=(shoulder, elbow, "
            f"wrist), three of {brief(', '.join(self.chain))}, or lock those before the arm"
        )


class TaskTooLargeError(HolokinError):
    """A task with more rows than the robot has joints: m > n."""

    def __init__(self, m: int, n: int, robot: str) -> None:
        self.m, self.n = m, n
        super().__init__(
            f"the task has m = {m} rows but {robot} has n = {n} joints, so J has no right inverse; "
            f"choose at most {n} rows with rows=[...], or a robot with more joints"
        )


class ConstraintRowsError(HolokinError):
    """A constraint that does not have r = n - m rows."""

    def __init__(self, name: str, rows: int, n: int, m: int) -> None:
        self.rows, self.n, self.m = rows, n, m
        cure = f"it needs exactly r = n - m = {n - m}; add or drop rows, or combine with hk.constraints.stack(...)"
        if n == m:
            cure = "no joint is left for it: keep fewer rows of the task, or give hk.moore_penrose(task) to hk.inverse"
        fact = f"constraint {name!r} has {rows} rows; the robot has n = {n} joints and the task m = {m} rows"
        super().__init__(f"{fact}: {cure}" if n == m else f"{fact}, so {cure}")


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
    """The start posture does not put the tool at the start of the path. `unit`: what speaks against metres."""

    def __init__(self, distance: float, tool: Iterable[float], path: Iterable[float], unit: str = "") -> None:
        self.distance, self.tool, self.path = distance, tuple(tool), tuple(path)
        super().__init__(
            f"the tool at the start posture is {distance:.3g} (m or rad) away from the start of the path: "
            f"tool {posture_text(self.tool)}, path {posture_text(self.path)}; "
            + (unit or "move the path with path.starting_at(point), or choose a start posture on it")
        )


class OpenPathError(HolokinError):
    """A closed path is needed."""

    def __init__(self, what: str, gap: float) -> None:
        self.gap = gap
        super().__init__(
            f"{what} needs a closed path, but this one ends {gap:.3g} (m or rad) from its start; "
            "close it with hk.join(path, ...) or use path + path.reversed()"
        )


class PathError(HolokinError):
    """A path that could not be followed to its end; `.trajectory` holds what was computed."""

    def __init__(self, fact: str, cure: str, trajectory: Any = None) -> None:
        self.trajectory = trajectory
        self.fact, self.cure = fact, cure
        super().__init__(f"{fact}; {cure}")


class OutOfReachError(PathError):
    """The path leaves the workspace."""


class PathSingularityError(PathError):
    """The path leads into a singularity of the strategy; `.kind` says of which sort."""

    def __init__(self, kind: SingularityKind, fact: str, cure: str, trajectory: Any = None) -> None:
        self.kind = kind
        super().__init__(fact, cure, trajectory)


class TrackingError(PathError):
    """Integration lost the path."""


class BranchError(PathError):
    """Leaf following met the end of its branch."""


class LimitReachedError(PathError):
    """A joint ran into its limit along the path."""


class ControllerError(PathError):
    """A controller that threw, blocked, or answered with something that is not n finite joint rates."""

    def __init__(self, name: str, fact: str, trajectory: Any = None) -> None:
        self.name = name
        cure = "a law takes (q, pose, twist, dt) and returns n finite joint rates; what was computed is in .trajectory"
        super().__init__(f"{name} stopped {fact}", cure, trajectory)


class NotHolonomicError(HolokinError):
    """A strategy without leaves, where leaves are needed; `.witness` is a posture that shows it.

    It shows it by a `gap` [joint units] between two ways of the tool to one pose, or by `curvature` [1/rad], the
    relative one of `involutivity`; the other is None.
    """

    def __init__(
        self, name: str, witness: Iterable[float], gap: float | None = None, *, curvature: float | None = None
    ) -> None:
        self.witness, self.gap, self.curvature = tuple(float(v) for v in witness), gap, curvature
        at = posture_text(self.witness)
        fact = f"at q = {at} it has a curvature of {curvature or 0:.3g} per rad of joint motion"
        if gap is not None:
            fact = f"from q = {at} two ways of the tool to one pose end {gap:.3g} (joint units) apart"
        super().__init__(
            f"{name!r} is not holonomic: {fact}; hk.radial(strategy, start) is a holonomic strategy near it"
        )


class RoundOffError(HolokinError):
    """A question that numbers cannot answer at a posture, because round-off hides the answer."""

    def __init__(self, name: str, q: Iterable[float], noise: float) -> None:
        self.q, self.noise = tuple(float(v) for v in q), noise
        super().__init__(
            f"{name!r} cannot be judged at q = {posture_text(self.q)}: round-off makes {noise:.1e} of a bracket "
            "there, and a real one could hide in it; choose a posture farther from singularities"
        )


class InfeasibleError(HolokinError):
    """No joint rates within the limits do what the task asks."""

    def __init__(self, name: str, q: Iterable[float]) -> None:
        self.q = tuple(float(v) for v in q)
        super().__init__(
            f"{name}: at q = {posture_text(self.q)} no joint rates within the limits follow the path; "
            "go slower, or choose another start or path"
        )


class EmptyRegionError(HolokinError):
    """No posture of a region could be judged."""

    def __init__(self, samples: int, first: Exception) -> None:
        self.first = first
        super().__init__(
            f"all {samples} sampled postures of the region are singular or nearly so, and nothing can be judged; "
            f"move or enlarge the region. The first said: {first}"
        )


class NativeError(HolokinError):
    """Native code that could not be made or loaded. `cause`: a word for what lies behind it, by default the fact."""

    def __init__(self, fact: str, cause: str = "") -> None:
        self.fact, self.cause = fact, cause or fact
        super().__init__(f"{fact}; everything works without native code too: set HOLOKIN_NATIVE=0")


class ExportError(HolokinError):
    """A strategy that cannot be written as C, or whose C failed its self-test."""

    def __init__(self, fact: str, cure: str) -> None:
        super().__init__(f"{fact}; {cure}")


class MissingExtraError(HolokinError):
    """An optional dependency that is not installed."""

    def __init__(self, package: str, extra: str) -> None:
        super().__init__(f"this needs {package}; install it with: pip install 'holokin[{extra}]'")


class WriteError(HolokinError):
    """A file that the system does not let us write; what stood there before is as it was."""

    _cures: ClassVar[dict[int, str]] = {
        errno.ENOSPC: "make room on that disk, or choose another place",
        errno.EDQUOT: "make room within your quota, or choose another place",
        errno.EFBIG: "raise the limit on the size of files (ulimit -f), or choose another place",
        errno.ENOENT: "make the folder first, or choose another place",
        errno.EEXIST: "choose another name",
        errno.ENAMETOOLONG: "choose a shorter name",
    }

    def __init__(self, file: object, problem: OSError) -> None:
        self.file, self.problem = file, problem
        cure = self._cures.get(problem.errno or 0, "choose another place")
        super().__init__(f"{file} cannot be written: {problem.strerror or problem}; {cure}")


class PickleError(HolokinError):
    """A value that holds functions which cannot be pickled."""

    def __init__(self, what: str, fact: str) -> None:
        super().__init__(f"{what} cannot be pickled: {brief(fact)}; pickle what you made it from, and make it again")
