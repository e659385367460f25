"""The form of a survey file, checked by pydantic: which robots, tasks, starts, loops and laws, and how many cases."""

from __future__ import annotations

import fnmatch
from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from ...base.errors import brief
from ..job.path_tables import MOST_CYCLES, MOST_SAMPLES, MOST_STEPS, Row
from ..job.robot_tables import RobotTable
from ..job.schema import LONGEST_ABOUT, LONGEST_TITLE
from ..job.table_values import KindTable, Positive, Table, check_of, needed_by
from ..job.task_tables import TaskTable
from .own_metrics import ColumnName, OwnMetric
from .survey_laws import AnyLaw, ClosedLoop

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
    laws: Annotated[dict[Name, AnyLaw], Field(min_length=1)]
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
        check_of(self.laws, ClosedLoop, "laws", "law of this survey")
        return self
