"""[sheets] of a job: its map, searched for or read from a file, and the motion along the job's path on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

from ...analysis.sheets import SheetMotion, Sheets, sheets
from ...base.errors import JobError
from ...base.types import Vector
from ...path import Path
from ...path.synchronized_paths import AnyPath
from ...robot import Robot
from ...strategies.tasks.task import Task
from ..report.sheets_result import SheetsResult
from .check_tables import ChecksTable
from .cover_strategies import workspace_of_job
from .job_parts import naming
from .saved_sheets import read_sheets
from .schema import Job, SheetsTable

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
        return read_sheets(place, task, **kept_clear(job.checks, task.robot))


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
        around = kept_clear(job.checks, task.robot)
        return sheets(task, space, say=lambda text: say(f"sheets: {text}"), **searched(job.sheets), **around)


def sheets_result(
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


def kept_clear(checks: ChecksTable | None, robot: Robot) -> dict[str, Any]:
    """What [checks] ask to keep clear of, as arguments of `sheets` and `read_sheets`."""
    if checks is None:
        return {}
    return {key: value for key, value in checks.proven(robot).items() if key != "limits"}
