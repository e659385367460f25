"""The tables of a job but for its strategies: robot, task, path, checks, and how its motion is timed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, ValidationInfo, model_validator

from ...analysis.curvature import MOST_JOINTS
from ...base.errors import ArgumentError, brief, closest
from ...base.types import Matrix, Vector
from ...export import ProcessLines, ToolTolerance, Wiring
from ...motion import TimedTrajectory, retime
from ...motion.checks import CheckReport, Clearances, Scene, check
from ...motion.timing import GIVE_VELOCITY, joint_curve
from ...motion.trajectory import Trajectory
from ...path import frame_pose
from ...path.editing import MOST_PASSES
from ...robot import (
    FARTHEST,
    Box,
    Capsule,
    Cylinder,
    LinkShape,
    Mesh,
    Robot,
    Shape,
    assembled,
    beside,
    convex_pieces,
    coordinates,
    load,
    obstacle,
    speed_limits,
    with_capsules,
    with_limits,
    with_shape,
)
from ...strategies.tasks.frame_task import Orientation, stacked
from ...strategies.tasks.task import Task
from ...strategies.tasks.task_kinds import custom_task, line_of_sight, pose, position, relative_pose
from ...symbolic import SX, horzcat, parse, vertcat, vertsplit

# --- What the tables of a job share: numbers and lists of a bounded size, and formulas of the joints.

LARGEST = 1e12  # largest number of a job: products of a few such numbers and their squares stay far from overflow

Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
Length = Annotated[float, Field(ge=-FARTHEST, le=FARTHEST, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, le=LARGEST, allow_inf_nan=False)]
Formula = str | Number
Few = Field(max_length=MOST_JOINTS)  # A list of at most as many as a robot may have joints

Formulas = Annotated[list[Formula], Few]
Numbers = Annotated[list[Number], Few]
# joints by name, or by index in q, counted from 0
Joints = Annotated[list[str | int], Field(min_length=1, max_length=MOST_JOINTS)]


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


def check_of(tables: Mapping[str, Table], kind: type[Table], key: str, noun: str) -> None:
    """That what is made of another one names one that is not itself of this kind.

    Args:
        tables: by name. kind: of those that have `of`. key: of the tables in the file. noun: what they are in it.

    Raises:
        ValueError: it begins with the key.
    """
    others = [name for name, table in tables.items() if not isinstance(table, kind)]
    for name, table in tables.items():
        if isinstance(table, kind) and (of := vars(table)["of"]) not in others:
            fact = f"{key}.{brief(name, 60)}.of: {brief(of, 100)} is no other {noun}"
            raise ValueError(f"{fact}; {closest(of, others)}")


Filled = TypeVar("Filled", bound=Table)


def by_kind(models: Iterable[type[Filled]]) -> dict[str, type[Filled]]:
    """Kind -> model; a model may have several kinds."""
    return {str(word): model for model in models for word in get_args(model.model_fields["kind"].annotation)}


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


def of_pose(rows: list[Formula]) -> Callable[[SX, SX], SX]:
    """(position (3,), rotation (3, 3)) -> the values (k,) of formulas of x, y, z and r11, r12, ..., r33."""

    def values(position: SX, rotation: SX) -> SX:
        names = dict(zip("xyz", vertsplit(position), strict=True))
        names |= {f"r{i + 1}{j + 1}": rotation[i, j] for i in range(3) for j in range(3)}
        return vertcat(*(parse(row, names) for row in rows))

    return values


def matrix(rows: list[list[Formula]], robot: Robot) -> Callable[[SX], SX]:
    """q -> the matrix of rows of formulas."""
    return lambda q: vertcat(*(horzcat(*(parse(x, _joint_symbols(q, robot)) for x in row)) for row in rows))


# --- [robot] of a job file: a robot by name, its tool and mounting, or parts put together; and the robot of it.

MOST_PARTS = 32  # robots of which one is put together

Three = Annotated[list[Length], Field(min_length=3, max_length=3)]
Names = Annotated[list[str], Field(max_length=1000)]
Tips = Annotated[list[str], Field(min_length=1, max_length=MOST_PARTS)]
# of all joints, of each, or of some by name
Limit = Number | Numbers | Annotated[dict[str, Number], Field(max_length=1000)]


class FrameTable(Table):
    """A frame: xyz in m; rpy in rad, or rpy_deg. R = Rz(yaw) Ry(pitch) Rx(roll)."""

    xyz: Three = Field(default=[0.0, 0.0, 0.0])
    rpy: Three | None = None
    rpy_deg: Three | None = None

    @model_validator(mode="after")
    def _one_of_them(self) -> FrameTable:
        if self.rpy is not None and self.rpy_deg is not None:
            raise ValueError("rpy and rpy_deg both say how it is turned; leave out one")
        return self

    def pose(self) -> tuple[list[float], list[float]]:
        """(xyz [m], rpy [rad])."""
        turned = np.deg2rad(self.rpy_deg).tolist() if self.rpy_deg is not None else self.rpy
        return self.xyz, turned or [0.0, 0.0, 0.0]

    @property
    def matrix(self) -> Matrix:
        """The pose (4, 4)."""
        xyz, rpy = self.pose()
        return frame_pose("a frame", [*xyz, *rpy])


def frame_of(frame: FrameTable | None) -> Matrix:
    """The pose (4, 4) of a frame, which a job has put in the place of its name; without one that of the base."""
    return np.eye(4) if frame is None else frame.matrix


class ModelTable(Table):
    """What a robot and a part of one have in common: which chain is taken of a model, and its tool."""

    tip: str | Tips | None = None
    base: str | None = None
    locked: dict[str, Number] = Field(default={})
    args: dict[str, str | Number | bool] = Field(default={})
    trust_units: bool = False
    tool: FrameTable | None = None
    tools: Annotated[dict[str, FrameTable], Field(min_length=1, max_length=MOST_PARTS)] | None = None


class PartTable(ModelTable, FrameTable):
    """[[robot.parts]]: a robot, mounted at xyz, rpy on a tip of a part before it, or on the "base"."""

    name: str
    on: str | None = None
    prefix: str = ""


class CoordinatesTable(Table):
    """[robot.coordinates]: coordinates u with limits and no links, for a custom task."""

    names: Names
    lower: Number | Numbers | None = None
    upper: Number | Numbers | None = None
    max_velocity: Number | Numbers | None = None
    units: str | Names = "1"


class RobotTable(ModelTable):
    """[robot]: a catalogue name, or a path (a model or .toml) relative to the job file; or parts, one on the other.

    Or coordinates without links.
    """

    name: str | None = None
    base_pose: FrameTable | None = None
    parts: Annotated[list[PartTable], Field(min_length=1, max_length=MOST_PARTS)] | None = None
    order: Names | None = None
    lower: Limit | None = None
    upper: Limit | None = None
    max_velocity: Limit | None = None
    coordinates: CoordinatesTable | None = None

    @model_validator(mode="after")
    def _something(self) -> RobotTable:
        if self.coordinates is not None:
            if more := sorted(self.model_fields_set - {"name", "coordinates"}):
                raise ValueError(f"{more[0]} stands beside coordinates; they have no links: leave it out")
            return self
        if self.name is None and self.parts is None:
            raise ValueError("it names no robot; give name, or parts")
        chosen = sorted(self.model_fields_set & {"tip", "base", "locked", "args"})
        if self.parts is not None and chosen:
            raise ValueError(f"{chosen[0]} stands beside parts; give it to one of them")
        return self


def robot_of_job(table: RobotTable, file: Path) -> Robot:
    """The robot of a job; a path counts from the job file's folder. Raises: as `load` and `compose`."""
    if table.coordinates is not None:
        return coordinates(**table.coordinates.model_dump(exclude_none=True), name=table.name or "coordinates")

    def loaded(given: Mapping[str, Any]) -> Robot:
        return load(beside(given["name"], file.parent), **{key: v for key, v in given.items() if key != "name"})

    given = table.model_dump(exclude_none=True, exclude_defaults=True)
    limits = {key: given.pop(key) for key in ("lower", "upper", "max_velocity") if key in given}
    robot = assembled(file, given, loaded)
    return with_limits(robot, **limits, trust_units=table.trust_units) if limits else robot


# --- [checks] of a job file: what is looked at in the motion of every strategy.

LARGEST_OBSTACLE = 50.0  # size of a mesh [m]: what is larger was given in mm
MOST_OBSTACLES = 100  # shapes round a robot; each is looked at with each link
MOST_ALLOWED = 1000  # pairs of links that may touch

NotNegative = Annotated[float, Field(ge=0, le=1e6, allow_inf_nan=False)]
Pair = Annotated[list[str], Field(min_length=2, max_length=2)]


class ObstacleTable(KindTable, FrameTable):
    """[[checks.obstacles]]: a solid or a mesh at xyz, rpy in the frame of the base, of a `frame`, or `on` a tip."""

    name: Annotated[str, Field(min_length=1, max_length=100)]
    on: str | None = None
    frame: FrameTable | None = None
    kind: Literal["box", "sphere", "capsule", "cylinder", "mesh"]
    sides: Annotated[Annotated[list[Positive], Field(min_length=3, max_length=3)] | None, needed_by("box")] = None
    radius: Annotated[Positive | None, needed_by("sphere", "capsule", "cylinder")] = None
    length: Annotated[Positive | None, needed_by("capsule", "cylinder")] = None
    file: Annotated[str | None, needed_by("mesh")] = None
    scale: Annotated[Positive | Three, of("mesh")] = 1.0
    pieces: Annotated[Literal["coacd"] | Names | None, of("mesh")] = None
    threshold: Annotated[float, Field(ge=0.01, le=1), of("mesh")] = 0.05

    @model_validator(mode="before")
    @classmethod
    def _beside(cls, given: Any, info: ValidationInfo) -> Any:
        """Files count from the folder of the job file."""
        if not isinstance(given, dict):
            return given
        more: dict[str, Any] = {}
        if isinstance(given.get("file"), str):
            more["file"] = _from_folder(given["file"], info)
        if isinstance(pieces := given.get("pieces"), list):
            more["pieces"] = [_from_folder(piece, info) if isinstance(piece, str) else piece for piece in pieces]
        return given | more

    @model_validator(mode="after")
    def _complete(self) -> ObstacleTable:
        if self.on is not None and self.frame is not None:
            raise ValueError("on and frame both say from where it counts; leave out one")
        if "threshold" in self.model_fields_set and self.pieces != "coacd":
            raise ValueError('threshold is of pieces = "coacd"; leave it out')
        return self

    def standing(self) -> list[LinkShape]:
        """The same as values, where they stand: one, or the pieces of a mesh. Raises: RobotFileError."""
        parts = [obstacle(self.name, shape, *self.pose()) for shape in self._shapes]
        return [replace(part, placement=frame_of(self.frame) @ part.placement) for part in parts]

    def carried(self, robot: Robot) -> Robot:
        """The robot that carries it. Raises: UnknownNameError: no such tip."""
        for shape in self._shapes:
            robot = with_shape(robot, self.name, shape, *self.pose(), tip=self.on)
        return robot

    @cached_property
    def _shapes(self) -> tuple[Shape, ...]:
        if self.kind == "box":
            return (Box(self.sides),)  # type: ignore[arg-type]  the shape makes an array of it
        if self.kind == "mesh":
            return self._meshes()
        radius, length = self.radius or 0.0, self.length or 0.0
        return (Cylinder(radius, length) if self.kind == "cylinder" else Capsule(radius, length),)

    def _meshes(self) -> tuple[Shape, ...]:
        """The mesh, or its convex pieces. Raises: RobotFileError, ArgumentError: one that is too large for metres."""
        scale = np.full(3, self.scale) if isinstance(self.scale, float) else np.array(self.scale)
        mesh = Mesh(Path(self.file or ""), scale)
        if (size := 2 * mesh.ball[1]) > LARGEST_OBSTACLE:
            cure = "give metres: scale = 0.001 makes them of a file in mm"
            raise ArgumentError(f"the size of {self.name} [m]", round(size, 3), cure)
        if self.pieces is None:
            return (mesh,)
        if self.pieces == "coacd":
            return convex_pieces(mesh, self.threshold)
        return tuple(Mesh(Path(piece), scale).hull for piece in self.pieces)


def _from_folder(name: str, info: ValidationInfo) -> str:
    """A file's name, which counts from the folder of the job file where that is known."""
    return str(Path(info.context["folder"]) / name) if info.context else name


class ChecksTable(Table):
    """[checks]: what every motion is looked at for, as of `check`."""

    floor: Length | None = None
    clearance: NotNegative = Scene.clearance
    self_collision: bool = True
    limits: bool = True
    margin: NotNegative = 0.0
    rcond: Annotated[float, Field(ge=0, lt=1)] = 0.01
    radius: Positive | dict[str, Positive] | None = None
    allowed: Annotated[list[Pair], Field(max_length=MOST_ALLOWED)] = Field(default=[])
    srdf: str | None = None
    padding: dict[str, NotNegative] = Field(default={})
    obstacles: Annotated[list[ObstacleTable], Field(max_length=MOST_OBSTACLES)] = Field(default=[])

    @model_validator(mode="before")
    @classmethod
    def _beside(cls, given: Any, info: ValidationInfo) -> Any:
        """The SRDF counts from the folder of the job file."""
        if isinstance(given, dict) and isinstance(given.get("srdf"), str):
            return given | {"srdf": _from_folder(given["srdf"], info)}
        return given

    @cached_property
    def scene(self) -> Scene:
        """What the robot is to keep clear of. Raises: RobotFileError: a mesh or an SRDF that cannot be read."""
        keys = {"floor": self.floor, "clearance": self.clearance, "self_collision": self.self_collision}
        standing = [shape for table in self.obstacles if table.on is None for shape in table.standing()]
        keys |= {"obstacles": standing, "allowed": [(a, b) for a, b in self.allowed], "padding": self.padding}
        return Scene(**keys) if self.srdf is None else Scene.from_srdf(self.srdf, **keys)

    def checked(self, motion: Trajectory | TimedTrajectory, task: Task) -> CheckReport:
        """What is found of a motion, of a robot that is `shaped`. Raises: as `check`."""
        return check(motion, self.scene, task=task, limits=self.limits, margin=self.margin, rcond=self.rcond)

    def keeps_clear(self, robot: Robot) -> Scene | None:
        """The scene, for what refuses one of which a robot can touch nothing. Raises: as `Clearances.of`."""
        return self.scene if robot.tips and Clearances.of(robot, self.scene).names else None

    def shaped(self, robot: Robot) -> Robot:
        """The robot with its capsules, and with what it carries. Raises: as `with_capsules` and `with_shape`."""
        return self._loaded(robot if self.radius is None else with_capsules(robot, self.radius))

    def _loaded(self, robot: Robot) -> Robot:
        for table in self.obstacles:
            robot = robot if table.on is None else table.carried(robot)
        return robot

    def drawn(self, robot: Robot) -> Robot:
        """The robot for pictures: with what it carries, and else as it was. Raises: UnknownNameError: no such tip."""
        count = sum(len(table._shapes) for table in self.obstacles if table.on is not None)
        return replace(robot, shapes=(*robot.shapes, *self._loaded(robot).shapes[-count:])) if count else robot


# --- [task] of a job file: what the tool, or two of them, shall do; and the tasks of it.
#
# A new kind of task is one more value of `kind` here, its keys, each with the kinds that use it, and its case in
# `tasks`.

Orientations = Annotated[list[Orientation], Field(min_length=1)]
Axis = Literal["x", "y", "z"] | Three
Rows = Field(min_length=1, max_length=MOST_JOINTS)
Parts = Field(min_length=2, max_length=MOST_PARTS)


class TaskTable(KindTable):
    """[task]: position, pose, the pose of one tip in another's frame, a camera's line of sight, formulas, or several.

    A list of orientations runs every strategy once for each.
    """

    kind: Literal["position", "pose", "relative-pose", "line-of-sight", "custom", "stacked"] = "position"
    orientation: Annotated[Orientation | Orientations, of("pose", "relative-pose")] = "twist"
    axis: Annotated[Axis, of("pose", "relative-pose", "line-of-sight")] = "z"
    rows: Annotated[Annotated[list[int], Field(max_length=6)] | None, of("position", "pose", "relative-pose")] = None
    tip: Annotated[str | None, of("position", "pose", "line-of-sight"), needed_by("relative-pose")] = None
    other: Annotated[str | None, needed_by("relative-pose")] = None
    point: Annotated[Three | None, needed_by("line-of-sight")] = None
    expressions: Annotated[Annotated[list[Formula], Rows] | None, needed_by("custom")] = None
    units: Annotated[Annotated[list[str], Rows] | None, needed_by("custom")] = None
    names: Annotated[Annotated[list[str], Rows] | None, of("custom")] = None
    parts: Annotated[Annotated[list[TaskTable], Parts] | None, needed_by("stacked")] = None

    @model_validator(mode="after")
    def _complete(self) -> TaskTable:
        kinds = self.orientation
        if isinstance(kinds, list) and len(set(kinds)) < len(kinds):
            raise ValueError(f"orientation = {kinds} names one twice; name each once")
        if "axis" in self.model_fields_set and self.kind != "line-of-sight" and "axis" not in self._orientations:
            raise ValueError('axis serves orientation = "axis"; leave it out')
        if any(isinstance(part.orientation, list) or part.kind == "stacked" for part in self.parts or []):
            raise ValueError("a part of a stacked task has one orientation, and no parts of its own; choose one")
        return self

    @property
    def _orientations(self) -> list[Orientation]:
        return self.orientation if isinstance(self.orientation, list) else [self.orientation]

    def tasks(self, robot: Robot, q0: Vector, turned: Matrix | None = None) -> list[Task]:
        """One task, or one for each orientation of a list; what counts from a reference does so from the start.

        Args:
            turned: rotation (3, 3) of the tool at the start, where no posture of it is known yet.
        """
        if self.kind == "position":
            return [position(robot, self.tip, rows=self.rows)]
        if self.kind == "line-of-sight":
            return [line_of_sight(robot, self.point or (), axis=self.axis, tip=self.tip)]
        if self.kind == "custom":
            formulas = column(self.expressions or [], robot)
            return [custom_task(robot, formulas, units=self.units or (), names=self.names, name="task")]
        if self.kind == "pose":
            R = robot.pose(q0, self.tip)[:3, :3] if turned is None else turned
            return [
                pose(robot, kind, reference=R, axis=self.axis, tip=self.tip, rows=self.rows)
                for kind in self._orientations
            ]
        if self.kind == "stacked":
            return [stacked(*(part.tasks(robot, q0)[0] for part in self.parts or []))]
        tip, other = self.tip or "", self.other or ""
        R = relative_pose(robot, tip, other).pose(q0)[:3, :3]
        return [
            relative_pose(robot, tip, other, kind, reference=R, axis=self.axis, rows=self.rows)
            for kind in self._orientations
        ]


# --- [path] of a job file: which curve, in which frame, and what is made of it.

# points of a polyline: a millimetre apart they make ten metres. Each is looked at in Python, 20 us
MOST_POINTS = 10_000
MOST_SAMPLES = 100_000  # steps a cycle: 10 um apart on a metre
MOST_CYCLES = 10_000  # cycles: a day's work of an arm that takes ten seconds for one
MOST_PATHS = 100  # paths of a job: a program of more procedures is made of several jobs
# samples times cycles. A Panda's pose takes 1.7 GB, a minute to follow and 410 MB of CSV for a million of them;
# these fit into a gigabyte
MOST_STEPS = 400_000

Point = Annotated[list[Length], Field(min_length=2, max_length=3)]
Row = Annotated[list[Number], Field(min_length=3, max_length=3)]
Points = Annotated[list[Point], Field(max_length=MOST_POINTS)]
Turns = Annotated[list[Three], Field(max_length=MOST_POINTS)]
Times = Annotated[list[Length], Field(max_length=MOST_POINTS)]
Poses = Annotated[list[FrameTable], Field(max_length=MOST_POINTS)]
Count = Annotated[int, Field(ge=1, le=MOST_POINTS)]
Kind = Literal["circle", "arc", "polyline", "spline", "poses", "file", "figure-eight", "raster", "spiral"]

Lines = Annotated[list[str], Field(max_length=100)]  # lines of a robot program

_OF_ALL = {"samples", "cycles", "entry", "others"}  # keys of [path] that `others` do not have
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
    closed: Annotated[bool, of("polyline", "spline", "poses", "file")] = False
    clockwise: Annotated[bool, of("circle", "arc", "spiral")] = False
    times: Annotated[Times | None, of("spline", "poses")] = None
    poses: Annotated[Poses | None, needed_by("poses")] = None
    through: Annotated[Literal["spline", "lines"] | None, of("poses", "file")] = None
    file: Annotated[str | None, needed_by("file")] = None
    only: Annotated[str | Count | None, of("file")] = None
    units: Annotated[Literal["m", "mm", "in"] | None, of("file")] = None
    angles: Annotated[Literal["rad", "deg"] | None, of("file")] = None
    order: Annotated[Literal["xyzw", "wxyz"] | None, of("file")] = None
    maker: Annotated[str | None, of("file")] = None
    columns: Annotated[Names | None, of("file")] = None
    ignore: Annotated[Names, of("file")] = Field(default=[])
    axis: Annotated[Literal["into", "out"] | None, of("file")] = None
    rotary: Annotated[str | None, of("file")] = None
    rapid_speed: Annotated[Positive | None, of("file")] = None
    pixel: Annotated[Positive | None, of("file")] = None
    at: Annotated[Point | None, of("circle", "arc", "file", "figure-eight", "raster", "spiral")] = None
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
        """The frame (4, 4) from which the path counts; one that is named stands in the job, see `Job`."""
        return frame_of(self.frame)


class NamedPathTable(PathTable):
    """[[path]]: one of several paths, with its name, its tool, and the lines of its process."""

    name: Annotated[str, Field(min_length=1, max_length=100)]
    tool_frame: FrameTable | None = None
    on: Lines | None = None
    off: Lines | None = None

    @model_validator(mode="after")
    def _of_several(self) -> NamedPathTable:
        if not self.name.isprintable():
            raise ValueError("name holds a control character; give letters, digits, spaces")
        for key in ("entry", "others", "cycles"):
            if key in self.model_fields_set:
                raise ValueError(f"{key} is of a job of one path; leave it out, see [air]")
        return self


class AirTable(Table):
    """[air]: how the tool goes from one of several paths to the next."""

    order: Literal["given", "shortest"] = "given"
    height: Annotated[float, Field(gt=0, le=FARTHEST)] = 0.1
    height_speed: Positive = 0.1
    via: Annotated[list[Numbers], Field(max_length=20)] = Field(default=[])
    home: bool = True


JointLimit = Positive | Annotated[list[Positive], Few]  # one for all joints, or one a joint

Speed = Annotated[float, Field(gt=0)]  # A positive number, or `inf` for no limit

# keys of [program] that some languages take, each in its own kind
OF_SOME = ("tool", "base", "payload", "zone", "coupled", "pulses", "letters", "group", "arc")

# Key of [program] -> the argument of writers that holds it together with others.
ARGUMENT_OF: dict[str, str] = {
    **dict.fromkeys(("axes", "external", "signs", "offsets", "offsets_deg"), "wiring"),
    **dict.fromkeys(("before", "on", "off", "after"), "lines"),
    **dict.fromkeys(("tool_tolerance", "linear"), "tolerance"),
}
ALL_JOINTS = 2e-3  # tolerance of the joints [rad or m] for tasks of several tools


class TimingTable(Table):
    """[timing]: limits, profile and step, as of `retime`; every strategy is timed."""

    acceleration: JointLimit | None = None
    jerk: JointLimit | None = None
    velocity: Speed | Annotated[list[Speed], Few] | None = None
    profile: Literal["time-optimal", "trapezoidal", "quintic"] = "time-optimal"
    speed: Positive | Literal["fastest"] = 1.0
    endless: bool = False
    dt: Annotated[float, Field(ge=1e-6, le=1.0)] = 1e-3

    @model_validator(mode="after")
    def _complete(self) -> TimingTable:
        if self.acceleration is None and self.profile != "quintic":
            raise ValueError(f"profile = {self.profile!r} needs acceleration; add it")
        return self

    def check(self, robot: Robot) -> None:
        """Raises: ArgumentError: a joint of the robot has no speed limit, and the table gives none."""
        if self.velocity is None:
            speed_limits(robot, GIVE_VELOCITY)

    def timed(self, trajectory: Trajectory) -> TimedTrajectory:
        """A trajectory, timed as the table says; one that does not repeat is never endless. Raises: as `retime`."""
        speed = None if self.speed == "fastest" else self.speed
        endless = self.endless and joint_curve(trajectory).repeats
        return retime(trajectory, **self.model_dump() | {"speed": speed, "endless": endless})


class ToolToleranceTable(Table):
    """[program.tool_tolerance]: how near the tool stays to the timed motion, as of `ToolTolerance`."""

    mm: Positive = 0.5
    degrees: Positive = 0.5
    percent: Annotated[float, Field(gt=0, lt=100)] = 5.0
    joints: Positive = 0.02


class ProgramTable(Table):
    """[program]: the axes of the controller, how exact a robot program is, and what it does besides moving."""

    axes: Annotated[list[str | Length], Few] | None = None
    external: Annotated[list[str | Length], Few] = Field(default=[])
    signs: dict[str, Literal[1, -1]] = Field(default={})
    offsets: dict[str, Length] = Field(default={})
    offsets_deg: dict[str, Length] = Field(default={})
    coupled: bool = False
    tolerance: Positive | None = None
    tool_tolerance: ToolToleranceTable | None = None
    linear: bool = False
    tool: str | int | Annotated[list[Length], Few] | None = None
    base: str | int | None = None
    payload: str | int | float | None = None
    zone: str | int | float | None = None
    pulses: Annotated[list[Length], Few] | None = None
    letters: Annotated[list[str], Few] | None = None
    group: int | None = None
    arc: Annotated[list[str], Few] | None = None
    before: Lines = Field(default=[])
    on: Lines = Field(default=[])
    off: Lines = Field(default=[])
    after: Lines = Field(default=[])

    @model_validator(mode="after")
    def _one_tolerance(self) -> ProgramTable:
        if self.tolerance is not None and self.tool_tolerance is not None:
            raise ValueError("tolerance and tool_tolerance both say how exact the program is; leave out one")
        if self.tolerance is not None and self.linear:
            raise ValueError("linear moves need a tolerance of the tool; give tool_tolerance in place of tolerance")
        return self

    @property
    def wiring(self) -> Wiring:
        """The axes as a value."""
        axes = None if self.axes is None else tuple(self.axes)
        turned = {joint: float(np.deg2rad(value)) for joint, value in self.offsets_deg.items()}
        return Wiring(axes, tuple(self.external), dict(self.signs), dict(self.offsets) | turned)

    def lines(self, window: tuple[float, float] | None, path: PathTable | None = None) -> ProcessLines:
        """The process lines as a value, those of a path first. Raises: ArgumentError: a line that no program can hold.

        Args:
            window: times at which the process begins and ends. path: one of several.
        """
        on, off = self.on, self.off
        if isinstance(path, NamedPathTable):
            on, off = (own if given is None else given for own, given in ((on, path.on), (off, path.off)))
        return ProcessLines(tuple(self.before), tuple(on), tuple(off), tuple(self.after), window)

    def given(self, task: Task, streams: bool) -> dict[str, Any]:
        """Arguments of a writer for a task; `streams`: by default it sends every sample."""
        own = {key: getattr(self, key) for key in OF_SOME if getattr(self, key) is not None}
        return own | {"wiring": self.wiring, "tolerance": self._tolerance(task, streams)}

    def _tolerance(self, task: Task, streams: bool) -> float | ToolTolerance | None:
        """Of the tool, unless the job gives one of the joints or the task has several tools."""
        table = self.tool_tolerance
        if self.tolerance is not None or (table is None and not self.linear and (streams or task.frames > 1)):
            return self.tolerance or (None if streams else ALL_JOINTS)
        table = table or ToolToleranceTable()
        rotation = float(np.deg2rad(table.degrees))
        return ToolTolerance(task, table.mm / 1e3, rotation, table.percent / 100, table.joints, self.linear)
