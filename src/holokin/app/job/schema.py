"""The form of a job file, checked by pydantic; every error names file, key, value and cure."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, Generic, Literal, TypeVar, get_args, get_origin

from pydantic import AfterValidator, BaseModel, Discriminator, Field, Tag, ValidationError, model_validator

from ...base.errors import ArgumentError, HolokinError, JobError, brief, closest, shown
from ...base.units import SI, PrintedUnits, printed_units
from ...motion.checks import Scene
from ...robot import FARTHEST
from ...robot.formats.urdf import read_toml
from .strategy_tables import KINDS, AnyStrategy, Fitted
from .tables import (
    MOST_PATHS,
    AirTable,
    ChecksTable,
    Few,
    FrameTable,
    KindTable,
    Length,
    NamedPathTable,
    Names,
    PathTable,
    Point,
    Positive,
    ProgramTable,
    RobotTable,
    Row,
    Table,
    TaskTable,
    TimingTable,
    check_of,
    needed_by,
    of,
)

MOST_POSTURES = 65_536  # postures of a verdict: those of `thorough=True`
# tool poses of a workspace: shares are right to a thousandth, and those that are missed take a few ms each
MOST_POSES = 16_384
MOST_CELLS = 200  # cells along the longest side of a slice: a pixel each in a picture on a page
MOST_STRATEGIES = 100  # strategies of a job: a table and figures of more are not read
LONGEST_NAME = 100  # characters of a strategy's name, which heads columns, figures and files
LONGEST_TITLE = 200  # characters of a title: two lines of the table
LONGEST_ABOUT = 10_000  # characters of the paragraph in a report

Figure = Annotated[float, Field(allow_inf_nan=False)]
Size = Annotated[float, Field(ge=0, le=FARTHEST, allow_inf_nan=False)]
HalfTurn = Annotated[float, Field(ge=0, le=180)]
Rotation = Annotated[list[Row], Field(min_length=3, max_length=3)]
SOLIDS = ("box", "cylinder", "sphere")


class StartTable(Table):
    """[start]: the posture, in joint units (rad, m), or in degrees for revolute joints."""

    q: Annotated[list[Length], Few]
    degrees: bool = False


class Bound(Table):
    """What a number must be: below, above, or a value within a tolerance."""

    below: Figure | None = None
    above: Figure | None = None
    value: Figure | None = None
    within: Positive | None = None

    @model_validator(mode="after")
    def _complete(self) -> Bound:
        if (self.value is None) != (self.within is None):
            raise ValueError("value and within go together; give both, or neither")
        if self.below is None and self.above is None and self.value is None:
            raise ValueError("it holds no bound; give below, above, or value and within")
        return self

    def holds(self, number: float) -> bool:
        """True when the number is as wanted; never for NaN."""
        return (
            number == number
            and (self.below is None or number < self.below)
            and (self.above is None or number > self.above)
            and (self.value is None or self.within is None or abs(number - self.value) <= self.within)
        )

    def __str__(self) -> str:
        value = None if self.value is None else f"{self.value:g} +- {self.within:g}"
        above = None if self.above is None else f"> {self.above:g}"
        below = None if self.below is None else f"< {self.below:g}"
        return " and ".join(filter(None, (value, above, below)))


class ExpectTable(Table):
    """[expect.NAME]: what a strategy must show, or the job fails (exit code 1); bounds of its `METRICS`, too."""

    holonomic: bool | None = None
    completes: bool = True
    defect: Bound | None = None
    drift: Bound | None = None
    drift_mean: Bound | None = None
    drift_total: Bound | None = None
    drift_least: Bound | None = None
    drift_most: Bound | None = None
    spread: Bound | None = None
    tracking: Bound | None = None
    sigma: Bound | None = None
    speed: Bound | None = None
    peak_speed: Bound | None = None
    residual: Bound | None = None
    invariant: Bound | None = None
    same_joints: Bound | None = None
    coverage: Bound | None = None
    coverage_rcond: Bound | None = None
    time: Bound | None = None
    clearance: Bound | None = None
    limit_distance: Bound | None = None


class VerdictTable(Table):
    """[verdict]: where involutivity is judged: a box around the start posture; `thorough` as of `involutivity`."""

    radius: Positive = 0.2
    samples: Annotated[int, Field(ge=1, le=MOST_POSTURES)] = 64
    thorough: bool | Annotated[int, Field(ge=1, le=MOST_POSTURES)] = False

    @model_validator(mode="after")
    def _one_of_them(self) -> VerdictTable:
        if self.thorough is not False and "samples" in self.model_fields_set:
            raise ValueError("samples and thorough both say how many postures are looked at; leave out one")
        return self


class WorkspaceTable(KindTable):
    """[workspace]: tool poses in the frame of the base; every strategy with leaves is asked how many it reaches."""

    kind: Literal["box", "cylinder", "sphere", "poses"] = "box"
    box: Annotated[list[Length] | None, Field(min_length=4, max_length=6), of("box")] = None
    center: Annotated[Point | None, needed_by("cylinder", "sphere"), of("box")] = None
    half: Annotated[Point | None, of("box")] = None
    radius: Annotated[Positive | None, needed_by("cylinder", "sphere")] = None
    half_height: Annotated[Size | None, needed_by("cylinder")] = None
    file: Annotated[str | None, needed_by("poses")] = None
    ignore: Annotated[Names, of("poses")] = Field(default=[])
    rotation: Annotated[Literal["down", "start"] | Rotation, of(*SOLIDS)] = "down"
    tilt_deg: Annotated[HalfTurn, of(*SOLIDS)] = 0.0
    spin_deg: Annotated[HalfTurn, of(*SOLIDS)] = 0.0
    samples: Annotated[int, Field(ge=1, le=MOST_POSES)] = 1024
    seed: Annotated[int, Field(ge=0)] = 0
    limits: bool = True
    slices: Annotated[int, Field(ge=0, le=MOST_CELLS)] = 31

    @model_validator(mode="after")
    def _one_box(self) -> WorkspaceTable:
        both = (self.center, self.half)
        if self.kind == "box" and (None in both if self.box is None else both != (None, None) or len(self.box) == 5):
            raise ValueError("a box needs box = [x, y, z, hx, hy, hz], in a plane [x, y, hx, hy]; or center and half")
        return self

    @property
    def box_sides(self) -> tuple[list[float] | None, list[float] | None]:
        """(centre, half sides) of a box."""
        if self.box is None:
            return self.center, self.half
        half = len(self.box) // 2
        return self.box[:half], self.box[half:]


class SheetsTable(Table):
    """[sheets]: the fewest leaves that serve the workspace; `file` names a map of them that is taken instead."""

    file: Annotated[str | None, Field(min_length=1)] = None
    share: Annotated[float, Field(gt=0, le=1)] = 0.995
    samples: Annotated[int, Field(ge=1, le=MOST_POSES)] = 4096
    seed: Annotated[int, Field(ge=0)] = 0
    rcond: Annotated[float, Field(ge=0, lt=1)] = 0.0
    seconds: Positive = 280.0


def _known_units(given: str | list[str]) -> str | list[str]:
    """The words for units, where they are known ones."""
    if given:
        try:
            printed_units(given)
        except HolokinError as problem:
            raise ValueError(str(problem)) from None
    return given


ONE, SEVERAL = "[path]", "[[path]]"
"""How a job gives its path, or several; the tags are in no key of a message."""

Several = Annotated[list[NamedPathTable], Field(min_length=1, max_length=MOST_PATHS)]
OneOrSeveral = Annotated[
    Annotated[PathTable, Tag(ONE)] | Annotated[Several, Tag(SEVERAL)],
    Discriminator(lambda given: SEVERAL if isinstance(given, list) else ONE),
]


class Job(Table):
    """A whole job file."""

    title: Annotated[str, Field(max_length=LONGEST_TITLE)]
    about: Annotated[str, Field(max_length=LONGEST_ABOUT)] = ""
    units: Annotated[str | Names, AfterValidator(_known_units)] = ""
    robot: RobotTable
    task: TaskTable = TaskTable()
    start: StartTable
    frames: dict[str, FrameTable] = Field(default={})
    path: OneOrSeveral
    every_path: dict[str, Any] = Field(default={})
    air: AirTable | None = None
    timing: TimingTable | None = None
    program: ProgramTable | None = None
    checks: ChecksTable | None = None
    workspace: WorkspaceTable | None = None
    sheets: SheetsTable | None = None
    strategies: Annotated[dict[str, AnyStrategy], Field(min_length=1, max_length=MOST_STRATEGIES)]
    expect: dict[str, ExpectTable] = Field(default={})
    verdict: VerdictTable = VerdictTable()

    @property
    def scene(self) -> Scene | None:
        """What the robot is to keep clear of, None where the job has no [checks]."""
        return None if self.checks is None else self.checks.scene

    @property
    def printed_units(self) -> PrintedUnits:
        """The units in which results are printed."""
        return printed_units(self.units) if self.units else SI

    @property
    def paths(self) -> list[NamedPathTable]:
        """The paths of a job of several; none where it has one [path]."""
        return self.path if isinstance(self.path, list) else []

    @property
    def only_path(self) -> PathTable:
        """The path of a job of one. Raises: ArgumentError: it has several."""
        if isinstance(self.path, PathTable):
            return self.path
        cure = "this is for one [path]; `holokin run`, `advise`, `certify` and `export` take several"
        raise ArgumentError("the number of paths of the job", len(self.path), cure)

    @model_validator(mode="before")
    @classmethod
    def _framed(cls, given: Any) -> Any:
        """Each path with the keys of [every_path], and frames in the place of their names."""
        if not isinstance(given, dict) or not isinstance(frames := given.get("frames", {}), dict):
            return given

        def placed(table: Any, key: str) -> Any:
            name = table.get("frame") if isinstance(table, dict) else None
            if not isinstance(name, str):
                return table
            if name not in frames:
                raise ValueError(
                    f"{key}.frame: is {brief(name, 60)!r}, no frame of [frames]; {closest(name, list(frames))}"
                )
            return table | {"frame": frames[name]}

        path, checks, shared = given.get("path"), given.get("checks"), given.get("every_path", {})
        if isinstance(path, list):
            if isinstance(shared, dict):
                path = [shared | table if isinstance(table, dict) else table for table in path]
            given = given | {"path": [placed(table, f"path.{i}") for i, table in enumerate(path)]}
        elif path is not None:
            given = given | {"path": placed(path, "path")}
        if isinstance(checks, dict) and isinstance(things := checks.get("obstacles"), list):
            things = [placed(table, f"checks.obstacles.{i}") for i, table in enumerate(things)]
            given = given | {"checks": checks | {"obstacles": things}}
        return given

    @model_validator(mode="after")
    def _several(self) -> Job:
        names = [table.name for table in self.paths]
        for i, name in enumerate(names):
            if name in names[:i]:
                fact = f"path.{i}.name: {brief(name, 60)!r} is the name of path.{names.index(name)}, too"
                raise ValueError(f"{fact}; give each a name of its own")
        for key in {"air", "every_path"} & self.model_fields_set if not names else ():
            raise ValueError(f"{key}: is for several paths; leave it out, or write [[path]] with names")
        if names and self.timing is None:
            raise ValueError("timing: is missing; add [timing]: the ways between several paths are timed")
        unused = sorted(self.model_fields_set & {"sheets", "workspace", "expect", "verdict"})
        if names and unused:
            raise ValueError(f"{unused[0]}: is for a job of one [path]; leave it out")
        return self

    @model_validator(mode="after")
    def _consistent(self) -> Job:
        for name in self.expect:
            if name not in self.strategies:
                known = closest(name, list(self.strategies))
                raise ValueError(f"expect.{brief(name, 100)}: is for no strategy of this job; {known}")
            asked = [key for key in ("coverage", "coverage_rcond") if getattr(self.expect[name], key) is not None]
            if asked and self.workspace is None:
                cure = "the job has no workspace: add a [workspace] table, or leave it out"
                raise ValueError(f"expect.{brief(name, 100)}.{asked[0]}: {cure}")
        check_of(self.strategies, Fitted, "strategies", "strategy of this job")
        for name in self.strategies:
            if not 1 <= len(name) <= LONGEST_NAME or not name.isprintable():
                fact = f"strategies.{brief(name, 60)}: is a name of {len(name)} characters"
                raise ValueError(f"{fact}; give it one of 1 to {LONGEST_NAME}, none of them a control character")
        return self


# --- Reading a job file: what is wrong with it becomes a sentence that names file, key, value and cure.

Key = tuple[str, ...]  # the path to a value: the names and numbers of the tables and lists around it, and its own

_BOUNDS = ("gt", "ge", "lt", "le", "min_length", "max_length", "expected")
_CURES = {
    "greater_than": "a number above {}",
    "greater_than_equal": "at least {}",
    "less_than_equal": "at most {}",
    "too_short": "at least {} of them",
    "too_long": "at most {} of them",
    "literal_error": "one of {}",
    "string": "a text in quotes",
    "float": "a number",
    "finite_number": "a finite number",
    "int": "a whole number",
    "bool": "true or false",
    "list": "a list, in [ ]",
    "dict": "a table",
    "model": "a table",
}


Model = TypeVar("Model", bound=BaseModel)


@dataclass(frozen=True)
class Form(Generic[Model]):
    """What a kind of file holds: its model, the table of things that have a `kind`, and those kinds.

    where, more, example: the cures where there is no such file, of a misspelt key, and of a missing one.
    """

    model: type[Model]
    named: str
    kinds: Mapping[str, type[BaseModel]]
    where: str = "check the path"
    more: str = "check its spelling: {}"
    example: str = "add it"
    check: Callable[[Path, dict[str, Any]], None] = lambda _path, _table: None

    def read(self, path: Path) -> Model:
        """A file of this form. Raises: JobError naming file, key, value and cure."""
        return self.checked(path, job_table(path, self.where))

    def checked(self, path: Path, table: dict[str, Any]) -> Model:
        """The content of a file. Raises: JobError."""
        self.check(path, table)
        try:
            return self.model.model_validate(table, context={"folder": path.parent})
        except ValidationError as problem:
            raise _named(path, problem, table, self) from None


def read_job(path: Path) -> Job:
    """A job from a TOML file. Raises: JobError naming file, key, value and cure."""
    return _JOB.read(path)


def job_of(path: Path, table: dict[str, Any]) -> Job:
    """The job of a file's content, or of what was made of it. Raises: JobError."""
    return _JOB.checked(path, table)


def job_table(path: Path, where: str = "check the path") -> dict[str, Any]:
    """What stands in a job file, unchecked. Raises: JobError; `where` is the cure where there is no such file."""

    def refuse(key: str, fact: str, cure: str) -> JobError:
        return JobError(path, key or "file", fact, where if fact == "there is no such file" else cure)

    return read_toml(path, refuse)


def dotted(key: Key) -> str:
    """A key as TOML writes it: a name that is no plain word in quotes."""
    return ".".join(part if re.fullmatch(r"[\w-]+", part) else shown(part, 100) for part in key)


def _named(path: Path, problem: ValidationError, table: dict[str, Any], form: Form[Any]) -> JobError:
    """The first fault of the file, as a sentence. A value that may be of several types has a fault for each."""
    # The deepest fault below the first key; a misspelt key tells more than the one that it leaves out.
    faults = [_located(fault, table, form) for fault in problem.errors()]
    faults.sort(key=lambda located: located[1]["type"] == "missing")
    first = faults[0][0]
    parts, fault = max((f for f in faults if f[0][: len(first)] == first), key=lambda f: len(f[0]))
    key = dotted(_as_written(parts, table))
    # The kind of the table that it is in, unless the kind itself is wrong.
    of_kind = parts[:1] == (form.named,) and bool(parts[2:])
    kind = str(table[form.named][parts[1]]["kind"]) if of_kind and parts[2] != "kind" else ""
    # A key that is missing, or too many.
    if fault["type"] == "missing":
        if kind:
            return JobError(path, dotted(parts[:2]), f"kind = {kind!r} needs {parts[2]}", "add it")
        return JobError(path, key, "is missing", form.example)
    if fault["type"] == "extra_forbidden":
        if kind and any(parts[2] in model.model_fields for model in form.kinds.values()):
            return JobError(path, dotted(parts[:2]), f"kind = {kind!r} does not use {parts[2]}", "leave it out")
        known = keys_beside(form.model, parts)
        if of_kind:
            known = keys_beside(form.kinds[kind], parts[2:]) if kind else ["kind"]
        return JobError(path, key, "is an unknown key", form.more.format(closest(parts[-1], known)))
    # A value that makes no sense, in the words of the table.
    value = fault.get("input", table)
    if isinstance(value, float) and not isfinite(value):
        return JobError(path, key, f"is {value}", "give a finite number")
    if fault["type"] == "value_error":
        fact = "" if isinstance(value, dict) else f"is {shown(value, 150)}: "
        message, _, cure = fault["msg"].removeprefix("Value error, ").partition("; ")
        if not key:  # of the whole job: the message begins with the key
            key, _, message = message.partition(": ")
        return JobError(path, key, f"{fact}{message}", cure)
    # A value of another type, or none of the choices.
    fact = "is a table" if isinstance(value, dict) else f"is {shown(value, 150)}"
    choices = [w for k, f in faults if k == parts for w in re.findall("'([^']+)'", _context(f, "expected"))]
    if choices and isinstance(value, str):
        return JobError(path, key, fact, closest(value, choices))
    cures = dict.fromkeys(_cure(f) for k, f in faults if k == parts)
    return JobError(path, key, fact, f"give {' or '.join(cures)}")


def _as_written(key: Key, table: Mapping[str, Any]) -> Key:
    """A key where it stands in the file: one of a path may be in [every_path]."""
    if (
        len(key) < 3
        or key[0] != "path"
        or key[2] not in table.get("every_path", {})
        or key[2] in table["path"][int(key[1])]
    ):
        return key
    return ("every_path", *key[2:])


def _cure(fault: Mapping[str, Any]) -> str:
    """What pydantic wants, in a job writer's words."""
    kind = fault["type"].removesuffix("_type").removesuffix("_parsing").removesuffix("_from_float")
    bound = next((_context(fault, word) for word in _BOUNDS if _context(fault, word)), "").removesuffix(".0")
    return _CURES.get(kind, "{}").format(bound) if kind in _CURES else f"what this asks for: {fault['msg']}"


def _context(fault: Mapping[str, Any], word: str) -> str:
    """A fact of a fault; empty if it has none."""
    return str(fault.get("ctx", {}).get(word, ""))


def _located(fault: Any, table: dict[str, Any], form: Form[Any]) -> tuple[Key, dict[str, Any]]:
    """(key, fault) of what pydantic found: without what it puts into keys, kinds and types that a value may have."""
    loc, fault = fault["loc"], dict(fault)
    if loc[:1] == (form.named,) and len(loc) > 2:
        loc = loc[:2] + loc[3:]
    if fault["type"].startswith("union_tag"):
        loc = (*loc, "kind")
        expected = {"expected": ", ".join(map(repr, form.kinds))}
        fault |= {"type": "literal_error", "ctx": expected} if "kind" in fault["input"] else {"type": "missing"}
        fault["input"] = fault["input"].get("kind")
    parts: list[str] = []
    value: Any = table
    for part in (part for part in loc if part not in (ONE, SEVERAL)):
        if isinstance(value, dict):
            parts.append(str(part))
            value = value.get(part)
        elif isinstance(value, list) and isinstance(part, int):
            parts.append(str(part))
            value = value[part] if part < len(value) else None  # a list may lack the part whose absence is the fault
    return tuple(parts), fault


def keys_beside(of: Any, key: Key) -> list[str]:
    """The keys that may stand where a key does, in a table, or in a value of another type that may hold tables."""
    if isinstance(of, type) and issubclass(of, BaseModel):
        field = of.model_fields.get(key[0])
        return list(of.model_fields) if len(key) == 1 else keys_beside(field.annotation if field else None, key[1:])
    if get_origin(of) in (list, dict):  # the first part is the place or the name
        return keys_beside(get_args(of)[-1], key[1:]) if len(key) > 1 else []
    return list(dict.fromkeys(name for kind in get_args(of) for name in keys_beside(kind, key)))


def _no_survey(path: Path, table: dict[str, Any]) -> None:
    if not {"laws", "loops"} - set(table) and "strategies" not in table:
        raise JobError(path, "laws", "is of a survey, and this no job", f"run it: holokin survey {path}")


_WRITES = "`holokin new` writes a complete example"
_JOB = Form(
    Job,
    "strategies",
    KINDS,
    "check the path; `holokin jobs` lists the packaged ones",
    f"check its spelling: {{}}; {_WRITES}",
    f"add it; {_WRITES}",
    _no_survey,
)
