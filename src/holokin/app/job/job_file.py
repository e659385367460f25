"""Reading a job file: what is wrong with it becomes a sentence that names file, key, value and cure."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any, Generic, TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError

from ...base.errors import JobError, closest, shown
from ...robot.formats.text_files import read_toml
from .schema import Job
from .strategy_tables import KINDS

Key = tuple[str, ...]
"""The path to a value: the names and numbers of the tables and lists around it, and its own."""

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
    """What a kind of file holds: its model, the table of things that have a `kind`, and those kinds."""

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
            return self.model.model_validate(table)
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
    faults = [_located(fault, table, form) for fault in problem.errors()]
    faults.sort(key=lambda found: found[1]["type"] == "missing")  # a misspelt key tells more than the one it leaves out
    first = faults[0][0]
    parts, fault = max((f for f in faults if f[0][: len(first)] == first), key=lambda f: len(f[0]))
    key, kind = dotted(parts), _kind_at(parts, table, form)
    if fault["type"] == "missing":
        if kind:
            return JobError(path, dotted(parts[:2]), f"kind = {kind!r} needs {parts[2]}", "add it")
        return JobError(path, key, "is missing", form.example)
    if fault["type"] == "extra_forbidden":
        if kind and any(parts[2] in model.model_fields for model in form.kinds.values()):
            return JobError(path, dotted(parts[:2]), f"kind = {kind!r} does not use {parts[2]}", "leave it out")
        nearest = closest(parts[-1], _known_keys(parts, kind, form))
        return JobError(path, key, "is an unknown key", form.more.format(nearest))
    value = fault.get("input", table)
    if isinstance(value, float) and not isfinite(value):
        return JobError(path, key, f"is {value}", "give a finite number")
    if fault["type"] == "value_error":
        found = "" if isinstance(value, dict) else f"is {shown(value, 150)}: "
        message, _, cure = fault["msg"].removeprefix("Value error, ").partition("; ")
        if not key:  # of the whole job: the message begins with the key
            key, _, message = message.partition(": ")
        return JobError(path, key, f"{found}{message}", cure)
    found = "is a table" if isinstance(value, dict) else f"is {shown(value, 150)}"
    choices = [w for k, f in faults if k == parts for w in re.findall("'([^']+)'", _context(f, "expected"))]
    if choices and isinstance(value, str):
        return JobError(path, key, found, closest(value, choices))
    cures = dict.fromkeys(_cure(f) for k, f in faults if k == parts)
    return JobError(path, key, found, f"give {' or '.join(cures)}")


def _cure(fault: Mapping[str, Any]) -> str:
    """What pydantic wants, in a job writer's words."""
    kind = fault["type"].removesuffix("_type").removesuffix("_parsing").removesuffix("_from_float")
    bound = next((_context(fault, word) for word in _BOUNDS if _context(fault, word)), "").removesuffix(".0")
    return _CURES.get(kind, "{}").format(bound) if kind in _CURES else f"what this asks for: {fault['msg']}"


def _context(fault: Mapping[str, Any], word: str) -> str:
    """A fact of a fault; empty if it has none."""
    return str(fault.get("ctx", {}).get(word, ""))


def _located(fault: Any, table: dict[str, Any], form: Form[Any]) -> tuple[Key, dict[str, Any]]:
    """(key, fault) of what pydantic found: without the kinds that it puts into the keys of what has one."""
    loc, fault = fault["loc"], dict(fault)
    if loc[:1] == (form.named,) and len(loc) > 2:
        loc = loc[:2] + loc[3:]
    if fault["type"].startswith("union_tag"):
        loc = (*loc, "kind")
        named = "kind" in fault["input"]
        facts = {"expected": ", ".join(map(repr, form.kinds))}
        fault |= {"type": "literal_error", "ctx": facts} if named else {"type": "missing"}
        fault["input"] = fault["input"].get("kind")
    return _key(loc, table), fault


def _kind_at(key: Key, table: dict[str, Any], form: Form[Any]) -> str:
    """The kind of what a key is of; empty for other tables, and where it is the kind that is wrong."""
    if len(key) < 3 or key[0] != form.named or key[2] == "kind":
        return ""
    return str(table[form.named][key[1]]["kind"])


def _known_keys(key: Key, kind: str, form: Form[Any]) -> list[str]:
    """The keys that stand beside a key; of what has a kind those of its kind."""
    if len(key) > 2 and key[0] == form.named:
        return keys_beside(form.kinds[kind], key[2:]) if kind else ["kind"]
    return keys_beside(form.model, key)


def keys_beside(of: Any, key: Key) -> list[str]:
    """The keys that may stand where a key does, in a table, or in a value of another type that may hold tables."""
    if isinstance(of, type) and issubclass(of, BaseModel):
        field = of.model_fields.get(key[0])
        return list(of.model_fields) if len(key) == 1 else keys_beside(field.annotation if field else None, key[1:])
    if get_origin(of) in (list, dict):  # the first part is the place or the name
        return keys_beside(get_args(of)[-1], key[1:]) if len(key) > 1 else []
    return list(dict.fromkeys(found for one in get_args(of) for found in keys_beside(one, key)))


def _key(loc: tuple[int | str, ...], table: Any) -> Key:
    """The key of a fault, without pydantic's names for the types that a value may have."""
    parts: list[str] = []
    for part in loc:
        if isinstance(table, dict) or (isinstance(table, list) and isinstance(part, int)):
            parts.append(str(part))
            if isinstance(table, dict):
                table = table.get(part)
            else:  # a list may lack the part whose absence is the fault
                table = table[int(part)] if int(part) < len(table) else None
    return tuple(parts)


def _no_survey(path: Path, table: dict[str, Any]) -> None:
    if not {"laws", "loops"} - set(table) and "strategies" not in table:
        raise JobError(path, "laws", "is of a survey, and this no job", f"run it: holokin survey {path}")


_WRITES = "`holokin new` writes a complete example"
_JOB = Form(
    Job, "strategies", KINDS, "check the path; `holokin jobs` lists the packaged ones",
    f"check its spelling: {{}}; {_WRITES}", f"add it; {_WRITES}", _no_survey,
)  # fmt: skip
