"""What is made of the strategies of a job: certificates, C, and robot programs, of one leaf or over sheets."""

from __future__ import annotations

import textwrap
import unicodedata
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from itertools import product
from pathlib import Path as FilePath
from typing import Any, get_type_hints

import numpy as np

from ...base.arguments import check
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
from ...export import LANGUAGES, ProcessLines, Program, ascii_text, c_name
from ...export.programs.procedures import with_procedures
from ...export.programs.robot_program import LANGUAGE_WORDS, checked_name, taken
from ...motion import TimedTrajectory, follow
from ...motion.checks import CheckReport
from ...motion.timed_trajectory import with_entry
from ...path import Path
from ...path.editing import AnyPath
from ...path.workspaces import PoseRange
from ...proof import Certificate, WholeArm, certify
from ...proof.certify_leaf import certify_cells, provable
from ...proof.proven_region import region_by_cells
from ...strategies import HolonomicStrategy, Strategy
from ...strategies.tasks.task import Task
from .advice_job import ADVISED
from .job_parts import (
    build_begin,
    build_entry,
    build_path,
    build_paths,
    build_strategy,
    build_tasks,
    naming,
    reason,
    title_of,
)
from .paths_job import PathsPlan, PlannedPath, plan_paths
from .runner import OF_ONE_STRATEGY, ONE_TOOL, build_workspace, path_motion, sheets_of_job
from .schema import Job
from .tables import ARGUMENT_OF, PathTable, ProgramTable, TimingTable, filled


def certify_job(
    job: Job,
    file: FilePath,
    *,
    workspace: bool = False,
    whole_arm: bool = False,
    part: bool = False,
    budget: int | None = None,
    cells_file: Callable[[str], FilePath | None] = lambda _title: None,
    progress: Callable[[str], None] = lambda _text: None,
) -> Iterator[tuple[str, Certificate | WholeArm | str]]:
    """(name, certificate, or why there is none) of each strategy of a job, one after the other.

    What its [checks] ask for is to be proven, too: shapes apart, joints within their limits. A job of several paths has
    a certificate for each path, from the posture at which `plan_paths` begins it; the ways between them have none.

    Args:
        workspace: over the box of the job's [workspace] instead of along its path. whole_arm: on the whole arm.
        part: of a workspace, as much as can be proven, as of `unique_region`.
        budget: cells that may be examined for each; by default as `certify`.
        cells_file: name of a strategy -> the file that keeps its cells, as `keep_in` of `certify`, or None.
        progress: hears how far it is.

    Raises:
        HolokinError: bad input.
    """
    # Where it is to be proven, and what besides.
    robot, start, tasks = build_tasks(job, file)
    domain = None
    if whole_arm or (job.paths and not workspace):
        pass
    elif not workspace:
        with naming(file, "path"):
            domain = build_path(job.only_path, tasks[0], start, file)
    elif job.workspace is None:
        cure = "leave --workspace out: each path is certified" if job.paths else 'add a table [workspace] of kind "box"'
        raise JobError(file, "workspace", "is missing", cure)
    elif job.workspace.kind != "box":
        raise JobError(file, "workspace.kind", f"is {job.workspace.kind!r}", 'only a "box" can be certified')
    else:
        domain = build_workspace(job.workspace, robot.pose(start)[:3, :3], file)
    more: dict[str, Any] = {} if budget is None else {"budget": budget}
    if job.checks is not None:
        with naming(file, "checks"):
            more |= {"limits": job.checks.limits, "scene": job.checks.keeps_clear(robot)}
    # Each strategy, from where it begins; of several paths each from the posture that `plan_paths` finds for it.
    for (label, table), task in product(job.strategies.items(), tasks):
        title = title_of(label, task, tasks)
        progress(title)
        more |= {"progress": lambda text, title=title: progress(f"{title}: {text}"), "keep_in": cells_file(title)}
        with _refused(file, label) as why:
            strategy = build_strategy(job, label, task, start, title)
            strategy = strategy if isinstance(strategy, HolonomicStrategy) else provable(strategy)
            if job.paths and not whole_arm:
                yield from _certify_paths(plan_paths(job, file, label, progress), title, file, more, progress)
                continue
            if domain is None:
                yield title, certify(strategy)
                continue
            begin, _ = build_begin(table, strategy, start)
            if isinstance(domain, Path):
                begin = build_entry(job, strategy, domain, begin).q0
            if part and isinstance(domain, PoseRange):
                yield title, region_by_cells(strategy, begin, domain, **more)[0]
            else:
                yield title, certify_cells(strategy, domain, begin, **more)
        yield from ((title, reason) for reason in why)


def _certify_paths(
    plan: PathsPlan, title: str, file: FilePath, more: Mapping[str, Any], progress: Callable[[str], None]
) -> Iterator[tuple[str, Certificate | str]]:
    """(name, certificate, or why there is none) of each path of a plan, from its own posture, and of those left out."""
    for each in plan.paths:
        name = f"{title}, {each.name}"
        options = {**more, "progress": lambda text, name=name: progress(f"{name}: {text}")}
        with _refused(file, plan.name) as why:
            yield name, certify_cells(each.strategy, each.path, each.timed.q[0], **options)
        yield from ((name, reason) for reason in why)
    yield from ((f"{title}, {name}", why) for name, why in plan.left_out.items())


@contextmanager
def _refused(file: FilePath, label: str) -> Iterator[list[str]]:
    """A list that holds, afterwards, why there is no proof, where that is no mistake in the job."""
    why: list[str] = []
    try:
        with naming(file, "strategies", label):
            yield why
    except HolokinError as problem:
        cause = problem.__cause__ or problem
        if isinstance(cause, NoProofError):
            why.append(cause.cure)
        elif isinstance(cause, (*OF_ONE_STRATEGY, ExpressionError)):
            why.append(reason(problem))
        else:
            raise


# --- A strategy of a job as C for a controller.


def default_strategy(job: Job, file: FilePath) -> tuple[str, str]:
    """(label, a sentence about it) of the strategy that is taken where none is named.

    Of several it is the advised one, else the first with leaves that is not radial, else the first with leaves, else
    the first. The sentence is empty where there is one alone.

    Raises:
        JobError: as `job_strategy`.
    """
    labels = list(job.strategies)
    if len(labels) == 1:
        return labels[0], ""
    label, why = ADVISED, "the advised one"
    if ADVISED not in labels:
        radial_last = sorted(labels, key=lambda known: job.strategies[known].kind == "radial")
        with_leaves = (known for known in radial_last if _has_leaves(job, file, known))
        label, why = next(((known, "the first with leaves") for known in with_leaves), (labels[0], "none has leaves"))
    others = ", ".join(known for known in labels if known != label)
    return label, f"strategy {label}: {why}; --strategy takes another: {others}"


def _has_leaves(job: Job, file: FilePath, label: str) -> bool:
    try:
        return isinstance(job_strategy(job, file, label)[1], HolonomicStrategy)
    except HolokinError:  # one that cannot be built is none to choose
        return False


def job_strategy(
    job: Job, file: FilePath, label: str | None = None, orientation: str | None = None
) -> tuple[str, Strategy, Vector]:
    """(label, strategy, the posture it begins at) of a job.

    Args:
        label: the strategy's name in the job; by default that of `default_strategy`.
        orientation: one of the job's representations of orientation; by default its first.

    Raises:
        UnknownNameError: no such strategy or orientation.
    """
    _, start, tasks = build_tasks(job, file)
    label = default_strategy(job, file)[0] if label is None else label
    if label not in job.strategies:
        raise UnknownNameError(f"strategy of {file.name}", label, tuple(job.strategies))
    known = tuple(str(task.orientation) for task in tasks)
    if orientation is not None and orientation not in known:
        raise UnknownNameError(f"orientation of {file.name}", orientation, known)
    task = tasks[0 if orientation is None else known.index(orientation)]
    with naming(file, "strategies", label):
        strategy = build_strategy(job, label, task, start, label)
        return label, strategy, build_begin(job.strategies[label], strategy, start)[0]


def exported_strategy(
    name: str,
    job: Job,
    file: FilePath,
    label: str | None = None,
    *,
    orientation: str | None = None,
    prefix: str | None = None,
) -> tuple[Strategy, dict[str, Any]]:
    """A strategy of a job, and what all exports are told of it: its start, its C name, where it comes from.

    Raises:
        as `job_strategy`.
    """
    label, strategy, start = job_strategy(job, file, label, orientation)
    short = c_name(f"{strategy.task.robot.name}_{label}") if prefix is None else prefix
    return strategy, {"q0": start, "name": short, "origin": f"the job {name}, strategy {label}"}


# --- A strategy of a job as a robot program: followed, timed, and written in a controller's language.

SAME_TIME = 1e-9  # share of a path's duration by which a motion over sheets may be longer and have the path's own times


def program_of_job(
    name: str,
    job: Job,
    file: FilePath,
    language: str,
    label: str | None = None,
    *,
    short: str | None = None,
    changes: dict[str, Any] | None = None,
) -> tuple[Program, TimedTrajectory, CheckReport | None]:
    """(program, the timed motion, what the job's [checks] find of it) of a strategy of a job, with its cycles.

    Args:
        language: one of LANGUAGES.
        label: the strategy's name in the job; by default that of `default_strategy`.
        short: the program's name; by default robot and strategy.
        changes: keys of [timing] to take instead of the job's.

    Raises:
        as `job_strategy`, `follow`, `retime`, `check` and the writer; ArgumentError: limits are missing.
    """
    label, strategy, start = job_strategy(job, file, label)
    timing = _timing_of(job, changes)
    with naming(file, "path"):
        path = build_paths(job.only_path, strategy.task, start, file)
        entry = build_entry(job, strategy, path, start)
    trajectory = follow(strategy, path, entry.q0, samples=job.only_path.samples, cycles=job.only_path.cycles)
    timed = entry.before(timing.timed(trajectory), timing)
    report = _report(job, file, timed, strategy.task)
    short = short or _word(f"{strategy.task.robot.name}_{label}", LANGUAGES[language].longest)
    about = f"Job {name}: {strategy.name} on {strategy.task.robot.name}, {job.title}"
    return _written(job, file, language, strategy.task, path, timed, short, about), timed, report


def program_of_paths(
    name: str,
    job: Job,
    file: FilePath,
    language: str,
    label: str | None = None,
    *,
    short: str | None = None,
    changes: dict[str, Any] | None = None,
    progress: Callable[[str], None] = lambda _text: None,
) -> tuple[Program, PathsPlan]:
    """(program, plan) of a job of several paths: a procedure for each, with the way to it, and a main program.

    Args:
        language, label, short, changes: as of `program_of_job`. progress: hears what is going on.

    Raises:
        as `plan_paths` and the writer.
    """
    label, _, _ = job_strategy(job, file, label)
    plan = plan_paths(job, file, label, progress, _timing_of(job, changes))
    return program_of_plan(plan, name, job, file, language, short), plan


def program_of_plan(
    plan: PathsPlan, name: str, job: Job, file: FilePath, language: str, short: str | None = None
) -> Program:
    """The program of a plan that was made, see `program_of_paths`. Raises: ArgumentError, and as the writer."""
    task, longest = plan.paths[0].strategy.task, LANGUAGES[language].longest
    # A name for each procedure: what languages hold, and none twice, whatever its capitals.
    main = short or _word(f"{task.robot.name}_{plan.name}", longest)
    checked_name(main, longest, next((known for known in LANGUAGE_WORDS if known.lower() == language), language))
    stages: list[tuple[str, PlannedPath | None, TimedTrajectory]] = []
    for each in plan.paths:
        way = each.air.timed
        stages.append((each.name, each, each.timed if way is None else with_entry(way, each.timed)))
    if plan.home is not None and plan.home.timed is not None:
        stages.append(("home", None, plan.home.timed))
    used, words = {main.lower()}, []
    for title, _, _ in stages:
        words.append(_procedure(title, longest, used))
    # The procedures, then what calls them.
    programs, notes = [], []
    for word, (title, each, timed) in zip(words, stages, strict=True):
        about = f"Job {name}: {title}, by {plan.name} on {task.robot.name}, {job.title}"
        given = (task, None, None) if each is None else (each.strategy.task, each.table, each.path)
        own, table, path = given
        programs.append(_written(job, file, language, own, path, timed, word, about, table))
        notes += [f"the procedure of {title!r} is {word}"] if word.lower() != title.lower() else []
    facts = [
        f"Job {name}: {plan.name} on {task.robot.name}, {job.title}",
        *textwrap.wrap(plan.sentence.replace(";", ","), 76),
    ]
    facts.append(f"{len(plan.paths)} paths, {plan.timed.duration:.3f} s in all")
    program = with_procedures(language, main, words, programs, facts)
    left = [f"left out: {title}: {why}" for title, why in plan.left_out.items()]
    return replace(program, notes=(*left, plan.sentence, *notes, *program.notes))


def _procedure(title: str, longest: int, used: set[str]) -> str:
    """A name for a path that is a word of no language, and none of those that are used, which it joins."""
    word = _word(unicodedata.normalize("NFKD", title).encode("ascii", "ignore").decode() or "path", longest)
    if any(taken(word, language) for language in LANGUAGE_WORDS) or taken(word, ""):
        word = f"p_{word}"[:longest]
    free, number = word, 1
    while free.lower() in used:
        number += 1
        end = f"_{number}"
        free = word[: longest - len(end)] + end
    used.add(free.lower())
    return free


def program_of_sheets(
    name: str,
    job: Job,
    file: FilePath,
    language: str,
    *,
    short: str | None = None,
    changes: Mapping[str, Any] | None = None,
    progress: Callable[[str], None] = lambda _text: None,
) -> tuple[Program, TimedTrajectory, CheckReport | None]:
    """(program, the timed motion, what the job's [checks] find of it) of a job's path over its sheets, once along it.

    Args:
        language, short, changes: as of `program_of_job`. progress: hears what is going on, as of `sheets`.

    Raises:
        ArgumentError: the job has no [sheets], or several tools. PathError: the path is divided, or
        not served as a whole. As `sheets_of_job`, `retime`, `check` and the writer.
    """
    if job.sheets is None:
        raise ArgumentError("[sheets] of the job", None, "add the table, or give --strategy in place of --sheets")
    # The motion over the sheets: in the times of the path, where the program switches its process on and off.
    timing = _timing_of(job, changes)
    _, start, (task, *_) = build_tasks(job, file)
    with naming(file, "path"):
        path = build_paths(job.only_path, task, start, file)
    sheet_map = sheets_of_job(job, task, start, file, progress)
    progress("sheets: the path")
    motion = path_motion(sheet_map, path, start)
    if motion is None:
        raise ArgumentError("the path of the job", file.name, f"{ONE_TOOL}: give --strategy in place of --sheets")
    trajectory = motion.trajectory
    late = abs(float(trajectory.t[-1]) - path.duration) > SAME_TIME * path.duration
    if late and _process_window(job.only_path, path) is not None:
        cure = "the motion over sheets has times of its own: leave lead_in, lead_out and retract out"
        raise ArgumentError("the leads of [path]", job.only_path.lead_in or job.only_path.lead_out, cure)
    # Timed, checked and written.
    timed = timing.timed(trajectory)
    report = _report(job, file, timed, task)
    used = f"{len({piece.sheet for piece in motion.pieces})} of {len(sheet_map)} sheets"
    about = f"{used} with {motion.changes} change{'' if motion.changes == 1 else 's'} on {task.robot.name}"
    short = short or _word(f"{task.robot.name}_sheets", LANGUAGES[language].longest)
    program = _written(job, file, language, task, path, timed, short, f"Job {name}: {about}, {job.title}")
    notes = [f"over sheets: {motion.sentence}"]
    if not np.allclose(trajectory.q[0], start, atol=1e-6):
        notes.append(f"the motion begins at {posture_text(trajectory.q[0], task.robot.joint_names)}, not at [start]")
    if job.only_path.cycles > 1:
        notes.append(f"the path is gone along once, not {job.only_path.cycles} times: sheets tell no cycles")
    return replace(program, notes=(*program.notes, *notes)), timed, report


def _timing_of(job: Job, changes: Mapping[str, Any] | None) -> TimingTable:
    """[timing] of a job with keys that were given instead. Raises: ArgumentError: limits are missing."""
    table = job.timing.model_dump(exclude_unset=True) if job.timing is not None else {}
    table |= changes or {}
    if table.get("acceleration") is None and table.get("profile") != "quintic":
        cure = "give --acceleration, or a table [timing] in the job"
        raise ArgumentError("the acceleration of the joints", None, cure)
    return filled(TimingTable, "timing", table)


def _report(job: Job, file: FilePath, timed: TimedTrajectory, task: Task) -> CheckReport | None:
    """What the job's [checks] find of a timed motion, None in a job without. Raises: JobError, as `check`."""
    if job.checks is None:
        return None
    with naming(file, "checks"):
        return job.checks.checked(timed, task)


def _written(
    job: Job,
    file: FilePath,
    language: str,
    task: Task,
    path: AnyPath | None,
    timed: TimedTrajectory,
    name: str,
    about: str,
    own: PathTable | None = None,
) -> Program:
    """The program of a timed motion by the writer of a language, of the keys of [program] that it takes.

    Args:
        path: None of a way through the air, which has no process. own: the table of a path, where the job has several.
    """
    writer, table = LANGUAGES[language], job.program or ProgramTable()
    speeds = task.robot.max_velocity
    with naming(file, "program"):
        arguments = table.given(task, timed.dt in writer.streams) | {
            "name": name,
            "about": about,
            "lines": _lines(job, table, path, own),
            "speeds": speeds.tolist() if np.isfinite(speeds).all() else None,
        }
        for key in writer.needs:
            if key not in arguments:
                raise ArgumentError(f"{key} of [program]", None, f"{language} needs it: add it to [program]")
        if table.linear and "tool" in writer.takes and table.tool is None:
            cure = "linear moves lead the tool that the controller has: give its name or number, or that of the flange"
            raise ArgumentError("tool of [program]", None, cure)
        for key, kind in get_type_hints(writer.write).items():
            if key in ("tool", "base", "payload") and arguments.get(key) is not None:
                named = _CALLED.get(kind, "")
                check(key, kind, arguments[key], named and f": {language} knows it by {named}")
        program = writer.write(timed, **{key: value for key, value in arguments.items() if key in writer.takes})
    given = [key for key in ProgramTable.model_fields if key in table.model_fields_set]
    unused = [key for key in given if ARGUMENT_OF.get(key, key) not in writer.takes]
    notes = (f"{language} takes no {' and no '.join(unused)} of [program]: left out",) if unused else ()
    return replace(program, notes=(*notes, *program.notes))


_CALLED = {str: "its name", str | None: "its name", int: "its number", int | None: "its number"}
"""How a language calls tools, frames and loads."""


def _lines(job: Job, table: ProgramTable, path: AnyPath | None, own: PathTable | None) -> ProcessLines:
    """The lines of the process along a path; none on a way through the air."""
    if path is None:
        return ProcessLines()
    return table.lines(_process_window(own or job.only_path, path), own)


def _process_window(table: PathTable, path: AnyPath) -> tuple[float, float] | None:
    """The path's times at which its lead in ends and its lead out begins [s]; None where it has none."""
    leads = [bool(length) + bool(table.retract) for length in (table.lead_in, table.lead_out)]
    if not isinstance(path, Path) or not any(leads):
        return None
    return float(path.durations[: leads[0]].sum()), float(path.durations[: len(path.durations) - leads[1]].sum())


def _word(text: str, longest: int) -> str:
    """A name of letters, digits and underscores."""
    letters = "".join(c if c.isalnum() else "_" for c in ascii_text(text))
    letters = letters if letters[:1].isalpha() else f"p_{letters}"
    return letters[:longest].rstrip("_")
