"""The form of a job file, checked by pydantic; every error names file, key, value and cure."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from ..errors import JobError, closest

Number = Annotated[float, Field(allow_inf_nan=False)]
Point = Annotated[list[Number], Field(min_length=2, max_length=3)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Formula = str | Number
Kind = Literal[
    "moore-penrose", "weighted", "null-basis", "pfaffian", "custom", "linear", "lock", "coupled", "coupled-twist",
    "arm-angle", "height", "stationary", "radial", "inertia-weighted", "impedance",
]  # fmt: skip
_USES: dict[Kind, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "moore-penrose": ((), ()),
    "weighted": (("W",), ()),
    "null-basis": (("N_G",), ()),
    "pfaffian": (("A",), ()),
    "custom": (("g",), ("leaf",)),
    "linear": (("matrix",), ("leaf",)),
    "lock": (("joints",), ("leaf",)),
    "coupled": (("gain",), ("orientation", "leaf")),
    "coupled-twist": (("gain",), ()),
    "arm-angle": ((), ("arm", "joints", "leaf")),
    "height": (("joints",), ("leaf",)),
    "stationary": (("cost",), ("preferred", "stiffness", "free", "leaf")),
    "radial": ((), ("W", "steps")),
    "inertia-weighted": ((), ()),
    "impedance": (("preferred",), ("stiffness", "force")),
}
"""For each kind of strategy the keys that it needs, and those that it may have."""

_SHAPES = {
    "center": ("circle", "arc"), "normal": ("circle", "arc"), "clockwise": ("circle", "arc"), "angle_deg": ("arc",),
    "points": ("polyline",), "turns_deg": ("polyline",), "closed": ("polyline",),
}  # fmt: skip
"""The kinds of path that use a key; the other keys serve all."""

Orientation = Literal["twist", "zyz", "rpy", "rotation-vector"]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class RobotTable(_Table):
    """[robot]: a catalogue name, or a path (.urdf, .toml) relative to the job file."""

    name: str
    tip: str | None = None
    base: str | None = None
    locked: dict[str, Number] = {}


class TaskTable(_Table):
    """[task]: position or pose; a list of orientations runs every strategy once for each."""

    kind: Literal["position", "pose"] = "position"
    orientation: Orientation | Annotated[list[Orientation], Field(min_length=1)] = "twist"
    rows: list[int] | None = None

    @model_validator(mode="after")
    def _each_once(self) -> TaskTable:
        kinds = self.orientation
        if isinstance(kinds, list) and len(set(kinds)) < len(kinds):
            raise ValueError(f"orientation = {kinds} names one twice; name each once")
        return self


class StartTable(_Table):
    """[start]: the posture, in joint units (rad, m), or in degrees for revolute joints."""

    q: list[Number]
    degrees: bool = False


class PathTable(_Table):
    """[path]: a curve that begins at the tool's start point.

    `relative` points count from the tool's start point. A closed path is run round for `cycles`, and its two
    halves are the two ways to the pose half a loop away.
    """

    kind: Literal["circle", "arc", "polyline"]
    center: Point | None = None
    normal: Annotated[list[Number], Field(min_length=3, max_length=3)] = [0.0, 0.0, 1.0]
    angle_deg: Number | None = None
    points: list[Point] | None = None
    turns_deg: list[Annotated[list[Number], Field(min_length=3, max_length=3)]] | None = None
    closed: bool = False
    clockwise: bool = False
    relative: bool = False
    speed: Positive = 0.1
    samples: Annotated[int, Field(ge=1, le=10_000_000)] = 1000
    cycles: Annotated[int, Field(ge=1, le=1_000_000)] = 1

    @model_validator(mode="after")
    def _complete(self) -> PathTable:
        needs = {"circle": ["center"], "arc": ["center", "angle_deg"], "polyline": ["points"]}[self.kind]
        missing = [key for key in needs if getattr(self, key) is None]
        if missing:
            raise ValueError(f"a {self.kind} needs {' and '.join(missing)}; add it")
        for key in sorted(self.model_fields_set & _SHAPES.keys()):
            if self.kind not in _SHAPES[key]:
                raise ValueError(f"a {self.kind} does not use {key}; leave it out")
        if self.cycles > 1 and (self.kind == "arc" or (self.kind == "polyline" and not self.closed)):
            raise ValueError("several cycles need a closed path; use a circle, or a polyline with closed = true")
        return self


class StrategyTable(_Table):
    """[strategies.NAME]: a kind and what it needs. Formulas use q1, q2, ... or the joints' names."""

    kind: Kind
    W: list[list[Formula]] | None = None
    N_G: list[list[Formula]] | None = None
    g: list[Formula] | None = None
    A: list[list[Formula]] | None = None
    matrix: list[list[Number]] | None = None
    joints: list[str] | None = None
    gain: Number | list[list[Number]] | None = None
    orientation: Literal["zyz", "rpy", "rotation-vector"] | None = None
    arm: Literal["stereographic", "conventional"] | None = None
    cost: Literal["posture", "centring", "manipulability", "gravity"] | None = None
    preferred: list[Number] | None = None
    stiffness: Positive | list[Positive] | None = None
    force: Literal["pseudo-inverse", "stiffness"] | None = None
    free: list[str] | None = None
    steps: Annotated[int, Field(ge=1, le=1000)] | None = None
    leaf: Number | list[Number] | None = None
    method: Literal["velocity", "leaf"] | None = None
    invariant: list[Formula] = []

    @field_validator("W", "N_G", "A", "matrix", "gain")
    @classmethod
    def _rectangular(cls, rows: Any) -> Any:
        if isinstance(rows, list) and len({len(row) for row in rows}) != 1:
            raise ValueError("a matrix needs rows, all of one length; mend them")
        return rows

    @model_validator(mode="after")
    def _complete(self) -> StrategyTable:
        needed, optional = _USES[self.kind]
        for key in needed:
            if getattr(self, key) is None:
                raise ValueError(f"kind = {self.kind!r} needs {key}; add it")
        every = {key for pair in _USES.values() for keys in pair for key in keys}
        for key in sorted(every - {*needed, *optional}):
            if getattr(self, key) is not None:
                raise ValueError(f"kind = {self.kind!r} does not use {key}; leave it out")
        if self.kind == "stationary" and (self.cost == "posture") != (self.preferred is not None):
            raise ValueError("cost = 'posture' and preferred go together; add or leave out preferred")
        if self.kind == "stationary" and self.stiffness is not None and self.cost != "posture":
            raise ValueError(f"cost = {self.cost!r} has no stiffness; leave it out")
        return self


class Bound(_Table):
    """What a number must be: below, above, or a value within a tolerance."""

    below: Number | None = None
    above: Number | None = None
    value: Number | None = None
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
        checks = [number == number]
        if self.below is not None:
            checks.append(number < self.below)
        if self.above is not None:
            checks.append(number > self.above)
        if self.value is not None and self.within is not None:
            checks.append(abs(number - self.value) <= self.within)
        return all(checks)

    def __str__(self) -> str:
        parts = []
        if self.value is not None:
            parts.append(f"{self.value:g} +- {self.within:g}")
        if self.above is not None:
            parts.append(f"> {self.above:g}")
        if self.below is not None:
            parts.append(f"< {self.below:g}")
        return " and ".join(parts)


class ExpectTable(_Table):
    """[expect.NAME]: what a strategy must show, or the job fails (exit code 1)."""

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


class VerdictTable(_Table):
    """[verdict]: where involutivity is judged: a box around the start posture."""

    radius: Positive = 0.2
    samples: Annotated[int, Field(ge=1, le=1_000_000)] = 64


class Job(_Table):
    """A whole job file."""

    title: str
    about: str = ""
    robot: RobotTable
    task: TaskTable = TaskTable()
    start: StartTable
    path: PathTable
    strategies: Annotated[dict[str, StrategyTable], Field(min_length=1)]
    expect: dict[str, ExpectTable] = {}
    verdict: VerdictTable = VerdictTable()

    @model_validator(mode="after")
    def _consistent(self) -> Job:
        for name in self.expect:
            if name not in self.strategies:
                raise ValueError(f"expect.{name}: is for no strategy of this job; known: {', '.join(self.strategies)}")
        return self


def kinds_of_strategy() -> dict[str, tuple[tuple[str, ...], tuple[str, ...]]]:
    """Kind of strategy -> (keys that it needs, keys that it may have besides method and invariant)."""
    return {str(kind): keys for kind, keys in _USES.items()}


def read_job(path: Path) -> Job:
    """A job from a TOML file. Raises: JobError naming file, key, value and cure."""
    try:
        text = path.read_text("utf-8")
    except FileNotFoundError:
        raise JobError(
            path, "file", "there is no such file", "check the path; `holokin jobs` lists the packaged ones"
        ) from None
    except (OSError, UnicodeDecodeError) as problem:
        raise JobError(path, "file", f"cannot be read ({problem})", "give a TOML text file") from None
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        raise JobError(path, "file", f"is not TOML: {problem}", "mend the line it names") from None
    try:
        return Job.model_validate(table)
    except ValidationError as problem:
        raise _named(path, problem, table) from None


def _named(path: Path, problem: ValidationError, table: dict[str, Any]) -> JobError:
    """The first fault of the file, as a sentence. A value that may be of several types has a fault for each."""
    faults = [(_key(fault["loc"], table), fault) for fault in problem.errors()]
    first = faults[0][0]
    key, fault = max((f for f in faults if f"{f[0]}.".startswith(f"{first}.")), key=lambda f: f[0].count("."))
    if fault["type"] == "missing":
        return JobError(path, key, "is missing", "add it; `holokin new` writes a complete example")
    if fault["type"] == "extra_forbidden":
        nearest = closest(key.rpartition(".")[2], _known_keys(key, table))
        cure = f"check its spelling: {nearest}; `holokin new` writes a complete example"
        return JobError(path, key, "is an unknown key", cure)
    value = fault.get("input", table)
    if isinstance(value, float) and not isfinite(value):
        return JobError(path, key, f"is {value}", "give a finite number")
    if fault["type"] == "value_error":
        shown = "" if isinstance(value, dict) else f"is {value!r}: "
        message, _, cure = fault["msg"].removeprefix("Value error, ").partition("; ")
        if not key:  # of the whole job: the message begins with the key
            key, _, message = message.partition(": ")
        return JobError(path, key, f"{shown}{message}", cure)
    shown = "is a table" if isinstance(value, dict) else f"is {value!r}"
    choices = [w for k, f in faults if k == key for w in re.findall("'([^']+)'", _context(f, "expected"))]
    if choices and isinstance(value, str):
        return JobError(path, key, shown, closest(value, choices))
    cures = dict.fromkeys(_cure(f) for k, f in faults if k == key)
    return JobError(path, key, shown, f"give {' or '.join(cures)}")


def _cure(fault: Mapping[str, Any]) -> str:
    """What pydantic wants, in a job writer's words."""
    kind = fault["type"].removesuffix("_type").removesuffix("_parsing").removesuffix("_from_float")
    bound = next((_context(fault, word) for word in _BOUNDS if _context(fault, word)), "").removesuffix(".0")
    return _CURES.get(kind, "{}").format(bound) if kind in _CURES else f"what this asks for: {fault['msg']}"


def _context(fault: Mapping[str, Any], word: str) -> str:
    """A fact of a fault; empty if it has none."""
    return str(fault.get("ctx", {}).get(word, ""))


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


def _known_keys(key: str, table: dict[str, Any]) -> list[str]:
    """The keys that stand beside a key; of a strategy those of its kind."""
    parts = key.split(".")
    if len(parts) == 1:
        return list(Job.model_fields)
    if parts[0] == "strategies":
        kind = table["strategies"][parts[1]].get("kind")
        if kind in _USES:
            every = {word for pair in _USES.values() for words in pair for word in words}
            used = {word for words in _USES[kind] for word in words}
            return [word for word in StrategyTable.model_fields if word not in every - used]
    return list(_TABLES["bound" if len(parts) > 3 else parts[0]].model_fields)


_TABLES: dict[str, type[_Table]] = {
    "robot": RobotTable, "task": TaskTable, "start": StartTable, "path": PathTable, "strategies": StrategyTable,
    "expect": ExpectTable, "verdict": VerdictTable, "bound": Bound,
}  # fmt: skip


def _key(loc: tuple[int | str, ...], table: Any) -> str:
    """The key of a fault, without pydantic's names for the types that a value may have."""
    parts: list[str] = []
    for part in loc:
        if isinstance(table, dict) or (isinstance(table, list) and isinstance(part, int)):
            parts.append(str(part))
            table = table.get(part) if isinstance(table, dict) else table[int(part)]
    return ".".join(parts)
