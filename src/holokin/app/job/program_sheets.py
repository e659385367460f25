"""The path of a job over its sheets as a robot program, with the changes of the sheet while the tool rests."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...base.errors import ArgumentError, posture_text
from ...export import Program
from ...motion import TimedTrajectory
from ...motion.checks import CheckReport
from .job_parts import build_tasks, naming
from .program_strategy import checked, timing_of, window, written
from .schema import Job
from .several_paths import build_paths
from .sheets_over_job import ONE_TOOL, path_motion, sheets_of_job

SAME_TIME = 1e-9
"""Share of a path's duration by which a motion over sheets may be longer and still have the path's own times."""


def program_of_sheets(
    name: str, job: Job, file: FilePath, language: str, *, short: str | None = None,
    changes: Mapping[str, Any] | None = None, say: Callable[[str], None] = lambda _text: None,
) -> tuple[Program, TimedTrajectory, CheckReport | None]:  # fmt: skip
    """(program, the timed motion, what the job's [checks] find of it) of a job's path over its sheets, once along it.

    Args:
        language, short, changes: as of `program_of_job`. say: hears what is going on, as of `sheets`.

    Raises:
        ArgumentError: the job has no [sheets], or several tools. DividedPathError: the path is divided, or
        not served as a whole. As `sheets_of_job`, `retime`, `check` and the writer.
    """
    if job.sheets is None:
        raise ArgumentError("[sheets] of the job", None, "add the table, or give --strategy in place of --sheets")
    timing = timing_of(job, changes)
    _, start, tasks = build_tasks(job, file)
    with naming(file, "path"):
        path = build_paths(job.path, tasks[0], start, file)
    found = sheets_of_job(job, tasks[0], start, file, say)
    say("sheets: the path")
    motion = path_motion(found, path, start)
    if motion is None:
        raise ArgumentError("the path of the job", file.name, f"{ONE_TOOL}: give --strategy in place of --sheets")
    walk, way = motion.trajectory, window(job, path)
    if way is not None and abs(float(walk.t[-1]) - path.duration) > SAME_TIME * path.duration:
        cure = "the motion over sheets has times of its own: leave lead_in, lead_out and retract out"
        raise ArgumentError("the leads of [path]", job.path.lead_in or job.path.lead_out, cure)
    timed = timing.timed(walk, tasks[0].robot)
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
