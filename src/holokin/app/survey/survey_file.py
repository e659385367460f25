"""The survey file: its tables of robots, strategies and metrics, and objects given in Python in their place."""

from __future__ import annotations

import fnmatch
import importlib
import inspect
import multiprocessing
import pickle
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Annotated, Any, Literal, Union

from pydantic import AfterValidator, BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from ...analysis.coverage import locked_joints
from ...base.errors import ArgumentError, JobError, OwnFunctionError, brief, closest
from ...base.poses import pose_from
from ...base.types import Matrix, Vector, own_number
from ...motion.control import (
    ControlLaw,
    PostureTask,
    as_control_law,
    closed_loop,
    damped,
    gradient_projection,
    repetitive_motion,
)
from ...motion.control.control_law import GAIN
from ...motion.control.libraries import LIBRARIES
from ...motion.trajectory import Trajectory
from ...path import Path
from ...strategies import Strategy, constraints
from ...strategies.tasks.task import Task
from ..job.schema import LONGEST_ABOUT, LONGEST_TITLE, Form, dotted
from ..job.strategy_tables import KINDS, Fitted, Lock, Radial, StrategyTable
from ..job.tables import (
    MOST_CYCLES,
    MOST_SAMPLES,
    MOST_STEPS,
    Few,
    KindTable,
    Length,
    Positive,
    RobotTable,
    Row,
    Table,
    TaskTable,
    by_kind,
    check_of,
    needed_by,
)

# --- Functions that a survey file names: their module is looked for beside the file first, then where Python looks.

_importing = threading.Lock()
"""The path of Python's modules is of all threads."""

_folders: dict[str, FilePath] = {}
"""Where a survey found a module: the next survey may have one of the same name in another folder."""


def imported(name: str, folder: FilePath) -> Callable[..., Any]:
    """The function "module:name". Raises: ArgumentError: it cannot be imported."""
    module, _, function = name.partition(":")
    try:
        with _importing, _first(folder):
            # What a survey in another folder imported from there by this name.
            top = module.partition(".")[0]
            if _folders.get(top, folder) != folder:
                _drop(top)
            attribute = getattr(importlib.import_module(module), function)
            if folder.absolute() in FilePath(getattr(sys.modules[module], "__file__", None) or "/").parents:
                _folders[module.partition(".")[0]] = folder
    except Exception as problem:  # noqa: BLE001  a module may raise anything
        fact = problem if isinstance(problem, ImportError | AttributeError) else repr(problem)
        raise ArgumentError("the function", name, f"it cannot be imported ({fact}); see to it in {folder}") from None
    if not callable(attribute):
        raise ArgumentError("the function", name, "it is no function: name one of (task, start posture)")
    return attribute


def source_of(name: str, folder: FilePath) -> FilePath | None:
    """The file of a function "module:name" that lies beside the survey file; else None."""
    place = folder.joinpath(*name.partition(":")[0].split("."))
    return next((file for file in (place.with_suffix(".py"), place / "__init__.py") if file.is_file()), None)


def forget_imported() -> bool:
    """Import anew what was found beside survey files: it may have changed. Whether there was any."""
    with _importing:
        modules = list(_folders)
        for top in modules:
            _drop(top)
    return bool(modules)


def _drop(top: str) -> None:
    """Forget a module and what is in it."""
    del _folders[top]
    for module in [known for known in sys.modules if known == top or known.startswith(f"{top}.")]:
        del sys.modules[module]


@contextmanager
def _first(folder: FilePath) -> Iterator[None]:
    before = str(folder.absolute())
    importlib.invalidate_caches()  # the file may have been written a moment ago
    sys.path.insert(0, before)
    try:
        yield
    finally:
        sys.path.remove(before)


# --- Robots, strategies and paths that a survey in Python is given as objects: its tables name them by keys.

OBJECT = "given:"
"""Before the name of a robot that is an object."""

_objects: dict[str, Any] = {}
_forgetting: list[Callable[[], None]] = []


def keep(objects: Mapping[str, Any]) -> None:
    """Those of the survey that this process does now; what was built of others with the same keys is forgotten."""
    if any(_objects.get(key, thing) is not thing for key, thing in objects.items()):
        for forget in _forgetting:
            forget()
    _objects.update(objects)


def when_replaced(forget: Callable[[], None]) -> Callable[[], None]:
    """Have something done when a key gets another object: whoever keeps what is built of objects forgets it."""
    _forgetting.append(forget)
    return forget


def given(key: str) -> Any:
    """The object of a key. Raises: ArgumentError."""
    if key not in _objects:
        raise ArgumentError("key", key, "it is of a survey in Python: a survey file cannot name it")
    return _objects[key]


def given_path(key: str, tool: Matrix) -> Path:
    """A path that begins at the tool pose (4, 4): one that is moved there, or that a function makes of the pose."""
    path = given(key)
    if not isinstance(path, Path):
        return path(tool)
    return path.in_frame(pose_from(tool[:3, 3] - path.start))


def sendable(objects: Mapping[str, Any]) -> bool:
    """Whether other processes can be sent them; what a script or notebook defines itself they do not find."""
    try:
        return b"__main__" not in pickle.dumps(dict(objects))
    except Exception:  # noqa: BLE001  pickle raises what the objects raise
        return False


def forks() -> bool:
    """Whether a process can have them without being sent them."""
    return "fork" in multiprocessing.get_all_start_methods()


# --- Metrics of the user's own: columns of a survey, each a function of what the joints did.

ColumnName = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]{0,39}$")]
"""The name of a column: letters, digits and _."""


class GivenMetric(Table):
    """One that `hk.survey` was given: a function of the trajectory."""

    kind: Literal["given"]
    key: str


OwnMetric = Annotated[str, Field(pattern=r"^[\w.]+:\w+$")] | GivenMetric
"""In a survey file "module:function", of which the module is looked for beside the file first."""


def own_metrics(
    asked: Mapping[str, OwnMetric], walk: Trajectory, folder: FilePath
) -> tuple[dict[str, float], list[OwnFunctionError]]:
    """(the numbers by name, what went wrong). A metric without a number is left out. Raises: ArgumentError."""
    numbers: dict[str, float] = {}
    problems: list[OwnFunctionError] = []
    for name, metric in asked.items():
        function = imported(metric, folder) if isinstance(metric, str) else given(metric.key)
        try:
            number = own_number(f"the metric {name!r}", function, walk)
        except OwnFunctionError as problem:
            problems.append(problem)
            continue
        if number is not None:
            numbers[name] = number
    return numbers, problems


# --- [laws.NAME] of a survey: the strategies of a job, control laws of text books and libraries, and your own.
#
# A new kind is one more class here: `kind` and its keys, and `build`.

Gain = Annotated[float, Field(ge=0, le=1e6)]


class ControlTable(Table):
    """A control law: it is run by `simulate`, with steps as long as those of the strategies."""

    def build(self, task: Task, q0: Vector, name: str) -> ControlLaw:
        """The control law of a task, from a start posture (n,). Raises: HolokinError."""
        raise NotImplementedError


class BestLock(ControlTable):
    """The joints that determine the self-motion best at the start posture stay where they are, as of `lock`."""

    kind: Literal["best-lock"]


class ClosedLoop(ControlTable):
    """A strategy of the survey with feedback of the tool's error."""

    kind: Literal["closed-loop"]
    of: str
    gain: Gain = GAIN


class Damped(ControlTable):
    """Damped least squares."""

    kind: Literal["damped"]
    damping: Positive = 0.05
    gain: Gain = GAIN

    def build(self, task: Task, q0: Vector, name: str) -> ControlLaw:
        """As `damped`."""
        return damped(task, self.damping, self.gain, name=name)


class GradientProjection(ControlTable):
    """Gradient projection on the start posture, or on a cost."""

    kind: Literal["gradient-projection"]
    cost: Literal["start", "centring", "manipulability"] = "start"
    weight: Gain = 1.0
    gain: Gain = GAIN

    def build(self, task: Task, q0: Vector, name: str) -> ControlLaw:
        """As `gradient_projection`; of the start posture as `repetitive_motion`, which is the same."""
        if self.cost == "start":
            return repetitive_motion(task, self.weight, self.gain, name=name)
        cost = constraints.centring_cost() if self.cost == "centring" else constraints.manipulability_cost()
        return gradient_projection(task, cost, self.weight, self.gain, name=name)


if TYPE_CHECKING:
    LibraryName = str
else:
    LibraryName = Literal[tuple(LIBRARIES)]


class Library(ControlTable):
    """A library's inverse kinematics: a frame task on the robot's first tip, with a posture task if it costs.

    Without `preferred` that prefers the start.
    """

    kind: LibraryName
    posture_cost: Gain = 1e-3
    posture_gain: Gain = 1.0
    preferred: Annotated[list[Length], Few] | None = None

    def build(self, task: Task, q0: Vector, name: str) -> ControlLaw:
        """As `pink_law`, `mink_law` or `placo_law`. Raises: ArgumentError: a task that is no whole pose."""
        if task.orientation != "twist" or task.m != (3 if task.robot.planar else 6):
            cure = f"{', '.join(LIBRARIES)} follow whole poses here: use kind = 'pose'"
            raise ArgumentError("the task", task.name, cure)
        preferred = None if self.preferred is None else tuple(self.preferred)
        posture = PostureTask(self.posture_cost, self.posture_gain, preferred)
        return LIBRARIES[self.kind].law(task.robot, posture, name=name)


class Own(ControlTable):
    """Your own: "module:function", which takes (task, start posture) and returns a strategy or a control law.

    The module is looked for beside the survey file first.
    """

    kind: Literal["import"]
    function: Annotated[str, Field(pattern=r"^[\w.]+:\w+$")]


class Given(ControlTable):
    """One that `hk.survey` was given: a function of the task, or of the task and the start posture."""

    kind: Literal["given"]
    key: str

    def build(self, task: Task, q0: Vector, name: str) -> Any:
        """What the function returns."""
        function = given(self.key)
        return _as_law(function(task, q0) if _takes_start(function) else function(task))


def _takes_start(function: Callable[..., Any]) -> bool:
    """Whether a user's function is of the task and the start posture, and not of the task alone."""
    parameters = inspect.signature(function).parameters.values()
    places = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    return sum(p.kind in places and p.default is p.empty for p in parameters) > 1


def _as_law(made: Any) -> Strategy | ControlLaw:
    """What a user's function returned, as it can be run."""
    return made if isinstance(made, Strategy) else as_control_law(made)


OWN_KINDS = (BestLock, ClosedLoop, Damped, GradientProjection, Library, Own, Given)
OF_A_JOB = tuple(model for kind, model in KINDS.items() if model is not Fitted)

if TYPE_CHECKING:
    AnyStrategy = StrategyTable | ControlTable
else:
    AnyStrategy = Annotated[Union[(*OF_A_JOB, *OWN_KINDS)], Field(discriminator="kind")]


def resolved(laws: Mapping[str, AnyStrategy], name: str, task: Task, q0: Vector) -> dict[str, AnyStrategy]:
    """A strategy, and what it is of, with what a start posture chooses chosen: two starts may share what is built."""
    table = laws[name]
    chosen = resolved(laws, table.of, task, q0) if isinstance(table, ClosedLoop) else {}
    if isinstance(table, BestLock):
        joints: list[str | int] = [task.robot.joint_names[i] for i in locked_joints(task, q0)]
        table = Lock(kind="lock", joints=joints)
    return chosen | {name: table}


def of_the_start(laws: Mapping[str, AnyStrategy]) -> bool:
    """Whether what is built depends on the start posture, and not on the task alone."""
    return any(
        isinstance(law, (Radial, Own)) or (isinstance(law, Given) and _takes_start(given(law.key)))
        for law in laws.values()
    )


def built(
    laws: Mapping[str, AnyStrategy], name: str, task: Task, q0: Vector, folder: FilePath
) -> Strategy | ControlLaw:
    """The strategy of a name; modules are looked for in the survey file's folder first. Raises: HolokinError."""
    table = laws[name]
    if isinstance(table, Own):
        return _as_law(imported(table.function, folder)(task, q0))
    if isinstance(table, ClosedLoop):
        of = built(laws, table.of, task, q0, folder)
        if not isinstance(of, Strategy):
            raise ArgumentError("of", table.of, "it is a control law already: name a strategy")
        return closed_loop(of, table.gain, name=name)
    return table.build(task, q0, name)


# --- The form of a survey file, checked by pydantic: robots, tasks, starts, loops, strategies, and how many cases.

MOST_CASES = 100_000_000
"""Cases of a survey: a thousand processor cores do as many in a day, at a tenth of a second each."""

MOST_OF_A_KIND = 1_000_000
"""Starts or loops of one kind."""

Share = Annotated[float, Field(gt=0, le=1)]
Pair = BeforeValidator(lambda given: tuple(given) if isinstance(given, list) else given)
"""TOML has lists; a range is a pair."""

Plane = Literal["xy", "yz", "xz", "random"]
Name = Annotated[str, Field(min_length=1, max_length=100, pattern=r"^[^\x00-\x1f]+$")]


class StartsTable(Table):
    """[starts]: how many start postures of each kind a robot gets.

    `regular` ones are well inside the limits and far from singular, always the same; `random` ones are even within the
    limits but for `margin`, a share of each joint's range.
    """

    regular: Annotated[int, Field(ge=0, le=100)] = 1
    random: Annotated[int, Field(ge=0, le=MOST_OF_A_KIND)] = 0
    margin: Annotated[float, Field(ge=0, lt=0.5)] = 0.1

    @model_validator(mode="after")
    def _some(self) -> StartsTable:
        if self.regular + self.random == 0:
            raise ValueError("it asks for no start posture; give regular or random")
        return self


LOOPS = ("circle", "square", "figure-eight", "raster", "smooth")
"""The kinds of loop of a survey file."""


def _loop(kind: str) -> str:
    """A kind of loop; those that Python gave are no choice of a file, and are not offered."""
    if kind not in (*LOOPS, "given"):
        raise PydanticCustomError("literal_error", "no kind of loop", {"expected": ", ".join(map(repr, LOOPS))})
    return kind


class LoopTable(KindTable):
    """[loops.NAME]: closed tool paths that begin at the tool's start; a range [a, b] is drawn from evenly.

    `size` is the largest extent in metres; `share` says it as a share of the arm's length instead.
    """

    kind: Annotated[str, AfterValidator(_loop)]
    key: Annotated[str | None, needed_by("given")] = None
    size: Annotated[Positive | tuple[Positive, Positive] | None, Pair] = None
    share: Annotated[Share | tuple[Share, Share] | None, Pair] = None
    plane: Plane | Row = "random"
    direction: Literal["counter-clockwise", "clockwise", "random"] = "random"
    speed: Annotated[Positive | tuple[Positive, Positive], Pair] = 0.1
    count: Annotated[int, Field(ge=1, le=MOST_OF_A_KIND)] = 1

    @model_validator(mode="after")
    def _one_size(self) -> LoopTable:
        if self.kind != "given" and (self.size is None) == (self.share is None):
            fact = "neither size nor share says" if self.size is None else "size and share both say"
            raise ValueError(f"{fact} how large it is; give one of them")
        for key in ("size", "share", "speed"):
            value = getattr(self, key)
            if isinstance(value, tuple) and value[0] > value[1]:
                raise ValueError(f"{key} = {list(value)} is no range; give the smaller number first")
        return self


Patterns = Name | Annotated[list[Name], Field(min_length=1, max_length=1000)]


class WithoutTable(Table):
    """[[without]]: combinations that are left out, by names or patterns, as ["ur*", "irb140"] for robots.

    A case is left out when every key that is given fits it.
    """

    robot: Patterns = "*"
    task: Patterns = "*"
    loop: Patterns = "*"
    law: Patterns = "*"

    @model_validator(mode="after")
    def _something(self) -> WithoutTable:
        if not self.model_fields_set:
            raise ValueError("it says nothing to leave out; give robot, task, loop or law")
        return self

    def fits(self, **names: str) -> bool:
        """Whether all that it says fits these names of a case."""
        return all(
            any(fnmatch.fnmatchcase(name, p) for p in ([given] if isinstance(given, str) else given))
            for key, name in names.items()
            for given in [getattr(self, key)]
        )


class SurveyTable(Table):
    """A whole survey file."""

    title: Annotated[str, Field(max_length=LONGEST_TITLE)]
    about: Annotated[str, Field(max_length=LONGEST_ABOUT)] = ""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    robots: Annotated[list[str | RobotTable], Field(min_length=1, max_length=10_000)]
    tasks: Annotated[dict[Name, TaskTable], Field(min_length=1)] = Field(default={"position": TaskTable()})
    starts: StartsTable = StartsTable()
    loops: Annotated[dict[Name, LoopTable], Field(min_length=1)]
    laws: Annotated[dict[Name, AnyStrategy], Field(min_length=1)]
    metrics: Annotated[dict[ColumnName, OwnMetric], Field(max_length=100)] = Field(default={})
    without: Annotated[list[WithoutTable], Field(max_length=1000)] = Field(default=[])
    cycles: Annotated[int, Field(ge=1, le=MOST_CYCLES)] = 10
    samples: Annotated[int, Field(ge=1, le=MOST_SAMPLES)] = 200
    limits: bool = True
    cases: Annotated[int, Field(ge=1, le=MOST_CASES)] | None = None
    time_limit: Annotated[float, Field(gt=0, le=86_400)] = 60.0

    @model_validator(mode="after")
    def _consistent(self) -> SurveyTable:
        if self.samples * self.cycles > MOST_STEPS:
            fact = f"{self.samples:,} samples in {self.cycles:,} cycles are more than {MOST_STEPS:,} steps a case"
            raise ValueError(f"{fact}; give fewer samples or cycles")
        for name, table in self.tasks.items():
            if isinstance(table.orientation, list):
                raise ValueError(f"tasks.{brief(name, 60)}.orientation: is a list; give each its own task")
        check_of(self.laws, ClosedLoop, "laws", "strategy of this survey")
        return self


SURVEY_KINDS = by_kind(model for model in (*OF_A_JOB, *OWN_KINDS) if model is not Given)
"""Every kind of strategy that a survey may hold, and its model."""


def _no_job(path: FilePath, table: dict[str, Any]) -> None:
    if "strategies" in table and "laws" not in table:
        raise JobError(path, "strategies", "is of a job, and this no survey", f"run it: holokin run {path}")


def _no_objects(path: FilePath, table: dict[str, Any]) -> None:
    _no_job(path, table)
    for named, kinds in (("laws", tuple(SURVEY_KINDS)), ("loops", LOOPS)):
        tables = table.get(named)
        for name, entry in tables.items() if isinstance(tables, dict) else ():
            if isinstance(entry, dict) and entry.get("kind") == "given":
                raise JobError(path, dotted((named, name, "kind")), "is 'given'", closest("given", kinds))


_SURVEY = Form(SurveyTable, "laws", SURVEY_KINDS, check=_no_job)


def read_survey(path: FilePath) -> SurveyTable:
    """A survey from a TOML file. Raises: JobError naming file, key, value and cure."""
    return replace(_SURVEY, check=_no_objects).read(path)


def survey_of(content: dict[str, object], name: str) -> SurveyTable:
    """A survey from its content. Raises: JobError."""
    return _SURVEY.checked(FilePath(name), dict(content))
