"""What `holokin sheets` does: of a robot or a job with what is typed beside it."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

from ..covering import SheetMotion, Sheets, sheets, write_sheets
from ..designing.proposed_workspace import first_start, proposed_workspace
from ..errors import ArgumentError, JobError
from ..path import Path
from .advice_question import Question, Typed, question
from .check_tables import ChecksTable
from .job_file import job_of
from .schema import SheetsTable
from .several_paths import build_paths
from .table_values import filled


def sheets_command(
    name: str,
    typed: Typed,
    out: FilePath | None,
    options: Mapping[str, Any],
    say: Callable[[str], None],
    announce: Callable[[str], None],
) -> tuple[Sheets, FilePath, float, SheetMotion | None]:
    """(the sheets of a robot or a job, the file to which they were written, the share that was wanted, the motion along
    the path of a job of one tool).

    Args:
        options: keys of [sheets] that were typed; they go before those of the job.

    Raises:
        WriteError, JobError: the file exists; said before anything is looked at. As `sheets` and `question`.
    """
    file = out or FilePath(f"sheets-{FilePath(name).stem}.npz")
    if file.suffix != ".npz":
        raise ArgumentError("--out", str(file), "give a name that ends in .npz")
    if os.path.lexists(file):
        raise JobError(file, "--out", "exists already", "choose another name, or delete it first")
    asked = question(name, typed)
    space = asked.workspace
    if space is None:
        space = proposed_workspace(asked.task, first_start(asked.task) if asked.q0 is None else asked.q0)
    table = filled(SheetsTable, "sheets", {**asked.keys.get("sheets", {}), **options})
    announce(f"{asked.chain}: {space}. This takes up to {table.seconds + 60:.0f} s.")
    found = sheets(asked.task, space, say=say, **table.model_dump(), **_kept_clear(asked))
    write_sheets(found, file)
    return found, file, table.share, None if asked.file is None else _along(found, asked, asked.file)


def _along(found: Sheets, asked: Question, file: FilePath) -> SheetMotion | None:
    """The job's path over the sheets; its tool begins with the rotation that it has at the job's start."""
    if asked.q0 is None:
        return None
    path, _ = build_paths(job_of(file, dict(asked.keys)).path, asked.task, asked.q0, file)
    if not isinstance(path, Path):
        return None
    return found.follow(
        path if path.rotation is not None else replace(path, rotation=asked.task.pose(asked.q0)[:3, :3])
    )


def _kept_clear(asked: Question) -> dict[str, Any]:
    """What [checks] of the job, or of what was typed, asks to keep clear of: arguments of `sheets`."""
    checks = asked.keys.get("checks")
    if not checks:
        return {}
    found = filled(ChecksTable, "checks", checks).proven(asked.task.robot)
    return {key: value for key, value in found.items() if key != "limits"}
