"""Surveys: the same questions asked of many robots, starts, loops and strategies; resumable.

Uses `app/job` and `motion/control`. Read first: `survey_file.py`, `one_case.py`.
"""

from .findings import (
    Findings,
    boxes_figure,
    coverage_figure,
    drift_figure,
    repeated,
    survival_figure,
    write_survey_report,
)
from .resumable_run import Progress, run_survey, survey
from .store import Store, repeat
from .survey_file import SurveyTable, read_survey, survey_of

__all__ = [
    "Findings",
    "Progress",
    "Store",
    "SurveyTable",
    "boxes_figure",
    "coverage_figure",
    "drift_figure",
    "read_survey",
    "repeat",
    "repeated",
    "run_survey",
    "survey",
    "survey_of",
    "survival_figure",
    "write_survey_report",
]
