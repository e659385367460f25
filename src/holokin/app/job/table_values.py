"""What the tables of a job share: numbers and lists of a bounded size, and formulas of the joints."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Self, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from ...analysis.curvature import MOST_JOINTS
from ...base.errors import ArgumentError, brief, closest
from ...robot import FARTHEST, Robot
from ...symbolic import SX, horzcat, parse, vertcat

LARGEST = 1e12
"""Largest number of a job: products of a few such numbers and their squares stay far from overflow."""

Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
Length = Annotated[float, Field(ge=-FARTHEST, le=FARTHEST, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, le=LARGEST, allow_inf_nan=False)]
Formula = str | Number
Few = Field(max_length=MOST_JOINTS)
"""A list of at most as many as a robot may have joints."""

Formulas = Annotated[list[Formula], Few]
Numbers = Annotated[list[Number], Few]
Joints = Annotated[list[str | int], Field(min_length=1, max_length=MOST_JOINTS)]
"""Joints by name, or by index in q, counted from 0."""


class Table(BaseModel):
    """A table of a job file: no other keys, no conversions, and it never changes."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


@dataclass(frozen=True)
class Kinds:
    """Beside the type of a key: the kinds of its table that use it, and whether they need it."""

    names: tuple[str, ...]
    needed: bool


def of(*kinds: str) -> Kinds:
    """A key that these kinds may have."""
    return Kinds(kinds, False)


def needed_by(*kinds: str) -> Kinds:
    """A key that these kinds must have."""
    return Kinds(kinds, True)


class KindTable(Table):
    """A table with a `kind`, of which each uses keys of its own, see `of` and `needed_by`; other keys serve all."""

    @model_validator(mode="after")
    def _of_its_kind(self) -> Self:
        kind, missing, unused = vars(self)["kind"], [], []
        for key, field in type(self).model_fields.items():
            kinds = [mark for mark in field.metadata if isinstance(mark, Kinds)]
            own = [mark for mark in kinds if kind in mark.names]
            given = key in self.model_fields_set and getattr(self, key) is not None
            if any(mark.needed for mark in own) and not given:
                missing.append(key)
            if kinds and not own and given:
                unused.append(key)
        if missing:
            raise ValueError(f"kind = {kind!r} needs {' and '.join(missing)}; add it")
        if unused:
            raise ValueError(f"kind = {kind!r} does not use {unused[0]}; leave it out")
        return self


def check_of(tables: Mapping[str, Table], kind: type[Table], key: str, said: str) -> None:
    """That what is made of another one names one that is not itself of this kind.

    Args:
        tables: by name. kind: of those that have `of`. key: of the tables in the file. said: what they are in it.

    Raises:
        ValueError: it begins with the key.
    """
    others = [name for name, table in tables.items() if not isinstance(table, kind)]
    for name, table in tables.items():
        if isinstance(table, kind) and (of := vars(table)["of"]) not in others:
            fact = f"{key}.{brief(name, 60)}.of: {brief(of, 100)} is no other {said}"
            raise ValueError(f"{fact}; {closest(of, others)}")


Filled = TypeVar("Filled", bound=Table)


def by_kind(models: Iterable[type[Filled]]) -> dict[str, type[Filled]]:
    """Kind -> model; a model may have several kinds."""
    return {str(word): model for model in models for word in get_args(model.model_fields["kind"].annotation)}


def kinds(parent: type[Filled]) -> dict[str, type[Filled]]:
    """Kind -> model of every table below one, in the order of their file; those below these come last."""
    models = parent.__subclasses__()
    found = by_kind(model for model in models if "kind" in model.model_fields)
    for model in models:
        found |= kinds(model)
    return found


def filled(table: type[Filled], key: str, values: dict[str, Any]) -> Filled:
    """A table of values that are given elsewhere than in a job file. Raises: ArgumentError: one makes no sense."""
    try:
        return table(**values)
    except ValidationError as problem:
        fault = problem.errors()[0]
        raise ArgumentError(str((*fault["loc"], key)[0]), fault["input"], f"see [{key}]: {fault['msg']}") from None


def _joint_symbols(q: SX, robot: Robot) -> dict[str, SX]:
    """The joints by name; and as q1 to qn, unless a joint of its own is called like one of these."""
    joints = robot.joint_names
    numbered = [f"q{i + 1}" for i in range(len(joints))]
    free = {} if set(numbered) & set(joints) else {name: q[i] for i, name in enumerate(numbered)}
    return free | {name: q[i] for i, name in enumerate(joints) if name.isidentifier()}


def column(rows: list[Formula], robot: Robot) -> Callable[[SX], SX]:
    """q -> the values (k,) of formulas."""
    return lambda q: vertcat(*(parse(row, _joint_symbols(q, robot)) for row in rows))


def matrix(rows: list[list[Formula]], robot: Robot) -> Callable[[SX], SX]:
    """q -> the matrix of rows of formulas."""
    return lambda q: vertcat(*(horzcat(*(parse(x, _joint_symbols(q, robot)) for x in row)) for row in rows))
