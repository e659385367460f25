"""What is made of the strategies of a job: certificates, C, and robot programs, of one leaf or over sheets."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...base.errors import (
    ArgumentError,
    ExpressionError,
    HolokinError,
    JobError,
    NoProofError,
    UnknownNameError,
    posture_text,
)
from ...base.types import Vector
from ...export import LANGUAGES, Program, c_name
from ...motion import TimedTrajectory, follow
from ...motion.checks import CheckReport
from ...path import Path
from ...path.editing import AnyPath
from ...path.workspaces import PoseRange
from ...proof import Certificate, certify, unique_region
from ...strategies import HolonomicStrategy, Strategy
from ...strategies.tasks.task import Task
from .job_parts import build_begin, build_entry, build_path, build_paths, build_strategy, build_tasks, naming
from .runner import OF_ONE_STRATEGY, ONE_TOOL, build_workspace, path_motion, sheets_of_job
from .schema import Job
from .tables import HELD_IN, ProgramTable, TimingTable, filled


def certify_job(
    job: Job, file: FilePath, *, workspace: bool = False, part: bool = False, budget: int | None = None,
    cells_file: Callable[[str], FilePath | None] = lambda _title: None,
    progress: Callable[[str], None] = lambda _text: None,
) -> Iterator[tuple[str, Certificate | str]]:  # fmt: skip
    """(name, certificate, or why there is none) of each strategy of a job, one after the other.

    What its [checks] ask for is to be proven, too: shapes apart, joints within their limits.

    Args:
        workspace: over the box of the job's [workspace] instead of along its path.
        part: of a workspace, as much as can be proven, as of `unique_region`.
        budget: cells that may be examined for each; by default as `certify`.
        cells_file: name of a strategy -> the file that keeps its cells, as `keep_in` of `certify`, or None.
        progress: hears how far it is.

    Raises:
        HolokinError: bad input.
    """
    robot, start, tasks = build_tasks(job, file)
    if not workspace:
        with naming(file, "path"):
            where = build_path(job.path, tasks[0], start, file)
    elif job.workspace is None:
        raise JobError(file, "workspace", "is missing", 'add a table [workspace] of kind "box"')
    elif job.workspace.kind != "box":
        raise JobError(file, "workspace.kind", f"is {job.workspace.kind!r}", 'only a "box" can be certified')
    else:
        where = build_workspace(job.workspace, robot.pose(start)[:3, :3], file)
    more: dict[str, Any] = {} if budget is None else {"budget": budget}
    if job.checks is not None:
        with naming(file, "checks"):
            more |= {"limits": job.checks.limits, "scene": job.checks.keeps_clear(robot)}
    for label, table in job.strategies.items():
        for task in tasks:
            title = label if len(tasks) == 1 else f"{label} ({task.orientation})"
            progress(title)
            try:
                with naming(file, "strategies", label):
                    strategy = build_strategy(job, label, task, start, title)
                    if not isinstance(strategy, HolonomicStrategy):
                        raise NoProofError(title, f"it has no leaves: {HolonomicStrategy.cure}")
                    begin, _ = build_begin(table, strategy, start)
                    if isinstance(where, Path):
                        begin = build_entry(job, strategy, where, begin).q0
                    told = {
                        "progress": lambda text, title=title: progress(f"{title}: {text}"),
                        "keep_in": cells_file(title),
                    }
                    if part and isinstance(where, PoseRange):
                        found = unique_region(strategy, begin, where, **told, **more).certificate
                    else:
                        found = certify(strategy, where, begin, **told, **more)
            except HolokinError as problem:
                cause = problem.__cause__ or problem
                if isinstance(cause, NoProofError):
                    yield title, cause.cure
                    continue
                if not isinstance(cause, (*OF_ONE_STRATEGY, ExpressionError)):
                    raise
                yield title, f"{problem.fact}; {problem.cure}" if isinstance(problem, JobError) else str(problem)
            else:
                yield title, found


# --- A strategy of a job as C for a controller.


def job_strategy(
    job: Job, file: FilePath, label: str | None = None, orientation: str | None = None
) -> tuple[str, Strategy, Vector]:
    """(label, strategy, the posture it begins at) of a job.

    Args:
        label: the strategy's name in the job; may be left out where there is only one.
        orientation: one of the job's representations of orientation; by default its first.

    Raises:
        UnknownNameError: no such strategy or orientation, or none named among several.
    """
    _, start, tasks = build_tasks(job, file)
    if label is None and len(job.strategies) == 1:
        label = next(iter(job.strategies))
    if label is None:
        cure = f"say which one with --strategy: {', '.join(job.strategies)}"
        raise ArgumentError("the number of strategies of the job", len(job.strategies), cure)
    if label not in job.strategies:
        raise UnknownNameError(f"strategy of {file.name}", label, tuple(job.strategies))
    known = tuple(str(task.orientation) for task in tasks)
    if orientation is not None and orientation not in known:
        raise UnknownNameError(f"orientation of {file.name}", orientation, known)
    task = tasks[0 if orientation is None else known.index(orientation)]
    table = job.strategies[label]
    with naming(file, "strategies", label):
        strategy = build_strategy(job, label, task, start, label)
        return label, strategy, build_begin(table, strategy, start)[0]


def exported_strategy(
    name: str, job: Job, file: FilePath, label: str | None = None, *, orientation: str | None = None,
    prefix: str | None = None,
) -> tuple[Strategy, dict[str, Any]]:  # fmt: skip
    """A strategy of a job, and what all exports are told of it: its start, its C name, where it comes from.

    Raises:
        as `job_strategy`.
    """
    label, strategy, start = job_strategy(job, file, label, orientation)
    short = c_name(f"{strategy.task.robot.name}_{label}") if prefix is None else prefix
    return strategy, {"q0": start, "name": short, "origin": f"the job {name}, strategy {label}"}


# --- A strategy of a job as a robot program: followed, timed, and written in a controller's language.


def program_of_job(
    name: str, job: Job, file: FilePath, language: str, label: str | None = None, *, short: str | None = None,
    changes: dict[str, Any] | None = None,
) -> tuple[Program, TimedTrajectory, CheckReport | None]:  # fmt: skip
    """(program, the timed motion, what the job's [checks] find of it) of a strategy of a job, with its cycles.

    Args:
        language: one of LANGUAGES.
        label: the strategy's name in the job; may be left out where there is only one.
        short: the program's name; by default robot and strategy.
        changes: keys of [timing] to take instead of the job's.

    Raises:
        as `job_strategy`, `follow`, `retime`, `check` and the writer; ArgumentError: limits are missing.
    """
    label, strategy, start = job_strategy(job, file, label)
    timing = _timing_of(job, changes)
    with naming(file, "path"):
        path = build_paths(job.path, strategy.task, start, file)
        entry = build_entry(job, strategy, path, start)
    walk = follow(strategy, path, entry.q0, samples=job.path.samples, cycles=job.path.cycles)
    timed = entry.before(timing.timed(walk), timing)
    found = checked(job, file, timed, strategy.task)
    told = label, strategy.name
    return written(name, job, file, language, told, strategy.task, window(job, path), timed, short), timed, found


def _timing_of(job: Job, changes: Mapping[str, Any] | None) -> TimingTable:
    """[timing] of a job with keys that were given instead. Raises: ArgumentError: limits are missing."""
    table = job.timing.model_dump(exclude_unset=True) if job.timing is not None else {}
    table |= changes or {}
    if table.get("acceleration") is None and table.get("profile") != "quintic":
        raise ArgumentError(
            "the acceleration of the joints", None, "give --acceleration, or a table [timing] in the job"
        )
    return filled(TimingTable, "timing", table)


def checked(job: Job, file: FilePath, timed: TimedTrajectory, task: Task) -> CheckReport | None:
    """What the job's [checks] find of a timed motion, None in a job without. Raises: JobError, as `check`."""
    if job.checks is None:
        return None
    with naming(file, "checks"):
        return job.checks.checked(timed, task)


def written(
    name: str, job: Job, file: FilePath, language: str, told: tuple[str, str], task: Task,
    window: tuple[float, float] | None, timed: TimedTrajectory, short: str | None,
) -> Program:  # fmt: skip
    """The program of a timed motion; `told`: the label in its name, and what moves the joints in words."""
    robot, speeds = task.robot.name, task.robot.max_velocity
    writer, how = LANGUAGES[language], job.program or ProgramTable()
    with naming(file, "program"):
        given = how.given(task, timed.dt in writer.streams) | {
            "name": short or _word(f"{robot}_{told[0]}", writer.longest),
            "about": f"Job {name}: {told[1]} on {robot}, {job.title}",
            "lines": how.lines(window),
            "speeds": speeds.tolist() if np.isfinite(speeds).all() else None,
        }
        for key in writer.needs:
            if key not in given:
                raise ArgumentError(f"{key} of [program]", None, f"{language} needs it: add it to [program]")
        if how.linear and "tool" in writer.takes and how.tool is None:
            cure = "linear moves lead the tool that the controller has: give its name or number, or that of the flange"
            raise ArgumentError("tool of [program]", None, cure)
        left = [key for key in how.given_keys if _argument(key) not in writer.takes]
        program = writer.write(timed, **{key: value for key, value in given.items() if key in writer.takes})
    notes = (f"{language} takes no {' and no '.join(left)} of [program]: left out",) if left else ()
    return replace(program, notes=(*notes, *program.notes))


def _argument(key: str) -> str:
    """The argument of a writer that holds a key of [program]."""
    found = (argument for argument, keys in HELD_IN.items() if key in keys)
    return next(found, key)


def window(job: Job, path: AnyPath) -> tuple[float, float] | None:
    """The path's times at which its lead in ends and its lead out begins [s]; None where it has none."""
    table = job.path
    ways = [bool(length) + bool(table.retract) for length in (table.lead_in, table.lead_out)]
    if not isinstance(path, Path) or not any(ways):
        return None
    return float(path.durations[: ways[0]].sum()), float(path.durations[: len(path.durations) - ways[1]].sum())


def _word(text: str, longest: int) -> str:
    """A name of letters, digits and underscores."""
    letters = "".join(c if c.isascii() and c.isalnum() else "_" for c in text)
    letters = letters if letters[:1].isalpha() else f"p_{letters}"
    return letters[:longest].rstrip("_")


SAME_TIME = 1e-9
"""Share of a path's duration by which a motion over sheets may be longer and still have the path's own times."""


def program_of_sheets(
    name: str, job: Job, file: FilePath, language: str, *, short: str | None = None,
    changes: Mapping[str, Any] | None = None, progress: Callable[[str], None] = lambda _text: None,
) -> tuple[Program, TimedTrajectory, CheckReport | None]:  # fmt: skip
    """(program, the timed motion, what the job's [checks] find of it) of a job's path over its sheets, once along it.

    Args:
        language, short, changes: as of `program_of_job`. progress: hears what is going on, as of `sheets`.

    Raises:
        ArgumentError: the job has no [sheets], or several tools. DividedPathError: the path is divided, or
        not served as a whole. As `sheets_of_job`, `retime`, `check` and the writer.
    """
    if job.sheets is None:
        raise ArgumentError("[sheets] of the job", None, "add the table, or give --strategy in place of --sheets")
    timing = _timing_of(job, changes)
    _, start, tasks = build_tasks(job, file)
    with naming(file, "path"):
        path = build_paths(job.path, tasks[0], start, file)
    found = sheets_of_job(job, tasks[0], start, file, progress)
    progress("sheets: the path")
    motion = path_motion(found, path, start)
    if motion is None:
        raise ArgumentError("the path of the job", file.name, f"{ONE_TOOL}: give --strategy in place of --sheets")
    walk, way = motion.trajectory, window(job, path)
    if way is not None and abs(float(walk.t[-1]) - path.duration) > SAME_TIME * path.duration:
        cure = "the motion over sheets has times of its own: leave lead_in, lead_out and retract out"
        raise ArgumentError("the leads of [path]", job.path.lead_in or job.path.lead_out, cure)
    timed = timing.timed(walk)
    report = checked(job, file, timed, tasks[0])
    many = f"{motion.changes} change{'' if motion.changes == 1 else 's'}"
    told = ("sheets", f"{len({one.sheet for one in motion.pieces})} of {len(found)} sheets with {many}")
    program = written(name, job, file, language, told, tasks[0], way, timed, short)
    notes = [f"over sheets: {motion.sentence}"]
    if not np.allclose(walk.q[0], start, atol=1e-6):
        notes.append(f"the motion begins at {posture_text(walk.q[0], tasks[0].robot.joint_names)}, not at [start]")
    if job.path.cycles > 1:
        notes.append(f"the path is gone along once, not {job.path.cycles} times: sheets tell no cycles")
    return replace(program, notes=(*program.notes, *notes)), timed, report
