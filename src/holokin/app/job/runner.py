"""Doing a job: every strategy round the path, both paths and for its cycles, judged and checked."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib.resources import as_file, files
from pathlib import Path as FilePath

import numpy as np

from ...analysis.curvature import around, involutivity, why_elsewhere
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
from ...base.types import Vector
from ...motion import follow
from ...motion.follow_path import Following, by_leaf
from ...motion.trajectory import Status, Trajectory
from ...path.synchronized_paths import AnyPath
from ...robot import Robot, load
from ...strategies import HolonomicStrategy, Strategy
from ..report.job_result import Check, JobResult, NotRun, StrategyResult
from .cover_strategies import build_covering
from .job_file import job_table, read_job
from .job_parts import build_begin, build_robot, build_strategy, build_tasks, naming
from .metrics import METRICS, Run, apart
from .motion_tables import TimingTable
from .path_entry import build_entry, entry_report
from .schema import ExpectTable, Job
from .several_paths import build_paths
from .sheets_over_job import saved_map, sheets_result

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
    robot, start, tasks = build_tasks(job, file)
    if job.timing is not None:
        with naming(file, "timing", "velocity"):
            job.timing.check(robot)
    with naming(file, "path"):
        path = build_paths(job.path, tasks[0], start, file)
    covering = build_covering(job, tasks[0], start, file)
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
                        found = _timed(found, job.timing, robot)
                    if job.checks is not None:
                        with naming(file, "checks"):
                            report = job.checks.checked(found.timed or found.cycles, robot, task)
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
        over = sheets_result(job, tasks[0], start, path, file, say)
    except HolokinError as problem:  # the strategies were run all the same
        failed.append(
            NotRun("[sheets]", f"{problem.fact}; {problem.cure}" if isinstance(problem, JobError) else str(problem))
        )
    task_name = tasks[0].name if len(tasks) == 1 else f"pose of {robot.name}, {len(tasks)} orientation representations"
    shown = job.checks.drawn(robot) if job.checks is not None else robot
    seconds = time.perf_counter() - began
    return JobResult(
        name, job.title, about.strip(), shown, task_name, start, path, job.path.cycles, tuple(results), seconds,
        tuple(failed), str(covering.workspace) if covering is not None else "",
        job.checks.standing() if job.checks is not None else (), one_way(path),
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


def _timed(found: StrategyResult, table: TimingTable, robot: Robot) -> StrategyResult:
    """With its cycles timed. Raises: as `retime`."""
    timed = table.timed(found.cycles, robot)
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
