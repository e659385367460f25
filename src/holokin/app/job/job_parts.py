"""From the tables of a job to the nouns: robot, tasks, path, strategies."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path as FilePath
from typing import cast

import numpy as np

from ...analysis.curvature import MOST_JOINTS
from ...base.errors import (
    ArgumentError,
    BranchError,
    HolokinError,
    JobError,
    JointLimitError,
    MissingExtraError,
    PathError,
    SingularityError,
    posture_text,
)
from ...base.poses import pose_from
from ...base.tolerances import TOLERANCES
from ...base.types import Matrix, Value, Vector
from ...motion import TimedTrajectory, approach, retime
from ...motion.checks import CheckReport
from ...motion.ik import move_to_leaf
from ...motion.timed_trajectory import with_entry
from ...motion.trajectory import Trajectory
from ...path import (
    Path,
    PathFile,
    Waypoints,
    arc,
    as_point,
    blended,
    figure_eight,
    passes,
    polyline,
    raster,
    read_paths,
    spiral,
    spline,
    with_leads,
)
from ...path.editing import AnyPath, synchronized
from ...path.path import rotation_vector
from ...robot import Robot, with_tool
from ...strategies import HolonomicStrategy, Strategy
from ...strategies.tasks.frame_task import parts_of
from ...strategies.tasks.task import Task
from ...symbolic import Function, parse, symbol
from .schema import Job, dotted
from .strategy_tables import ConstraintTable, Fitted, StrategyTable
from .tables import NamedPathTable, PathTable, TimingTable, robot_of_job

MOST_COMMENTS = 10
"""Comments of a file that a job passes on."""


def build_robot(job: Job, file: FilePath) -> Robot:
    """The robot of a job; a path counts from the job file's folder."""
    with naming(file, "robot") if job.robot.parts is not None or job.robot.order is not None else nullcontext():
        robot = robot_of_job(job.robot, file)
    if robot.n > MOST_JOINTS:
        cure = (
            f"strategies of at most {MOST_JOINTS} joints are judged: choose tip and base nearer together, or lock some"
        )
        raise JobError(file, "robot", f"moves {robot.n} joints", cure)
    return robot


@contextmanager
def naming(file: FilePath, *key: str) -> Iterator[None]:
    """Errors of what a job asks for name its file and key. Along a path, or without an extra, they keep theirs."""
    try:
        yield
    except (JobError, PathError, MissingExtraError):
        raise
    except HolokinError as problem:
        fact, _, cure = str(problem).rpartition("; ")
        raise JobError(file, dotted(key), fact or cure, cure if fact else "change it") from problem


def title_of(label: str, task: Task, tasks: list[Task]) -> str:
    """How a strategy of a job is called for one of its tasks: with the orientation, where there are several."""
    return label if len(tasks) == 1 else f"{label} ({task.orientation})"


def reason(problem: HolokinError) -> str:
    """Why a strategy could not be run; of an error that names a key of the job the fact and the cure."""
    return f"{problem.fact}; {problem.cure}" if isinstance(problem, JobError) else str(problem)


def _build_start(job: Job, robot: Robot, file: FilePath) -> Vector:
    """The start posture (n,) in rad and m. Raises: JobError, JointLimitError."""
    q = np.array(job.start.q, dtype=float)
    if len(q) != robot.n:
        names = ", ".join(robot.joint_names)
        raise JobError(file, "start.q", f"has {len(q)} numbers", f"give {robot.n}, for {names}")
    scales = np.where(robot.hinges, np.pi / 180, 1.0)
    if job.start.degrees:
        q = scales * q
    try:
        robot.check_limits(q)
    except JointLimitError as problem:
        if job.start.degrees or robot.beyond(scales * q).max() > 0:
            raise
        fact = f"puts joint {problem.joint!r} at {problem.value:.6g} rad, outside its limits"
        limits = f"[{problem.lower:.6g}, {problem.upper:.6g}]"
        cure = "say degrees = true if these are degrees, or choose another start posture"
        raise JobError(file, "start.q", f"{fact} {limits}", cure) from None
    return q


def build_tasks(job: Job, file: FilePath, robot: Robot | None = None) -> tuple[Robot, Vector, list[Task]]:
    """(robot, start posture (n,), a task, or one for each orientation of a list) of a job.

    The robot has the shapes of [checks], and all that is made of the tasks has them, too.

    Args:
        robot: as `build_robot` makes it, where it was made before.

    Raises:
        JobError, JointLimitError, and what the tasks raise.
    """
    robot = build_robot(job, file) if robot is None else robot
    if job.checks is not None:
        with naming(file, "checks"):
            robot = job.checks.shaped(robot)
    start = _build_start(job, robot, file)
    with naming(file, "task"):
        return robot, start, job.task.tasks(robot, start)


def build_strategy(job: Job, label: str, task: Task, q0: Vector, title: str) -> Strategy:
    """A strategy of the job, called `title`; a fitted one is fitted to another one of it. Raises: HolokinError."""
    table = job.strategies[label]
    if isinstance(table, Fitted):
        return table.fit(build_strategy(job, table.of, task, q0, table.of), q0, title)
    return table.build(task, q0, title)


def build_begin(table: StrategyTable, strategy: Strategy, q0: Vector) -> tuple[Vector, str]:
    """Where a strategy begins (n,), and a sentence on it: the start posture, or with `level` the one moved to from it.

    Raises:
        BranchError where moving to the leaf fails; else as `move_to_leaf`.
    """
    if not isinstance(table, ConstraintTable) or table.level is None:
        return q0, ""
    level = ", ".join(f"{value:g}" for value in np.atleast_1d(table.level))
    try:
        begin = move_to_leaf(cast(HolonomicStrategy, strategy), q0, table.level, limits=False)  # it refuses others
    except (SingularityError, PathError) as problem:
        fact, _, cure = str(problem).rpartition("; ")
        fact = f"moving to the leaf failed: from the start posture to level {level}, {fact}"
        raise BranchError(fact, f"{cure}, or another level") from problem
    posture = posture_text(begin, strategy.task.robot.joint_names)
    return begin, f"{strategy.name} begins on the leaf of level {level}, moved to from the start posture, at {posture}."


def build_path(table: PathTable, task: Task, q0: Vector, file: FilePath) -> Path:
    """The path of a table. It begins at the tool's start point unless an entry leads to it.

    Raises:
        JobError, FileError, and what the shapes raise.
    """
    tool, F = task.pose(q0), table.frame_pose
    local = np.linalg.inv(F) @ tool if table.frame is not None else tool
    path = _curve(table, local[:3, 3], file)
    if table.file:
        path = replace(path, notes=tuple(f"{table.file}: {note}" for note in path.notes))
    if table.blend is not None:
        path = blended(path, table.blend, keep_start=table.entry is None)
    if table.passes > 1:
        turns = None if not table.same_way else False
        path = passes(path, table.passes, offset=table.offset, lift=table.lift, back_and_forth=turns)
    if table.lead_in or table.lead_out or table.retract:
        path = with_leads(path, table.lead_in, table.lead_out, retract=table.retract, retract_speed=table.retract_speed)
    if table.frame is not None:
        path = path.in_frame(F)
    if table.cycles > 1 and not path.closed:
        fact = f"asks for {table.cycles} cycles of a path that ends {path.gap:.3g} (m or rad) from its start"
        raise JobError(file, "path.cycles", fact, "close the path, or leave out cycles")
    if table.entry is None:
        _check_begin(path, table, tool, task, q0, file)
    return path


def _curve(table: PathTable, tool: Vector, file: FilePath) -> Path:
    """The bare curve, in its frame, in which the tool's start point is `tool`."""
    origin = tool if table.relative else np.zeros(3)

    def placed(point: list[float]) -> Vector:
        return origin + as_point(point)

    kind, speed, closed = table.kind, table.speed, table.closed
    # Through points and poses.
    if kind in ("polyline", "spline"):
        points = np.array([placed(p) for p in table.points or []])
        if kind == "spline":
            return spline(points, times=table.times, closed=closed, speed=speed)
        turns = None if table.turns_deg is None else np.deg2rad(table.turns_deg)
        return polyline(points, turns=turns, closed=closed, speed=speed)
    if kind == "poses":
        matrices = np.array([pose.matrix for pose in table.poses or []]).reshape(-1, 4, 4)
        targets = Waypoints(matrices[:, :3, 3] + origin, matrices[:, :3, :3])
        if table.through == "lines":
            return polyline(targets, closed=closed, speed=speed)
        return spline(targets, times=table.times, closed=closed, speed=speed)
    # Curves of a few numbers, from the tool, or from `at`.
    if kind in ("circle", "arc"):
        return _arc(table, placed(table.center or []), tool if table.at is None else placed(table.at), file)
    start = tool if table.at is None and table.frame is None else placed(table.at or [0.0, 0.0, 0.0])
    if kind == "file":
        return _of_file(table, origin, start, file)
    if kind == "figure-eight":
        return figure_eight(start, table.width or 0.0, table.height, table.normal, along=table.along, speed=speed)
    # Over a surface.
    surface = None if table.surface is None else _surface(table.surface)
    if kind == "raster":
        sides = table.along or [], table.across or []
        return raster(start, *sides, table.spacing or 0.0, surface=surface, tool=table.tool, speed=speed)
    way = {"inward": table.inward, "clockwise": table.clockwise, "along": table.along}
    radius, spacing = table.radius or 0.0, table.spacing or 0.0
    return spiral(start, radius, spacing, table.normal, surface=surface, tool=table.tool, speed=speed, **way)


def _arc(table: PathTable, center: Vector, start: Vector, file: FilePath) -> Path:
    """The arc that begins at a point (3,): where the tool is, or `at`."""
    angle = 360.0 if table.angle_deg is None else table.angle_deg
    try:
        return arc(start, center, np.deg2rad(-angle if table.clockwise else angle), table.normal, speed=table.speed)
    except ArgumentError as problem:
        if problem.what != "normal" or table.relative:
            raise
        fact = f"is {problem.value}, {'the tool' if table.at is None else 'it'} starts at {_typed(start)}"
        cure = f"{problem.cure}; set relative = true, then the center counts from the tool"
        raise JobError(file, "path.normal", fact, cure) from None


def _read_file(table: PathTable, file: FilePath) -> PathFile:
    """The paths in the file of a table. Raises: as `read_paths`."""
    words = table.model_dump(
        include={"units", "columns", "angles", "order", "maker", "ignore", "axis", "rotary", "rapid_speed", "pixel"}
    )
    return read_paths(file.parent / (table.file or ""), **words)


def _named_paths(tables: Sequence[NamedPathTable], file: FilePath) -> list[NamedPathTable]:
    """The tables of a job of several paths; one of a file without `only` stands for each path in it, by its name.

    Raises:
        JobError: two paths then have one name. As `read_paths`.
    """
    every: list[NamedPathTable] = []
    for i, table in enumerate(tables):
        if table.kind != "file" or table.only is not None:
            every.append(table)
            continue
        with naming(file, "path", str(i), "file"):
            read = _read_file(table, file)
        if len(read) == 1:
            every.append(table)
            continue
        for number, path in enumerate(read.paths, 1):
            name = f"{table.name} {path.name or number}"
            every.append(table.model_copy(update={"only": number, "name": name}))
    names = [table.name for table in every]
    for name in names:
        if names.count(name) > 1:
            raise JobError(file, "path", f"has two paths named {name!r}", "give one of the tables another name")
    return every


def build_each(job: Job, file: FilePath, start: Vector, task: Task) -> list[tuple[NamedPathTable, Task, Path]]:
    """(table, task of its tool, path) of each of several paths; all of one tool have one task.

    Args:
        task: of the job, whose robot has no `tool_frame`.

    Raises:
        JobError, and as `build_path`.
    """
    tasks: dict[str, Task] = {repr(None): task}
    built = []
    for i, table in enumerate(_named_paths(job.paths, file)):
        key = repr(table.tool_frame)
        if key not in tasks and table.tool_frame is not None:
            with naming(file, "path", str(i), "tool_frame"):
                tip = task.robot._find_tip(task.tip).name
                robot = with_tool(task.robot, *table.tool_frame.pose(), tip=tip, name=tip)
                tasks[key] = job.task.tasks(robot, start)[0]
        with naming(file, "path", str(i)):
            path = build_path(table.model_copy(update={"entry": "joints"}), tasks[key], start, file)
        rotation = path.rotation if path.rotation is not None else tasks[key].pose(start)[:3, :3]
        built.append((table, tasks[key], replace(path, rotation=rotation)))
    return built


def _of_file(table: PathTable, origin: Vector, start: Vector, file: FilePath) -> Path:
    """A path of a file: counted from an origin, or from `at`; one of a drawing without a place begins at the start."""
    read = _read_file(table, file)
    if table.only is None and len(read) > 1:
        lengths = ", ".join(f"{path.name!r}: {path.path().length:.3g} m" for path in read.paths[:12])
        raise JobError(file, "path.only", f"names none of the {len(read)} paths ({lengths})", "say which one")
    try:
        waypoints = read.named(1 if table.only is None else table.only)
    except ArgumentError as problem:
        raise JobError(file, "path.only", f"is {table.only!r}", problem.cure) from None
    # What the file says beside the points.
    notes = [*read.notes, *(f"a comment of {comment}" for comment in waypoints.comments[:MOST_COMMENTS])]
    if waypoints.approach is not None:
        notes.append(f"the rapid moves to its start are left out ({len(waypoints.approach)})")
    if waypoints.speeds is not None and "speed" in table.model_fields_set:
        notes.append(f"the speeds of the file give way to that of the job, {table.speed:g} m/s")
        waypoints = replace(waypoints, speeds=None)
    # A table of points alone is smoothed unless the job says lines; all else is as the file draws it.
    smooth = table.through == "spline" or (
        table.through is None and read.kind == "table" and waypoints.moves is None and waypoints.speeds is None
    )
    if waypoints.moves is not None and (smooth or table.closed):
        key = "closed" if table.closed else "through"
        raise JobError(file, f"path.{key}", "is of points, and the file has arcs or curves", "leave it out")
    if smooth:
        path = spline(waypoints, closed=table.closed, speed=table.speed)
    elif table.closed:
        path = polyline(waypoints, closed=True, speed=table.speed)
    else:
        path = waypoints.path(table.speed)
    path = replace(path, notes=(*notes, *path.notes))
    if read.kind in ("SVG", "DXF") and table.at is None and table.frame is None and not table.relative:
        return path.starting_at(start)
    return path.in_frame(pose_from(origin if table.at is None else start))


def _surface(formula: str | float) -> Callable[[float, float], float]:
    """z(u, v) of a formula of u and v."""
    u, v = symbol("u", 1), symbol("v", 1)
    height = Function("surface", {"u": u, "v": v}, {"z": parse(formula, {"u": u, "v": v})})
    return lambda a, b: float(np.ravel(height([a], [b]))[0])


def _check_begin(path: Path, table: PathTable, tool: Matrix, task: Task, q0: Vector, file: FilePath) -> None:
    """Raises: JobError when a path begins elsewhere than at the tool, in the rows of the task."""
    R = tool[:3, :3] if path.rotation is None else path.rotation
    off = np.abs(task.error(q0, path.start, R))
    if off.max(initial=0.0) <= TOLERANCES.start:
        return
    rows = [row for row in task.rows if row < 3]
    gap = float(np.abs((path.start - tool[:3, 3])[rows]).max(initial=0.0))
    where = f"the tool at the start posture, {_typed(tool[:3, 3])},"
    if gap <= TOLERANCES.start:
        turned = np.degrees(np.linalg.norm(rotation_vector(R @ tool[:3, :3].T)))
        fact = f"{where} is turned by {turned:.3g} degrees from the start of the path"
        raise JobError(file, "path", fact, 'set entry = "joints" to go there first, or choose another start posture')
    fact = f"{where} is {gap:.3g} m away from the start of the path"
    if table.kind == "polyline" and table.frame is None:
        first = "set relative = true, or make the tool's point the first one"
        cure = "begin with [0, 0, 0]" if table.relative else first
        raise JobError(file, "path.points.0", fact, f'{cure}, or set entry = "joints" to go there first')
    raise JobError(file, "path", f"{fact}, {_typed(path.start)}", 'set entry = "joints" to go there first, or move it')


def _typed(point: Vector) -> str:
    """A point as one would type it into a job, within the tolerance of a start."""
    return "[" + ", ".join(f"{round(float(v), 9) + 0.0:.10g}" for v in point) + "]"


def build_paths(table: PathTable, task: Task, q0: Vector, file: FilePath) -> AnyPath:
    """The path, or paths of several frames run through together; one without stays where it is.

    Raises:
        JobError, ArgumentError: as `build_path`; more paths than frames; an entry, which serves one tool.
    """
    others = table.others or []
    if len(others) >= task.frames:
        cure = f"the task has {task.frames}: leave some out"
        raise ArgumentError("the number of frames with a path", len(others) + 1, cure)
    if task.frames == 1:
        return build_path(table, task, q0, file)
    if table.entry is not None:
        raise JobError(file, "path.entry", "leads one tool to its path, the task has several", "leave it out")
    paths = []
    for f, part in enumerate(parts_of(task)):
        if f > len(others):
            paths.append(part.pose(q0)[:3, 3])
        else:
            own = table if f == 0 else others[f - 1].model_copy(update={"cycles": table.cycles})
            paths.append(build_path(own, part, q0, file))
    return synchronized(*paths)


# --- The entry of a job: from its start posture to where its path begins, timed and checked like the path.


@dataclass(frozen=True, eq=False)
class Entry(Value):
    """The posture q0 (n,) at the start of the path, and the way to it; None where the path begins at once."""

    q0: Vector
    walk: Trajectory | None = None

    def timed(self, timing: TimingTable) -> TimedTrajectory | None:
        """The entry with the limits and the profile of a job, at most as fast as `approach` goes."""
        if self.walk is None:
            return None
        return retime(self.walk, **timing.model_dump() | {"speed": 1.0, "endless": False})

    def before(self, motion: TimedTrajectory, timing: TimingTable) -> TimedTrajectory:
        """A timed motion of the path with the entry before it."""
        entry = self.timed(timing)
        return motion if entry is None else with_entry(entry, motion)


def build_entry(job: Job, strategy: Strategy, path: AnyPath, q0: Vector) -> Entry:
    """The entry of a job from a start posture (n,).

    Raises:
        BranchError where it leads nowhere; ArgumentError: paths of several frames.
    """
    if job.only_path.entry is None:
        return Entry(q0)
    if not isinstance(path, Path):
        cure = "leave it out, and begin where all paths do"
        raise ArgumentError("the entry to the paths of several frames", job.only_path.entry, cure)
    try:
        walk = approach(strategy, path, q0, by=job.only_path.entry)
    except (SingularityError, PathError) as problem:
        fact, _, cure = str(problem).rpartition("; ")
        raise BranchError(f"the entry to the path failed: {fact}", cure) from problem
    return Entry(walk.q[-1], walk if len(walk.q) > 1 else None)


def entry_report(job: Job, file: FilePath, strategy: Strategy, entry: Entry) -> tuple[str, CheckReport | None]:
    """A sentence on an entry, and what the job's [checks] find on it; an empty one where there is no entry."""
    walk, robot = entry.walk, strategy.task.robot
    if walk is None:
        return "", None
    motion = walk if job.timing is None else entry.timed(job.timing) or walk
    # How long it takes, where it leads, and the joint that moves most.
    moved = np.ptp(walk.q, axis=0)
    most, posture = int(np.argmax(moved)), posture_text(entry.q0, robot.joint_names)
    note = (
        f"{strategy.name} enters the path by {job.only_path.entry} in {motion.t[-1]:.3g} s, at {posture}; on this way "
    )
    note += f"{robot.joint_names[most]} moves most, by {moved[most]:.3g} {robot.coordinates[most].unit}"
    # What [checks] find.
    if job.checks is None:
        return f"{note}. The way there is not checked: the job has no [checks].", None
    with naming(file, "checks"):
        report = job.checks.checked(motion, strategy.task)
    if report.passed:
        return f"{note}. [checks] find nothing on the way there.", report
    trouble = report.findings[0] if report.findings else report.unread
    return f"{note}. [checks] find on the way there: {trouble}.", report
