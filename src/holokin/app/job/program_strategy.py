"""A strategy of a job as a robot program: followed, timed, and written in a controller's language."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...base.errors import ArgumentError
from ...export import LANGUAGES, Program
from ...motion import TimedTrajectory, follow
from ...motion.checks import CheckReport
from ...path import Path
from ...path.synchronized_paths import AnyPath
from ...strategies.tasks.task import Task
from .export_strategy import job_strategy
from .job_parts import naming
from .motion_tables import HELD_IN, ProgramTable, TimingTable
from .path_entry import build_entry
from .schema import Job
from .several_paths import build_paths
from .table_values import filled


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
    timing = timing_of(job, changes)
    with naming(file, "path"):
        path = build_paths(job.path, strategy.task, start, file)
        entry = build_entry(job, strategy, path, start)
    robot = strategy.task.robot
    walk = follow(strategy, path, entry.q0, samples=job.path.samples, cycles=job.path.cycles)
    timed = entry.before(timing.timed(walk, robot), timing, robot)
    found = checked(job, file, timed, strategy.task)
    told = label, strategy.name
    return written(name, job, file, language, told, strategy.task, window(job, path), timed, short), timed, found


def timing_of(job: Job, changes: Mapping[str, Any] | None) -> TimingTable:
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
        return job.checks.checked(timed, task.robot, task)


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
