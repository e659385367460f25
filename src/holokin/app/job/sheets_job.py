"""What `holokin sheets` does, of a robot or a job."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path as FilePath
from typing import Any

from ...analysis.coverage.starts import first_start, proposed_workspace
from ...analysis.sheets import sheets, write_sheets
from ...base.errors import ArgumentError, JobError
from ..report.job_result import SheetsResult
from .advice_job import Question
from .job_parts import build_paths
from .runner import sheets_result
from .schema import SheetsTable, job_of
from .tables import filled


def sheets_command(
    name: str,
    asked: Question,
    out: FilePath | None,
    options: Mapping[str, Any],
    progress: Callable[[str], None],
    announce: Callable[[str], None],
) -> tuple[SheetsResult, FilePath]:
    """(the sheets of a robot or a job with the motion along the job's path, the file to which they were written).

    Args:
        out: by default the file that the job's [sheets] name, or one called after the robot or the job.
        options: keys of [sheets] that were typed; they go before those of the job.

    Raises:
        WriteError, JobError: the file exists; said before anything is looked at. As `sheets`.
    """
    table = filled(SheetsTable, "sheets", {**asked.keys.get("sheets", {}), **options})
    file = out or FilePath(f"sheets-{FilePath(name).stem}.npz")
    if out is None and table.file is not None and asked.file is not None:
        file = asked.file.parent / table.file
    if file.suffix != ".npz":
        raise ArgumentError("--out", str(file), "give a name that ends in .npz")
    if os.path.lexists(file):
        raise JobError(file, "--out", "exists already", "choose another name, or delete it first")
    space = asked.workspace
    if space is None:
        space = proposed_workspace(asked.task, first_start(asked.task) if asked.q0 is None else asked.q0)
    announce(f"{asked.chain}: {space}. This takes up to {table.seconds + 60:.0f} s.")
    search = table.model_dump(exclude={"file"})
    sheet_map = sheets(asked.task, space, scene=asked.scene, progress=progress, **search)
    write_sheets(sheet_map, file)
    job = None if asked.file is None else job_of(asked.file, dict(asked.keys))
    if job is None or job.paths or asked.q0 is None or asked.file is None:
        return SheetsResult(sheet_map, table.share), file
    path = build_paths(job.only_path, asked.task, asked.q0, asked.file)
    return sheets_result(sheet_map, table.share, path, asked.q0), file
