"""Errors of what was given or asked: names, arrays, files, robots, tasks, calls."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from .holokin_error import FORMS, LONGEST, FileError, HolokinError, brief, closest, posture_text, shown


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
    """A call with an argument too many, too few or of another name; `form` is how the function is called."""

    def __init__(self, fact: str, form: str) -> None:
        self.fact, self.form = fact, form
        super().__init__(f"{brief(fact)}; call it as {brief(form, LONGEST)}")


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
    """A function of the user's own that raises, or gives something else than what is wanted of it."""

    def __init__(self, what: str, fact: str, cure: str) -> None:
        self.what, self.fact, self.cure = what, fact, cure
        super().__init__(f"{brief(what)}, a function of yours, {brief(fact)}; {brief(cure)}")


class RobotFileError(FileError):
    """A robot description that is missing, malformed or not supported."""


class JobError(HolokinError):
    """A job file that cannot be run: names file, key, value and cure."""

    def __init__(self, path: object, key: str, fact: str, cure: str) -> None:
        self.path, self.key, self.fact, self.cure = path, key, fact, cure
        super().__init__(f"{brief(path)}: [{brief(key, 200)}] {brief(fact)}; {brief(cure, LONGEST)}")


class RecordingError(FileError):
    """A log of joint motion, a table of tool poses, or a drawing, that cannot be read or judged."""


class SurveyError(FileError):
    """A survey that cannot be run, or whose results cannot be read."""


class CertificateError(HolokinError):
    """A file that is no certificate."""

    def __init__(self, path: object, fact: str) -> None:
        self.path, self.fact = path, fact
        super().__init__(f"{brief(path)} is no certificate: {brief(fact)}; give a file of `holokin certify`")


class SheetsFileError(HolokinError):
    """A file that is no map of sheets, or that of another robot."""

    def __init__(self, path: object, fact: str, cure: str) -> None:
        self.path, self.fact, self.cure = path, fact, cure
        super().__init__(f"{brief(path)} is no map of sheets for this: {brief(fact)}; {brief(cure, LONGEST)}")


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
        cure = (
            f"it needs exactly r = n - m = {n - m}; add or drop rows, or combine with "
            "hk.strategies.constraints.stack(...)"
        )
        if n == m:
            cure = "no joint is left for it: keep fewer rows of the task, or give hk.moore_penrose(task) to hk.ik"
        fact = f"constraint {name!r} has {rows} rows; the robot has n = {n} joints and the task m = {m} rows"
        super().__init__(f"{fact}: {cure}" if n == m else f"{fact}, so {cure}")


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


class AmbiguousTruthError(HolokinError):
    """A result was used as if it were True or False; `what` is its kind, `ask` what to ask it instead.

    Python takes objects for True, and so `if verdict:` would be a yes where the answer is no.
    """

    def __init__(self, what: str, ask: str) -> None:
        self.what, self.ask = what, ask
        super().__init__(f"{what} is neither True nor False, for that would say nothing of what was found; ask {ask}")


class RoundOffError(HolokinError):
    """A question that numbers cannot answer at a posture, because round-off hides the answer."""

    def __init__(self, name: str, q: Iterable[float], noise: float) -> None:
        self.q, self.noise = tuple(float(v) for v in q), noise
        super().__init__(
            f"{name!r} cannot be judged at q = {posture_text(self.q)}: round-off makes {noise:.1e} of a bracket "
            "there, and a real one could hide in it; choose a posture farther from singularities"
        )


class EmptyRegionError(HolokinError):
    """No posture of a region could be judged."""

    def __init__(self, samples: int, first: Exception) -> None:
        self.first = first
        super().__init__(
            f"all {samples} sampled postures of the region are singular or nearly so, and nothing can be judged; "
            f"move or enlarge the region. The first said: {first}"
        )


class FunctionError(HolokinError):
    """A strategy's Python function raised at a posture; `.problem` is what it raised."""

    def __init__(self, name: str, q: Iterable[float], problem: Exception) -> None:
        self.q, self.problem = tuple(float(v) for v in q), problem
        message = f"{type(problem).__name__}: {brief(problem)}"
        super().__init__(
            f"the function of {name!r} raised {message} at q = {posture_text(self.q)}; "
            "correct it, or keep away from this posture"
        )
