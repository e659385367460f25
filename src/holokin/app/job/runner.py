"""Doing a job: every strategy round the path, over a workspace, by sheets; judged and checked."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib.resources import as_file, files
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...analysis.coverage import coverage, coverage_slices, posture_reach
from ...analysis.curvature import around, involutivity, why_elsewhere
from ...analysis.sheets import SheetMotion, Sheets, sheets
from ...analysis.sheets.sheet_map import sheets_of_file
from ...base.arguments import typed
from ...base.errors import (
    KEPT,
    ArgumentError,
    HolokinError,
    JobError,
    JointLimitError,
    NotFiniteError,
    PathError,
    SingularityError,
    UndecidedError,
    UnknownNameError,
)
from ...base.types import Matrix, Vector
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
    build_each,
    build_entry,
    build_paths,
    build_robot,
    build_strategy,
    build_tasks,
    entry_report,
    naming,
    reason,
    title_of,
)
from .metrics import METRICS, measured, representation_gap
from .schema import ExpectTable, Job, SheetsTable, WorkspaceTable, job_table, read_job
from .strategy_tables import strategy_of_keys
from .tables import TimingTable

# --- Jobs by name: the packaged ones, and files.

PAPER = ("ppr-half-circle", "ppr-cycle", "irb140-half-square", "orientation")
"""The jobs that make up the paper, under the name "paper"."""


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


def robot_of_file(
    name: str, tip: str | Sequence[str] | None = None, base: str | None = None, trust_units: bool = False
) -> Robot:
    """The robot of a job, or one by catalogue name or file. Raises: as `open_job` and `load`; ArgumentError.

    Args:
        tip: of a model; beside a job, or a robot of the catalogue, one of the tools that it has.
        base, trust_units: of a model.
    """
    if is_job(name):
        _, job, file = open_one_job(name)
        robot = build_robot(job, file)
        tools = [known.name for known in robot.tips] if len(robot.tips) > 1 else []
        alone_says(name, {"--tip": None if tip in tools else tip, "--base": base, "--trust-units": trust_units})
        return robot
    return load(name, tip=tip or None, base=base, trust_units=trust_units)


def alone_says(name: str, options: Mapping[str, Any]) -> None:
    """Refuse options that a job says itself. Raises: ArgumentError: one is given."""
    for option, given in options.items():
        if given is not None and given is not False:
            raise ArgumentError(f"{option} beside a job", given, f"a job says it itself: write it into {name}")


# --- [workspace] and [sheets] of a job.

COVER_POSES = 256  # poses of a path that stand for a workspace
LEAST_POSES = 16  # of each of several paths
ONE_TOOL = "it is of several tools, and sheets are of one"  # why a path is not followed on sheets


def build_workspace(table: WorkspaceTable, at_start: Matrix, file: FilePath) -> Workspace:
    """The workspace of a table; a file of poses counts from the job file's folder.

    Args:
        at_start: rotation (3, 3) of the tool at the start.

    Raises:
        JobError, FileError.
    """
    if table.kind == "poses":
        return read_workspace(file.parent / str(table.file), ignore=table.ignore, axis=table.axis)
    rotation = None if table.rotation == "down" else at_start if table.rotation == "start" else table.rotation
    box = cylinder = sphere = None
    if table.kind == "box":
        box = table.box_sides
    elif table.kind == "cylinder":
        cylinder = table.center, table.radius, table.half_height
    else:
        sphere = table.center, table.radius
    tilt, spin = np.deg2rad(table.tilt_deg), np.deg2rad(table.spin_deg)
    with naming(file, "workspace"):
        return workspace(box=box, cylinder=cylinder, sphere=sphere, rotation=rotation, tilt=tilt, spin=spin)  # type: ignore[arg-type]


def workspace_of_job(job: Job, task: Task, start: Vector, file: FilePath) -> Workspace:
    """[workspace] of a job; without one the poses along its path, or along all of them.

    Raises:
        as `build_workspace` and `build_each`; ArgumentError: paths of several tools at once.
    """
    tool = task.robot.pose(start, task.tip)[:3, :3]
    if job.workspace is not None:
        return build_workspace(job.workspace, tool, file)
    if job.paths:
        each = build_each(job, file, start, task)
    else:
        path = build_paths(job.only_path, task, start, file)
        if not isinstance(path, Path):
            raise ArgumentError(
                "the paths of several tools", len(path.paths), "this is for one tool: add a [workspace]"
            )
        each = [(None, task, path if path.rotation is not None else replace(path, rotation=tool))]
    # Where the tip of the task is: the tool of a path may be another frame on it.
    poses, count = [], max(LEAST_POSES, COVER_POSES // len(each))
    for table, _, path in each:
        along = path.at(np.linspace(0.0, path.duration, count, endpoint=not path.closed))
        T = np.tile(np.eye(4), (count, 1, 1))
        T[:, :3, 3], T[:, :3, :3] = along.position, along.rotation @ np.asarray(path.rotation)
        frame = None if table is None else table.tool_frame
        poses.append(T if frame is None else T @ np.linalg.inv(frame.matrix))
    return pose_cloud(np.concatenate(poses), f"the {'paths' if job.paths else 'path'} of {file.name}")


@typed
def read_sheets(path: str | FilePath, task: Task, scene: Scene | None = None) -> Sheets:
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
        FileError: it cannot be read, is of another robot, task or scene, or holds what makes no sense.
    """
    return sheets_of_file(path, task, scene, _strategy)


def _strategy(keys: Mapping[str, Any], task: Task, q0: Vector, name: str) -> HolonomicStrategy:
    """The strategy of a sheet from the keys in its file. Raises: UnknownNameError, ArgumentError."""
    if task.n == task.m:
        return holonomic(task, custom(lambda _q: [], rows=0), name=name)
    strategy = strategy_of_keys(dict(keys), task, q0, name)
    if not isinstance(strategy, HolonomicStrategy):
        raise ArgumentError(
            "the strategy of a sheet", keys.get("kind"), "it has no leaves: give a file that a map of sheets saved"
        )
    return strategy


def saved_map(job: Job, task: Task, file: FilePath) -> Sheets | None:
    """The map that `file` of [sheets] names, which counts from the job file's folder; None where it names none.

    Raises:
        JobError: there is no such file, or it is of another robot, task or [checks].
    """
    table = job.sheets
    if table is None or table.file is None:
        return None
    map_file = file.parent / table.file
    if not map_file.is_file():
        cure = f"write it with `holokin sheets {file.name}`, or leave it out: then the sheets are searched for"
        raise JobError(file, "sheets.file", f"names {table.file}, and there is no such file", cure)
    with naming(file, "sheets", "file"):
        return read_sheets(map_file, task, job.scene)


def sheets_of_job(
    job: Job, task: Task, start: Vector, file: FilePath, progress: Callable[[str], None] = lambda _text: None
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
        search = (job.sheets or SheetsTable()).model_dump(exclude={"file"})
        return sheets(task, space, scene=job.scene, progress=lambda text: progress(f"sheets: {text}"), **search)


def path_motion(sheet_map: Sheets, path: AnyPath, start: Vector) -> SheetMotion | None:
    """A path over the sheets, None of several tools; the tool begins with the rotation of the path, or of the start."""
    if not isinstance(path, Path):
        return None
    return sheet_map.follow(
        path if path.rotation is not None else replace(path, rotation=sheet_map.task.pose(start)[:3, :3])
    )


def sheets_result(
    sheet_map: Sheets, share: float, path: AnyPath, start: Vector, source: str = "", remark: str = ""
) -> SheetsResult:
    """A map of sheets and the motion of a path over it, or why there is none. Args: `source`: the map's file."""
    motion = path_motion(sheet_map, path, start)
    return SheetsResult(sheet_map, share, motion, "" if motion is not None else ONE_TOOL, source, remark)


# --- A job, from its table to its result.

# What one strategy may meet where the others of its job do not. Anything else is a mistake in the job file.
OF_ONE_STRATEGY = (SingularityError, PathError, UndecidedError, JointLimitError, NotFiniteError)
COMPARED = 65  # places of the two halves of a closed path that are held against each other
RETRACED = 1e-6  # share of a path's size by which halves may differ and be one way: beyond round-off, below any drawing


def run_job(name: str, job: Job, file: FilePath, progress: Callable[[str], None] = lambda _text: None) -> JobResult:
    """Do a job. `progress` hears what is going on.

    A strategy that stops at a limit, a singularity or the end of the workspace is a result, with what was followed;
    one that cannot be run at all (no posture of its leaf is found, it is singular at the start posture) is in
    `not_run`; the others are done.

    Raises:
        HolokinError: bad input; or no strategy could be run, for the first one's reason.
    """
    began = time.perf_counter()
    # Robot, start posture, tasks, path and workspace. What cannot be used is told before the work.
    own = build_robot(job, file)
    robot, start, tasks = build_tasks(job, file, own)
    if job.timing is not None:
        with naming(file, "timing", "velocity"):
            job.timing.check(robot)
    with naming(file, "path"):
        path = build_paths(job.only_path, tasks[0], start, file)
    space = None
    if job.workspace is not None:
        space = build_workspace(job.workspace, robot.pose(start)[:3, :3], file)
    saved_map(job, tasks[0], file)
    # Each strategy, for each representation of orientation.
    results: list[StrategyResult] = []
    not_run: list[NotRun] = []
    first: HolokinError | None = None
    reach = None
    notes = [job.about, *(f"{note}." for note in path.notes)]
    for label, table in job.strategies.items():
        with naming(file, "strategies", label, "invariant"):
            invariant = table.invariants(tasks[0])
        variants = []
        for task in tasks:
            title = title_of(label, task, tasks)
            progress(title)
            try:
                with naming(file, "strategies", label):
                    # The strategy, where it begins, and the way there.
                    strategy = build_strategy(job, label, task, start, title)
                    begin, note = build_begin(table, strategy, start)
                    entry = build_entry(job, strategy, path, begin)
                    entry_note, entry_check = entry_report(job, file, strategy, entry)
                    # Its verdict and trajectories; then timing, [checks], coverage and metrics.
                    result = _followed(job, label, strategy, path, entry.q0, table.method)
                    if entry_check is not None and not entry_check.passed:
                        result = replace(result, trouble=result.trouble or f"the entry: {entry_check.trouble}")
                    if job.timing is not None and result.cycles.status is Status.COMPLETE:
                        result = _timed(result, job.timing)
                    if job.checks is not None:
                        with naming(file, "checks"):
                            report = job.checks.checked(result.timed or result.cycles, task)
                        result = replace(result, motion_check=report)
                    if job.workspace is not None and space is not None and isinstance(strategy, HolonomicStrategy):
                        samples, seed, limits = job.workspace.samples, job.workspace.seed, job.workspace.limits
                        if reach is None:  # the same for all strategies
                            reach = posture_reach(tasks[0], space, start, samples=samples, seed=seed)
                        covers = coverage(
                            strategy, space, entry.q0, samples=samples, seed=seed, limits=limits, reach=reach
                        )
                        result = replace(result, coverage=covers)
                        if isinstance(space, PoseRange) and job.workspace.slices:
                            steps = max(2, job.workspace.slices)
                            slices = coverage_slices(strategy, space, entry.q0, steps=steps, limits=limits)
                            result = replace(result, slices=slices)
                    variants.append(replace(result, metrics=measured(strategy, path, invariant, result)))
                    notes += [note, entry_note]
            except HolokinError as problem:
                if not isinstance(problem.__cause__ or problem, OF_ONE_STRATEGY):
                    raise
                first = first or problem
                not_run.append(NotRun(title, reason(problem)))
        # What is expected of it.
        gap = {"same_joints": representation_gap(variants)}
        expect = job.expect.get(label)
        results += [_checked(replace(result, metrics=result.metrics | gap), expect) for result in variants]
    if first is not None and not results:
        raise first
    # The path over sheets; where that fails the strategies were run all the same.
    over_sheets = None
    try:
        if job.sheets is not None:
            sheet_map = sheets_of_job(job, tasks[0], start, file, progress)
            progress("sheets: the path")
            remark = _other_workspace(job, sheet_map, start, file)
            over_sheets = sheets_result(sheet_map, job.sheets.share, path, start, job.sheets.file or "", remark)
    except HolokinError as problem:
        not_run.append(NotRun("[sheets]", reason(problem)))
    return JobResult(
        name=name,
        title=job.title,
        about=" ".join(filter(None, (note.strip() for note in notes))),
        robot=own if job.checks is None else job.checks.drawn(own),
        task=tasks[0].name if len(tasks) == 1 else f"pose of {robot.name}, {len(tasks)} orientation representations",
        q0=start,
        path=path,
        cycles=job.only_path.cycles,
        strategies=tuple(results),
        seconds=time.perf_counter() - began,
        not_run=tuple(not_run),
        workspace="" if space is None else str(space),
        obstacles=() if job.scene is None else tuple(job.scene.obstacles),
        one_way=one_way(path),
        meanings={key: metric.meaning for key, metric in METRICS.items()},
        units=job.printed_units,
        sheets=over_sheets,
    )


def _followed(
    job: Job, label: str, strategy: Strategy, path: AnyPath, q0: Vector, method: Following | None
) -> StrategyResult:
    """The verdict of a strategy about its start (n,), and its trajectories: the cycles, and two paths to one pose."""
    region, table = around(q0, job.verdict.radius), job.verdict
    verdict = involutivity(strategy, region, samples=table.samples, thorough=table.thorough)
    troubles: list[str] = []

    def run(part: AnyPath, samples: int, cycles: int) -> Trajectory:
        """A trajectory, up to where it ends."""
        try:
            return follow(strategy, part, q0, samples=samples, cycles=cycles, method=method)
        except PathError as problem:
            if problem.trajectory is None:
                raise
            troubles.append(str(problem).replace(KEPT, "what was computed is written"))
            return problem.trajectory

    cycles = run(path, job.only_path.samples, job.only_path.cycles)
    pair = None
    if not one_way(path):
        a, b = path.reversed().halves() if path.counter_clockwise else path.halves()
        half = max(1, job.only_path.samples // 2)
        pair = (run(a, half, 1), run(b, half, 1))
    # What is said of it: where it stopped; or that its joints, followed on its leaf, do not come back.
    status = next((t.status for t in (cycles, *(pair or ())) if t.status is not Status.COMPLETE), Status.COMPLETE)
    if not troubles and path.closed and strategy.task.frames == 1 and isinstance(strategy, HolonomicStrategy):
        troubles.append(why_elsewhere(strategy, cycles) if by_leaf(strategy, method) is not None else "")
    complete = cycles.status is Status.COMPLETE
    share = 1.0 if complete else min(float(cycles.t[-1]) / (path.duration * job.only_path.cycles), 1.0)
    trouble = troubles[0] if troubles else ""
    return StrategyResult(strategy.name, label, verdict, pair, cycles, status, trouble, {}, followed=share)


def one_way(path: AnyPath) -> str:
    """Why a path has no second path to a pose of it, to compare the joints with; empty where it has one."""
    cure = "draw a closed path whose halves lead to one pose by different paths"
    if not path.closed:
        return f"the path is open, so it leads to each pose by one way only; {cure}"
    there, back = path.halves()
    shares = np.linspace(0.0, 1.0, COMPARED)
    a, b = there.at(shares * there.duration), back.at(shares * back.duration)
    size = max(float(np.ptp(a.position, axis=0).max()), float(np.ptp(a.rotation, axis=0).max()), 1e-300)
    gap = max(float(np.abs(a.position - b.position).max()), float(np.abs(a.rotation - b.rotation).max()))
    if gap > RETRACED * size:
        return ""
    same = "so both its halves are one way, on which any strategy dq = G(q) dx undoes what it did"
    return f"the path runs back on itself, {same}; {cure}"


def _timed(result: StrategyResult, table: TimingTable) -> StrategyResult:
    """With its cycles timed. Raises: as `retime`."""
    timed = table.timed(result.cycles)
    trouble = result.trouble
    if table.endless and timed.loop is None:
        trouble = trouble or "its cycles do not end where they started: they are timed one after the other, not endless"
    return replace(result, timed=timed, trouble=trouble)


def _checked(result: StrategyResult, expect: ExpectTable | None) -> StrategyResult:
    """With its checks; one of which nothing is expected must be followed to its end all the same."""
    complete = result.status is Status.COMPLETE
    if expect is None:
        if complete:
            return result
        expect = ExpectTable()
    checks = [Check("completes", str(expect.completes).lower(), result.status.value, complete == expect.completes)]
    if expect.holonomic is not None:
        verdict = result.verdict.holonomic
        wanted, found = str(expect.holonomic).lower(), str(verdict).lower()
        checks.append(Check("holonomic", wanted, found, verdict == expect.holonomic))
    for key, value in result.metrics.items():
        bound = getattr(expect, key)
        if bound is not None:
            found = f"not known: {METRICS[key].unknown}" if np.isnan(value) else f"{value:.6g}"
            checks.append(Check(key, str(bound), found, bound.holds(value)))
    return replace(result, checks=tuple(checks))


def _other_workspace(job: Job, sheet_map: Sheets, start: Vector, file: FilePath) -> str:
    """That the map of a file is of other poses than the job's [workspace]; empty where it is of the same."""
    if job.sheets is None or job.sheets.file is None or job.workspace is None or job.workspace.kind == "poses":
        return ""
    asked = str(workspace_of_job(job, sheet_map.task, start, file))
    return "" if str(sheet_map.workspace) == asked else f"it is of {sheet_map.workspace}, not of the job's [workspace]"
