"""Every error of the library: each takes the facts, writes the sentence and names the cure."""

from __future__ import annotations

import errno
from collections.abc import Callable, Iterable, Sequence
from difflib import get_close_matches
from enum import Enum
from typing import Any, ClassVar

# --- The texts that messages are made of.

LONGEST_PART = 400
"""Characters that a fact, a value or a cure may have in a message: more, nobody reads in one sentence."""

LONGEST = 1_600
"""Characters of a whole message: a fact, a cure and some names; files and keys are at its beginning."""

MOST_NAMES = 40
"""Names that a message lists of those that are known: those of any job, robot or table of this library."""

SYNONYMS = {
    **dict.fromkeys(("pseudo-inverse", "pseudoinverse", "pinv"), "moore-penrose"),
    "leaf": "level",
    **dict.fromkeys(("waypoints", "svg"), "file"),
}
"""Names that people use -> those that are known."""

FORMS = {
    "robot.pose(q)": "fk fkine forward forward_kinematics end_effector end_effector_pose tool_pose get_pose",
    "robot.jacobian(q)": "jac jacob jacob0 jacobe geometric_jacobian get_jacobian",
    "ik = hk.ik(strategy, q0), and then q = ik(pose)": "ik inverse ikine solve_ik inverse_kinematics solve",
    "hk.follow(strategy, path, q0)": "run execute track trace plan play",
    "hk.load(name)": "load_robot load_urdf from_file robots",
}
"""What is to be written -> names by which people look for it, on nouns and in the package."""

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
    matches = get_close_matches(word.lower(), [k.lower() for k in known], n=1, cutoff=0.5)
    return [k for k in known if k.lower() in matches]


def closest(word: object, known: Sequence[str]) -> str:
    """The known name nearest to a word, as a question, and all that are known."""
    word = brief(word, LONGEST_NAME + 1)
    meant = SYNONYMS.get(word.lower())
    close = [k for k in known if k.partition(".")[0] == word or k == meant] or _near(word, known)
    hint = f"did you mean {shown(close[0], LONGEST_NAME)}? " if close else ""
    names = ", ".join(brief(name, 60) for name in known[:MOST_NAMES]) or "none"
    return f"{hint}known: {names}{f' and {len(known) - MOST_NAMES} more' if len(known) > MOST_NAMES else ''}"


# --- The parent of all errors.


class HolokinError(Exception):
    """The parent of every error that holokin raises on purpose. Its message is one line of 1,600 characters at most."""

    def __init__(self, message: object = "") -> None:
        super().__init__(brief(message, LONGEST))

    def __reduce__(self) -> Any:
        """Pickled as message and facts: the children are made from other arguments than their message."""
        return _unpickled, (type(self), self.args), vars(self)


def _unpickled(kind: type[HolokinError], arguments: tuple[Any, ...]) -> HolokinError:
    return kind.__new__(kind, *arguments)


# --- Errors of what was given or asked: names, arrays, files, robots, tasks, calls.


class UnknownNameError(HolokinError):
    """A name (robot, joint, link, strategy, job, key) that does not exist."""

    def __init__(self, kind: str, name: str, known: Iterable[str]) -> None:
        self.kind, self.name, self.known = kind, name, tuple(known)
        super().__init__(f"unknown {brief(kind)} {shown(name, 100)}; {closest(name, self.known)}")


class NoAttributeError(HolokinError, AttributeError):
    """A name that a noun or the package does not have; `form` is what to write instead, where that is known.

    It is Python's `AttributeError` too, so that `hasattr` and `getattr` work.
    """

    def __init__(self, owner: str, name: str, known: Iterable[str], form: str = "") -> None:
        self.owner, self.name, self.known = owner, name, tuple(known)
        form = form or next((form for form, names in FORMS.items() if name.lower() in names.split()), "")
        cure = f"write {form}" if form else closest(name, self.known)
        super().__init__(f"{brief(owner)} has no {shown(name, 100)}; {cure}")


class CallError(HolokinError, TypeError):
    """A call with an argument too many, too few or of another name; or a result that was used as True or False.

    Python takes objects for True, and so `if verdict:` would be a yes where the answer is no.
    """

    def __init__(self, fact: str, cure: str) -> None:
        self.fact, self.cure = fact, cure
        super().__init__(f"{brief(fact)}; {brief(cure, LONGEST)}")


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


class OwnFunctionError(HolokinError):
    """A function of the user's own that raises, or gives something else than what is wanted of it.

    `.q` is the posture at which it was asked, where there is one, and `.problem` what it raised.
    """

    def __init__(
        self, what: str, fact: str, cure: str, q: Iterable[float] = (), problem: Exception | None = None
    ) -> None:
        self.what, self.fact, self.cure = what, fact, cure
        self.q, self.problem = tuple(float(v) for v in q), problem
        super().__init__(f"{brief(what)}, a function of yours, {brief(fact, 3 * LONGEST_PART)}; {brief(cure)}")


class FileError(HolokinError):
    """A file that cannot be used as it is: a log, table, drawing, certificate, survey or map of sheets."""

    def __init__(self, path: object, fact: str, cure: str) -> None:
        self.path, self.fact, self.cure = path, fact, cure
        super().__init__(f"{brief(path)}: {brief(fact)}; {brief(cure, LONGEST)}")


class RobotFileError(FileError):
    """A robot description that is missing, malformed, not supported, or lacks what is needed, as masses."""


class JobError(HolokinError):
    """A job file that cannot be run: names file, key, value and cure."""

    def __init__(self, path: object, key: str, fact: str, cure: str) -> None:
        self.path, self.key, self.fact, self.cure = path, key, fact, cure
        super().__init__(f"{brief(path)}: [{brief(key, 200)}] {brief(fact)}; {brief(cure, LONGEST)}")


class ExpressionError(HolokinError):
    """A formula in a job file that cannot be read."""

    def __init__(self, text: str, fact: str, cure: str) -> None:
        self.text = text
        self.fact, self.cure = f"cannot read the formula {shown(text, 150)}: {brief(fact)}", cure
        super().__init__(f"{self.fact}; {brief(cure, LONGEST)}")


class ArgumentError(HolokinError):
    """A value that makes no sense where it stands."""

    def __init__(self, what: str, value: object, cure: str) -> None:
        self.what, self.value, self.cure = what, value, cure
        super().__init__(f"{brief(what)} is {'not given' if value is None else shown(value)}; {brief(cure, LONGEST)}")


class NoProofError(ArgumentError):
    """A strategy that no proof is made of; `.cure` says what to certify instead."""

    def __init__(self, name: str, cure: str) -> None:
        self.name, self.cure = name, cure
        super().__init__("the strategy to certify", name, cure)


class NoArmError(HolokinError):
    """A chain of joints on which no shoulder, elbow and wrist are found."""

    def __init__(self, robot: str, chain: Sequence[str]) -> None:
        self.chain = tuple(chain)
        super().__init__(
            "no shoulder (three consecutive hinges that meet), elbow (the next hinge) and wrist (two or three that "
            f"meet) were found on {robot!r}, and its chain is not one of seven hinges; name joints=(shoulder, elbow, "
            f"wrist), three of {brief(', '.join(self.chain))}, or lock those before the arm"
        )


class RowsError(HolokinError):
    """A task with more rows m than the robot has joints n, or a constraint that has not r = n - m rows."""

    def __init__(self, name: str, rows: int, n: int, m: int | None = None) -> None:
        self.rows, self.n, self.m = rows, n, rows if m is None else m
        if m is None:
            fact = f"the task has m = {rows} rows but {name} has n = {n} joints, so J has no right inverse"
            cure = f"choose at most {n} rows with rows=[...], or a robot with more joints"
        else:
            fact = f"constraint {name!r} has {rows} rows; the robot has n = {n} joints and the task m = {m} rows"
            join = "hk.strategies.constraints.stack(...)"
            cure = f"it needs exactly r = n - m = {n - m}; add or drop rows, or combine with {join}"
            if n == m:
                cure = "no joint is left for it: keep fewer rows of the task, or give hk.moore_penrose(task) to hk.ik"
        super().__init__(f"{fact}; {cure}")


# --- Errors of questions about strategies that have no answer.


class NotHolonomicError(HolokinError):
    """A strategy without leaves, where leaves are needed; `.witness` is a posture that shows it.

    It shows it by a `gap` [joint units] between two paths of the tool to one pose, or by `curvature` [1/rad], the
    relative one of `involutivity`; the other is None.
    """

    def __init__(
        self, name: str, witness: Iterable[float], gap: float | None = None, *, curvature: float | None = None
    ) -> None:
        self.witness, self.gap, self.curvature = tuple(float(v) for v in witness), gap, curvature
        posture = posture_text(self.witness)
        fact = f"at q = {posture} it has a curvature of {curvature or 0:.3g} per rad of joint motion"
        if gap is not None:
            fact = f"from q = {posture} two paths of the tool to one pose end {gap:.3g} (joint units) apart"
        super().__init__(
            f"{name!r} is not holonomic: {fact}; hk.radial(strategy, start) is a holonomic strategy near it"
        )


class UndecidedError(HolokinError):
    """A question that numbers cannot answer: postures are singular or nearly so, or round-off hides the answer.

    `.q` is the posture where there is one, `.noise` the share of a bracket that is round-off there, `.first` what was
    said of the first posture of many.
    """

    def __init__(
        self, fact: str, cure: str, q: Iterable[float] = (), noise: float = 0.0, first: Exception | None = None
    ) -> None:
        self.q, self.noise, self.first = tuple(float(v) for v in q), noise, first
        tail = "" if first is None else f". The first said: {first}"
        super().__init__(f"{fact}; {cure}{tail}")


# --- Errors that a motion meets: limits, singularities, the ends of the workspace.


KEPT = "what was computed is in .trajectory"
"""The cure of a path that ends early, for who calls from Python."""


class JointLimitError(HolokinError):
    """A posture outside the joint limits: the joint that is farthest outside."""

    def __init__(self, joint: str, value: float, lower: float, upper: float, unit: str, cure: str = "") -> None:
        self.joint, self.value, self.lower, self.upper = joint, value, lower, upper
        past = f"{max(lower - value, value - upper):.3g} {unit} outside its limits [{lower:.6g}, {upper:.6g}] {unit}"
        self.fact = f"joint {joint!r} is at {value:.6g} {unit}, {past}"
        self.cure = cure or "choose another start posture or path, or widen the limits in the robot description"
        super().__init__(f"{self.fact}; {self.cure}")


class SingularityKind(Enum):
    """Why a strategy has no value at a posture."""

    KINEMATIC = "the task Jacobian J loses rank: the tool cannot move in every direction of the task"
    ALGORITHMIC = "the arm could move the tool in every direction of the task, but not by this strategy"
    REPRESENTATION = (
        "a representation that the task or the constraint uses is singular or ends: its rates are not defined"
    )


class SingularityError(HolokinError):
    """A posture at which a strategy or representation is not defined."""

    _cure: ClassVar[dict[SingularityKind, str]] = {
        SingularityKind.KINEMATIC: "keep the path away from this posture, or drop task rows",
        SingularityKind.ALGORITHMIC: "choose another strategy for this posture, or another start posture",
        SingularityKind.REPRESENTATION: "choose another orientation=, 'twist' has no such singularity, or another "
        "constraint; for a radial law a start nearer by, or more steps",
    }

    _measure: ClassVar[dict[SingularityKind, str]] = {
        SingularityKind.KINEMATIC: "smallest singular value",
        SingularityKind.ALGORITHMIC: "rcond",
        SingularityKind.REPRESENTATION: "distance from the singularity",
    }

    def __init__(self, kind: SingularityKind, q: Iterable[float], what: str, measure: float, why: str = "") -> None:
        self.kind, self.q, self.measure = kind, tuple(float(v) for v in q), float(measure)
        super().__init__(
            f"{kind.name.lower()} singularity of {what} at q = {posture_text(self.q)} "
            f"({self._measure[kind]} {measure:.2e}): {why or kind.value}; {self._cure[kind]}"
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


class PathError(HolokinError):
    """A path that could not be followed to its end; `.trajectory` holds what was computed."""

    def __init__(self, fact: str, cure: str, trajectory: Any = None) -> None:
        self.trajectory = trajectory
        self.fact, self.cure = fact, cure
        super().__init__(f"{fact}; {cure}")


class OutOfReachError(PathError):
    """A pose or path beyond the workspace, or beyond what a region or a map of sheets serves; `.position` [m]."""

    def __init__(self, fact: str, cure: str, trajectory: Any = None, position: Iterable[float] = ()) -> None:
        self.position = tuple(float(x) for x in position)
        super().__init__(fact, cure, trajectory)


class PathSingularityError(PathError):
    """The path leads into a singularity of the strategy; `.kind` says of which sort."""

    def __init__(self, kind: SingularityKind, fact: str, cure: str, trajectory: Any = None) -> None:
        self.kind = kind
        super().__init__(fact, cure, trajectory)


class TrackingError(PathError):
    """Integration lost the path, or the tool is too far from where a control step wants it."""


class BranchError(PathError):
    """Leaf following met the end of its branch.

    Where g jumps there, `.what` is the operation of its formula, `.q` the posture, and `.level` by how much.
    """

    def __init__(
        self, fact: str, cure: str, trajectory: Any = None, what: str = "", q: Iterable[float] = (), level: float = 0.0
    ) -> None:
        self.what, self.q, self.level = what, tuple(float(v) for v in q), level
        super().__init__(fact, cure, trajectory)


class LimitReachedError(PathError):
    """A joint ran into its limit along the path, or no joint rates within the limits follow it."""


class ControllerError(PathError):
    """A controller that threw, blocked, or answered with something that is not n finite joint rates."""

    def __init__(self, name: str, fact: str, trajectory: Any = None) -> None:
        self.name = name
        cure = f"a law takes (q, pose, twist, dt) and returns n finite joint rates; {KEPT}"
        super().__init__(f"{name} stopped {fact}", cure, trajectory)


# --- Errors of what lies outside: compilers, packages, files.


class NativeError(HolokinError):
    """Native code that could not be made or loaded. `cause`: a word for what lies behind it, by default the fact."""

    def __init__(self, fact: str, cause: str = "") -> None:
        self.fact, self.cause = fact, cause or fact
        super().__init__(f"{fact}; everything works without native code too: set HOLOKIN_NATIVE=0")


class ExportError(HolokinError):
    """What cannot be written in another form: a strategy as C, or whose C failed its self-test; a value as a pickle."""

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


def error_form(name: str) -> str:
    """How an error is written, by its name; "" for what is none."""
    kind = globals().get(name)
    return f"hk.base.errors.{name}" if isinstance(kind, type) and issubclass(kind, HolokinError) else ""
