"""[path] of a job file: which curve, in which frame, and what is made of it."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from ...base.types import Matrix
from ...robot import FARTHEST
from .robot_tables import MOST_PARTS, FrameTable, Names, Three
from .table_values import Formula, KindTable, Length, Number, Positive, needed_by, of

MOST_POINTS = 10_000
"""Points of a polyline: a millimetre apart they make ten metres. Each is looked at in Python, 20 us."""

MOST_SAMPLES = 100_000
"""Steps a cycle: 10 um apart on a metre."""

MOST_CYCLES = 10_000
"""Cycles: a day's work of an arm that takes ten seconds for one."""

MOST_STEPS = 400_000
"""Samples times cycles. A Panda's pose takes 1.7 GB, a minute to follow and 410 MB of CSV for a million of them; these
fit into a gigabyte."""

MOST_PASSES = 1_000

Point = Annotated[list[Length], Field(min_length=2, max_length=3)]
Row = Annotated[list[Number], Field(min_length=3, max_length=3)]
Points = Annotated[list[Point], Field(max_length=MOST_POINTS)]
Turns = Annotated[list[Three], Field(max_length=MOST_POINTS)]
Times = Annotated[list[Length], Field(max_length=MOST_POINTS)]
Poses = Annotated[list[FrameTable], Field(max_length=MOST_POINTS)]
Count = Annotated[int, Field(ge=1, le=MOST_POINTS)]
Kind = Literal[
    "circle", "arc", "polyline", "spline", "poses", "waypoints", "svg", "figure-eight", "raster", "spiral"
]  # fmt: skip

_OF_ALL = {"samples", "cycles", "entry", "others"}
"""Keys of [path] that `others` do not have."""

_OPEN = ("arc", "raster", "spiral")


class PathTable(KindTable):
    """[path]: a curve of the tool, and what is made of it.

    `relative` points count from the tool's start point. A closed path is run round for `cycles`, and its two
    halves are the two paths to the pose half a loop away.
    """

    kind: Kind
    center: Annotated[Point | None, needed_by("circle", "arc")] = None
    normal: Annotated[Row, of("circle", "arc", "figure-eight", "spiral")] = Field(default=[0.0, 0.0, 1.0])
    angle_deg: Annotated[Length | None, needed_by("arc")] = None
    points: Annotated[Points | None, needed_by("polyline", "spline")] = None
    turns_deg: Annotated[Turns | None, of("polyline")] = None
    closed: Annotated[bool, of("polyline", "spline", "poses", "waypoints")] = False
    clockwise: Annotated[bool, of("circle", "arc", "spiral")] = False
    times: Annotated[Times | None, of("spline", "poses")] = None
    poses: Annotated[Poses | None, needed_by("poses")] = None
    through: Annotated[Literal["spline", "lines"], of("poses", "waypoints")] = "spline"
    file: Annotated[str | None, needed_by("waypoints", "svg")] = None
    units: Annotated[Literal["m", "mm"] | None, of("waypoints")] = None
    angles: Annotated[Literal["rad", "deg"] | None, of("waypoints")] = None
    order: Annotated[Literal["xyzw", "wxyz"] | None, of("waypoints")] = None
    ignore: Annotated[Names, of("waypoints")] = Field(default=[])
    pixel: Annotated[Positive | None, of("svg")] = None
    outline: Annotated[Count | None, of("svg")] = None
    at: Annotated[Point | None, of("circle", "arc", "svg", "figure-eight", "raster", "spiral")] = None
    width: Annotated[Positive | None, needed_by("figure-eight")] = None
    height: Annotated[Positive | None, of("figure-eight")] = None
    along: Annotated[Three | None, of("figure-eight", "spiral"), needed_by("raster")] = None
    across: Annotated[Three | None, needed_by("raster")] = None
    spacing: Annotated[Positive | None, needed_by("raster", "spiral")] = None
    radius: Annotated[Positive | None, needed_by("spiral")] = None
    inward: Annotated[bool, of("spiral")] = False
    surface: Annotated[Formula | None, of("raster", "spiral")] = None
    tool: Annotated[Literal["start", "normal"] | None, of("raster", "spiral")] = None
    relative: bool = False
    frame: FrameTable | None = None
    blend: Positive | None = None
    passes: Annotated[int, Field(ge=1, le=MOST_PASSES)] = 1
    offset: Three = Field(default=[0.0, 0.0, 0.0])
    lift: Three = Field(default=[0.0, 0.0, 0.0])
    same_way: bool = False
    lead_in: Annotated[float, Field(ge=0, le=FARTHEST)] = 0.0
    lead_out: Annotated[float, Field(ge=0, le=FARTHEST)] = 0.0
    retract: Annotated[float, Field(ge=0, le=FARTHEST)] = 0.0
    retract_speed: Positive | None = None
    entry: Literal["joints", "tool"] | None = None
    speed: Annotated[float, Field(gt=0, le=FARTHEST, allow_inf_nan=False)] = 0.1
    samples: Annotated[int, Field(ge=1, le=MOST_SAMPLES)] = 1000
    cycles: Annotated[int, Field(ge=1, le=MOST_CYCLES)] = 1
    others: Annotated[list[PathTable], Field(max_length=MOST_PARTS)] | None = None

    @model_validator(mode="after")
    def _complete(self) -> PathTable:
        if self.relative and self.frame is not None:
            raise ValueError("relative and frame both say from where it counts; leave out one")
        for key in sorted(self.model_fields_set & {"offset", "lift", "same_way"}):
            if self.passes == 1:
                raise ValueError(f"{key} is of several passes; give passes, or leave it out")
        own = {key for other in self.others or [] for key in other.model_fields_set & _OF_ALL}
        if own:
            raise ValueError(f"others hold {' and '.join(sorted(own))}; say that of all paths together, in [path]")
        open_polyline = self.kind in ("polyline", "spline") and not self.closed
        leads = self.passes > 1 or self.lead_in > 0 or self.lead_out > 0 or self.retract > 0
        if self.cycles > 1 and (self.kind in _OPEN or open_polyline or leads):
            raise ValueError("several cycles need a closed path; use a circle, or a polyline with closed = true")
        if self.samples * self.cycles > MOST_STEPS:
            fact = f"{self.samples:,} samples in {self.cycles:,} cycles are more than {MOST_STEPS:,} steps"
            raise ValueError(f"{fact}; give fewer samples or cycles")
        return self

    @property
    def frame_pose(self) -> Matrix:
        """The frame (4, 4) from which the path counts."""
        return np.eye(4) if self.frame is None else self.frame.matrix
