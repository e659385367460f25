"""Doing a job: every strategy round the path, over a workspace, by sheets; judged and checked."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from importlib.resources import as_file, files
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...analysis.coverage import Reach, coverage, coverage_slices, posture_reach
from ...analysis.curvature import around, involutivity, why_elsewhere
from ...analysis.sheets import SheetMotion, Sheets, sheets
from ...analysis.sheets.sheet_map import sheets_of_file
from ...base.arguments import typed
from ...base.errors import (
    ArgumentError,
    EmptyRegionError,
    HolokinError,
    JobError,
    JointLimitError,
    NotFiniteError,
    PathError,
    RoundOffError,
    SingularityError,
    UnknownNameError,
)
from ...base.errors.motion_errors import KEPT
from ...base.types import Matrix, Value, Vector
from ...motion import follow
from ...motion.checks import Scene
from ...motion.follow_path import Following, by_leaf
from ...motion.trajectory import Status, Trajectory
from ...path import Path, read_workspace
from ...path.editing import AnyPath
from ...path.workspaces import PoseRange, Workspace, pose_cloud, workspace
from ...robot import Robot, load
from ...strategies import HolonomicStrategy, Strategy, holonomic
from ...strategies.constraints import custom
from ...strategies.tasks.task import Task
from ..report.job_result import Check, JobResult, NotRun, SheetsResult, StrategyResult
from .job_parts import (
    build_begin,
    build_entry,
    build_paths,
    build_robot,
    build_strategy,
    build_tasks,
    entry_report,
    naming,
)
from .metrics import METRICS, Run, apart
from .schema import ExpectTable, Job, SheetsTable, WorkspaceTable, job_table, read_job
from .strategy_tables import KINDS, Fitted
from .tables import TimingTable, filled

# --- [workspace]: how many of its poses each strategy with leaves reaches.

COVER_PLACES = 256
"""Poses of a path that stand for a workspace."""


@dataclass(frozen=True, eq=False)
class Covering(Value):
    """The workspace of a job, as its table asks for it."""

    workspace: Workspace
    table: WorkspaceTable
    task: Task
    q0: Vector

    @cached_property
    def reach(self) -> Reach:
        """Which poses the arm reaches by any posture: the same for all strategies."""
        asked = self.table
        return posture_reach(self.task, self.workspace, self.q0, samples=asked.samples, seed=asked.seed)

    def added(self, result: StrategyResult, strategy: HolonomicStrategy, q0: Vector) -> StrategyResult:
        """A result with the coverage of the leaf on which the strategy begins, and slices where there are planes."""
        asked, space = self.table, self.workspace
        covers = coverage(
            strategy, space, q0, samples=asked.samples, seed=asked.seed, limits=asked.limits, reach=self.reach
        )
        slices = ()
        if isinstance(space, PoseRange) and asked.slices:
            slices = coverage_slices(strategy, space, q0, steps=max(2, asked.slices), limits=asked.limits)
        return replace(result, coverage=covers, slices=slices)


def _build_covering(job: Job, task: Task, q0: Vector, file: FilePath) -> Covering | None:
    """The workspace of a job with what is asked of it; None for a job without. Raises: JobError, RecordingError."""
    if job.workspace is None:
        return None
    at_start = task.robot.pose(q0)[:3, :3]
    return Covering(build_workspace(job.workspace, at_start, file), job.workspace, task, q0)


def build_workspace(table: WorkspaceTable, at_start: Matrix, file: FilePath) -> Workspace:
    """The workspace of a table; a file of poses counts from the job file's folder.

    Args:
        at_start: rotation (3, 3) of the tool at the start.

    Raises:
        JobError, RecordingError.
    """
    if table.kind == "poses":
        return read_workspace(file.parent / str(table.file), ignore=table.ignore)
    solid = {
        "box": table.box_sides,
        "cylinder": (table.center, table.radius, table.half_height),
        "sphere": (table.center, table.radius),
    }[table.kind]
    rotations = {"down": None, "start": at_start}
    rotation = rotations[table.rotation] if isinstance(table.rotation, str) else table.rotation
    angles = {"tilt": np.deg2rad(table.tilt_deg), "spin": np.deg2rad(table.spin_deg)}
    with naming(file, "workspace"):
        return workspace(**{table.kind: solid}, rotation=rotation, **angles)  # type: ignore[arg-type]


def workspace_of_job(job: Job, task: Task, start: Vector, file: FilePath) -> Workspace:
    """[workspace] of a job; without one the poses along its path. Raises: as `build_workspace`; ArgumentError."""
    tool = task.robot.pose(start, task.tip)[:3, :3]
    if job.workspace is not None:
        return build_workspace(job.workspace, tool, file)
    path = build_paths(job.path, task, start, file)
    if not isinstance(path, Path):
        raise ArgumentError("the paths of several tools", len(path.paths), "this is for one tool: add a [workspace]")
    shares = np.linspace(0.0, 1.0, COVER_PLACES, endpoint=not path.closed)
    places = path.at(shares * path.duration)
    T = np.tile(np.eye(4), (COVER_PLACES, 1, 1))
    T[:, :3, 3] = places.position
    T[:, :3, :3] = places.rotation @ (tool if path.rotation is None else path.rotation)
    return pose_cloud(T, f"the path of {file.name}")


@typed
def read_sheets(
    path: str | FilePath,
    task: Task,
    scene: Scene | None = None,
) -> Sheets:
    """The map of sheets that `Sheets.save` or `holokin sheets` wrote, for the task that it was made for.

    Nothing in the file is run. The postures in it are held against the model: their tools are at the poses, they lie on
    their leaves and within the limits.

    Args:
        path: the file.
        task: of the robot for which the map was made.
        scene: as it was given to `hk.sheets`.

    Returns:
        The map, as it was saved.

    Raises:
        SheetsFileError: it cannot be read, is of another robot, task or scene, or holds what makes no sense.
    """
    return sheets_of_file(path, task, scene, _strategy)


def _strategy(keys: Mapping[str, Any], task: Task, q0: Vector, name: str) -> HolonomicStrategy:
    if task.n == task.m:
        return holonomic(task, custom(lambda _q: [], rows=0), name=name)
    kind = str(keys.get("kind"))
    known = {name: model for name, model in KINDS.items() if model is not Fitted}
    if kind not in known:
        raise UnknownNameError("kind of strategy", kind, known)
    found = filled(known[kind], "strategy", dict(keys)).build(task, q0, name)
    if not isinstance(found, HolonomicStrategy):
        raise ArgumentError("the strategy of a sheet", kind, "it has no leaves: give a file that a map of sheets saved")
    return found


# --- [sheets] of a job: its map, searched for or read from a file, and the motion along the job's path on it.

ONE_TOOL = "it is of several tools, and sheets are of one"
"""Why a path is not followed on sheets."""


def saved_map(job: Job, task: Task, file: FilePath) -> Sheets | None:
    """The map that `file` of [sheets] names, which counts from the job file's folder; None where it names none.

    Raises:
        JobError: there is no such file, or it is of another robot, task or [checks].
    """
    table = job.sheets
    if table is None or table.file is None:
        return None
    place = file.parent / table.file
    if not place.is_file():
        cure = f"write it with `holokin sheets {file.name}`, or leave it out: then the sheets are searched for"
        raise JobError(file, "sheets.file", f"names {table.file}, and there is no such file", cure)
    with naming(file, "sheets", "file"):
        return read_sheets(place, task, job.scene)


def sheets_of_job(
    job: Job, task: Task, start: Vector, file: FilePath, say: Callable[[str], None] = lambda _text: None
) -> Sheets:
    """The map of a job with [sheets]: that of its file, or the outcome of a search, which may take minutes.

    Raises:
        JobError, and as `sheets`.
    """
    saved = saved_map(job, task, file)
    if saved is not None:
        return saved
    with naming(file, "sheets"):
        space = workspace_of_job(job, task, start, file)
        return sheets(
            task, space, scene=job.scene, progress=lambda text: say(f"sheets: {text}"), **searched(job.sheets)
        )


def _sheets_result(
    job: Job, task: Task, start: Vector, path: AnyPath, file: FilePath, say: Callable[[str], None]
) -> SheetsResult | None:
    """What becomes of [sheets] of a job, None in a job without. Raises: as `sheets_of_job`."""
    if job.sheets is None:
        return None
    found = sheets_of_job(job, task, start, file, say)
    say("sheets: the path")
    return _result_of(found, job.sheets, path_motion(found, path, start), job, start, file)


def _result_of(
    found: Sheets, table: SheetsTable, along: SheetMotion | None, job: Job, start: Vector, file: FilePath
) -> SheetsResult:
    """A map and a motion as what a report tells; a map of other poses than the job's [workspace] is named so."""
    remark = ""
    if table.file is not None and job.workspace is not None:
        asked = str(workspace_of_job(job, found.task, start, file))
        if job.workspace.kind != "poses" and str(found.workspace) != asked:
            remark = f"it is of {found.workspace}, not of the job's [workspace]"
    return SheetsResult(found, table.share, along, "" if along is not None else ONE_TOOL, table.file or "", remark)


def path_motion(found: Sheets, path: AnyPath, start: Vector) -> SheetMotion | None:
    """A path over the sheets, None of several tools; the tool begins with the rotation of the path, or of the start."""
    if not isinstance(path, Path):
        return None
    turned = path if path.rotation is not None else replace(path, rotation=found.task.pose(start)[:3, :3])
    return found.follow(turned)


def searched(table: SheetsTable | None) -> dict[str, Any]:
    """[sheets] as arguments of `sheets`."""
    return (table or SheetsTable()).model_dump(exclude={"file"})


PAPER = ("ppr-half-circle", "ppr-cycle", "irb140-half-square", "orientation")
"""The jobs that make up the paper, under the name "paper"."""

OF_ONE_STRATEGY = (
    SingularityError, PathError, EmptyRegionError, JointLimitError, NotFiniteError, RoundOffError,
)  # fmt: skip
"""What one strategy may meet where the others of its job do not. Anything else is a mistake in the job file."""


PLACES = 65
"""Of the two halves of a closed path that are held against each other."""

RETRACED = 1e-6
"""Share of a path's size by which its halves may differ and still be one way: beyond round-off, below any drawing."""


def packaged_jobs() -> tuple[str, ...]:
    """Names of the jobs that come with the library."""
    names = (entry.name for entry in files("holokin.app.job").joinpath("packaged").iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml")))


def expand(names: list[str]) -> list[str]:
    """Job names with "paper" replaced by its four jobs."""
    return [job for name in names for job in (PAPER if name == "paper" else (name,))]


def open_job(name: str) -> tuple[str, Job, FilePath]:
    """(short name, job, file) of a packaged job or a TOML file. Raises: UnknownNameError, JobError."""
    if name.lower().endswith(".toml"):
        path = FilePath(name)
        if os.path.exists(path) and not os.path.isfile(path):  # a pipe or a device might never end
            raise JobError(path, "file", "cannot be read: it is no regular file", "give a TOML text file")
        if path.stem in (".", ".."):
            raise JobError(path, "file", "has no name before .toml", "rename it: its results go into a folder so named")
        return path.stem, read_job(path), path
    if name not in packaged_jobs():
        beside = [file for file in (f"{name}.toml", f"{name}.TOML") if os.path.isfile(file)]  # False for any odd name
        raise UnknownNameError("job", name, [*beside, *packaged_jobs(), "paper", "or a path ending in .toml"])
    with as_file(files("holokin.app.job").joinpath("packaged", f"{name}.toml")) as path:
        return name, read_job(path), path


def open_one_job(name: str) -> tuple[str, Job, FilePath]:
    """As `open_job`. Raises: ArgumentError: a name that stands for several jobs."""
    names = expand([name])
    if names != [name]:
        raise ArgumentError("the job", name, f"it stands for several: choose one of {', '.join(names)}")
    return open_job(name)


def is_job(name: str) -> bool:
    """Whether a name is that of a job: a packaged one, or a .toml file with a table of a job."""
    file = FilePath(name)
    if file.suffix.lower() != ".toml":
        return name in packaged_jobs()
    try:
        return bool({"strategies", "path", "task", "start", "robot"} & job_table(file).keys())
    except JobError:  # who reads it as a robot says what is wrong
        return False


def robot_of_file(name: str, tip: Sequence[str] | None = None, trust_units: bool = False) -> Robot:
    """The robot of a job, or one by catalogue name or file. Raises: as `open_job` and `load`."""
    if is_job(name):
        if tip:
            raise ArgumentError("the tip", list(tip), "a job says it itself: leave it out")
        _, job, file = open_one_job(name)
        return build_robot(job, file)
    return load(name, tip=tip or None, trust_units=trust_units)


def run_job(name: str, job: Job, file: FilePath, say: Callable[[str], None] = lambda _text: None) -> JobResult:
    """Do a job. `say` hears what is going on.

    A strategy that stops at a limit, a singularity or the end of the workspace is a result, with what was followed;
    one that cannot be run at all (no posture of its leaf is found, it is singular at the start posture) is in
    `not_run`; the others are done.

    Raises:
        HolokinError: bad input; or no strategy could be run, for the first one's reason.
    """
    began = time.perf_counter()
    own = build_robot(job, file)
    robot, start, tasks = build_tasks(job, file, own)
    if job.timing is not None:
        with naming(file, "timing", "velocity"):
            job.timing.check(robot)
    with naming(file, "path"):
        path = build_paths(job.path, tasks[0], start, file)
    covering = _build_covering(job, tasks[0], start, file)
    saved_map(job, tasks[0], file)  # a file that cannot be used is told before the work
    results: list[StrategyResult] = []
    failed: list[NotRun] = []
    first: HolokinError | None = None
    about = " ".join([job.about, *(f"{note}." for note in path.notes)]).strip()
    for label, table in job.strategies.items():
        with naming(file, "strategies", label, "invariant"):
            invariant = table.invariants(tasks[0])
        variants = []
        for task in tasks:
            title = label if len(tasks) == 1 else f"{label} ({task.orientation})"
            say(title)
            try:
                with naming(file, "strategies", label):
                    strategy = build_strategy(job, label, task, start, title)
                    begin, note = build_begin(table, strategy, start)
                    entry = build_entry(job, strategy, path, begin)
                    begin = entry.q0
                    told, entered = entry_report(job, file, strategy, entry)
                    found = _run_strategy(job, label, strategy, path, begin, table.method)
                    if entered is not None and not entered.passed:
                        found = replace(found, trouble=found.trouble or f"the entry: {entered.trouble}")
                    if job.timing is not None and found.cycles.status is Status.COMPLETE:
                        found = _timed(found, job.timing)
                    if job.checks is not None:
                        with naming(file, "checks"):
                            report = job.checks.checked(found.timed or found.cycles, task)
                        found = replace(found, motion_check=report)
                    if covering is not None and isinstance(strategy, HolonomicStrategy):
                        found = covering.added(found, strategy, begin)
                    variants.append(replace(found, metrics=Run(strategy, path, invariant, found).measured()))
                    about = f"{about} {note} {told}".strip()
            except HolokinError as problem:
                if not isinstance(problem.__cause__ or problem, OF_ONE_STRATEGY):
                    raise
                first = first or problem
                failed.append(
                    NotRun(title, f"{problem.fact}; {problem.cure}" if isinstance(problem, JobError) else str(problem))
                )
        same = {"same_joints": apart(variants)}
        expect = job.expect.get(label)
        results += [_checked(replace(v, metrics=v.metrics | same), expect) for v in variants]
    if first is not None and not results:
        raise first
    over = None
    try:
        over = _sheets_result(job, tasks[0], start, path, file, say)
    except HolokinError as problem:  # the strategies were run all the same
        failed.append(
            NotRun("[sheets]", f"{problem.fact}; {problem.cure}" if isinstance(problem, JobError) else str(problem))
        )
    task_name = tasks[0].name if len(tasks) == 1 else f"pose of {robot.name}, {len(tasks)} orientation representations"
    shown = own if job.checks is None else job.checks.drawn(own)
    seconds = time.perf_counter() - began
    return JobResult(
        name, job.title, about.strip(), shown, task_name, start, path, job.path.cycles, tuple(results), seconds,
        tuple(failed), str(covering.workspace) if covering is not None else "",
        () if job.scene is None else tuple(job.scene.obstacles), one_way(path),
        {key: metric.meaning for key, metric in METRICS.items()}, job.printed_units, over,
    )  # fmt: skip


def _run_strategy(
    job: Job, label: str, strategy: Strategy, path: AnyPath, q0: Vector, method: Following | None
) -> StrategyResult:
    asked = job.verdict
    region = around(q0, asked.radius)
    verdict = involutivity(strategy, region, samples=asked.samples, thorough=asked.thorough)
    troubles: list[str] = []

    def run(part: AnyPath, samples: int, cycles: int) -> Trajectory:
        try:
            return follow(strategy, part, q0, samples=samples, cycles=cycles, method=method)
        except PathError as problem:
            if problem.trajectory is None:
                raise
            troubles.append(str(problem).replace(KEPT, "what was computed is written"))
            return problem.trajectory

    cycles = run(path, job.path.samples, job.path.cycles)
    pair = None
    if not one_way(path):
        a, b = path.reversed().halves() if path.counter_clockwise else path.halves()
        half = max(1, job.path.samples // 2)
        pair = (run(a, half, 1), run(b, half, 1))
    walks = [cycles, *(pair or ())]
    status = next((t.status for t in walks if t.status is not Status.COMPLETE), Status.COMPLETE)
    trouble = troubles[0] if troubles else _elsewhere(strategy, path, cycles, method)
    done = cycles.status is Status.COMPLETE
    share = 1.0 if done else min(float(cycles.t[-1]) / (path.duration * job.path.cycles), 1.0)
    return StrategyResult(strategy.name, label, verdict, pair, cycles, status, trouble, {}, followed=share)


def _elsewhere(strategy: Strategy, path: AnyPath, cycles: Trajectory, method: Following | None) -> str:
    """What is said of a law with leaves whose joints, followed on its leaf, do not come back; empty of others."""
    if not (isinstance(strategy, HolonomicStrategy) and path.closed and strategy.task.frames == 1):
        return ""
    return why_elsewhere(strategy, cycles) if by_leaf(strategy, method) is not None else ""


def one_way(path: AnyPath) -> str:
    """Why a path has no second path to a pose of it, to compare the joints with; empty where it has one."""
    cure = "draw a closed path whose halves lead to one pose by different paths"
    if not path.closed:
        return f"the path is open, so it leads to each pose by one way only; {cure}"
    there, back = path.halves()
    shares = np.linspace(0.0, 1.0, PLACES)
    a, b = there.at(shares * there.duration), back.at(shares * back.duration)
    size = max(float(np.ptp(a.position, axis=0).max()), float(np.ptp(a.rotation, axis=0).max()), 1e-300)
    gap = max(float(np.abs(a.position - b.position).max()), float(np.abs(a.rotation - b.rotation).max()))
    if gap > RETRACED * size:
        return ""
    same = "so both its halves are one way, on which any law dq = G(q) dx undoes what it did"
    return f"the path runs back on itself, {same}; {cure}"


def _timed(found: StrategyResult, table: TimingTable) -> StrategyResult:
    """With its cycles timed. Raises: as `retime`."""
    timed = table.timed(found.cycles)
    trouble = found.trouble
    if table.endless and timed.loop is None:
        trouble = trouble or "its cycles do not end where they started: they are timed one after the other, not endless"
    return replace(found, timed=timed, trouble=trouble)


def _checked(result: StrategyResult, expect: ExpectTable | None) -> StrategyResult:
    """With its checks; one of which nothing is expected must be followed to its end all the same."""
    complete = result.status is Status.COMPLETE
    if expect is None:
        if complete:
            return result
        expect = ExpectTable()
    checks = [Check("completes", str(expect.completes).lower(), result.status.value, complete == expect.completes)]
    if expect.holonomic is not None:
        found = result.verdict.holonomic
        checks.append(Check("holonomic", str(expect.holonomic).lower(), str(found).lower(), found == expect.holonomic))
    for key, value in result.metrics.items():
        bound = getattr(expect, key)
        if bound is not None:
            why = f"not known: {METRICS[key].unknown}"
            checks.append(Check(key, str(bound), why if np.isnan(value) else f"{value:.6g}", bound.holds(value)))
    return replace(result, checks=tuple(checks))
