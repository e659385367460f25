"""Surveys: the same questions asked of many robots, starts, loops and laws; resumable, on one machine or several.

Uses `job` and `control_laws`. Read first: `survey_tables.py`, `one_case.py`, `resumable_run.py`.
"""

from .findings import Findings
from .repeated_case import repeat
from .resumable_run import Progress, run_survey
from .store import Store
from .survey_call import survey
from .survey_figures import boxes_figure, coverage_figure, drift_figure, status_figure, survival_figure
from .survey_file import read_survey, survey_of
from .survey_report import repeated, write_survey_report
from .survey_tables import SurveyTable

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
    "status_figure",
    "survey",
    "survey_of",
    "survival_figure",
    "write_survey_report",
]
