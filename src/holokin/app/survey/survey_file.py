"""Reading a survey file: what is wrong with it becomes a sentence that names file, key, value and cure."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from ...base.errors import JobError, closest
from ..job.job_file import Form, dotted
from ..job.table_values import by_kind
from .survey_laws import OF_A_JOB, OWN_KINDS, Given
from .survey_tables import LOOPS, SurveyTable

KINDS = by_kind(model for model in (*OF_A_JOB, *OWN_KINDS) if model is not Given)
"""Every kind of law that a survey may hold, and its model."""


def _no_job(path: Path, table: dict[str, Any]) -> None:
    if "strategies" in table and "laws" not in table:
        raise JobError(path, "strategies", "is of a job, and this no survey", f"run it: holokin run {path}")


def _no_objects(path: Path, table: dict[str, Any]) -> None:
    _no_job(path, table)
    for named, kinds in (("laws", tuple(KINDS)), ("loops", LOOPS)):
        tables = table.get(named)
        for name, one in tables.items() if isinstance(tables, dict) else ():
            if isinstance(one, dict) and one.get("kind") == "given":
                raise JobError(path, dotted((named, name, "kind")), "is 'given'", closest("given", kinds))


_SURVEY = Form(SurveyTable, "laws", KINDS, check=_no_job)


def read_survey(path: Path) -> SurveyTable:
    """A survey from a TOML file. Raises: JobError naming file, key, value and cure."""
    return replace(_SURVEY, check=_no_objects).read(path)


def survey_of(content: dict[str, object], name: str) -> SurveyTable:
    """A survey from its content. Raises: JobError."""
    return _SURVEY.checked(Path(name), dict(content))
