"""Reading a survey file: what is wrong with it becomes a sentence that names file, key, value and cure."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

from ..job.read import Form
from ..job.robot_tables import RobotTable
from ..job.task_tables import TaskTable
from .laws import OF_A_JOB, OWN_KINDS
from .tables import LoopTable, StartsTable, SurveyTable, WithoutTable

KINDS = {
    str(word): model for model in (*OF_A_JOB, *OWN_KINDS) for word in get_args(model.model_fields["kind"].annotation)
}
"""Every kind of law that a survey may hold, and its model."""

_SURVEY = Form(
    SurveyTable,
    "laws",
    KINDS,
    {"starts": StartsTable, "loops": LoopTable, "robots": RobotTable, "tasks": TaskTable, "without": WithoutTable},
)


def read_survey(path: Path) -> SurveyTable:
    """A survey from a TOML file. Raises: JobError naming file, key, value and cure."""
    return _SURVEY.read(path)


def survey_of(content: dict[str, object], name: str) -> SurveyTable:
    """A survey from its content. Raises: JobError."""
    return _SURVEY.checked(Path(name), dict(content))
