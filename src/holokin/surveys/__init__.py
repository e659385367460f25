"""Surveys: the same questions asked of many robots, starts, loops and laws; resumable, on one machine or several."""

from .figures import boxes_figure, coverage_figure, drift_figure, status_figure, survival_figure
from .findings import Findings
from .reading import read_survey, survey_of
from .repeating import repeat
from .report import repeated, write_survey_report
from .store import Store
from .surveying import Progress, run_survey
from .tables import SurveyTable

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
    "survey_of",
    "survival_figure",
    "write_survey_report",
]
