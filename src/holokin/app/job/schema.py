"""The form of a job file, checked by pydantic; every error names file, key, value and cure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import AfterValidator, Field, create_model, model_validator

from ...base.errors import HolokinError, brief, closest
from ...base.printed_units import SI, PrintedUnits, printed_units
from ...robot import FARTHEST
from .check_tables import ChecksTable
from .metrics import METRICS
from .motion_tables import ProgramTable, TimingTable
from .path_tables import PathTable, Point, Row
from .robot_tables import Names, RobotTable
from .strategy_tables import AnyStrategy, Fitted
from .table_values import Few, KindTable, Length, Positive, Table, check_of, needed_by, of
from .task_tables import TaskTable

MOST_POSTURES = 65_536
"""Postures of a verdict: those of `thorough=True`."""

MOST_POSES = 16_384
"""Tool poses of a workspace: shares are right to a thousandth, and those that are missed take a few ms each."""

MOST_CELLS = 200
"""Cells along the longest side of a slice: a pixel each in a picture on a page."""

MOST_STRATEGIES = 100
"""Strategies of a job: a table and figures of more are not read."""

LONGEST_NAME = 100
"""Characters of a strategy's name, which heads columns, figures and files."""

LONGEST_TITLE = 200
"""Characters of a title: two lines of the table."""

LONGEST_ABOUT = 10_000
"""Characters of the paragraph in a report."""

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


class Expected(Table):
    """[expect.NAME]: what a strategy must show, or the job fails (exit code 1); every metric may have a bound, too."""

    holonomic: bool | None = None
    completes: bool = True


if TYPE_CHECKING:
    ExpectTable = Expected
else:
    ExpectTable = create_model("ExpectTable", __base__=Expected, **dict.fromkeys(METRICS, (Bound | None, None)))


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


class Job(Table):
    """A whole job file."""

    title: Annotated[str, Field(max_length=LONGEST_TITLE)]
    about: Annotated[str, Field(max_length=LONGEST_ABOUT)] = ""
    units: Annotated[str | Names, AfterValidator(_known_units)] = ""
    robot: RobotTable
    task: TaskTable = TaskTable()
    start: StartTable
    path: PathTable
    timing: TimingTable | None = None
    program: ProgramTable | None = None
    checks: ChecksTable | None = None
    workspace: WorkspaceTable | None = None
    sheets: SheetsTable | None = None
    strategies: Annotated[dict[str, AnyStrategy], Field(min_length=1, max_length=MOST_STRATEGIES)]
    expect: dict[str, ExpectTable] = Field(default={})
    verdict: VerdictTable = VerdictTable()

    @property
    def printed_units(self) -> PrintedUnits:
        """The units in which results are printed."""
        return printed_units(self.units) if self.units else SI

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
